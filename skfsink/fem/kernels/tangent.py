"""Tangent stiffness of the momentum equation, element by element, scattered into a fixed pattern.

Second derivative of the element potential in :mod:`.force2d`. With g_a = F^-T Grad N_a, n_a = F Grad N_a,
b = dJ_bar/du and A_a = dI1'/du, one element gives (Eq. 18, 19 with the J_bar coupling)

    K = gamma_bar k V b b^T
        + sum_q w gamma (psi'' A A^T + psi' d2I1'/du2) + sum_q w p J (g_a g_b^T - g_b g_a^T),
    d2I1'/du2 = J^(-2/3) [2 (Grad N_a . Grad N_b) I - 4/3 (n_a g_b^T + g_a n_b^T) + 4/9 trC g_a g_b^T
                          + 2/3 trC g_b g_a^T].

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
from ...system.jit import njit
from ..pattern import Pattern
from ..space import Space
from .lanes import J_FLOOR
from .pieces import pieces

__all__ = ["ERSATZ_STIFFNESS", "SOFT_GAMMA", "tangent"]

ERSATZ_STIFFNESS = 1e-6
SOFT_GAMMA = 1e-3


def tangent(space: Space, pattern: Pattern, material: Material, u: np.ndarray, gamma: np.ndarray,
            j_bar: bool = True, convex: bool = False, elements: np.ndarray | None = None) -> np.ndarray:
    """Data of the tangent on `pattern` at the displacement `u` (n, dim) and Gauss point densities `gamma` (ne, nq).

    With `convex` the pressure in the geometric part is bounded where it would make a Gauss point unstable. With
    `elements` it is that of these alone.
    """
    data, x = np.zeros(pattern.nnz), space.X + u
    loop = _tangent_2d if space.dim == 2 else _tangent_3d
    for conn, dN, w, at_gauss, slot in pieces(space, pattern, gamma, elements):
        loop(material.compiled_law, material.constants, material.bulk_modulus, material.shear_modulus, conn, x, dN, w,
             at_gauss, j_bar, convex, slot, data)
    return data


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


def _make(dim: int) -> Callable[..., Any]:
    """The element loop for one dimension, with its sizes as constants so that the compiler unrolls it."""
    na = 2**dim
    nd = na * dim

    @njit(cache=True, fastmath={"contract", "arcp", "nsz", "reassoc"}, nogil=True)
    def loop(law, constants, k_bulk, mu, conn, x, dN, w, gamma, j_bar, convex, slot, data):  # type: ignore[no-untyped-def]
        K, b = np.empty((nd, nd)), np.empty(nd)
        g, nf, A, z = np.empty((na, nd)), np.empty((na, nd)), np.empty(nd), np.empty(nd)
        F, G = np.empty((3, 3)), np.empty((3, 3))
        J, tr, I1, R = np.empty(na), np.empty(na), np.empty(na), np.empty(na)
        least = np.empty(na)
        psi, dpsi, ddpsi = np.empty(na), np.empty(na), np.empty(na)
        for e in range(conn.shape[0]):
            K[:] = 0.0
            b[:] = 0.0
            V, mean, gamma_bar = 0.0, 0.0, 0.0
            for q in range(na):
                F[:] = 0.0
                F[2, 2] = 1.0
                for i in range(dim):
                    for j in range(dim):
                        s = 0.0
                        for a in range(na):
                            s += x[conn[e, a], i] * dN[e, q, a, j]
                        F[i, j] = s
                G[0, 0] = F[1, 1] * F[2, 2] - F[1, 2] * F[2, 1]   # cof F
                G[0, 1] = F[1, 2] * F[2, 0] - F[1, 0] * F[2, 2]
                G[0, 2] = F[1, 0] * F[2, 1] - F[1, 1] * F[2, 0]
                G[1, 0] = F[0, 2] * F[2, 1] - F[0, 1] * F[2, 2]
                G[1, 1] = F[0, 0] * F[2, 2] - F[0, 2] * F[2, 0]
                G[1, 2] = F[0, 1] * F[2, 0] - F[0, 0] * F[2, 1]
                G[2, 0] = F[0, 1] * F[1, 2] - F[0, 2] * F[1, 1]
                G[2, 1] = F[0, 2] * F[1, 0] - F[0, 0] * F[1, 2]
                G[2, 2] = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
                det = F[0, 0] * G[0, 0] + F[0, 1] * G[0, 1] + F[0, 2] * G[0, 2]
                t = 0.0
                for i in range(3):
                    for j in range(3):
                        t += F[i, j] * F[i, j]
                J[q] = det
                tr[q] = t
                floored = max(det, J_FLOOR)
                R[q] = floored ** (-2.0 / 3.0)
                if convex:  # least product of two stretches that the deformation can turn
                    least[q] = floored if dim == 2 else floored / np.sqrt(_greatest(F, t))
                I1[q] = R[q] * t
                for a in range(na):
                    for i in range(dim):
                        s, r = 0.0, 0.0
                        for j in range(dim):
                            s += G[i, j] * dN[e, q, a, j]
                            r += F[i, j] * dN[e, q, a, j]
                        b[dim * a + i] += w[e, q] * s
                        g[q, dim * a + i] = s / floored
                        nf[q, dim * a + i] = r
                V += w[e, q]
                mean += w[e, q] * det
                gamma_bar += w[e, q] * gamma[e, q]
            mean /= V
            gamma_bar /= V
            law(I1, constants, psi, dpsi, ddpsi)
            if j_bar:
                factor = gamma_bar * k_bulk / V
                for i in range(nd):
                    for j in range(i, nd):
                        K[i, j] = factor * b[i] * b[j]
            for q in range(na):
                wg = w[e, q] * gamma[e, q]
                c1 = wg * dpsi[q] * R[q]
                c2 = wg * ddpsi[q]
                if j_bar:
                    wpJ, wkJJ = w[e, q] * gamma_bar * k_bulk * (mean - 1.0) * J[q], 0.0
                else:
                    wpJ, wkJJ = wg * k_bulk * (J[q] - 1.0) * J[q], wg * k_bulk * max(J[q], J_FLOOR) ** 2
                if convex:
                    middle, reach = 2.0 / 3.0 * tr[q] * c1, 2.0 * c1 * least[q]
                    wpJ = min(max(wpJ, middle - reach), middle + reach)
                straight = 0.5 * (4.0 / 9.0 * tr[q] * c1 + wpJ + wkJJ)
                crossed = 2.0 / 3.0 * tr[q] * c1 - wpJ
                soft = w[e, q] * ERSATZ_STIFFNESS * mu if gamma[e, q] < SOFT_GAMMA else 0.0
                for i in range(nd):
                    A[i] = R[q] * (2.0 * nf[q, i] - 2.0 / 3.0 * tr[q] * g[q, i])
                    z[i] = straight * g[q, i] - 4.0 / 3.0 * c1 * nf[q, i]
                for a in range(na):
                    for bb in range(a, na):
                        s = 0.0
                        for j in range(dim):
                            s += dN[e, q, a, j] * dN[e, q, bb, j]
                        s *= 2.0 * c1 + soft
                        for i in range(dim):
                            ai = dim * a + i
                            for k in range(dim):
                                bk = dim * bb + k
                                K[ai, bk] += (c2 * A[ai] * A[bk] + z[ai] * g[q, bk] + g[q, ai] * z[bk]
                                              + crossed * g[q, dim * a + k] * g[q, dim * bb + i])
                            K[ai, dim * bb + i] += s
            for i in range(nd):
                for j in range(nd):
                    k = slot[e, i, j]
                    if k >= 0:
                        data[k] += K[i, j] if i <= j else K[j, i]

    return loop


_tangent_2d = _make(2)
_tangent_3d = _make(3)
