"""Viscous force of quadrilaterals and hexahedra, tile by tile, from positions and velocities.

With l = (dF/dt) cof F^T, whose trace is dJ/dt, the rate of deformation is d = sym(l)/J_e, and the force on node a is
sum_q P_q Grad N_a  with

    P = s cof F,   s = 2 w gamma eta/J_e [sym l - 1/3 tr(l) 1] + w gamma_bar q 1,
    q = rho0 c_d L [b1 - b2^2 L/c_d min(0, D)] D,   D = dJ_bar/dt = sum_q w tr(l)/V,   L = V^(1/dim).

In a body of revolution F and dF/dt have the components r/R and v_r/R around it, and L is the root of the section.
A thin sheet is incompressible: d_33 = -tr d, and without stress across it s = 2 w gamma eta/J_e^2 [sym l + tr(l) 1].
J_e is J, or what takes its place in a crushed point. The power of this force is never negative.

The loops run only where a viscosity is not zero, and leave nothing behind but the forces.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...system.jit import njit
from ..pattern import Pattern
from ..space import Space
from . import force2d, force3d
from .hoop import AROUND, add_hoop_force, hoop_stretch, rate_around, ratio_around, viscous_stress
from .lanes import FAST, J_FLOOR, LANES, LANES_3D, crush_factor
from .pieces import Pieces
from .records import Viscous
from .tangent import _cofactor, parts

__all__ = ["viscous_2d", "viscous_3d", "viscous_tangent"]

_Q, _Q3 = 4 * LANES, 8 * LANES_3D


@njit(fastmath=FAST)
def _inverse(J, sheet, inverse):  # type: ignore[no-untyped-def]
    """1/J_e, of a thin sheet its square."""
    for i in range(J.size):
        one = 1.0 / (J[i] if J[i] > J_FLOOR else J_FLOOR * crush_factor(J[i]))
        inverse[i] = one * one if sheet else one


@njit(fastmath=FAST)
def _bulk(w, around, gamma, rate, viscous, dim, sums, q):  # type: ignore[no-untyped-def]
    """gamma_bar q of each lane, from the rate of J at the points; returns the greatest compression of a live lane.

    `around` is 1/R of a body of revolution, and empty of others.
    """
    L = q.size
    V, mean, D, section = sums[:L], sums[L:2 * L], sums[2 * L:3 * L], sums[3 * L:]
    sums[:] = 0.0
    for a in range(w.size // L):
        for i in range(L):
            k = a * L + i
            V[i] += w[k]
            mean[i] += w[k] * gamma[k]
            D[i] += w[k] * rate[k]
    if around.size:
        for a in range(w.size // L):
            for i in range(L):
                section[i] += w[a * L + i] * around[a * L + i] / (2.0 * np.pi)
    else:
        section[:] = V
    greatest = 0.0
    for i in range(L):
        D[i] /= V[i]
        length = section[i] ** (1.0 / dim)
        compression = -length / viscous.speed * D[i] if D[i] < 0.0 else 0.0
        q[i] = (mean[i] / V[i] * viscous.impedance * length * D[i]
                * (viscous.linear + viscous.quadratic**2 * compression))
        greatest = compression if compression > greatest and mean[i] > 0.0 else greatest
    return greatest


# --- quadrilaterals ---
@njit(fastmath=FAST)
def _rate_2d(F, G, rate):  # type: ignore[no-untyped-def]
    Q = _Q
    for i in range(Q):
        rate[i] = G[i] * F[3 * Q + i] - G[Q + i] * F[2 * Q + i] - G[2 * Q + i] * F[Q + i] + G[3 * Q + i] * F[i]


@njit(fastmath=FAST)
def _stress_2d(F, G, geo, c, side, wq, t):  # type: ignore[no-untyped-def]
    """Stress pulled back to the reference square; `c` is w gamma 2 eta times a power of 1/J_e, `wq` the bulk part."""
    Q = _Q
    for i in range(Q):
        f0, f1, f2, f3 = F[i], F[Q + i], F[2 * Q + i], F[3 * Q + i]
        g0, g1, g2, g3 = G[i], G[Q + i], G[2 * Q + i], G[3 * Q + i]
        k0, k1, k2, k3 = geo[i], geo[Q + i], geo[2 * Q + i], geo[3 * Q + i]
        l00, l01, l10, l11 = g0 * f3 - g1 * f2, g1 * f0 - g0 * f1, g2 * f3 - g3 * f2, g3 * f0 - g2 * f1
        around = c[i] * side * (l00 + l11) + wq[i]
        s00, s11, s01 = c[i] * l00 + around, c[i] * l11 + around, 0.5 * c[i] * (l01 + l10)
        P0, P1, P2, P3 = s00 * f3 - s01 * f1, s01 * f0 - s00 * f2, s01 * f3 - s11 * f1, s11 * f0 - s01 * f2
        t[i] = P0 * k0 + P1 * k1
        t[Q + i] = P0 * k2 + P1 * k3
        t[2 * Q + i] = P2 * k0 + P3 * k1
        t[3 * Q + i] = P2 * k2 + P3 * k3


@njit(fastmath=FAST)
def _factors(w, gamma, inverse, eta, q, c, wq):  # type: ignore[no-untyped-def]
    L = q.size
    for a in range(w.size // L):
        for i in range(L):
            k = a * L + i
            c[k] = 2.0 * eta * w[k] * gamma[k] * inverse[k]
            wq[k] = w[k] * q[i]


@njit(cache=True, fastmath=FAST, nogil=True)
def viscous_2d(viscous, x, v, elements):  # type: ignore[no-untyped-def]
    """Fills `elements.force`; returns the greatest compression -L/c_d min(0, D) of an element with gamma > 0."""
    conn, geometry, gamma = elements.conn, elements.geometry, elements.gamma
    side = 1.0 if viscous.sheet else -1.0 / 3.0
    bulk = viscous.linear > 0.0 or viscous.quadratic > 0.0
    F, G = np.empty(force2d.ROWS * LANES), np.empty(force2d.ROWS * LANES)
    z, t, inverse, rate = np.empty(8 * LANES), np.empty(4 * _Q), np.empty(_Q), np.empty(_Q)
    c, wq, sums, q = np.empty(_Q), np.empty(_Q), np.empty(4 * LANES), np.zeros(LANES)
    J, floored = force2d.points(F, force2d.J_ROW), force2d.points(F, force2d.FLOORED)
    tr, f = force2d.points(F, force2d.TRACE), force2d.points(F, force2d.HOOP)
    ratio, hoop, revolved = force2d.points(G, force2d.HOOP), np.empty(_Q), geometry.shape[1] > AROUND
    greatest = 0.0
    for tile in range(conn.shape[0]):
        geo, g = geometry[tile].reshape(-1), gamma[tile].reshape(-1)
        w, around = geo[force2d.WEIGHT * LANES:(force2d.WEIGHT + 4) * LANES], geo[AROUND * LANES:]
        out = elements.force[tile].reshape(-1)
        force2d._gather(conn[tile], x, z)
        force2d._kinematics(z, geo, F)
        if revolved:
            ratio_around(z, around, f)
            hoop_stretch(f, J, floored, tr)
        force2d._gather(conn[tile], v, z)
        force2d._kinematics(z, geo, G)
        if revolved:
            ratio_around(z, around, ratio)
        _inverse(J, viscous.sheet, inverse)
        if bulk:
            _rate_2d(F, G, rate)
            if revolved:
                rate_around(F, f, ratio, rate)
            found = _bulk(w, around, g, rate, viscous, 2, sums, q)
            greatest = found if found > greatest else greatest
        _factors(w, g, inverse, viscous.eta, q, c, wq)
        if revolved:
            viscous_stress(F, G, f, ratio, geo, c, wq, t, hoop)
        else:
            _stress_2d(F, G, geo, c, side, wq, t)
        force2d._nodal_force(t, out)
        if revolved:
            add_hoop_force(hoop, out)
    return greatest


# --- hexahedra ---
@njit(fastmath=FAST)
def _cofactors(F, C):  # type: ignore[no-untyped-def]
    Q = _Q3
    for i in range(Q):
        f0, f1, f2, f3, f4 = F[i], F[Q + i], F[2 * Q + i], F[3 * Q + i], F[4 * Q + i]
        f5, f6, f7, f8 = F[5 * Q + i], F[6 * Q + i], F[7 * Q + i], F[8 * Q + i]
        C[i], C[Q + i], C[2 * Q + i] = f4 * f8 - f5 * f7, f5 * f6 - f3 * f8, f3 * f7 - f4 * f6
        C[3 * Q + i], C[4 * Q + i], C[5 * Q + i] = f2 * f7 - f1 * f8, f0 * f8 - f2 * f6, f1 * f6 - f0 * f7
        C[6 * Q + i], C[7 * Q + i], C[8 * Q + i] = f1 * f5 - f2 * f4, f2 * f3 - f0 * f5, f0 * f4 - f1 * f3


@njit(fastmath=FAST)
def _turned(C, G, l, rate):  # type: ignore[no-untyped-def]
    """The rows l_00, l_11, l_22 and twice the symmetric l_01, l_02, l_12; and their trace."""
    Q = _Q3
    for i in range(Q):
        c0, c1, c2, c3, c4 = C[i], C[Q + i], C[2 * Q + i], C[3 * Q + i], C[4 * Q + i]
        c5, c6, c7, c8 = C[5 * Q + i], C[6 * Q + i], C[7 * Q + i], C[8 * Q + i]
        g0, g1, g2, g3, g4 = G[i], G[Q + i], G[2 * Q + i], G[3 * Q + i], G[4 * Q + i]
        g5, g6, g7, g8 = G[5 * Q + i], G[6 * Q + i], G[7 * Q + i], G[8 * Q + i]
        l0, l1, l2 = g0 * c0 + g1 * c1 + g2 * c2, g3 * c3 + g4 * c4 + g5 * c5, g6 * c6 + g7 * c7 + g8 * c8
        l[i], l[Q + i], l[2 * Q + i] = l0, l1, l2
        l[3 * Q + i] = g0 * c3 + g1 * c4 + g2 * c5 + g3 * c0 + g4 * c1 + g5 * c2
        l[4 * Q + i] = g0 * c6 + g1 * c7 + g2 * c8 + g6 * c0 + g7 * c1 + g8 * c2
        l[5 * Q + i] = g3 * c6 + g4 * c7 + g5 * c8 + g6 * c3 + g7 * c4 + g8 * c5
        rate[i] = l0 + l1 + l2


@njit(fastmath=FAST)
def _piola_3d(C, l, rate, c, wq, P):  # type: ignore[no-untyped-def]
    Q = _Q3
    for i in range(Q):
        c0, c1, c2, c3, c4 = C[i], C[Q + i], C[2 * Q + i], C[3 * Q + i], C[4 * Q + i]
        c5, c6, c7, c8 = C[5 * Q + i], C[6 * Q + i], C[7 * Q + i], C[8 * Q + i]
        around = wq[i] - c[i] * rate[i] * (1 / 3.0)
        s00, s11, s22 = c[i] * l[i] + around, c[i] * l[Q + i] + around, c[i] * l[2 * Q + i] + around
        s01, s02, s12 = 0.5 * c[i] * l[3 * Q + i], 0.5 * c[i] * l[4 * Q + i], 0.5 * c[i] * l[5 * Q + i]
        P[i], P[Q + i], P[2 * Q + i] = (s00 * c0 + s01 * c3 + s02 * c6, s00 * c1 + s01 * c4 + s02 * c7,
                                        s00 * c2 + s01 * c5 + s02 * c8)
        P[3 * Q + i], P[4 * Q + i], P[5 * Q + i] = (s01 * c0 + s11 * c3 + s12 * c6, s01 * c1 + s11 * c4 + s12 * c7,
                                                    s01 * c2 + s11 * c5 + s12 * c8)
        P[6 * Q + i], P[7 * Q + i], P[8 * Q + i] = (s02 * c0 + s12 * c3 + s22 * c6, s02 * c1 + s12 * c4 + s22 * c7,
                                                    s02 * c2 + s12 * c5 + s22 * c8)


@njit(cache=True, fastmath=FAST, nogil=True)
def viscous_3d(viscous, x, v, elements):  # type: ignore[no-untyped-def]
    """Results as of :func:`viscous_2d`."""
    conn, geometry, gamma = elements.conn, elements.geometry, elements.gamma
    L, Q = LANES_3D, _Q3
    bulk = viscous.linear > 0.0 or viscous.quadratic > 0.0
    z, t, l = np.empty(24 * L), np.empty(3 * Q), np.empty(6 * Q)
    F, G, C, P = np.empty(9 * Q), np.empty(9 * Q), np.empty(9 * Q), np.empty(9 * Q)
    J, floored, tr, inverse, rate = np.empty(Q), np.empty(Q), np.empty(Q), np.empty(Q), np.empty(Q)
    c, wq, sums, q = np.empty(Q), np.empty(Q), np.empty(4 * L), np.zeros(L)
    greatest = 0.0
    for tile in range(conn.shape[0]):
        geo, g = geometry[tile].reshape(-1), gamma[tile].reshape(-1)
        w = geo[force3d.WEIGHT * Q:]
        force3d._deformation(conn[tile], x, geo, z, t, F)
        force3d._deformation(conn[tile], v, geo, z, t, G)
        force3d._invariants(F, J, floored, tr)
        _inverse(J, False, inverse)
        _cofactors(F, C)
        _turned(C, G, l, rate)
        if bulk:
            found = _bulk(w, w[:0], g, rate, viscous, 3, sums, q)
            greatest = found if found > greatest else greatest
        _factors(w, g, inverse, viscous.eta, q, c, wq)
        _piola_3d(C, l, rate, c, wq, P)
        out = elements.force[tile].reshape(-1)
        for i in range(3):
            force3d._pull(P[3 * i * Q:3 * (i + 1) * Q], geo, t)
            force3d._nodal_force(t, out[i * L:])
    return greatest


# --- the derivative with the velocity ---
def viscous_tangent(space: Space, pattern: Pattern, viscous: Viscous, motion: tuple[np.ndarray, np.ndarray],
                    gamma: np.ndarray, *, compression: float = 0.0, elements: np.ndarray | None = None,
                    threads: int = 1) -> np.ndarray:
    """Data of the derivative of the viscous force with the velocity on `pattern`; symmetric, and never negative.

    `motion` are displacement and velocity (n, dim), `gamma` the densities (ne, nq). Each element counts as compressed
    by -L/c_d min(0, D) = `compression` at least. With `elements` it is that of these alone.
    """
    u, v = motion
    loop = _tangent_around if space.axisymmetric else _tangent_2d if space.dim == 2 else _tangent_3d
    pieces = Pieces(space, pattern, gamma, elements)
    return pieces.assemble(lambda piece, data: loop(viscous, compression, (space.X + u, v), piece, data), threads)


def _make(dim: int, revolved: bool = False) -> Callable[..., Any]:
    """The element loop for one dimension."""
    na = 2**dim
    nd = na * dim
    deformation, coupling, scatter = parts(dim, revolved)

    @njit(cache=True, fastmath={"contract", "arcp", "nsz", "reassoc"}, nogil=True)
    def loop(viscous, compression, motion, piece, data):  # type: ignore[no-untyped-def]
        x, v = motion
        side = 1.0 if viscous.sheet else -1.0 / 3.0
        conn, dN, w, gamma, slot = piece.conn, piece.dN, piece.w, piece.gamma, piece.slot
        K, b, factor = np.empty((nd, nd)), np.empty(nd), np.empty(na)
        g, turn, ring = np.empty((na, nd)), np.empty((na, nd)), np.empty(na)  # turn: of g what is in the plane
        F, C = np.empty((3, 3)), np.empty((3, 3))
        for e in range(conn.shape[0]):
            b[:] = 0.0
            V, gamma_bar, D, extent = 0.0, 0.0, 0.0, 0.0
            for q in range(na):
                deformation(x, piece, e, q, F)
                _cofactor(F, C)
                J = F[0, 0] * C[0, 0] + F[0, 1] * C[0, 1] + F[0, 2] * C[0, 2]
                J_e = J if J > J_FLOOR else J_FLOOR * crush_factor(J)
                factor[q] = 2.0 * viscous.eta * w[e, q] * gamma[e, q] * (1.0 if viscous.sheet else J_e)
                for a in range(na):
                    for i in range(dim):
                        s = 0.0
                        for j in range(dim):
                            s += C[i, j] * dN[e, q, a, j]
                        turn[q, dim * a + i] = s / J_e
                        if revolved and i == 0:
                            s += C[2, 2] * piece.around[e, q, a]
                        b[dim * a + i] += w[e, q] * s
                        g[q, dim * a + i] = s / J_e
                if revolved:
                    ring[q] = (C[2, 2] / J_e) ** 2
                    for a in range(na):
                        extent += w[e, q] * piece.around[e, q, a] / (2.0 * np.pi)
                V += w[e, q]
                gamma_bar += w[e, q] * gamma[e, q]
            for a in range(na):
                for i in range(dim):
                    D += b[dim * a + i] * v[conn[e, a], i]
            length = (extent if revolved else V) ** (1.0 / dim)
            counted = max(compression, -length / viscous.speed * D / V)
            slope = viscous.impedance * length * (viscous.linear + 2.0 * viscous.quadratic**2 * counted)
            coupling(gamma_bar / V * slope / V, b, K)
            for q in range(na):
                for a in range(na):
                    for bb in range(a, na):
                        s = 0.0
                        for j in range(dim):
                            s += turn[q, dim * a + j] * turn[q, dim * bb + j]
                        for i in range(dim):
                            for k in range(dim):
                                K[dim * a + i, dim * bb + k] += factor[q] * (
                                    0.5 * turn[q, dim * a + k] * turn[q, dim * bb + i]
                                    + side * g[q, dim * a + i] * g[q, dim * bb + k])
                            K[dim * a + i, dim * bb + i] += factor[q] * 0.5 * s
                        if revolved:
                            K[dim * a, dim * bb] += (factor[q] * ring[q] * piece.around[e, q, a]
                                                     * piece.around[e, q, bb])
            scatter(K, slot, e, data)

    return loop


_tangent_2d = _make(2)
_tangent_around = _make(2, revolved=True)
_tangent_3d = _make(3)
