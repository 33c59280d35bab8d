"""Picture of the pieces into which a body has come apart, each in a colour of its own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from ..fem.space import Space
from ..fields.fragments import pieces_at
from ..results.frame import SPENT, Frame
from . import body as deformed
from .body import View
from .plot import STYLE, WIDTH, draw_body, save

__all__ = ["piece_picture"]

#: of the heaviest pieces; all others are grey
COLOURS = ("#33658a", "#d1495b", "#2a9d5c", "#e0a030", "#7b4ea3", "#4fb3bf", "#8a5a00", "#c46fa6", "#9bb53c")
OTHERS = "#b5b5b5"


@matplotlib.rc_context(STYLE)
def piece_picture(space: Space, frame: Frame, rows: Mapping[str, np.ndarray], density: np.ndarray, path: str | Path,
                  title: str = "", view: View = deformed.OBLIQUE) -> None:
    """The deformed body of a frame, coloured by its pieces, with the mass and the speed of the heaviest.

    `rows` are columns of :func:`.read_fragments` at that time, `density` is that of the intact elements, (ne, 1).
    """
    alive, piece = pieces_at(space, frame.gamma, frame.deleted, SPENT)
    number = int(piece.max(initial=-1)) + 1
    mass = np.bincount(piece, (space.w * density * space.at_gauss(frame.gamma))[alive].sum(axis=1), number)
    rank = np.argsort(np.argsort(-mass, kind="stable"))[piece]
    colour = np.full(space.n_nodes, float(len(COLOURS)))
    holds = frame.gamma[space.conn[alive]] > SPENT
    nodes = space.conn[alive]
    colour[nodes[holds]] = np.minimum(np.broadcast_to(rank[:, None], nodes.shape)[holds], len(COLOURS))
    scale = ScalarMappable(Normalize(0, len(COLOURS)), ListedColormap([*COLOURS, OTHERS]))
    (drawn,), box, ratio = deformed.bodies(space, [frame], view, [colour])
    figure = Figure((WIDTH, min(8.0, 0.72 * WIDTH * ratio + 0.7)), layout="compressed")
    ax = figure.subplots()
    draw_body(ax, drawn, frame.title, scale)
    ax.set(xlim=box[:, 0], ylim=box[:, 1], aspect="equal", xlabel="$x$ (mm)", ylabel="$y$ (mm)")
    if space.dim == 3:
        ax.set_axis_off()
    ax.legend(handles=_entries(rows, number), loc="center left", bbox_to_anchor=(1.01, 0.5),
              title="share of mass, speed")
    save(figure, path, title)


def _entries(rows: Mapping[str, np.ndarray], number: int) -> list[Patch]:
    """Legend: a line for each of the heaviest pieces, and one for the others."""
    mass = next(values for name, values in rows.items() if name.startswith("mass"))
    velocity = np.stack([values for name, values in rows.items() if name.startswith("velocity")])
    share, speed = mass / mass.sum(), np.linalg.norm(velocity, axis=0) / 1e3
    entries = [Patch(color=colour, label=f"{100 * share[k]:.3g} %, {speed[k]:.3g} m/s")
               for k, colour in enumerate(COLOURS[:number])]
    if number > len(COLOURS):
        rest = slice(len(COLOURS), None)
        entries.append(Patch(color=OTHERS, label=f"{number - len(COLOURS)} others, {100 * share[rest].sum():.2g} %"))
    return entries
