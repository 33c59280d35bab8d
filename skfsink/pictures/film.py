"""Pictures of a body in space from the series of a run, still and moving, rendered without a display.

They need pyvista, the extra `view`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from PIL import Image

from ..errors import OutputError, choose
from ..results.frame import Frame, frame_file, read_frame
from ..results.loader import Run
from ..system.files import replaced
from .body import View, fastest
from .plot import GAMMA_SCALE, GIF_FRAMES, SPEED_MAP, STYLE, save_gif
from .render import Camera, bounds, render

__all__ = ["FIELDS", "camera_of", "film", "still"]

FIELDS = {"gamma": r"relative density $\gamma$", "speed": "speed of the material (m/s)"}
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
    run: of one analysis of a body in space.
    moment: onset, branching, arrival, end, or the number of a frame.
    field: "gamma", or "speed" of the material.
    width: of the picture [pixels].
    view: azimuth and elevation [degrees]; default that of the case.

    Raises
    ------
    OutputError
        The run is of a plane body, has no such frame, or the file cannot be written.
    ParameterError
        There is no such field.
    MissingExtra
        pyvista is not installed.
    """
    frames = _frames(run, [_number(run, moment)])
    picture = _pictures(run, frames, field, width, view)[0]
    with replaced(path) as part:
        picture.save(part, (Path(path).suffix.lstrip(".") or "png").replace("jpg", "jpeg"))


def film(run: Run, path: str | Path, field: str = "gamma", width: int = 700, seconds: float = 7.0,
         view: View | None = None) -> None:
    """All frames, `GIF_FRAMES` at the most, as an endless GIF of about `seconds`; otherwise as :func:`still`."""
    numbers = np.unique(np.linspace(0, len(run.frames) - 1, min(len(run.frames), GIF_FRAMES)).astype(int)).tolist()
    save_gif(_pictures(run, _frames(run, numbers), field, width, view), path, seconds, 256)


def _number(run: Run, moment: str | int) -> int:
    frames = run.frames
    if isinstance(moment, str) and moment in frames.moments:
        return frames.moments[moment]
    try:
        return range(len(frames))[int(moment)]
    except (ValueError, IndexError):
        raise OutputError(f"{run.folder} has no frame {moment}; it has {', '.join(frames.moments) or 'no moments'}, "
                          f"or 0 to {len(frames) - 1}") from None


def _frames(run: Run, numbers: Sequence[int]) -> list[Frame]:
    if run.scene.sample.space.dim == 2:
        raise OutputError(f"{run.folder} holds a plane body: its pictures are density.png and animation.gif; rendered "
                          "are bodies in space")
    quasistatic = run.analysis == "quasistatic"
    found = []
    for number in numbers:
        time = float(run.frames.times[number])
        run.frames.frame(number)  # says in one line what is missing
        label = f"pass {time:.0f}" if quasistatic else ""
        found.append(read_frame(run.folder / "series" / frame_file("run", number), np.nan if quasistatic else time,
                                label, 3))
    return found


@matplotlib.rc_context(STYLE)
def _pictures(run: Run, frames: Sequence[Frame], field: str, width: int, view: View | None) -> list[Image.Image]:
    """The frames, all at one scale and in one range of colours."""
    choose("field", field, FIELDS)
    space, camera = run.scene.sample.space, camera_of(view or run.scene.view)
    box = bounds(space, frames, camera)
    largest = 1.0 if field == "gamma" else fastest(frames)
    scale = GAMMA_SCALE if field == "gamma" else ScalarMappable(Normalize(0, largest), SPEED_MAP)
    ratio = min(float(np.divide(*(box[1] - box[0])[::-1])), TALLEST)
    figure = Figure((width / DPI, width / DPI * (0.82 * ratio + 0.06)), dpi=DPI)
    canvas = FigureCanvasAgg(figure)
    ax = figure.add_axes((0.01, 0.01, 0.82, 0.99 - 0.06 / (0.82 * ratio + 0.06)))
    bar = figure.add_axes((0.86, 0.12, 0.02, 0.7))
    figure.colorbar(scale, cax=bar, extend="neither" if field == "gamma" else "max").set_label(FIELDS[field])
    ax.set_axis_off()
    images = []
    for frame in frames:
        for artist in list(ax.images):
            artist.remove()
        body = render(space, frame, camera, box, round(0.82 * width), field=field,
                      largest=largest if field == "gamma" else 1e3 * largest)
        ax.imshow(body, extent=(box[0, 0], box[1, 0], box[0, 1], box[1, 1]), interpolation="antialiased")
        ax.set_title(frame.title)
        canvas.draw()
        images.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB"))
    return images
