"""Internal force of eight-node hexahedra, tile by tile: the potential of :mod:`.force2d` with a 3x3 F.

    P = a F + b cof F,   a = 2 w gamma psi' J^(-2/3),   b = w p - a (F:F)/(3 J).

Reference gradients along a direction are the differences over the four edges in that direction, interpolated to the
four lines of Gauss points; the nodal force is the transpose of that.
"""

from __future__ import annotations

import numpy as np

from ...material.compiled import isochoric_law
from ...system.jit import njit
from .force2d import _add, _dilatation_plain, least_live
from .lanes import FAST, GAUSS_HIGH, GAUSS_LOW, J_FLOOR, continue_below_floor, guess_inverse_cbrt, refine_inverse_cbrt
from .lanes import LANES_3D as LANES

WEIGHT = 9  #: geometry: nine components of d xi/d X at the eight Gauss points, then the weights


@njit(fastmath=FAST)
def _gather(conn, x, z):  # type: ignore[no-untyped-def]
    """Positions of the nodes by component, then node: z (24 L)."""
    for a in range(8):
        for i in range(LANES):
            node = conn[a, i]
            z[a * LANES + i] = x[node, 0]
            z[(8 + a) * LANES + i] = x[node, 1]
            z[(16 + a) * LANES + i] = x[node, 2]


@njit(fastmath=FAST)
def _to_lines(e0, e1, e2, e3):  # type: ignore[no-untyped-def]
    """Values on the four lines of Gauss points, from those on the four edges; its own transpose."""
    a0, a1 = GAUSS_HIGH * e0 + GAUSS_LOW * e1, GAUSS_LOW * e0 + GAUSS_HIGH * e1
    b0, b1 = GAUSS_HIGH * e2 + GAUSS_LOW * e3, GAUSS_LOW * e2 + GAUSS_HIGH * e3
    return (GAUSS_HIGH * a0 + GAUSS_LOW * b0, GAUSS_HIGH * a1 + GAUSS_LOW * b1,
            GAUSS_LOW * a0 + GAUSS_HIGH * b0, GAUSS_LOW * a1 + GAUSS_HIGH * b1)


@njit(fastmath=FAST)
def _gradient(z, g):  # type: ignore[no-untyped-def]
    """One component's reference gradient, by direction and Gauss point, g (24 L), from its nodal values, z (8 L)."""
    L = LANES
    for i in range(L):
        x0, x1, x2, x3 = z[i], z[L + i], z[2 * L + i], z[3 * L + i]
        x4, x5, x6, x7 = z[4 * L + i], z[5 * L + i], z[6 * L + i], z[7 * L + i]
        a, b, c, d = _to_lines(x1 - x0, x3 - x2, x5 - x4, x7 - x6)
        g[i], g[L + i], g[2 * L + i], g[3 * L + i] = a, a, b, b
        g[4 * L + i], g[5 * L + i], g[6 * L + i], g[7 * L + i] = c, c, d, d
        a, b, c, d = _to_lines(x2 - x0, x3 - x1, x6 - x4, x7 - x5)
        g[8 * L + i], g[9 * L + i], g[10 * L + i], g[11 * L + i] = a, b, a, b
        g[12 * L + i], g[13 * L + i], g[14 * L + i], g[15 * L + i] = c, d, c, d
        a, b, c, d = _to_lines(x4 - x0, x5 - x1, x6 - x2, x7 - x3)
        g[16 * L + i], g[17 * L + i], g[18 * L + i], g[19 * L + i] = a, b, c, d
        g[20 * L + i], g[21 * L + i], g[22 * L + i], g[23 * L + i] = a, b, c, d


@njit(fastmath=FAST)
def _nodal_force(t, out):  # type: ignore[no-untyped-def]
    """Transpose of :func:`_gradient`: component c of the nodal forces, rows 3 a + c of `out` beginning at its row c."""
    L = LANES
    for i in range(L):
        x0, x1, x2, x3 = _to_lines(t[i] + t[L + i], t[2 * L + i] + t[3 * L + i],
                                   t[4 * L + i] + t[5 * L + i], t[6 * L + i] + t[7 * L + i])
        y0, y1, y2, y3 = _to_lines(t[8 * L + i] + t[10 * L + i], t[9 * L + i] + t[11 * L + i],
                                   t[12 * L + i] + t[14 * L + i], t[13 * L + i] + t[15 * L + i])
        z0, z1, z2, z3 = _to_lines(t[16 * L + i] + t[20 * L + i], t[17 * L + i] + t[21 * L + i],
                                   t[18 * L + i] + t[22 * L + i], t[19 * L + i] + t[23 * L + i])
        out[i] = -x0 - y0 - z0
        out[3 * L + i] = x0 - y1 - z1
        out[6 * L + i] = -x1 + y0 - z2
        out[9 * L + i] = x1 + y1 - z3
        out[12 * L + i] = -x2 - y2 + z0
        out[15 * L + i] = x2 - y3 + z1
        out[18 * L + i] = -x3 + y2 + z2
        out[21 * L + i] = x3 + y3 + z3


@njit(fastmath=FAST)
def _push(g, k, F):  # type: ignore[no-untyped-def]
    """One row of F, F_iJ = sum_d (dx_i/dxi_d) (dxi_d/dX_J), at all Gauss points; g (3, Q), k (9, Q), F (3, Q)."""
    Q = 8 * LANES
    for i in range(Q):
        a, b, c = g[i], g[Q + i], g[2 * Q + i]
        F[i] = a * k[i] + b * k[3 * Q + i] + c * k[6 * Q + i]
        F[Q + i] = a * k[Q + i] + b * k[4 * Q + i] + c * k[7 * Q + i]
        F[2 * Q + i] = a * k[2 * Q + i] + b * k[5 * Q + i] + c * k[8 * Q + i]


@njit(fastmath=FAST)
def _deformation(conn, x, geo, z, g, F):  # type: ignore[no-untyped-def]
    """F, or its rate, (9, Q), from positions or velocities x (n, 3) of the nodes conn; z (24 L), g (3 Q): scratch."""
    L, Q = LANES, 8 * LANES
    _gather(conn, x, z)
    for c in range(3):
        _gradient(z[8 * c * L:8 * (c + 1) * L], g)
        _push(g, geo, F[3 * c * Q:3 * (c + 1) * Q])


@njit(fastmath=FAST)
def _invariants(F, J, floored, tr):  # type: ignore[no-untyped-def]
    Q = 8 * LANES
    for i in range(Q):
        f0, f1, f2, f3, f4 = F[i], F[Q + i], F[2 * Q + i], F[3 * Q + i], F[4 * Q + i]
        f5, f6, f7, f8 = F[5 * Q + i], F[6 * Q + i], F[7 * Q + i], F[8 * Q + i]
        det = f0 * (f4 * f8 - f5 * f7) - f1 * (f3 * f8 - f5 * f6) + f2 * (f3 * f7 - f4 * f6)
        J[i] = det
        floored[i] = det if det > J_FLOOR else J_FLOOR
        tr[i] = f0 * f0 + f1 * f1 + f2 * f2 + f3 * f3 + f4 * f4 + f5 * f5 + f6 * f6 + f7 * f7 + f8 * f8


@njit(fastmath=FAST)
def _means(w, J, gamma, mean):  # type: ignore[no-untyped-def]
    """Rows of mean: V, V J_bar, V gamma_bar."""
    L = LANES
    for i in range(3 * L):
        mean[i] = 0.0
    for q in range(8):
        for i in range(L):
            mean[i] += w[q * L + i]
        for i in range(L):
            mean[L + i] += w[q * L + i] * J[q * L + i]
        for i in range(L):
            mean[2 * L + i] += w[q * L + i] * gamma[q * L + i]


@njit(fastmath=FAST)
def _dilatation(mean, k_bulk, pressure, volumetric):  # type: ignore[no-untyped-def]
    L = LANES
    for i in range(L):
        dilatation = mean[L + i] / mean[i] - 1.0
        pressure[i] = mean[2 * L + i] / mean[i] * k_bulk * dilatation
        volumetric[i] = 0.5 * k_bulk * dilatation * dilatation
    for q in range(1, 8):
        for i in range(L):
            pressure[q * L + i] = pressure[i]
        for i in range(L):
            volumetric[q * L + i] = volumetric[i]


@njit(fastmath=FAST)
def _coefficients(w, gamma, dpsi, R, pressure, ab):  # type: ignore[no-untyped-def]
    Q = 8 * LANES
    for i in range(Q):
        ab[i] = 2.0 * w[i] * gamma[i] * dpsi[i] * R[i]
        ab[Q + i] = w[i] * pressure[i]


@njit(fastmath=FAST)
def _deviator(ab, tr, inverse):  # type: ignore[no-untyped-def]
    Q = 8 * LANES
    for i in range(Q):
        ab[Q + i] -= ab[i] * tr[i] * inverse[i] * (1 / 3.0)


@njit(fastmath=FAST)
def _piola(F, ab, P):  # type: ignore[no-untyped-def]
    Q = 8 * LANES
    for i in range(Q):
        A, B = ab[i], ab[Q + i]
        f0, f1, f2, f3, f4 = F[i], F[Q + i], F[2 * Q + i], F[3 * Q + i], F[4 * Q + i]
        f5, f6, f7, f8 = F[5 * Q + i], F[6 * Q + i], F[7 * Q + i], F[8 * Q + i]
        P[i] = A * f0 + B * (f4 * f8 - f5 * f7)
        P[Q + i] = A * f1 + B * (f5 * f6 - f3 * f8)
        P[2 * Q + i] = A * f2 + B * (f3 * f7 - f4 * f6)
        P[3 * Q + i] = A * f3 + B * (f2 * f7 - f1 * f8)
        P[4 * Q + i] = A * f4 + B * (f0 * f8 - f2 * f6)
        P[5 * Q + i] = A * f5 + B * (f1 * f6 - f0 * f7)
        P[6 * Q + i] = A * f6 + B * (f1 * f5 - f2 * f4)
        P[7 * Q + i] = A * f7 + B * (f2 * f3 - f0 * f5)
        P[8 * Q + i] = A * f8 + B * (f0 * f4 - f1 * f3)


@njit(fastmath=FAST)
def _pull(P, k, t):  # type: ignore[no-untyped-def]
    """One row of T_id = P_iJ dxi_d/dX_J; P (3, Q), k (9, Q), t (3, Q)."""
    Q = 8 * LANES
    for i in range(Q):
        a, b, c = P[i], P[Q + i], P[2 * Q + i]
        t[i] = a * k[i] + b * k[Q + i] + c * k[2 * Q + i]
        t[Q + i] = a * k[3 * Q + i] + b * k[4 * Q + i] + c * k[5 * Q + i]
        t[2 * Q + i] = a * k[6 * Q + i] + b * k[7 * Q + i] + c * k[8 * Q + i]


@njit(fastmath=FAST)
def _product(a, b, out):  # type: ignore[no-untyped-def]
    for i in range(a.size):
        out[i] = a[i] * b[i]


@njit(fastmath=FAST)
def _energy(w, gamma, W, psi):  # type: ignore[no-untyped-def]
    for i in range(LANES):
        psi[i] = 0.0
    for q in range(8):
        for i in range(LANES):
            psi[i] += w[q * LANES + i] * gamma[q * LANES + i] * W[q * LANES + i]


@njit(cache=True, fastmath=FAST, nogil=True)
def force_3d(address, constants, volumetric_part, x, elements):  # type: ignore[no-untyped-def]
    law = isochoric_law(address)
    k_bulk, j_bar = volumetric_part.bulk_modulus, volumetric_part.j_bar
    conn, geometry, gamma = elements.conn, elements.geometry, elements.gamma
    force, W, psi = elements.force, elements.W, elements.psi
    L, Q = LANES, 8 * LANES
    z, g, t = np.empty(24 * L), np.empty(3 * Q), np.empty(3 * Q)
    F, P = np.empty(9 * Q), np.empty(9 * Q)
    J, floored, tr, R, I1 = np.empty(Q), np.empty(Q), np.empty(Q), np.empty(Q), np.empty(Q)
    psi_q, dpsi, ddpsi, ab, mean = np.empty(Q), np.empty(Q), np.empty(Q), np.empty(2 * Q), np.empty(3 * L)
    pressure, volumetric = np.empty(Q), np.empty(Q)
    least = np.ones(Q)
    for tile in range(conn.shape[0]):
        geo, gam = geometry[tile].reshape(-1), gamma[tile].reshape(-1)
        w = geo[WEIGHT * Q:]
        _deformation(conn[tile], x, geo, z, g, F)
        _invariants(F, J, floored, tr)
        least_live(J, gam, least)
        guess_inverse_cbrt(floored.view(np.int64), R.view(np.int64))
        refine_inverse_cbrt(floored, R)
        continue_below_floor(J, floored, R)
        _product(R, tr, I1)
        law(I1, constants, psi_q, dpsi, ddpsi)
        if j_bar:
            _means(w, J, gam, mean)
            _dilatation(mean, k_bulk, pressure, volumetric)
        else:
            _dilatation_plain(gam, k_bulk, J, pressure, volumetric)
        _coefficients(w, gam, dpsi, R, pressure, ab)
        _deviator(ab, tr, floored)  # by now 1/J
        _piola(F, ab, P)
        density, out = W[tile].reshape(-1), force[tile].reshape(-1)
        for c in range(3):
            _pull(P[3 * c * Q:3 * (c + 1) * Q], geo, t)
            _nodal_force(t, out[c * L:])
        _add(psi_q, volumetric, density)
        _energy(w, gam, density, psi[tile])
    return least.min()
