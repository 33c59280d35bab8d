"""What the figures share: the page, lettered panels, densities on the deformed body, and the command line."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

import matplotlib
import numpy as np
from cyclopts import App
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from skfsink.errors import SkfsinkError
from skfsink.pictures import body as deformed
from skfsink.pictures import plot
from skfsink.results.reference import Reference
from skfsink.system.files import write_atomic

__all__ = ["ANALYSES", "BLUE", "DPI", "RED", "WIDTH", "Panel", "densities", "dissipation", "legend", "microseconds",
           "save", "script", "start", "title"]

WIDTH, DPI = plot.WIDTH, plot.DPI
LARGEST = 950_000  # of a file [bytes]
RED, BLUE = "#a63d40", "#33658a"
ANALYSES = {"dynamic": ("dynamic", RED), "quasistatic": ("quasi-static", BLUE)}  # as called, and coloured
Panel = tuple[Reference, deformed.Frame, str]  # what is drawn, and the words above it
HERE = Path(__file__).resolve().parent


def title(ax: Axes, letter: str, text: str) -> None:
    """The letter of a panel and what it shows, above its left end."""
    ax.set_title(f"({letter}) {text}", loc="left")


def microseconds(frame: deformed.Frame) -> str:
    """Time of a frame since the onset."""
    return f"{frame.time * 1e6:.0f} µs"


def densities(axes: Sequence[Axes], panels: Sequence[Panel], letters: str) -> None:
    """Gamma on plane bodies as they are deformed, at one scale, with axes in mm."""
    drawn = [deformed.body(ref.space, frame, deformed.OBLIQUE) for ref, frame, _ in panels]
    box = np.array([np.min([b.box[0] for b in drawn], axis=0), np.max([b.box[1] for b in drawn], axis=0)])
    box += 0.02 * np.ptp(box, axis=0).max() * np.array([[-1], [1]])
    for ax, body, letter, (_, _, text) in zip(axes, drawn, letters, panels, strict=True):
        plot.draw_body(ax, body, "")
        title(ax, letter, text)
        ax.set(xlim=box[:, 0], ylim=box[:, 1], aspect="equal", xlabel="$x$ (mm)", ylabel="$y$ (mm)")
        ax.locator_params(nbins=5)


def dissipation(ax: Axes, dynamic: Reference, quasistatic: Reference, printed: dict[str, float]) -> None:
    """U against the length of the crack in both analyses, and U as the paper prints it."""
    for ref, name, colour in ((dynamic, "dynamic", RED), (quasistatic, "quasi-static", BLUE)):
        event = ref.history["phase"] == "event"
        length = np.maximum.accumulate(ref.history["crack_length_mm"][event])
        ax.plot(length, ref.history["U_paper"][event], color=colour, label=name)
        if (value := printed.get(ref.summary["analysis"])) is not None:
            ax.axhline(value, color=colour, linestyle="--", linewidth=0.8, label=f"paper, {name}")
    ax.set(xlabel="crack length (mm)", ylabel="dissipated energy $U$ (N mm/mm)", xlim=(0, None), ylim=(0, None),
           box_aspect=1)
    ax.set_ylim(0, 1.45 * ax.get_ylim()[1])  # room for the legend
    ax.legend(loc="upper left")


def legend(figure: Figure, columns: int) -> None:
    """One legend below all axes, with each label once."""
    handles = {label: handle for ax in figure.axes for handle, label in zip(*ax.get_legend_handles_labels())}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=columns)


def save(figure: Figure, path: Path) -> None:
    """Write a PNG of `DPI` dots per inch, cut to its content above and below.

    Its colours are just coarse enough for it to stay below `LARGEST`.
    """
    canvas = FigureCanvasAgg(figure)
    figure.set_dpi(DPI)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3].astype(int)
    filled, margin = np.flatnonzero((pixels < 255).any(axis=(1, 2))), DPI // 25
    pixels = pixels[max(0, filled[0] - margin):filled[-1] + 1 + margin]
    for step in (1, 2, 3, 4, 6, 8):
        file = io.BytesIO()
        levels = 255 - np.rint((255 - pixels) / step) * step  # white stays white
        Image.fromarray(np.clip(levels, 0, 255).astype(np.uint8)).save(file, "PNG", optimize=True, dpi=(DPI, DPI))
        if file.tell() < LARGEST:
            break
    write_atomic(path, file.getvalue())


def script(draw: Callable[[Path], None], file: str) -> None:
    """Command line of a figure's script: `--out` names another file than the PNG beside the script."""
    app = App(name=f"python figures/{Path(file).name}", help=(sys.modules["__main__"].__doc__ or "").strip(),
              help_format="plaintext", version_flags=[])

    default = Path(file).resolve().with_suffix(".png")

    @app.default
    def main(*, out: Path = default) -> None:
        """Draw the figure from the reference results.

        Parameters
        ----------
        out
            File to write.
        """
        with matplotlib.rc_context(plot.STYLE):
            draw(out)
        print(out)

    start(app)


def start(app: App) -> NoReturn:
    """Run a command line; an error that can be cured is one line and exit status 2, as that of the cases."""
    try:
        raise SystemExit(app(result_action="return_value"))
    except SkfsinkError as error:
        print("skfsink:", error, file=sys.stderr)
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        print("skfsink: interrupted; the same command goes on", file=sys.stderr)
        raise SystemExit(130) from None
