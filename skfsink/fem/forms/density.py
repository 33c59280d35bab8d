"""The mass balance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from skfem import BilinearForm, LinearForm
from skfem.helpers import dot, grad

__all__ = ["DensityForms", "density_forms", "row_sums"]


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
