"""Internal force of eight-node hexahedra, tile by tile: the potential of :mod:`.force2d` with a 3x3 F.

    P = a F + b cof F,   a = 2 w gamma psi' J^(-2/3),   b = w p - a (F:F)/(3 J).

Reference gradients along direction d are the differences over the four edges in that direction, interpolated to the
four lines of Gauss points; the nodal force is the transpose of that.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .force2d import _SIGNATURE, least_live
from .lanes import FAST, GAUSS_HIGH, GAUSS_LOW, J_FLOOR, LANES, guess_inverse_cbrt, refine_inverse_cbrt

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
def _push(g0, g1, g2, k, F, J, tr):  # type: ignore[no-untyped-def]
    """F = sum_d (dx/dxi_d) (dxi_d/dX) of one Gauss point; g* (3, L), k (9 L), F (9 L)."""
    L = LANES
    for i in range(L):
        k0, k1, k2, k3, k4 = k[i], k[L + i], k[2 * L + i], k[3 * L + i], k[4 * L + i]
        k5, k6, k7, k8 = k[5 * L + i], k[6 * L + i], k[7 * L + i], k[8 * L + i]
        a, b, c = g0[i], g1[i], g2[i]
        f0, f1, f2 = a * k0 + b * k3 + c * k6, a * k1 + b * k4 + c * k7, a * k2 + b * k5 + c * k8
        a, b, c = g0[L + i], g1[L + i], g2[L + i]
        f3, f4, f5 = a * k0 + b * k3 + c * k6, a * k1 + b * k4 + c * k7, a * k2 + b * k5 + c * k8
        a, b, c = g0[2 * L + i], g1[2 * L + i], g2[2 * L + i]
        f6, f7, f8 = a * k0 + b * k3 + c * k6, a * k1 + b * k4 + c * k7, a * k2 + b * k5 + c * k8
        F[i], F[L + i], F[2 * L + i] = f0, f1, f2
        F[3 * L + i], F[4 * L + i], F[5 * L + i] = f3, f4, f5
        F[6 * L + i], F[7 * L + i], F[8 * L + i] = f6, f7, f8
        J[i] = f0 * (f4 * f8 - f5 * f7) - f1 * (f3 * f8 - f5 * f6) + f2 * (f3 * f7 - f4 * f6)
        tr[i] = f0 * f0 + f1 * f1 + f2 * f2 + f3 * f3 + f4 * f4 + f5 * f5 + f6 * f6 + f7 * f7 + f8 * f8


@njit(fastmath=FAST)
def _stress(k, F, a, b, t):  # type: ignore[no-untyped-def]
    """Pulled-back stress T_id = P_iJ dxi_d/dX_J of one Gauss point into t (9 L), rows d*3 + i."""
    L = LANES
    for i in range(L):
        f0, f1, f2, f3, f4 = F[i], F[L + i], F[2 * L + i], F[3 * L + i], F[4 * L + i]
        f5, f6, f7, f8 = F[5 * L + i], F[6 * L + i], F[7 * L + i], F[8 * L + i]
        A, B = a[i], b[i]
        p0, p1, p2 = A * f0 + B * (f4 * f8 - f5 * f7), A * f1 + B * (f5 * f6 - f3 * f8), A * f2 + B * (f3 * f7 - f4 * f6)
        p3, p4, p5 = A * f3 + B * (f2 * f7 - f1 * f8), A * f4 + B * (f0 * f8 - f2 * f6), A * f5 + B * (f1 * f6 - f0 * f7)
        p6, p7, p8 = A * f6 + B * (f1 * f5 - f2 * f4), A * f7 + B * (f2 * f3 - f0 * f5), A * f8 + B * (f0 * f4 - f1 * f3)
        for d in range(3):
            k0, k1, k2 = k[3 * d * L + i], k[(3 * d + 1) * L + i], k[(3 * d + 2) * L + i]
            t[3 * d * L + i] = p0 * k0 + p1 * k1 + p2 * k2
            t[(3 * d + 1) * L + i] = p3 * k0 + p4 * k1 + p5 * k2
            t[(3 * d + 2) * L + i] = p6 * k0 + p7 * k1 + p8 * k2


@njit(fastmath=FAST)
def _coefficients(w, gamma, dpsi, R, tr, Jf, p, a, b):  # type: ignore[no-untyped-def]
    for i in range(LANES):
        a[i] = 2.0 * w[i] * gamma[i] * dpsi[i] * R[i]
        b[i] = w[i] * p[i] - a[i] * tr[i] / Jf[i] * (1 / 3.0)


@njit(fastmath=FAST)
def _add(a, out):  # type: ignore[no-untyped-def]
    for i in range(a.size):
        out[i] += a[i]


@njit(fastmath=FAST)
def _sub(a, out):  # type: ignore[no-untyped-def]
    for i in range(a.size):
        out[i] -= a[i]


@njit(_SIGNATURE, cache=True, fastmath=FAST, nogil=True)
def force_3d(law, constants, k_bulk, conn, x, geometry, gamma, j_bar, force, W, psi):  # type: ignore[no-untyped-def]
    L = LANES
    z, edge, G, S = np.empty((24, L)), np.empty((4, L)), np.empty((12, 3, L)), np.empty((12, 3, L))
    F, J, tr, Jf, I1, R = np.empty((8, 9, L)), np.empty((8, L)), np.empty((8, L)), np.empty((8, L)), \
        np.empty((8, L)), np.empty((8, L))
    e, de, dde, t = np.empty((8, L)), np.empty((8, L)), np.empty((8, L)), np.empty(9 * L)
    p, vol, a, b, mean, gbar, V = np.empty((8, L)), np.empty((8, L)), np.empty(L), np.empty(L), np.empty(L), \
        np.empty(L), np.empty(L)
    least = 1.0
    M = _INTERPOLATE
    for tile in range(conn.shape[0]):
        geo, g = geometry[tile], gamma[tile]
        _gather(conn[tile], x, z)
        for d in range(3):
            for c in range(3):
                for m in range(4):
                    n0 = _EDGES[d, m]
                    _difference(z[3 * n0 + c], z[3 * (n0 + (1 << d)) + c], edge[m])
                for f in range(4):
                    _mix(M[f, 0], M[f, 1], M[f, 2], M[f, 3], edge[0], edge[1], edge[2], edge[3], G[4 * d + f, c])
        mean[:] = 0.0
        gbar[:] = 0.0
        V[:] = 0.0
        for q in range(8):
            _push(G[_LINE[0, q]].reshape(-1), G[4 + _LINE[1, q]].reshape(-1), G[8 + _LINE[2, q]].reshape(-1),
                  geo[10 * q:10 * q + 9].reshape(-1), F[q].reshape(-1), J[q], tr[q])
            w = geo[10 * q + 9]
            for i in range(L):
                Jf[q, i] = J[q, i] if J[q, i] > J_FLOOR else J_FLOOR
                mean[i] += w[i] * J[q, i]
                gbar[i] += w[i] * g[q, i]
                V[i] += w[i]
        least = least_live(J.reshape(-1), g.reshape(-1), least)
        guess_inverse_cbrt(Jf.reshape(-1).view(np.int64), R.reshape(-1).view(np.int64))
        refine_inverse_cbrt(Jf.reshape(-1), R.reshape(-1))
        for q in range(8):
            for i in range(L):
                I1[q, i] = R[q, i] * tr[q, i]
                dilatation = (mean[i] / V[i] if j_bar else J[q, i]) - 1.0
                p[q, i] = (gbar[i] / V[i] if j_bar else g[q, i]) * k_bulk * dilatation
                vol[q, i] = 0.5 * k_bulk * dilatation * dilatation
        law(I1.reshape(-1), constants, e.reshape(-1), de.reshape(-1), dde.reshape(-1))
        S[:] = 0.0
        energy, density = psi[tile], W[tile]
        energy[:] = 0.0
        for q in range(8):
            w = geo[10 * q + 9]
            _coefficients(w, g[q], de[q], R[q], tr[q], Jf[q], p[q], a, b)
            _stress(geo[10 * q:10 * q + 9].reshape(-1), F[q].reshape(-1), a, b, t)
            for d in range(3):
                _add(t[3 * d * L:3 * (d + 1) * L], S[4 * d + _LINE[d, q]].reshape(-1))
            for i in range(L):
                density[q, i] = e[q, i] + vol[q, i]
                energy[i] += w[i] * g[q, i] * density[q, i]
        out = force[tile]
        out[:] = 0.0
        for d in range(3):
            for c in range(3):
                for m in range(4):
                    n0 = _EDGES[d, m]
                    _mix(M[0, m], M[1, m], M[2, m], M[3, m], S[4 * d, c], S[4 * d + 1, c], S[4 * d + 2, c],
                         S[4 * d + 3, c], edge[m])
                    _add(edge[m], out[3 * (n0 + (1 << d)) + c])
                    _sub(edge[m], out[3 * n0 + c])
    return least
