"""Internal force of eight-node hexahedra, tile by tile: the potential of :mod:`.force2d` with a 3x3 F.

    P = a F + b cof F,   a = 2 w gamma psi' J^(-2/3),   b = w p - a (F:F)/(3 J).

Reference gradients along direction d are the differences over the four edges in that direction, interpolated to the
four lines of Gauss points; the nodal force is the transpose of that.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .force2d import _SIGNATURE, _add, _dilatation_plain, least_live
from .lanes import FAST, GAUSS_HIGH, GAUSS_LOW, J_FLOOR, guess_inverse_cbrt, refine_inverse_cbrt
from .lanes import LANES_3D as LANES

# edges in direction d: first nodes; the second node is 2^d further. Edge m is at (m & 1, m >> 1) across.
_EDGES = np.array([[0, 2, 4, 6], [0, 1, 4, 5], [0, 1, 2, 3]])
# line of Gauss points in direction d on which Gauss point q lies
_LINE = np.array([[(q >> 1) & 1 | (q >> 2 & 1) << 1 for q in range(8)],
                  [q & 1 | (q >> 2 & 1) << 1 for q in range(8)],
                  [q & 1 | (q >> 1 & 1) << 1 for q in range(8)]])
_C = np.array([[GAUSS_HIGH, GAUSS_LOW], [GAUSS_LOW, GAUSS_HIGH]])
_INTERPOLATE = np.kron(_C, _C)


@njit(fastmath=FAST)
def _gather(conn, x, z):  # type: ignore[no-untyped-def]
    for a in range(8):
        for i in range(LANES):
            node = conn[a, i]
            z[3 * a, i] = x[node, 0]
            z[3 * a + 1, i] = x[node, 1]
            z[3 * a + 2, i] = x[node, 2]


@njit(fastmath=FAST)
def _difference(a, b, out):  # type: ignore[no-untyped-def]
    for i in range(LANES):
        out[i] = b[i] - a[i]


@njit(fastmath=FAST)
def _mix(c0, c1, c2, c3, a, b, c, d, out):  # type: ignore[no-untyped-def]
    for i in range(LANES):
        out[i] = c0 * a[i] + c1 * b[i] + c2 * c[i] + c3 * d[i]


@njit(fastmath=FAST)
def _copy(a, out):  # type: ignore[no-untyped-def]
    for i in range(LANES):
        out[i] = a[i]


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
def _deviator(ab, tr, floored):  # type: ignore[no-untyped-def]
    Q = 8 * LANES
    for i in range(Q):
        ab[Q + i] -= ab[i] * tr[i] / floored[i] * (1 / 3.0)


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


@njit(fastmath=FAST)
def _add_to(a, out):  # type: ignore[no-untyped-def]
    for i in range(a.size):
        out[i] += a[i]


@njit(fastmath=FAST)
def _subtract_from(a, out):  # type: ignore[no-untyped-def]
    for i in range(a.size):
        out[i] -= a[i]


@njit(_SIGNATURE, cache=True, fastmath=FAST, nogil=True)
def force_3d(law, constants, k_bulk, conn, x, geometry, gamma, j_bar, force, W, psi):  # type: ignore[no-untyped-def]
    L, Q = LANES, 8 * LANES
    z, edge, line = np.empty((24, L)), np.empty((4, L)), np.empty((4, L))
    g, F, P, t = np.empty((3, 3, 8, L)), np.empty(9 * Q), np.empty(9 * Q), np.empty((3, 3, 8, L))
    J, floored, tr, R, I1 = np.empty(Q), np.empty(Q), np.empty(Q), np.empty(Q), np.empty(Q)
    psi_q, dpsi, ddpsi, ab, mean = np.empty(Q), np.empty(Q), np.empty(Q), np.empty(2 * Q), np.empty(3 * L)
    pressure, volumetric = np.empty(Q), np.empty(Q)
    least = 1.0
    M = _INTERPOLATE
    for tile in range(conn.shape[0]):
        geo, gam = geometry[tile].reshape(-1), gamma[tile].reshape(-1)
        w = geo[9 * Q:]
        _gather(conn[tile], x, z)
        for c in range(3):
            for d in range(3):
                for m in range(4):
                    n0 = _EDGES[d, m]
                    _difference(z[3 * n0 + c], z[3 * (n0 + (1 << d)) + c], edge[m])
                for f in range(4):
                    _mix(M[f, 0], M[f, 1], M[f, 2], M[f, 3], edge[0], edge[1], edge[2], edge[3], line[f])
                for q in range(8):
                    _copy(line[_LINE[d, q]], g[c, d, q])
            _push(g[c].reshape(-1), geo, F[3 * c * Q:3 * (c + 1) * Q])
        _invariants(F, J, floored, tr)
        least = least_live(J, gam, least)
        guess_inverse_cbrt(floored.view(np.int64), R.view(np.int64))
        refine_inverse_cbrt(floored, R)
        _product(R, tr, I1)
        law(I1, constants, psi_q, dpsi, ddpsi)
        if j_bar:
            _means(w, J, gam, mean)
            _dilatation(mean, k_bulk, pressure, volumetric)
        else:
            _dilatation_plain(gam, k_bulk, J, pressure, volumetric)
        _coefficients(w, gam, dpsi, R, pressure, ab)
        _deviator(ab, tr, floored)
        _piola(F, ab, P)
        for c in range(3):
            _pull(P[3 * c * Q:3 * (c + 1) * Q], geo, t[c].reshape(-1))
        density = W[tile].reshape(-1)
        _add(psi_q, volumetric, density)
        _energy(w, gam, density, psi[tile])
        out = force[tile]
        out[:] = 0.0
        for c in range(3):
            for d in range(3):
                line[:] = 0.0
                for q in range(8):
                    _add_to(t[c, d, q], line[_LINE[d, q]])
                for m in range(4):
                    n0 = _EDGES[d, m]
                    _mix(M[0, m], M[1, m], M[2, m], M[3, m], line[0], line[1], line[2], line[3], edge[m])
                    _add_to(edge[m], out[3 * (n0 + (1 << d)) + c])
                    _subtract_from(edge[m], out[3 * n0 + c])
    return least
