"""The size of the factors of a matrix on a mesh, estimated from the mesh alone."""

from __future__ import annotations

import numpy as np

__all__ = ["factor_entries"]

LEAF = 60  # elements that dissection does not divide further


def factor_entries(conn: np.ndarray, X: np.ndarray, elements: np.ndarray | None = None,
                   done: np.ndarray | None = None) -> float:
    """Entries of the Cholesky factor of a scalar matrix on a mesh of elements (ne, na), ordered by nested dissection.

    The elements are halved across their longest extent again and again; the nodes that two halves share are the
    separator, eliminated after both, together with the separators around them.
    """
    if elements is None or done is None:
        elements, done = np.arange(len(conn)), np.zeros(len(X), bool)
    own = conn[elements]
    nodes = np.unique(own)
    around = int(done[nodes].sum())
    if len(elements) <= LEAF:
        inner = len(nodes) - around
        return inner * (inner / 2 + around)
    middle = X[own].mean(axis=1)
    order = np.argsort(middle[:, np.ptp(middle, axis=0).argmax()], kind="stable")
    halves = elements[order[:len(order) // 2]], elements[order[len(order) // 2:]]
    shared = np.intersect1d(conn[halves[0]], conn[halves[1]])
    shared = shared[~done[shared]]
    inner = len(shared)
    done[shared] = True
    below = sum(factor_entries(conn, X, half, done) for half in halves)
    done[shared] = False
    return below + inner * (inner / 2 + around)
