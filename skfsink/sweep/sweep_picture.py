"""The picture of a sweep: what comes out against what varies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..system.files import replaced

__all__ = ["DRAWN", "draw"]

#: figures that have a panel, as far as a run has them
DRAWN = ("onset_pressure", "onset_load", "onset_displacement", "onset_G", "U", "D", "tip_speed", "branches",
         "tear_angle")
SERIES = 10  # at the most that have a colour of their own
_STYLE: dict[Any, Any] = {"font.family": "DejaVu Sans", "font.size": 10}


@matplotlib.rc_context(_STYLE)
def draw(rows: Sequence[Mapping[str, Any]], varied: Sequence[str], path: Path, units: Mapping[str, str]) -> None:
    """Picture of the figures against the first number that varies besides the seed of the mesh, or else the first text.

    Each run is a point; where several share a value, their mean and standard deviation are beside them. If only the
    seed varies, the figures are drawn against it, over their mean and standard deviation. What else varies has colours.
    `units` has those of figures and parameters.
    """
    numeric = [name for name in varied if not isinstance(rows[0][name], str | bool)]
    words = [name for name in varied if name not in numeric]
    axis = next((name for name in (*numeric, *words) if name != "mesh_seed"), None)
    ensemble = axis is None and "mesh_seed" in numeric
    across = "mesh_seed" if ensemble else axis
    categories = sorted({str(row[across]) for row in rows}) if across in words else []
    series = _series(rows, [name for name in varied if name not in (across, "mesh_seed")], units)
    shown = [name for name in DRAWN if any(row.get(name) is not None for row in rows)]
    lines = -(-len(shown) // 2)
    figure = Figure((9, 0.4 + 3.0 * lines), layout="constrained")
    axes = figure.subplots(lines, 2 if len(shown) > 1 else 1, squeeze=False)
    for name, plot in zip(shown, axes.flat):
        for number, (label, own) in enumerate(series.items()):
            pairs = np.array([(_place(row[across], categories) if across else 0.0, row[name]) for row in own
                              if row.get(name) is not None], float).reshape(-1, 2)
            (_seeds if ensemble else _groups)(plot, pairs, label, f"C{number}")
        plot.set_ylabel(_words(name, units))
        plot.grid(alpha=0.3)
        low, high = plot.get_ylim()
        nothing = not any(row.get(name) for row in rows)  # as the branches of runs that end at their onset
        plot.set_ylim(*((0.0, 1.0) if nothing else (min(0.0, low), 1.12 * high if high > 0 else 0.0)))
        if name == "branches":
            plot.yaxis.set_major_locator(MaxNLocator(integer=True))
        if categories:
            plot.set_xticks(range(len(categories)), categories)
            plot.set_xlim(-0.5, len(categories) - 0.5)
        elif not across:
            plot.set_xticks([0.0], [f"{len(rows)} runs"])
            plot.set_xlim(-1, 1)
        if across:
            plot.set_xlabel(_words(across, units))
    for plot in axes.flat[len(shown):]:
        plot.remove()
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=2, frameon=False, fontsize=8)
    with replaced(path) as temporary:
        figure.savefig(temporary, dpi=150, format="png")


def _words(name: str, units: Mapping[str, str]) -> str:
    return f"{name.replace('_', ' ')} [{units[name]}]" if units.get(name) else name.replace("_", " ")


def _place(value: Any, categories: Sequence[str]) -> float:
    return float(categories.index(str(value)) if categories else value)


def _series(rows: Sequence[Mapping[str, Any]], others: Sequence[str], units: Mapping[str, str]
            ) -> dict[str, list[Mapping[str, Any]]]:
    """The rows by analysis and by what else varies, each under its name; by analysis alone if that were too many."""
    found: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        if row["analysis"]:
            named = [f"{name.replace('_', ' ')} {_value(row[name])} {units.get(name, '')}".strip() for name in others]
            found.setdefault(", ".join([row["analysis"], *named]), []).append(row)
    if len(found) > SERIES and others:
        return _series(rows, (), units)
    return dict(sorted(found.items())) if not others else found


def _value(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _groups(plot: Axes, pairs: np.ndarray, label: str, colour: str) -> None:
    """Points, and beside those of the same value their mean and standard deviation."""
    values = np.unique(pairs[:, 0])
    groups = [pairs[pairs[:, 0] == value, 1] for value in values]
    several = any(len(group) > 1 for group in groups)
    width = 0.02 * (np.ptp(values) if len(values) > 1 else 1.0) if several else 0.0
    plot.plot(pairs[:, 0] - width / 2, pairs[:, 1], "o", ms=4, mfc="none", color=colour, alpha=0.7)
    if several:
        mean = [group.mean() for group in groups]
        spread = [group.std(ddof=1) if len(group) > 1 else 0.0 for group in groups]
        plot.errorbar(values + width / 2, mean, spread, fmt="s", ms=5, capsize=4, color=colour,
                      label=f"{label}: mean ± standard deviation")
    else:
        plot.plot([], [], "o", mfc="none", color=colour, label=label)


def _seeds(plot: Axes, pairs: np.ndarray, label: str, colour: str) -> None:
    """Points against the seed of their mesh, over a band of their mean and standard deviation."""
    plot.plot(*pairs.T, "o", ms=4, mfc="none", color=colour)
    if len(pairs) > 1:
        mean, spread = pairs[:, 1].mean(), pairs[:, 1].std(ddof=1)
        plot.axhline(mean, color=colour, linewidth=1,
                     label=f"{label}: mean ± standard deviation of {len(pairs)} meshes")
        plot.axhspan(mean - spread, mean + spread, color=colour, alpha=0.15, linewidth=0)
