"""Four-node quadrilaterals in plane stress: a thin sheet with free faces, per unit of its undeformed thickness.

The stretch lambda across the sheet is a local unknown at each Gauss point. With j = det F and t = F:F of the plane,

    W(F) = min over lambda of  psi(I1') + k/2 (J - 1)^2,   J = j lambda,   I1' = J^(-2/3) (t + lambda^2),

so that P_33 = dW/dlambda = 0. In y = J^(1/3) this is rational: with p = t/y^2 and s = y^4/j^2

    I1' = p + s,    y dW/dy = psi' (4 s - 2 p) + 3 k J (J - 1) = 0.

The sheet thins freely, so nothing locks: J is taken at the point, without element mean. At fixed lambda the stress is
P = a (F - lambda^2/j cof F), a = 2 psi' J^(-2/3), the pressure being eliminated by P_33 = 0. The tangent has lambda
condensed out. gamma multiplies all of it and drops out of P_33 = 0.
"""

from __future__ import annotations

import numpy as np

from ...material import Material
from ...material.compiled import isochoric_law
from ...system.jit import njit
from ..pattern import Pattern
from ..space import Space
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
from .lanes import FAST, J_FLOOR, LANES
from .pieces import Pieces
from .records import Solid
from .tangent import ERSATZ_STIFFNESS, SOFT_GAMMA

__all__ = ["force_plane_stress", "stiffness_plane_stress", "tangent_plane_stress"]

MOST = 40              # steps for the stretch; 2 or 3 in tension, up to 25 crushed to j = 0.02
ENOUGH = 1e-14         # squared steps in log y, summed: the error left is about mu/k times the square of the last
LONGEST = 0.2          # of a Newton step in log y, and 0.3 of what its correction may change of it
_Q = 4 * LANES


# These functions take arrays one by one: a record of them costs the loops 10 to 20 %, see PART in tangent.py.
@njit(fastmath=FAST)
def _invariants(y, t, inv_j, p, s, I1):  # type: ignore[no-untyped-def]
    for i in range(y.size):
        y2 = y[i] * y[i]
        r = y2 * inv_j[i]
        p[i] = t[i] / y2
        s[i] = r * r
        I1[i] = p[i] + s[i]


@njit(fastmath=FAST)
def _stride(gradient, isochoric, J, v):  # type: ignore[no-untyped-def]
    """Step for log y, Newton's with the curvature of the volumetric part.

    `gradient` is dW/d log y, `isochoric` the second derivative of psi, and v = 3 k J.
    """
    exact, least = isochoric + v * (6.0 * J - 3.0), 0.1 * (isochoric + 3.0 * v * J)
    inverse = 1.0 / (exact if exact > least else least)  # W is convex in log y for J > 1/2
    step = -gradient * inverse
    step = step if step < LONGEST else LONGEST
    step = step if step > -LONGEST else -LONGEST
    change = step * inverse * v * (18.0 * J - 4.5)
    change = change if change < 1.5 * LONGEST else 1.5 * LONGEST
    change = change if change > -1.5 * LONGEST else -1.5 * LONGEST
    return step - step * change


@njit(fastmath=FAST)
def _step(p, s, dpsi, ddpsi, k_bulk, y):  # type: ignore[no-untyped-def]
    """One step for log y; returns the sum of their squares."""
    total = 0.0
    for i in range(y.size):
        J = y[i] * y[i] * y[i]
        v = 3.0 * k_bulk * J
        slope = 4.0 * s[i] - 2.0 * p[i]
        gradient = dpsi[i] * slope + v * (J - 1.0)
        isochoric = ddpsi[i] * slope * slope + dpsi[i] * (16.0 * s[i] + 4.0 * p[i])
        step = _stride(gradient, isochoric, J, v)
        y[i] *= 1.0 + step + 0.5 * step * step
        total += step * step
    return total


@njit(fastmath=FAST)
def _thin(law, constants, k_bulk, t, j, inv_j, y, p, s, I1, psi, dpsi, ddpsi):  # type: ignore[no-untyped-def]
    """y = J^(1/3) with P_33 = 0, p, s, and psi and its derivatives there, from t and j > 0 (arrays); inv_j = 1/j."""
    for i in range(y.size):
        y[i] = 1.0
        inv_j[i] = 1.0 / j[i]
    for _ in range(MOST):
        _invariants(y, t, inv_j, p, s, I1)
        law(I1, constants, psi, dpsi, ddpsi)
        if not _step(p, s, dpsi, ddpsi, k_bulk, y) > ENOUGH:
            break
    _invariants(y, t, inv_j, p, s, I1)
    law(I1, constants, psi, dpsi, ddpsi)


@njit(fastmath=FAST)
def _shift(t):  # type: ignore[no-untyped-def]
    for i in range(t.size):
        t[i] -= 1.0  # the kinematics of plane strain count F_33 = 1


@njit(fastmath=FAST)
def _coefficients(w, gamma, y, inv_j, s, dpsi, ab):  # type: ignore[no-untyped-def]
    """The factors a and b of the stress w gamma P = a F + b cof F."""
    for i in range(_Q):
        c = 2.0 * w[i] * gamma[i] * dpsi[i]
        ab[i] = c / (y[i] * y[i])
        ab[_Q + i] = -c * s[i] * inv_j[i]


@njit(fastmath=FAST)
def _density(psi, y, k_bulk, W):  # type: ignore[no-untyped-def]
    for i in range(psi.size):
        dilatation = y[i] * y[i] * y[i] - 1.0
        W[i] = psi[i] + 0.5 * k_bulk * dilatation * dilatation


@njit(cache=True, fastmath=FAST, nogil=True)
def force_plane_stress(address, constants, volumetric_part, x, elements):  # type: ignore[no-untyped-def]
    """Arguments and results as of :func:`.force2d.force_2d`; `j_bar` has no meaning here."""
    law, k_bulk = isochoric_law(address), volumetric_part.bulk_modulus
    conn, geometry, gamma = elements.conn, elements.geometry, elements.gamma
    force, W, psi = elements.force, elements.W, elements.psi
    ws, z, t_stress, ab = np.empty(ROWS * LANES), np.empty(8 * LANES), np.empty(4 * _Q), np.empty(2 * _Q)
    inv_j, y, p, s, I1 = np.empty(_Q), np.empty(_Q), np.empty(_Q), np.empty(_Q), np.empty(_Q)
    psi_q, dpsi, ddpsi = np.empty(_Q), np.empty(_Q), np.empty(_Q)
    J, j, t = points(ws, J_ROW), points(ws, FLOORED), points(ws, TRACE)
    least = np.ones(_Q)
    for b in range(conn.shape[0]):
        geo, g = geometry[b].reshape(-1), gamma[b].reshape(-1)
        w = geo[WEIGHT * LANES:]
        _gather(conn[b], x, z)
        _kinematics(z, geo, ws)
        _shift(t)
        least_live(J, g, least)
        _thin(law, constants, k_bulk, t, j, inv_j, y, p, s, I1, psi_q, dpsi, ddpsi)
        _coefficients(w, g, y, inv_j, s, dpsi, ab)
        _stress(ws, geo, ab, t_stress)
        _nodal_force(t_stress, force[b].reshape(-1))
        density = W[b].reshape(-1)
        _density(psi_q, y, k_bulk, density)
        _energy(w, g, density, psi[b])
    return least.min()


# --- second derivatives ---
def tangent_plane_stress(space: Space, pattern: Pattern, material: Material, u: np.ndarray, gamma: np.ndarray,
                         *, convex: bool = False, elements: np.ndarray | None = None, threads: int = 1) -> np.ndarray:
    """Data of the tangent on `pattern` at the displacement `u` (n, 2) and Gauss point densities `gamma` (ne, nq).

    Its Gauss points are soft as in :func:`.tangent.tangent`. With `convex` no point is unstable. With `elements` it is
    that of these alone.
    """
    x, law = space.X + u, material.compiled_law.address
    solid = Solid(material.bulk_modulus, material.shear_modulus, False, convex)
    pieces = Pieces(space, pattern, gamma, elements)
    return pieces.assemble(lambda piece, data: _tangent(law, material.constants, solid, x, piece, data), threads)


@njit(fastmath=FAST)
def _second(inv_j, y, p, s, dpsi, ddpsi, k_bulk, convex, c):  # type: ignore[no-untyped-def]
    """Derivatives of W(t, j) with lambda condensed out: rows W_t, W_j, W_tt, W_tj, W_jj of c.

    With x = log lambda and R = J^(-2/3), I = R (t + lambda^2) has I_t = R, I_j = -2/3 I/j,
    I_x = R (4/3 lambda^2 - 2/3 t), I_xx = R (4/9 t + 16/9 lambda^2); and W_tt - W_tx^2/W_xx is the condensed W_tt.
    With `convex` the volumetric energy counts as linear in x where it is concave, J < 1/2.
    """
    for i in range(y.size):
        y2, ij = y[i] * y[i], inv_j[i]
        R, J = 1.0 / y2, y2 * y[i]
        I, d1, d2, Ij = p[i] + s[i], dpsi[i], ddpsi[i], -2.0 / 3.0 * (p[i] + s[i]) * ij
        Ix, Ixx = 4.0 / 3.0 * s[i] - 2.0 / 3.0 * p[i], 16.0 / 9.0 * s[i] + 4.0 / 9.0 * p[i]
        volumetric = 2.0 * J - 1.0 if J > 0.5 or not convex else 0.0  # of the second derivative with x
        volumetric *= k_bulk * J
        Wtx = d2 * R * Ix - 2.0 / 3.0 * d1 * R
        Wjx = d2 * Ij * Ix - 2.0 / 3.0 * d1 * Ix * ij + ij * volumetric
        Wxx = d2 * Ix * Ix + d1 * Ixx + volumetric
        c[0, i] = d1 * R
        c[1, i] = -2.0 * d1 * s[i] * ij
        c[2, i] = d2 * R * R - Wtx * Wtx / Wxx
        c[3, i] = d2 * R * Ij - 2.0 / 3.0 * d1 * R * ij - Wtx * Wjx / Wxx
        c[4, i] = (d2 * Ij * Ij + (10.0 / 9.0 * d1 * I + volumetric - k_bulk * J * (J - 1.0)) * ij * ij
                   - Wjx * Wjx / Wxx)


@njit(cache=True, fastmath=FAST, nogil=True)
def _tangent(address, constants, solid, x, piece, data):  # type: ignore[no-untyped-def]
    """With n_a = F Grad N_a and c_a = cof F Grad N_a (so dt = 2 n.du and dj = c.du) one Gauss point gives

        w gamma [2 W_t Grad N_a.Grad N_b I + W_j j'' + 4 W_tt n n^T + 2 W_tj (n c^T + c n^T) + W_jj c c^T].

    The first two together are positive for |W_j| <= 2 W_t, to which `convex` bounds W_j: beyond, the sheet buckles.
    It also leaves out the concave part that the volumetric energy has, in log J, at J < 1/2.
    """
    law = isochoric_law(address)
    k_bulk, mu, convex = solid.bulk_modulus, solid.shear_modulus, solid.convex
    conn, dN, w, gamma, slot = piece.conn, piece.dN, piece.w, piece.gamma, piece.slot
    K, n, c = np.empty((8, 8)), np.empty((4, 8)), np.empty((4, 8))
    t, j, inv_j, y, p, s = np.empty(4), np.empty(4), np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    I1, psi, dpsi, ddpsi, W = np.empty(4), np.empty(4), np.empty(4), np.empty(4), np.empty((5, 4))
    for e in range(conn.shape[0]):
        K[:] = 0.0
        for q in range(4):
            f0, f1, f2, f3 = 0.0, 0.0, 0.0, 0.0
            for a in range(4):
                node = conn[e, a]
                f0 += x[node, 0] * dN[e, q, a, 0]
                f1 += x[node, 0] * dN[e, q, a, 1]
                f2 += x[node, 1] * dN[e, q, a, 0]
                f3 += x[node, 1] * dN[e, q, a, 1]
            t[q] = f0 * f0 + f1 * f1 + f2 * f2 + f3 * f3
            j[q] = max(f0 * f3 - f1 * f2, J_FLOOR)
            for a in range(4):
                d0, d1 = dN[e, q, a, 0], dN[e, q, a, 1]
                n[q, 2 * a], n[q, 2 * a + 1] = f0 * d0 + f1 * d1, f2 * d0 + f3 * d1
                c[q, 2 * a], c[q, 2 * a + 1] = f3 * d0 - f2 * d1, f0 * d1 - f1 * d0
        _thin(law, constants, k_bulk, t, j, inv_j, y, p, s, I1, psi, dpsi, ddpsi)
        _second(inv_j, y, p, s, dpsi, ddpsi, k_bulk, convex, W)
        for q in range(4):
            wg = w[e, q] * gamma[e, q]
            soft = w[e, q] * ERSATZ_STIFFNESS * mu if gamma[e, q] < SOFT_GAMMA else 0.0
            direct, turning = 2.0 * wg * W[0, q] + soft, wg * W[1, q]
            if convex:
                turning = max(turning, -2.0 * wg * W[0, q])
            tt, tj, jj = 4.0 * wg * W[2, q], 2.0 * wg * W[3, q], wg * W[4, q]
            for a in range(4):
                a0, a1 = dN[e, q, a, 0], dN[e, q, a, 1]
                for bb in range(a, 4):
                    b0, b1 = dN[e, q, bb, 0], dN[e, q, bb, 1]
                    m, r = direct * (a0 * b0 + a1 * b1), turning * (a0 * b1 - a1 * b0)
                    K[2 * a, 2 * bb] += m
                    K[2 * a + 1, 2 * bb + 1] += m
                    K[2 * a, 2 * bb + 1] += r
                    K[2 * a + 1, 2 * bb] -= r
            for i in range(8):
                u, v = tt * n[q, i] + tj * c[q, i], tj * n[q, i] + jj * c[q, i]
                for k in range(i, 8):
                    K[i, k] += u * n[q, k] + v * c[q, k]
        for i in range(8):
            for k in range(8):
                at = slot[e, i, k]
                if at >= 0:
                    data[at] += K[i, k] if i <= k else K[k, i]


@njit(fastmath=FAST)
def _try(conn, inverse_mass, b, z, norm):  # type: ignore[no-untyped-def]
    """The vector M^-1 b of each element (rows of z as of positions), and the square of its norm in the mass."""
    L = LANES
    for i in range(L):
        total = 0.0
        for a in range(4):
            node = conn[a, i]
            for c in range(2):
                k = (2 * a + c) * L + i
                z[k] = b[k] * inverse_mass[node, c]
                total += b[k] * z[k]
        norm[i] = total


@njit(fastmath=FAST)
def _quadratic(ws, d, W, w, gamma, form):  # type: ignore[no-untyped-def]
    """w gamma times the second derivative of W at the deformation `ws` along the gradient `d`, at each point."""
    for i in range(_Q):
        f0, f1, f2, f3 = ws[i], ws[_Q + i], ws[2 * _Q + i], ws[3 * _Q + i]
        d0, d1, d2, d3 = d[i], d[_Q + i], d[2 * _Q + i], d[3 * _Q + i]
        dt, dj = 2.0 * (f0 * d0 + f1 * d1 + f2 * d2 + f3 * d3), f3 * d0 - f2 * d1 - f1 * d2 + f0 * d3
        form[i] = w[i] * gamma[i] * (2.0 * W[0, i] * (d0 * d0 + d1 * d1 + d2 * d2 + d3 * d3)
                                     + 2.0 * W[1, i] * (d0 * d3 - d1 * d2)
                                     + W[2, i] * dt * dt + 2.0 * W[3, i] * dt * dj + W[4, i] * dj * dj)


@njit(cache=True, fastmath=FAST, nogil=True)
def stiffness_plane_stress(address, constants, k_bulk, x, elements, inverse_mass):  # type: ignore[no-untyped-def]
    """Greatest Rayleigh quotient of the tangent and the mass for M^-1 b of an element [1/s^2], b = dJ_mean/du.

    b is the force of an all-round tension, and its motion about the stiffest an element has. Neighbours add to the
    quotient while they are stable, so it is a lower bound of the highest frequency squared.
    """
    law = isochoric_law(address)
    conn, geometry, gamma = elements.conn, elements.geometry, elements.gamma
    ws, d, z, b = np.empty(ROWS * LANES), np.empty(ROWS * LANES), np.empty(8 * LANES), np.empty(8 * LANES)
    t_stress, ab, norm, form = np.empty(4 * _Q), np.zeros(2 * _Q), np.empty(LANES), np.empty(_Q)
    inv_j, y, p, s, I1 = np.empty(_Q), np.empty(_Q), np.empty(_Q), np.empty(_Q), np.empty(_Q)
    psi_q, dpsi, ddpsi, W = np.empty(_Q), np.empty(_Q), np.empty(_Q), np.empty((5, _Q))
    j, t = points(ws, FLOORED), points(ws, TRACE)
    greatest = 0.0
    for tile in range(conn.shape[0]):
        geo, g = geometry[tile].reshape(-1), gamma[tile].reshape(-1)
        w = geo[WEIGHT * LANES:]
        ab[_Q:] = w
        _gather(conn[tile], x, z)
        _kinematics(z, geo, ws)
        _shift(t)
        _thin(law, constants, k_bulk, t, j, inv_j, y, p, s, I1, psi_q, dpsi, ddpsi)
        _second(inv_j, y, p, s, dpsi, ddpsi, k_bulk, False, W)
        _stress(ws, geo, ab, t_stress)
        _nodal_force(t_stress, b)
        _try(conn[tile], inverse_mass, b, z, norm)
        _kinematics(z, geo, d)
        _quadratic(ws, d, W, w, g, form)
        for i in range(LANES):
            total = form[i] + form[LANES + i] + form[2 * LANES + i] + form[3 * LANES + i]
            if total > greatest * norm[i]:
                greatest = total / norm[i]
    return greatest
