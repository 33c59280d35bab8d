"""The momentum balance: the element of mean dilatation, the plain one, and any law of F."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from skfem import BilinearForm, Functional, LinearForm
from skfem.helpers import ddot, dot

from ...material import GeneralMaterial, Material
from ...material.crushed import J_FLOOR
from ..kernels import ERSATZ_STIFFNESS, SOFT_GAMMA
from .kinematics import element_mean, kinematics, once, slope, volume_derivatives

__all__ = ["MomentumForms", "dilatation", "ersatz", "mass_form", "momentum_forms", "tangents"]

#: components of F of a body of revolution that can be other than 0
IN_HALF_PLANE = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class MomentumForms:
    """Momentum balance for one material.

    Attributes
    ----------
    energy: stored energy density W of the undamaged material (Eq. 12, 31).
    residual: internal force (Eq. 14, 17).
    tangent: its derivative (Eq. 15, 18, 19).
    convex: the tangent, changed where a Gauss point is unstable so that it is not; Newton's method takes it there.
    mass: consistent mass (Eq. 28).
    dilatation: derivative of the volume, int cof F : Grad v; the highest frequency is looked for along it.
    """

    energy: Functional
    residual: LinearForm
    tangent: BilinearForm
    convex: BilinearForm
    mass: BilinearForm
    dilatation: LinearForm


def momentum_forms(material: Material, j_bar: bool = True) -> MomentumForms:
    """Forms of the momentum balance for `material`; `j_bar=False` gives the plain displacement element."""
    if isinstance(material, GeneralMaterial):
        return _general_forms(material, j_bar)
    k = material.bulk_modulus

    @once
    def isochoric(w: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """psi and its two derivatives at I1'."""
        at = kinematics(w)
        return material.isochoric(at.R * at.tr_C)

    volumetric = _volumetric(k, j_bar)

    @Functional
    def energy(w: Any) -> np.ndarray:
        return isochoric(w)[0] + 0.5 * k * (volumetric(w).J - 1) ** 2

    @LinearForm
    def residual(v: Any, w: Any) -> np.ndarray:
        at, (_, dpsi, _) = kinematics(w), isochoric(w)
        dI1 = at.R * (2 * at.F - 2 / 3 * at.tr_C * at.F_invT)
        return ddot(w["gamma"] * dpsi * dI1 + volumetric(w).pressure * at.cofactor, slope(v, w))

    def second(du: Any, v: Any, w: Any, convex: bool) -> np.ndarray:
        at, (_, dpsi, ddpsi), gamma = kinematics(w), isochoric(w), np.asarray(w["gamma"])
        scale = at.R
        a, b = slope(du, w), slope(v, w)
        dI1 = scale * (2 * at.F - 2 / 3 * at.tr_C * at.F_invT)
        volume = volume_derivatives(a, b, w)
        cross = volume.a * volume.b - volume.both
        ddI1 = scale * (2 * ddot(a, b) - 4 / 3 * (ddot(at.F, a) * volume.b + ddot(at.F, b) * volume.a)
                        + 4 / 9 * at.tr_C * volume.a * volume.b + 2 / 3 * at.tr_C * cross)
        isochoric_part = gamma * (ddpsi * ddot(dI1, a) * ddot(dI1, b) + dpsi * ddI1)
        pressure = volumetric(w).pressure * at.J
        if convex:
            pressure = np.clip(pressure, *bounds(w))
        return isochoric_part + volumetric(w).coupling(a, b, w) + pressure * volume.both + ersatz(material, a, b, w)

    @once
    def bounds(w: Any) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest p J for which a Gauss point is stable."""
        at, (_, dpsi, _) = kinematics(w), isochoric(w)
        c = np.asarray(w["gamma"]) * dpsi * at.R
        least = at.J_e  # product of two stretches that the deformation can turn
        if "radius" in w:
            least = at.J_e / np.maximum(at.F[2, 2], J_FLOOR)  # nothing turns what goes around
        elif len(at.F) == 3:
            C = np.einsum("...iJ,...iL->...JL", at.full, at.full)
            least = at.J_e / np.sqrt(np.linalg.eigvalsh(C)[..., -1])
        return 2 / 3 * at.tr_C * c - 2 * c * least, 2 / 3 * at.tr_C * c + 2 * c * least

    return MomentumForms(energy, residual, *tangents(second), mass_form(material), dilatation)


class _Volumetric(NamedTuple):
    """The volumetric part: J or its element mean, the pressure gamma k (J - 1), and the second derivative with J."""

    J: np.ndarray
    pressure: np.ndarray
    coupling: Callable[[np.ndarray, np.ndarray, Any], np.ndarray]


def _volumetric(k: float, j_bar: bool) -> Callable[[Any], _Volumetric]:
    """The volumetric part for the bulk modulus `k` [MPa], with element means (Eq. 12, 13) or values at the points."""
    @once
    def part(w: Any) -> _Volumetric:
        at, gamma = kinematics(w), np.asarray(w["gamma"])
        mean = (lambda values: element_mean(values, w["dV"])) if j_bar else np.asarray
        J, gamma = mean(at.J), mean(gamma)

        def coupling(a: np.ndarray, b: np.ndarray, w: Any) -> np.ndarray:
            return gamma * k * mean(ddot(at.cofactor, a)) * mean(ddot(at.cofactor, b))

        return _Volumetric(J, gamma * k * (J - 1), coupling)

    return part


def _general_forms(material: GeneralMaterial, j_bar: bool) -> MomentumForms:
    """Those of a stored energy of several invariants."""
    k = material.bulk_modulus
    volumetric = _volumetric(k, j_bar)

    @Functional
    def energy(w: Any) -> np.ndarray:
        psi = material.isochoric_energy(kinematics(w).full, J_FLOOR, np.asarray(w["fibres"]))
        return psi + 0.5 * k * (volumetric(w).J - 1) ** 2

    @once
    def isochoric_stress(w: Any) -> np.ndarray:
        dim = len(kinematics(w).F)
        P = material.isochoric_stress(kinematics(w).full, J_FLOOR, np.asarray(w["fibres"]))
        return np.moveaxis(P[..., :dim, :dim], (-2, -1), (0, 1))

    @LinearForm
    def residual(v: Any, w: Any) -> np.ndarray:
        return ddot(w["gamma"] * isochoric_stress(w) + volumetric(w).pressure * kinematics(w).cofactor, slope(v, w))

    @once
    def modulus(w: Any) -> np.ndarray:
        """Second derivative at fixed pressure, iJkL."""
        at = kinematics(w)
        dim, G = len(at.F), at.F_invT
        A = material.isochoric_modulus(at.full, J_FLOOR, np.asarray(w["fibres"]))
        A = np.moveaxis(A[..., :dim, :dim, :dim, :dim], (-4, -3, -2, -1), (0, 1, 2, 3))
        turned = np.einsum("iJ...,kL...->iJkL...", G, G) - np.einsum("iL...,kJ...->iJkL...", G, G)
        return w["gamma"] * A + volumetric(w).pressure * at.J * turned

    @once
    def convex_modulus(w: Any) -> np.ndarray:
        """The modulus without its negative eigenvalues, and less the coupling that the point has by itself."""
        at, A = kinematics(w), modulus(w)
        dim = len(at.F)
        if "radius" in w:  # the others are no deformation of a body of revolution
            A = A * IN_HALF_PLANE[:, :, None, None, None, None] * IN_HALF_PLANE[..., None, None]
        coupling = np.zeros_like(A)
        if not j_bar:
            coupling = w["gamma"] * k * np.einsum("iJ...,kL...->iJkL...", at.cofactor, at.cofactor)
        values, vectors = np.linalg.eigh(
            np.moveaxis((A + coupling).reshape(dim**2, dim**2, *A.shape[4:]), (0, 1), (-2, -1)))
        positive = np.einsum("...ir,...r,...jr->ij...", vectors, np.maximum(values, 0.0), vectors)
        return positive.reshape(A.shape) - coupling

    def second(du: Any, v: Any, w: Any, convex: bool) -> np.ndarray:
        a, b = slope(du, w), slope(v, w)
        A = convex_modulus(w) if convex else modulus(w)
        return (np.einsum("iJ...,iJkL...,kL...->...", b, A, a) + volumetric(w).coupling(a, b, w)
                + ersatz(material, a, b, w))

    return MomentumForms(energy, residual, *tangents(second), mass_form(material), dilatation)


def tangents(second: Callable[[Any, Any, Any, bool], np.ndarray]) -> tuple[BilinearForm, BilinearForm]:
    """The tangent, and the convex one."""

    @BilinearForm
    def tangent(du: Any, v: Any, w: Any) -> np.ndarray:
        return second(du, v, w, False)

    @BilinearForm
    def convex(du: Any, v: Any, w: Any) -> np.ndarray:
        return second(du, v, w, True)

    return tangent, convex


def ersatz(material: Material, a: np.ndarray, b: np.ndarray, w: Any) -> np.ndarray:
    """What a Gauss point that has lost its density keeps of the stiffness of an undeformed solid."""
    return np.where(w["gamma"] < SOFT_GAMMA, ERSATZ_STIFFNESS * material.shear_modulus, 0.0) * ddot(a, b)


def mass_form(material: Material) -> BilinearForm:
    @BilinearForm
    def mass(a: Any, v: Any, w: Any) -> np.ndarray:
        return w["gamma"] * material.rho0 * dot(a, v)

    return mass


@LinearForm
def dilatation(v: Any, w: Any) -> np.ndarray:
    return ddot(kinematics(w).cofactor, slope(v, w))
