"""Internal force of four-node quadrilaterals in plane strain, or of a body of revolution, tile by tile.

With F = Grad x, J = det F and  I1' = J^(-2/3) (F:F + 1), the element potential for fixed gamma is

    Pi_e = sum_q w_q gamma_q psi(I1'_q) + gamma_bar V k/2 (J_bar - 1)^2,
    J_bar = sum_q w_q J_q / V,   gamma_bar = sum_q w_q gamma_q / V,

and its derivative is  f_a = sum_q P_q Grad N_a  with  P = a F + b cof F,

    a = 2 w gamma psi' J^(-2/3),    b = w p - a (F:F + 1)/(3 J),    p = gamma_bar k (J_bar - 1).

Gradients are taken in the reference square, where they are differences of nodal values, and carried to X by the
stored d xi/d X. Each function below is one pass over the lanes of a tile and vectorises. Passes of :mod:`.hoop` add
what goes around the axis of a body of revolution.
"""

from __future__ import annotations

import numpy as np

from ...material.compiled import isochoric_law
from ...system.jit import njit
from .hoop import AROUND, add_hoop_force, hoop_stress, hoop_stretch, ratio_around
from .lanes import (
    FAST,
    GAUSS_HIGH,
    GAUSS_LOW,
    J_FLOOR,
    LANES,
    continue_below_floor,
    guess_inverse_cbrt,
    refine_inverse_cbrt,
)

# Rows of the workspace and of the geometry, four Gauss points each: a quantity at Gauss point q of lane i is at
# (row + q) * LANES + i, so that what is done point by point is one loop over 4 * LANES numbers.
F_XX, F_XY, F_YX, F_YY = 0, 4, 8, 12
J_ROW, I1_ROW, R_ROW, PSI, DPSI, FLOORED, TRACE = 16, 20, 24, 28, 32, 36, 40  # FLOORED: J at first, then 1/J
HOOP = 44  # r/R of a body of revolution
ROWS = 48
XI_X, XI_Y, ETA_X, ETA_Y, WEIGHT = 0, 4, 8, 12, 16  # geometry: d xi/d X by component, then the weights


@njit
def points(rows, first):  # type: ignore[no-untyped-def]
    """A quantity at the four Gauss points of all lanes, which begins at row `first`."""
    return rows[first * LANES:(first + 4) * LANES]


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
            k0, k1 = geo[(XI_X + q) * L + i], geo[(XI_Y + q) * L + i]
            k2, k3 = geo[(ETA_X + q) * L + i], geo[(ETA_Y + q) * L + i]
            f0, f1, f2, f3 = g0 * k0 + g1 * k2, g0 * k1 + g1 * k3, g2 * k0 + g3 * k2, g2 * k1 + g3 * k3
            ws[(F_XX + q) * L + i], ws[(F_XY + q) * L + i] = f0, f1
            ws[(F_YX + q) * L + i], ws[(F_YY + q) * L + i] = f2, f3
            J = f0 * f3 - f1 * f2
            ws[(J_ROW + q) * L + i] = J
            ws[(FLOORED + q) * L + i] = J if J > J_FLOOR else J_FLOOR
            ws[(TRACE + q) * L + i] = f0 * f0 + f1 * f1 + f2 * f2 + f3 * f3 + 1.0


@njit(fastmath=FAST)
def _invariant(ws):  # type: ignore[no-untyped-def]
    for i in range(4 * LANES):
        ws[I1_ROW * LANES + i] = ws[R_ROW * LANES + i] * ws[TRACE * LANES + i]


@njit(fastmath=FAST)
def _dilatation(geo, gamma, k_bulk, ws, p):  # type: ignore[no-untyped-def]
    """Row 0 of p: gamma_bar k (J_bar - 1); row 1: k/2 (J_bar - 1)^2."""
    L = LANES
    for i in range(L):
        w0, w1 = geo[WEIGHT * L + i], geo[(WEIGHT + 1) * L + i]
        w2, w3 = geo[(WEIGHT + 2) * L + i], geo[(WEIGHT + 3) * L + i]
        inv_V = 1.0 / (w0 + w1 + w2 + w3)
        dilatation = (w0 * ws[J_ROW * L + i] + w1 * ws[(J_ROW + 1) * L + i] + w2 * ws[(J_ROW + 2) * L + i]
                      + w3 * ws[(J_ROW + 3) * L + i]) * inv_V - 1.0
        gamma_bar = (w0 * gamma[i] + w1 * gamma[L + i] + w2 * gamma[2 * L + i] + w3 * gamma[3 * L + i]) * inv_V
        p[i] = gamma_bar * k_bulk * dilatation
        p[L + i] = 0.5 * k_bulk * dilatation * dilatation


@njit(fastmath=FAST)
def _spread(p, pressure, volumetric):  # type: ignore[no-untyped-def]
    L = LANES
    for i in range(L):
        a, b = p[i], p[L + i]
        pressure[i] = a
        pressure[L + i] = a
        pressure[2 * L + i] = a
        pressure[3 * L + i] = a
        volumetric[i] = b
        volumetric[L + i] = b
        volumetric[2 * L + i] = b
        volumetric[3 * L + i] = b


@njit(fastmath=FAST)
def _dilatation_plain(gamma, k_bulk, J, pressure, volumetric):  # type: ignore[no-untyped-def]
    for i in range(J.size):
        dilatation = J[i] - 1.0
        pressure[i] = gamma[i] * k_bulk * dilatation
        volumetric[i] = 0.5 * k_bulk * dilatation * dilatation


@njit(fastmath=FAST)
def _coefficients(ws, w, gamma, pressure, ab):  # type: ignore[no-untyped-def]
    """The factors a and b of the stress P = a F + b cof F."""
    Q = 4 * LANES
    for i in range(Q):
        a = 2.0 * w[i] * gamma[i] * ws[DPSI * LANES + i] * ws[R_ROW * LANES + i]
        ab[i] = a
        ab[Q + i] = w[i] * pressure[i] - a * ws[TRACE * LANES + i] * ws[FLOORED * LANES + i] * (1 / 3.0)


@njit(fastmath=FAST)
def _stress(ws, geo, ab, t):  # type: ignore[no-untyped-def]
    """Stress pulled back to the reference square, T_i,d = P_iJ d xi_d/d X_J."""
    L, Q = LANES, 4 * LANES
    for i in range(Q):
        a, b = ab[i], ab[Q + i]
        f0, f1, f2, f3 = ws[F_XX * L + i], ws[F_XY * L + i], ws[F_YX * L + i], ws[F_YY * L + i]
        k0, k1, k2, k3 = geo[XI_X * L + i], geo[XI_Y * L + i], geo[ETA_X * L + i], geo[ETA_Y * L + i]
        P0, P1, P2, P3 = a * f0 + b * f3, a * f1 - b * f2, a * f2 - b * f1, a * f3 + b * f0
        t[i] = P0 * k0 + P1 * k1
        t[Q + i] = P0 * k2 + P1 * k3
        t[2 * Q + i] = P2 * k0 + P3 * k1
        t[3 * Q + i] = P2 * k2 + P3 * k3


@njit(fastmath=FAST)
def _nodal_force(t, force):  # type: ignore[no-untyped-def]
    L = LANES
    lo, hi = GAUSS_LOW, GAUSS_HIGH
    for i in range(L):
        for c in range(2):
            u0, u1, u2, u3 = t[8 * c * L + i], t[(8 * c + 1) * L + i], t[(8 * c + 2) * L + i], t[(8 * c + 3) * L + i]
            v0, v1 = t[(8 * c + 4) * L + i], t[(8 * c + 5) * L + i]
            v2, v3 = t[(8 * c + 6) * L + i], t[(8 * c + 7) * L + i]
            low_xi, high_xi = hi * (u0 + u1) + lo * (u2 + u3), lo * (u0 + u1) + hi * (u2 + u3)
            low_eta, high_eta = hi * (v0 + v2) + lo * (v1 + v3), lo * (v0 + v2) + hi * (v1 + v3)
            force[c * L + i] = -low_xi - low_eta
            force[(2 + c) * L + i] = low_xi - high_eta
            force[(4 + c) * L + i] = low_eta - high_xi
            force[(6 + c) * L + i] = high_xi + high_eta


@njit(fastmath=FAST)
def _add(a, b, out):  # type: ignore[no-untyped-def]
    for i in range(a.size):
        out[i] = a[i] + b[i]


@njit(fastmath=FAST)
def _energy(w, gamma, W, psi):  # type: ignore[no-untyped-def]
    L = LANES
    for i in range(L):
        psi[i] = (w[i] * gamma[i] * W[i] + w[L + i] * gamma[L + i] * W[L + i]
                  + w[2 * L + i] * gamma[2 * L + i] * W[2 * L + i] + w[3 * L + i] * gamma[3 * L + i] * W[3 * L + i])


@njit(fastmath=FAST)
def least_live(J, gamma, least):  # type: ignore[no-untyped-def]
    """Lower `least` to J where that is smaller and gamma > 0; by lane, as a single minimum would not vectorise."""
    for i in range(J.size):
        value = J[i] if gamma[i] > 0.0 else 1.0
        least[i] = value if value < least[i] else least[i]


@njit(cache=True, fastmath=FAST, nogil=True)
def force_2d(address, constants, volumetric_part, x, elements):  # type: ignore[no-untyped-def]
    law = isochoric_law(address)
    k_bulk, j_bar = volumetric_part.bulk_modulus, volumetric_part.j_bar
    conn, geometry, gamma = elements.conn, elements.geometry, elements.gamma
    force, W, psi = elements.force, elements.W, elements.psi
    Q = 4 * LANES
    ws, z = np.empty(ROWS * LANES), np.empty(8 * LANES)
    t, p, ab = np.empty(4 * Q), np.empty(2 * LANES), np.empty(2 * Q)
    pressure, volumetric, ddpsi = np.empty(Q), np.empty(Q), np.empty(Q)
    J, I1, R, psi_q = points(ws, J_ROW), points(ws, I1_ROW), points(ws, R_ROW), points(ws, PSI)
    dpsi, floored, tr, f = points(ws, DPSI), points(ws, FLOORED), points(ws, TRACE), points(ws, HOOP)
    least, revolved, hoop = np.ones(Q), geometry.shape[1] > AROUND, np.empty(Q)
    for b in range(conn.shape[0]):
        geo, g = geometry[b].reshape(-1), gamma[b].reshape(-1)
        w = geo[WEIGHT * LANES:]
        _gather(conn[b], x, z)
        _kinematics(z, geo, ws)
        if revolved:
            ratio_around(z, geo[AROUND * LANES:], f)
            hoop_stretch(f, J, floored, tr)
        least_live(J, g, least)
        guess_inverse_cbrt(floored.view(np.int64), R.view(np.int64))
        refine_inverse_cbrt(floored, R)
        continue_below_floor(J, floored, R)
        _invariant(ws)
        law(I1, constants, psi_q, dpsi, ddpsi)
        if j_bar:
            _dilatation(geo, g, k_bulk, ws, p)
            _spread(p, pressure, volumetric)
        else:
            _dilatation_plain(g, k_bulk, J, pressure, volumetric)
        _coefficients(ws, w, g, pressure, ab)
        if revolved:
            hoop_stress(ws, f, geo[AROUND * LANES:], ab, hoop)
        _stress(ws, geo, ab, t)
        _nodal_force(t, force[b].reshape(-1))
        if revolved:
            add_hoop_force(hoop, force[b].reshape(-1))
        density = W[b].reshape(-1)
        _add(psi_q, volumetric, density)
        _energy(w, g, density, psi[b])
    return least.min()
