"""Second derivatives of a body, made some elements at a time, and by several threads."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from ...system.jit import njit
from ..pattern import Pattern
from ..space import Space
from .records import Piece

__all__ = ["Pieces"]

PIECE = {2: 1024, 3: 256}  # elements whose data is made at a time, by dimension: it stays in the second-level cache


@dataclass(frozen=True)
class Pieces:
    """The `elements` of a body, or all of them (None), taken some at a time by the loops for second derivatives.

    `gamma` (ne, nq) is numbered over the whole body, as the arrays of `space` are; `fibres` over `elements`.
    """

    space: Space
    pattern: Pattern
    gamma: np.ndarray
    elements: np.ndarray | None
    fibres: np.ndarray | None = None

    @property
    def count(self) -> int:
        """Number of elements."""
        return self.space.n_elements if self.elements is None else self.elements.size

    def piece(self, start: int) -> Piece:
        """Data of the elements from `start` on."""
        space, elements = self.space, self.elements
        part = slice(start, min(start + PIECE[space.dim], self.count))
        some = part if elements is None else elements[part]
        ne, na = part.stop - start, space.conn.shape[1]
        around = space.around[some] if space.axisymmetric else np.empty((ne, 0, na))
        fibres = np.empty((ne, 0, 3)) if self.fibres is None else np.ascontiguousarray(self.fibres[part])
        return Piece(_taken(space.conn, some), space.slopes(some), _taken(space.w, some), _taken(self.gamma, some),
                     self.pattern.slots(some), fibres, around)

    def assemble(self, loop: Callable[[Piece, np.ndarray], None], threads: int = 1) -> np.ndarray:
        """Data on the pattern, of which `loop` adds what each piece has.

        The sums are in the order of the elements, whatever the number of threads.
        """
        data, starts = np.zeros(self.pattern.nnz), range(0, self.count, PIECE[self.space.dim])
        if threads == 1 or len(starts) == 1:
            for start in starts:
                loop(self.piece(start), data)
            return data
        slot = self.piece(0).slot  # what the space keeps is made here, once and not by each thread
        places = np.arange(slot.size, dtype=slot.dtype).reshape(slot.shape)
        waiting: deque[Future[tuple[np.ndarray, np.ndarray]]] = deque()
        with ThreadPoolExecutor(threads) as pool:
            for start in starts:
                waiting.append(pool.submit(self._apart, loop, start, places))
                if len(waiting) > threads:  # no more of them than the threads need: an entry takes 12 bytes
                    _add(*waiting.popleft().result(), data)
            while waiting:
                _add(*waiting.popleft().result(), data)
        return data

    def _apart(self, loop: Callable[[Piece, np.ndarray], None], start: int,
               places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where the element matrices of a piece go, and these (m, nd, nd), each entry in one of the `places` alone."""
        piece = self.piece(start)
        matrices = np.zeros(piece.slot.shape)
        loop(piece._replace(slot=places[:len(matrices)]), matrices.reshape(-1))
        return piece.slot, matrices


def _taken(array: np.ndarray, rows: np.ndarray | slice) -> np.ndarray:
    """Rows of an array, one after the other in memory and read-only if it is: the compiled loops are not compiled again
    for them."""
    taken: np.ndarray = np.ascontiguousarray(array[rows])
    taken.flags.writeable = array.flags.writeable
    return taken


@njit(cache=True)
def _add(slot, matrices, data):  # type: ignore[no-untyped-def]
    for e in range(slot.shape[0]):
        for i in range(slot.shape[1]):
            for j in range(slot.shape[2]):
                if slot[e, i, j] >= 0:
                    data[slot[e, i, j]] += matrices[e, i, j]
