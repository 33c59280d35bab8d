"""Ramps and dead tractions: their nodal forces, the load path they make, and the energy they bring in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bodies import Loadable, Weight, box, ends, notched, wavy
from dissipation import Energies
from guarded import NOTCHED, PLAIN, Stop, simulation

from skfsink.errors import ConvergenceError, Interrupted, MeshError, ParameterError
from skfsink.fem.space import Space
from skfsink.fields.body import Body
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.fields.state import State
from skfsink.loads.grips import Grip, Ramp, Traction
from skfsink.loads.schedule import Loading
from skfsink.material import AAA, SinkLaw
from skfsink.methods.controls import ExplicitControls, HHTControls
from skfsink.methods.explicit import Explicit
from skfsink.methods.hht import HHT
from skfsink.methods.statics import Statics
from skfsink.results.history import History
from skfsink.run.display import Display
from skfsink.run.simulate import Simulation
from skfsink.run.verdict import verdict
from skfsink.scene.controls import Controls
from skfsink.scene.scene import Scene

TOUGH = SinkLaw(phi=1e3)  # never reached: gamma stays 1
FINE = {"force_tolerance": 1e-8, "correction_tolerance": 1e-8, "gamma_tolerance": 1e-7, "max_iterations": 40}


class Loaded(Loadable):
    """A body with grips and tractions on its sides, and the two fields."""

    def __init__(self, space: Space, grips: tuple[Grip, ...], tractions: tuple[Traction, ...] = (),
                 law: SinkLaw = TOUGH, **controls: Any) -> None:
        super().__init__(space, Loading(space, [(side(space, g.boundary), g) for g in grips],
                                        [(side(space, t.boundary), t) for t in tractions]), AAA(), law, **controls)


def side(space: Space, name: str) -> np.ndarray:
    """Nodes of a side: "x-", "x+", "y-" and so on."""
    return np.flatnonzero(ends(space, "xyz".index(name[0]))["-+".index(name[1])])


def rollers(dim: int) -> tuple[Grip, ...]:
    """The sides at x = 0, y = 0 (and z = 0) held against their own direction."""
    return tuple(Grip("xyz"[i] + "-", tuple(0.0 if j == i else None for j in range(dim))) for i in range(dim))


def pulled(law: SinkLaw | None = None, rate: float = 0.1, **controls: Any) -> Loaded:
    """A notched plate clamped at the bottom and pulled at the top by a traction."""
    return Loaded(notched(9), (Grip("y-", (0.0, 0.0)),), (Traction("y+", (0.0, rate)),), law or SinkLaw(), **controls)


# --- nodal forces ---
@pytest.mark.parametrize("kind", ["quad", "hex"])
def test_nodal_forces_have_the_resultant_and_the_moment_of_the_traction(kind: str) -> None:
    """Fails if a facet is missed, counted twice, or weighted unevenly on a distorted side."""
    space = box(kind, 3, 0.25, 2.0)
    dim, size = space.dim, 2.0 ** (space.dim - 1)
    T = np.arange(1.0, dim + 1)
    body = Loaded(space, (Grip("y-", (0.0,) * dim),), (Traction("y+", tuple(T)), Traction("x-", (5.0,) * dim)))
    dead = body.loading.dead
    assert dead is not None
    dead.at(0.5)
    f = np.zeros_like(space.X)
    f[dead.nodes] = dead.values
    np.testing.assert_allclose(f.sum(axis=0), 0.5 * size * (T + 5.0), rtol=1e-12)
    middle = np.full(dim, 1.0)
    places = [np.where(np.arange(dim) == 1, 2.0, middle), np.where(np.arange(dim) == 0, 0.0, middle)]
    moment = sum(np.outer(x, 0.5 * size * t) for x, t in zip(places, (T, np.full(dim, 5.0))))
    np.testing.assert_allclose(space.X.T @ f, moment, rtol=1e-12)
    np.testing.assert_allclose(dead.resultant(0), 0.5 * size * T, rtol=1e-12)
    inside = np.setdiff1d(np.arange(space.n_nodes), np.union1d(side(space, "y+"), side(space, "x-")))
    assert (f[inside] == 0).all()


@pytest.mark.parametrize("kind", ["quad", "hex"])
def test_net_force_is_the_derivative_of_the_potential(kind: str) -> None:
    """Fails if force and potential of the dead loads do not belong together, which Newton's line search relies on."""
    space = box(kind, 3)
    body = Loaded(space, (Grip("y-", (0.0,) * space.dim),), (Traction("y+", (0.3, 0.7, -0.2)[:space.dim]),))
    momentum, u, v = body.momentum, wavy(space, 0.1), wavy(space, 1.0, 5)
    momentum.set_time(2.0)
    slope = float(np.vdot(momentum.force(u), v))
    sides = []
    for eps in (1e-5, -1e-5):
        momentum.force(u + eps * v)
        sides.append(momentum.potential)
    assert (sides[0] - sides[1]) / 2e-5 == pytest.approx(slope, rel=1e-7)
    assert momentum.potential != momentum.energy


def test_elements_that_are_gone_bear_no_load() -> None:
    """Fails if a traction acts on material that has no force left, or if its going is not booked as work."""
    body = pulled()
    space, state, momentum, dead = body.space, body.state, body.momentum, body.loading.dead
    assert dead is not None
    momentum.set_time(1.0)
    whole = dead.resultant(0)
    state.deleted[dead.elements[:3]] = True
    momentum.set_gamma(state.gamma, state.deleted)
    np.testing.assert_allclose(dead.resultant(0), whole * 6 / 9, rtol=1e-12)
    state.deleted[:] = False
    gamma = np.where(np.isin(np.arange(space.n_nodes), space.conn[dead.elements[0]]), 1e-5, 1.0)
    momentum.set_gamma(gamma, state.deleted)
    np.testing.assert_allclose(dead.resultant(0), whole * 8 / 9, rtol=1e-12)
    momentum.set_gamma(state.gamma, state.deleted)
    np.testing.assert_allclose(dead.resultant(0), whole, rtol=1e-12)


# --- statics ---
@pytest.mark.parametrize("kind", ["quad", "hex"])
def test_uniform_traction_gives_the_homogeneous_stress(kind: str) -> None:
    """Fails if a block under a uniform traction T is not stretched uniformly, with T = P_yy of the material to 1e-6."""
    space = box(kind, 4 if kind == "quad" else 2)
    dim = space.dim
    body = Loaded(space, rollers(dim), (Traction("y+", (0.0, Ramp((0.0, 2.0), (0.0, 1.2)), 0.0)[:dim]),))
    state = body.load(2.0)
    state.u, _ = body.statics.newton.equilibrium(state.u, 1e-10)  # an increment's is good to 1e-5 only
    F = np.eye(3)
    F[:dim, :dim] += np.linalg.lstsq(space.X, state.u, rcond=None)[0].T
    np.testing.assert_allclose(state.u, space.X @ (F - np.eye(3))[:dim, :dim].T, atol=2e-7)
    P = AAA().first_piola(F)
    assert F[1, 1] > 1.15 and P[1, 1] == pytest.approx(1.2, rel=1e-6)
    assert abs(P[0, 0]) < 1e-6 and (dim == 2 or abs(P[2, 2]) < 1e-6)


def test_ledger_of_the_loading_closes_as_the_trapezoidal_rule() -> None:
    """Fails if loads or work of changing dead loads are wrong: the balance falls with the square of the increment."""
    errors = []
    for increment in (0.02, 0.01, 0.005):
        body = Loaded(notched(9), (*rollers(2), Grip("x+", (0.002, None))),
                      (Traction("y+", (0.01, 0.1)),), increment=increment)
        state = body.load(2.0)
        momentum = body.momentum
        force = momentum.force(state.u)
        assert state.ledger.elastic == pytest.approx(momentum.energy, rel=1e-12)
        dead = body.loading.dead
        assert dead is not None
        assert state.ledger.loads == pytest.approx(-float((dead.values * state.u[dead.nodes]).sum()))
        assert np.linalg.norm(force.ravel()[body.loading.free]) < 1e-5 * np.linalg.norm(force)
        errors.append(abs(state.ledger.balance) / state.ledger.elastic)
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] < 1e-3 and (rates > 1.7).all(), (errors, rates)


def test_the_order_of_ramps_does_not_matter_to_an_elastic_body() -> None:
    """Fails if a ramp is followed wrongly: stretch sideways, hold, pull gives the state of pull first, then stretch."""
    early, late = Ramp((0.0, 1.0), (0.0, 0.1)), Ramp((3.0, 4.5), (0.0, 0.1))
    states = []
    for x, y in ((early, late), (late, early)):
        body = Loaded(box("quad", 5), (Grip("x-", (0.0, None)), Grip("x+", (x, None)), Grip("y-", (None, 0.0)),
                                       Grip("y+", (None, y))), increment=0.02)
        times = []
        while body.state.grip < 4.5:
            times.append(next(body.statics.load(body.state)).grip)
        assert 1.0 in times and not any(1.0 < t < 3.0 for t in times) and 3.0 not in times
        states.append(body.state)
        np.testing.assert_allclose(body.state.u[side(body.space, "x+"), 0], 0.1, rtol=1e-12)
        assert body.state.grip == 4.5
        body.load()
        assert body.statics.unfailed == "nothing moves after load time 4.5 s"
        body.state.u, _ = body.statics.newton.equilibrium(body.state.u, 1e-10)
    np.testing.assert_allclose(states[0].u, states[1].u, atol=1e-9)
    assert states[0].ledger.work == pytest.approx(states[1].ledger.work, rel=1e-3)


def test_knots_are_hit_and_slow_ramps_do_not_blur_the_onset() -> None:
    """Fails if an increment passes a knot, or if a long hold widens the tolerance of the onset."""
    way = (0.0, 0.02, 0.02, 1.0)
    plain = Loaded(notched(9), (Grip("y+", (0.0, 1e-3)), Grip("y-", (0.0, 0.0))), law=SinkLaw())
    held = Loaded(notched(9), (Grip("y+", (0.0, Ramp((0.0, 7.0, 7e4, 7e4 + 1), way))), Grip("y-", (0.0, 0.0))),
                  law=SinkLaw())
    opening = plain.load().grip * 1e-3
    times = [state.grip for state in held.statics.load(held.state)]
    assert 7.0 in times and min(t for t in times if t > 7.0) > 7e4
    found = float(held.state.u[side(held.space, "y+"), 1].max())
    assert found == pytest.approx(opening, rel=2e-3)
    grown = held.statics.clock.grown(held.state.grip, 0.01)
    assert grown - 7e4 == pytest.approx((1.01 * found - 0.02) / 0.98, rel=1e-6)


def test_loads_that_end_without_an_onset_are_reported() -> None:
    """Fails if a body that holds is loaded for ever, or ends without saying when."""
    body = Loaded(notched(9), (Grip("y-", (0.0, 0.0)),), (Traction("y+", (0.0, Ramp((0.0, 2.0), (0.0, 0.05)))),),
                  law=SinkLaw())
    body.load()
    assert body.statics.unfailed == "nothing moves after load time 2 s"
    assert body.state.grip == 2.0 and body.statics.loading.knot(2.0) == np.inf


# --- the event ---
@pytest.mark.parametrize("integrator", ["explicit", "hht"])
def test_suddenly_loaded_body_swings_about_the_static_solution(integrator: str) -> None:
    """Fails if a sudden load of T does not swing the mass between 0 and twice the static displacement, or the ledger
    opens: one element, two nodes that move together, linear."""
    T, space = 1e-5, box("quad", 1, 0.0)
    body = Loaded(space, (Grip("y-", (0.0, 0.0)), Grip("x-", (0.0, None)), Grip("x+", (0.0, None))),
                  (Traction("y+", (0.0, Ramp((0.0, 1.0), (0.0, T)))),))
    static = body.load(1.0).u[2:, 1].max()
    state = State.intact(space)
    state.grip = 1.0
    mass = body.momentum.lumped_mass(1e-9)
    period = 2 * np.pi * float(np.sqrt(mass[side(space, "y+")].sum() * static / T))
    steps = 200
    scheme: Explicit | HHT
    if integrator == "explicit":
        scheme = Explicit(body.body, ExplicitControls(gamma_every=10**6))
        scheme.length.fix(period / steps)
    else:
        scheme = HHT(body.body, HHTControls(alpha=0.0, dt=period / steps, force_tolerance=1e-9,
                                            correction_tolerance=1e-9))
    scheme.begin(state)
    swing = []
    for _ in range(2 * steps):
        scheme.step(state)
        swing.append(float(state.u[side(space, "y+"), 1].mean()))
        assert abs(state.ledger.balance) < 1e-7 * T * static
    expected = static * (1 - np.cos(2 * np.pi * np.arange(1, 2 * steps + 1) / steps))
    np.testing.assert_allclose(swing, expected, atol=3e-3 * static)
    assert max(swing) == pytest.approx(2 * static, rel=1e-3)
    assert state.ledger.loads == pytest.approx(-T * swing[-1], rel=1e-9, abs=1e-12 * T * static)


@pytest.mark.parametrize("integrator", ["explicit", pytest.param("hht", marks=pytest.mark.slow)])
def test_plate_torn_by_a_traction_closes_its_ledger(integrator: str) -> None:
    """Fails if an entry of the event's ledger is wrong: dead loads follow a fast ramp with a knot while a crack runs.

    The load is dropped to half within the event; grips take a jump of their velocity at a knot. HHT does not count the
    kinetic energy of what is held, so that its grips are slow.
    """
    way, allowed = (3e-4, 1e-10) if integrator == "explicit" else (3e-6, 1e-8)
    quick = Ramp((0.0, 1.0, 1.0 + 1e-5, 1.0 + 2e-5), (0.0, 0.5, 0.5, 0.25))
    push = Ramp((0.0, 1.0 + 1e-5, 1.0 + 1.3e-5, 2.0), (0.0, 0.0, way, way))
    grips = *rollers(2), Grip("x+", (push, None))
    body = Loaded(notched(9), grips, (Traction("y+", (0.0, quick)),), law=SinkLaw(phi=0.1))
    state = body.load()
    assert state.grip < 1.0 and state.gamma.min() < 0.99
    body.start(0.01)
    state.grip = 1.0
    scheme: Explicit | HHT = (Explicit(body.body) if integrator == "explicit"
                              else HHT(body.body, HHTControls(dt=4e-7, **FINE)))
    scheme.begin(state)
    scale, energies = state.ledger.elastic, Energies(body.body)
    assert state.ledger.initial == pytest.approx(scale + state.ledger.loads + state.ledger.kinetic)
    times, moments = [], [energies.of(state)]
    for _ in scheme.run(state, 2.5e-5):
        moments.append(energies.of(state))
        assert abs(state.ledger.balance) <= allowed * scale
        times.append(state.grip)
        x = state.u[side(body.space, "x+"), 0]
        np.testing.assert_allclose(x, push.value(state.grip), atol=1e-10)
    assert {1.0 + 1e-5, 1.0 + 1.3e-5, 1.0 + 2e-5} <= set(times)
    assert state.deleted.sum() > 3 and state.ledger.sink > 0.1 * scale and state.ledger.loads < 0
    assert state.ledger.sink == pytest.approx(sum(energies.taken(moments)), rel=0.03)
    assert abs(state.ledger.numerical) < (0.05 if integrator == "explicit" else 0.2) * scale  # HHT damps the jumps


@pytest.mark.parametrize("integrator", ["explicit", "hht", "single"])
def test_loaded_side_that_fails_drops_its_load(integrator: str) -> None:
    """Fails if elements that die under their traction are torn away by it, or if the ledger opens as it goes."""
    body = pulled()
    dead, state = body.loading.dead, body.load(0.5)
    assert dead is not None
    body.start(0.0)
    state.W_max[dead.elements[:2]] = 1.0  # of which nothing is left at the next density solve
    scheme: Explicit | HHT = Explicit(body.body) if integrator == "explicit" else HHT(body.body, HHTControls(
        dt=2e-7, coupling="single" if integrator == "single" else "iterated", **FINE))
    scheme.begin(state)
    scale, full, work = state.ledger.elastic, dead.resultant(0)[1], state.ledger.work
    for _ in scheme.run(state, 4e-6):
        assert abs(state.ledger.balance) <= (1e-10 if integrator == "explicit" else 1e-7) * scale
    lost = full - dead.resultant(0)[1]
    assert state.deleted.sum() >= 2 and lost == pytest.approx(full * 2 / 9, rel=1e-4)
    assert 0.0 < state.ledger.work - work < 4 * lost * np.abs(state.u).max()
    assert np.abs(state.u).max() < 0.2


def scene(tractions: tuple[Traction, ...] = (), grips: tuple[Grip, ...] = (Grip("bottom", (0.0, 0.0)),),
          **controls: Any) -> Scene:
    """The notched block of the guards, loaded otherwise."""
    controls = {"event_time": 4e-5, "overshoot": 0.01, "checkpoint_every": 1e6, "frame_every": 1e-3, **controls}
    sample = NOTCHED.sample
    sample = replace(sample, boundaries={**sample.boundaries, "right": side(sample.space, "x+")})
    return Scene("block", "Block", {"mesh": ""}, sample, AAA(), SinkLaw(), grips, tractions,
                 controls=Controls(**controls))


PULL = (Traction("top", (0.0, 0.1)),)


def test_run_under_a_traction(tmp_path: Path) -> None:
    """Fails if a plate that is pulled does not crack, its ledger does not close, or load and displacement are not those
    of the traction."""
    sim = simulation(scene(PULL), tmp_path)
    state = sim.run()
    table = History.load(tmp_path / "history.csv")
    loading = table["phase"] == "loading"
    assert state.deleted.sum() > 10 and sim.crack.tracker.arrival is not None
    np.testing.assert_allclose(table["reaction_N_per_mm"][loading], 0.1 * table["time_s"][loading], rtol=1e-12)
    assert (np.diff(table["grip_displacement_mm"][loading]) > 0).all()
    assert np.abs(table["balance"][~loading]).max() < 1e-9 * table["elastic"][loading][-1]
    assert abs(table["balance"][loading][-1]) < 0.01 * table["elastic"][loading][-1]
    assert (table["loads"] < 0).all() and table.units["loads"] == "N mm/mm"
    external = sim.onset.figures["work"]
    assert external == pytest.approx(float(-np.trapezoid(table["grip_displacement_mm"][loading],
                                                         table["reaction_N_per_mm"][loading])), rel=0.05)


def test_sweeps_under_traction_and_grips(tmp_path: Path) -> None:
    """Fails if a quasi-static crack under a dead load from the side loses energy, or if one under dead loads alone,
    which has no equilibrium, is not refused."""
    small = Ramp((0.0, 1.0), (0.0, 0.02))
    side_load = (Traction("top", (0.0, small)), Traction("right", (small, 0.0)))
    grips = (Grip("top", (0.0, Ramp((1.0, 2.0), (0.0, 0.4)))), Grip("bottom", (0.0, 0.0)))
    sim = simulation(scene(side_load, grips, analysis="quasistatic"), tmp_path / "mixed")
    state = sim.run()
    ledger, scale = state.ledger, sim.onset.figures["elastic_energy"]
    assert sim.crack.tracker.arrival is not None and ledger.released > 0.1 * scale
    assert abs(ledger.balance) < 1e-9 * scale
    with pytest.raises(ConvergenceError, match="the history follows equilibria only: a body that tractions tear"):
        simulation(scene(PULL, analysis="quasistatic"), tmp_path / "dead").run()


@pytest.mark.parametrize("integrator", ["explicit", pytest.param("hht", marks=pytest.mark.slow)])
@pytest.mark.parametrize("stop", [3, pytest.param(40, marks=pytest.mark.slow)])
def test_resumed_in_the_middle_of_a_ramp(integrator: str, stop: int, tmp_path: Path) -> None:
    """Fails if a checkpoint misses the place on a ramp: the resumed run writes the same bytes."""
    quick = Ramp((0.0, 1.0, 3.0, 9.0, 9.0 + 1e-5), (0.0, 0.05, 0.05, 0.65, 0.7))
    of = scene((Traction("top", (Ramp((0.0, 2.0), (0.0, 0.02)), quick)),), integrator=integrator, event_time=1e-5)
    whole = simulation(of, tmp_path / "whole")
    whole.run()
    broken = simulation(of, tmp_path / "broken", Stop(stop))
    with pytest.raises(Interrupted):
        broken.run()
    resumed = Simulation(of, tmp_path / "broken", Display(True), resume=True)
    assert resumed.state.phase == ("loading" if stop == 3 else "event")
    state = resumed.run()
    assert (tmp_path / "whole" / "history.csv").read_bytes() == (tmp_path / "broken" / "history.csv").read_bytes()
    np.testing.assert_array_equal(state.u, whole.state.u)
    assert state.ledger == whole.state.ledger and state.ledger.work != 0.0


# --- what is reported ---
def test_load_is_that_of_the_first_grip_that_moves(tmp_path: Path) -> None:
    """Fails if a grip at rest is taken for the load, or a ramp's displacement for that of a constant velocity."""
    still = Grip("bottom", (0.0, 0.0))
    for velocity, grips in ((1e-3, "ts"), (1e-3, "st"), (Ramp((0.0, 1.0, 2.0), (0.0, 0.0, 0.002)), "st")):
        moving = Grip("top", (0.0, velocity))
        of = replace(scene(), grips=tuple(moving if g == "t" else still for g in grips))
        sim = simulation(of, tmp_path / "run")
        for state in sim.statics.load(sim.state):
            if state.grip >= 2.0:
                break
        gauge = sim.view.gauge
        assert of.moving is moving and of.opposite is (still if grips == "ts" else None)
        assert gauge.displacement(state) == pytest.approx(1e-3 * state.grip, rel=1e-9)
        force = sim.momentum.force(state.u)
        load = gauge.load(force, state.u)
        assert load == pytest.approx(float(force[of.sample.nodes("top"), 1].sum()), rel=1e-12) and load > 0


def test_histories_of_before_have_no_loads(tmp_path: Path) -> None:
    """Fails if a history without the column is refused, or its loads are not zero."""
    history = History(tmp_path / "history.csv", [{"phase": "event", "elastic": 2.0, "kinetic": 3.0}], 3)
    header, row = (line.split(",") for line in history.path.read_text().splitlines())
    at = header.index("loads_N_mm")
    assert row[at] == "0.0"
    del header[at], row[at]
    history.path.write_text(",".join(header) + "\n" + ",".join(row) + "\n")
    table = History.load(history.path)
    assert (table.dim, table["loads"][0], table["elastic"][0], table["kinetic"][0]) == (3, 0.0, 2.0, 3.0)


# --- refusals ---
def test_ramps_that_jump_are_refused() -> None:
    """Fails if a ramp may begin away from zero, where no equilibrium path leads."""
    with pytest.raises(ParameterError, match=r"^a ramp must be 0 at time 0; got 0\.3"):
        Ramp((0.0, 1.0), (0.3, 1.0))


@pytest.mark.parametrize(("grips", "part"), [
    ((), "no grip holds the body in x"),
    ((Grip("bottom", (None, 0.0)),), "no grip holds the body in x"),
    ((Grip("pin", (0.0, 0.0)),), "the grips let the body turn"),
    ((Grip("bottom", (0.0, 0.0, 0.0)),), "grip bottom must have 2 components, as the mesh; got 3")])
def test_bodies_that_a_traction_would_carry_away_are_refused(grips: tuple[Grip, ...], part: str) -> None:
    """Fails if a body that is not held is given to Newton's method."""
    with pytest.raises(ParameterError, match=f"^{part}"):
        scene(PULL, grips)


def test_tractions_need_facets_and_as_many_components_as_the_mesh() -> None:
    """Fails if a traction acts nowhere, silently, or is read as of another dimension."""
    with pytest.raises(MeshError, match=r"^no traction can act on boundary 'pin'"):
        scene((Traction("pin", (0.0, 1.0)),))
    with pytest.raises(ParameterError, match=r"^the traction on top must have 2 components"):
        scene((Traction("top", (0.0, 1.0, 0.0)),))
    with pytest.raises(ParameterError, match=r"^start rest is for grips of constant velocity; .* has tractions"):
        scene(PULL, start="rest")


def test_scene_in_which_nothing_moves_says_so(tmp_path: Path) -> None:
    """Fails if a body without load divides by zero, or is loaded for ever."""
    still = replace(scene(), sample=PLAIN)
    run = simulation(still, tmp_path)
    assert run.run().phase == "done"
    assert verdict(still, run).startswith("nothing failed: the greatest W/Phi was 0, at ")
    assert verdict(still, run).endswith("the loading ended because nothing moves after load time 0 s")


# --- loads of other kinds ---
@pytest.mark.parametrize("kind", ["quad", "hex"])
def test_a_hanging_body_bears_its_weight(kind: str) -> None:
    """Fails if a load of another kind is left out of balance or ledger, alone or beside others: its top holds it."""
    space = box(kind, 3, 0.1)
    up = "xyz"[space.dim - 1]
    grips = (Grip(f"{up}+", (0.0,) * space.dim),)
    pull = Traction(f"{up}-", (*[0.0] * (space.dim - 1), -1e-3))
    for tractions, others, force in (((), [Weight(space, 2e-3)], 2e-3), ((pull,), [Weight(space, 2e-3)], 3e-3),
                                     ((), [Weight(space, 1e-3), Weight(space, 1e-3)], 2e-3)):
        loading = Loading(space, [(side(space, g.boundary), g) for g in grips],
                          [(side(space, t.boundary), t) for t in tractions], others)
        momentum = Momentum(space, AAA(), dead=loading.dead)
        statics = Statics(Body(momentum, DensitySolver(space, TOUGH), loading))
        state = State.intact(space)
        for _ in statics.load(state):
            if state.grip >= 10.0:
                break
        expected = np.zeros(space.dim)
        expected[-1] = force * state.grip  # a box of side 1
        top = side(space, f"{up}+")
        settled = statics.equilibrium(state.u)[0]  # a first pass of the loading may leave more, up to 1e-5
        for u, left in ((state.u, 1e-5), (settled, 1e-6)):
            held = momentum.force(u)[top].sum(axis=0)
            np.testing.assert_allclose(held, expected, atol=left * force * state.grip)
        assert abs(state.ledger.balance) < 5e-3 * state.ledger.elastic and state.ledger.loads < 0


def test_weight_of_failed_elements_is_gone() -> None:
    """Fails if elements without force still bear a load."""
    space = box("quad", 4, 0.0)
    top = side(space, "y+"), Grip("y+", (0.0, 0.0))
    loading = Loading(space, [top], (), [Weight(space, 1.0), Weight(space, 1.0)])
    momentum, state = Momentum(space, AAA(), dead=loading.dead), State.intact(space)
    momentum.set_time(1.0)
    state.deleted[:4] = True
    momentum.set_gamma(state.gamma, state.deleted)
    assert loading.dead is not None
    assert loading.dead.values.sum() == pytest.approx(-2.0 * (1 - 4 / 16))
