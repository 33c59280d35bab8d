"""The pictures of a run, drawn from the files it has left."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..errors import OutputError
from ..results.fragments import FRAGMENTS, read_fragments
from ..results.frame import Frame, frame_file, read_frame
from ..results.history import History
from ..results.loader import Run, load
from ..results.probes import read_probes
from ..results.result import Result
from ..results.series import frame_times
from ..scene.scene import Scene
from ..system.files import path_of
from .piece_picture import piece_picture
from .plot import (
    animation,
    comparison_picture,
    density_picture,
    ledger_picture,
    loading_picture,
    speed_picture,
    tip_picture,
)
from .probe_curves import probe_picture

__all__ = ["draw_comparison", "draw_run", "picture"]

_WORDS = {"onset": "onset", "branching": "first branches", "arrival": "first arrival", "end": "end"}
FORMATS = (".pdf", ".svg", ".png")  # of pictures that are drawn again


def draw_run(scene: Scene, folder: Path, series: str, moments: Mapping[str, int]) -> None:
    """`density.png`, `speed.png` (dynamic), `energies.png`, `tip.png` and `animation.gif` of a finished run;
    `probes.png` of one with probes, and `fragments.png` of a body that has come apart.

    They are drawn from the files in `folder`. `series` names the one to draw, "run", or "loading" of a body that did
    not fail; `moments` has the numbers of the frames at key moments.
    """
    space = scene.sample.space
    quasistatic = scene.controls.analysis == "quasistatic"
    kind = "quasi-static" if quasistatic else f"dynamic, {scene.controls.integrator}"
    title = f"{scene.title}, mesh {scene.sample.name}, {kind}"
    history = History.load(folder / "history.csv")
    _draw_probes(folder, title, quasistatic)
    if series == "loading":
        _draw_loading(scene, folder)
        return
    labels = {number: _WORDS.get(label, label) for label, number in moments.items()}
    frames = [_frame(folder, number, time, labels.get(number, ""), scene)
              for number, time in enumerate(frame_times(folder / "series" / "run.pvd"))]
    keys = sorted(set(moments.values()))
    if len(keys) < 4:  # too few things happened: add the middle of the event
        keys = sorted({*keys, len(frames) // 2})
    density_picture(space, [frames[k] for k in keys], folder / "density.png", title, scene.view)
    if not quasistatic:
        speed_picture(space, [frames[k] for k in keys], folder / "speed.png", title, scene.view)
    ledger_picture(history, folder / "energies.png", title)
    _draw_pieces(scene, folder, frames[-1], title)
    part = max(scene.parts, key=lambda part: int(frames[-1].deleted[part.elements].sum()))  # where the crack has run
    if len(scene.parts) > 1 and not quasistatic:
        title += f"\n$c_s$, $c_R$ {'in region ' + part.name if part.name else 'outside of the regions'}"
    tip_picture(history, folder / "tip.png", title, np.nan if quasistatic else part.material.shear_wave_speed,
                np.nan if quasistatic else part.material.rayleigh_wave_speed)
    animation(space, frames, folder / "animation.gif", view=scene.view)


def _draw_loading(scene: Scene, folder: Path) -> None:
    """`density.png`, `loading.png` and `animation.gif` of a run that did not fail."""
    space, title = scene.sample.space, f"{scene.title}, mesh {scene.sample.name}: nothing failed"
    frames = [read_frame(folder / "series" / frame_file("loading", i), np.nan, f"load time {time:.4g} s", space.dim)
              for i, time in enumerate(frame_times(folder / "series" / "loading.pvd"))]
    keys = sorted({len(frames) // 2, len(frames) - 1})
    density_picture(space, [frames[k] for k in keys], folder / "density.png", title, scene.view)
    loading_picture(History.load(folder / "history.csv"), folder / "loading.png", title)
    animation(space, frames, folder / "animation.gif", view=scene.view)


def _draw_probes(folder: Path, title: str, quasistatic: bool) -> None:
    """`probes.png`, of a run that has probes."""
    if probes := read_probes(folder):
        probe_picture(probes, folder / "probes.png", title, quasistatic)


def _draw_pieces(scene: Scene, folder: Path, frame: Frame, title: str) -> None:
    """`fragments.png`, of a body that has come apart."""
    rows = read_fragments(folder / FRAGMENTS) if (folder / FRAGMENTS).exists() else {}
    if not rows or len(first := np.flatnonzero(rows["piece"] == 1)) == 0 or rows["piece"][-1] < 2:
        return
    last = {name: values[first[-1]:] for name, values in rows.items()}
    density = np.empty((scene.space.n_elements, 1))
    for part in scene.parts:
        density[part.elements] = part.material.rho0
    piece_picture(scene.space, frame, last, density, folder / "fragments.png", title, scene.view)


def _frame(folder: Path, number: int, time: float, word: str, scene: Scene) -> Frame:
    quasistatic = scene.controls.analysis == "quasistatic"
    if quasistatic:
        word = ", ".join(filter(None, [word, f"pass {time:.0f}"]))
    return read_frame(folder / "series" / frame_file("run", number), np.nan if quasistatic else time, word,
                      scene.sample.space.dim)


def picture(run: Run | str | Path, path: str | Path, title: str | None = None) -> Path:
    """Draw the main picture of a run again, as for a paper: γ on the deformed body at the key moments, or of
    `analysis="both"` both analyses with their energies.

    Parameters
    ----------
    run: a run or its folder.
    path: of the picture; its suffix is the format: ".pdf", ".svg", ".png".
    title: above it; left out: that of the run, "" for none.

    Returns
    -------
    The path.

    Raises
    ------
    OutputError
        The folder holds no finished run, or the format is unknown.
    """
    run, path = run if isinstance(run, Run) else load(run), path_of("path", path)
    if not all(part.finished for part in run.runs):
        raise OutputError(f"the run in {run.folder} is not finished: there is no picture to draw")
    if path.suffix.lower() not in FORMATS:
        raise OutputError(f"a picture is drawn as {', '.join(FORMATS)}; got {path.name}")
    scene = run.scene
    name = f"{scene.title}, mesh {scene.sample.name}" if title is None else title
    if run.parts and all(part.summary["series"] == "run" for part in run.runs):
        _comparison(scene, run.parts["dynamic"], run.parts["quasistatic"], path, name)
    else:
        _density(scene, run.runs[0], path, name)
    return path


def _density(scene: Scene, run: Run, path: Path, title: str) -> None:
    words = {number: _WORDS.get(label, label) for label, number in run.frames.moments.items()}
    loading, keys = run.frames.name == "loading", sorted(words) or [len(run.frames) - 1]
    quasistatic = run.analysis == "quasistatic" and not loading
    shown = [read_frame(run.folder / "series" / frame_file(run.frames.name, i),
                        np.nan if quasistatic or loading else run.frames.times[i],
                        f"load time {run.frames.times[i]:.4g} s" if loading else words[i], scene.space.dim)
             for i in keys]
    density_picture(scene.space, shown, path, title, scene.view)


def draw_comparison(dynamic: Result, quasistatic: Result, folder: Path) -> None:
    """`comparison.png`: the dynamic crack beside the quasi-static one, at the end of each."""
    _comparison(dynamic.scene, dynamic, quasistatic, folder / "comparison.png",
                f"{dynamic.scene.title}, mesh {dynamic.scene.sample.name}")


def _comparison(scene: Scene, dynamic: Run, quasistatic: Run, path: Path, title: str) -> None:
    frames, space = [], scene.sample.space
    for part in (dynamic, quasistatic):
        number = part.summary["moments"].get("arrival", part.summary["moments"]["end"])
        frames.append(read_frame(part.folder / "series" / frame_file("run", number), np.nan, "", space.dim))
    comparison_picture(space, frames[0], frames[1], dynamic.history, quasistatic.history, path, title=title,
                       view=scene.view)
