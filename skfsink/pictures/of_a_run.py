"""The pictures of a run, drawn from the files it has left."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..errors import OutputError
from ..fields.frame_fields import asked_fields
from ..results.fragments import FRAGMENTS, read_fragments
from ..results.frame import Frame
from ..results.history import History, Table
from ..results.loader import Run, load
from ..results.loading import way_to_onset
from ..results.probes import read_probes
from ..results.result import Result
from ..results.stored_series import StoredSeries
from ..scene.scene import Scene
from ..system.files import path_of
from .fibre_picture import fibre_picture
from .field_picture import field_picture
from .line_curves import line_picture
from .looks import cells_of
from .moving import animation, few
from .piece_picture import piece_picture
from .plot import comparison_picture, density_picture, ledger_picture, loading_picture, tip_picture
from .probe_curves import probe_picture

__all__ = ["draw_comparison", "draw_run", "draw_what_there_is", "picture"]

WORDS = {"onset": "onset", "branching": "first branches", "arrival": "first arrival", "end": "end"}
LATEST = "last frame"
FORMATS = (".pdf", ".svg", ".png")  # of pictures that are drawn again


def draw_run(scene: Scene, folder: Path, series: str, moments: Mapping[str, int]) -> None:
    """`density`, `speed` (dynamic), `loading`, `energies`, `tip` and `animation.gif` of a run; `probes` and `lines` of
    one with probes, `fibres` of one with fibres, `fragments` of a body that has come apart, and the fields that its
    scene asks for.

    They are drawn from the files in `folder`, in the format that the scene says. `series` names the one to draw, "run",
    or "loading" of a body that did not fail; `moments` has the numbers of the frames at key moments.
    """
    quasistatic = scene.controls.analysis == "quasistatic"
    kind = "quasi-static" if quasistatic else f"dynamic, {scene.controls.integrator}"
    run = _Files(scene, folder, f"{scene.title}, mesh {scene.sample.name}, {kind}", series, moments)
    _draw_probes(run)
    if (fibres := scene.fibres) is not None:
        fibre_picture(scene.space, fibres, run.path("fibres"), f"{scene.title}, mesh {scene.sample.name}", scene.view)
    if series == "loading":
        run.title = f"{scene.title}, mesh {scene.sample.name}: " + (
            "not finished" if LATEST in moments else "nothing failed")
        _draw_loading(run)
        return
    history = History.load(folder / "history.csv")
    keys = run.keys()
    frames = run.frames(keys, run.cells)
    _draw_density(run, frames)
    for name in (*(() if quasistatic else ("speed",)), *run.asked):
        field_picture(scene.space, frames, name, run.path(name), run.title, scene.view)
    loading_picture(way_to_onset(folder), run.path("loading"), run.title, _event(history))
    ledger_picture(history, run.path("energies"), run.title)
    _draw_pieces(run, frames[-1])
    part = max(scene.parts, key=lambda part: int(frames[-1].deleted[part.elements].sum()))  # where the crack has run
    title = run.title
    if len(scene.parts) > 1 and not quasistatic:
        title += f"\n$c_s$, $c_R$ {'in region ' + part.name if part.name else 'outside of the regions'}"
    tip_picture(history, run.path("tip"), title, np.nan if quasistatic else part.material.shear_wave_speed,
                np.nan if quasistatic else part.material.rayleigh_wave_speed)
    animation(scene.space, run.frames(few(len(run.stored))), folder / "animation.gif", view=scene.view)


def draw_what_there_is(scene: Scene, folder: Path, moments: Mapping[str, int]) -> bool:
    """The same of a run that has stopped on its way, up to its last frame; whether there was anything to draw."""
    for series in ("run", "loading"):
        stored = StoredSeries.of(folder / "series", series)
        if len(stored) and (series == "loading" or len(_event(History.load(folder / "history.csv"))["step"]) > 1):
            known = {word: number for word, number in moments.items() if series == "run" and number < len(stored)}
            draw_run(scene, folder, series, {**known, LATEST: len(stored) - 1})
            return True
    return False


@dataclass
class _Files:
    """The files of a run, as they are drawn: `read` keeps the frames that were read."""

    scene: Scene
    folder: Path
    title: str
    series: str
    moments: Mapping[str, int]
    read: dict[int, Frame] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.stored = StoredSeries.of(self.folder / "series", self.series)
        self.asked = asked_fields(self.scene.controls.fields)
        self.cells = [cell for name in self.asked for cell in cells_of(name)]

    def path(self, name: str) -> Path:
        """Of the picture of that name."""
        return self.folder / f"{name}.{self.scene.controls.pictures}"

    def keys(self) -> list[int]:
        """Numbers of the frames at key moments, and of others where too few things have happened."""
        found = set(self.moments.values())
        if len(found) < 4:
            found.add(len(self.stored) // 2)
        return sorted(found)

    def frames(self, numbers: Sequence[int], cells: Sequence[str] = ()) -> list[Frame]:
        """Some frames, with their labels; each is read once."""
        words = WORDS if self.scene.event_at == np.inf else WORDS | {"onset": "start"}  # where nothing has failed yet
        labels = {number: words.get(moment, moment) for moment, number in self.moments.items()}
        quasistatic = self.scene.controls.analysis == "quasistatic"
        for number in numbers:
            if number in self.read:
                continue
            time = self.stored.times[number]
            word = labels.get(number, "")
            if self.series == "loading":
                word, time = f"load time {time:.4g} s", np.nan
            elif quasistatic:
                word, time = ", ".join(filter(None, [word, f"pass {time:.0f}"])), np.nan
            self.read[number] = self.stored.frame(number, time, word, self.scene.space.dim, cells)
        return [self.read[number] for number in numbers]


def _event(history: Table) -> Table:
    rows = history["phase"] == "event"
    return Table({name: values[rows] for name, values in history.items()}, history.dim, history.without)


def _draw_loading(run: _Files) -> None:
    """`density`, `loading`, fields and `animation.gif` of a run that did not fail."""
    scene = run.scene
    frames = run.frames(sorted({len(run.stored) // 2, len(run.stored) - 1}), run.cells)
    _draw_density(run, frames)
    for name in run.asked:
        field_picture(scene.space, frames, name, run.path(name), run.title, scene.view)
    loading_picture(way_to_onset(run.folder), run.path("loading"), run.title)
    animation(scene.space, run.frames(few(len(run.stored))), run.folder / "animation.gif", view=scene.view)


def _draw_density(run: _Files, frames: Sequence[Frame]) -> None:
    """`density`, the main picture of a run: in the format that its scene says, and as PNG, which runs show of
    themselves."""
    for path in dict.fromkeys((run.path("density"), run.folder / "density.png")):
        density_picture(run.scene.space, frames, path, run.title, run.scene.view)


def _draw_probes(run: _Files) -> None:
    """`probes` and `lines`, of a run that has probes."""
    if probes := read_probes(run.folder):
        probe_picture(probes, run.path("probes"), run.title, run.scene.controls.analysis == "quasistatic")
        line_picture(probes, run.path("lines"), run.title)


def _draw_pieces(run: _Files, frame: Frame) -> None:
    """`fragments`, of a body that has come apart."""
    rows = read_fragments(run.folder / FRAGMENTS) if (run.folder / FRAGMENTS).exists() else {}
    if not rows or len(first := np.flatnonzero(rows["piece"] == 1)) == 0 or rows["piece"][-1] < 2:
        return
    scene, last = run.scene, {name: values[first[-1]:] for name, values in rows.items()}
    density = np.empty((scene.space.n_elements, 1))
    for part in scene.parts:
        density[part.elements] = part.material.rho0
    piece_picture(scene.space, frame, last, density, run.path("fragments"), run.title, scene.view)


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
    files = _Files(scene, run.folder, title, run.frames.name, run.frames.moments)
    numbers = sorted(set(files.moments.values())) or [len(files.stored) - 1]
    density_picture(scene.space, files.frames(numbers), path, title, scene.view)


def draw_comparison(dynamic: Result, quasistatic: Result, folder: Path) -> None:
    """`comparison`: the dynamic crack beside the quasi-static one, at the end of each; as PNG in any case."""
    scene = dynamic.scene
    for path in dict.fromkeys((folder / f"comparison.{scene.controls.pictures}", folder / "comparison.png")):
        _comparison(scene, dynamic, quasistatic, path, f"{scene.title}, mesh {scene.sample.name}")


def _comparison(scene: Scene, dynamic: Run, quasistatic: Run, path: Path, title: str) -> None:
    frames, space = [], scene.sample.space
    for part in (dynamic, quasistatic):
        number = part.summary["moments"].get("arrival", part.summary["moments"]["end"])
        frames.append(StoredSeries.of(part.folder / "series", "run").frame(number, np.nan, "", space.dim))
    comparison_picture(space, frames[0], frames[1], dynamic.history, quasistatic.history, path, title=title,
                       view=scene.view)
