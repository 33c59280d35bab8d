"""Pictures of any field on the deformed body from the series of a run, still and moving.

Plane bodies are drawn with axes; bodies in space are rendered without a display, which needs pyvista, the extra `view`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from ..errors import OutputError, choose
from ..results.frame import Frame
from ..results.loader import Run
from ..results.loading import loaded_in
from ..results.stored_series import StoredSeries
from ..system.files import replaced
from .body import View
from .field_picture import field_picture
from .looks import FIELDS, cells_of, nodal, scale_of
from .moving import FILMS, drawn, few, save_film
from .plot import STYLE
from .render import Camera, bounds, render

__all__ = ["FIELDS", "PHASES", "camera_of", "film", "still"]

PHASES = ("event", "loading", "all")
VECTORS = (".pdf", ".svg")  # formats of a still of a plane body that keep lines and letters
TALLEST = 1.5   # height of a picture over its width, at the most
DPI = 150


def camera_of(view: View) -> Camera:
    """The camera at an azimuth and an elevation [degrees], z up."""
    (ca, ce), (sa, se) = np.cos(np.radians(view)), np.sin(np.radians(view))
    return Camera((float(ca * ce), float(sa * ce), float(se)), (0.0, 0.0, 1.0))


def still(run: Run, path: str | Path, moment: str | int = "end", field: str = "gamma", width: int = 1200,
          view: View | None = None) -> None:
    """A picture of the deformed body, cut open along the crack; the suffix of `path` decides on the format.

    Parameters
    ----------
    run: of one analysis.
    moment: onset, branching, arrival, end, or the number of a frame of the event.
    field: one of :data:`.looks.FIELDS`.
    width: of the picture [pixels]; without a meaning for a plane body as .pdf or .svg.
    view: azimuth and elevation [degrees] of a body in space; default that of the case.

    Raises
    ------
    OutputError
        The run has no such frame, its frames have not that field, or the file cannot be written.
    ParameterError
        There is no such field.
    MissingExtra
        The body is one in space, and pyvista is not installed.
    """
    cells, number = cells_of(field), _number(run, moment)
    frame = _read(run, run.frames.stored, [number], cells)[0]
    kind = Path(path).suffix.lower()
    if run.scene.space.dim == 2 and kind in VECTORS:
        field_picture(run.scene.space, [frame], field, path)
        return
    picture = _pictures(run, [frame], field, width, view)[0]
    with replaced(path) as part:
        picture.save(part, (kind.lstrip(".") or "png").replace("jpg", "jpeg"))


def film(run: Run, path: str | Path, field: str = "gamma", width: int = 700, seconds: float = 7.0,
         view: View | None = None, phase: str = "event") -> None:
    """All frames as a film of about `seconds`; otherwise as :func:`still`.

    `path` ends in .gif, which is endless and of 40 frames at the most, or in .mp4, which needs imageio-ffmpeg (the
    extra `view`). `phase` is "event", "loading" (what has led to the onset) or "all", the one after the other.

    Raises
    ------
    OutputError
        As :func:`still`; or there are no frames of that phase, or the suffix is another one.
    """
    choose("phase", phase, PHASES)
    cells, suffix = cells_of(field), Path(path).suffix.lower()
    if suffix not in FILMS:
        raise OutputError(f"a film is a file ending in {' or '.join(FILMS)}; got {path}")
    series = []
    if phase != "event" and run.frames.name != "loading":
        series.append(StoredSeries.of(loaded_in(run.folder) / "series", "loading"))
    if phase != "loading" or run.frames.name == "loading":
        series.append(run.frames.stored)
    places = [(one, number) for one in series for number in range(len(one))]
    if not places:
        raise OutputError(f"{run.folder} has no frames of the {phase if phase != 'all' else 'run'}")
    if suffix == ".gif":
        places = [places[i] for i in few(len(places))]
    frames = [frame for one in series
              for frame in _read(run, one, [number for there, number in places if there is one], cells)]
    save_film(_pictures(run, frames, field, width, view), path, seconds)


def _number(run: Run, moment: str | int) -> int:
    frames = run.frames
    if isinstance(moment, str) and moment in frames.moments:
        return frames.moments[moment]
    if moment == "end" and not run.finished and len(frames):
        return len(frames) - 1
    try:
        return range(len(frames))[int(moment)]
    except (ValueError, IndexError):
        raise OutputError(f"{run.folder} has no frame {moment}; it has {', '.join(frames.moments) or 'no moments'}, "
                          f"or 0 to {len(frames) - 1}") from None


def _read(run: Run, series: StoredSeries, numbers: Sequence[int], cells: Sequence[str]) -> list[Frame]:
    """Frames of a series with their labels: those of the loading have the load time, passes their number."""
    found, dim = [], run.scene.space.dim
    for number in numbers:
        time = float(series.times[number])
        label = (f"load time {time:.4g} s" if series.name == "loading" else
                 f"pass {time:.0f}" if run.analysis == "quasistatic" else "")
        found.append(series.frame(number, np.nan if label else time, label, dim, cells))
    return found


def _pictures(run: Run, frames: Sequence[Frame], field: str, width: int, view: View | None) -> list[Image.Image]:
    """The frames, all at one scale and in one range of colours."""
    space = run.scene.space
    if space.dim == 2:
        return [*drawn(space, frames, field, width=width)]
    return _rendered(run, frames, field, width, view)


@matplotlib.rc_context(STYLE)
def _rendered(run: Run, frames: Sequence[Frame], field: str, width: int, view: View | None) -> list[Image.Image]:
    space, camera = run.scene.space, camera_of(view or run.scene.view)
    box = bounds(space, frames, camera)
    values = [nodal(space, frame, field) for frame in frames]
    scale = scale_of(space, frames, values, field)
    ratio = min(float(np.divide(*(box[1] - box[0])[::-1])), TALLEST)
    figure = Figure((width / DPI, width / DPI * (0.82 * ratio + 0.06)), dpi=DPI)
    canvas = FigureCanvasAgg(figure)
    ax = figure.add_axes((0.01, 0.01, 0.82, 0.99 - 0.06 / (0.82 * ratio + 0.06)))
    bar = figure.add_axes((0.86, 0.12, 0.02, 0.7))
    figure.colorbar(scale.colours, cax=bar, extend=scale.extend).set_label(scale.label)
    ax.set_axis_off()
    images = []
    for frame, value in zip(frames, values):
        for artist in list(ax.images):
            artist.remove()
        body = render(space, frame, camera, box, round(0.82 * width), field="value", values=value,
                      least=scale.limits[0], largest=scale.limits[1], colours=scale.map)
        ax.imshow(body, extent=(box[0, 0], box[1, 0], box[0, 1], box[1, 1]), interpolation="antialiased")
        ax.set_title(frame.title)
        canvas.draw()
        images.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB"))
    return images
