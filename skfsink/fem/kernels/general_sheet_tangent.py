"""Second derivatives of thin sheets of several invariants: the tangent, and the indicator of the highest frequency.

With F and v = (t, j, q_f) of the plane (:mod:`.general_sheet`), A_f being the directions of fibres in it,

    A_iJkL = 2 W_t delta_ik delta_JL + W_j d2j/dF_iJ dF_kL + 2 sum_f W_f delta_ik A_fJ A_fL
             + sum_bc W_bc dv_b/dF_iJ dv_c/dF_kL,

    dt/dF = 2 F,   dj/dF = cof F,   dq_f/dF = 2 (F A_f) A_f^T.

With `convex` the negative eigenvalues of A, a matrix (4, 4), are set to zero, as in :mod:`.general_tangent`.
"""

from __future__ import annotations

import numpy as np

from ...material import GeneralMaterial
from ...material.compiled import general_law
from ...system.jit import njit
from ..pattern import Pattern
from ..space import Space
from .force2d import FLOORED, ROWS, TRACE, WEIGHT, _gather, _kinematics, _nodal_force, _stress, points
from .general_sheet import across, stretched, thin
from .general_tangent import _project, adding
from .lanes import FAST, J_FLOOR, LANES
from .pieces import Pieces
from .plane_stress import _quadratic, _shift, _try
from .records import Solid
from .tangent import ERSATZ_STIFFNESS, SOFT_GAMMA, parts

__all__ = ["stiffness_general_sheet", "tangent_general_sheet"]

_Q = 4 * LANES

_, _, _scatter = parts(2)
_add = adding(2)


def tangent_general_sheet(space: Space, pattern: Pattern, material: GeneralMaterial, u: np.ndarray, gamma: np.ndarray,
                          fibres: np.ndarray, *, convex: bool = False, elements: np.ndarray | None = None,
                          threads: int = 1) -> np.ndarray:
    """Data of the tangent on `pattern`, as :func:`.general_tangent.tangent_general`."""
    x, law = space.X + u, material.compiled_law.address
    solid = Solid(material.bulk_modulus, material.shear_modulus, False, convex)
    pieces = Pieces(space, pattern, gamma, elements, fibres)
    return pieces.assemble(lambda piece, data: _tangent(law, material.constants, solid, x, piece, data), threads)


@njit(fastmath=FAST)
def second(i, k_bulk, inv_j, y, p, s, o, I, d, dd, z, plane, mixed, first, W):  # type: ignore[no-untyped-def]
    """Of one point i: W_b in `first` (m,), and W_bc with the stretch following in `W` (m, m).

    `plane` and `mixed` (m, m) are for the derivatives of the invariants with v, and with v and z.
    """
    m, ij, R, J = I.shape[0], inv_j[i], 1.0 / (y[i] * y[i]), y[i] * y[i] * y[i]
    ps, s_, o_ = p[i] * s[i], s[i], o[i]
    plane[:] = 0.0
    mixed[:] = 0.0
    plane[0, 0], plane[1, 0], plane[0, 1], plane[1, 1] = R, s_ * R, -2.0 * s_ * ij, 2.0 * (o_ - ps) * ij
    mixed[0, 0], mixed[1, 0], mixed[0, 1], mixed[1, 1] = (-2.0 * R, 2.0 * s_ * R, -8.0 * s_ * ij,
                                                          -(4.0 * ps + 8.0 * o_) * ij)
    for f in range(2, m):
        plane[f, f], mixed[f, f] = R, -2.0 * R
    Wzz = (d[0, i] * (16.0 * s_ + 4.0 * p[i]) + d[1, i] * (4.0 * ps + 16.0 * o_)
           + 9.0 * k_bulk * J * (2.0 * J - 1.0))
    for f in range(2, m):
        Wzz += 4.0 * d[f, i] * I[f, i]
    for a in range(m):
        for c in range(m):
            Wzz += dd[a, c, i] * z[a, i] * z[c, i]
    for b in range(m):
        slope, Wbz = 0.0, 0.0
        for a in range(m):
            slope += d[a, i] * plane[a, b]
            Wbz += d[a, i] * mixed[a, b]
            for c in range(m):
                Wbz += dd[a, c, i] * plane[a, b] * z[c, i]
        first[b] = slope
        mixed[0, b] = Wbz  # column b of it is no longer needed
    for b in range(m):
        for e in range(m):
            total = -mixed[0, b] * mixed[0, e] / Wzz
            for a in range(m):
                for c in range(m):
                    total += dd[a, c, i] * plane[a, b] * plane[c, e]
            W[b, e] = total
    W[0, 1] -= 2.0 * d[1, i] * s_ * R * ij
    W[1, 0] -= 2.0 * d[1, i] * s_ * R * ij
    W[1, 1] += (6.0 * d[0, i] * s_ + d[1, i] * (6.0 * ps + 2.0 * o_)) * ij * ij


@njit
def _modulus(F, fibres, first, W, wg, dv, A):  # type: ignore[no-untyped-def]
    """w gamma A_iJkL of one point, in the rows 2 i + J, from F as (f_00, f_01, f_10, f_11)."""
    m = dv.shape[0]
    for r in range(4):
        dv[0, r] = 2.0 * F[r]
    dv[1, 0], dv[1, 1], dv[1, 2], dv[1, 3] = F[3], -F[2], -F[1], F[0]
    A[:] = 0.0
    for r in range(4):
        A[r, r] = 2.0 * first[0]
    A[0, 3] = A[3, 0] = first[1]
    A[1, 2] = A[2, 1] = -first[1]
    for f in range(2, m):
        a = fibres[f - 2]
        n = F[0] * a[0] + F[1] * a[1], F[2] * a[0] + F[3] * a[1]
        for i in range(2):
            for J in range(2):
                dv[f, 2 * i + J] = 2.0 * n[i] * a[J]
                for L in range(2):
                    A[2 * i + J, 2 * i + L] += 2.0 * first[f] * a[J] * a[L]
    for b in range(m):
        for c in range(m):
            for r in range(4):
                share = W[b, c] * dv[b, r]
                for k in range(4):
                    A[r, k] += share * dv[c, k]
    for r in range(4):
        for k in range(4):
            A[r, k] *= wg


@njit(cache=True, nogil=True)
def _tangent(address, constants, solid, x, piece, data):  # type: ignore[no-untyped-def]
    law = general_law(address)
    k_bulk, mu, convex = solid.bulk_modulus, solid.shear_modulus, solid.convex
    conn, dN, w, gamma, slot, fibres = piece.conn, piece.dN, piece.w, piece.gamma, piece.slot, piece.fibres
    m = 2 + fibres.shape[1]
    K, A, T, F = np.empty((8, 8)), np.empty((4, 4)), np.empty((4, 2)), np.empty((4, 4))
    t, j, inv_j, y, p, s, o = (np.empty(4), np.empty(4), np.empty(4), np.empty(4), np.empty(4), np.empty(4),
                               np.empty(4))
    psi, I, d, dd = np.empty(4), np.empty((m, 4)), np.zeros((m, 4)), np.zeros((m, m, 4))
    z, work, along = np.empty((m, 4)), np.empty((2, 4)), np.empty((m - 2, 4))
    plane, mixed, first, W, dv = np.empty((m, m)), np.empty((m, m)), np.empty(m), np.empty((m, m)), np.empty((m, 4))
    for e in range(conn.shape[0]):
        K[:] = 0.0
        for q in range(4):
            F[q] = 0.0
            for a in range(4):
                node = conn[e, a]
                F[q, 0] += x[node, 0] * dN[e, q, a, 0]
                F[q, 1] += x[node, 0] * dN[e, q, a, 1]
                F[q, 2] += x[node, 1] * dN[e, q, a, 0]
                F[q, 3] += x[node, 1] * dN[e, q, a, 1]
            t[q] = F[q, 0] ** 2 + F[q, 1] ** 2 + F[q, 2] ** 2 + F[q, 3] ** 2
            j[q] = max(F[q, 0] * F[q, 3] - F[q, 1] * F[q, 2], J_FLOOR)
            for f in range(m - 2):
                n0 = F[q, 0] * fibres[e, f, 0] + F[q, 1] * fibres[e, f, 1]
                n1 = F[q, 2] * fibres[e, f, 0] + F[q, 3] * fibres[e, f, 1]
                along[f, q] = n0 * n0 + n1 * n1
        thin(law, constants, k_bulk, t, j, along, inv_j, y, p, s, o, I, psi, d, dd, z, work)
        across(p, s, o, I, z)
        for q in range(4):
            second(q, k_bulk, inv_j, y, p, s, o, I, d, dd, z, plane, mixed, first, W)
            _modulus(F[q], fibres[e], first, W, w[e, q] * gamma[e, q], dv, A)
            if convex:
                _project(A)
            if gamma[e, q] < SOFT_GAMMA:
                for r in range(4):
                    A[r, r] += w[e, q] * ERSATZ_STIFFNESS * mu
            _add(dN, piece.around, (e, q), A, T, K)
        _scatter(K, slot, e, data)


# --- the indicator of the highest frequency ---
@njit(fastmath=FAST)
def _second_plain(k_bulk, inv_j, y, p, s, o, d, dd, z, W):  # type: ignore[no-untyped-def]
    """What :func:`second` gives, without fibres at all points at once: rows W_t, W_j, W_tt, W_tj, W_jj of W."""
    for i in range(y.size):
        ij, R, J, ps = inv_j[i], 1.0 / (y[i] * y[i]), y[i] * y[i] * y[i], p[i] * s[i]
        d0, d1, z0, z1 = d[0, i], d[1, i], z[0, i], z[1, i]
        d00, d01, d11 = dd[0, 0, i], dd[0, 1, i], dd[1, 1, i]
        t1, j0, j1 = s[i] * R, -2.0 * s[i] * ij, 2.0 * (o[i] - ps) * ij  # derivatives of I2' with t, of both with j
        a0, a1, b0, b1 = d00 * R + d01 * t1, d01 * R + d11 * t1, d00 * j0 + d01 * j1, d01 * j0 + d11 * j1
        Wtz = a0 * z0 + a1 * z1 + 2.0 * R * (d1 * s[i] - d0)
        Wjz = b0 * z0 + b1 * z1 - (8.0 * d0 * s[i] + d1 * (4.0 * ps + 8.0 * o[i])) * ij
        Wzz = (d00 * z0 * z0 + 2.0 * d01 * z0 * z1 + d11 * z1 * z1 + d0 * (16.0 * s[i] + 4.0 * p[i])
               + d1 * (4.0 * ps + 16.0 * o[i]) + 9.0 * k_bulk * J * (2.0 * J - 1.0))
        W[0, i] = d0 * R + d1 * t1
        W[1, i] = d0 * j0 + d1 * j1
        W[2, i] = a0 * R + a1 * t1 - Wtz * Wtz / Wzz
        W[3, i] = a0 * j0 + a1 * j1 - 2.0 * d1 * t1 * ij - Wtz * Wjz / Wzz
        W[4, i] = (b0 * j0 + b1 * j1 + (6.0 * d0 * s[i] + d1 * (6.0 * ps + 2.0 * o[i])) * ij * ij
                   - Wjz * Wjz / Wzz)


@njit(fastmath=FAST)
def _along_fibres(q, i, ws, D, fibres, first, W, dv):  # type: ignore[no-untyped-def]
    """The second derivative of W at the deformation `ws` along the gradient `D`, at Gauss point q of lane i."""
    k = q * LANES + i
    f0, f1, f2, f3 = ws[k], ws[_Q + k], ws[2 * _Q + k], ws[3 * _Q + k]
    d0, d1, d2, d3 = D[k], D[_Q + k], D[2 * _Q + k], D[3 * _Q + k]
    dv[0], dv[1] = 2.0 * (f0 * d0 + f1 * d1 + f2 * d2 + f3 * d3), f3 * d0 - f2 * d1 - f1 * d2 + f0 * d3
    total = 2.0 * first[0] * (d0 * d0 + d1 * d1 + d2 * d2 + d3 * d3) + 2.0 * first[1] * (d0 * d3 - d1 * d2)
    for f in range(2, dv.size):
        a0, a1 = fibres[3 * f - 6, i], fibres[3 * f - 5, i]
        m0, m1 = d0 * a0 + d1 * a1, d2 * a0 + d3 * a1
        dv[f] = 2.0 * ((f0 * a0 + f1 * a1) * m0 + (f2 * a0 + f3 * a1) * m1)
        total += 2.0 * first[f] * (m0 * m0 + m1 * m1)
    for b in range(dv.size):
        for c in range(dv.size):
            total += W[b, c] * dv[b] * dv[c]
    return total


@njit(cache=True, fastmath=FAST, nogil=True)
def stiffness_general_sheet(address, constants, k_bulk, x, elements, inverse_mass):  # type: ignore[no-untyped-def]
    """What :func:`.plane_stress.stiffness_plane_stress` is, of a law of several invariants."""
    law = general_law(address)
    conn, geometry, gamma, fibres = elements.conn, elements.geometry, elements.gamma, elements.fibres
    m = 2 + fibres.shape[1] // 3
    ws, D, u, b = np.empty(ROWS * LANES), np.empty(ROWS * LANES), np.empty(8 * LANES), np.empty(8 * LANES)
    t_stress, ab, norm, form, plain = (np.empty(4 * _Q), np.zeros(2 * _Q), np.empty(LANES), np.empty(_Q),
                                       np.empty((5, _Q)))
    inv_j, y, p, s, o = np.empty(_Q), np.empty(_Q), np.empty(_Q), np.empty(_Q), np.empty(_Q)
    psi_q, I, d, dd = np.empty(_Q), np.empty((m, _Q)), np.zeros((m, _Q)), np.zeros((m, m, _Q))
    z, work, along = np.empty((m, _Q)), np.empty((2, _Q)), np.empty((m - 2, _Q))
    plane, mixed, first, W, dv = np.empty((m, m)), np.empty((m, m)), np.empty(m), np.empty((m, m)), np.empty(m)
    j, t = points(ws, FLOORED), points(ws, TRACE)
    greatest = 0.0
    for tile in range(conn.shape[0]):
        geo, g = geometry[tile].reshape(-1), gamma[tile].reshape(-1)
        w = geo[WEIGHT * LANES:]
        ab[_Q:] = w[:_Q]
        _gather(conn[tile], x, u)
        _kinematics(u, geo, ws)
        _shift(t)
        stretched(ws, fibres[tile], along)
        thin(law, constants, k_bulk, t, j, along, inv_j, y, p, s, o, I, psi_q, d, dd, z, work)
        across(p, s, o, I, z)
        _stress(ws, geo, ab, t_stress)
        _nodal_force(t_stress, b)
        _try(conn[tile], inverse_mass, b, u, norm)
        _kinematics(u, geo, D)
        if m == 2:
            _second_plain(k_bulk, inv_j, y, p, s, o, d, dd, z, plain)
            _quadratic(ws, D, plain, w, g, form)
        for q in range(4 * (m > 2)):
            for i in range(LANES):
                k = q * LANES + i
                second(k, k_bulk, inv_j, y, p, s, o, I, d, dd, z, plane, mixed, first, W)
                form[k] = w[k] * g[k] * _along_fibres(q, i, ws, D, fibres[tile], first, W, dv)
        for i in range(LANES):
            total = form[i] + form[LANES + i] + form[2 * LANES + i] + form[3 * LANES + i]
            if total > greatest * norm[i]:
                greatest = total / norm[i]
    return greatest
