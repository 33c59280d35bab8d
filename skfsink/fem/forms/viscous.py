"""Viscosity: a Newtonian stress beside the elastic one, and the bulk viscosity of explicit codes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from skfem import BilinearForm, Functional, LinearForm
from skfem.helpers import ddot

from ...material import Material
from .kinematics import element_mean, kinematics, once, slope

__all__ = ["BulkViscosity", "ViscousForms", "viscous_forms"]


class BulkViscosity(NamedTuple):
    """Coefficients b1 and b2 of the bulk viscosity, pure numbers >= 0."""

    linear: float = 0.0
    quadratic: float = 0.0

    def slope(self, compression: Any) -> Any:
        """dq/dD over rho0 c_d L, in an element compressed by -L/c_d min(0, D) = `compression`."""
        return self.linear + 2.0 * self.quadratic**2 * compression


@dataclass(frozen=True)
class ViscousForms:
    """Viscosity of one material.

    Fields at assembly beside those of the momentum balance: `velocity`, as `displacement`, and for the tangent
    `compression`, a number.

    Attributes
    ----------
    force: force of the viscous stress.
    tangent: its derivative with the velocity, where elements count as compressed by `compression` at least.
    compression: -L/c_d min(0, D) of an element, at all its points.
    """

    force: LinearForm
    tangent: BilinearForm
    compression: Functional


class _Bulk(NamedTuple):
    """At the points: rho0 c_d L [MPa s], D [1/s] and the compression of their element."""

    scale: np.ndarray
    D: np.ndarray
    compression: np.ndarray


def viscous_forms(material: Material, bulk: BulkViscosity, sheet: bool = False) -> ViscousForms:
    """Forms of the viscosity of `material`; `sheet` is that of a thin, incompressible sheet."""
    eta, c_d = material.viscosity, material.dilatational_wave_speed * 1e3

    def rate(gradient: np.ndarray, w: Any) -> np.ndarray:
        """Rate of deformation of a velocity with this gradient: the symmetric part of grad v F^-1."""
        l = np.einsum("iJ...,kJ...->ik...", gradient, kinematics(w).F_invT)
        return 0.5 * (l + np.swapaxes(l, 0, 1))

    def stress(d: np.ndarray) -> np.ndarray:
        """2 eta dev d, or in a sheet without stress across it 2 eta (d + tr d 1)."""
        share = 1.0 if sheet else -1 / 3
        return 2 * eta * (d + share * np.einsum("ii...->...", d) * np.eye(len(d))[..., None, None])

    def weight(w: Any) -> np.ndarray:
        return np.asarray(w["gamma"]) * (1.0 if sheet else kinematics(w).J_e)

    @once
    def volume_rate(w: Any) -> _Bulk:
        dV = np.asarray(w["dV"])
        extent, dim = (dV / (2 * np.pi * w["radius"]), 2) if "radius" in w else (dV, len(kinematics(w).F))
        length = np.broadcast_to(extent.sum(axis=-1, keepdims=True), dV.shape) ** (1 / dim)
        D = element_mean(ddot(kinematics(w).cofactor, slope(w["velocity"], w)), dV)
        return _Bulk(material.rho0 * c_d * length, D, -length / c_d * np.minimum(D, 0.0))

    @once
    def newtonian(w: Any) -> np.ndarray:
        return weight(w) * stress(rate(slope(w["velocity"], w), w))

    @LinearForm
    def force(v: Any, w: Any) -> np.ndarray:
        at = volume_rate(w)
        q = at.scale * (bulk.linear + bulk.quadratic**2 * at.compression) * at.D
        return (ddot(newtonian(w), rate(slope(v, w), w))
                + element_mean(w["gamma"], w["dV"]) * q * ddot(kinematics(w).cofactor, slope(v, w)))

    @BilinearForm
    def tangent(dv: Any, v: Any, w: Any) -> np.ndarray:
        at, cofactor = volume_rate(w), kinematics(w).cofactor
        stiffening = at.scale * bulk.slope(np.maximum(at.compression, w["compression"]))
        one, other = (element_mean(ddot(cofactor, slope(field, w)), w["dV"]) for field in (dv, v))
        return (weight(w) * ddot(stress(rate(slope(dv, w), w)), rate(slope(v, w), w))
                + element_mean(w["gamma"], w["dV"]) * stiffening * one * other)

    @Functional
    def compression(w: Any) -> np.ndarray:
        return volume_rate(w).compression

    return ViscousForms(force, tangent, compression)
