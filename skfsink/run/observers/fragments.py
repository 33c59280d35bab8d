"""Fragments: the pieces into which the body comes apart, at the end of a run or every so often."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...fem.space import Space
from ...fields.body import Body
from ...fields.pieces import Pieces, pieces_of
from ...fields.state import State
from ...results.fragments import FRAGMENTS, append_fragments, fragment_columns, write_fragments
from .observer import Recorder
from .view import View

__all__ = ["Fragments", "fragment_summary"]


def _rows(found: Pieces) -> np.ndarray:
    """A row for each piece, the heaviest first: the columns of :func:`.fragment_columns`."""
    return np.column_stack([np.arange(1, len(found.mass) + 1), *(
        part if part.ndim == 2 else part[:, None] for part in found[:-1])])


class Fragments(Recorder):
    """Writes `fragments.csv`, the pieces of the body at the end of the run, and at its looks: a row for each piece.

    Pieces are numbered at each look, the heaviest first. That of every run looks at the end alone; one with `every`, or
    `every_passes` in a quasi-static event, takes its place.

    Memory: the `rows` so far (step, time [s], and the columns of :func:`.fragment_columns`); `look`, `unfailed` and
    `finish` add to them.

    Parameters
    ----------
    every: time between two looks in the event [s]; None looks at the end alone.
    every_passes: passes between two looks in a quasi-static event; None looks at the end alone.
    """

    def __init__(self, every: float | None = None, every_passes: int | None = None) -> None:
        super().__init__()
        self.every = every
        self._passes, self.every_passes = every_passes, 1 if every_passes is None else every_passes

    def prepare(self, view: View) -> None:
        """Begin the file with the rows so far."""
        write_fragments(view.folder / FRAGMENTS, _columns(view.body.space), self.rows)

    def due(self, view: View) -> bool:
        """When it is time, if it looks at all before the end."""
        return (self._passes if view.quasistatic else self.every) is not None and super().due(view)

    def look(self, view: View) -> None:
        """Add a row for each piece."""
        if view.occasion == "begin" and (self._passes if view.quasistatic else self.every) is None:
            return
        self._add(view, 0.0 if view.quasistatic else view.state.time)

    def unfailed(self, view: View) -> None:
        """The pieces of a run that ends without a failure."""
        self._add(view, view.state.time)

    def _add(self, view: View, time: float) -> None:
        found = _rows(pieces_of(view.body.momentum, view.state))
        rows = np.column_stack([np.tile([float(view.state.step), time], (len(found), 1)), found])
        self._rows.append(rows)
        append_fragments(view.folder / FRAGMENTS, _columns(view.body.space), rows)


def _columns(space: Space) -> list[str]:
    return fragment_columns(space.dim, space.volume_dim)


def fragment_summary(body: Body, state: State, length_scale: float) -> Mapping[str, Any]:
    """The pieces of a body, as `summary.json` has them: each that is no debris, and sums of the debris and of all."""
    found, names = pieces_of(body.momentum, state), _columns(body.space)
    rows = _rows(found)
    whole = {"piece", "elements"}
    is_debris = found.extent < length_scale**body.space.dim
    added = [name for name in names if name.startswith(("elements", "area", "volume", "mass", "momentum", "kinetic"))]

    def sums(of: np.ndarray) -> dict[str, Any]:
        totals = dict(zip(names, of.sum(axis=0).tolist()))
        return {name: int(totals[name]) if name in whole else totals[name] for name in added}

    listed = [{name: int(value) if name in whole else value for name, value in zip(names, row)}
              for row in rows[~is_debris].tolist()]
    return {"pieces": listed, "debris": sums(rows[is_debris]), "all": sums(rows)}
