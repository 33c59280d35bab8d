"""Tangent stiffness of the momentum equation, element by element, scattered into a fixed pattern.

Second derivative of the element potential in :mod:`.force2d`. With g_a = F^-T Grad N_a, n_a = F Grad N_a,
b = dJ_bar/du and A_a = dI1'/du, one element gives (Eq. 18, 19 with the J_bar coupling)

    K = gamma_bar k V b b^T
        + sum_q w gamma (psi'' A A^T + psi' d2I1'/du2) + sum_q w p J (g_a g_b^T - g_b g_a^T),
    d2I1'/du2 = J^(-2/3) [2 (Grad N_a . Grad N_b) I - 4/3 (n_a g_b^T + g_a n_b^T) + 4/9 trC g_a g_b^T
                          + 2/3 trC g_b g_a^T].

In a body of revolution g_a and n_a have the parts  (cof F)_33/J N_a/R  and  F_33 N_a/R  along r besides, Grad N_a .
Grad N_b the part  N_a N_b/R^2  in r r, and g_b g_a^T is that of the plane and, in r r, the product of those parts.

It is symmetric and couples all Gauss points of the element through b. A Gauss point with gamma < `SOFT_GAMMA` adds
`ERSATZ_STIFFNESS` times the stiffness of an undeformed solid, mu int Grad v : Grad u: it keeps nodes that nothing
holds any more where they are, as the factor 1e-6 on failed elements does in Sec. 4 of the paper. There the factor is
applied to the computed stiffness; that of a tangled element need not be positive, the undeformed one is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...material import Material
from ...material.compiled import isochoric_law
from ...material.crushed import J_FLOOR
from ...system.jit import njit
from ..pattern import Pattern
from ..space import Space
from .lanes import crush_factor
from .pieces import Pieces
from .records import Solid

__all__ = ["ERSATZ_STIFFNESS", "SOFT_GAMMA", "tangent"]

ERSATZ_STIFFNESS = 1e-6
SOFT_GAMMA = 1e-3


def tangent(space: Space, pattern: Pattern, material: Material, u: np.ndarray, gamma: np.ndarray,
            *, j_bar: bool = True, convex: bool = False, elements: np.ndarray | None = None,
            threads: int = 1) -> np.ndarray:
    """Data of the tangent on `pattern` at the displacement `u` (n, dim) and Gauss point densities `gamma` (ne, nq).

    With `convex` the pressure in the geometric part is bounded where it would make a Gauss point unstable. With
    `elements` it is that of these alone. It does not depend on the number of `threads`.
    """
    x, law = space.X + u, material.compiled_law.address
    loop = _tangent_around if space.axisymmetric else _tangent_2d if space.dim == 2 else _tangent_3d
    solid = Solid(material.bulk_modulus, material.shear_modulus, j_bar, convex)
    pieces = Pieces(space, pattern, gamma, elements)
    return pieces.assemble(lambda piece, data: loop(law, material.constants, solid, x, piece, data), threads)


@njit(fastmath={"contract", "arcp", "nsz"})
def _greatest(F, tr):  # type: ignore[no-untyped-def]
    """Greatest eigenvalue of C = F^T F (3, 3), whose trace is `tr`."""
    second, third = 0.0, 0.0   # invariants of the deviator: |dev|^2 / 2 and its determinant
    m = tr / 3.0
    c00 = F[0, 0] ** 2 + F[1, 0] ** 2 + F[2, 0] ** 2 - m
    c11 = F[0, 1] ** 2 + F[1, 1] ** 2 + F[2, 1] ** 2 - m
    c22 = F[0, 2] ** 2 + F[1, 2] ** 2 + F[2, 2] ** 2 - m
    c01 = F[0, 0] * F[0, 1] + F[1, 0] * F[1, 1] + F[2, 0] * F[2, 1]
    c02 = F[0, 0] * F[0, 2] + F[1, 0] * F[1, 2] + F[2, 0] * F[2, 2]
    c12 = F[0, 1] * F[0, 2] + F[1, 1] * F[1, 2] + F[2, 1] * F[2, 2]
    second = 0.5 * (c00 * c00 + c11 * c11 + c22 * c22) + c01 * c01 + c02 * c02 + c12 * c12
    third = c00 * (c11 * c22 - c12 * c12) - c01 * (c01 * c22 - c12 * c02) + c02 * (c01 * c12 - c11 * c02)
    r = np.sqrt(second / 3.0)
    if r <= 1e-12 * m:
        return m
    cosine = min(1.0, max(-1.0, third / (2.0 * r**3)))
    return m + 2.0 * r * np.cos(np.arccos(cosine) / 3.0)


#: Options of the parts of a loop: numba puts them into it before the compiler sees it, as if they were written there.
#: The order of the sums in a loop, which the compiler may change, then does not depend on how it is taken apart. What
#: is left in the loop below would change its last bits (the factors of a Gauss point) or cost it 5 % (the gradients of
#: the shape functions) as a part, and a record of its arrays a third in 2D, whose references are counted at each use.
PART: dict[str, Any] = {"inline": "always"}


@njit(**PART)
def _cofactor(F, G):  # type: ignore[no-untyped-def]
    G[0, 0] = F[1, 1] * F[2, 2] - F[1, 2] * F[2, 1]
    G[0, 1] = F[1, 2] * F[2, 0] - F[1, 0] * F[2, 2]
    G[0, 2] = F[1, 0] * F[2, 1] - F[1, 1] * F[2, 0]
    G[1, 0] = F[0, 2] * F[2, 1] - F[0, 1] * F[2, 2]
    G[1, 1] = F[0, 0] * F[2, 2] - F[0, 2] * F[2, 0]
    G[1, 2] = F[0, 1] * F[2, 0] - F[0, 0] * F[2, 1]
    G[2, 0] = F[0, 1] * F[1, 2] - F[0, 2] * F[1, 1]
    G[2, 1] = F[0, 2] * F[1, 0] - F[0, 0] * F[1, 2]
    G[2, 2] = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]


def parts(dim: int, revolved: bool = False) -> tuple[Callable[..., Any], ...]:
    """Parts of the element loops for one dimension: deformation, volumetric coupling, and scatter.

    Those that are `revolved` are of bodies of revolution, dim = 2.
    """
    na = 2**dim
    nd = na * dim

    @njit(**PART)
    def deformation(x, piece, e, q, F):  # type: ignore[no-untyped-def]
        """F = Grad x at Gauss point q, with F_33 = 1 in a plane, or r/R."""
        F[:] = 0.0
        F[2, 2] = 1.0
        if revolved:
            F[2, 2] = 0.0
            for a in range(na):
                F[2, 2] += x[piece.conn[e, a], 0] * piece.around[e, q, a]
        for i in range(dim):
            for j in range(dim):
                s = 0.0
                for a in range(na):
                    s += x[piece.conn[e, a], i] * piece.dN[e, q, a, j]
                F[i, j] = s

    @njit(**PART)
    def volumetric_coupling(factor, b, K):  # type: ignore[no-untyped-def]
        """gamma_bar k V b b^T on the upper triangle."""
        for i in range(nd):
            for j in range(i, nd):
                K[i, j] = factor * b[i] * b[j]

    @njit(**PART)
    def scatter(K, slot, e, data):  # type: ignore[no-untyped-def]
        """Adds the symmetric matrix of an element, of which the upper triangle is there."""
        for i in range(nd):
            for j in range(nd):
                k = slot[e, i, j]
                if k >= 0:
                    data[k] += K[i, j] if i <= j else K[j, i]

    return deformation, volumetric_coupling, scatter


def _make(dim: int, revolved: bool = False) -> Callable[..., Any]:
    """The element loop for one dimension, with its sizes as constants so that the compiler unrolls it."""
    na = 2**dim
    nd = na * dim
    deformation, volumetric_coupling, scatter = parts(dim, revolved)

    @njit(**PART)
    def products(where, factors, dN, g, Az, K):  # type: ignore[no-untyped-def]
        """Adds the isochoric and the geometric part of a Gauss point on the upper triangle.

        The rows na and after of a `g` of a body of revolution are those of the plane alone.
        """
        e, q = where
        direct, c2, crossed = factors
        p = na + q if revolved else q
        for a in range(na):
            for bb in range(a, na):
                s = 0.0
                for j in range(dim):
                    s += dN[e, q, a, j] * dN[e, q, bb, j]
                s *= direct
                for i in range(dim):
                    ai = dim * a + i
                    for k in range(dim):
                        bk = dim * bb + k
                        K[ai, bk] += (c2 * Az[0, ai] * Az[0, bk] + Az[1, ai] * g[q, bk] + g[q, ai] * Az[1, bk]
                                      + crossed * g[p, dim * a + k] * g[p, dim * bb + i])
                    K[ai, dim * bb + i] += s

    @njit(cache=True, fastmath={"contract", "arcp", "nsz", "reassoc"}, nogil=True)
    def loop(address, constants, solid, x, piece, data):  # type: ignore[no-untyped-def]
        law = isochoric_law(address)
        k_bulk, mu, j_bar, convex = solid.bulk_modulus, solid.shear_modulus, solid.j_bar, solid.convex
        conn, dN, w, gamma, slot = piece.conn, piece.dN, piece.w, piece.gamma, piece.slot
        K, b = np.empty((nd, nd)), np.empty(nd)
        g, nf, Az = np.empty((2 * na if revolved else na, nd)), np.empty((na, nd)), np.empty((2, nd))
        ring = np.empty(na)
        F, G = np.empty((3, 3)), np.empty((3, 3))
        J, tr, I1, R = np.empty(na), np.empty(na), np.empty(na), np.empty(na)
        least = np.empty(na)
        psi, dpsi, ddpsi = np.empty(na), np.empty(na), np.empty(na)
        for e in range(conn.shape[0]):
            K[:] = 0.0
            b[:] = 0.0
            V, mean, gamma_bar = 0.0, 0.0, 0.0
            for q in range(na):
                deformation(x, piece, e, q, F)
                _cofactor(F, G)
                det = F[0, 0] * G[0, 0] + F[0, 1] * G[0, 1] + F[0, 2] * G[0, 2]
                t = 0.0
                for i in range(3):
                    for j in range(3):
                        t += F[i, j] * F[i, j]
                J[q] = det
                tr[q] = t
                floored = max(det, J_FLOOR)
                R[q] = floored ** (-2.0 / 3.0)
                if det < J_FLOOR:
                    R[q] *= crush_factor(det)
                    floored *= crush_factor(det)  # J_e
                if convex:  # least product of two stretches that the deformation can turn
                    if revolved:
                        least[q] = floored / max(F[2, 2], J_FLOOR)
                    else:
                        least[q] = floored if dim == 2 else floored / np.sqrt(_greatest(F, t))
                I1[q] = R[q] * t
                for a in range(na):
                    for i in range(dim):
                        s, r = 0.0, 0.0
                        for j in range(dim):
                            s += G[i, j] * dN[e, q, a, j]
                            r += F[i, j] * dN[e, q, a, j]
                        if revolved:
                            g[na + q, dim * a + i] = s / floored
                            if i == 0:
                                s += G[2, 2] * piece.around[e, q, a]
                                r += F[2, 2] * piece.around[e, q, a]
                        b[dim * a + i] += w[e, q] * s
                        g[q, dim * a + i] = s / floored
                        nf[q, dim * a + i] = r
                if revolved:
                    ring[q] = (G[2, 2] / floored) ** 2
                V += w[e, q]
                mean += w[e, q] * det
                gamma_bar += w[e, q] * gamma[e, q]
            mean /= V
            gamma_bar /= V
            law(I1, constants, psi, dpsi, ddpsi)
            if j_bar:
                volumetric_coupling(gamma_bar * k_bulk / V, b, K)
            for q in range(na):
                wg = w[e, q] * gamma[e, q]
                c1 = wg * dpsi[q] * R[q]
                c2 = wg * ddpsi[q]
                if j_bar:
                    wpJ, wkJJ = w[e, q] * gamma_bar * k_bulk * (mean - 1.0) * J[q], 0.0
                else:
                    wpJ, wkJJ = wg * k_bulk * (J[q] - 1.0) * J[q], wg * k_bulk * max(J[q], J_FLOOR) ** 2
                    if J[q] < J_FLOOR:
                        wkJJ *= crush_factor(J[q]) ** 2
                if convex:
                    middle, reach = 2.0 / 3.0 * tr[q] * c1, 2.0 * c1 * least[q]
                    wpJ = min(max(wpJ, middle - reach), middle + reach)
                straight = 0.5 * (4.0 / 9.0 * tr[q] * c1 + wpJ + wkJJ)
                crossed = 2.0 / 3.0 * tr[q] * c1 - wpJ
                soft = w[e, q] * ERSATZ_STIFFNESS * mu if gamma[e, q] < SOFT_GAMMA else 0.0
                for i in range(nd):
                    Az[0, i] = R[q] * (2.0 * nf[q, i] - 2.0 / 3.0 * tr[q] * g[q, i])
                    Az[1, i] = straight * g[q, i] - 4.0 / 3.0 * c1 * nf[q, i]
                products((e, q), (2.0 * c1 + soft, c2, crossed), dN, g, Az, K)
                if revolved:
                    around = 2.0 * c1 + soft + crossed * ring[q]
                    for a in range(na):
                        for bb in range(a, na):
                            K[dim * a, dim * bb] += around * piece.around[e, q, a] * piece.around[e, q, bb]
            scatter(K, slot, e, data)

    return loop


_tangent_2d = _make(2)
_tangent_around = _make(2, revolved=True)
_tangent_3d = _make(3)
