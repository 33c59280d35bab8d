"""The measured ladders as a picture, error against price for each scene, and as tables."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ..run.model import LADDERS, REFERENCE, Ladder, ladder_path
from ..scene.options import QUANTITIES
from .chart import page

__all__ = ["choices_table", "draw_ladders", "errors_table"]

COLOURS = {"onset": "#8c8c8c", "statics": "#2b6ca3", "dynamics": "#b2362b", "full": "k"}
MARKERS = {"onset": "v", "statics": "s", "dynamics": "o", "full": "D"}
WORDS = {"statics": "statics only", "dynamics": "statics, then dynamics", "full": "full dynamics (reference)"}
LEAST, MOST = 1e-4, 2.0  # errors that are drawn; smaller and larger ones are put on the edge
TOLERANCE = 0.05


def draw_ladders(ladders: Mapping[str, Ladder], path: Path, quantity: str = "U") -> None:
    """Draw the error of `quantity` against the price, a panel a scene."""
    title = f"Models of the scenes: error of ${quantity}$ at the first arrival against price"
    with page(path, title, 3, 2, 8.6) as axes:
        for ax, case in zip(axes, LADDERS):
            ax.set_title(case.replace("_", " "))
            if case in ladders:
                _panel(ax, ladders[case], quantity)
            else:
                ax.set_axis_off()
                ax.text(0.5, 0.5, "not measured", transform=ax.transAxes, ha="center", color="0.5")
        keys: list[Artist] = [Line2D([], [], marker=MARKERS[base], color=COLOURS[base], markersize=4, linestyle="",
                                     label=words) for base, words in WORDS.items()]
        keys += [Line2D([], [], color="0.4", linewidth=0.8, linestyle="--", label=f"tolerance {TOLERANCE:g}"),
                 Patch(color="0.92", label="difference between two meshes of equal sizes")]
        axes[0].figure.legend(handles=keys, loc="outside lower center", ncols=3, fontsize=7)


def _panel(ax: Axes, ladder: Ladder, quantity: str) -> None:
    shown = []
    for name in ladder.by_price():
        error = ladder.error(name, quantity)
        if error is None:
            continue
        base, _, variant = name.partition("-")
        at = ladder.points[name]["price_s"], float(np.clip(error, LEAST, MOST))
        ax.plot(*at, MARKERS[base], color=COLOURS[base], markersize=4.5, zorder=3)
        shown.append((at, variant.replace("-", " ") if variant else base, COLOURS[base]))
    if not shown:
        return
    scatter = ladder.scatter(quantity)
    if scatter is not None:
        ax.axhspan(LEAST / 2, min(max(scatter, LEAST), MOST), color="0.92", zorder=0)
    ax.axhline(TOLERANCE, color="0.4", linewidth=0.8, linestyle="--", zorder=1)
    ax.set(xscale="log", yscale="log", ylim=(LEAST / 2, 2 * MOST), xlabel="price (s)", ylabel="relative error")
    prices = [at[0] for at, *_ in shown]
    ax.set_xlim(0.6 * min(prices), 2.6 * max(prices))
    _label(ax, shown)


def _label(ax: Axes, shown: list[tuple[tuple[float, float], str, str]]) -> None:
    """Write the names beside the points, right or left, moved up or down where they would meet something."""
    ax.figure.canvas.draw()
    scale = 72.0 / ax.figure.dpi
    places = [tuple(ax.transData.transform(at) * scale) for at, *_ in shown]
    taken = [(x - 3, x + 3, y) for x, y in places]  # left, right, height [points]
    edge = ax.bbox.x0 * scale, ax.bbox.x1 * scale
    for (x, y), (at, text, colour) in zip(places, shown):
        width = 2.9 * len(text)
        spots = [(left, up) for up in (0, 6.5, -6.5, 13, -13, 19.5, -19.5, 26, -26) for left in (5, -5 - width)]
        left, up = next((spot for spot in spots if edge[0] < x + spot[0] and x + spot[0] + width < edge[1] and all(
            x + spot[0] > b or a > x + spot[0] + width or abs(y + spot[1] - h) > 6 for a, b, h in taken)), spots[0])
        taken.append((x + left, x + left + width, y + up))
        line = {"arrowstyle": "-", "color": colour, "linewidth": 0.4, "shrinkA": 0, "shrinkB": 2}
        ax.annotate(text, at, xytext=(left, up - 2), textcoords="offset points", fontsize=5.6, color=colour,
                    arrowprops=line if abs(up) > 7 else None)


def errors_table(ladder: Ladder) -> str:
    """Price and errors of the levels of a case, the cheapest first, as a table in Markdown."""
    lines = ["| model | elements | price (s) | " + " | ".join(QUANTITIES) + " |", "|---" * (3 + len(QUANTITIES)) + "|"]
    for name in ladder.by_price():
        point = ladder.points[name]
        errors = [ladder.error(name, quantity) for quantity in QUANTITIES]
        cells = [f"{error:.1%}".replace("%", " %") if error is not None else "–" for error in errors]
        if name == REFERENCE:
            cells = [_value(point, quantity) for quantity in QUANTITIES]
        word = f"**{name}**" if name == REFERENCE else name
        lines.append(f"| {word} | {point['elements']:,} | {point['price_s']:.1f} | " + " | ".join(cells) + " |")
    scatter = [ladder.scatter(quantity) for quantity in QUANTITIES]
    lines.append("| *another mesh* | | | " + " | ".join(f"{s:.1%}".replace("%", " %") if s is not None else "–"
                                                        for s in scatter) + " |")
    return "\n".join(lines) + "\n"


def _value(point: dict[str, dict[str, float]], quantity: str) -> str:
    value = point["quantities"].get(quantity)
    return "" if value is None else f"{value:.4g}"


def choices_table(ladders: Mapping[str, Ladder], tolerance: float = TOLERANCE) -> str:
    """What `--model auto` takes for each quantity, as a table in Markdown."""
    lines = ["| scene | " + " | ".join(QUANTITIES) + " |", "|---" * (1 + len(QUANTITIES)) + "|"]
    for case, ladder in ladders.items():
        cells = []
        for quantity in QUANTITIES:
            name = ladder.cheapest(quantity, tolerance, gmsh=True)[0]
            cells.append(f"{name}, {ladder.points[name]['price_s']:.0f} s")
        lines.append(f"| `{case}` | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    measured = {case: Ladder(case) for case in LADDERS if ladder_path(case).is_file()}
    for case, ladder in measured.items():
        sys.stdout.write(f"### {case}\n\n{errors_table(ladder)}\n")
    sys.stdout.write(choices_table(measured))
