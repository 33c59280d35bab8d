"""A pressure on the deformed surface, which turns and grows with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from skfem import BilinearForm, LinearForm
from skfem.helpers import dot

from .kinematics import kinematics, once, slope

__all__ = ["PressureForms", "pressure_forms"]


@dataclass(frozen=True)
class PressureForms:
    """Forms on a `FacetBasis`, whose normal `w.n` is N of the undeformed surface; n da = cof(F) N dA (Nanson).

    Fields at assembly: `displacement`, and `pressure` [MPa], a number or one for each facet and point; `radius` as in
    the momentum balance.

    Attributes
    ----------
    residual: p int v . cof(F) N dA, what the pressure adds to the internal force (it pushes against the normal).
    tangent: its derivative with the displacement. It is symmetric where the surface is closed, or where its rim is held
        or slides in the planes that close it.
    """

    residual: LinearForm
    tangent: BilinearForm


def pressure_forms() -> PressureForms:
    """Forms of a pressure that follows the surface."""
    @once
    def area(w: Any) -> np.ndarray:
        """cof(F) N."""
        plane = len(w.n)
        return np.einsum("ij...,j...->i...", kinematics(w).cofactor[:plane, :plane], w.n)

    @LinearForm
    def residual(v: Any, w: Any) -> np.ndarray:
        return w["pressure"] * dot(v, area(w))

    @BilinearForm
    def tangent(du: Any, v: Any, w: Any) -> np.ndarray:
        F_invT, H, plane = kinematics(w).F_invT, slope(du, w), len(w.n)
        divergence = np.einsum("ij...,ij...->...", F_invT, H)
        turned = np.einsum("ij...,kj...,k...->i...", F_invT[:plane, :plane], H[:plane, :plane], area(w))
        return w["pressure"] * (divergence * dot(v, area(w)) - dot(v, turned))

    return PressureForms(residual, tangent)
