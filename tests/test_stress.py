"""The stress for ParaView is the one whose forces the element loops integrate."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import box, wavy

from skfsink.fem.space import Space
from skfsink.fields import stress
from skfsink.fields.momentum import Momentum
from skfsink.material import AAA


@pytest.mark.parametrize("element", ["jbar", "plain", "planestress", "axisymmetric"])
def test_stress_at_the_points_gives_the_nodal_forces(space: Space, kind: str, element: str) -> None:
    """sum w J sigma F^-T Grad N is the force of the loops; fails if the two read gamma, J_bar or a dead point
    differently."""
    if kind == "hex" and element in ("planestress", "axisymmetric"):
        pytest.skip("for quadrilaterals only")
    space = space.revolved() if element == "axisymmetric" else space
    momentum, u = Momentum(space, AAA(), element), wavy(space, 0.15)
    nodal = np.random.default_rng(3).uniform(0.05, 1, space.n_nodes)
    nodal[: space.n_nodes // 3] = 1e-9  # some points, and all points of some elements, exert no force
    deleted = np.arange(space.n_elements) % 7 == 0
    momentum.set_gamma(nodal, deleted)
    assert (momentum.gamma == 0).any() and (momentum.gamma > 0).any()
    s = stress._at_points(momentum, u, momentum.parts[0], slice(None), momentum.gamma)
    F = space.deformation_gradient(u)
    if momentum.plane_stress:
        F = momentum.material.thin_sheet(F[..., :2, :2])
    P = np.linalg.det(F)[..., None, None] * s[..., [[0, 3, 5], [3, 1, 4], [5, 4, 2]]] @ np.swapaxes(
        np.linalg.inv(F), -1, -2)
    d = space.dim
    force = np.zeros_like(space.X)
    np.add.at(force, space.conn, np.einsum("eq,eqiJ,eqaJ->eai", space.w, P[..., :d, :d], space.dN))
    if space.axisymmetric:
        np.add.at(force[:, 0], space.conn, np.einsum("eq,eq,eqa->ea", space.w, P[..., 2, 2], space.around))
    expected = momentum.force(u)
    np.testing.assert_allclose(force, expected, atol=1e-10 * np.abs(expected).max())
    if momentum.plane_stress:
        assert np.abs(s[..., 2]).max() < 1e-9 * np.abs(s).max()


@pytest.mark.parametrize("element", ["jbar", "plain", "planestress", "axisymmetric"])
def test_the_stress_of_crushed_elements_is_unknown(kind: str, element: str) -> None:
    """Fails if a crushed point that bears a force is given a stress, as of F = I, or a dead one makes it unknown."""
    if kind == "hex" and element in ("planestress", "axisymmetric"):
        pytest.skip("for quadrilaterals only")
    space = box(kind, 3)
    space = space.revolved() if element == "axisymmetric" else space
    momentum, x = Momentum(space, AAA(), element), space.X.copy()
    gamma = np.ones(space.n_nodes)
    gamma[space.conn[0]] = 0.0
    low, high = space.conn[0], space.conn[-1]
    for conn in (low, high):  # folded through its middle
        x[conn] = x[conn].mean(axis=0) - [0.5, *[-1.0] * (space.dim - 1)] * (x[conn] - x[conn].mean(axis=0))
    momentum.set_gamma(gamma, np.zeros(space.n_elements, bool))
    found = stress.cauchy_stress(momentum, x - space.X)
    assert np.isnan(found[-1]).all() and not found[0].any()
    intact = ~np.isin(space.conn, [*low, *high]).any(axis=1)
    assert np.isfinite(found[intact]).all()
    assert np.isnan(stress.pressure(found)[-1]) and np.isnan(stress.von_mises(found)[-1])


def test_means_chunks_and_invariants(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if the chunks are put together wrongly, or a homogeneous stress is not that of the material."""
    space = box(kind, 3)
    momentum = Momentum(space, AAA())
    G = np.array([[0.1, 0.2, 0], [0.05, -0.08, 0.1], [0, 0.1, 0.02]])[:space.dim, :space.dim]
    monkeypatch.setattr(stress, "_CHUNK", 2)
    found = stress.cauchy_stress(momentum, space.X @ G.T)
    F = np.eye(3)
    F[:space.dim, :space.dim] += G
    sigma = momentum.material.first_piola(F) @ F.T / np.linalg.det(F)
    np.testing.assert_allclose(found, np.broadcast_to(sigma[[0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]], found.shape),
                               rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(stress.pressure(found), -np.trace(sigma) / 3)
    deviator = sigma - np.trace(sigma) / 3 * np.eye(3)
    np.testing.assert_allclose(stress.von_mises(found), np.sqrt(1.5 * np.sum(deviator**2)))
    assert stress.von_mises(np.array([0, 0, 0, 2.0, 0, 0])) == pytest.approx(2 * np.sqrt(3))  # of pure shear
