"""Tangent for stored energies of several invariants, from the modulus at each Gauss point.

With A_iJkL the second derivative of  w gamma psi + w p J  at fixed p, one element gives

    K_ai,bk = gamma_bar k V b b^T + sum_q (Grad N_a)_J A_iJkL (Grad N_b)_L.

With `convex` the negative eigenvalues of every A, a matrix (dim^2, dim^2), are set to zero: the tangent is then
positive semidefinite at every point, and unchanged where no point is unstable. In a body of revolution A is a matrix
(5, 5), with the component F_33 last, whose variation is N_a/R along r.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...material import GeneralMaterial
from ...material.compiled import general_law
from ...material.crushed import J_FLOOR
from ...system.jit import njit
from ..pattern import Pattern
from ..space import Space
from .lanes import crush_factor
from .pieces import Pieces
from .records import Solid
from .tangent import ERSATZ_STIFFNESS, PART, SOFT_GAMMA, parts

__all__ = ["adding", "tangent_general"]


def tangent_general(space: Space, pattern: Pattern, material: GeneralMaterial, u: np.ndarray, gamma: np.ndarray,
                    fibres: np.ndarray, *, j_bar: bool = True, convex: bool = False,
                    elements: np.ndarray | None = None, threads: int = 1) -> np.ndarray:
    """Data of the tangent on `pattern`, as :func:`.tangent.tangent`.

    `fibres` (number of `elements`, families, 3) are directions.
    """
    x, law = space.X + u, material.compiled_law.address
    loop = _tangent_around if space.axisymmetric else _tangent_2d if space.dim == 2 else _tangent_3d
    solid = Solid(material.bulk_modulus, material.shear_modulus, j_bar, convex)
    pieces = Pieces(space, pattern, gamma, elements, fibres)
    return pieces.assemble(lambda piece, data: loop(law, material.constants, solid, x, piece, data), threads)


@njit
def _cofactor(F, G):  # type: ignore[no-untyped-def]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        G[i, 0] = F[j, 1] * F[k, 2] - F[j, 2] * F[k, 1]
        G[i, 1] = F[j, 2] * F[k, 0] - F[j, 0] * F[k, 2]
        G[i, 2] = F[j, 0] * F[k, 1] - F[j, 1] * F[k, 0]


# The two functions below take arrays one by one: a record of them costs the loop 15 % in 2D, see PART in tangent.py.
@njit
def _slopes(F, G, C, B, n, tr, X):  # type: ignore[no-untyped-def]
    """Slopes X_F (m, 3, 3) of the plain invariants, C and B = F F^T; n (m, 2, 3) holds F A and A of each family."""
    for i in range(3):
        for j in range(3):
            C[i, j] = F[0, i] * F[0, j] + F[1, i] * F[1, j] + F[2, i] * F[2, j]
            B[i, j] = F[i, 0] * F[j, 0] + F[i, 1] * F[j, 1] + F[i, 2] * F[j, 2]
    for i in range(3):
        for j in range(3):
            X[0, i, j] = 2.0 * F[i, j]
            X[1, i, j] = 2.0 * (tr * F[i, j] - F[i, 0] * C[0, j] - F[i, 1] * C[1, j] - F[i, 2] * C[2, j])
            for f in range(2, X.shape[0]):
                X[f, i, j] = 2.0 * n[f, 0, i] * n[f, 1, j]


@njit
def _modulus(dim, F, G, C, B, n, tr, R, I, d, dd, X, wg, pressure, volume, A):  # type: ignore[no-untyped-def]
    """A_iJkL in the rows dim i + J; `pressure` is w p J, and `volume` multiplies G_iJ G_kL besides.

    X holds the slopes of the plain invariants, and afterwards those of the isochoric ones.
    """
    m = X.shape[0]
    square, direct = 0.0, 0.0      # factors of G_iJ G_kL and G_iL G_kJ
    for a in range(m):
        p = 4.0 / 3.0 if a == 1 else 2.0 / 3.0
        square += d[a] * p * p * I[a]
        direct += d[a] * p * I[a]
    square = wg * square + pressure + volume
    direct = wg * direct - pressure
    unit = 2.0 * wg * (d[0] * R + d[1] * R * R * tr)
    e = 2.0 * wg * d[1] * R * R
    for i in range(dim):
        for J in range(dim):
            row = dim * i + J
            for k in range(dim):
                for L in range(dim):
                    s = square * G[i, J] * G[k, L] + direct * G[i, L] * G[k, J]
                    s += e * (2.0 * F[i, J] * F[k, L] - F[i, L] * F[k, J])
                    mixed = 2.0 / 3.0 * d[0] * R * (X[0, i, J] * G[k, L] + G[i, J] * X[0, k, L])
                    mixed += 4.0 / 3.0 * d[1] * R * R * (X[1, i, J] * G[k, L] + G[i, J] * X[1, k, L])
                    for f in range(2, m):
                        mixed += 2.0 / 3.0 * d[f] * R * (X[f, i, J] * G[k, L] + G[i, J] * X[f, k, L])
                    s -= wg * mixed
                    if i == k:
                        s -= e * C[J, L]
                        for f in range(2, m):
                            s += 2.0 * wg * d[f] * R * n[f, 1, J] * n[f, 1, L]
                        if J == L:
                            s += unit
                    if J == L:
                        s -= e * B[i, k]
                    A[row, dim * k + L] = s
    for a in range(m):
        p = 4.0 / 3.0 if a == 1 else 2.0 / 3.0
        scale = R * R if a == 1 else R
        plain = I[a] / scale
        for i in range(dim):
            for J in range(dim):
                X[a, i, J] = scale * (X[a, i, J] - p * plain * G[i, J])
    for a in range(m):
        for c in range(m):
            if dd[a, c] != 0.0:
                factor = wg * dd[a, c]
                for row in range(dim * dim):
                    s = factor * X[a, row // dim, row % dim]
                    for column in range(dim * dim):
                        A[row, column] += s * X[c, column // dim, column % dim]


@njit
def _project(A):  # type: ignore[no-untyped-def]
    """Sets the negative eigenvalues of the symmetric matrix A to zero."""
    values, vectors = np.linalg.eigh(A)
    for r in range(values.size):
        if values[r] < 0.0:
            for i in range(values.size):
                for j in range(values.size):
                    A[i, j] -= values[r] * vectors[i, r] * vectors[j, r]


@njit
def _in_half_plane(whole, A):  # type: ignore[no-untyped-def]
    """The rows and columns (i, J) of the `whole` (9, 9) that a body of revolution has: 00, 01, 10, 11 and 22."""
    for row in range(5):
        r = 8 if row == 4 else row + row // 2
        for column in range(5):
            A[row, column] = whole[r, 8 if column == 4 else column + column // 2]


def adding(dim: int, revolved: bool = False) -> Callable[..., Any]:
    """What a Gauss point adds to the matrix of its element, for one dimension."""
    na, n2 = 2**dim, dim * dim + revolved

    @njit(**PART)
    def add(dN, around, where, A, T, K):  # type: ignore[no-untyped-def]
        """Adds (Grad N_a)_J A_iJkL (Grad N_b)_L of a Gauss point on the upper triangle."""
        e, q = where
        for bb in range(na):
            for row in range(n2):
                for k in range(dim):
                    s = 0.0
                    for L in range(dim):
                        s += A[row, dim * k + L] * dN[e, q, bb, L]
                    if revolved and k == 0:
                        s += A[row, n2 - 1] * around[e, q, bb]
                    T[row, k] = s
            for a in range(bb + 1):
                for i in range(dim):
                    for k in range(dim):
                        s = 0.0
                        for j in range(dim):
                            s += dN[e, q, a, j] * T[dim * i + j, k]
                        if revolved and i == 0:
                            s += around[e, q, a] * T[n2 - 1, k]
                        K[dim * a + i, dim * bb + k] += s

    return add


def _make(dim: int, revolved: bool = False) -> Callable[..., Any]:
    """The element loop for one dimension, with its sizes as constants."""
    na = 2**dim
    nd, n2 = na * dim, dim * dim + revolved
    _, volumetric_coupling, scatter = parts(dim, revolved)
    add = adding(dim, revolved)

    @njit(cache=True, nogil=True)
    def loop(address, constants, solid, x, piece, data):  # type: ignore[no-untyped-def]
        law = general_law(address)
        k_bulk, mu, j_bar, convex = solid.bulk_modulus, solid.shear_modulus, solid.j_bar, solid.convex
        conn, dN, w, gamma, slot, fibres = piece.conn, piece.dN, piece.w, piece.gamma, piece.slot, piece.fibres
        m = 2 + fibres.shape[1]
        K, A, T = np.empty((nd, nd)), np.empty((n2, n2)), np.empty((n2, dim))
        whole = np.empty((9, 9))
        F, G, b = np.zeros((na, 3, 3)), np.empty((na, 3, 3)), np.empty(nd)
        C, B, X, n = np.empty((3, 3)), np.empty((3, 3)), np.empty((m, 3, 3)), np.zeros((na, m, 2, 3))
        J, tr, R, psi = np.empty(na), np.empty(na), np.empty(na), np.empty(na)
        I, d, dd = np.empty((m, na)), np.zeros((m, na)), np.zeros((m, m, na))
        F[:, 2, 2] = 1.0
        for e in range(conn.shape[0]):
            K[:] = 0.0
            b[:] = 0.0
            V, mean, gamma_bar = 0.0, 0.0, 0.0
            for q in range(na):
                for i in range(dim):
                    for j in range(dim):
                        s = 0.0
                        for a in range(na):
                            s += x[conn[e, a], i] * dN[e, q, a, j]
                        F[q, i, j] = s
                if revolved:
                    F[q, 2, 2] = 0.0
                    for a in range(na):
                        F[q, 2, 2] += x[conn[e, a], 0] * piece.around[e, q, a]
                _cofactor(F[q], G[q])
                J[q] = F[q, 0, 0] * G[q, 0, 0] + F[q, 0, 1] * G[q, 0, 1] + F[q, 0, 2] * G[q, 0, 2]
                R[q] = max(J[q], J_FLOOR) ** (-2.0 / 3.0)
                if J[q] < J_FLOOR:
                    R[q] *= crush_factor(J[q])
                t, second = 0.0, 0.0
                for i in range(3):
                    for j in range(3):
                        t += F[q, i, j] * F[q, i, j]
                        second += G[q, i, j] * G[q, i, j]
                tr[q] = t
                I[0, q], I[1, q] = R[q] * t, R[q] * R[q] * second
                for f in range(2, m):
                    s = 0.0
                    for i in range(3):
                        r = 0.0
                        for j in range(3):
                            r += F[q, i, j] * fibres[e, f - 2, j]
                        n[q, f, 0, i], n[q, f, 1, i] = r, fibres[e, f - 2, i]
                        s += r * r
                    I[f, q] = R[q] * s
                for a in range(na):
                    for i in range(dim):
                        s = 0.0
                        for j in range(dim):
                            s += G[q, i, j] * dN[e, q, a, j]
                        if revolved and i == 0:
                            s += G[q, 2, 2] * piece.around[e, q, a]
                        b[dim * a + i] += w[e, q] * s
                G[q] /= max(J[q], J_FLOOR)
                if J[q] < J_FLOOR:
                    G[q] /= crush_factor(J[q])
                V += w[e, q]
                mean += w[e, q] * J[q]
                gamma_bar += w[e, q] * gamma[e, q]
            mean /= V
            gamma_bar /= V
            law(I, constants, psi, d, dd)
            if j_bar:
                volumetric_coupling(gamma_bar * k_bulk / V, b, K)
            for q in range(na):
                wg = w[e, q] * gamma[e, q]
                if j_bar:
                    pressure, volume = w[e, q] * gamma_bar * k_bulk * (mean - 1.0) * J[q], 0.0
                else:
                    pressure, volume = wg * k_bulk * (J[q] - 1.0) * J[q], wg * k_bulk * max(J[q], J_FLOOR) ** 2
                    if J[q] < J_FLOOR:
                        volume *= crush_factor(J[q]) ** 2
                _slopes(F[q], G[q], C, B, n[q], tr[q], X)
                if revolved:
                    _modulus(3, F[q], G[q], C, B, n[q], tr[q], R[q], I[:, q], d[:, q], dd[:, :, q], X, wg, pressure,
                             volume, whole)
                    _in_half_plane(whole, A)
                else:
                    _modulus(dim, F[q], G[q], C, B, n[q], tr[q], R[q], I[:, q], d[:, q], dd[:, :, q], X, wg, pressure,
                             volume, A)
                if convex:
                    _project(A)
                if gamma[e, q] < SOFT_GAMMA:
                    for i in range(n2):
                        A[i, i] += w[e, q] * ERSATZ_STIFFNESS * mu
                add(dN, piece.around, (e, q), A, T, K)
            scatter(K, slot, e, data)

    return loop


_tangent_2d = _make(2)
_tangent_around = _make(2, revolved=True)
_tangent_3d = _make(3)
