"""What the loops for second derivatives take of a body, some elements at a time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..pattern import Pattern
from ..space import Space
from .records import Piece

__all__ = ["pieces"]

PIECE = 1024  # elements whose data is made at a time


def pieces(space: Space, pattern: Pattern, gamma: np.ndarray, elements: np.ndarray | None,
           fibres: np.ndarray | None = None) -> Iterator[Piece]:
    """Data of the `elements`, or of all (None), some at a time.

    `gamma` (ne, nq) is numbered over the whole body, as the arrays of `space` are; `fibres` over `elements`.
    """
    count = space.n_elements if elements is None else elements.size
    if fibres is None:
        fibres = np.empty((count, 0, 3))
    gamma = np.ascontiguousarray(gamma)
    for start in range(0, count, PIECE):
        part = slice(start, min(start + PIECE, count))
        some = part if elements is None else elements[part]
        around = space.around[some] if space.axisymmetric else np.empty((part.stop - start, 0, space.conn.shape[1]))
        yield Piece(_taken(space.conn, some), space.slopes(some), _taken(space.w, some), _taken(gamma, some),
                    pattern.slots(some), np.ascontiguousarray(fibres[part]), around)


def _taken(array: np.ndarray, rows: np.ndarray | slice) -> np.ndarray:
    """Rows of an array, read-only if it is: the compiled loops are not compiled again for them."""
    taken: np.ndarray = array[rows]
    taken.flags.writeable = array.flags.writeable
    return taken
