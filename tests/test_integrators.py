"""Order, ledger, rejection of steps, and exact continuation of the two time integrators."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import Fracture, box, ends, held_body

from skfsink.fields.body import Body
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.fields.state import State
from skfsink.loads.grips import Grip, Ramp
from skfsink.loads.schedule import Loading
from skfsink.material import AAA, SinkLaw
from skfsink.methods.controls import ExplicitControls, HHTControls
from skfsink.methods.explicit import Explicit
from skfsink.methods.hht import HHT

EXACT = {"force_tolerance": 1e-9, "correction_tolerance": 1e-9, "max_iterations": 30}


def swinging(kind: str, steps: int, integrator: str, alpha: float = 0.0, end: float = 2e-5) -> State:
    """A smooth elastic swing of a coarse body, clamped at one end and let go, after `steps` equal steps."""
    space = box(kind, 3 if kind == "quad" else 2, 0.2)
    momentum, density = Momentum(space, AAA(bulk_modulus=5.0)), DensitySolver(space, SinkLaw(phi=1e3))
    free, still = np.repeat(~ends(space)[0], space.dim), np.zeros_like(space.X)
    state = State.intact(space)
    x, y = space.X[:, 0], space.X[:, 1]
    state.u[:, 0] = 0.05 * np.sin(np.pi * y / 2)
    state.u[:, 1] = 0.025 * np.sin(np.pi * y / 2) * x
    if integrator == "explicit":
        scheme = Explicit(held_body(momentum, density, free, still), ExplicitControls(gamma_every=10))
        scheme.length.fix(end / steps)
    else:
        scheme = HHT(held_body(momentum, density, free, still), HHTControls(alpha=alpha, dt=end / steps, **EXACT))
    scheme.begin(state)
    for _ in range(steps):
        scheme.step(state)
    assert state.time == pytest.approx(end, rel=1e-12)
    assert integrator == "explicit" or scheme.rejected == 0
    return state


@pytest.mark.parametrize(("integrator", "alpha"), [("explicit", 0.0), ("hht", 0.0), ("hht", -0.05),
                                                   pytest.param("hht", -1 / 3, marks=pytest.mark.slow)])
def test_second_order_in_time(kind: str, integrator: str, alpha: float):
    """Fails if a scheme loses its order: self-convergence of displacement and velocity, 1.9 to 2.1.

    Without damage, alpha = 0 and explicit steps keep the energy up to terms of second order; the ledger books these,
    and what HHT damps, as numerical, and closes to rounding.
    """
    states = [swinging(kind, n, integrator, alpha) for n in (40, 80, 160)]
    for field in ("u", "v"):
        a, b, c = (getattr(s, field) for s in states)
        order = np.log2(np.linalg.norm(a - b) / np.linalg.norm(b - c))
        assert 1.9 < order < 2.1, (field, order)
    for s in states:
        assert abs(s.ledger.balance) <= 1e-12 * s.ledger.initial
        assert s.ledger.kinetic > 0.05 * s.ledger.initial  # it does move
    lost = np.abs([s.ledger.numerical / s.ledger.initial for s in states])
    assert lost[2] < 0.3 * lost[1] or lost.max() < 1e-6
    assert lost[0] < (6e-4 if integrator == "explicit" else 2e-5 if alpha == 0 else 4e-4)


def recomputed(momentum: Momentum, state: State, mass: np.ndarray) -> tuple[float, float]:
    """Elastic and kinetic energy of a state from scratch, by the formulas of the material."""
    space = momentum.space
    F = space.deformation_gradient(state.u)
    J = np.linalg.det(F)
    gamma = momentum.effective(state.gamma, state.deleted)
    live = gamma > 0
    W = np.zeros_like(J)
    J_bar = np.broadcast_to(space.element_mean(J)[:, None], J.shape)
    W[live] = momentum.material.energy(F[live], J_bar[live])
    return float((space.w * gamma * W).sum()), 0.5 * float(mass @ (state.v**2).sum(axis=1))


@pytest.mark.parametrize("gamma_every", [1, 7])
def test_explicit_ledger_closes_through_a_fracture(fracture: Fracture, gamma_every: int):
    """Fails if an energy of the state is wrong, or a step does not keep the identity of the scheme (docs/theory.md).

    Elastic and kinetic energy are recomputed from the state. The balance of 1e-10 is algebra: `numerical` takes up what
    another entry is wrong by, and is bounded, as D is, by the fields alone in test_energies.py.
    """
    fresh, momentum, density, free, velocity = fracture
    state = fresh()
    explicit = Explicit(held_body(momentum, density, free, velocity), ExplicitControls(gamma_every=gamma_every))
    explicit.begin(state)
    initial = state.ledger.initial
    worst = 0.0
    for _ in explicit.run(state, 4e-5):
        worst = max(worst, abs(state.ledger.balance))
        if state.step % 100 == 0:
            elastic, kinetic = recomputed(momentum, state, explicit.mass)
            assert state.ledger.elastic == pytest.approx(elastic, rel=1e-9)
            assert state.ledger.kinetic == pytest.approx(kinetic, rel=1e-9)
    ledger = state.ledger
    assert worst <= 1e-10 * initial
    assert state.deleted.sum() > 10 and len(state.deletions) == state.deleted.sum()
    assert ledger.paper == pytest.approx(density.law.failure_energy * momentum.space.V[state.deleted].sum(), rel=1e-12)
    assert 0.3 * initial < ledger.sink < initial
    assert ledger.sink_stored > ledger.sink_kinetic > 0.05 * initial
    assert 0 < abs(ledger.numerical) < 0.01 * initial
    assert state.gamma.min() > 0 and state.gamma.max() <= 1 + 1e-9
    times = [t for t, _ in state.deletions]
    assert times == sorted(times)


@pytest.mark.parametrize("coupling", ["single", "iterated"])
def test_hht_ledger_closes_through_a_fracture(fracture: Fracture, coupling: str):
    """Fails if an accepted step is not in balance, or its entries do not follow from the scheme: they close to 1e-8.

    Also when elements and nodes die, with what the mass floor of dead nodes held. D is held against the fields alone in
    test_energies.py.
    """
    fresh, momentum, density, free, velocity = fracture
    state = fresh()
    controls = HHTControls(dt=4e-7, coupling=coupling, force_tolerance=1e-8, correction_tolerance=1e-8,
                           gamma_tolerance=1e-7)
    hht = HHT(held_body(momentum, density, free, velocity), controls)
    hht.begin(state)
    for _ in hht.run(state, 2.5e-5):
        assert abs(state.ledger.balance) <= 1e-8 * state.ledger.initial
    elastic, kinetic = recomputed(momentum, state, momentum.lumped_mass(controls.mass_floor))
    assert state.ledger.elastic == pytest.approx(elastic, rel=1e-9)
    assert state.ledger.kinetic == pytest.approx(kinetic, rel=1e-6)
    assert state.ledger.sink > 0.3 * state.ledger.initial and state.deleted.sum() > 5
    assert 0 < state.ledger.sink_kinetic < state.ledger.sink_stored


def test_integrators_agree_on_a_fracture(fracture: Fracture):
    """Fails if one of them is wrong: the energies at 20 us agree to 10 % of the initial energy on this coarse mesh."""
    fresh, momentum, density, free, velocity = fracture
    ledgers = []
    for make in (lambda: Explicit(held_body(momentum, density, free, velocity)),
                 lambda: HHT(held_body(momentum, density, free, velocity), HHTControls(dt=2e-7))):
        state, scheme = fresh(), make()
        scheme.begin(state)
        for _ in scheme.run(state, 2e-5):
            pass
        ledgers.append(state.ledger)
    for name in ("elastic", "kinetic", "sink", "sink_stored"):
        a, b = (getattr(ledger, name) for ledger in ledgers)
        assert a == pytest.approx(b, abs=0.1 * ledgers[0].initial), name


CARRIED = {"explicit": {}, "lumped": {"mass": "lumped"}, "consistent": {"mass": "consistent"},
           "single pass": {"mass": "lumped", "coupling": "single"},
           "consistent, single pass": {"mass": "consistent", "coupling": "single"}}


def carried(kind: str, scheme: str, dies: float, velocity: float = 4e3) -> tuple[Explicit | HHT, State, float]:
    """A body that moves rigidly with the grip at one of its ends, its history `dies` times Phi at some of that end;
    the integrator has begun. Returns m v^2/2 of the intact body too."""
    space = box(kind, 3 if kind == "quad" else 2, 0.2)
    momentum, density = Momentum(space, AAA(bulk_modulus=5.0)), DensitySolver(space, SinkLaw(length_scale=0.3))
    low, v = ends(space)[0], np.zeros_like(space.X)
    v[:, 1] = velocity
    body = held_body(momentum, density, np.repeat(~low, space.dim), np.where(low[:, None], v, 0.0))
    state = State.intact(space)
    state.v[...] = v
    elements = np.flatnonzero(low[space.conn].any(axis=1))[:2]
    state.W_max[elements] = dies * density.law.phi
    made = (Explicit(body, ExplicitControls(gamma_every=1)) if scheme == "explicit"
            else HHT(body, HHTControls(dt=1e-8, **CARRIED[scheme])))
    made.begin(state)
    return made, state, 0.5 * momentum.rho0 * float(space.V.sum()) * velocity**2


@pytest.mark.parametrize("scheme", CARRIED)
def test_a_rigid_motion_with_a_grip_has_half_m_v_squared(kind: str, scheme: str):
    """Fails if the nodes that a grip carries are left out of the kinetic energy, or work is seen where none is done."""
    made, state, exact = carried(kind, scheme, 0.0)
    assert state.ledger.kinetic == pytest.approx(exact, rel=1e-12) == state.ledger.initial
    for _ in range(3):
        made.step(state)
        assert state.ledger.kinetic == pytest.approx(exact, rel=1e-9)
        assert abs(state.ledger.work) < 1e-9 * exact and abs(state.ledger.balance) < 1e-12 * exact


@pytest.mark.parametrize("scheme", CARRIED)
def test_mass_that_goes_takes_its_half_v_squared(kind: str, scheme: str):
    """Fails if the sink takes another kinetic energy of nodes that a grip carries than the body loses there: without
    stress both together remain m v^2/2, and the ledger closes."""
    made, state, exact = carried(kind, scheme, 1.1)
    for _ in range(3):
        made.step(state)
    space, ledger = made.space, state.ledger
    gamma = float(np.einsum("eq,eq->", space.w, space.at_gauss(state.gamma)) / space.V.sum())
    assert 0.1 < gamma < 0.95 and not state.deleted.any()
    assert ledger.kinetic == pytest.approx(gamma * exact, rel=1e-9)
    assert ledger.sink_kinetic == pytest.approx((1 - gamma) * exact, rel=1e-9)
    assert abs(ledger.balance) < 1e-9 * exact and abs(ledger.work) < 1e-9 * exact


@pytest.mark.parametrize("scheme", CARRIED)
def test_a_grip_that_starts_off_works_on_what_it_holds(kind: str, scheme: str):
    """Fails if what held nodes gain in kinetic energy, as their grip changes its velocity at once, is not its work."""
    space = box(kind, 3 if kind == "quad" else 2, 0.2)
    momentum, density = Momentum(space, AAA(bulk_modulus=5.0)), DensitySolver(space, SinkLaw(phi=1e3))
    course, half = (Ramp((0.0, 1e-7, 1.1e-6), (0.0, 0.0, way)) for way in (2e-3, 1e-3))
    low, high = ends(space)
    fixed = (0.0,) * (space.dim - 2)
    loading = Loading(space, [(np.flatnonzero(low), Grip("low", (half, course, *fixed))),
                              (np.flatnonzero(high), Grip("high", (0.0,) * space.dim))])
    body, state = Body(momentum, density, loading), State.intact(space)
    made = (Explicit(body, ExplicitControls(raised_mass=0.0)) if scheme == "explicit"
            else HHT(body, HHTControls(dt=5e-8, **CARRIED[scheme])))
    made.begin(state)
    assert state.ledger.kinetic == 0.0
    while state.time < 1e-7:
        made.step(state)
    v = np.where(low[:, None], np.array([1e3, 2e3, 0.0][:space.dim]), 0.0)
    np.testing.assert_allclose(state.v, v, atol=1e-9)
    lumped = 0.5 * float(momentum.lumped_mass(0.0) @ np.einsum("ni,ni->n", v, v))
    at_gauss = np.einsum("qa,eai->eqi", space.N, v[space.conn])
    consistent = 0.5 * momentum.rho0 * float(np.einsum("eq,eqi,eqi->", space.w, at_gauss, at_gauss))
    exact = consistent if "consistent" in scheme else lumped
    assert state.ledger.kinetic == pytest.approx(exact, rel=1e-9) == state.ledger.work
    for _ in range(4):
        made.step(state)
    assert state.ledger.work > 1.001 * exact and abs(state.ledger.balance) < 1e-9 * exact
