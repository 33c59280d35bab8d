"""The pictures of a run, drawn from the files it has left."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import meshio
import numpy as np

from .output import History
from .plot import (
    Frame,
    animation,
    comparison_picture,
    density_picture,
    ledger_picture,
    loading_picture,
    speed_picture,
    tip_picture,
)
from .recorder import Recorder
from .scene import Scene

if TYPE_CHECKING:
    from .result import Result

__all__ = ["draw_comparison", "draw_run", "read_frame"]

_WORDS = {"onset": "onset", "branching": "first branches", "arrival": "first arrival", "end": "end"}


def read_frame(path: Path, time: float, label: str, dim: int) -> Frame:
    """A frame of the ParaView series as the fields to draw."""
    data = meshio.read(path)
    u, v = (np.asarray(data.point_data[name], float)[:, :dim] for name in ("displacement", "velocity"))
    return Frame(time, label, u, np.asarray(data.point_data["gamma"], float),
                 np.asarray(data.cell_data["deleted"][0], bool), v)


def draw_run(scene: Scene, folder: Path, recorder: Recorder) -> None:
    """`density.png`, `speed.png` (dynamic), `energies.png`, `tip.png` and `animation.gif` of a finished run."""
    space = scene.sample.space
    quasistatic = scene.controls.analysis == "quasistatic"
    kind = "quasi-static" if quasistatic else f"dynamic, {scene.controls.integrator}"
    title = f"{scene.title}, mesh {scene.sample.name}, {kind}"
    history = History.load(folder / "history.csv")
    if not recorder.frames:
        _draw_loading(scene, folder, recorder)
        return
    frames = [_frame(recorder, i, quasistatic, space.dim) for i in range(len(recorder.frames))]
    keys = sorted(set(recorder.moments.values()))
    if len(keys) < 4:  # too few things happened: add the middle of the event
        keys = sorted({*keys, len(frames) // 2})
    density_picture(space, [frames[k] for k in keys], folder / "density.png", title, scene.view)
    if not quasistatic:
        speed_picture(space, [frames[k] for k in keys], folder / "speed.png", title, scene.view)
    ledger_picture(history, folder / "energies.png", title)
    part = max(scene.parts, key=lambda part: int(frames[-1].deleted[part.elements].sum()))  # where the crack has run
    if len(scene.parts) > 1 and not quasistatic:
        title += f"\n$c_s$, $c_R$ {'in region ' + part.name if part.name else 'outside of the regions'}"
    tip_picture(history, folder / "tip.png", title, np.nan if quasistatic else part.material.shear_wave_speed,
                np.nan if quasistatic else part.material.rayleigh_wave_speed)
    animation(space, frames, folder / "animation.gif", view=scene.view)


def _draw_loading(scene: Scene, folder: Path, recorder: Recorder) -> None:
    """`density.png`, `loading.png` and `animation.gif` of a run that did not fail."""
    space, title = scene.sample.space, f"{scene.title}, mesh {scene.sample.name}: nothing failed"
    frames = [read_frame(recorder.loading_series.frame(i), np.nan, f"load time {time:.4g} s", space.dim)
              for i, (time, _) in enumerate(recorder.loading_frames)]
    keys = sorted({len(frames) // 2, len(frames) - 1})
    density_picture(space, [frames[k] for k in keys], folder / "density.png", title, scene.view)
    loading_picture(History.load(folder / "history.csv"), folder / "loading.png", title)
    animation(space, frames, folder / "animation.gif", view=scene.view)


def _frame(recorder: Recorder, number: int, quasistatic: bool, dim: int) -> Frame:
    time, label = recorder.frames[number]
    word = _WORDS.get(label, label)
    if quasistatic:
        word = ", ".join(filter(None, [word, f"sweep {time:.0f}"]))
    return read_frame(recorder.series.frame(number), np.nan if quasistatic else time, word, dim)


def draw_comparison(dynamic: Result, quasistatic: Result, folder: Path) -> None:
    """`comparison.png`: the dynamic crack beside the quasi-static one, at the end of each."""
    frames = []
    space = dynamic.scene.sample.space
    for part in (dynamic, quasistatic):
        number = part.summary["moments"].get("arrival", part.summary["moments"]["end"])
        frames.append(read_frame(part.folder / "series" / f"run_{number:04d}.vtu", np.nan, "", space.dim))
    comparison_picture(space, frames[0], frames[1], dynamic.history, quasistatic.history, folder / "comparison.png",
                       f"{dynamic.scene.title}, mesh {dynamic.scene.sample.name}", dynamic.scene.view)
