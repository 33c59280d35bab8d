"""Loops for stored energies of several invariants, :mod:`skfsink.material.general`: the force in 2D and 3D.

The element potential is that of :mod:`.force2d`, with psi(I1', I2', I4', ...). The stress of a Gauss point is

    P = a F + b cof F - e F C + sum_f c_f (F A_f) A_f^T,
    a = 2 w gamma (psi_1 R + psi_2 R^2 tr C),   e = 2 w gamma psi_2 R^2,   c_f = 2 w gamma psi_f R,   R = J^(-2/3),
    b = w p - w gamma [2/3 (psi_1 I1' + sum_f psi_f I_f') + 4/3 psi_2 I2']/J.

With F_33 = f the components of  tr C F - F C  are  f^2 F + J cof F  in the plane, of its F, J and cof F, and  (F:F) f
across it: in plane strain e is not needed. `fibres` holds the directions A_f of each element, three rows for each
family, tiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...material.compiled import general_law
from ...system.jit import njit
from . import force2d, force3d
from .hoop import AROUND, add_hoop_force, hoop_stress, hoop_stretch, ratio_around
from .lanes import FAST, LANES, LANES_3D, continue_below_floor, guess_inverse_cbrt, refine_inverse_cbrt

__all__ = ["force_general_2d", "force_general_3d"]

_Q = 4 * LANES
_Q3 = 8 * LANES_3D


class _Isochoric(NamedTuple):
    """R = J^(-2/3), 1/J, the invariants (m, n), and the derivatives of psi with them."""

    R: np.ndarray
    inverse_J: np.ndarray
    I: np.ndarray
    d: np.ndarray


@njit(fastmath=FAST)
def _coefficients(w, gamma, pressure, isochoric, ab, c):  # type: ignore[no-untyped-def]
    """a and b without the part of I2' in a; the rows of c are e, then c_f of each family."""
    R, inverse, I, d = isochoric.R, isochoric.inverse_J, isochoric.I, isochoric.d
    Q = R.size
    for i in range(Q):
        wg = w[i] * gamma[i]
        ab[i] = 2.0 * wg * d[0, i] * R[i]
        c[0, i] = 2.0 * wg * d[1, i] * R[i] * R[i]
        pull = 2.0 / 3.0 * d[0, i] * I[0, i] + 4.0 / 3.0 * d[1, i] * I[1, i]
        ab[Q + i] = w[i] * pressure[i] - wg * pull * inverse[i]
    for f in range(2, I.shape[0]):
        for i in range(Q):
            wg = w[i] * gamma[i]
            c[f - 1, i] = 2.0 * wg * d[f, i] * R[i]
            ab[Q + i] -= 2.0 / 3.0 * wg * d[f, i] * I[f, i] * inverse[i]


# --- quadrilaterals ---
@njit(fastmath=FAST)
def _invariants_2d(ws, J, tr, R, fibres, I):  # type: ignore[no-untyped-def]
    for i in range(_Q):
        I[0, i] = R[i] * tr[i]
        I[1, i] = R[i] * R[i] * (tr[i] - 1.0 + J[i] * J[i])
    for f in range(2, I.shape[0]):
        A = fibres[3 * f - 6:3 * f - 3]
        for q in range(4):
            for i in range(LANES):
                k = q * LANES + i
                n0, n1 = ws[k] * A[0, i] + ws[_Q + k] * A[1, i], ws[2 * _Q + k] * A[0, i] + ws[3 * _Q + k] * A[1, i]
                I[f, k] = R[k] * (n0 * n0 + n1 * n1 + A[2, i] * A[2, i])


@njit(fastmath=FAST)
def _second_2d(J, c, ab):  # type: ignore[no-untyped-def]
    for i in range(_Q):
        ab[i] += c[0, i]
        ab[_Q + i] += c[0, i] * J[i]


@njit(fastmath=FAST)
def _invariants_around(ws, f, J, tr, R, fibres, I):  # type: ignore[no-untyped-def]
    """Those of :func:`_invariants_2d` in a body of revolution, J and tr with the stretch f around it."""
    for i in range(_Q):
        square = f[i] * f[i]
        plane = ws[i] * ws[3 * _Q + i] - ws[_Q + i] * ws[2 * _Q + i]
        I[0, i] = R[i] * tr[i]
        I[1, i] = R[i] * R[i] * (plane * plane + square * (tr[i] - square))
    for n in range(2, I.shape[0]):
        A = fibres[3 * n - 6:3 * n - 3]
        for q in range(4):
            for i in range(LANES):
                k = q * LANES + i
                n0, n1 = ws[k] * A[0, i] + ws[_Q + k] * A[1, i], ws[2 * _Q + k] * A[0, i] + ws[3 * _Q + k] * A[1, i]
                I[n, k] = R[k] * (n0 * n0 + n1 * n1 + f[k] * f[k] * A[2, i] * A[2, i])


@njit(fastmath=FAST)
def _second_around(ws, f, tr, around, c, ab, hoop):  # type: ignore[no-untyped-def]
    """What :func:`_second_2d` adds, after :func:`.hoop_stress`."""
    for i in range(_Q):
        square = f[i] * f[i]
        ab[i] += c[0, i] * square
        ab[_Q + i] += c[0, i] * (ws[i] * ws[3 * _Q + i] - ws[_Q + i] * ws[2 * _Q + i])
        hoop[i] += c[0, i] * (tr[i] - square) * f[i] * around[i]


@njit(fastmath=FAST)
def _fibre_stress_around(f, fibres, around, c, hoop):  # type: ignore[no-untyped-def]
    for n in range(1, c.shape[0]):
        A = fibres[3 * n - 1]
        for q in range(4):
            for i in range(LANES):
                k = q * LANES + i
                hoop[k] += c[n, k] * f[k] * A[i] * A[i] * around[k]


@njit(fastmath=FAST)
def _fibre_stress_2d(ws, geo, fibres, c, t):  # type: ignore[no-untyped-def]
    """Adds the stress of the fibres, pulled back to the reference square."""
    for f in range(1, c.shape[0]):
        A = fibres[3 * f - 3:3 * f]
        for q in range(4):
            for i in range(LANES):
                k = q * LANES + i
                a0, a1 = A[0, i], A[1, i]
                n0, n1 = c[f, k] * (ws[k] * a0 + ws[_Q + k] * a1), c[f, k] * (ws[2 * _Q + k] * a0 + ws[3 * _Q + k] * a1)
                m0, m1 = a0 * geo[k] + a1 * geo[_Q + k], a0 * geo[2 * _Q + k] + a1 * geo[3 * _Q + k]
                t[k] += n0 * m0
                t[_Q + k] += n0 * m1
                t[2 * _Q + k] += n1 * m0
                t[3 * _Q + k] += n1 * m1


@njit(cache=True, fastmath=FAST, nogil=True)
def force_general_2d(address, constants, volumetric_part, x, elements):  # type: ignore[no-untyped-def]
    """Arguments and results as of :func:`.force2d.force_2d`."""
    law = general_law(address)
    k_bulk, j_bar = volumetric_part.bulk_modulus, volumetric_part.j_bar
    conn, geometry, gamma = elements.conn, elements.geometry, elements.gamma
    fibres, force, W, psi = elements.fibres, elements.force, elements.W, elements.psi
    m = 2 + fibres.shape[1] // 3
    ws, z, t, p = np.empty(force2d.ROWS * LANES), np.empty(8 * LANES), np.empty(4 * _Q), np.empty(2 * LANES)
    ab, pressure, volumetric = np.empty(2 * _Q), np.empty(_Q), np.empty(_Q)
    I, d, dd, c = np.empty((m, _Q)), np.zeros((m, _Q)), np.zeros((m, m, _Q)), np.empty((m - 1, _Q))
    J, R, psi_q = force2d.points(ws, force2d.J_ROW), force2d.points(ws, force2d.R_ROW), np.empty(_Q)
    floored, tr = force2d.points(ws, force2d.FLOORED), force2d.points(ws, force2d.TRACE)
    f, hoop, revolved = force2d.points(ws, force2d.HOOP), np.empty(_Q), geometry.shape[1] > AROUND
    least = np.ones(_Q)
    for b in range(conn.shape[0]):
        geo, g = geometry[b].reshape(-1), gamma[b].reshape(-1)
        w = geo[force2d.WEIGHT * LANES:]
        force2d._gather(conn[b], x, z)
        around = geo[AROUND * LANES:]
        force2d._kinematics(z, geo, ws)
        if revolved:
            ratio_around(z, around, f)
            hoop_stretch(f, J, floored, tr)
        force2d.least_live(J, g, least)
        guess_inverse_cbrt(floored.view(np.int64), R.view(np.int64))
        refine_inverse_cbrt(floored, R)
        continue_below_floor(J, floored, R)
        if revolved:
            _invariants_around(ws, f, J, tr, R, fibres[b], I)
        else:
            _invariants_2d(ws, J, tr, R, fibres[b], I)
        law(I, constants, psi_q, d, dd)
        if j_bar:
            force2d._dilatation(geo, g, k_bulk, ws, p)
            force2d._spread(p, pressure, volumetric)
        else:
            force2d._dilatation_plain(g, k_bulk, J, pressure, volumetric)
        _coefficients(w, g, pressure, _Isochoric(R, floored, I, d), ab, c)  # floored: by now 1/J
        if revolved:
            hoop_stress(ws, f, around, ab, hoop)
            _second_around(ws, f, tr, around, c, ab, hoop)
            _fibre_stress_around(f, fibres[b], around, c, hoop)
        else:
            _second_2d(J, c, ab)
        force2d._stress(ws, geo, ab, t)
        _fibre_stress_2d(ws, geo, fibres[b], c, t)
        force2d._nodal_force(t, force[b].reshape(-1))
        if revolved:
            add_hoop_force(hoop, force[b].reshape(-1))
        density = W[b].reshape(-1)
        force2d._add(psi_q, volumetric, density)
        force2d._energy(w, g, density, psi[b])
    return least.min()


# --- hexahedra ---
@njit(fastmath=FAST)
def _invariants_3d(F, tr, R, fibres, I):  # type: ignore[no-untyped-def]
    Q = _Q3
    for i in range(Q):
        f0, f1, f2, f3, f4 = F[i], F[Q + i], F[2 * Q + i], F[3 * Q + i], F[4 * Q + i]
        f5, f6, f7, f8 = F[5 * Q + i], F[6 * Q + i], F[7 * Q + i], F[8 * Q + i]
        c0, c1, c2 = f4 * f8 - f5 * f7, f5 * f6 - f3 * f8, f3 * f7 - f4 * f6
        c3, c4, c5 = f2 * f7 - f1 * f8, f0 * f8 - f2 * f6, f1 * f6 - f0 * f7
        c6, c7, c8 = f1 * f5 - f2 * f4, f2 * f3 - f0 * f5, f0 * f4 - f1 * f3
        I[0, i] = R[i] * tr[i]
        I[1, i] = R[i] * R[i] * (c0 * c0 + c1 * c1 + c2 * c2 + c3 * c3 + c4 * c4 + c5 * c5 + c6 * c6 + c7 * c7
                                 + c8 * c8)
    for f in range(2, I.shape[0]):
        A = fibres[3 * f - 6:3 * f - 3]
        for q in range(8):
            for i in range(LANES_3D):
                k = q * LANES_3D + i
                a0, a1, a2 = A[0, i], A[1, i], A[2, i]
                n0 = F[k] * a0 + F[Q + k] * a1 + F[2 * Q + k] * a2
                n1 = F[3 * Q + k] * a0 + F[4 * Q + k] * a1 + F[5 * Q + k] * a2
                n2 = F[6 * Q + k] * a0 + F[7 * Q + k] * a1 + F[8 * Q + k] * a2
                I[f, k] = R[k] * (n0 * n0 + n1 * n1 + n2 * n2)


@njit(fastmath=FAST)
def _second_3d(F, tr, c, P):  # type: ignore[no-untyped-def]
    """Adds e (tr C F - F C) to the stress."""
    Q = _Q3
    for i in range(Q):
        e, t = c[0, i], tr[i]
        f0, f1, f2, f3, f4 = F[i], F[Q + i], F[2 * Q + i], F[3 * Q + i], F[4 * Q + i]
        f5, f6, f7, f8 = F[5 * Q + i], F[6 * Q + i], F[7 * Q + i], F[8 * Q + i]
        c00, c11 = f0 * f0 + f3 * f3 + f6 * f6 - t, f1 * f1 + f4 * f4 + f7 * f7 - t
        c22 = f2 * f2 + f5 * f5 + f8 * f8 - t
        c01, c02, c12 = f0 * f1 + f3 * f4 + f6 * f7, f0 * f2 + f3 * f5 + f6 * f8, f1 * f2 + f4 * f5 + f7 * f8
        P[i] -= e * (f0 * c00 + f1 * c01 + f2 * c02)
        P[Q + i] -= e * (f0 * c01 + f1 * c11 + f2 * c12)
        P[2 * Q + i] -= e * (f0 * c02 + f1 * c12 + f2 * c22)
        P[3 * Q + i] -= e * (f3 * c00 + f4 * c01 + f5 * c02)
        P[4 * Q + i] -= e * (f3 * c01 + f4 * c11 + f5 * c12)
        P[5 * Q + i] -= e * (f3 * c02 + f4 * c12 + f5 * c22)
        P[6 * Q + i] -= e * (f6 * c00 + f7 * c01 + f8 * c02)
        P[7 * Q + i] -= e * (f6 * c01 + f7 * c11 + f8 * c12)
        P[8 * Q + i] -= e * (f6 * c02 + f7 * c12 + f8 * c22)


@njit(fastmath=FAST)
def _fibre_stress_3d(F, fibres, c, P):  # type: ignore[no-untyped-def]
    Q = _Q3
    for f in range(1, c.shape[0]):
        A = fibres[3 * f - 3:3 * f]
        for q in range(8):
            for row in range(0, 9 * Q, 3 * Q):
                for i in range(LANES_3D):
                    k = q * LANES_3D + i
                    a0, a1, a2 = A[0, i], A[1, i], A[2, i]
                    n = c[f, k] * (F[row + k] * a0 + F[row + Q + k] * a1 + F[row + 2 * Q + k] * a2)
                    P[row + k] += n * a0
                    P[row + Q + k] += n * a1
                    P[row + 2 * Q + k] += n * a2


@njit(cache=True, fastmath=FAST, nogil=True)
def force_general_3d(address, constants, volumetric_part, x, elements):  # type: ignore[no-untyped-def]
    """Arguments and results as of :func:`.force3d.force_3d`."""
    law = general_law(address)
    k_bulk, j_bar = volumetric_part.bulk_modulus, volumetric_part.j_bar
    conn, geometry, gamma = elements.conn, elements.geometry, elements.gamma
    fibres, force, W, psi = elements.fibres, elements.force, elements.W, elements.psi
    L, Q, m = LANES_3D, _Q3, 2 + fibres.shape[1] // 3
    z, g, t = np.empty(24 * L), np.empty(3 * Q), np.empty(3 * Q)
    F, P = np.empty(9 * Q), np.empty(9 * Q)
    J, floored, tr, R, psi_q = np.empty(Q), np.empty(Q), np.empty(Q), np.empty(Q), np.empty(Q)
    I, d, dd, c = np.empty((m, Q)), np.zeros((m, Q)), np.zeros((m, m, Q)), np.empty((m - 1, Q))
    ab, mean, pressure, volumetric = np.empty(2 * Q), np.empty(3 * L), np.empty(Q), np.empty(Q)
    least = np.ones(Q)
    for tile in range(conn.shape[0]):
        geo, gam = geometry[tile].reshape(-1), gamma[tile].reshape(-1)
        w = geo[force3d.WEIGHT * Q:]
        force3d._deformation(conn[tile], x, geo, z, g, F)
        force3d._invariants(F, J, floored, tr)
        force2d.least_live(J, gam, least)
        guess_inverse_cbrt(floored.view(np.int64), R.view(np.int64))
        refine_inverse_cbrt(floored, R)
        continue_below_floor(J, floored, R)
        _invariants_3d(F, tr, R, fibres[tile], I)
        law(I, constants, psi_q, d, dd)
        if j_bar:
            force3d._means(w, J, gam, mean)
            force3d._dilatation(mean, k_bulk, pressure, volumetric)
        else:
            force2d._dilatation_plain(gam, k_bulk, J, pressure, volumetric)
        _coefficients(w, gam, pressure, _Isochoric(R, floored, I, d), ab, c)
        force3d._piola(F, ab, P)
        _second_3d(F, tr, c, P)
        _fibre_stress_3d(F, fibres[tile], c, P)
        density, out = W[tile].reshape(-1), force[tile].reshape(-1)
        for i in range(3):
            force3d._pull(P[3 * i * Q:3 * (i + 1) * Q], geo, t)
            force3d._nodal_force(t, out[i * L:])
        force2d._add(psi_q, volumetric, density)
        force3d._energy(w, gam, density, psi[tile])
    return least.min()
