"""The pass that gives the element loops a new relative density and books the stored energy its fall takes, and a pass
that finds the elements without force at a density.
"""

from __future__ import annotations

import numpy as np

from ...system.jit import njit

__all__ = ["relax", "without_force"]


@njit(cache=True, nogil=True)
def relax(nodal, N, deleted, floor, elements):  # type: ignore[no-untyped-def]
    """Values at the Gauss points of the nodal field, zero below `floor` and where `deleted`, into `elements.gamma`.

    Returns  sum_q w_q W_q (old - new), with W as last evaluated.
    """
    conn, geometry, W, gamma = elements.conn, elements.geometry, elements.W, elements.gamma
    tiles, na, lanes = conn.shape
    first = 16 if na == 4 else 72  # weights come after d xi/d X
    x, value, total = np.empty((na, lanes)), np.empty(lanes), 0.0
    for b in range(tiles):
        for a in range(na):
            for i in range(lanes):
                x[a, i] = nodal[conn[b, a, i]]
        for q in range(na):
            value[:] = 0.0
            for a in range(na):
                shape = N[q, a]
                for i in range(lanes):
                    value[i] += shape * x[a, i]
            for i in range(lanes):
                new = 0.0 if value[i] < floor or deleted[b, i] else value[i]
                total += geometry[b, first + q, i] * W[b, q, i] * (gamma[b, q, i] - new)
                gamma[b, q, i] = new
    return total


@njit(cache=True)
def without_force(conn, nodal, N, deleted, floor, out):  # type: ignore[no-untyped-def]
    """Whether elements are `deleted`, or the nodal field is below `floor` at all their Gauss points, to `out` (ne,)."""
    na = conn.shape[1]
    for e in range(conn.shape[0]):
        count = 0
        for a in range(na):
            count += nodal[conn[e, a]] < floor
        out[e] = deleted[e] or count == na
        if 0 < count < na and not out[e]:
            fails = True
            for q in range(na):
                value = 0.0
                for a in range(na):
                    value += N[q, a] * nodal[conn[e, a]]
                if value >= floor:
                    fails = False
                    break
            out[e] = fails
