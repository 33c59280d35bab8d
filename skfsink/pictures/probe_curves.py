"""Picture of what probes have followed, drawn from their files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..results.probes import ENDINGS, FIRST, ProbeTable
from .plot import STYLE, WIDTH, save

__all__ = ["COLOURS", "MOST", "RAISED", "by_unit", "legend", "probe_picture"]

RAISED = {ord("^"): None, ord("2"): "²", ord("3"): "³"}
MOST = 12     # panels, one below the other
COLOURS = ("k", "#33658a", "#a63d40", "#c98a2b", "#5b8e7d", "#7b4ea3")


@matplotlib.rc_context(STYLE)
def probe_picture(probes: Mapping[str, ProbeTable], path: str | Path, title: str = "",
                  quasistatic: bool = False) -> None:
    """Curves of probes, of the loading over the displacement (left) and of the event over time (right).

    A panel for the columns of one unit of a probe; lines have a picture of their own, and what would be too much is
    left out. Nothing is drawn where nothing is left.
    """
    panels = [(name, table, unit, columns) for name, table in probes.items() if "s_mm" not in table
              for unit, columns in by_unit(table).items()][:MOST]
    if not panels:
        return
    figure = Figure((WIDTH, 0.8 + 1.3 * len(panels)), layout="constrained")
    axes = figure.subplots(len(panels), 2, squeeze=False, sharex="col", sharey="row", width_ratios=[2, 3])
    for (left, right), (name, table, unit, columns) in zip(axes, panels):
        loading = table["phase"] == "loading"
        time = table["step"].astype(float) if quasistatic else 1e6 * table["time_s"]
        for column, colour in zip(columns, COLOURS):
            label = column.removesuffix(ENDINGS.get(unit, ""))
            left.plot(table["grip_displacement_mm"][loading], table[column][loading], ".-", color=colour, markersize=3)
            right.plot(time[~loading], table[column][~loading], color=colour, label=label)
        left.set_ylabel(name + ("" if unit == "1" else f" ({unit.translate(RAISED)})"))
        legend(right)
    axes[-1][0].set_xlabel("loading: displacement (mm)")
    axes[-1][1].set_xlabel("event: pass" if quasistatic else "event: time (µs)")
    figure.align_ylabels()
    save(figure, path, title)


def by_unit(table: ProbeTable) -> dict[str, list[str]]:
    """Columns of a probe by their units."""
    found: dict[str, list[str]] = {}
    for name, values in table.items():
        if name not in FIRST and np.isfinite(values).any():
            found.setdefault(table.units[name], []).append(name)
    return found


def legend(ax: Axes) -> None:
    """The legend of a panel, beside it."""
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
