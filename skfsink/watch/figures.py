"""What the page draws of runs: the body now, loading, tip, energies, in the words of the report."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from ..errors import OutputError
from ..pictures.plot import density_picture, ledger_picture, tip_picture
from ..report.charts import Chart, energy_chart, loading_chart, speed_chart
from ..report.scenes import wave_speeds
from ..results.frame import Frame, frame_of
from ..results.history import Table
from ..results.loader import Frames, Run
from ..results.stored_series import PACKED, series_index
from ..scene.scene import Scene
from ..scene.stored import SCENE
from .drawn import Drawn
from .seen import Seen, stamp_of

__all__ = ["Figure", "Scenes", "joint_figures", "own_figures"]

SVG, PNG = "image/svg+xml", "image/png"


@dataclass(frozen=True)
class Figure:
    """A picture that the page may show.

    Attributes
    ----------
    name: in its address.   title: of its place on the page.
    alt: words for it before it is drawn.
    stamp: what changes when it is to be drawn anew.
    draw: draws it.
    """

    name: str
    title: str
    alt: str
    stamp: Hashable
    draw: Callable[[], Drawn]


class Scenes:
    """Scenes and wave speeds of runs, which take long to make, and do not change while a run goes on.

    Memory: those so far, by folder and state of `scene.toml`: `scene` and `waves` make each once.
    """

    def __init__(self) -> None:
        self._scenes: dict[Hashable, Scene] = {}
        self._waves: dict[Hashable, tuple[float, float] | None] = {}

    def scene(self, run: Run) -> Scene:
        """The scene of a run."""
        key = (run.folder, stamp_of(run.folder / SCENE))
        if key not in self._scenes:
            self._scenes[key] = run.scene
        return self._scenes[key]

    def waves(self, run: Run) -> tuple[float, float] | None:
        """Wave speeds of a run; see :func:`.wave_speeds`."""
        key = (run.folder, stamp_of(run.folder / SCENE))
        if key not in self._waves:
            self._waves[key] = wave_speeds(run)
        return self._waves[key]


# --- pictures of one run ---
def own_figures(key: int, seen: Seen, scenes: Scenes) -> list[Figure]:
    """The pictures of one run, as far as it has come."""
    run, history, lead = seen.run, seen.history, f"{seen.place.label}: "
    if run is None:
        return []
    found = []
    for name in ("run", "loading"):
        index = series_index(run.folder / "series", name)
        if index.is_file() and (index.suffix == PACKED or b"<DataSet" in index.read_bytes()):
            alt = lead + "relative density γ on the deformed body"
            found.append(Figure(f"density-{key}.png", "Relative density", alt, (name, stamp_of(index)),
                                partial(_density, run, name, scenes, alt)))
            break
    rows = 0 if history is None else int((history["phase"] == "event").sum())
    if history is not None and rows > 1:
        alt = lead + "length of the crack, position and speed of its leading tip, and branches"
        found.append(Figure(f"tip-{key}.svg", "Tip of the crack", alt, rows, partial(_tip, run, history, scenes, alt)))
        alt = lead + "where the energy of the event is over time, stacked, and what does not add up"
        found.append(Figure(f"energies-{key}.svg", "Energy ledger", alt, rows, partial(_ledger, history, alt)))
    return found


def _density(run: Run, name: str, scenes: Scenes, alt: str) -> Drawn:
    """The body at the newest frame that can be read: the last one may be torn."""
    frames, scene = Frames(run.folder / "series", {}, name), scenes.scene(run)
    for number in range(len(frames) - 1, -1, -1):
        try:
            data = frames.frame(number)
        except OutputError:
            if number == max(0, len(frames) - 3):
                raise
            continue
        time = float(frames.times[number])
        label = (f"load time {time:.4g} s" if name == "loading" else
                 f"pass {time:.0f}" if run.analysis == "quasistatic" else "")
        frame = frame_of(data, np.nan if label else time, label, scene.sample.space.dim)
        content = _written(".png", partial(_draw_density, scene, frame))
        return Drawn(PNG, content, f"{alt} at {frame.title}")
    raise OutputError(f"{run.folder} has no frame yet")


def _draw_density(scene: Scene, frame: Frame, path: Path) -> None:
    density_picture(scene.sample.space, [frame], path, "", scene.view)


def _tip(run: Run, history: Table, scenes: Scenes, alt: str) -> Drawn:
    c_s, c_R = scenes.waves(run) or (np.nan, np.nan)
    return Drawn(SVG, _written(".svg", lambda path: tip_picture(history, path, "", c_s, c_R)), alt)


def _ledger(history: Table, alt: str) -> Drawn:
    return Drawn(SVG, _written(".svg", lambda path: ledger_picture(history, path, "")), alt)


def _written(suffix: str, draw: Callable[[Path], None]) -> bytes:
    """What a picture's function writes, in a folder that is gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="skfsink-watch-") as folder:
        draw(path := Path(folder) / f"picture{suffix}")
        return path.read_bytes()


# --- curves of all runs ---
def joint_figures(shown: Sequence[Seen], scenes: Scenes) -> list[Figure]:
    """The curves of the report, of the runs that are shown, as far as these have come."""
    runs = [seen.run for seen in shown if seen.run is not None and seen.history is not None]
    if not runs:
        return []
    labels = [seen.place.label for seen in shown if seen.run is not None and seen.history is not None]
    stamp = tuple((run.folder, len(run.history["step"]), run.finished) for run in runs)
    found = []
    if any((run.history["phase"] == "loading").sum() > 1 for run in runs):
        found.append(Figure("loading.svg", "Loading", "Load over displacement up to the onset", stamp,
                            lambda: _chart(loading_chart(runs, labels))))
    if any(run.analysis == "dynamic" and np.isfinite(run.event["tip_speed_m_per_s"]).sum() > 1 for run in runs):
        found.append(Figure("speed.svg", "Speed of the tip", "Speed of the leading tip over time", stamp,
                            lambda: _chart(speed_chart(runs, labels, [scenes.waves(run) for run in runs]))))
    if any(np.nanmax(run.event["crack_length_mm"], initial=0.0) > 0 for run in runs):
        title = "Energies over the length of the crack"
        found.append(Figure("crack.svg", title, "U and D over the length of the crack", stamp,
                            lambda: _chart(energy_chart(runs, labels))))
    return found


def _chart(chart: Chart | None) -> Drawn:
    if chart is None:
        raise OutputError("there is nothing to draw yet")
    return Drawn(SVG, chart.svg, chart.alt)
