"""Picture of what probes on lines have followed, such as stresses through a wall, drawn from their files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ..results.probes import ENDINGS, ProbeTable
from .plot import STYLE, WIDTH, save
from .probe_curves import COLOURS, MOST, RAISED, by_unit, legend

__all__ = ["line_picture"]

LOOKS = (("loading", "-", "end of the loading"), ("event", "--", "end of the event"))
PLACES = ("s_mm", "x_mm", "y_mm", "z_mm")
NODAL = ("u_", "v_", "gamma")  # what is interpolated; all else are means of elements, drawn as steps


@matplotlib.rc_context(STYLE)
def line_picture(probes: Mapping[str, ProbeTable], path: str | Path, title: str = "") -> None:
    """Quantities along lines, over the distance from the first point in the undeformed body: full as the loading ends,
    dashed as the event does; means of elements as steps.

    A panel for the columns of one unit of a probe. Nothing is drawn where no probe is a line.
    """
    panels = [(name, table, unit, [column for column in columns if column not in PLACES])
              for name, table in probes.items() if "s_mm" in table for unit, columns in by_unit(table).items()]
    panels = [panel for panel in panels if panel[3]][:MOST]
    if not panels:
        return
    figure = Figure((WIDTH, 0.8 + 1.9 * len(panels)), layout="constrained")
    for ax, (name, table, unit, columns) in zip(figure.subplots(len(panels), 1, squeeze=False)[:, 0], panels):
        phase, distance = table.look("phase")[:, 0], table.look("s_mm")[0]
        looks = [(np.flatnonzero(phase == of)[-1], style, words) for of, style, words in LOOKS if (phase == of).any()]
        for row, style, words in looks:
            for column, colour in zip(columns, COLOURS):
                label = column.removesuffix(ENDINGS.get(unit, ""))
                ax.plot(distance, table.look(column)[row], style, color=colour,
                        drawstyle="default" if column.startswith(NODAL) else "steps-mid",
                        label=label if len(looks) == 1 else f"{label}, {words}")
        ax.set(ylabel=name + ("" if unit == "1" else f" ({unit.translate(RAISED)})"), xlim=(0, distance[-1]))
        legend(ax)
    ax.set_xlabel("distance along the line, undeformed (mm)")
    figure.align_ylabels()
    save(figure, path, title)
