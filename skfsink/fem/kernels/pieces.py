"""What the loops for second derivatives take of a body: all of it at once, or the elements of one region in pieces."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..pattern import Pattern
from ..space import Space

__all__ = ["pieces"]

PIECE = 4096  # elements whose data is copied at a time


def pieces(space: Space, pattern: Pattern, gamma: np.ndarray, elements: np.ndarray | None,
           *more: np.ndarray) -> Iterator[tuple[np.ndarray, ...]]:
    """(conn, dN, w, gamma, slot, `more`...) of the `elements`, some at a time; of all (None) without a copy.

    `gamma` (ne, nq) is numbered over the whole body, as the arrays of `space` are; `more` over `elements`.
    """
    arrays = space.conn, space.dN, space.w, np.ascontiguousarray(gamma), pattern.slot
    if elements is None:
        yield (*arrays, *map(np.ascontiguousarray, more))
        return
    for start in range(0, elements.size, PIECE):
        part = slice(start, start + PIECE)
        yield (*(_taken(array, elements[part]) for array in arrays),
               *(np.ascontiguousarray(array[part]) for array in more))


def _taken(array: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Rows of an array, read-only if it is: the compiled loops are not compiled again for them."""
    taken: np.ndarray = array[rows]
    taken.flags.writeable = array.flags.writeable
    return taken
