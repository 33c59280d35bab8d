"""Newton's method, loading to the onset, and the quasi-static run of a crack."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from bodies import Fracture, box, ends, grid, grips, held_body, notched, wavy

from skfsink.errors import ConvergenceError, ParameterError
from skfsink.fem.space import Space
from skfsink.fields.density import DensitySolver
from skfsink.fields.energy import Ledger
from skfsink.fields.momentum import Momentum
from skfsink.fields.state import State
from skfsink.material import AAA, SinkLaw
from skfsink.methods.controls import StaticsControls
from skfsink.methods.statics import Statics

LAW = SinkLaw()


class Body(NamedTuple):
    """A body in its grips, and what computes it."""

    momentum: Momentum
    statics: Statics
    state: State

    @classmethod
    def of(cls, space: Space, speed: float = 1e-3, **controls: float) -> Body:
        momentum = Momentum(space, AAA())
        free, velocity = grips(space, speed)
        statics = Statics(held_body(momentum, DensitySolver(space, LAW), free, velocity), StaticsControls(**controls))
        return cls(momentum, statics, State.intact(space))


def loaded(n: int = 9, **options: float) -> Body:
    """A notched plate of n x n quads, loaded to its onset."""
    body = Body.of(notched(n), **options)
    for _ in body.statics.load(body.state):
        pass
    return body


def test_newton_finds_the_equilibrium(kind: str):
    """Fails if equilibrium leaves a residual, raises the energy, moves the grips, or depends on the guess."""
    space = box(kind, 6 if kind == "quad" else 3, 0.2)
    body = Body.of(space, tolerance=1e-9)
    state = body.state
    state.gamma = np.random.default_rng(0).uniform(0.3, 1, space.n_nodes)
    body.momentum.set_gamma(state.gamma, state.deleted)
    free = body.statics.free.reshape(space.X.shape)
    pulled = space.X * np.array([0.0, 0.2, 0.0])[:space.dim]
    results = []
    for seed in (1, 2):
        guess = pulled + np.where(free, wavy(space, 0.04, seed), 0.0)
        body.momentum.force(guess)
        before = body.momentum.energy
        u, force = body.statics.equilibrium(guess)
        assert body.momentum.energy < before
        np.testing.assert_array_equal(u[~free], guess[~free])
        assert np.linalg.norm(force[free]) <= 1.1e-9 * np.linalg.norm(force)
        np.testing.assert_allclose(force, body.momentum.force(u), atol=1e-14)
        results.append(u)
    np.testing.assert_allclose(results[0], results[1], atol=1e-8)
    steps = body.statics.newton_steps
    near, _ = body.statics.equilibrium(results[0] + np.where(free, wavy(space, 1e-5, 3), 0.0))
    np.testing.assert_allclose(near, results[0], atol=1e-8)
    assert body.statics.newton_steps - steps <= 6  # with kept factorisations; from afar, about 30


def test_impossible_equilibrium_is_reported():
    """Fails if a body crushed to nothing gives a result instead of a ConvergenceError."""
    body = Body.of(box("quad", 4))
    with pytest.raises(ConvergenceError, match="no equilibrium"):
        body.statics.equilibrium(body.statics.space.X * np.array([0.0, -0.99]))


@pytest.mark.parametrize(("kind", "peak"), [("quad", 1.525), ("hex", 1.413)])
def test_strength_of_a_block_is_the_closed_form(kind: str, peak: float):
    """Fails if any part of the coupled analysis is off by 1e-3: uniform tension of a distorted mesh, sides free.

    gamma is uniform, so gamma = H + eps, and stress and strength are those of the homogeneous solid (plane strain,
    uniaxial); the bulk modulus is raised to come near the incompressible solid.
    """
    space = box(kind, 4 if kind == "quad" else 2, 0.2)
    material = AAA(bulk_modulus=5e4)
    momentum = Momentum(space, material)
    low, high = ends(space)
    free = np.ones(space.X.shape, bool)
    free[low | high, 1] = False
    for axis in (0, 2)[:space.dim - 1]:
        free[np.isclose(space.X[:, axis], 0), axis] = False
    velocity = np.zeros_like(space.X)
    velocity[high, 1] = 1.0
    body = held_body(momentum, DensitySolver(space, LAW), free.ravel(), velocity)
    statics = Statics(body, StaticsControls(increment=0.01))
    state = State.intact(space)
    stresses = []
    for _ in statics.load(state):
        s = 1 + state.grip
        F = np.diag([1 / s, s, 1]) if kind == "quad" else np.diag([s**-0.5, s, s**-0.5])
        H = float(LAW.history(material.energy(F)))
        cauchy = H * material.first_piola(F) @ F.T
        force = momentum.force(state.u)
        stresses.append(float(force[high, 1].sum()) * s)
        if H > 0.9:
            assert np.ptp(state.gamma) < 5e-6  # the fields are iterated to 1e-5
            assert state.gamma[0] == pytest.approx(H, abs=1e-4)
            assert stresses[-1] == pytest.approx(cauchy[1, 1] - cauchy[0, 0], rel=3e-4)
    assert max(stresses) == pytest.approx(peak, rel=3e-3)  # between increments of one per cent


@pytest.mark.parametrize("increment", [0.003, 0.007, 0.02])
def test_onset_does_not_depend_on_the_increments(increment: float):
    """Fails if the onset is where the iteration happens to give up: it is the same within the bisection's tolerance.

    Up to it the body is almost intact; just past it the fields run away.
    """
    expected = 0.05922
    body = loaded(increment=increment)
    state, controls = body.state, body.statics.controls
    assert state.grip * 1e-3 == pytest.approx(expected, rel=2 * controls.onset_tolerance)
    assert 0.88 < state.gamma.min() < 0.97 and not state.deleted.any()
    assert state.gamma[body.statics.space.X[:, 0] > 0.9].min() > 0.99
    beyond = body.statics._settle(state, body.statics._predict(state.u, 2 * controls.onset_tolerance * state.grip))
    assert beyond is None
    below = body.statics._settle(state, state.u * 0.999)
    assert below is not None


def test_work_of_the_grips_is_stored_up_to_the_onset():
    """Fails if work, elastic energy or D of the loading is wrong: the balance is the error of the trapezoidal rule."""
    errors = []
    for increment in (0.02, 0.01, 0.005):
        body = Body.of(notched(9), increment=increment)
        points = [(0.0, 0.0)]
        for state in body.statics.load(body.state):
            reaction = body.momentum.force(state.u)[ends(body.statics.space)[1], 1].sum()
            points.append((2e-3 * state.grip, float(reaction)))
            if state.step == round(0.04 / increment):
                break
        x, f = np.array(points).T
        assert state.ledger.work == pytest.approx(float(np.trapezoid(f, x)), rel=1e-9)
        assert state.ledger.elastic == pytest.approx(body.momentum.energy, rel=1e-12)
        errors.append(abs(state.ledger.balance) / state.ledger.elastic)
    assert errors[0] > 3.5 * errors[1] > 12 * errors[2]
    assert errors[2] < 1e-3


def test_loading_resumes_to_the_same_bits():
    """Fails if a checkpoint of the loading misses anything."""
    whole, parts = Body.of(notched(9)), Body.of(notched(9))
    for _ in whole.statics.load(whole.state):
        pass
    for state in parts.statics.load(parts.state):
        if state.step == 7:
            break
    other = Body.of(notched(9))
    other.statics.restore(parts.statics.memory())
    for _ in other.statics.load(parts.state):
        pass
    np.testing.assert_array_equal(whole.state.u, parts.state.u)
    np.testing.assert_array_equal(whole.state.gamma, parts.state.gamma)
    assert whole.state.grip == parts.state.grip and whole.state.ledger == parts.state.ledger


@pytest.mark.parametrize("n", [9, 15])
def test_quasi_static_crack_runs_straight(n: int):
    """Fails if gamma grows, the stored energy grows, or the crack does not cut the plate straight.

    The balance holds by construction; what is released, and D, are held against the fields in test_energies.py.
    """
    body = loaded(n)
    state, statics, space = body.state, body.statics, body.statics.space
    state.begin_event(0.005)
    high = ends(space)[1]
    gamma, elastic = state.gamma, np.inf
    for _ in statics.propagate(state):
        ledger = state.ledger
        assert (state.gamma <= gamma + 1e-7).all()
        assert ledger.elastic < elastic + 1e-12 and ledger.released >= 0
        gamma, elastic = state.gamma, ledger.elastic
        if body.momentum.force(state.u)[high, 1].sum() < 1e-6:
            break
        assert state.step < 40
    assert ledger.work == 0.0  # the grips stood still
    assert abs(ledger.elastic) < 1e-9 * ledger.initial
    assert 0.2 * ledger.initial < ledger.released < 0.6 * ledger.initial
    centres = space.X[space.conn[state.deleted]].mean(axis=1)
    assert np.abs(centres[:, 1] - 0.5).max() < 1.1 / n and centres[:, 0].max() > 0.9
    assert ledger.paper == pytest.approx(LAW.failure_energy * space.V[state.deleted].sum(), rel=1e-12)


def test_arrested_crack_is_driven_on_by_the_grips():
    """Fails if a body below its onset is not settled, or the next pass does not move the grips and book their work."""
    body = loaded()
    state, statics = body.state, body.statics
    state.u *= 0.9
    state.grip *= 0.9
    state.step, state.ledger = 0, Ledger()
    start = state.grip
    for _ in statics.propagate(state):
        if state.step == 1:
            assert statics.settled and state.grip == start and state.ledger.work == 0
        if state.step == 3:
            break
    assert state.grip == pytest.approx(start * 1.005**2, rel=1e-12)
    assert state.ledger.work > 0
    assert abs(state.ledger.balance) < 1e-4 * state.ledger.initial
    for _ in statics.propagate(state, limit=1.001):
        pass
    assert statics.arrested == "the grips are at 1.001 times their way to the onset"


@pytest.mark.parametrize(("name", "value"), [("tolerance", 0.0), ("increment", 0.6), ("onset_tolerance", -1.0),
                                             ("max_newton", 1)])
def test_controls_out_of_range_are_refused(name: str, value: float):
    """Fails if an option without meaning is accepted."""
    with pytest.raises(ParameterError, match=f"got {value}"):
        StaticsControls(**{name: value})


def test_points_wait_while_one_is_much_further_past_the_limit(fracture: Fracture) -> None:
    """Fails if a pass kills all past Phi at once, forgets who waits, or lets a spent point hold up the rest."""
    momentum, density = fracture.momentum, fracture.density
    state = fracture.fresh()
    momentum.set_gamma(state.gamma, state.deleted)
    statics = Statics(held_body(momentum, density, fracture.free, fracture.velocity))
    phi, before = density.law.phi, state.W_max.copy()
    W = 0.5 * before
    W[0], W[1], W[2], W[3] = 3.0 * phi, 2.9 * phi, 1.5 * phi, 0.9 * phi
    assert statics._follow(state, W)
    followed = [0, 1, 3]
    assert np.array_equal(state.W_max[followed], np.maximum(before, W)[followed])
    assert np.array_equal(state.W_max[2], before[2])          # waits
    W[0] = W[1] = 0.1 * phi                                   # relieved
    assert not statics._follow(state, W) and (state.W_max[2] == W[2]).all()
    W[4], W[5] = 100 * phi, 1.4 * phi
    momentum.gamma = np.where(np.arange(len(W))[:, None] == 4, 0.0, momentum.gamma)
    assert not statics._follow(state, W) and (state.W_max[5] == W[5]).all()


def test_bent_strip_snaps_back(kind: str):
    """Fails if Newton's method loses its way where the tangent is indefinite: a strip bent to a U, one end let go."""
    shape, size = ((20, 4), (1.0, 0.2)) if kind == "quad" else ((16, 2, 2), (1.0, 0.15, 0.15))
    space = Space(grid(kind, shape, size))
    momentum = Momentum(space, AAA())
    free = np.repeat(~ends(space, axis=0)[0], space.dim)
    statics = Statics(held_body(momentum, DensitySolver(space, LAW), free, np.zeros_like(space.X)))
    x, y = space.X[:, 0], space.X[:, 1] - size[1] / 2
    angle, radius = np.pi * x, 1 / np.pi
    bent = space.X.copy()
    bent[:, 0], bent[:, 1] = (radius - y) * np.sin(angle), radius - (radius - y) * np.cos(angle) + size[1] / 2
    u, _ = statics.newton.equilibrium(bent - space.X, most=200)
    np.testing.assert_allclose(u, 0.0, atol=1e-5)
    assert momentum.energy < 1e-10
    assert statics.newton_steps <= 150 and statics.factorisations <= 180


def test_passes_resume_to_the_same_bits():
    """Fails if a checkpoint of the passes misses what the factors that are kept were made from."""
    bodies = [loaded(), loaded()]
    for body in bodies:
        body.state.begin_event(0.005)
    whole, parts = bodies
    for state in whole.statics.propagate(whole.state):
        if state.step == 9:
            break
    for stop in (2, 4, 5, 9):
        for state in parts.statics.propagate(parts.state):
            if state.step == stop:
                break
        other = Body.of(notched(9))
        other.statics.restore(parts.statics.memory())
        parts = Body(other.momentum, other.statics, parts.state)
    np.testing.assert_array_equal(whole.state.u, parts.state.u)
    np.testing.assert_array_equal(whole.state.gamma, parts.state.gamma)
    assert whole.state.ledger == parts.state.ledger and whole.state.ledger.released > 0
