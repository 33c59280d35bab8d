"""What the loops for second derivatives take of a body: all of it at once, or the elements of one region in pieces."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..pattern import Pattern
from ..space import Space
from .records import Piece

__all__ = ["pieces"]

PIECE = 4096  # elements whose data is copied at a time


def pieces(space: Space, pattern: Pattern, gamma: np.ndarray, elements: np.ndarray | None,
           fibres: np.ndarray | None = None) -> Iterator[Piece]:
    """Data of the `elements`, some at a time; of all (None) without a copy.

    `gamma` (ne, nq) is numbered over the whole body, as the arrays of `space` are; `fibres` over `elements`.
    """
    if fibres is None:
        fibres = np.empty((space.n_elements if elements is None else elements.size, 0, 3))
    whole = space.conn, space.dN, space.w, np.ascontiguousarray(gamma), pattern.slot
    around = space.around if space.axisymmetric else np.empty((space.n_elements, 0, space.conn.shape[1]))
    if elements is None:
        yield Piece(*whole, np.ascontiguousarray(fibres), around)
        return
    for start in range(0, elements.size, PIECE):
        part = slice(start, start + PIECE)
        conn, dN, w, at_points, slot = (_taken(array, elements[part]) for array in whole)
        yield Piece(conn, dN, w, at_points, slot, np.ascontiguousarray(fibres[part]), around[elements[part]])


def _taken(array: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Rows of an array, read-only if it is: the compiled loops are not compiled again for them."""
    taken: np.ndarray = array[rows]
    taken.flags.writeable = array.flags.writeable
    return taken
