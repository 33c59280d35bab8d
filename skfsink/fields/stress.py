"""The Cauchy stress of a body, as it is written for ParaView."""

from __future__ import annotations

import numpy as np

from ..fem.backend import Part, among
from ..material import GeneralMaterial
from ..material.crushed import J_FLOOR
from .momentum import Momentum

__all__ = ["cauchy_stress", "pressure", "principal_stresses", "von_mises"]

_CHUNK = 8192                                   # elements at a time
_VOIGT = ([0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2])    # components xx, yy, zz, xy, yz, xz, in the order of VTK


def cauchy_stress(momentum: Momentum, u: np.ndarray, elements: np.ndarray | None = None) -> np.ndarray:
    """Cauchy stress [MPa], element means (ne, 6) of the components xx, yy, zz, xy, yz, xz; of some `elements` (m, 6).

    sigma = P F^T / J with the P = gamma dW/dF (Eq. 11) that the force integrates: the volumetric part of the element
    "jbar" is gamma_bar k (J_bar - 1), one value an element. `u` is the displacement (n, dim); the relative density is
    the one `momentum` has, which is 0 at points that exert no force. It is NaN in elements that are crushed: where a
    point that exerts a force has J below 0.02 or is inside out, which no stress is defined for.
    """
    space, gamma = momentum.space, momentum.gamma
    if elements is not None:
        return _of_some(momentum, u, elements)
    means = np.zeros((space.n_elements, 6))
    for part in momentum.parts:
        for start in range(0, space.n_elements if part.elements is None else part.elements.size, _CHUNK):
            rows = slice(start, start + _CHUNK)
            some = part.numbers(rows)
            means[some] = np.einsum("eq,eqc->ec", space.w[some], _at_points(momentum, u, part, rows, gamma[some]))
    return np.asarray(means / space.V[:, None])


def _of_some(momentum: Momentum, u: np.ndarray, elements: np.ndarray) -> np.ndarray:
    """Stress of some elements (m,), in any order."""
    means, w = np.zeros((elements.size, 6)), momentum.space.w[elements]
    for part, here, own in among(momentum.parts, elements):
        means[here] = np.einsum("eq,eqc->ec", w[here],
                                _at_points(momentum, u, part, own, momentum.gamma[elements[here]]))
    return np.asarray(means / momentum.space.V[elements, None])


def _at_points(momentum: Momentum, u: np.ndarray, part: Part, rows: slice | np.ndarray,
               gamma: np.ndarray) -> np.ndarray:
    """Stress at the Gauss points of some elements of a part, whose density is `gamma`."""
    space, material, k = momentum.space, part.material, part.material.bulk_modulus
    elements = part.numbers(rows)
    F = np.zeros((*gamma.shape, 3, 3))
    F[...] = np.eye(3)
    F[..., :space.dim, :space.dim] += np.einsum("eai,eqaJ->eqiJ", u[space.conn[elements]], space.slopes(elements))
    space.add_hoop(F, u, elements)
    raw = _determinant(F)
    flat = raw < J_FLOOR
    F[flat] = np.eye(3)  # as good as any for points without stiffness; those with it are marked as unknown
    if momentum.plane_stress:
        F = material.thin_sheet(F[..., :2, :2], None if part.fibres is None else part.fibres[rows][:, None])
    J_bar = J = _determinant(F)
    gamma_bar = gamma
    if momentum.j_bar:
        w = space.w[elements]
        J_bar, gamma_bar = ((w * a).sum(axis=1, keepdims=True) / w.sum(axis=1, keepdims=True) for a in (raw, gamma))
    if isinstance(material, GeneralMaterial) and part.fibres is not None:
        tau = material.isochoric_stress(F, fibres=part.fibres[rows][:, None]) @ np.swapaxes(F, -1, -2)
        sigma = ((gamma / J)[..., None] * tau[..., _VOIGT[0], _VOIGT[1]]
                 + (gamma_bar * k * (J_bar - 1))[..., None] * np.array([1.0, 1, 1, 0, 0, 0]))
    else:
        b = F @ np.swapaxes(F, -1, -2)
        trace = np.trace(b, axis1=-2, axis2=-1)
        _, slope, _ = material.isochoric(J ** (-2 / 3) * trace)
        shear = gamma * slope * J ** (-5 / 3)
        mean = gamma_bar * k * (J_bar - 1) - 2 / 3 * shear * trace
        sigma = (2 * shear[..., None] * b[..., _VOIGT[0], _VOIGT[1]]
                 + mean[..., None] * np.array([1.0, 1, 1, 0, 0, 0]))
    sigma[flat & (gamma > 0)] = np.nan
    return np.asarray(sigma)


def _determinant(F: np.ndarray) -> np.ndarray:
    """Of matrices (..., 3, 3); several times as fast as by factorisation."""
    return np.asarray(F[..., 0, 0] * (F[..., 1, 1] * F[..., 2, 2] - F[..., 1, 2] * F[..., 2, 1])
                      - F[..., 0, 1] * (F[..., 1, 0] * F[..., 2, 2] - F[..., 1, 2] * F[..., 2, 0])
                      + F[..., 0, 2] * (F[..., 1, 0] * F[..., 2, 1] - F[..., 1, 1] * F[..., 2, 0]))


def pressure(stress: np.ndarray) -> np.ndarray:
    """-tr(sigma)/3 [MPa] of stresses (..., 6)."""
    return np.asarray(-stress[..., :3].mean(axis=-1))


def von_mises(stress: np.ndarray) -> np.ndarray:
    """sqrt(3/2 s:s) [MPa] of stresses (..., 6), s their deviator."""
    normal = stress[..., :3] + pressure(stress)[..., None]
    return np.asarray(np.sqrt(1.5 * (normal**2).sum(axis=-1) + 3.0 * (stress[..., 3:] ** 2).sum(axis=-1)))


def principal_stresses(stress: np.ndarray) -> np.ndarray:
    """Principal stresses (ne, 3) [MPa], ascending, of components as of :func:`cauchy_stress`; NaN where these are."""
    tensor = np.zeros((len(stress), 3, 3))
    tensor[:, _VOIGT[0], _VOIGT[1]] = tensor[:, _VOIGT[1], _VOIGT[0]] = stress
    known = np.isfinite(stress).all(axis=1)
    values = np.full((len(stress), 3), np.nan)
    values[known] = np.linalg.eigvalsh(tensor[known])
    return values
