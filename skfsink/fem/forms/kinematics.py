"""Deformation at the Gauss points of an assembly, found once for all its test functions."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, NamedTuple

import numpy as np
from skfem.helpers import ddot, grad

from ...material.crushed import crushed
from ...material.general import cofactor

__all__ = ["Derivatives", "Kinematics", "element_mean", "kinematics", "once", "slope", "volume_derivatives"]


def element_mean(values: Any, dV: Any) -> np.ndarray:
    """Projection of Gauss point values (..., ne, nq) on the element constants, at every Gauss point (Eq. 13)."""
    mean = np.sum(values * dV, axis=-1, keepdims=True) / np.sum(np.asarray(dV), axis=-1, keepdims=True)
    return np.broadcast_to(mean, np.broadcast(values, dV).shape)


def once(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """A function of the fields of an assembly, evaluated once for all its test functions."""
    @wraps(function)
    def kept(w: Any) -> Any:
        if kept not in w:
            w[kept] = function(w)
        return w[kept]

    return kept


def slope(field: Any, w: Any) -> np.ndarray:
    """Gradient of a displacement, (dim, dim, ne, nq); with the field `radius`, R, that of a body of revolution.

    It is (3, 3, ne, nq) then, with u_r/R around the axis.
    """
    in_plane: np.ndarray = grad(field)
    if "radius" not in w:
        return in_plane
    H = np.zeros((3, 3, *in_plane.shape[2:]))
    H[:2, :2] = in_plane
    H[2, 2] = np.asarray(field)[0] / w["radius"]
    return H


class Kinematics(NamedTuple):
    """Deformation at the Gauss points; vectors and tensors come first in the shape.

    A body of revolution counts as one of dim = 3, with axes r, z (x, y of the mesh) and around.

    Attributes
    ----------
    F, F_invT: deformation gradient and F^-T, with J_e of a crushed point, (dim, dim, ne, nq).
    cofactor: J F^-T.
    full: F with F_33 = 1 in a plane, (ne, nq, 3, 3).
    J, J_e, floored: det F; that of a crushed point, see :mod:`.crushed`, and not below its floor.
    R: J^(-2/3), continued where a point is crushed.
    tr_C: F : F, in three dimensions.
    """

    F: np.ndarray
    F_invT: np.ndarray
    cofactor: np.ndarray
    full: np.ndarray
    J: np.ndarray
    J_e: np.ndarray
    floored: np.ndarray
    R: np.ndarray
    tr_C: np.ndarray


@once
def kinematics(w: Any) -> Kinematics:
    H = np.moveaxis(slope(w["displacement"], w), (0, 1), (-2, -1))
    dim = H.shape[-1]
    F = np.broadcast_to(np.eye(3), (*H.shape[:-2], 3, 3)).copy()
    F[..., :dim, :dim] += H
    J = np.linalg.det(F)
    floored, s, J_e = crushed(J)
    plain = np.moveaxis(F[..., :dim, :dim], (-2, -1), (0, 1))
    cof = np.moveaxis(cofactor(F)[..., :dim, :dim], (-2, -1), (0, 1))
    return Kinematics(plain, cof / J_e, cof, F, J, J_e, floored, floored ** (-2 / 3) * s,
                      np.einsum("...iJ,...iJ", F, F))


class Derivatives(NamedTuple):
    """The first derivatives of the volume ratio along two directions, and the second one: J' a, J' b, J'' a b."""

    a: np.ndarray
    b: np.ndarray
    both: np.ndarray


def volume_derivatives(a: np.ndarray, b: np.ndarray, w: Any) -> Derivatives:
    """Derivatives of J over J, along the displacement gradients `a` and `b`: spatial divergences, and their product."""
    G = kinematics(w).F_invT
    div_a, div_b = ddot(G, a), ddot(G, b)
    return Derivatives(div_a, div_b, div_a * div_b - np.einsum("iL...,kJ...,kL...,iJ...->...", G, G, a, b))
