"""Equilibrium near what has failed, in turn with that of the whole body."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import at_density, close, distorted, grid, grips, momentum_of, pulled, same_bits, wavy

from skfsink.fem.space import Space
from skfsink.fields.momentum import Momentum
from skfsink.fields.state import State
from skfsink.material import AAA, Material, SinkLaw
from skfsink.material.fibres import HolzapfelGasserOgden
from skfsink.material.regions import Region
from skfsink.methods.nearby import LAYERS, Nearby
from skfsink.methods.newton import Newton
from skfsink.methods.statics import Statics

SIZE = (3.0, 2.0, 0.2)


def slab(amount: float = 0.0) -> Space:
    """A slab of hexahedra, notched in the middle of its left side."""
    mesh = grid("hex", (30, 21, 2), SIZE)
    x, y, _ = mesh.p[:, mesh.t].mean(axis=1)
    return Space(distorted(mesh.remove_elements(np.flatnonzero((x < 0.8) & (np.abs(y - 1.0) < 0.06))), amount))


def elements_at(space: Space, x: float, y: float, size: float = 0.12) -> np.ndarray:
    """Mask of the elements around a place."""
    middle = space.X[space.conn].mean(axis=1)
    return np.abs(middle[:, :2] - (x, y)).max(axis=1) < size


def newton_of(momentum: Momentum, tolerance: float = 1e-8) -> Newton:
    return Newton(momentum, grips(momentum.space, 1.0)[0], tolerance, 100)


def stretched(space: Space) -> np.ndarray:
    return 0.05 * (space.X - space.X.mean(axis=0)) * [0.0, 1.0, 0.0]


@pytest.mark.parametrize("material", [AAA(), HolzapfelGasserOgden()])
def test_forces_nearby_are_those_of_the_body(material: Material):
    """Fails if the body nearby is of other materials, fibres, density or places than the same elements in the whole."""
    space = slab(0.2)
    region = Region("stiff", np.flatnonzero(space.X[space.conn].mean(axis=1)[:, 1] > 1.05), AAA(bulk_modulus=100.0),
                    SinkLaw())
    gamma = np.random.default_rng(0).uniform(0.3, 1.0, space.w.shape)
    whole = newton_of(momentum_of(space, material, gamma, regions=[region]))
    before = gamma.copy()
    before[elements_at(space, 0.9, 1.0)] += 0.1
    near = Nearby.of(whole, before)
    assert near is not None
    moves = near.newton.free.reshape(-1, 3).any(axis=1)
    assert 0 < moves.sum() < 0.25 * space.n_nodes and not moves.all()
    u = wavy(space, 0.05)
    close(near.newton.momentum.force(u[near.nodes])[moves], whole.momentum.force(u)[near.nodes][moves])


def test_a_body_is_moved_nearby_alone():
    """Fails if nodes far away move, if grips do, or if what is nearby is left out of equilibrium."""
    space = slab()
    gamma = np.ones_like(space.w)
    gamma[elements_at(space, 0.2, 1.9)] = 0.01  # at a grip
    whole = newton_of(momentum_of(space, AAA(), gamma))
    near = Nearby.of(whole, np.ones_like(space.w))
    assert near is not None
    u = stretched(space)
    u, _ = newton_of(Momentum(space, AAA())).equilibrium(u)
    before, moves = u.copy(), np.zeros(space.n_nodes, bool)
    moves[near.nodes] = near.newton.free.reshape(-1, 3).any(axis=1)
    residual = np.linalg.norm(whole.momentum.force(u)[moves])
    way = near.relax(u, 1e-3 * residual)
    assert way is not None
    np.testing.assert_array_equal(u - before, way)
    held = ~(grips(space, 1.0)[0].reshape(-1, 3)[:, 0]) | ~moves
    assert held.sum() > space.n_nodes / 2 and not way[held].any()
    assert np.linalg.norm(whole.momentum.force(u)[moves]) <= 1e-3 * residual
    far = np.abs(space.X[:, :2] - (0.2, 1.9)).max(axis=1) > 0.12 + 0.1 * (LAYERS + 1)
    assert far.sum() > space.n_nodes / 2 and not way[far].any()


def test_no_equilibrium_nearby_leaves_the_body_as_it_was(monkeypatch: pytest.MonkeyPatch):
    """Fails if a body is left between two states where none is found nearby, or is given up itself."""
    space = slab()
    gamma = np.ones_like(space.w)
    gamma[elements_at(space, 0.9, 1.0)] = 0.01
    start, _ = newton_of(Momentum(space, AAA())).equilibrium(stretched(space))
    answers = []
    for gives_up in (False, True):
        whole = newton_of(Momentum(space, AAA()))
        whole.equilibrium(start * 0.999)
        at_density(whole.momentum, gamma)
        if gives_up:
            monkeypatch.setattr("skfsink.methods.nearby.STEPS", 1)
            near = Nearby.of(whole, np.ones_like(space.w))
            assert near is not None
            u = start.copy()
            assert near.relax(u, 1e-12) is None
            np.testing.assert_array_equal(u, start)
        answers.append(whole.equilibrium(start, nearby=True)[0])
    close(answers[1], answers[0], 1e-6)


def test_secants_are_of_the_whole_way(monkeypatch: pytest.MonkeyPatch):
    """Fails if a secant is of a step alone, while its change of force is also of what moved nearby."""
    space, ways, pairs = slab(), [], []
    gamma = np.ones_like(space.w)
    gamma[elements_at(space, 0.9, 1.0)] = 0.3
    whole = newton_of(Momentum(space, AAA()))
    start, _ = whole.equilibrium(stretched(space))
    at_density(whole.momentum, gamma)
    monkeypatch.setattr(Nearby, "relax", lambda self, u, force, plain=Nearby.relax:
                        (plain(self, u, force), ways.append(u.ravel()[whole.free]))[0])
    whole._secants.clear()
    monkeypatch.setattr(whole._secants, "add", lambda s, y: pairs.append((s, y)))
    whole.equilibrium(start, nearby=True)
    assert len(pairs) >= 2
    for (s, y), before, after in zip(pairs, ways, ways[1:]):
        close(s, after - before, 1e-5)
        u = np.zeros_like(start), np.zeros_like(start)
        for place, way in zip(u, (before, after)):
            place[:] = start
            place.reshape(-1)[whole.free] = way
        change = whole.momentum.force(u[1]) - whole.momentum.force(u[0])
        close(y, change.ravel()[whole.free], 1e-5)


@pytest.mark.parametrize("where", [(0.9, 1.0, 0.12), (1.5, 1.0, 0.8)], ids=["few", "many"])
def test_only_a_small_part_of_a_body_is_nearby(where: tuple[float, float, float]):
    """Fails if a body that has changed nowhere, or as a whole, has something nearby."""
    space = slab()
    gamma = np.ones_like(space.w)
    whole = newton_of(momentum_of(space, AAA(), gamma))
    assert Nearby.of(whole, gamma) is None
    before = gamma.copy()
    before[elements_at(space, *where)] = 0.9
    assert (Nearby.of(whole, before) is None) == (where[2] > 0.5)


# --- in statics ---
def statics_of(space: Space) -> Statics:
    return pulled(space, SinkLaw(length_scale=0.1), tolerance=1e-8).statics


@pytest.fixture(scope="module")
def onset() -> State:
    """The slab at its onset."""
    return pulled(slab(), SinkLaw(length_scale=0.1), tolerance=1e-8).load()


def passes(statics: Statics, state: State, count: int) -> State:
    for _ in statics.propagate(state):
        if state.step == count:
            break
    return state


def test_a_crack_runs_as_without(onset: State, monkeypatch: pytest.MonkeyPatch):
    """Fails if passes come to other equilibria, or take as many factors of the whole body."""
    space, found, relaxed = slab(), [], []
    monkeypatch.setattr(Nearby, "relax", lambda self, u, force, plain=Nearby.relax:
                        (way := plain(self, u, force), relaxed.append(way is not None))[0])
    for nearby in (False, True):
        monkeypatch.setattr(Newton, "NEARBY", nearby)
        state, statics = onset.copy(), statics_of(space)
        state.begin_event(0.005)
        found.append((passes(statics, state, 25), statics.factorisations))
        assert bool(relaxed) == nearby
    (plain, factors), (state, fewer) = found
    assert sum(relaxed) > 25 and sum(relaxed) > 0.9 * len(relaxed)
    np.testing.assert_array_equal(state.deleted, plain.deleted)
    assert state.deleted.sum() > 10
    np.testing.assert_allclose(state.gamma, plain.gamma, atol=1e-5)
    for name in ("released", "elastic"):
        assert getattr(state.ledger, name) == pytest.approx(getattr(plain.ledger, name), rel=1e-5)
    assert fewer < 0.7 * factors, (fewer, factors)


def test_passes_resume_to_the_same_bits(onset: State):
    """Fails if something nearby is remembered from one pass to the next, beyond what a checkpoint holds."""
    space = slab()
    states = [onset.copy(), onset.copy()]
    for state in states:
        state.begin_event(0.005)
    passes(statics_of(space), states[0], 12)
    parts = statics_of(space)
    for stop in (5, 8, 12):
        passes(parts, states[1], stop)
        memory, parts = parts.memory(), statics_of(space)
        parts.restore(memory)
    same_bits(*states)


@pytest.mark.parametrize("name", ["", "dead", "followers", "contact", "sliding"])
def test_other_loads_are_left_to_the_whole(name: str):
    """Fails if what is nearby is brought to an equilibrium without the loads or the contact of the body."""
    space = slab()
    gamma = np.ones_like(space.w)
    gamma[elements_at(space, 0.9, 1.0)] = 0.5
    whole = newton_of(momentum_of(space, AAA(), gamma))
    whole._kept = (np.zeros_like(space.X), np.ones_like(gamma))
    if name:
        setattr(whole.momentum, name, object())
    assert (whole._nearby() is None) == bool(name)
