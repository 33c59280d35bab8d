"""Energy-momentum (Eshelby) tensor and configurational forces of the element that the body is computed with.

At fixed nodal displacements the potential of Sec. 4 of `docs/theory.md` depends on the undeformed places X_a of the
nodes: with H = Grad u, and of weights, gradients, mean J and mean gamma of an element

    dw = w N_a,K dX_aK,   dF_iJ = -u_i,K N_a,J dX_aK,   d(J_bar V) = w (J delta_KJ - cof F_iJ u_i,K) N_a,J dX_aK,

    dPi/dX_aK = sum_q w S_KJ N_a,J,   S_KJ = [gamma W + p (J - J_bar)] delta_KJ - u_i,K P_iJ,

with p = gamma_bar k (J_bar - 1).

In a body of revolution dw has the part  w N_a/R dX_aR  besides, and  dF_33 = -(u_r/R) N_a/R dX_aR,  so that
dPi/dX_aR gets

    sum_q w S_33 N_a/R,   S_33 = gamma W + p (J - J_bar) - (u_r/R) P_33.

S is the energy-momentum tensor (Eshelby, J. Elasticity 5 (1975) 321-335), with the stress P of the element. The term of
J - J_bar comes with the element constant J_bar; it vanishes with the size of the elements, and there is none in the
elements "plain" and "planestress".
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..fem.backend import Part, among
from ..material import GeneralMaterial, Material
from ..material.crushed import J_FLOOR, crushed
from ..material.general import cofactor
from ..material.sheet import SheetInvariants
from .momentum import Momentum

__all__ = ["PointStress", "configurational_forces", "point_stress"]


class PointStress(NamedTuple):
    """Energy and stress at the Gauss points of some elements, weighted by gamma.

    Attributes
    ----------
    energy: gamma W [MPa], (m, nq).   excess: p (J - J_bar) [MPa], (m, nq).
    P: first Piola-Kirchhoff stress of the body's dimension [MPa], (m, nq, dim, dim).   H: Grad u, of the same shape.
    around: S_33 [MPa], (m, nq), and strain: u_r/R, of the same shape, of a body of revolution; 0 of others.
    """

    energy: np.ndarray
    excess: np.ndarray
    P: np.ndarray
    H: np.ndarray
    around: np.ndarray
    strain: np.ndarray

    @property
    def tensor(self) -> np.ndarray:
        """The energy-momentum tensor S_KJ [MPa], (m, nq, dim, dim)."""
        S = -np.swapaxes(self.H, -1, -2) @ self.P
        diagonal = np.arange(S.shape[-1])
        S[..., diagonal, diagonal] += (self.energy + self.excess)[..., None]
        return np.asarray(S)


def configurational_forces(momentum: Momentum, u: np.ndarray) -> np.ndarray:
    """Derivative of the stored energy with the undeformed places of the nodes, at fixed displacements of these.

    `u` is the displacement (n, dim) [mm]; the relative density is the one that `momentum` has, and goes with its Gauss
    points. The result is (n, dim) [N; N/mm in 2D]. In equilibrium it vanishes, but for the error of the mesh, at
    nodes inside of a homogeneous body; at the tip of a crack its sum over a domain is -G in the direction of the crack
    (:mod:`.release_rate`). Dead loads and contact have no part in it.
    """
    space = momentum.space
    elements, dN = np.arange(space.n_elements), space.dN
    stress = point_stress(momentum, u, elements, momentum.gamma, dN)
    local = np.einsum("eq,eqKJ,eqaJ->eaK", space.w, stress.tensor, dN)
    if space.axisymmetric:
        local[..., 0] += np.einsum("eq,eq,eqa->ea", space.w, stress.around, space.around)
    out = np.zeros_like(space.X)
    for i in range(space.dim):
        out[:, i] = np.bincount(space.conn.ravel(), local[..., i].ravel(), space.n_nodes)
    return out


def point_stress(momentum: Momentum, u: np.ndarray, elements: np.ndarray, gamma: np.ndarray,
                 dN: np.ndarray | None = None) -> PointStress:
    """Energy and stress of `elements` (m,) at the displacement `u` (n, dim), for the density `gamma` (m, nq).

    `dN` are their :meth:`.Space.slopes`, if they are at hand.
    """
    space, dim = momentum.space, momentum.space.dim
    H = np.swapaxes(u[space.conn[elements]], 1, 2)[:, None] @ (space.slopes(elements) if dN is None else dN)
    F = np.zeros((*gamma.shape, 3, 3))
    F[..., :dim, :dim] = H
    F[..., range(3), range(3)] += 1.0
    space.add_hoop(F, u, elements)
    W, excess, P = np.empty_like(gamma), np.empty_like(gamma), np.empty_like(F)
    for part, rows, own in among(momentum.parts, elements):
        if part.elements is None:
            W, P, excess = _of_part(momentum, part, own, F, gamma)
        else:
            W[rows], P[rows], excess[rows] = _of_part(momentum, part, own, F[rows], gamma[rows])
    energy, around, strain = gamma * W, np.zeros_like(gamma), np.zeros_like(gamma)
    if space.axisymmetric:
        strain = F[..., 2, 2] - 1.0
        around = energy + excess - strain * P[..., 2, 2]
    return PointStress(energy, excess, P[..., :dim, :dim], H, around, strain)


def _of_part(momentum: Momentum, part: Part, own: np.ndarray, F: np.ndarray,
             gamma: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """W of the undamaged material, P weighted by gamma, and p (J - J_bar), of elements by their numbers in one part."""
    material, w = part.material, momentum.space.w[part.numbers(own)]
    if momentum.plane_stress:
        return _of_sheet(material, F, gamma, None if part.fibres is None else part.fibres[own][:, None])
    cof = cofactor(F)
    J = np.einsum("...J,...J", F[..., 0, :], cof[..., 0, :])
    k, J_bar, gamma_bar = material.bulk_modulus, J, gamma
    if momentum.j_bar:
        J_bar, gamma_bar = ((w * a).sum(axis=1, keepdims=True) / w.sum(axis=1, keepdims=True) for a in (J, gamma))
    p = gamma_bar * k * (J_bar - 1)
    F = np.where((gamma > 0)[..., None, None], F, np.eye(3))  # a dead point may have any shape
    if isinstance(material, GeneralMaterial):
        fibres = None if part.fibres is None else part.fibres[own][:, None]
        psi = material.isochoric_energy(F, J_FLOOR, fibres)
        P, pressure = gamma[..., None, None] * material.isochoric_stress(F, J_FLOOR, fibres), p
    else:
        floored, s, J_e = crushed(np.where(gamma > 0, J, 1.0))
        R, tr_C = floored ** (-2 / 3) * s, np.einsum("...iJ,...iJ", F, F)
        psi, slope, _ = material.isochoric(R * tr_C)
        slope = 2 * gamma * slope * R
        P, pressure = slope[..., None, None] * F, p - slope * tr_C / (3 * J_e)
    P += pressure[..., None, None] * cof
    return psi + 0.5 * k * (J_bar - 1) ** 2, P, p * (J - J_bar)


def _of_sheet(material: Material, F: np.ndarray, gamma: np.ndarray,
              fibres: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same of a thin sheet without stress across it; J below the floor is read as that (Sec. 4.1)."""
    F = np.where((gamma > 0)[..., None, None], F, np.eye(3))
    plane = F[..., :2, :2]
    j = np.maximum(plane[..., 0, 0] * plane[..., 1, 1] - plane[..., 0, 1] * plane[..., 1, 0], J_FLOOR)
    t, along = np.einsum("...iJ,...iJ", plane, plane), material.along(plane, fibres)
    across = _across(material, t, j, along)
    J = j * across
    cof = cofactor(F)
    if isinstance(material, GeneralMaterial):
        at = SheetInvariants(t, j, J, along)
        psi, d, _ = material.isochoric(at.values)
        slope = gamma * np.einsum("a...,ab...->b...", d, at.plane)
        P = 2 * slope[0][..., None, None] * F + slope[1][..., None, None] * cof
        if fibres is not None:
            P += 2 * np.einsum("f...,...iJ,...fJ,...fK->...iK", slope[2:], F, fibres, fibres)
    else:
        psi, d, _ = material.isochoric(J ** (-2 / 3) * (t + across**2))
        P = (2 * gamma * d * J ** (-2 / 3))[..., None, None] * (F - (across**2 / j)[..., None, None] * cof)
    return psi + 0.5 * material.bulk_modulus * (J - 1) ** 2, P, np.zeros_like(gamma)


def _across(material: Material, t: np.ndarray, j: np.ndarray, along: np.ndarray) -> np.ndarray:
    """:meth:`.Material.stretch_across` by Newton's method for log J^(1/3) (Sec. 4.1), which is faster."""
    y, k = np.ones_like(j), material.bulk_modulus
    for _ in range(60):
        J = y**3
        if isinstance(material, GeneralMaterial):
            at = SheetInvariants(t, j, J, along)
            _, d, dd = material.isochoric(at.values)
            slope = np.einsum("a...,a...", d, at.across)
            isochoric = np.einsum("a...,a...", d, at.curved) + np.einsum("ab...,a...,b...", dd, at.across, at.across)
        else:
            p, s = t / y**2, (y * y / j) ** 2
            _, d, dd = material.isochoric(p + s)
            lean = 4 * s - 2 * p
            slope, isochoric = d * lean, dd * lean**2 + d * (16 * s + 4 * p)
        gradient = slope + 3 * k * J * (J - 1)
        stiff = np.maximum(isochoric + 3 * k * J * (6 * J - 3), 0.1 * (isochoric + 9 * k * J * J))
        step = np.clip(-gradient / stiff, -0.2, 0.2)
        y *= np.exp(step)
        if np.abs(step).max(initial=0.0) < 1e-9:
            return np.asarray(y**3 / j)
    return material.stretch_across(t, j, along)
