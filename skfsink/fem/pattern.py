"""The fixed sparsity of an assembled matrix, and where each element entry goes in it."""

from __future__ import annotations

from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.sparse import csr_array

from ..system.jit import njit

__all__ = ["Connectivity", "Pattern"]


KEPT = 2**28  # bytes of the places of entries that are kept: of 116,000 hexahedra, or a million quadrilaterals


class Connectivity(Protocol):
    """What a pattern is made from: the nodes of the elements (ne, na), and the graph of the nodes, (n, n)."""

    @property
    def conn(self) -> np.ndarray: ...

    @property
    def graph(self) -> csr_array: ...


class Pattern:
    """Fixed sparsity of an assembled matrix, and where each element entry goes in it.

    The CSR structure is that of the mesh graph, with `block` unknowns a node, restricted to the unknowns marked in
    `free` and, if `upper`, to the upper triangle (what a symmetric factorisation wants). It does not depend on
    values, so a factorisation keeps its analysis for the whole run.

    Parameters
    ----------
    absent: numbers of elements that put nothing in it.

    Attributes
    ----------
    indptr, indices: CSR structure, rows and columns numbered over the free unknowns.
    """

    def __init__(self, space: Connectivity, block: int = 1, free: np.ndarray | None = None,
                 upper: bool = False, absent: np.ndarray | None = None) -> None:
        node, conn = space.graph, space.conn
        n = node.shape[0] * block
        free = np.ones(n, bool) if free is None else free
        self._number = np.where(free, np.cumsum(free) - 1, -1).astype(np.int32)
        self._conn, self._block = conn, block
        self._absent = np.zeros(0, np.int64) if absent is None else absent
        self.size, self.upper = int(free.sum()), upper
        self.indptr = np.zeros(self.size + 1, np.int32)
        _count(node.indptr, node.indices, block, self._number, upper, self.indptr)
        self.indices, self.diagonal = np.empty(self.indptr[-1], np.int32), np.full(self.size, -1, np.int32)
        _fill(node.indptr, node.indices, block, self._number, upper, self.indptr, self.indices, self.diagonal)

    @cached_property
    def slot(self) -> np.ndarray:
        """Position of the element entry (i, j) in the data array, -1 where it is not stored, (ne, nd, nd).

        It is kept: 2.3 kB a hexahedron for its displacements; :meth:`slots` gives those of some elements.
        """
        return self._find(slice(None))

    def slots(self, elements: np.ndarray | slice) -> np.ndarray:
        """Those of some elements, (m, nd, nd).

        Those of all are kept if they take no more than KEPT, since finding them is a quarter of the time of a tangent.
        """
        ne, na = self._conn.shape
        if "slot" in self.__dict__ or ne * (na * self._block)**2 * np.dtype(np.int32).itemsize <= KEPT:
            return self.slot[elements]
        return self._find(elements)

    def _find(self, elements: np.ndarray | slice) -> np.ndarray:
        conn = self._conn[elements]
        unknowns = conn.shape[1] * self._block
        found: np.ndarray = np.empty((len(conn), unknowns, unknowns), np.int32)
        _find_slots(conn, self._block, self._number, self.indptr, self.indices, self.upper, found)
        if self._absent.size:
            found[np.isin(np.arange(len(self._conn))[elements], self._absent)] = -1
        return found

    @property
    def nnz(self) -> int:
        """Number of stored entries."""
        return int(self.indices.size)

    def matrix(self, data: np.ndarray) -> csr_array:
        """CSR matrix with this structure over `data` (not copied)."""
        return csr_array((data, self.indices, self.indptr), shape=(self.size, self.size), copy=False)

    def symmetric(self, data: np.ndarray) -> csr_array:
        """The whole symmetric matrix, whichever half is stored."""
        half = self.matrix(data)
        if not self.upper:
            return half
        return csr_array(half + half.T - _diagonal(half))


def _diagonal(matrix: csr_array) -> csr_array:
    n = matrix.shape[0]
    return csr_array((matrix.diagonal(), (np.arange(n), np.arange(n))), shape=(n, n))


@njit(cache=True, nogil=True)
def _find_slots(conn, block, number, indptr, indices, upper, slot):  # type: ignore[no-untyped-def]
    """The columns of a node lie side by side, as far from the end of a row in each row of another node: one search."""
    slot[:] = -1
    for e in range(conn.shape[0]):
        for a in range(conn.shape[1]):
            first = _first(conn[e, a], block, number)
            for b in range(conn.shape[1]):
                column = _first(conn[e, b], block, number)
                if first < 0 or column < 0 or (upper and column < first):
                    continue
                low, high = indptr[first], indptr[first + 1] - 1
                while low < high:
                    middle = (low + high) // 2
                    if indices[middle] < column:
                        low = middle + 1
                    else:
                        high = middle
                shift = low - indptr[first + 1] - column
                for i in range(block):
                    r = number[conn[e, a] * block + i]
                    for j in range(block):
                        c = number[conn[e, b] * block + j]
                        if r >= 0 and c >= 0 and not (upper and c < r):
                            slot[e, a * block + i, b * block + j] = indptr[r + 1] + shift + c


@njit(cache=True)
def _first(node, block, number):  # type: ignore[no-untyped-def]
    """The first free unknown of a node, -1 if it has none."""
    for i in range(block):
        if number[node * block + i] >= 0:
            return number[node * block + i]
    return -1


@njit(cache=True)
def _count(starts, nodes, block, number, upper, indptr):  # type: ignore[no-untyped-def]
    """The length of each row, added up."""
    for a in range(starts.size - 1):
        for i in range(block):
            row = number[a * block + i]
            if row < 0:
                continue
            count = 0
            for k in range(starts[a], starts[a + 1]):
                for j in range(block):
                    column = number[nodes[k] * block + j]
                    if column >= 0 and not (upper and column < row):
                        count += 1
            indptr[row + 1] = indptr[row] + count


@njit(cache=True)
def _fill(starts, nodes, block, number, upper, indptr, indices, diagonal):  # type: ignore[no-untyped-def]
    """The columns of each row, ascending, and the places of the diagonal."""
    for a in range(starts.size - 1):
        for i in range(block):
            row = number[a * block + i]
            if row < 0:
                continue
            at = indptr[row]
            for k in range(starts[a], starts[a + 1]):
                for j in range(block):
                    column = number[nodes[k] * block + j]
                    if column >= 0 and not (upper and column < row):
                        indices[at] = column
                        if column == row:
                            diagonal[row] = at
                        at += 1
