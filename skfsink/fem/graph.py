"""Which elements and nodes of a mesh are neighbours."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from ..system.jit import njit

__all__ = ["adjacency", "incidence", "node_key"]


def node_key(nodes: np.ndarray, n: int) -> np.ndarray:
    """One number for each row of nodes (m, 1 to 4) out of n, in any order; three nodes tell the faces of hexahedra."""
    ordered = np.sort(nodes, axis=1)[:, :3]
    key: np.ndarray = ordered @ (n ** np.arange(ordered.shape[1] - 1, -1, -1, dtype=np.int64))
    return key


def incidence(conn: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Elements at each of n nodes: (`start` (n+1,), `entry`), entry = na*element + local node, ascending for a node.

    `conn` (ne, na) are the nodes of the elements, unsigned.
    """
    start, entry = np.zeros(n + 1, np.int64), np.empty(conn.size, np.int64)
    np.cumsum(np.bincount(conn.ravel(), minlength=n), out=start[1:])
    _place_entries(conn, start[:-1].copy(), entry)
    return start, entry


def adjacency(conn: np.ndarray, n: int) -> csr_array:
    """Nodes that share an element, symmetric with a full diagonal, (n, n)."""
    start, entry = incidence(conn, n)
    indptr = np.zeros(n + 1, np.int32)
    seen = np.full(n, -1, np.int32)
    _count_neighbours(conn, start, entry, seen, indptr)
    indices = np.empty(indptr[-1], np.int32)
    seen[:] = -1
    _list_neighbours(conn, start, entry, seen, indptr, indices)
    return csr_array((np.ones(indices.size, np.int8), indices, indptr), shape=(n,) * 2)


@njit(cache=True)
def _place_entries(conn, place, entry):  # type: ignore[no-untyped-def]
    ne, na = conn.shape
    for e in range(ne):
        for a in range(na):
            node = conn[e, a]
            entry[place[node]] = e * na + a
            place[node] += 1


@njit(cache=True)
def _count_neighbours(conn, start, entry, seen, indptr):  # type: ignore[no-untyped-def]
    na = conn.shape[1]
    for node in range(seen.size):
        count = 0
        for k in range(start[node], start[node + 1]):
            for other in conn[entry[k] // na]:
                if seen[other] != node:
                    seen[other] = node
                    count += 1
        indptr[node + 1] = indptr[node] + count


@njit(cache=True)
def _list_neighbours(conn, start, entry, seen, indptr, indices):  # type: ignore[no-untyped-def]
    na = conn.shape[1]
    for node in range(seen.size):
        at = indptr[node]
        for k in range(start[node], start[node + 1]):
            for other in conn[entry[k] // na]:
                if seen[other] != node:
                    seen[other] = node
                    indices[at] = other
                    at += 1
        indices[indptr[node]:at].sort()
