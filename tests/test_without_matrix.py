"""The tangent of large bodies as differences of forces: the limit of the explicit step without a matrix."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import Fracture, boundary, box, close, wavy

from skfsink.fem.pattern import Pattern
from skfsink.fem.space import Space
from skfsink.fields.momentum import Momentum
from skfsink.loads.follower import FollowerLoads
from skfsink.loads.pressure import Pressure
from skfsink.loads.sliding import SlidingPlanes
from skfsink.material import AAA, GeneralMaterial, HolzapfelGasserOgden, Material, MooneyRivlin, SinkLaw
from skfsink.material.regions import Region
from skfsink.methods.controls import ExplicitControls
from skfsink.methods.explicit import Explicit
from skfsink.methods.frequency import highest_frequency
from skfsink.methods.step_length import StepLength


def damaged(space: Space, material: Material | GeneralMaterial, element: str = "jbar", **more: object) -> Momentum:
    """A body with failed elements and a density between 0 and 1."""
    momentum = Momentum(space, material, element, **more)  # type: ignore[arg-type]
    gamma = 0.5 + 0.5 * np.sin(3 * space.X.sum(axis=1)) ** 2
    gamma[space.conn[1]] = 1e-9
    momentum.set_gamma(gamma, np.arange(space.n_elements) == 2)
    return momentum


def by_matrix(momentum: Momentum, u: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Tangent times a displacement, from its matrix."""
    pattern = Pattern(momentum.space, momentum.space.dim)
    return (pattern.matrix(momentum.tangent(pattern, u)) @ d.ravel()).reshape(d.shape)


MADE = [("quad", AAA(), "jbar"), ("hex", AAA(), "jbar"), ("hex", AAA(), "plain"), ("quad", AAA(), "planestress"),
        ("hex", HolzapfelGasserOgden(), "jbar"), ("quad", MooneyRivlin(), "jbar"),
        ("quad", MooneyRivlin(), "planestress")]


@pytest.mark.parametrize(("kind", "material", "element"), MADE)
@pytest.mark.parametrize("kernels", ["compiled", "forms"])
def test_product_is_that_of_the_matrix(kind: str, material: Material, element: str, kernels: str) -> None:
    """Fails if a displacement is scaled wrongly, a loop is left out, or what the last force has left is touched."""
    space = box(kind, 3)
    momentum = damaged(space, material, element, kernels=kernels)
    u, d = wavy(space, 0.05), wavy(space, 7.0, seed=5)
    force = momentum.force(u)
    before = momentum.W.copy(), momentum.backend.energy, momentum.backend.mean_force()
    sheet = 2e-6 if element == "planestress" else 2e-8  # whose matrix has a millionth of mu more
    close(momentum.along(u)(d), by_matrix(momentum, u, d), sheet)
    np.testing.assert_array_equal(momentum.W, before[0])
    assert (momentum.backend.energy, momentum.backend.mean_force()) == before[1:]
    np.testing.assert_array_equal(momentum.force(u), force)
    assert not momentum.along(u)(np.zeros_like(d)).any()


def test_product_of_a_body_of_two_materials() -> None:
    """Fails if the loop of one material writes where those of the other are."""
    space = box("hex", 3)
    own = np.arange(1, space.n_elements, 2)
    momentum = damaged(space, AAA(), regions=[Region("inner", own, MooneyRivlin(), SinkLaw())])
    u, d = wavy(space, 0.05), wavy(space, 1.0, seed=5)
    close(momentum.along(u)(d), by_matrix(momentum, u, d), 2e-8)


def test_product_with_pressures_and_oblique_planes(kind: str) -> None:
    """Fails if the stiffness of pressures is left out, or a plane is: both are in the matrix."""
    space = box(kind, 3)
    pressed = FollowerLoads(space, [(np.flatnonzero(boundary(space)), Pressure("all", 4.0))])
    pressed.at(1.0)
    momentum = damaged(space, AAA(), followers=pressed)
    u, d = wavy(space, 0.05), wavy(space, 1.0, seed=5)
    close(momentum.along(u)(d), by_matrix(momentum, u, d), 2e-8)
    unpressed = damaged(space, AAA()).along(u)(d)
    assert np.abs(momentum.along(u)(d) - unpressed).max() > 1e-4 * np.abs(unpressed).max()
    free = np.ones(space.X.shape, bool)
    normal = np.array([0.6, 0.8, 0.0][:space.dim])
    momentum.sliding = SlidingPlanes(space, [(np.flatnonzero(space.X[:, 0] < 1e-9), normal, "left")], free, ~free)
    along = momentum.unheld(d)
    close(momentum.along(u)(d), momentum.unheld(by_matrix(momentum, u, along)), 2e-8)


@pytest.mark.parametrize("kind", ["quad", "hex"])
def test_highest_frequency_is_that_of_the_matrix(kind: str) -> None:
    """Fails if the product is not scaled by the masses, or nodes that are held move."""
    space = box(kind, 8 if kind == "quad" else 4)
    momentum, free = damaged(space, AAA()), np.repeat(~boundary(space), space.dim)
    mass, u = momentum.lumped_mass(1e-3), wavy(space, 0.05)
    pattern = Pattern(space, space.dim, free, upper=True)
    omega, mode = highest_frequency(momentum, pattern, free, u, mass, tolerance=1e-6)
    found, other = highest_frequency(momentum, None, free, u, mass, tolerance=1e-6)
    assert found == pytest.approx(omega, rel=1e-9)
    assert abs(mode @ other) == pytest.approx(1.0, rel=1e-6)


def test_an_event_without_a_matrix(fracture: Fracture, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a large body gets a matrix for its steps, or steps of another length."""

    def ran() -> tuple[Explicit, list[float], float]:
        state, explicit = fracture.fresh(), Explicit(fracture.body, ExplicitControls(estimate_every=40))
        explicit.begin(state)
        steps = []
        for _ in range(100):
            explicit.step(state)
            steps.append(explicit.dt)
        assert explicit.estimates > 1
        assert explicit.step_share(state) < 1.0
        return explicit, steps, state.ledger.elastic + state.ledger.sink_stored

    small, steps, dissipated = ran()
    assert small.length._pattern is not None
    monkeypatch.setattr(StepLength, "ASSEMBLED", 0)
    large, others, same = ran()
    assert large.length._pattern is None
    np.testing.assert_allclose(others, steps, rtol=1e-8)
    assert same == pytest.approx(dissipated, rel=1e-6)
