"""A body that is loaded evenly is a material point: its greatest nominal stress beside that of the theory."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from ..fem.space import Space
from ..fields.momentum import Momentum
from ..material import GeneralMaterial
from ..material.homogeneous import PATHS, curve, extent
from ..scene.scene import Scene

__all__ = ["beside_theory", "mean_deformation", "mean_stress"]

NEAR = 0.02  # difference of a stretch from that of a homogeneous path that is still this path, relative


def mean_deformation(momentum: Momentum, u: np.ndarray) -> np.ndarray:
    """Mean deformation gradient of the body, (3, 3); across a plane body 1, or 1/J of its plane in plane stress."""
    space = momentum.space
    F: np.ndarray = np.einsum("eq,eqij->ij", space.w, space.deformation_gradient(u)) / space.w.sum()
    if momentum.plane_stress:
        F[2, 2] = 1.0 / np.linalg.det(F[:2, :2])
    return F


def mean_stress(space: Space, force: np.ndarray) -> np.ndarray:
    """Mean nominal stress of a body in equilibrium under the forces `force` (n, dim) at its nodes [MPa], (3, 3).

    Of a body of revolution it is that of an even stress, the same along r and around.
    """
    P = np.zeros((3, 3))
    if space.axisymmetric:
        r, z = (force * space.X).sum(axis=0) / space.w.sum()
        return np.diag([r / 2.0, z, r / 2.0])
    P[:space.dim, :space.dim] = force.T @ space.X / space.w.sum()
    return P


def beside_theory(scene: Scene, F: np.ndarray, P: np.ndarray) -> dict[str, Any] | None:
    """The greatest nominal stress of an evenly loaded body beside the peak of its homogeneous path (Eq. 7, 10).

    `F` and `P` (3, 3) are the mean deformation gradient and nominal stress [MPa] where the load was greatest. None
    where the deformation is no tension that the theory has a curve of, or the body has several materials, or fibres.
    """
    material = scene.material
    fibrous = isinstance(material, GeneralMaterial) and material.fibres(np.zeros((1, 3))).size
    if len(scene.parts) > 1 or fibrous:
        return None
    _, stretches, directions = np.linalg.svd(F)
    along = float(stretches[0])
    names = {"uniaxial tension": (along, along**-0.5, along**-0.5), "plane strain": (along, 1.0, 1.0 / along),
             "equibiaxial tension": (along, along, along**-2)}
    name = next((name for name, path in names.items() if np.allclose(stretches, path, rtol=NEAR)), None)
    pulled = np.linalg.norm(directions @ P.T, axis=1)  # on the planes across the principal directions
    if name is None or pulled[2] > NEAR * pulled[0]:  # pressed: the stretches are those of tension
        return None
    path, law = PATHS[name], scene.sink_law

    def weakness(stretch: float) -> float:
        return -float(curve(scene.material, law, path, [stretch]).stress[0]) / stretch

    at = np.linspace(1.0, extent(scene.material, law, path), 500)[1:]
    top = int(np.argmin([weakness(stretch) for stretch in at]))
    best = minimize_scalar(weakness, bounds=(at[max(top - 1, 0)], at[min(top + 1, len(at) - 1)]), method="bounded",
                           options={"xatol": 1e-10})
    strength, theory = float(pulled[0]), -float(best.fun)
    return {"path": name, "stretch_at_greatest_load": along, "stretch_theory": float(best.x),
            "nominal_strength_MPa": strength, "nominal_strength_theory_MPa": theory,
            "difference": strength / theory - 1.0}
