"""Internal force of four-node quadrilaterals in plane strain, tile by tile.

With F = Grad x, J = det F and  I1' = J^(-2/3) (F:F + 1), the element potential for fixed gamma is

    Pi_e = sum_q w_q gamma_q psi(I1'_q) + gamma_bar V k/2 (J_bar - 1)^2,
    J_bar = sum_q w_q J_q / V,   gamma_bar = sum_q w_q gamma_q / V,

and its derivative is  f_a = sum_q P_q Grad N_a  with  P = a F + b cof F,

    a = 2 w gamma psi' J^(-2/3),    b = w p - a (F:F + 1)/(3 J),    p = gamma_bar k (J_bar - 1).

Gradients are taken in the reference square, where they are differences of nodal values, and carried to X by the
stored d xi/d X. Each function below is one pass over the lanes of a tile and vectorises.
"""

from __future__ import annotations

import numpy as np
from numba import boolean, float64, njit, types

from ..material import LAW
from .lanes import FAST, GAUSS_HIGH, GAUSS_LOW, J_FLOOR, LANES, guess_inverse_cbrt, refine_inverse_cbrt

# rows of the workspace, four Gauss points each
_F, _J, _I1, _R, _PSI, _DPSI, _DDPSI, _TR, _ROWS = 0, 16, 20, 24, 28, 32, 36, 40, 44


@njit(fastmath=FAST)
def _gather(conn, x, z):  # type: ignore[no-untyped-def]
    for a in range(4):
        for i in range(LANES):
            node = conn[a, i]
            z[2 * a * LANES + i] = x[node, 0]
            z[(2 * a + 1) * LANES + i] = x[node, 1]


@njit(fastmath=FAST)
def _kinematics(z, geo, ws):  # type: ignore[no-untyped-def]
    L = LANES
    for i in range(L):
        x0, y0, x1, y1 = z[i], z[L + i], z[2 * L + i], z[3 * L + i]
        x2, y2, x3, y3 = z[4 * L + i], z[5 * L + i], z[6 * L + i], z[7 * L + i]
        for q in range(4):
            if q < 2:      # dx/dxi on the lower, then on the upper line of Gauss points
                g0, g2 = GAUSS_HIGH * (x1 - x0) + GAUSS_LOW * (x3 - x2), GAUSS_HIGH * (y1 - y0) + GAUSS_LOW * (y3 - y2)
            else:
                g0, g2 = GAUSS_LOW * (x1 - x0) + GAUSS_HIGH * (x3 - x2), GAUSS_LOW * (y1 - y0) + GAUSS_HIGH * (y3 - y2)
            if q % 2 == 0:  # dx/deta on the left, then on the right line
                g1, g3 = GAUSS_HIGH * (x2 - x0) + GAUSS_LOW * (x3 - x1), GAUSS_HIGH * (y2 - y0) + GAUSS_LOW * (y3 - y1)
            else:
                g1, g3 = GAUSS_LOW * (x2 - x0) + GAUSS_HIGH * (x3 - x1), GAUSS_LOW * (y2 - y0) + GAUSS_HIGH * (y3 - y1)
            k0, k1 = geo[5 * q * L + i], geo[(5 * q + 1) * L + i]
            k2, k3 = geo[(5 * q + 2) * L + i], geo[(5 * q + 3) * L + i]
            f0, f1, f2, f3 = g0 * k0 + g1 * k2, g0 * k1 + g1 * k3, g2 * k0 + g3 * k2, g2 * k1 + g3 * k3
            ws[4 * q * L + i], ws[(4 * q + 1) * L + i] = f0, f1
            ws[(4 * q + 2) * L + i], ws[(4 * q + 3) * L + i] = f2, f3
            ws[(_J + q) * L + i] = f0 * f3 - f1 * f2
            ws[(_TR + q) * L + i] = f0 * f0 + f1 * f1 + f2 * f2 + f3 * f3 + 1.0


@njit(fastmath=FAST)
def _floor(J, clipped):  # type: ignore[no-untyped-def]
    for i in range(J.size):
        clipped[i] = J[i] if J[i] > J_FLOOR else J_FLOOR


@njit(fastmath=FAST)
def _product(a, b, out):  # type: ignore[no-untyped-def]
    for i in range(a.size):
        out[i] = a[i] * b[i]


@njit(fastmath=FAST)
def _pressure(geo, gamma, k_bulk, ws, out):  # type: ignore[no-untyped-def]
    L = LANES
    for i in range(L):
        w0, w1, w2, w3 = geo[4 * L + i], geo[9 * L + i], geo[14 * L + i], geo[19 * L + i]
        inv_V = 1.0 / (w0 + w1 + w2 + w3)
        dilatation = (w0 * ws[_J * L + i] + w1 * ws[(_J + 1) * L + i] + w2 * ws[(_J + 2) * L + i]
                      + w3 * ws[(_J + 3) * L + i]) * inv_V - 1.0
        gamma_bar = (w0 * gamma[i] + w1 * gamma[L + i] + w2 * gamma[2 * L + i] + w3 * gamma[3 * L + i]) * inv_V
        for q in range(4):
            out[q * L + i] = gamma_bar * k_bulk * dilatation
            out[(4 + q) * L + i] = 0.5 * k_bulk * dilatation * dilatation
        out[8 * L + i] = gamma_bar


@njit(fastmath=FAST)
def _pressure_plain(gamma, k_bulk, ws, out):  # type: ignore[no-untyped-def]
    L = LANES
    for i in range(4 * L):
        dilatation = ws[_J * L + i] - 1.0
        out[i] = gamma[i] * k_bulk * dilatation
        out[4 * L + i] = 0.5 * k_bulk * dilatation * dilatation


@njit(fastmath=FAST)
def _stress(q, geo, gamma, ws, p, t):  # type: ignore[no-untyped-def]
    """Pulled-back stress of Gauss point q into rows 0-3 of t, its energy density into row 4, times w gamma in row 5."""
    L = LANES
    F, G = 4 * q * L, 5 * q * L
    for i in range(L):
        w, w_gamma = geo[G + 4 * L + i], geo[G + 4 * L + i] * gamma[q * L + i]
        a = 2.0 * w_gamma * ws[(_DPSI + q) * L + i] * ws[(_R + q) * L + i]
        b = w * p[q * L + i] - a * ws[(_TR + q) * L + i] / ws[(_DDPSI + q) * L + i] * (1 / 3.0)
        f0, f1, f2, f3 = ws[F + i], ws[F + L + i], ws[F + 2 * L + i], ws[F + 3 * L + i]
        P0, P1, P2, P3 = a * f0 + b * f3, a * f1 - b * f2, a * f2 - b * f1, a * f3 + b * f0
        k0, k1, k2, k3 = geo[G + i], geo[G + L + i], geo[G + 2 * L + i], geo[G + 3 * L + i]
        t[6 * q * L + i] = P0 * k0 + P1 * k1
        t[(6 * q + 1) * L + i] = P0 * k2 + P1 * k3
        t[(6 * q + 2) * L + i] = P2 * k0 + P3 * k1
        t[(6 * q + 3) * L + i] = P2 * k2 + P3 * k3
        W = ws[(_PSI + q) * L + i] + p[(4 + q) * L + i]
        t[(6 * q + 4) * L + i] = W
        t[(6 * q + 5) * L + i] = w_gamma * W


@njit(fastmath=FAST)
def _nodal_force(t, force, W, psi):  # type: ignore[no-untyped-def]
    L = LANES
    lo, hi = GAUSS_LOW, GAUSS_HIGH
    for c in range(2):
        for i in range(L):
            u0, u1 = t[2 * c * L + i], t[(6 + 2 * c) * L + i]
            u2, u3 = t[(12 + 2 * c) * L + i], t[(18 + 2 * c) * L + i]
            v0, v1 = t[(2 * c + 1) * L + i], t[(7 + 2 * c) * L + i]
            v2, v3 = t[(13 + 2 * c) * L + i], t[(19 + 2 * c) * L + i]
            low_xi, high_xi = hi * (u0 + u1) + lo * (u2 + u3), lo * (u0 + u1) + hi * (u2 + u3)
            low_eta, high_eta = hi * (v0 + v2) + lo * (v1 + v3), lo * (v0 + v2) + hi * (v1 + v3)
            force[c * L + i] = -low_xi - low_eta
            force[(2 + c) * L + i] = low_xi - high_eta
            force[(4 + c) * L + i] = low_eta - high_xi
            force[(6 + c) * L + i] = high_xi + high_eta
    for i in range(L):
        psi[i] = t[5 * L + i] + t[11 * L + i] + t[17 * L + i] + t[23 * L + i]
    for q in range(4):
        for i in range(L):
            W[q * L + i] = t[(6 * q + 4) * L + i]


@njit(fastmath=FAST)
def least_live(J, gamma, least):  # type: ignore[no-untyped-def]
    """The smaller of `least` and the least J at a point with gamma > 0."""
    for i in range(J.size):
        value = J[i] if gamma[i] > 0.0 else 1.0
        least = value if value < least else least
    return least


_c = types.Array
_SIGNATURE = float64(LAW, _c(float64, 1, "C"), float64, _c(types.uint32, 3, "C"), _c(float64, 2, "C"),
                     _c(float64, 3, "C"), _c(float64, 3, "C"), boolean, _c(float64, 3, "C"), _c(float64, 3, "C"),
                     _c(float64, 2, "C"))


@njit(_SIGNATURE, cache=True, fastmath=FAST, nogil=True)
def force_2d(law, constants, k_bulk, conn, x, geometry, gamma, j_bar, force, W, psi):  # type: ignore[no-untyped-def]
    L = LANES
    ws, z, p, t = np.empty(_ROWS * L), np.empty(8 * L), np.empty(9 * L), np.empty(24 * L)
    J, I1, R, TR = ws[_J * L:_I1 * L], ws[_I1 * L:_R * L], ws[_R * L:_PSI * L], ws[_TR * L:_ROWS * L]
    clipped = ws[_DDPSI * L:_TR * L]  # the law's second derivative is not needed; its rows then hold the floored J
    least = 1.0
    for b in range(conn.shape[0]):
        geo, g = geometry[b].reshape(-1), gamma[b].reshape(-1)
        _gather(conn[b], x, z)
        _kinematics(z, geo, ws)
        least = least_live(J, g, least)
        _floor(J, clipped)
        guess_inverse_cbrt(clipped.view(np.int64), R.view(np.int64))
        refine_inverse_cbrt(clipped, R)
        _product(R, TR, I1)
        law(I1, constants, ws[_PSI * L:_DPSI * L], ws[_DPSI * L:_DDPSI * L], ws[_DDPSI * L:_TR * L])
        _floor(J, clipped)
        if j_bar:
            _pressure(geo, g, k_bulk, ws, p)
        else:
            _pressure_plain(g, k_bulk, ws, p)
        for q in range(4):
            _stress(q, geo, g, ws, p, t)
        _nodal_force(t, force[b].reshape(-1), W[b].reshape(-1), psi[b])
    return least
