"""The fixed sparsity of an assembled matrix, and where each element entry goes in it."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.sparse import csr_array

from ..system.jit import njit

__all__ = ["Connectivity", "Pattern"]


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

    Attributes
    ----------
    indptr, indices: CSR structure, rows and columns numbered over the free unknowns.
    slot: (ne, nd, nd) position of element entry (i, j) in the data array; -1 where it is not stored.
    """

    def __init__(self, space: Connectivity, block: int = 1, free: np.ndarray | None = None,
                 upper: bool = False) -> None:
        n = space.graph.shape[0] * block
        free = np.ones(n, bool) if free is None else free
        number = np.where(free, np.cumsum(free) - 1, -1).astype(np.int32)
        node = space.graph
        # the rows of the node graph, each repeated for every component, each entry widened to a block
        width = np.diff(node.indptr)
        rows = np.repeat(np.arange(n), np.repeat(width, block) * block)
        wide = (node.indices[:, None] * block + np.arange(block)).ravel()
        starts = np.repeat(node.indptr[:-1], block) * block
        lengths = np.repeat(width, block) * block
        within = np.arange(rows.size) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        cols = wide[np.repeat(starts, lengths) + within]
        keep = free[rows] & free[cols]
        if upper:
            keep &= cols >= rows
        self.size = int(free.sum())
        self.upper = upper
        self.indices = number[cols[keep]].astype(np.int32)
        counts = np.bincount(number[rows[keep]], minlength=self.size)
        self.indptr = np.concatenate(([0], np.cumsum(counts))).astype(np.int32)
        dofs = (space.conn[:, :, None] * block + np.arange(block)).reshape(len(space.conn), -1)
        self.slot = np.empty((*dofs.shape, dofs.shape[1]), np.int32)
        _find_slots(number[dofs], self.indptr, self.indices, upper, self.slot)
        self.diagonal = np.empty(self.size, np.int32)
        _find_diagonal(self.indptr, self.indices, self.diagonal)

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


@njit(cache=True)
def _find_slots(dofs, indptr, indices, upper, slot):  # type: ignore[no-untyped-def]
    for e in range(dofs.shape[0]):
        for i in range(dofs.shape[1]):
            for j in range(dofs.shape[1]):
                r, c = dofs[e, i], dofs[e, j]
                if r < 0 or c < 0 or (upper and c < r):
                    slot[e, i, j] = -1
                    continue
                low, high = indptr[r], indptr[r + 1] - 1
                while low < high:
                    middle = (low + high) // 2
                    if indices[middle] < c:
                        low = middle + 1
                    else:
                        high = middle
                slot[e, i, j] = low


@njit(cache=True)
def _find_diagonal(indptr, indices, diagonal):  # type: ignore[no-untyped-def]
    for r in range(diagonal.size):
        for k in range(indptr[r], indptr[r + 1]):
            if indices[k] == r:
                diagonal[r] = k
