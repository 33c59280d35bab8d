"""The active zone: gamma solved where it changes, checked everywhere."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import box

from skfsink.fem.amg import residual
from skfsink.fem.space import Space
from skfsink.fields.active_zone import ActiveZone, _deepen
from skfsink.fields.density import Density, DensitySolver
from skfsink.material import SinkLaw
from skfsink.methods.explicit import Explicit

TOLERANCE = Explicit.GAMMA_TOLERANCE
LAW = SinkLaw(length_scale=0.02)  # the body is 1 mm wide: fifty lengths l


@pytest.fixture(scope="module")
def space() -> Space:
    """A square of 1 mm of 4,900 quadrilaterals."""
    return box("quad", 70, 0.1)


def history(space: Space, *tips: float) -> np.ndarray:
    """Stored energy of cracks from the left edge to x = tip, one above the other."""
    middle = space.X[space.conn].mean(axis=1) / space.X.max()
    W = np.zeros_like(space.w)
    for tip, y in zip(tips, (0.3, 0.8)):
        W[(abs(middle[:, 1] - y) < 0.01) & (middle[:, 0] < tip)] = 1.0
    return W


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("share", [0.02, 0.3])
def test_depths_are_the_distances_from_the_end_of_the_zone(dim: int, share: float):
    """Fails if a cell is left out or not as deep as its sources make it, or a zone that is too large is not refused."""
    rng = np.random.default_rng(dim)
    centres = np.unique(rng.integers(0, 20, (600, dim)), axis=0) * 0.1
    sizes = rng.integers(0, 9, len(centres))
    need = np.where(rng.random(len(centres)) < share, rng.uniform(0.01, 0.3, len(centres)), 0.0)
    apart = np.linalg.norm(centres[:, None] - centres, axis=2)
    expected = np.where(need > 0, need + 0.2 - apart, 0.0).max(axis=1).clip(0.0)
    inside = sizes[expected > 0].sum() / sizes.sum()
    assert 0.05 < inside < 1.0 or share > 0.1
    for most, whole in ((inside + 1e-6, True), (inside - 1e-6, False), (1.0, True)):
        depth = np.zeros(len(centres))
        assert _deepen(centres, need, 0.2, sizes, most, depth) == whole
        if whole:
            np.testing.assert_allclose(depth, expected, atol=1e-14)


def run(space: Space, solver: DensitySolver, density: Density, *tips: tuple[float, float]) -> Density:
    """Solves while two cracks run on."""
    for pair in tips:
        density = solver.update(history(space, *pair), density, TOLERANCE)
    return density


PATH = [(0.3 + 0.01 * i, 0.1 + 0.005 * i) for i in range(20)]


def whole_residual(space: Space, solver: DensitySolver, W: np.ndarray, gamma: np.ndarray) -> float:
    """Relative residual of the density equation, from the matrix assembled anew; dead nodes scaled to their sink."""
    A = solver.pattern.matrix(solver._assemble(1 / (LAW.history(W) + LAW.epsilon)))
    r = residual(A, gamma, solver.load)
    return float(np.linalg.norm(r) / np.linalg.norm(solver.load))


def test_the_zone_gives_what_a_solve_everywhere_gives(space: Space):
    """Fails if the zone is too small, its matrix or its coupling to the outside wrong, or if it is not used."""
    zoned, everywhere = DensitySolver(space, LAW), DensitySolver(space, LAW, active_zone=False)
    ones = Density(np.ones(space.n_nodes))
    density, exact = run(space, zoned, ones, *PATH), run(space, everywhere, ones, *PATH)
    assert everywhere.zone is None
    assert zoned.zone.solves > 10
    assert density.zones[-1].nodes.size < 0.6 * space.n_nodes
    assert whole_residual(space, zoned, history(space, *PATH[-1]), density.gamma) <= 2 * TOLERANCE
    assert np.abs(density.gamma - exact.gamma).max() < 1e-4


def test_a_zone_that_is_too_small_is_found_out(space: Space, monkeypatch: pytest.MonkeyPatch):
    """Fails if the residual outside the zone is not looked at: the solve everywhere has to follow."""
    monkeypatch.setattr(ActiveZone, "RADIUS", 0.5)
    monkeypatch.setattr(ActiveZone, "MARGIN", 0.5)
    solver = DensitySolver(space, LAW)
    gamma = run(space, solver, Density(np.ones(space.n_nodes)), *PATH).gamma
    assert solver.zone.misses > 5
    assert whole_residual(space, solver, history(space, *PATH[-1]), gamma) <= 2 * TOLERANCE


def test_damage_far_outside_the_zone_is_not_overlooked(space: Space):
    """Fails if the sources of the last solves decide alone: a second crack starts where nothing happened before."""
    solver = DensitySolver(space, LAW)
    density = run(space, solver, Density(np.ones(space.n_nodes)), *[(0.3 + 0.01 * i, 0.0) for i in range(5)])
    gamma = solver.update(history(space, 0.35, 0.1), density, TOLERANCE).gamma
    assert whole_residual(space, solver, history(space, 0.35, 0.1), gamma) <= 2 * TOLERANCE
    born = space.at_gauss(gamma)[history(space, 0.0, 0.1) > 0]
    assert born.max() < 0.1


def test_zones_made_again_from_their_depths_give_the_same_bits(space: Space):
    """Fails if a zone depends on more than its depths: a resumed run would differ from one that was not stopped."""
    one, two = DensitySolver(space, LAW), DensitySolver(space, LAW)
    half = run(space, one, Density(np.ones(space.n_nodes)), *PATH[:12])
    again = half._replace(zones=tuple(two.zone.of_depth(zone.depth.copy()) for zone in half.zones))
    np.testing.assert_array_equal(run(space, one, half, *PATH[12:]).gamma, run(space, two, again, *PATH[12:]).gamma)
    assert two.zone.solves > 2


def test_a_solve_does_not_remember_the_one_before(space: Space):
    """Fails if a solver keeps a sink or zones of its own: what was solved in between would change the bits."""
    solver = DensitySolver(space, LAW)
    start = run(space, solver, Density(np.ones(space.n_nodes)), *PATH[:3])
    first = run(space, solver, start, *PATH[3:6])
    run(space, solver, start, (0.9, 0.9), (0.95, 0.2))  # steps that are given up
    np.testing.assert_array_equal(run(space, solver, start, *PATH[3:6]).gamma, first.gamma)
    whole = np.full_like(space.w, 0.1)  # H is 1 to rounding in both: nothing has changed between the two
    solver.solve(0.5 * whole, np.ones(space.n_nodes))
    assert np.abs(solver.solve(whole, np.full(space.n_nodes, 0.5)) - 1).max() < 0.01


def test_no_zone_for_the_consistent_sink(space: Space):
    """Fails if the zone is used where its solver stalls."""
    assert DensitySolver(space, LAW, "consistent").zone is None
