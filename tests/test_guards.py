"""Every guard of a run: it speaks just past its threshold, is silent before it, and its message names the cure."""

from __future__ import annotations

import dataclasses
import logging
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import skfem

from skfsink.density import DensitySolver
from skfsink.energy import Ledger
from skfsink.errors import ConvergenceError, InstabilityError, ParameterError
from skfsink.explicit import Explicit, ExplicitControls
from skfsink.guards import Guard, Notes
from skfsink.hht import HHTControls
from skfsink.material import AAA, SinkLaw
from skfsink.momentum import Momentum
from skfsink.progress import Display
from skfsink.result import summarize
from skfsink.sample import Sample
from skfsink.scene import Controls, Scene
from skfsink.simulate import Simulation, onset_copy
from skfsink.space import Space
from skfsink.state import State
from skfsink.statics import Statics, StaticsControls
from skfsink.study.blocks import block
from skfsink.study.body import PULLED, Body

MU = AAA().shear_modulus
PLAIN = block(15)      # h = l/1.5, without a notch: nothing to warn of
NOTCHED = Body(block(15, notch=0.4, width=0.06))
SHARP = r"a notch turns by 90 degrees"  # what a notch cut out of rows of elements always gives


def scene(sample: Sample = PLAIN, material: AAA | None = None, law: SinkLaw | None = None, **controls: Any) -> Scene:
    """A block between grips."""
    return Scene("block", "Block", {}, sample, material or AAA(), law or SinkLaw(), PULLED,
                 controls=Controls(**controls))


class Watched:
    """A guard with a state in order: intact, a little stretched, a closed ledger with an energy of 1 at the onset."""

    def __init__(self, of: Scene | None = None, stretch: float = 0.01) -> None:
        self.scene = of or scene()
        space = self.scene.sample.space
        self.momentum = Momentum(space, self.scene.material, self.scene.controls.element)
        self.guard = Guard(self.scene, self.momentum)
        self.guard.scale = 1.0
        self.state = State.intact(space)
        self.state.phase = "event"
        self.state.u = space.X * (np.array([1 / (1 + stretch), 1 + stretch]) - 1)
        self.state.ledger.initial = self.state.ledger.elastic = 1.0
        self.update()

    def update(self) -> None:
        """Evaluate the force."""
        self.momentum.set_gamma(self.state.gamma, self.state.deleted)
        self.momentum.force(self.state.u)


def simulation(of: Scene, folder: Path) -> Simulation:
    """A run of a scene in a folder."""
    folder.mkdir(exist_ok=True)
    return Simulation(of, folder, Display(True))


def event(folder: Path, **controls: Any) -> Simulation:
    """A run of the notched block from its onset on, not yet started."""
    controls = {"event_time": 1e-5, "overshoot": 0.01, "checkpoint_every": 1e6, **controls}
    return simulation(dataclasses.replace(NOTCHED.scene, controls=Controls(**controls)), folder)


# --- warnings ---
def test_a_warning_is_shown_once_and_kept(caplog: pytest.LogCaptureFixture):
    """Fails if a warning is repeated with other numbers, lost on resuming, or taken from a run that is over."""
    shown: list[str] = []
    log = logging.getLogger("skfsink.some.module")
    with Notes(shown.append) as notes:
        for h in (1, 2):
            log.warning("h is %d", h)
        log.warning("another")
        log.info("no warning")
    log.warning("too late")
    assert notes.texts == ["h is 1", "another"] and shown == ["warning: h is 1", "warning: another"]
    with Notes(shown.append, notes.kept) as resumed:
        log.warning("h is %d", 3)
        log.warning("a third")
    assert resumed.texts == ["h is 1", "another", "a third"] and shown[2:] == ["warning: a third"]
    assert logging.getLogger("skfsink").handlers == []


GRADED = np.concatenate([np.linspace(0, 0.5, 11), np.linspace(0.5, 1, 4)[1:]])


def coarse_right() -> Sample:
    """Elements of 0.05 mm on the left, of 0.17 mm on the right."""
    space = Space(skfem.MeshQuad.init_tensor(GRADED, np.linspace(0, 1, 11)))
    y = space.X[:, 1]
    return Sample("graded", space, {"top": np.flatnonzero(y > 1 - 1e-9), "bottom": np.flatnonzero(y < 1e-9)})


@pytest.mark.parametrize(("of", "message"), [
    (lambda: scene(), None),
    (lambda: scene(element="plain"), r"plain element locks at k/mu = 405.* take --element jbar"),
    (lambda: scene(material=AAA(bulk_modulus=49 * MU), element="plain"), None),
    (lambda: scene(material=AAA(bulk_modulus=1.9e4 * MU)), None),
    (lambda: scene(material=AAA(bulk_modulus=1e5 * MU)), r"k/mu = 1e\+05 is so large .* --bulk-modulus 1.23e\+03"),
    (lambda: scene(block(12)), None),
    (lambda: scene(block(11)), r"no element is finer than h = 0.0909 mm, l/h = 1.10 .* refine it to h <= l/3"),
    (lambda: scene(block(16, notch=0.4, width=0.0)), r"a notch turns by 180 degrees at one node, at \(0.375, 0.5\)"),
    (lambda: scene(block(15, notch=0.4, width=0.06)), SHARP + r".* round it with at least 4 elements"),
])
def test_scene_beyond_the_methods_is_warned_of(of: Callable[[], Scene], message: str | None,
                                               caplog: pytest.LogCaptureFixture):
    """Fails if a guard before the run is gone, speaks within the range of the methods, or names no cure."""
    Watched(of()).guard.check_scene()
    assert len(caplog.messages) == (message is not None)
    if message:
        assert re.search(message, caplog.messages[0]), caplog.messages


def test_onset_in_coarse_elements_is_warned_of(caplog: pytest.LogCaptureFixture):
    """Fails if the size of elements is not looked at where failure begins."""
    watched = Watched(scene(coarse_right()))
    left, right = (np.flatnonzero(np.isclose(watched.scene.sample.space.X[:, 0], x))[5] for x in (0.0, 1.0))
    watched.state.gamma[left] = 0.9
    watched.guard.check_onset(watched.state)
    assert not caplog.messages
    watched.state.gamma[right] = 0.8
    watched.guard.check_onset(watched.state)
    assert "where it begins to fail, at (1, 0.5) mm" in caplog.text and "refine it there to h <= l/3" in caplog.text


def test_alternating_pressures_are_warned_of(caplog: pytest.LogCaptureFixture):
    """Fails if a checkerboard in the pressures of an onset is not seen, or a smooth pressure is taken for one."""
    watched = Watched()
    X = watched.scene.sample.space.X
    watched.state.u += 1e-3 * np.column_stack([np.sin(2 * X[:, 0]), X[:, 1] ** 2])  # pressures up to 1 MPa, smooth
    watched.guard.check_onset(watched.state)
    assert not caplog.messages
    i, j = np.rint(X * 15).astype(int).T
    watched.state.u[:, 0] += 2e-4 * np.where((i // 1 + j // 2) % 2, 1, -1)
    watched.guard.check_onset(watched.state)
    assert "a checkerboard" in caplog.text and "break up the rows of the mesh" in caplog.text


def set_ledger(**entries: float) -> Callable[[Watched], None]:
    """Changes entries of the ledger."""
    return lambda watched: [setattr(watched.state.ledger, name, value) for name, value in entries.items()] and None


def shares(numerical: float = 0.0, deletion: float = 0.0) -> Callable[[Watched], None]:
    """Moves energy into `numerical` or `deletion`; the ledger stays closed."""
    return set_ledger(elastic=1 - numerical - deletion, numerical=numerical, deletion=deletion)


def mirrored(gamma: float) -> Callable[[Watched], None]:
    """Turns one element of that relative density inside out."""
    def change(watched: Watched) -> None:
        space, state = watched.scene.sample.space, watched.state
        nodes = space.conn[112]
        state.gamma[nodes] = gamma
        state.u[nodes, 0] = (space.X[nodes, 0].mean() - space.X[nodes, 0]) * 2.5
        watched.update()
    return change


def fields(value: float, share: float = 1.0) -> Callable[[Watched], None]:
    """Sets gamma to a value in a part of the body."""
    def change(watched: Watched) -> None:
        watched.state.gamma[: int(share * len(watched.state.gamma))] = value
        watched.update()
    return change


def pressed(watched: Watched) -> None:
    """Presses the body to a tenth of its volume."""
    watched.state.u = watched.scene.sample.space.X * (-0.75, -0.5)
    watched.update()


def broken_number(watched: Watched) -> None:
    """A displacement that is no number."""
    watched.state.u[3, 1] = np.nan


def failed(count: int) -> Callable[[Watched], None]:
    """Deletes that many elements."""
    def change(watched: Watched) -> None:
        watched.state.deletions = [(0.0, e) for e in range(count)]
    return change


@pytest.mark.parametrize(("change", "message"), [
    (set_ledger(numerical=-0.049), None),
    (set_ledger(numerical=-0.051), r"energy fed in by the integrator 5.10% .* lower --courant \(now 0.8\)"),
    (set_ledger(numerical=np.nan), r"energy fed in by the integrator nan%"),
    (set_ledger(kinetic=np.inf), r"energy fed in by the integrator"),
    (failed(20), None),
    (failed(21), r"21 of 225 elements failed in one step at t = 0 s, allowed 20: .* lower --courant"),
    (mirrored(0.3), None),
    (mirrored(0.6), r"Gauss point\(s\) with a relative density of up to 0.6. are inside out .* refine the mesh there"),
])
def test_steps_are_watched(change: Callable[[Watched], None], message: str | None):
    """Fails if a guard of every step is gone, or stops a run below its tolerance."""
    watched = Watched()
    watched.guard.check_step(watched.state)
    change(watched)
    if message is None:
        watched.guard.check_step(watched.state)
    else:
        with pytest.raises(InstabilityError, match=message):
            watched.guard.check_step(watched.state)


@pytest.mark.parametrize(("change", "message"), [
    (set_ledger(elastic=1.049), None),
    (set_ledger(elastic=1.051), r"energy balance error 5.10% .* allowed 5.00%: lower --courant .* --balance-tolerance"),
    (set_ledger(elastic=0.949), r"energy balance error"),
    (set_ledger(elastic=np.nan), r"energy balance error nan%"),
    (shares(deletion=0.049), None),
    (shares(deletion=0.051), r"energy lost in deleted elements 5.10% .* lower --deletion .* raise --force-floor"),
    (broken_number, r"a field is not finite at t = 0 s: lower --courant"),
    (fields(1e-15, 0.7), None),
    (fields(1e-15, 0.9), r"less than 20% of the body is left .* dies of a bad state"),
    (mirrored(0.6), r"inside out \(J <= 0\)"),
])
def test_records_are_watched(change: Callable[[Watched], None], message: str | None):
    """Fails if a guard of the records is gone, or stops a run below its tolerance."""
    watched = Watched()
    change(watched)
    if message is None:
        watched.guard.check_record(watched.state)
    else:
        with pytest.raises(InstabilityError, match=message):
            watched.guard.check_record(watched.state)


@pytest.mark.parametrize(("change", "message"), [
    (lambda watched: None, ""),
    (shares(deletion=0.009), ""),
    (shares(deletion=0.011), r"elements were deleted with 0.011 of the onset energy still in them"),
    (shares(numerical=0.049), ""),
    (shares(numerical=0.051), r"the time integration itself has dissipated 0.051"),
    (fields(-1e-7, 0.01), ""),
    (fields(-0.04, 0.01), r"falls to -0.04: the lumped sink has no maximum principle.* --sink lumped"),
    (mirrored(0.3), r"damaged Gauss point\(s\) are inside out .* raise --force-floor"),
    (pressed, r"compressed to J = 0.12 .* refine the mesh"),
])
def test_records_are_warned_of(change: Callable[[Watched], None], message: str, caplog: pytest.LogCaptureFixture):
    """Fails if a warning of the records is gone, or speaks below its threshold."""
    watched = Watched()
    change(watched)
    watched.guard.check_record(watched.state)
    assert len(caplog.messages) == bool(message), caplog.messages
    assert re.search(message, caplog.text)


def test_crack_in_coarse_elements_is_warned_of(caplog: pytest.LogCaptureFixture):
    """Fails if a crack that leaves the fine part of the mesh is not noticed."""
    watched = Watched(scene(coarse_right()))
    space = watched.scene.sample.space
    x = space.X[space.conn].mean(axis=1)[:, 0]
    watched.state.deleted[np.flatnonzero(x < 0.5)[:20]] = True
    watched.guard.check_record(watched.state)
    assert not caplog.messages
    watched.state.deleted[np.flatnonzero(x > 0.5)[:6]] = True
    watched.guard.check_record(watched.state)
    assert "the crack runs through elements of h = 0.129 mm, l/h = 0.77" in caplog.text


def test_open_ledger_of_the_loading_stops_the_run():
    """Fails if dynamics starts from a loading whose work and energies do not add up."""
    watched = Watched()
    watched.state.phase = "loading"
    watched.state.ledger.initial = 0.0
    watched.state.ledger.work = 1.04
    watched.guard.check_onset(watched.state)
    watched.state.ledger.work = 1.06
    with pytest.raises(InstabilityError, match=r"ledger of the loading is open by 6.00% .* smaller load increments"):
        watched.guard.check_onset(watched.state)


@pytest.mark.parametrize(("controls", "cure"), [
    ({"explicit": ExplicitControls(courant=0.7)}, r"at t = 0 s, .*lower --courant \(now 0.7\)"),
    ({"integrator": "hht", "hht": HHTControls(dt=3e-7)}, r"at t = 0 s, .*lower --hht-dt \(now 3e-07 s\)"),
    ({"analysis": "quasistatic"}, r"at sweep 0, .*raise --front \(now 0.8\), or compute with --analysis dynamic"),
])
def test_cure_is_that_of_the_method(controls: dict[str, Any], cure: str):
    """Fails if an error tells to change an option of another method."""
    watched = Watched(scene(**controls))
    watched.guard.check_step(watched.state)
    failed(30)(watched)
    with pytest.raises(InstabilityError, match=cure):
        watched.guard.check_step(watched.state)


# --- whole runs ---
def test_too_long_a_step_stops_the_run_with_the_cure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Fails if a run whose step is too long goes on to NaN, or ends with an error that names no cure."""
    step = Explicit._set_step

    def longer(self: Explicit, state: State) -> None:
        step(self, state)
        self.dt *= 1.4 / 0.8
    monkeypatch.setattr(Explicit, "_set_step", longer)
    sim = event(tmp_path)
    with np.errstate(all="ignore"), pytest.raises(InstabilityError, match=r"energy fed in .* lower --courant"):
        sim.run(NOTCHED.onset)
    assert np.isfinite(sim.state.u).all() and sim.state.gamma.min() > 0.0


def test_run_keeps_its_warnings(tmp_path: Path):
    """Fails if summary.json does not list what was warned of, or a resumed run forgets it."""
    sim = event(tmp_path, sink="consistent")
    sim.run(NOTCHED.onset)
    expected = [SHARP, "the consistent sink varies by more than 1e3", r"falls to -0.\d+: the consistent sink"]
    for texts in (summarize(sim.scene, sim)["warnings"],
                  Simulation(sim.scene, tmp_path, Display(True), resume=True).notes.texts):
        assert len(texts) == 3
        for form in expected:
            assert any(re.search(form, text) for text in texts), form


def test_long_hht_steps_are_cut_and_said_so(tmp_path: Path):
    """Fails if a step in which a crack runs through is taken, or cut without a word."""
    sim = event(tmp_path, integrator="hht", hht=HHTControls(dt=1e-5), event_time=2e-5)
    sim.run(NOTCHED.onset)
    assert any("would let a crack run through at once" in text for text in sim.notes.texts)
    assert sim.state.deleted.mean() < 0.15


def test_unconverged_sweep_is_not_followed(monkeypatch: pytest.MonkeyPatch):
    """Fails if the history follows a state that is no equilibrium: the sweep must end the run, and change nothing."""
    state = NOTCHED.onset
    state.u *= 1.01
    state.grip *= 1.01
    state.step = 0
    before = onset_copy(state)
    statics = NOTCHED.statics()
    monkeypatch.setattr(statics, "SNAP", 1)
    with pytest.raises(ConvergenceError, match=r"sweep 1: no equilibrium within 1 Newton steps; the history follows"):
        next(statics.propagate(state))
    for name in ("u", "gamma", "W_max", "deleted"):
        np.testing.assert_array_equal(getattr(state, name), getattr(before, name))


@pytest.mark.parametrize(("most", "refused", "early", "message"), [
    (80, "runs away", 1e-3, ""),
    (20, "passes", 1e-3, ""),
    (5, "passes", 2e-2, r"the onset may be too low: .* after 5 passes .* raise max_passes"),
])
def test_onset_says_why_it_is_one(most: int, refused: str, early: float, message: str,
                                  caplog: pytest.LogCaptureFixture):
    """Fails if an iteration of the two fields that was cut short passes for the onset, or harmless ones are told."""
    statics = Statics(NOTCHED.momentum, NOTCHED.density, *NOTCHED.constraints, StaticsControls(max_passes=most))
    state = State.intact(NOTCHED.sample.space)
    for _ in statics.load(state):
        pass
    assert statics.refused == refused and len(caplog.messages) == bool(message)
    assert re.search(message, caplog.text)
    missing = 1 - state.grip / NOTCHED.onset.grip
    assert 0 <= missing < early and (missing > 5e-3) == bool(message)


def test_onset_that_is_the_end_of_newton_is_said_so(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture):
    """Fails if loading that ends because no equilibrium is found passes for the onset of failure."""
    statics = NOTCHED.statics()
    limit, newton = 0.5 * NOTCHED.onset.grip, statics.newton.equilibrium

    def ends(u: np.ndarray, *args: Any) -> Any:
        if np.abs(u).max() > 1e-3 * limit:
            raise ConvergenceError("no equilibrium")
        return newton(u, *args)
    monkeypatch.setattr(statics.newton, "equilibrium", ends)
    for _ in statics.load(State.intact(NOTCHED.sample.space)):
        pass
    assert "the onset is where Newton's method ends" in caplog.text


def test_energy_in_deleted_elements_is_booked_as_such():
    """Fails if it goes to the sink: with a high threshold and no force floor elements still bear force when deleted."""
    body = Body(NOTCHED.sample, deletion=0.3, force_floor=0.0, overshoot=0.01)
    state = body.onset
    state.u *= 1.01
    state.time, state.step, state.ledger = 0.0, 0, Ledger()
    scheme = body.explicit(ExplicitControls())
    scheme.begin(state)
    booked = 0.0
    for _ in scheme.run(state, 2e-5):
        new = [e for t, e in state.deletions if t == state.time]
        if state.ledger.deletion != booked:
            assert new
            left = body.sample.space.at_gauss(state.gamma)[new] * body.momentum.W[new] * body.sample.space.w[new]
            assert state.ledger.deletion - booked == pytest.approx(float(left.sum()), rel=1e-9)
            booked = state.ledger.deletion
        assert abs(state.ledger.balance) < 1e-10 * state.ledger.initial
    assert booked > 1e-3 * state.ledger.initial


def test_nodes_without_mass_stay_where_they_are():
    """Fails if a mass floor of zero divides by the mass of dead nodes, which bear no force either."""
    state, X = NOTCHED.onset, NOTCHED.sample.space.X
    state.gamma[np.linalg.norm(X - (0.7, 0.5), axis=1) < 0.2] = 1e-15
    state.time, state.step, state.ledger = 0.0, 0, Ledger()
    scheme = NOTCHED.explicit(ExplicitControls(mass_floor=0.0, gamma_every=10**6))
    scheme.begin(state)
    dead, u = np.argmin(np.linalg.norm(X - (0.7, 0.5), axis=1)), state.u.copy()
    assert NOTCHED.momentum.lumped_mass(0.0)[dead] == 0.0
    for _ in range(40):
        scheme.step(state)
    np.testing.assert_array_equal(state.u[dead], u[dead])
    assert np.isfinite(state.u).all() and np.isfinite(state.ledger.kinetic) and state.ledger.kinetic > 0


@pytest.mark.parametrize("sink", ["lumped", "consistent", "nearest"])
@pytest.mark.parametrize("energy", [np.nan, np.inf])
def test_energy_that_is_no_number_does_not_pass_into_the_density(sink: str, energy: float):
    """Fails if a blow-up goes on as a gamma of NaN, or as a body without the points that blew up, or has no cure."""
    W = np.full(PLAIN.space.w.shape, 0.01)
    W[7, 2] = energy
    solver = DensitySolver(PLAIN.space, SinkLaw(), sink)
    with pytest.raises(ConvergenceError, match=r"is not finite: lower --courant or --hht-dt"):
        solver.solve(W, np.ones(PLAIN.space.n_nodes))


@pytest.mark.parametrize("alpha", [-0.334, 0.001])
def test_alpha_outside_its_range_is_refused(alpha: float):
    """Fails if an alpha is taken with which the scheme is unstable, or dissipates low modes."""
    with pytest.raises(ParameterError, match=r"hht-alpha must be a finite number in \[-0.333333, 0\]"):
        HHTControls(alpha=alpha)
