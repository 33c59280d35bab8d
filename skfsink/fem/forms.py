"""The weak forms as scikit-fem forms: the readable statement of the physics, on quads and hexes alike.

Runs use the compiled loops of :mod:`skfsink.fem.kernels`; a test holds the two equal to rounding. Each function here
returns plain `LinearForm`/`BilinearForm` objects, to be assembled on the bases of a :class:`~skfsink.fem.space.Space`:

    forms = momentum_forms(AAA())
    r = forms.residual.assemble(space.u_basis, x=u, gamma=gamma_q, dV=space.u_basis.dx)

Fields passed at assembly (at Gauss points unless said otherwise): `displacement` the nodal vector of the displacement
(skfem interpolates it), `gamma` the relative density (ne, nq), zero in deleted elements, `dV` the quadrature
weights `basis.dx`, from which element means are made.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from skfem import BilinearForm, LinearForm
from skfem.helpers import ddot, dot, grad

from ..material import GeneralMaterial, Material
from ..material.general import cofactor
from .kernels import ERSATZ_STIFFNESS, SOFT_GAMMA
from .kernels.lanes import J_FLOOR

__all__ = ["DensityForms", "MomentumForms", "density_forms", "element_mean", "momentum_forms",
           "plane_stress_forms"]


@dataclass(frozen=True)
class MomentumForms:
    """Momentum balance: `residual` (Eq. 14, 17), `tangent` (Eq. 15, 18, 19), `mass` (Eq. 28)."""

    residual: LinearForm
    tangent: BilinearForm
    mass: BilinearForm


@dataclass(frozen=True)
class DensityForms:
    """Mass balance: `residual` (Eq. 20, 23), `matrix` (Eq. 21, 24) and the constant `load` int delta gamma."""

    residual: LinearForm
    matrix: BilinearForm
    load: LinearForm


def element_mean(values: Any, dV: Any) -> np.ndarray:
    """Projection of Gauss point values (..., ne, nq) on the element constants, at every Gauss point (Eq. 13)."""
    mean = np.sum(values * dV, axis=-1, keepdims=True) / np.sum(np.asarray(dV), axis=-1, keepdims=True)
    return np.broadcast_to(mean, np.broadcast(values, dV).shape)


def momentum_forms(material: Material, j_bar: bool = True) -> MomentumForms:
    """Forms of the momentum balance for `material`; `j_bar=False` gives the plain displacement element."""
    if isinstance(material, GeneralMaterial):
        return _general_forms(material, j_bar)
    k = material.bulk_modulus

    def kinematics(w: Any) -> tuple[np.ndarray, ...]:
        H = w["displacement"].grad
        dim = H.shape[0]
        F = np.zeros((3, 3, *H.shape[2:]))
        for i in range(3):
            F[i, i] = 1.0
        F[:dim, :dim] += H
        J = np.linalg.det(np.moveaxis(F, (0, 1), (-2, -1)))
        J_safe = np.maximum(J, J_FLOOR)
        cof = np.stack([np.stack([F[(i + 1) % 3, (j + 1) % 3] * F[(i + 2) % 3, (j + 2) % 3]
                                  - F[(i + 1) % 3, (j + 2) % 3] * F[(i + 2) % 3, (j + 1) % 3]
                                  for j in range(3)]) for i in range(3)])
        tr_C = ddot(F, F)
        return F[:dim, :dim], J, J_safe, cof[:dim, :dim] / J_safe, tr_C

    def volumetric(J: np.ndarray, w: Any) -> tuple[np.ndarray, np.ndarray]:
        """J_bar and gamma_bar: element means, or the point values of the plain element."""
        gamma = np.asarray(w["gamma"])
        if not j_bar:
            return J, gamma
        dV = np.asarray(w["dV"])
        return element_mean(J, dV), element_mean(gamma, dV)

    @LinearForm
    def residual(v: Any, w: Any) -> np.ndarray:
        F, J, J_safe, F_invT, tr_C = kinematics(w)
        J_bar, gamma_bar = volumetric(J, w)
        _, dpsi, _ = material.isochoric(J_safe ** (-2 / 3) * tr_C)
        dI1 = J_safe ** (-2 / 3) * (2 * F - 2 / 3 * tr_C * F_invT)
        P = w["gamma"] * dpsi * dI1 + gamma_bar * k * (J_bar - 1) * J_safe * F_invT
        return ddot(P, grad(v))

    @BilinearForm
    def tangent(du: Any, v: Any, w: Any) -> np.ndarray:
        F, J, J_safe, F_invT, tr_C = kinematics(w)
        J_bar, gamma_bar = volumetric(J, w)
        gamma = np.asarray(w["gamma"])
        scale = J_safe ** (-2 / 3)
        _, dpsi, ddpsi = material.isochoric(scale * tr_C)
        a, b = grad(du), grad(v)
        dI1 = scale * (2 * F - 2 / 3 * tr_C * F_invT)
        div_a, div_b = ddot(F_invT, a), ddot(F_invT, b)      # spatial divergences
        cross = np.einsum("iL...,kJ...,kL...,iJ...->...", F_invT, F_invT, a, b)
        ddI1 = scale * (2 * ddot(a, b) - 4 / 3 * (ddot(F, a) * div_b + ddot(F, b) * div_a)
                        + 4 / 9 * tr_C * div_a * div_b + 2 / 3 * tr_C * cross)
        isochoric = gamma * (ddpsi * ddot(dI1, a) * ddot(dI1, b) + dpsi * ddI1)
        dJ_a, dJ_b = J_safe * div_a, J_safe * div_b
        if j_bar:
            dV = np.asarray(w["dV"])
            coupling = gamma_bar * k * element_mean(dJ_a, dV) * element_mean(dJ_b, dV)
        else:
            coupling = gamma_bar * k * dJ_a * dJ_b
        geometric = gamma_bar * k * (J_bar - 1) * J * (div_a * div_b - cross)
        ersatz = np.where(gamma < SOFT_GAMMA, ERSATZ_STIFFNESS * material.shear_modulus, 0.0) * ddot(a, b)
        return isochoric + coupling + geometric + ersatz

    @BilinearForm
    def mass(a: Any, v: Any, w: Any) -> np.ndarray:
        return w["gamma"] * material.rho0 * dot(a, v)

    return MomentumForms(residual, tangent, mass)


def _general_forms(material: GeneralMaterial, j_bar: bool) -> MomentumForms:
    """Those of a stored energy of several invariants; the field `fibres` (ne, nq, families, 3) holds the directions."""
    k = material.bulk_modulus

    def kinematics(w: Any) -> tuple[Any, ...]:
        H = np.moveaxis(w["displacement"].grad, (0, 1), (-2, -1))
        dim = H.shape[-1]
        F = np.broadcast_to(np.eye(3), (*H.shape[:-2], 3, 3)).copy()
        F[..., :dim, :dim] += H
        J, gamma = np.linalg.det(F), np.asarray(w["gamma"])
        cof = np.moveaxis(cofactor(F)[..., :dim, :dim], (-2, -1), (0, 1))
        means = (element_mean(v, w["dV"]) for v in (J, gamma)) if j_bar else (J, gamma)
        return F, J, cof, gamma, *means

    @LinearForm
    def residual(v: Any, w: Any) -> np.ndarray:
        F, _, cof, gamma, J_bar, gamma_bar = kinematics(w)
        P = np.moveaxis(material.isochoric_stress(F, J_FLOOR, w["fibres"]), (-2, -1), (0, 1))
        return ddot(gamma * P[:len(cof), :len(cof)] + gamma_bar * k * (J_bar - 1) * cof, grad(v))

    @BilinearForm
    def tangent(du: Any, v: Any, w: Any) -> np.ndarray:
        F, J, cof, gamma, J_bar, gamma_bar = kinematics(w)
        dim, a, b = len(cof), grad(du), grad(v)
        A = np.moveaxis(material.isochoric_modulus(F, J_FLOOR, w["fibres"]), (-4, -3, -2, -1), (0, 1, 2, 3))
        isochoric = np.einsum("iJ...,iJkL...,kL...->...", b, A[:dim, :dim, :dim, :dim], a)
        dJ_a, dJ_b = ddot(cof, a), ddot(cof, b)
        G = cof / np.maximum(J, J_FLOOR)
        cross = np.einsum("iL...,kJ...,kL...,iJ...->...", G, G, a, b)
        geometric = gamma_bar * k * (J_bar - 1) * J * (ddot(G, a) * ddot(G, b) - cross)
        if j_bar:
            dJ_a, dJ_b = element_mean(dJ_a, w["dV"]), element_mean(dJ_b, w["dV"])
        ersatz = np.where(gamma < SOFT_GAMMA, ERSATZ_STIFFNESS * material.shear_modulus, 0.0) * ddot(a, b)
        return gamma * isochoric + gamma_bar * k * dJ_a * dJ_b + geometric + ersatz

    @BilinearForm
    def mass(a: Any, v: Any, w: Any) -> np.ndarray:
        return w["gamma"] * material.rho0 * dot(a, v)

    return MomentumForms(residual, tangent, mass)


def plane_stress_forms(material: Material) -> MomentumForms:
    """Forms of the momentum balance of a thin sheet: F_33 at each point is such that P_33 = 0."""

    def sheet(w: Any) -> np.ndarray:
        H = np.moveaxis(w["displacement"].grad, (0, 1), (-2, -1))
        return material.thin_sheet(H + np.eye(2))

    @LinearForm
    def residual(v: Any, w: Any) -> np.ndarray:
        P = np.moveaxis(material.first_piola(sheet(w))[..., :2, :2], (-2, -1), (0, 1))
        return w["gamma"] * ddot(P, grad(v))

    @BilinearForm
    def tangent(du: Any, v: Any, w: Any) -> np.ndarray:
        A = np.moveaxis(material.modulus(sheet(w)), (-4, -3, -2, -1), (0, 1, 2, 3))
        A = A[:2, :2, :2, :2] - np.einsum("iJ...,kL...->iJkL...", A[:2, :2, 2, 2], A[2, 2, :2, :2]) / A[2, 2, 2, 2]
        a, b = grad(du), grad(v)
        ersatz = np.where(w["gamma"] < SOFT_GAMMA, ERSATZ_STIFFNESS * material.shear_modulus, 0.0) * ddot(a, b)
        return w["gamma"] * np.einsum("iJ...,iJkL...,kL...->...", b, A, a) + ersatz

    return MomentumForms(residual, tangent, momentum_forms(material).mass)


def density_forms(length_scale: float, epsilon: float) -> DensityForms:
    """Forms of the mass balance  int l^2 Grad gamma . Grad dgamma + gamma dgamma/(H + eps) = int dgamma  (Eq. 20).

    `history` is H at the Gauss points (ne, nq); `density` the nodal vector of gamma.
    """

    @LinearForm
    def residual(v: Any, w: Any) -> np.ndarray:
        gamma = w["density"]
        return -(length_scale**2) * dot(gamma.grad, grad(v)) + (1 - gamma / (w["history"] + epsilon)) * v

    @BilinearForm
    def matrix(g: Any, v: Any, w: Any) -> np.ndarray:
        return length_scale**2 * dot(grad(g), grad(v)) + g * v / (w["history"] + epsilon)

    @LinearForm
    def load(v: Any, w: Any) -> np.ndarray:
        return 1.0 * v

    return DensityForms(residual, matrix, load)
