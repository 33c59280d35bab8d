"""The momentum balance of a thin sheet, in plane stress."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from skfem import Functional, LinearForm
from skfem.helpers import ddot, grad

from ...material import GeneralMaterial, Material
from ...material.sheet import SheetInvariants
from .kinematics import kinematics, once
from .momentum import MomentumForms, dilatation, ersatz, mass_form, tangents

__all__ = ["plane_stress_forms"]


class _Sheet(NamedTuple):
    """A thin sheet at the Gauss points, as W(v): t = F : F and j = det F of the plane, then q_f = |F A_f|^2 of fibres.

    j is not below `J_FLOOR`.

    Attributes
    ----------
    W: stored energy density.
    first: its derivatives W_b with v, (m, ne, nq).
    second: W_bc, with the stretch across the sheet following, (m, m, ne, nq).
    convex: the same with the volumetric energy linear in log J where it is concave.
    """

    W: np.ndarray
    first: np.ndarray
    second: np.ndarray
    convex: np.ndarray


def _psi(material: Material, invariants: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """psi, its gradient (m, ...) and second derivatives (m, m, ...) at the invariants (m, ...) of a sheet."""
    if isinstance(material, GeneralMaterial):
        return material.isochoric(invariants)
    m = len(invariants)
    d, dd = np.zeros_like(invariants), np.zeros((m, *invariants.shape))
    psi, d[0], dd[0, 0] = material.isochoric(invariants[0])
    return psi, d, dd


def _thin(material: Material, t: np.ndarray, j: np.ndarray, along: np.ndarray) -> _Sheet:
    """W is least over z = log J^(1/3), the stretch across the sheet: W_bc is that at fixed z less W_bz W_cz/W_zz."""
    k = material.bulk_modulus
    J = j * material.stretch_across(t, j, along)
    at = SheetInvariants(t, j, J, along)
    psi, d, dd = _psi(material, at.values)
    first = np.einsum("a...,ab...->b...", d, at.plane)
    fixed = (np.einsum("a...,abc...->bc...", d, at.second())
             + np.einsum("ad...,ab...,dc...->bc...", dd, at.plane, at.plane))
    mixed = (np.einsum("a...,ab...->b...", d, at.mixed())
             + np.einsum("ad...,ab...,d...->b...", dd, at.plane, at.across))
    curved = np.einsum("a...,a...", d, at.curved) + np.einsum("ad...,a...,d...", dd, at.across, at.across)

    def second(volumetric: np.ndarray) -> np.ndarray:
        """Second derivatives, for that of k/2 (J - 1)^2 with z."""
        return np.asarray(fixed - np.einsum("b...,c...->bc...", mixed, mixed) / (curved + volumetric))

    volumetric = 9 * k * J * (2 * J - 1)
    return _Sheet(psi + 0.5 * k * (J - 1) ** 2, first, second(volumetric), second(np.maximum(volumetric, 0.0)))


def plane_stress_forms(material: Material) -> MomentumForms:
    """Forms of the momentum balance of a thin sheet: F_33 at each point is such that P_33 = 0."""
    general = isinstance(material, GeneralMaterial)

    def fibres(w: Any) -> np.ndarray:
        """Directions in the plane, (families, 2, ne, nq)."""
        if not general:
            return np.zeros((0, 2, 1, 1))
        return np.moveaxis(np.asarray(w["fibres"])[..., :2], (-2, -1), (0, 1))

    def pulled(a: np.ndarray, w: Any) -> np.ndarray:
        """A gradient along the fibres, (families, 2, ne, nq)."""
        return np.asarray(np.einsum("iJ...,fJ...->fi...", a, fibres(w)))

    @once
    def sheet(w: Any) -> _Sheet:
        at = kinematics(w)
        n = pulled(at.F, w)
        return _thin(material, at.tr_C - 1.0, at.floored, (n * n).sum(axis=1))

    def slopes(a: np.ndarray, w: Any) -> np.ndarray:
        """Derivatives of v along a gradient, (m, ne, nq)."""
        at = kinematics(w)
        along = 2 * (pulled(at.F, w) * pulled(a, w)).sum(axis=1)
        return np.stack([2 * ddot(at.F, a), ddot(at.cofactor, a), *along])

    @Functional
    def energy(w: Any) -> np.ndarray:
        return sheet(w).W

    @LinearForm
    def residual(v: Any, w: Any) -> np.ndarray:
        return w["gamma"] * np.einsum("b...,b...", sheet(w).first, slopes(grad(v), w))

    @once
    def modulus(w: Any) -> np.ndarray:
        """Second derivative, iJkL, without its negative eigenvalues; of a law of several invariants."""
        unit = np.zeros((2, 2, 2, 2))
        for i in range(2):
            for J in range(2):
                unit[i, J, i, J] = 1.0
        shape = kinematics(w).J.shape
        basis = [np.broadcast_to(unit[i, J][..., None, None], (2, 2, *shape)) for i in range(2) for J in range(2)]
        A = np.array([[direct(a, b, sheet(w).first, w) + coupled(a, b, sheet(w).second, w) for b in basis]
                      for a in basis])
        values, vectors = np.linalg.eigh(np.moveaxis(A, (0, 1), (-2, -1)))
        positive = np.einsum("...ir,...r,...jr->ij...", vectors, np.maximum(values, 0.0), vectors)
        return np.asarray(positive.reshape(2, 2, 2, 2, *shape))

    def direct(a: np.ndarray, b: np.ndarray, first: np.ndarray, w: Any) -> np.ndarray:
        """W_b times the second derivatives of v along two gradients."""
        j_ab = a[0, 0] * b[1, 1] + a[1, 1] * b[0, 0] - a[0, 1] * b[1, 0] - a[1, 0] * b[0, 1]
        along = 2 * (pulled(a, w) * pulled(b, w)).sum(axis=1)
        return np.asarray(2 * first[0] * ddot(a, b) + first[1] * j_ab + np.einsum("f...,f...", first[2:], along))

    def coupled(a: np.ndarray, b: np.ndarray, second: np.ndarray, w: Any) -> np.ndarray:
        return np.asarray(np.einsum("bc...,b...,c...", second, slopes(a, w), slopes(b, w)))

    def second(du: Any, v: Any, w: Any, convex: bool) -> np.ndarray:
        W, a, b = sheet(w), grad(du), grad(v)
        if convex and general:
            found = np.einsum("iJ...,iJkL...,kL...->...", b, modulus(w), a)
        elif convex:  # beyond that bound of W_j the sheet buckles
            found = (direct(a, b, np.stack([W.first[0], np.maximum(W.first[1], -2 * W.first[0])]), w)
                     + coupled(a, b, W.convex, w))
        else:
            found = direct(a, b, W.first, w) + coupled(a, b, W.second, w)
        return np.asarray(w["gamma"] * found + ersatz(material, a, b, w))

    return MomentumForms(energy, residual, *tangents(second), mass_form(material), dilatation)
