"""Thin sheets of laws of several invariants: what :mod:`.plane_stress` is for laws of I1' alone.

With y = J^(1/3), t = F:F, j = det F, and q_f = |F A_f|^2 of fibres in the plane, p = t/y^2, s = y^4/j^2 and o = 1/s,

    I1' = p + s,   I2' = p s + o,   I_f' = q_f/y^2,

and the derivative of W with z = log y vanishes. Those with v = (t, j, q_f) at that z give the stress,

    P = 2 W_t F + W_j cof F + 2 sum_f W_f (F A_f) A_f^T,   W_t = psi_1/y^2 + psi_2 s/y^2,   W_f = psi_f/y^2,
    W_j = 2/j [psi_2 (o - p s) - psi_1 s],

and  W_bc - W_bz W_cz/W_zz  the second derivatives with the stretch following (:mod:`skfsink.material.sheet`).
"""

from __future__ import annotations

import numpy as np

from ...material.compiled import general_law
from ...system.jit import njit
from .force2d import (
    FLOORED,
    J_ROW,
    ROWS,
    TRACE,
    WEIGHT,
    _energy,
    _gather,
    _kinematics,
    _nodal_force,
    _stress,
    least_live,
    points,
)
from .general import _fibre_stress_2d
from .lanes import FAST, LANES
from .plane_stress import ENOUGH, _density, _shift, _stride

__all__ = ["force_general_sheet"]

MOST = 100  # steps for the stretch; up to 13 without fibres, up to 61 where fibres are stiffer than the bulk
_Q = 4 * LANES


@njit(fastmath=FAST)
def _invariants(y, t, j, inv_j, along, p, s, o, I):  # type: ignore[no-untyped-def]
    for i in range(y.size):
        y2 = y[i] * y[i]
        inverse = 1.0 / y2
        r, h = y2 * inv_j[i], j[i] * inverse
        p[i] = t[i] * inverse
        s[i] = r * r
        o[i] = h * h
        I[0, i] = p[i] + s[i]
        I[1, i] = p[i] * s[i] + o[i]
    for f in range(2, I.shape[0]):
        for i in range(y.size):
            I[f, i] = along[f - 2, i] / (y[i] * y[i])


@njit(fastmath=FAST)
def across(p, s, o, I, z):  # type: ignore[no-untyped-def]
    """Derivatives of the invariants with log y, (m, n)."""
    for i in range(p.size):
        z[0, i] = 4.0 * s[i] - 2.0 * p[i]
        z[1, i] = 2.0 * p[i] * s[i] - 4.0 * o[i]
    for f in range(2, I.shape[0]):
        for i in range(p.size):
            z[f, i] = -2.0 * I[f, i]


@njit(fastmath=FAST)
def _slopes(p, s, o, I, d, dd, z, gradient, curved):  # type: ignore[no-untyped-def]
    """First and second derivative of psi with log y."""
    for i in range(p.size):
        gradient[i] = d[0, i] * z[0, i] + d[1, i] * z[1, i]
        curved[i] = (d[0, i] * (16.0 * s[i] + 4.0 * p[i]) + d[1, i] * (4.0 * p[i] * s[i] + 16.0 * o[i])
                     + dd[0, 0, i] * z[0, i] * z[0, i] + (dd[0, 1, i] + dd[1, 0, i]) * z[0, i] * z[1, i]
                     + dd[1, 1, i] * z[1, i] * z[1, i])
    for f in range(2, I.shape[0]):
        for i in range(p.size):
            gradient[i] += d[f, i] * z[f, i]
            curved[i] += 4.0 * d[f, i] * I[f, i] + dd[f, f, i] * z[f, i] * z[f, i]
        for g in range(f):
            for i in range(p.size):
                curved[i] += (dd[f, g, i] + dd[g, f, i]) * z[f, i] * z[g, i]


@njit(fastmath=FAST)
def _step(gradient, curved, k_bulk, y):  # type: ignore[no-untyped-def]
    """One step for log y; returns the sum of their squares."""
    total = 0.0
    for i in range(y.size):
        J = y[i] * y[i] * y[i]
        v = 3.0 * k_bulk * J
        step = _stride(gradient[i] + v * (J - 1.0), curved[i], J, v)
        y[i] *= 1.0 + step + 0.5 * step * step
        total += step * step
    return total


@njit(fastmath=FAST)
def thin(law, constants, k_bulk, t, j, along, inv_j, y, p, s, o, I, psi, d, dd, z, work):  # type: ignore[no-untyped-def]
    """y = J^(1/3) with P_33 = 0, and all that follows there, from t, j > 0 and `along`; `work` is (2, n)."""
    for i in range(y.size):
        y[i] = 1.0
        inv_j[i] = 1.0 / j[i]
    for _ in range(MOST):
        _invariants(y, t, j, inv_j, along, p, s, o, I)
        law(I, constants, psi, d, dd)
        across(p, s, o, I, z)
        _slopes(p, s, o, I, d, dd, z, work[0], work[1])
        if not _step(work[0], work[1], k_bulk, y) > ENOUGH:
            break
    _invariants(y, t, j, inv_j, along, p, s, o, I)
    law(I, constants, psi, d, dd)


@njit(fastmath=FAST)
def stretched(ws, fibres, along):  # type: ignore[no-untyped-def]
    """|F A|^2 of each family of fibres in the plane."""
    for f in range(along.shape[0]):
        A = fibres[3 * f:3 * f + 3]
        for q in range(4):
            for i in range(LANES):
                k = q * LANES + i
                n0, n1 = ws[k] * A[0, i] + ws[_Q + k] * A[1, i], ws[2 * _Q + k] * A[0, i] + ws[3 * _Q + k] * A[1, i]
                along[f, k] = n0 * n0 + n1 * n1


@njit(fastmath=FAST)
def _coefficients(w, gamma, y, inv_j, p, s, o, d, ab, c):  # type: ignore[no-untyped-def]
    """w gamma times 2 W_t, W_j, and in the rows 1 and after of c 2 W_f."""
    for i in range(y.size):
        wg = 2.0 * w[i] * gamma[i]
        R = 1.0 / (y[i] * y[i])
        ab[i] = wg * R * (d[0, i] + d[1, i] * s[i])
        ab[y.size + i] = wg * inv_j[i] * (d[1, i] * (o[i] - p[i] * s[i]) - d[0, i] * s[i])
    for f in range(1, c.shape[0]):
        for i in range(y.size):
            c[f, i] = 2.0 * w[i] * gamma[i] * d[f + 1, i] / (y[i] * y[i])


@njit(cache=True, fastmath=FAST, nogil=True)
def force_general_sheet(address, constants, volumetric_part, x, elements):  # type: ignore[no-untyped-def]
    """Arguments and results as of :func:`.force2d.force_2d`; `j_bar` has no meaning here."""
    law, k_bulk = general_law(address), volumetric_part.bulk_modulus
    conn, geometry, gamma = elements.conn, elements.geometry, elements.gamma
    fibres, force, W, psi = elements.fibres, elements.force, elements.W, elements.psi
    m = 2 + fibres.shape[1] // 3
    ws, z, t_stress, ab = np.empty(ROWS * LANES), np.empty(8 * LANES), np.empty(4 * _Q), np.empty(2 * _Q)
    inv_j, y, p, s, o = np.empty(_Q), np.empty(_Q), np.empty(_Q), np.empty(_Q), np.empty(_Q)
    psi_q, I, d, dd = np.empty(_Q), np.empty((m, _Q)), np.zeros((m, _Q)), np.zeros((m, m, _Q))
    Iz, work, along, c = np.empty((m, _Q)), np.empty((2, _Q)), np.empty((m - 2, _Q)), np.empty((m - 1, _Q))
    J, j, t = points(ws, J_ROW), points(ws, FLOORED), points(ws, TRACE)
    least = np.ones(_Q)
    for b in range(conn.shape[0]):
        geo, g = geometry[b].reshape(-1), gamma[b].reshape(-1)
        w = geo[WEIGHT * LANES:]
        _gather(conn[b], x, z)
        _kinematics(z, geo, ws)
        _shift(t)
        stretched(ws, fibres[b], along)
        least_live(J, g, least)
        thin(law, constants, k_bulk, t, j, along, inv_j, y, p, s, o, I, psi_q, d, dd, Iz, work)
        _coefficients(w, g, y, inv_j, p, s, o, d, ab, c)
        _stress(ws, geo, ab, t_stress)
        _fibre_stress_2d(ws, geo, fibres[b], c, t_stress)
        _nodal_force(t_stress, force[b].reshape(-1))
        density = W[b].reshape(-1)
        _density(psi_q, y, k_bulk, density)
        _energy(w, g, density, psi[b])
    return least.min()
