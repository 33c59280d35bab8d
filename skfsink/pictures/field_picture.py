"""Picture of a field on the deformed body, at several times."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib

from ..fem.space import Space
from ..results.frame import Frame
from . import body as deformed
from .body import OBLIQUE, View
from .looks import nodal, scale_of
from .plot import STYLE, draw_bodies, page, save

__all__ = ["field_picture"]


@matplotlib.rc_context(STYLE)
def field_picture(space: Space, frames: Sequence[Frame], field: str, path: str | Path, title: str = "",
                  view: View = OBLIQUE) -> None:
    """A field of :data:`.looks.FIELDS` on the deformed body, a panel for each frame, all in one range of colours.

    Frames have the fields of the elements that it takes, :func:`.looks.cells_of`, and for the speed velocities.
    """
    values = [nodal(space, frame, field) for frame in frames]
    bodies, box, ratio = deformed.bodies(space, frames, view, values)
    scale = scale_of(space, frames, values, field)
    figure, axes = page(len(frames), ratio)
    draw_bodies(axes, bodies, [frame.title for frame in frames], box, scale.colours)
    bar = figure.colorbar(scale.colours, ax=axes, aspect=25, pad=0.02, shrink=0.8, extend=scale.extend)
    bar.set_label(scale.label)
    for ax in axes:
        ax.label_outer()
    save(figure, path, title)
