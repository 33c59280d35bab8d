"""The weak forms as scikit-fem forms: the readable statement of the physics, on quads and hexes alike.

A run evaluates them with `--kernels forms` (:mod:`.assembled`); else it uses the compiled loops of
:mod:`skfsink.fem.kernels`, and tests hold the two equal to rounding. Each function here returns plain scikit-fem forms,
to be assembled on the bases of a :class:`~skfsink.fem.space.Space`:

    forms = momentum_forms(AAA())
    r = forms.residual.assemble(space.u_basis, displacement=u.ravel(), gamma=gamma_q, dV=space.u_basis.dx)

Fields passed at assembly (at Gauss points unless said otherwise): `displacement` the nodal vector of the displacement
(skfem interpolates it), `gamma` the relative density (ne, nq), zero in deleted elements, `dV` the quadrature
weights `basis.dx`, from which element means are made, and `fibres` (ne, nq, families, 3), directions of fibres. What is
the same for all test functions is found once an assembly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import Any, NamedTuple

import numpy as np
from skfem import BilinearForm, Functional, LinearForm
from skfem.helpers import ddot, dot, grad

from ..material import GeneralMaterial, Material
from ..material.general import cofactor
from .kernels import ERSATZ_STIFFNESS, SOFT_GAMMA
from .kernels.lanes import J_FLOOR

__all__ = ["DensityForms", "MomentumForms", "density_forms", "element_mean", "momentum_forms",
           "plane_stress_forms", "row_sums"]


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


@dataclass(frozen=True)
class DensityForms:
    """Mass balance.

    Attributes
    ----------
    residual: Eq. (20, 23), of the fields `density` and `history`.
    matrix: Eq. (21, 24), of the field `history`.
    flux, sink: its two terms; the field `sink` is 1/(H + eps).
    load: the constant int delta gamma.
    """

    residual: LinearForm
    matrix: BilinearForm
    flux: BilinearForm
    sink: BilinearForm
    load: LinearForm


@LinearForm
def row_sums(v: Any, w: Any) -> np.ndarray:
    """Row sums of a mass matrix, int weight v, with the field `weight` (ne, nq)."""
    return w["weight"] * v


def element_mean(values: Any, dV: Any) -> np.ndarray:
    """Projection of Gauss point values (..., ne, nq) on the element constants, at every Gauss point (Eq. 13)."""
    mean = np.sum(values * dV, axis=-1, keepdims=True) / np.sum(np.asarray(dV), axis=-1, keepdims=True)
    return np.broadcast_to(mean, np.broadcast(values, dV).shape)


def _once(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """A function of the fields of an assembly, evaluated once for all its test functions."""
    @wraps(function)
    def kept(w: Any) -> Any:
        if kept not in w:
            w[kept] = function(w)
        return w[kept]

    return kept


class _Kinematics(NamedTuple):
    """Deformation at the Gauss points; vectors and tensors come first in the shape.

    Attributes
    ----------
    F, F_invT: deformation gradient and F^-T with J not below `J_FLOOR`, (dim, dim, ne, nq).
    cofactor: J F^-T.
    full: F with F_33 = 1 in a plane, (ne, nq, 3, 3).
    J, J_safe: det F, and not below `J_FLOOR`.
    tr_C: F : F, in three dimensions.
    """

    F: np.ndarray
    F_invT: np.ndarray
    cofactor: np.ndarray
    full: np.ndarray
    J: np.ndarray
    J_safe: np.ndarray
    tr_C: np.ndarray


@_once
def _kinematics(w: Any) -> _Kinematics:
    H = np.moveaxis(w["displacement"].grad, (0, 1), (-2, -1))
    dim = H.shape[-1]
    F = np.broadcast_to(np.eye(3), (*H.shape[:-2], 3, 3)).copy()
    F[..., :dim, :dim] += H
    J = np.linalg.det(F)
    J_safe = np.maximum(J, J_FLOOR)
    plain = np.moveaxis(F[..., :dim, :dim], (-2, -1), (0, 1))
    cof = np.moveaxis(cofactor(F)[..., :dim, :dim], (-2, -1), (0, 1))
    return _Kinematics(plain, cof / J_safe, cof, F, J, J_safe, np.einsum("...iJ,...iJ", F, F))


class _Derivatives(NamedTuple):
    """The first derivatives of the volume ratio along two directions, and the second one: J' a, J' b, J'' a b."""

    a: np.ndarray
    b: np.ndarray
    both: np.ndarray


def _of_volume(a: np.ndarray, b: np.ndarray, w: Any) -> _Derivatives:
    """Derivatives of J over J, along the displacement gradients `a` and `b`: spatial divergences, and their product."""
    G = _kinematics(w).F_invT
    div_a, div_b = ddot(G, a), ddot(G, b)
    return _Derivatives(div_a, div_b, div_a * div_b - np.einsum("iL...,kJ...,kL...,iJ...->...", G, G, a, b))


def momentum_forms(material: Material, j_bar: bool = True) -> MomentumForms:
    """Forms of the momentum balance for `material`; `j_bar=False` gives the plain displacement element."""
    if isinstance(material, GeneralMaterial):
        return _general_forms(material, j_bar)
    k = material.bulk_modulus

    @_once
    def isochoric(w: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """psi and its two derivatives at I1'."""
        at = _kinematics(w)
        return material.isochoric(at.J_safe ** (-2 / 3) * at.tr_C)

    volumetric = _volumetric(k, j_bar)

    @Functional
    def energy(w: Any) -> np.ndarray:
        return isochoric(w)[0] + 0.5 * k * (volumetric(w).J - 1) ** 2

    @LinearForm
    def residual(v: Any, w: Any) -> np.ndarray:
        at, (_, dpsi, _) = _kinematics(w), isochoric(w)
        dI1 = at.J_safe ** (-2 / 3) * (2 * at.F - 2 / 3 * at.tr_C * at.F_invT)
        return ddot(w["gamma"] * dpsi * dI1 + volumetric(w).pressure * at.cofactor, grad(v))

    def second(du: Any, v: Any, w: Any, convex: bool) -> np.ndarray:
        at, (_, dpsi, ddpsi), gamma = _kinematics(w), isochoric(w), np.asarray(w["gamma"])
        scale = at.J_safe ** (-2 / 3)
        a, b = grad(du), grad(v)
        dI1 = scale * (2 * at.F - 2 / 3 * at.tr_C * at.F_invT)
        volume = _of_volume(a, b, w)
        cross = volume.a * volume.b - volume.both
        ddI1 = scale * (2 * ddot(a, b) - 4 / 3 * (ddot(at.F, a) * volume.b + ddot(at.F, b) * volume.a)
                        + 4 / 9 * at.tr_C * volume.a * volume.b + 2 / 3 * at.tr_C * cross)
        isochoric_part = gamma * (ddpsi * ddot(dI1, a) * ddot(dI1, b) + dpsi * ddI1)
        pressure = volumetric(w).pressure * at.J
        if convex:
            pressure = np.clip(pressure, *bounds(w))
        return isochoric_part + volumetric(w).coupling(a, b, w) + pressure * volume.both + _ersatz(material, a, b, w)

    @_once
    def bounds(w: Any) -> tuple[np.ndarray, np.ndarray]:
        """Least and greatest p J for which a Gauss point is stable."""
        at, (_, dpsi, _) = _kinematics(w), isochoric(w)
        c = np.asarray(w["gamma"]) * dpsi * at.J_safe ** (-2 / 3)
        least = at.J_safe  # product of two stretches that the deformation can turn
        if len(at.F) == 3:
            C = np.einsum("...iJ,...iL->...JL", at.full, at.full)
            least = at.J_safe / np.sqrt(np.linalg.eigvalsh(C)[..., -1])
        return 2 / 3 * at.tr_C * c - 2 * c * least, 2 / 3 * at.tr_C * c + 2 * c * least

    return MomentumForms(energy, residual, *_twice(second), _mass(material), _dilatation)


class _Volumetric(NamedTuple):
    """The volumetric part: J or its element mean, the pressure gamma k (J - 1), and the second derivative with J."""

    J: np.ndarray
    pressure: np.ndarray
    coupling: Callable[[np.ndarray, np.ndarray, Any], np.ndarray]


def _volumetric(k: float, j_bar: bool) -> Callable[[Any], _Volumetric]:
    """The volumetric part for the bulk modulus `k` [MPa], with element means (Eq. 12, 13) or values at the points."""
    @_once
    def part(w: Any) -> _Volumetric:
        at, gamma = _kinematics(w), np.asarray(w["gamma"])
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
        psi = material.isochoric_energy(_kinematics(w).full, J_FLOOR, np.asarray(w["fibres"]))
        return psi + 0.5 * k * (volumetric(w).J - 1) ** 2

    @_once
    def isochoric_stress(w: Any) -> np.ndarray:
        dim = len(_kinematics(w).F)
        P = material.isochoric_stress(_kinematics(w).full, J_FLOOR, np.asarray(w["fibres"]))
        return np.moveaxis(P[..., :dim, :dim], (-2, -1), (0, 1))

    @LinearForm
    def residual(v: Any, w: Any) -> np.ndarray:
        return ddot(w["gamma"] * isochoric_stress(w) + volumetric(w).pressure * _kinematics(w).cofactor, grad(v))

    @_once
    def modulus(w: Any) -> np.ndarray:
        """Second derivative at fixed pressure, iJkL."""
        at = _kinematics(w)
        dim, G = len(at.F), at.F_invT
        A = material.isochoric_modulus(at.full, J_FLOOR, np.asarray(w["fibres"]))
        A = np.moveaxis(A[..., :dim, :dim, :dim, :dim], (-4, -3, -2, -1), (0, 1, 2, 3))
        turned = np.einsum("iJ...,kL...->iJkL...", G, G) - np.einsum("iL...,kJ...->iJkL...", G, G)
        return w["gamma"] * A + volumetric(w).pressure * at.J * turned

    @_once
    def convex_modulus(w: Any) -> np.ndarray:
        """The modulus without its negative eigenvalues, and less the coupling that the point has by itself."""
        at, A = _kinematics(w), modulus(w)
        dim = len(at.F)
        own = np.zeros_like(A)
        if not j_bar:
            own = w["gamma"] * k * np.einsum("iJ...,kL...->iJkL...", at.cofactor, at.cofactor)
        values, vectors = np.linalg.eigh(np.moveaxis((A + own).reshape(dim**2, dim**2, *A.shape[4:]), (0, 1), (-2, -1)))
        positive = np.einsum("...ir,...r,...jr->ij...", vectors, np.maximum(values, 0.0), vectors)
        return positive.reshape(A.shape) - own

    def second(du: Any, v: Any, w: Any, convex: bool) -> np.ndarray:
        a, b = grad(du), grad(v)
        A = convex_modulus(w) if convex else modulus(w)
        return (np.einsum("iJ...,iJkL...,kL...->...", b, A, a) + volumetric(w).coupling(a, b, w)
                + _ersatz(material, a, b, w))

    return MomentumForms(energy, residual, *_twice(second), _mass(material), _dilatation)


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

    @_once
    def sheet(w: Any) -> _Sheet:
        at = _kinematics(w)
        return _thin(material, at.tr_C - 1.0, at.J_safe)

    @Functional
    def energy(w: Any) -> np.ndarray:
        return sheet(w).W

    @LinearForm
    def residual(v: Any, w: Any) -> np.ndarray:
        at, W = _kinematics(w), sheet(w)
        return w["gamma"] * ddot(2 * W.t * at.F + W.j * at.cofactor, grad(v))

    def second(du: Any, v: Any, w: Any, convex: bool) -> np.ndarray:
        at, W, a, b = _kinematics(w), sheet(w), grad(du), grad(v)
        tt, tj, jj = W.convex if convex else W.second
        W_j = np.maximum(W.j, -2 * W.t) if convex else W.j  # beyond that bound the sheet buckles
        t_a, t_b, j_a, j_b = 2 * ddot(at.F, a), 2 * ddot(at.F, b), ddot(at.cofactor, a), ddot(at.cofactor, b)
        j_ab = a[0, 0] * b[1, 1] + a[1, 1] * b[0, 0] - a[0, 1] * b[1, 0] - a[1, 0] * b[0, 1]
        return (w["gamma"] * (2 * W.t * ddot(a, b) + W_j * j_ab + tt * t_a * t_b + tj * (t_a * j_b + t_b * j_a)
                              + jj * j_a * j_b) + _ersatz(material, a, b, w))

    return MomentumForms(energy, residual, *_twice(second), _mass(material), _dilatation)


def _twice(second: Callable[[Any, Any, Any, bool], np.ndarray]) -> tuple[BilinearForm, BilinearForm]:
    """The tangent, and the convex one."""

    @BilinearForm
    def tangent(du: Any, v: Any, w: Any) -> np.ndarray:
        return second(du, v, w, False)

    @BilinearForm
    def convex(du: Any, v: Any, w: Any) -> np.ndarray:
        return second(du, v, w, True)

    return tangent, convex


def _ersatz(material: Material, a: np.ndarray, b: np.ndarray, w: Any) -> np.ndarray:
    """What a Gauss point that has lost its density keeps of the stiffness of an undeformed solid."""
    return np.where(w["gamma"] < SOFT_GAMMA, ERSATZ_STIFFNESS * material.shear_modulus, 0.0) * ddot(a, b)


def _mass(material: Material) -> BilinearForm:
    @BilinearForm
    def mass(a: Any, v: Any, w: Any) -> np.ndarray:
        return w["gamma"] * material.rho0 * dot(a, v)

    return mass


@LinearForm
def _dilatation(v: Any, w: Any) -> np.ndarray:
    return ddot(_kinematics(w).cofactor, grad(v))


def density_forms(length_scale: float, epsilon: float) -> DensityForms:
    """Forms of the mass balance  int l^2 Grad gamma . Grad dgamma + gamma dgamma/(H + eps) = int dgamma  (Eq. 20).

    `history` is H at the Gauss points (ne, nq); `density` the nodal vector of gamma.
    """

    @LinearForm
    def residual(v: Any, w: Any) -> np.ndarray:
        gamma = w["density"]
        return -(length_scale**2) * dot(gamma.grad, grad(v)) + (1 - gamma / (w["history"] + epsilon)) * v

    @BilinearForm
    def flux(g: Any, v: Any, w: Any) -> np.ndarray:
        return length_scale**2 * dot(grad(g), grad(v))

    @BilinearForm
    def sink(g: Any, v: Any, w: Any) -> np.ndarray:
        return w["sink"] * g * v

    @BilinearForm
    def matrix(g: Any, v: Any, w: Any) -> np.ndarray:
        return flux.form(g, v, w) + g * v / (w["history"] + epsilon)

    @LinearForm
    def load(v: Any, w: Any) -> np.ndarray:
        return 1.0 * v

    return DensityForms(residual, matrix, flux, sink, load)
