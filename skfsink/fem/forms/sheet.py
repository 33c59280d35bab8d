"""The momentum balance of a thin sheet, in plane stress."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from skfem import Functional, LinearForm
from skfem.helpers import ddot, grad

from ...material import Material
from .kinematics import kinematics, once
from .momentum import MomentumForms, dilatation, ersatz, mass_form, tangents

__all__ = ["plane_stress_forms"]


class _Sheet(NamedTuple):
    """A thin sheet at the Gauss points, as W(t, j) with t = F : F and j = det F of the plane, j not below `J_FLOOR`.

    Attributes
    ----------
    W: stored energy density.
    t, j: its derivatives W_t and W_j.
    second: W_tt, W_tj and W_jj, with the stretch across the sheet following.
    convex: the same with the volumetric energy linear in log J where it is concave.
    """

    W: np.ndarray
    t: np.ndarray
    j: np.ndarray
    second: tuple[np.ndarray, np.ndarray, np.ndarray]
    convex: tuple[np.ndarray, np.ndarray, np.ndarray]


def _thin(material: Material, t: np.ndarray, j: np.ndarray) -> _Sheet:
    """W is least over x = log lambda, the stretch across the sheet: its W_tt is that at fixed x less W_tx^2/W_xx."""
    k = material.bulk_modulus
    square = material.stretch_across(t, j) ** 2
    J = j * np.sqrt(square)
    R = J ** (-2 / 3)
    I = R * (t + square)
    psi, d, dd = material.isochoric(I)
    I_j, I_x = -2 / 3 * I / j, R * (4 / 3 * square - 2 / 3 * t)      # and I_t = R

    def second(volumetric: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Second derivatives, for that of k/2 (J - 1)^2 with log J."""
        W_tx, W_jx = dd * R * I_x - 2 / 3 * d * R, dd * I_j * I_x + (volumetric - 2 / 3 * d * I_x) / j
        W_xx = dd * I_x**2 + d * R * (4 / 9 * t + 16 / 9 * square) + volumetric
        return (dd * R**2 - W_tx**2 / W_xx, dd * R * I_j - 2 / 3 * d * R / j - W_tx * W_jx / W_xx,
                dd * I_j**2 + (10 / 9 * d * I + volumetric - k * J * (J - 1)) / j**2 - W_jx**2 / W_xx)

    volumetric = k * J * (2 * J - 1)
    return _Sheet(psi + 0.5 * k * (J - 1) ** 2, d * R, -2 * d * R * square / j, second(volumetric),
                  second(np.maximum(volumetric, 0.0)))


def plane_stress_forms(material: Material) -> MomentumForms:
    """Forms of the momentum balance of a thin sheet: F_33 at each point is such that P_33 = 0."""

    @once
    def sheet(w: Any) -> _Sheet:
        at = kinematics(w)
        return _thin(material, at.tr_C - 1.0, at.floored)

    @Functional
    def energy(w: Any) -> np.ndarray:
        return sheet(w).W

    @LinearForm
    def residual(v: Any, w: Any) -> np.ndarray:
        at, W = kinematics(w), sheet(w)
        return w["gamma"] * ddot(2 * W.t * at.F + W.j * at.cofactor, grad(v))

    def second(du: Any, v: Any, w: Any, convex: bool) -> np.ndarray:
        at, W, a, b = kinematics(w), sheet(w), grad(du), grad(v)
        tt, tj, jj = W.convex if convex else W.second
        W_j = np.maximum(W.j, -2 * W.t) if convex else W.j  # beyond that bound the sheet buckles
        t_a, t_b, j_a, j_b = 2 * ddot(at.F, a), 2 * ddot(at.F, b), ddot(at.cofactor, a), ddot(at.cofactor, b)
        j_ab = a[0, 0] * b[1, 1] + a[1, 1] * b[0, 0] - a[0, 1] * b[1, 0] - a[1, 0] * b[0, 1]
        return (w["gamma"] * (2 * W.t * ddot(a, b) + W_j * j_ab + tt * t_a * t_b + tj * (t_a * j_b + t_b * j_a)
                              + jj * j_a * j_b) + ersatz(material, a, b, w))

    return MomentumForms(energy, residual, *tangents(second), mass_form(material), dilatation)
