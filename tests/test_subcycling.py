"""Short steps of their own for the smallest elements: what they leave as it is, accuracy, and stability."""

from __future__ import annotations

import copy
from collections.abc import Callable

import numpy as np
import pytest
from bodies import Fracture, at_onset, boundary, grid, grips, held_body, notched, same_bits

from skfsink.errors import ParameterError
from skfsink.fem.space import Space
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import BulkViscosity, Momentum
from skfsink.fields.state import State
from skfsink.material import AAA, SinkLaw
from skfsink.material.regions import Region
from skfsink.methods.controls import ExplicitControls
from skfsink.methods.explicit import Explicit
from skfsink.methods.raised_mass import small_elements
from skfsink.methods.ranks.part import check_parts
from skfsink.methods.subcycling import Subcycling, check_subcycling
from skfsink.scene.controls import Controls

EVENT = 10**9  # steps between solves for gamma: never


def squeezed(space: Space, ratio: float, middle: float = 0.5, width: float = 0.2) -> Space:
    """A body of 1 mm whose elements within `width` of `middle` along the last axis are `ratio` times as thin."""
    p = space.mesh.p.copy()
    y = np.unique(np.round(p[-1], 12))
    thin = np.where(np.abs(0.5 * (y[1:] + y[:-1]) - middle) < 0.5 * width, 1 / ratio, 1.0)
    p[-1] = np.interp(p[-1], y, np.concatenate([[0.0], np.cumsum(thin * np.diff(y))]) / (thin * np.diff(y)).sum())
    return Space(type(space.mesh)(p, space.mesh.t))


def share(space: Space) -> float:
    """Of the volume that its thin elements fill, and a bit."""
    return float(1.001 * space.V[0.5 * space.V.max() > space.V].sum() / space.V.sum())


def layered(ratio: float, kind: str = "quad") -> Space:
    """A body with thin layers in its middle."""
    if kind == "quad":
        return squeezed(Space(grid(kind, (4, 20))), ratio, width=0.19)
    return squeezed(Space(grid(kind, (2, 2, 16))), ratio, width=0.13)


class Swinging:
    """An intact body with layers, stretched and let go, whose ends are held or pulled [mm/s]."""

    def __init__(self, space: Space, element: str = "jbar", pull: float = 0.0, *, speed: float = 3e3,
                 **options: float) -> None:
        momentum = Momentum(space, AAA(), element)
        free, velocity = grips(space, pull, space.dim - 1)
        body = held_body(momentum, DensitySolver(space, SinkLaw()), free, velocity)
        options = {"raised_mass": 0.0, "energy_tolerance": 0.0, "gamma_every": EVENT} | options
        self.explicit, self.state = Explicit(body, ExplicitControls(**options)), State.intact(space)
        y, stretch = space.X[:, -1], 1.1
        thinner = stretch ** (-1 / (space.volume_dim - 1))
        self.state.u[...] = space.X * (thinner - 1)
        self.state.u[:, -1] = (stretch - 1) * y
        self.state.v[:, -1] = speed * np.sin(np.pi * y) * (1 + space.X[:, 0]) + pull * (2 * y - 1)
        self.state.v[:, 0] = 0.5 * speed * np.sin(2 * np.pi * y)
        self.explicit.begin(self.state)

    def until(self, t: float, dt: float) -> np.ndarray:
        """The displacement at a time [s], in equal steps."""
        self.explicit.length.fix(dt)
        for _ in range(round(t / dt)):
            self.explicit.step(self.state)
        return self.state.u


def patched(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    """Let every step have as many short ones."""
    monkeypatch.setattr(Subcycling, "steps", lambda self, dt: count)


#: space, element, and speed of the grips [mm/s]
BODIES = {"jbar": (layered(4), "jbar", 0.0), "planestress": (layered(4), "planestress", 0.0),
          "solid": (layered(4, "hex"), "jbar", 0.0), "revolved": (layered(4).revolved(), "axisymmetric", 0.0),
          "at a grip": (squeezed(Space(grid("quad", (4, 20))), 4.0, middle=1.0, width=0.4), "jbar", 4e3)}


@pytest.mark.parametrize("name", BODIES)
def test_one_short_step_is_the_step(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if kicks and short step do not add up to the step of the scheme, in displacement, velocity or energies.

    Seen to fail with the whole acceleration in the first kick.
    """
    patched(monkeypatch, 1)
    space, element, pull = BODIES[name]
    one, other = Swinging(space, element, pull), Swinging(space, element, pull, subcycled=share(space))
    assert other.explicit.subcycling is not None and one.explicit.subcycling is None
    for of in (one, other):
        of.until(2e-6, 2e-8)
    for field in ("u", "v", "a"):
        expected = getattr(one.state, field)
        np.testing.assert_allclose(getattr(other.state, field), expected, atol=1e-9 * np.abs(expected).max(), rtol=0)
    for term in ("kinetic", "elastic", "numerical", "work"):
        assert getattr(other.state.ledger, term) == pytest.approx(
            getattr(one.state.ledger, term), abs=1e-10 * one.state.ledger.initial)


@pytest.mark.parametrize("name", BODIES)
def test_error_is_of_second_order(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if kicks stand at the wrong time, or the other forces are not the whole ones less those of the fast
    elements.

    Seen to fail with accelerations by the fast elements that stay those of the start, with 3 % less of them in the last
    kick, and, at a grip, with nodes that are held standing still in short steps.
    """
    space, element, pull = BODIES[name]
    T = 3.2e-6
    exact = Swinging(space, element, pull).until(T, 2.5e-9)
    patched(monkeypatch, 3)
    errors = [np.abs(Swinging(space, element, pull, subcycled=share(space)).until(T, dt) - exact).max()
              for dt in (8e-8, 4e-8, 2e-8)]
    assert errors[2] < 0.02 * np.abs(exact).max()
    assert 3.0 < errors[0] / errors[1] < 5.5 and 3.3 < errors[1] / errors[2] < 4.7


@pytest.mark.parametrize(("ratio", "courant"), [(3, 0.8), (3, 0.925), (6, 0.795), (16, 0.8)])
def test_energy_is_conserved_for_long(ratio: float, courant: float) -> None:
    """Fails if the scheme resonates, or the step is not that of the elements outside.

    Seen to fail without layers of neighbours, and with one, at some of these ratios and Courant numbers, and with the
    step of the whole body.
    """
    space = layered(ratio)
    body = Swinging(space, subcycled=share(space), courant=courant)
    body.state.v = np.random.default_rng(0).standard_normal(space.X.shape) * 1e3  # all modes swing
    body.explicit.begin(body.state)
    ledger, found = body.state.ledger, []
    at_first = ledger.kinetic
    for _ in range(2000):
        body.explicit.step(body.state)
        found.append(abs(ledger.numerical) / at_first)
    assert max(found[1000:]) < 1.05 * max(found[:1000]) < 0.3  # the swing of the scheme, which is of second order
    assert abs(ledger.balance) < 1e-9 * ledger.initial
    plain = Swinging(space, courant=courant)
    plain.explicit.step(plain.state)
    assert body.explicit.dt > 0.6 * ratio * plain.explicit.dt
    assert body.explicit.step_share(body.state) <= 1.0


@pytest.fixture(scope="module")
def thin() -> Fracture:
    """A notched plate just past its onset, with elements a sixth as thin at the height of its notch."""
    return at_onset(squeezed(notched(15), 6.0, width=0.21))


def event(of: Fracture, **options: float) -> Explicit:
    """Its explicit scheme, with short steps of the thin elements."""
    momentum = Momentum(of.momentum.space, of.momentum.material)
    body = held_body(momentum, DensitySolver(momentum.space, SinkLaw()), of.free, of.velocity)
    return Explicit(body, ExplicitControls(**{"raised_mass": 0.0, "subcycled": share(momentum.space)} | options))


def test_ledger_of_a_fracture_is_closed(thin: Fracture) -> None:
    """Fails if a term of a step is missing in what it feeds in, or masses are not those of the body.

    Seen to fail without the half kick at the end in `gain`.
    """
    explicit, state = event(thin, energy_tolerance=5e-7), thin.fresh()
    explicit.begin(state)
    for _ in range(200):
        explicit.step(state)
        assert abs(state.ledger.balance) < 1e-10 * state.ledger.initial
    assert explicit.rejected > 0 and state.gamma.min() < 0.5
    assert abs(state.ledger.numerical) < 5e-3 * state.ledger.initial
    kinetic = 0.5 * float(explicit.mass @ (state.v**2).sum(axis=1))
    assert state.ledger.kinetic == pytest.approx(kinetic, rel=1e-12)


def test_step_made_again_begins_where_the_first_did(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a rejected step leaves something behind.

    Seen to fail with the accelerations by the fast elements kept from it.
    """
    patched(monkeypatch, 3)
    space = layered(4)
    one, other = (Swinging(space, subcycled=share(space)) for _ in range(2))
    for body in (one, other):
        body.until(4e-7, 4e-8)
    with monkeypatch.context() as refusing:
        refusing.setattr(one.explicit.length, "accepts", lambda *_: False)
        assert not one.explicit._try(one.state)
    for body in (one, other):
        body.until(8e-8, 2e-8)
    same_bits(one.state, other.state)
    assert one.state.ledger == other.state.ledger


def test_crack_runs_as_with_short_steps_of_all(thin: Fracture) -> None:
    """Fails if density or masses of the fast elements are not those of the body: the crack is then another.

    Seen to fail with the density of the start in the short steps.
    """
    ends = []
    for subcycled in (0.0, share(thin.momentum.space)):
        explicit, state = event(thin, subcycled=subcycled, gamma_every=0), thin.fresh()
        explicit.begin(state)
        for _ in explicit.run(state, 8e-6):
            assert state.step < 2000
        ends.append((state, explicit))
    (one, plain), (other, short) = ends
    assert other.step < 0.6 * one.step
    assert one.ledger.sink > 0.02 * one.ledger.initial
    assert other.ledger.sink == pytest.approx(one.ledger.sink, rel=0.05)
    assert np.abs(other.gamma - one.gamma).mean() < 0.01
    assert plain.subcycling is None and short.subcycling is not None and short.subcycling.evaluations > other.step


def test_symmetric_stays_symmetric(thin: Fracture) -> None:
    """Fails if the short steps do not treat both halves alike.

    Seen to fail with 1e-5 more acceleration at every second node.
    """
    space = thin.momentum.space
    image = np.array([int(np.argmin(np.hypot(*(space.X - (x, 1 - y)).T))) for x, y in space.X])
    explicit, state = event(thin), thin.fresh()
    explicit.begin(state)
    for _ in range(150):
        explicit.step(state)
    assert state.gamma.min() < 0.5
    np.testing.assert_allclose(state.u[image] * (1, -1), state.u, atol=1e-7 * np.abs(state.u).max())
    np.testing.assert_allclose(state.gamma[image], state.gamma, atol=1e-6)


def test_history_is_that_of_the_short_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if what a fast element goes through within a long step is lost, or shows in others.

    Seen to fail without `merge`.
    """
    patched(monkeypatch, 8)
    space = layered(4)
    body = Swinging(space, subcycled=share(space), speed=2e4)
    subcycling = body.explicit.subcycling
    assert subcycling is not None
    greatest = np.zeros_like(space.w)
    for _ in range(40):
        body.explicit.step(body.state)
        np.maximum(greatest, body.explicit.momentum.W, out=greatest)
    body.explicit.sync(body.state)
    more = body.state.W_max - greatest
    others = np.setdiff1d(np.arange(space.n_elements), subcycling.elements)
    assert (more >= -1e-15).all() and more[subcycling.elements].max() > 1e-3 * greatest.max()
    assert others.size and (more[others] <= 1e-15).all()


@pytest.mark.parametrize("tolerance", [0.0, 5e-7])
def test_run_continues_to_the_same_bits(thin: Fracture, tolerance: float) -> None:
    """Fails if a checkpoint misses anything of the short steps, in a running crack with and without rejected steps.

    Seen to fail without the accelerations of the fast elements, and without the memory of the short step.
    """
    one, state = event(thin, energy_tolerance=tolerance), thin.fresh()
    one.begin(state)
    for _ in range(33):
        one.step(state)
    one.sync(state)
    assert (one.rejected > 0) == (tolerance > 0.0)
    resumed, memory = copy.deepcopy((state, one.memory()))
    two = event(thin, energy_tolerance=tolerance)
    two.restore(resumed, memory)
    for _ in range(120):
        one.step(state)
        two.step(resumed)
    one.sync(state)
    two.sync(resumed)
    assert state.gamma.min() < 0.8
    same_bits(state, resumed)
    assert state.ledger == resumed.ledger and state.time == resumed.time
    after = two.memory()
    for name, value in one.memory().items():
        np.testing.assert_array_equal(after[name], value)


def test_small_elements_and_their_neighbours_are_fast() -> None:
    """Fails if others are, materials are not those of the elements, or equal elements are cycled.

    Seen to fail without the regions.
    """
    space = layered(4)
    stiff = np.flatnonzero(space.X[space.conn, 0].mean(axis=1) < 0.5)
    regions = (Region("left", stiff, AAA(c1=0.7), SinkLaw()),)
    momentum = Momentum(space, AAA(), regions=regions)
    free = ~boundary(space)[:, None] & np.ones(space.dim, bool)
    found = Subcycling(momentum, small_elements(momentum, share(space)), free, ExplicitControls(), 1.0)
    thin_ones = 0.5 * space.V.max() > space.V
    assert thin_ones[found.elements].sum() == thin_ones.sum() == 4 * 4
    assert found.elements.size == thin_ones.sum() + 2 * 3 * 4  # three layers above and below
    y = np.unique(space.X[:, 1].round(9))
    assert np.unique(space.X[found.inner, 1].round(9)).size == 4 + 1 + 2 * 2 and y.size == 21
    u = np.random.default_rng(0).standard_normal(space.X.shape) * 1e-3
    whole, part = np.empty_like(u), np.empty((found.nodes.size, 2))
    momentum.backend.force(u, whole)
    found._backend.force(u[found.nodes], part)
    inner = found.inner[found.nodes]
    np.testing.assert_allclose(part[inner], whole[found.nodes][inner], atol=1e-12)
    even = Swinging(Space(grid("quad", (5, 5))), subcycled=0.1)
    assert even.explicit.subcycling is None


@pytest.mark.parametrize(("of", "message"), [
    (lambda: ExplicitControls(subcycled=0.001), r"subcycled 0\.001 is .* raised_mass 0\.01: take raised_mass 0$"),
    (lambda: ExplicitControls(raised_mass=0.0, subcycled=0.6), r"subcycled"),
    (lambda: viscous(BulkViscosity(0.06, 0.0)), r"subcycled does not know viscosity: take subcycled 0"),
    (lambda: check_subcycling(loading(), Controls(contact=True), 0.0), r"does not know contact"),
    (lambda: check_subcycling(loading(), Controls(), 1e-5), r"does not know viscosity"),
    (lambda: check_parts(layered(4), loading(), Controls(), 0.01), r"several ranks cannot compute subcycled elements"),
])
def test_what_it_does_not_know_is_refused(of: Callable[[], object], message: str) -> None:
    """Fails if a run with what the short steps would leave out is computed without it, or no cure is named."""
    with pytest.raises(ParameterError, match=message):
        of()


def loading() -> object:
    """Of a body whose ends are held."""
    space = layered(4)
    free, velocity = grips(space, 0.0)
    return held_body(Momentum(space, AAA()), DensitySolver(space, SinkLaw()), free, velocity).loading


def viscous(bulk: BulkViscosity) -> Subcycling:
    """The short steps of a body with bulk viscosity."""
    space = layered(4)
    momentum = Momentum(space, AAA(), bulk_viscosity=bulk)
    return Subcycling(momentum, small_elements(momentum, 0.1), np.ones_like(space.X, bool), ExplicitControls(), 1.0)
