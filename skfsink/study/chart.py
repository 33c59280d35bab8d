"""Charts of the studies, in the style of :mod:`skfsink.pictures.plot`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from ..pictures.plot import DPI, STYLE, WIDTH
from ..system.files import replaced
from .pareto import pareto_front

__all__ = ["draw_front", "listed", "page"]


@contextmanager
def page(path: str | Path, title: str, rows: int, columns: int, height: float,
         width: float = WIDTH) -> Iterator[list[Axes]]:
    """A page with a grid of axes, `height` by `width` [in]; it is written to `path` (PNG) when the block has filled it.

    The axes come row by row.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure((width, height), layout="constrained")
        axes: list[Axes] = figure.subplots(rows, columns, squeeze=False).ravel().tolist()
        yield axes
        for ax in axes:
            plain_ticks(ax)
        figure.suptitle(title)
        with replaced(path) as part:
            figure.savefig(part, format="png", dpi=DPI)


def plain_ticks(ax: Axes) -> None:
    """Plain numbers on logarithmic axes: the decades, and 2 and 5 in between where there are fewer than two of them."""
    for axis in (ax.xaxis, ax.yaxis):
        if axis.get_scale() != "log":
            continue
        low, high = sorted(axis.get_view_interval())
        wide = bool(high > 60 * low)
        axis.set_major_locator(LogLocator(10, (1.0,) if wide else (1.0, 2.0, 5.0) if high > 3 * low else range(1, 10)))
        axis.set_major_formatter(FuncFormatter(partial(_number, wide)))
        axis.set_minor_formatter(NullFormatter())


def _number(decades: bool, value: float, _: int) -> str:
    """A number, a power of ten where it would be long."""
    if 9e-4 < value < 1.1e4:
        return f"{value:g}"
    power = int(np.floor(np.log10(value) + 1e-9))
    front = "" if decades else f"{value / 10**power:.0f}" + r"\cdot"
    return f"${front}10^{{{power}}}$"


def draw_front(ax: Axes, cost: Sequence[float], error: Sequence[float], names: Sequence[str],
               key: dict[str, int] | None = None, most: int = 9) -> None:
    """Draw the Pareto front of points, and number some of them, `most` at the most and evenly spread over the errors.

    `key` has the number of each name, and gets those that are new; without one the names are written below the axes.
    """
    front = pareto_front(cost, error)
    x, y = np.asarray(cost, float)[front], np.asarray(error, float)[front]
    ax.step(x, y, where="post", color="k", linewidth=0.8, zorder=1, label="Pareto front")
    key, below = ({}, True) if key is None else (key, False)
    step = (y[0] / y[-1]) ** (1 / max(1, most - 1)) if len(front) > most else 1.0
    last = np.inf
    for k, i in enumerate(front):
        if y[k] * step <= last * (1 + 1e-9) or k == len(front) - 1:
            last = y[k]
            number = key.setdefault(names[i], len(key) + 1)
            ax.annotate(str(number), (x[k], y[k]), xytext=(3, 3), textcoords="offset points", fontsize=6.5,
                        fontweight="bold", zorder=5)
    if below:
        ax.text(0.0, -0.2, listed(key), transform=ax.transAxes, fontsize=6, va="top", linespacing=1.3)


def listed(key: dict[str, int]) -> str:
    """The names of numbered points, a line each."""
    return "\n".join(f"{number}  {name}" for name, number in key.items())
