"""Moving pictures: a field on the deformed body at all its frames, as a GIF or an MP4."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from ..errors import MissingExtra, OutputError
from ..fem.space import Space
from ..results.frame import Frame
from ..system.files import replaced, write_atomic
from . import body as deformed
from .body import OBLIQUE, View
from .looks import nodal, scale_of
from .plot import STYLE, draw_bodies, draw_body

__all__ = ["FILMS", "GIF_FRAMES", "animation", "drawn", "few", "save_film", "save_gif"]

GIF_FRAMES = 40     # at the most, less than 3 MB
FILMS = (".gif", ".mp4")
LAST = 6            # times as long as the others the last picture stays
_SIZE, _DPI = 3.6, 120  # of the taller side of the body [in], dots per inch


def animation(space: Space, frames: Sequence[Frame], path: str | Path, seconds: float = 7.0,
              view: View = OBLIQUE) -> None:
    """Relative density on the deformed body as an endless GIF of about `seconds`, of `GIF_FRAMES` at the most."""
    save_gif([*drawn(space, [frames[i] for i in few(len(frames))], "gamma", view)], path, seconds)


def few(n: int) -> list[int]:
    """Numbers of the frames, of `n`, that a GIF has."""
    found: list[int] = np.unique(np.linspace(0, n - 1, min(n, GIF_FRAMES)).astype(int)).tolist()
    return found


@matplotlib.rc_context(STYLE)
def drawn(space: Space, frames: Sequence[Frame], field: str, view: View = OBLIQUE,
          width: int = 0) -> Iterator[Image.Image]:
    """A picture of each frame, all at one scale and in one range of colours; `width` [pixels], 0 takes the usual one.

    Axes and colour bar are drawn once.
    """
    values = [nodal(space, frame, field) for frame in frames]
    scale = scale_of(space, frames, values, field)
    last, box, ratio = deformed.bodies(space, frames[::-8], view)
    inches = _SIZE / max(1, ratio)
    figure = Figure((inches + 1.3, inches * ratio + 0.75), dpi=width / (inches + 1.3) if width else _DPI,
                    layout="compressed")
    canvas, ax = FigureCanvasAgg(figure), figure.subplots()
    draw_bodies([ax], last[:1], [frames[-1].title], box, scale.colours)
    figure.colorbar(scale.colours, ax=[ax], aspect=25, pad=0.02, shrink=0.8,
                    extend=scale.extend).set_label(scale.label)
    canvas.draw()
    figure.set_layout_engine("none")  # keep this layout for all frames
    rim: list[Any] = [*ax.spines.values(), ax.title] if ax.axison else [ax.title]
    for artist in [*ax.collections]:
        artist.remove()
    for artist in rim:
        artist.set_animated(True)  # drawn over the body
    canvas.draw()
    empty = canvas.copy_from_bbox(figure.bbox)  # type: ignore[attr-defined]
    for frame, value in zip(frames, values):
        canvas.restore_region(empty)  # type: ignore[attr-defined]
        draw_body(ax, deformed.body(space, frame, view, None if field == "gamma" else value), frame.title,
                  scale.colours)
        for artist in [*ax.collections, *rim]:
            ax.draw_artist(artist)
        yield Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
        for artist in [*ax.collections]:
            artist.remove()


def save_film(pictures: Sequence[Image.Image], path: str | Path, seconds: float) -> None:
    """Pictures as a film of about `seconds`; the suffix of the path decides on the format, GIF or MP4.

    Raises
    ------
    OutputError
        The suffix is none of `FILMS`, or the file cannot be written.
    MissingExtra
        An MP4 needs imageio-ffmpeg, which is not installed.
    """
    if (suffix := Path(path).suffix.lower()) not in FILMS:
        raise OutputError(f"a film is a file ending in {' or '.join(FILMS)}; got {path}")
    if suffix == ".gif":
        save_gif(pictures, path, seconds, 256)
    else:
        _save_mp4(pictures, path, seconds)


def _save_mp4(pictures: Sequence[Image.Image], path: str | Path, seconds: float) -> None:
    """H.264, which every browser plays; its pictures have an even number of pixels."""
    try:
        import imageio_ffmpeg
    except ImportError:
        raise MissingExtra('films as MP4 need imageio-ffmpeg: pip install "skfsink[view]", or name a .gif') from None
    size = tuple(2 * (side // 2) for side in pictures[0].size)
    rate = max(1.0, min(50.0, (len(pictures) + LAST) / seconds))
    with replaced(path) as part:
        writer = imageio_ffmpeg.write_frames(
            str(part), size, fps=rate, codec="libx264", quality=None, macro_block_size=2, ffmpeg_log_level="error",
            output_params=["-f", "mp4", "-crf", "18", "-movflags", "+faststart", "-threads", "1"])
        writer.send(None)
        for picture in [*pictures, *[pictures[-1]] * (LAST - 1)]:
            writer.send(np.ascontiguousarray(np.asarray(picture.convert("RGB"))[:size[1], :size[0]]))
        writer.close()


def save_gif(pictures: Sequence[Image.Image], path: str | Path, seconds: float, colours: int = 128) -> None:
    """Pictures as an endless GIF of about `seconds` and so many colours; the last one stays for a while."""
    some = np.concatenate([*map(np.asarray, pictures[::max(1, len(pictures) // 4)])])
    palette = Image.fromarray(some).quantize(colours)
    images = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    duration = [max(20, int(1000 * seconds / (len(pictures) + LAST - 1)))] * len(pictures)
    duration[-1] *= LAST  # the end stays for a while
    file = io.BytesIO()
    images[0].save(file, "GIF", save_all=True, append_images=images[1:], duration=duration, loop=0)
    write_atomic(path, file.getvalue())
