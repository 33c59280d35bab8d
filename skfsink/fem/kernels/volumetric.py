"""Volumetric stiffness of each element over its mass, tile by tile: the cheap indicator of the highest frequency.

The stiffest part of an element's tangent is  gamma_bar k V b b^T  with b = dJ_bar/du. The Rayleigh quotient of M^-1 b
is gamma_bar k V sum_a |b_a|^2/m_a over the free degrees of freedom. V b is the nodal force of the stress w cof F, so
the passes of the force loops are used again.
"""

from __future__ import annotations

import numpy as np

from ...system.jit import njit
from . import force2d, force3d
from .hoop import AROUND, add_hoop_force, hoop_stress, ratio_around
from .lanes import FAST, LANES, LANES_3D

__all__ = ["volumetric_2d", "volumetric_3d"]


@njit(fastmath=FAST)
def _greatest(conn, b, inverse_mass, w, gamma, sums):  # type: ignore[no-untyped-def]
    """The greatest gamma_bar sum_a |V b_a|^2/m_a / V over the lanes; b has the rows dim * a + i."""
    na, lanes = conn.shape
    dim = inverse_mass.shape[1]
    square, V, mean = sums[:lanes], sums[lanes:2 * lanes], sums[2 * lanes:]
    sums[:] = 0.0
    for a in range(na):
        for c in range(dim):
            row = b[(dim * a + c) * lanes:(dim * a + c + 1) * lanes]
            for i in range(lanes):
                square[i] += row[i] * row[i] * inverse_mass[conn[a, i], c]
        for i in range(lanes):
            V[i] += w[a * lanes + i]
            mean[i] += w[a * lanes + i] * gamma[a * lanes + i]
    greatest = 0.0
    for i in range(lanes):
        value = mean[i] * square[i] / (V[i] * V[i])
        greatest = value if value > greatest else greatest
    return greatest


@njit(cache=True, fastmath=FAST, nogil=True)
def volumetric_2d(x, elements, inverse_mass):  # type: ignore[no-untyped-def]
    conn, geometry, gamma = elements.conn, elements.geometry, elements.gamma
    Q = 4 * LANES
    z, ws, t = np.empty(8 * LANES), np.empty(force2d.ROWS * LANES), np.empty(4 * Q)
    ab, b, sums = np.zeros(2 * Q), np.empty(8 * LANES), np.empty(3 * LANES)
    f, hoop, revolved = force2d.points(ws, force2d.HOOP), np.empty(Q), geometry.shape[1] > AROUND
    greatest = 0.0
    for tile in range(conn.shape[0]):
        geo, w = geometry[tile].reshape(-1), geometry[tile].reshape(-1)[force2d.WEIGHT * LANES:]
        ab[Q:] = w[:Q]
        force2d._gather(conn[tile], x, z)
        force2d._kinematics(z, geo, ws)
        if revolved:
            ratio_around(z, geo[AROUND * LANES:], f)
            hoop_stress(ws, f, geo[AROUND * LANES:], ab, hoop)
        force2d._stress(ws, geo, ab, t)
        force2d._nodal_force(t, b)
        if revolved:
            add_hoop_force(hoop, b)
        found = _greatest(conn[tile], b, inverse_mass, w, gamma[tile].reshape(-1), sums)
        greatest = found if found > greatest else greatest
    return greatest


@njit(cache=True, fastmath=FAST, nogil=True)
def volumetric_3d(x, elements, inverse_mass):  # type: ignore[no-untyped-def]
    conn, geometry, gamma = elements.conn, elements.geometry, elements.gamma
    L, Q = LANES_3D, 8 * LANES_3D
    z, F, P, t = np.empty(24 * L), np.empty(9 * Q), np.empty(9 * Q), np.empty(4 * Q)
    ab, b, sums = np.zeros(2 * Q), np.empty(24 * L), np.empty(3 * L)
    greatest = 0.0
    for tile in range(conn.shape[0]):
        geo, w = geometry[tile].reshape(-1), geometry[tile].reshape(-1)[force3d.WEIGHT * Q:]
        ab[Q:] = w
        force3d._deformation(conn[tile], x, geo, z, t, F)
        force3d._piola(F, ab, P)
        for c in range(3):
            force3d._pull(P[3 * c * Q:3 * (c + 1) * Q], geo, t)
            force3d._nodal_force(t, b[c * L:])
        found = _greatest(conn[tile], b, inverse_mass, w, gamma[tile].reshape(-1), sums)
        greatest = found if found > greatest else greatest
    return greatest
