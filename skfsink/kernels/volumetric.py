"""Volumetric stiffness of each element over its mass, tile by tile: the cheap indicator of the highest frequency.

The stiffest part of an element's tangent is  gamma_bar k V b b^T  with b = dJ_bar/du. The Rayleigh quotient of M^-1 b
is gamma_bar k V sum_a |b_a|^2/m_a over the free degrees of freedom. V b is the nodal force of the stress w cof F, so
the passes of the force loops are used again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import float64, njit, types

from . import force2d, force3d
from .lanes import FAST, LANES, LANES_3D

__all__ = ["volumetric_2d", "volumetric_3d"]

_c = types.Array
_SIGNATURE = float64(_c(types.uint32, 3, "C"), _c(float64, 2, "C"), _c(float64, 3, "C"), _c(float64, 3, "C"),
                     _c(float64, 2, "C"))


def _make(dim: int) -> Callable[..., Any]:
    na, lanes = 2**dim, (LANES if dim == 2 else LANES_3D)
    Q, rows = na * lanes, 2**dim * dim

    @njit(fastmath=FAST)
    def square(conn, b, inverse_mass, w, gamma, out):  # type: ignore[no-untyped-def]
        """gamma_bar sum_a |V b_a|^2/m_a / V; b has the rows dim * a + component."""
        for i in range(lanes):
            total, V, mean = 0.0, 0.0, 0.0
            for a in range(na):
                node = conn[a, i]
                for c in range(dim):
                    total += b[(dim * a + c) * lanes + i] ** 2 * inverse_mass[node, c]
                V += w[a * lanes + i]
                mean += w[a * lanes + i] * gamma[a * lanes + i]
            out[i] = mean * total / (V * V)

    if dim == 2:
        @njit(fastmath=FAST)
        def gradient(conn, x, geo, z, ws, ab, t, b):  # type: ignore[no-untyped-def]
            force2d._gather(conn, x, z)
            force2d._kinematics(z, geo, ws)
            force2d._stress(ws, geo, ab, t)
            force2d._nodal_force(t, b)
    else:
        @njit(fastmath=FAST)
        def gradient(conn, x, geo, z, ws, ab, t, b):  # type: ignore[no-untyped-def]
            F, P = ws[:9 * Q], ws[9 * Q:18 * Q]
            force3d._gather(conn, x, z)
            for c in range(3):
                force3d._gradient(z[8 * c * lanes:8 * (c + 1) * lanes], t)
                force3d._push(t, geo, F[3 * c * Q:3 * (c + 1) * Q])
            force3d._piola(F, ab, P)
            for c in range(3):
                force3d._pull(P[3 * c * Q:3 * (c + 1) * Q], geo, t)
                force3d._nodal_force(t, b[c * lanes:])

    @njit(_SIGNATURE, cache=True, fastmath=FAST, nogil=True)
    def loop(conn, x, geometry, gamma, inverse_mass):  # type: ignore[no-untyped-def]
        z, ws, t = np.empty(rows * lanes), np.empty(18 * Q), np.empty(4 * Q)
        ab, b, out = np.zeros(2 * Q), np.empty(rows * lanes), np.empty(lanes)
        greatest = 0.0
        for tile in range(conn.shape[0]):
            geo, gam = geometry[tile].reshape(-1), gamma[tile].reshape(-1)
            w = geo[dim * dim * Q:]
            ab[Q:] = w
            gradient(conn[tile], x, geo, z, ws, ab, t, b)
            square(conn[tile], b, inverse_mass, w, gam, out)
            for i in range(lanes):
                if out[i] > greatest:
                    greatest = out[i]
        return greatest

    return loop


volumetric_2d = _make(2)
volumetric_3d = _make(3)
