"""Picture of the fibres on the undeformed body."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..fem.space import Space
from ..results.frame import Frame
from . import body as deformed
from .body import OBLIQUE, View
from .plot import BLUE, RED, STYLE, WIDTH, draw_body, save

__all__ = ["fibre_picture"]

ACROSS = 32  # lines along the longer side of the picture
COLOURS = (BLUE, RED)  # the first is thicker, to be seen where the second lies on it
_PLAIN = ScalarMappable(Normalize(0, 1), ListedColormap(["#e3e7ea"]))


@matplotlib.rc_context(STYLE)
def fibre_picture(space: Space, fibres: np.ndarray, path: str | Path, title: str = "", view: View = OBLIQUE) -> None:
    """Directions (ne, families, 3) as lines, a colour for each family; what points out of the picture is shorter.

    Elements are chosen evenly over the picture; of a body in space those at the surface that is seen.
    """
    rest = Frame(np.nan, "", np.zeros_like(space.X), np.ones(space.n_nodes), np.zeros(space.n_elements, bool))
    (body,), box, ratio = deformed.bodies(space, [rest], view, [np.zeros(space.n_nodes)])
    turn = np.eye(3) if space.dim == 2 else deformed.turned(view)
    elements, places = _seen(space, turn, float(np.ptp(box, axis=0).max()) / ACROSS)
    length = 0.8 * float(np.ptp(box, axis=0).max()) / ACROSS
    figure = Figure((WIDTH, min(8.0, 0.8 * WIDTH * ratio + 0.7)), layout="compressed")
    ax = figure.subplots()
    draw_body(ax, body, "", _PLAIN)
    families = fibres.shape[1]
    for family, colour in zip(range(families), COLOURS):
        along = 0.5 * length * (fibres[elements, family] @ turn.T)[:, :2]
        there = np.isfinite(along).all(axis=1)
        lines = np.stack([places - along, places + along], axis=1)[there]
        width = 1.0 if families == 1 else 2.2 - 1.4 * family
        ax.add_collection(LineCollection(list(lines), colors=colour, linewidths=width), autolim=False)
    ax.set(xlim=box[:, 0], ylim=box[:, 1], aspect="equal", xlabel="$x$ (mm)", ylabel="$y$ (mm)")
    if space.dim == 3:
        ax.set_axis_off()
    names = ["fibres"] if families == 1 else ["first family", "second family"]
    ax.legend(handles=[Line2D([], [], color=colour, label=name) for name, colour in zip(names, COLOURS)],
              loc="center left", bbox_to_anchor=(1.01, 0.5))
    save(figure, path, title)


def _seen(space: Space, turn: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Elements (m,) whose fibres are drawn, one in each square of that size, and where in the picture, (m, 2) [mm]."""
    elements = np.arange(space.n_elements)
    corners = space.X[space.conn]
    if space.dim == 2:
        places, depth = corners.mean(axis=1), np.zeros(space.n_elements)
    else:
        outer = deformed.outer_facets(space, elements)
        facets = (corners @ turn.T)[:, deformed.FACETS[3]]
        normal = np.cross(facets[:, :, 2] - facets[:, :, 0], facets[:, :, 3] - facets[:, :, 1])
        here, facet = np.nonzero(outer & (normal[:, :, 2] > 0))
        middle = facets[here, facet].mean(axis=1)
        elements, places, depth = here, middle[:, :2], middle[:, 2]
    square = np.floor(places / spacing)
    off = np.linalg.norm(places / spacing - square - 0.5, axis=1)
    near = off - (1e3 * depth / spacing if space.dim == 3 else 0.0)  # what is in front hides what is behind
    order = np.lexsort((near, square[:, 1], square[:, 0]))
    first = np.append(True, np.any(np.diff(square[order], axis=0) != 0, axis=1))
    return elements[order[first]], places[order[first]]
