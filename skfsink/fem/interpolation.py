"""Loops over elements between nodal values and the Gauss points; arrays are those of :class:`.Space`."""

from __future__ import annotations

import numpy as np

from ..system.jit import njit

__all__ = ["at_gauss", "lump", "slopes"]


@njit(cache=True)
def at_gauss(nodal, conn, N, out):  # type: ignore[no-untyped-def]
    """out[e, q] = N[q, a] nodal[conn[e, a]]."""
    if conn.shape[1] == 4:
        for e in range(conn.shape[0]):
            x0, x1, x2, x3 = nodal[conn[e, 0]], nodal[conn[e, 1]], nodal[conn[e, 2]], nodal[conn[e, 3]]
            for q in range(4):
                out[e, q] = N[q, 0] * x0 + N[q, 1] * x1 + N[q, 2] * x2 + N[q, 3] * x3
        return
    x = np.empty(8)
    for e in range(conn.shape[0]):
        for a in range(8):
            x[a] = nodal[conn[e, a]]
        for q in range(8):
            total = 0.0
            for a in range(8):
                total += N[q, a] * x[a]
            out[e, q] = total


@njit(cache=True)
def lump(w, values, conn, N, out):  # type: ignore[no-untyped-def]
    """out[conn[e, a]] += w[e, q] values[e, q] N[q, a]."""
    if conn.shape[1] == 4:
        for e in range(conn.shape[0]):
            x0, x1 = w[e, 0] * values[e, 0], w[e, 1] * values[e, 1]
            x2, x3 = w[e, 2] * values[e, 2], w[e, 3] * values[e, 3]
            for a in range(4):
                out[conn[e, a]] += x0 * N[0, a] + x1 * N[1, a] + x2 * N[2, a] + x3 * N[3, a]
        return
    x = np.empty(8)
    for e in range(conn.shape[0]):
        for q in range(8):
            x[q] = w[e, q] * values[e, q]
        for a in range(8):
            total = 0.0
            for q in range(8):
                total += x[q] * N[q, a]
            out[conn[e, a]] += total


@njit(cache=True, nogil=True)
def slopes(unit, inverse, out):  # type: ignore[no-untyped-def]
    """out[e, q, a] = unit[q, a] . inverse[e, q]."""
    ne, nq, na, dim = out.shape
    for e in range(ne):
        for q in range(nq):
            for a in range(na):
                for j in range(dim):
                    total = 0.0
                    for k in range(dim):
                        total += unit[q, a, k] * inverse[e, q, k, j]
                    out[e, q, a, j] = total
