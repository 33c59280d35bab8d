"""Whole runs under guard: they stop, warn and book what they should, with the cure."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from guarded import NOTCHED, PLAIN, SHARP, event, scene

from skfsink.errors import ConvergenceError, InstabilityError, ParameterError
from skfsink.fields.density import DensitySolver
from skfsink.fields.energy import Ledger
from skfsink.fields.state import State
from skfsink.material import SinkLaw
from skfsink.methods.controls import ExplicitControls, HHTControls, StaticsControls
from skfsink.methods.statics import Statics
from skfsink.methods.step_length import StepLength
from skfsink.run.display import Display
from skfsink.run.simulate import Loaded, Simulation
from skfsink.run.summarize import summarize
from skfsink.run.verdict import verdict
from skfsink.study.plate import Plate


@pytest.mark.parametrize("tolerance", [ExplicitControls.energy_tolerance, 0.0])
def test_too_long_a_step_is_cut_or_stops_the_run_with_the_cure(tolerance: float, tmp_path: Path,
                                                               monkeypatch: pytest.MonkeyPatch):
    """Fails if a run whose step is too long goes on to NaN, or ends with an error that names no cure.

    Such steps are cut; where that is turned off the guard ends the run.
    """
    look = StepLength.look

    def longer(self: StepLength, *arguments: Any) -> None:
        look(self, *arguments)
        self.dt = 1.4 / 0.8 * self.dt
    monkeypatch.setattr(StepLength, "look", longer)
    monkeypatch.setattr(StepLength, "CHECK", 1)
    sim = event(tmp_path, explicit=ExplicitControls(energy_tolerance=tolerance))
    if tolerance == 0.0:
        with np.errstate(all="ignore"), pytest.raises(InstabilityError, match=r"energy fed in .* lower courant"):
            sim.run(Loaded(NOTCHED.onset))
    else:
        sim.run(Loaded(NOTCHED.onset))
        assert abs(sim.state.ledger.numerical) < 1e-3 * sim.state.ledger.initial
        assert sim.integrator is not None and sim.integrator.rejected > 5
    assert np.isfinite(sim.state.u).all() and sim.state.gamma.min() > 0.0


def test_run_keeps_its_warnings(tmp_path: Path):
    """Fails if summary.json does not list what was warned of, or a resumed run forgets it."""
    sim = event(tmp_path, sink="consistent")
    sim.run(Loaded(NOTCHED.onset))
    expected = [SHARP, "begins to fail at a sharp corner",
                "the consistent sink varies by more than 1e3", r"falls to -0.\d+: the consistent sink"]
    for texts in (summarize(sim.scene, sim)["warnings"],
                  Simulation(sim.scene, tmp_path, Display(True), resume=True).notes.texts):
        assert len(texts) == 4
        for form in expected:
            assert any(re.search(form, text) for text in texts), form


def test_long_hht_steps_are_cut_and_said_so(tmp_path: Path):
    """Fails if a step in which a crack runs through is taken, or cut without a word."""
    sim = event(tmp_path, integrator="hht", hht=HHTControls(dt=1e-5), event_time=2e-5)
    sim.run(Loaded(NOTCHED.onset))
    assert any("would let a crack run through at once" in text for text in sim.notes.texts)
    assert sim.state.deleted.mean() < 0.15


def test_unconverged_pass_is_not_followed(monkeypatch: pytest.MonkeyPatch):
    """Fails if the history follows a state that is no equilibrium: the pass must end the run, and change nothing."""
    state = NOTCHED.onset
    state.u *= 1.01
    state.grip *= 1.01
    state.step = 0
    before = state.copy()
    statics = NOTCHED.statics()
    monkeypatch.setattr(statics, "SNAP", 1)
    with pytest.raises(ConvergenceError, match=r"pass 1: no equilibrium within 1 Newton steps; the history follows"):
        next(statics.propagate(state))
    for name in ("u", "gamma", "W_max", "deleted"):
        np.testing.assert_array_equal(getattr(state, name), getattr(before, name))


@pytest.mark.parametrize("arrived", [True, False])
def test_a_crack_that_has_arrived_ends_without_an_equilibrium(arrived: bool, tmp_path: Path,
                                                              monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if an analysis is lost whose crack has crossed the body, or goes on where one has not."""
    sim = event(tmp_path, analysis="quasistatic")
    equilibrium, tracker = sim.statics.newton.equilibrium, sim.crack.tracker

    def none(*arguments: Any, **options: Any) -> Any:
        far = tracker.arrival is not None if arrived else np.isfinite(tracker.cracked_at).any()
        if sim.state.phase == "event" and far:
            raise ConvergenceError("no equilibrium within 400 Newton steps")
        return equilibrium(*arguments, **options)

    monkeypatch.setattr(sim.statics.newton, "equilibrium", none)
    monkeypatch.setattr(tracker, "_apart", lambda _: False)  # the small block comes apart where its crack arrives
    if not arrived:
        with pytest.raises(ConvergenceError, match="no equilibrium within 400 Newton steps; the history follows"):
            sim.run()
        return
    state = sim.run()
    assert tracker.arrival == state.step and state.phase == "done"
    assert re.search(rf"^arrested at .* after it had arrived in pass {state.step}: pass {state.step + 1}: "
                     "no equilibrium within 400 Newton steps$", verdict(sim.scene, sim))
    assert abs(state.ledger.balance) < 1e-6 * state.ledger.initial
    assert summarize(sim.scene, sim)["energy"]["U_paper_at_arrival"] > 0


@pytest.mark.parametrize(("most", "refused", "early", "message"), [
    (80, "runs away", 1e-3, ""),
    (20, "passes", 1e-3, ""),
    (5, "passes", 2e-2, r"the onset may be too low: .* after 5 passes .* raise max_passes"),
])
def test_onset_says_why_it_is_one(most: int, refused: str, early: float, message: str,
                                  caplog: pytest.LogCaptureFixture):
    """Fails if an iteration of the two fields that was cut short passes for the onset, or harmless ones are told."""
    statics = Statics(NOTCHED.body, StaticsControls(max_passes=most))
    state = State.intact(NOTCHED.sample.space)
    for _ in statics.load(state):
        assert state.gamma.min() > 0.8
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
    body = Plate(NOTCHED.sample, deletion=0.3, force_floor=0.0, overshoot=0.01)
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
    """Fails if a blow-up goes on as a gamma of NaN, or as a body without the points that blew up."""
    W = np.full(PLAIN.space.w.shape, 0.01)
    W[7, 2] = energy
    solver = DensitySolver(PLAIN.space, SinkLaw(), sink)
    with pytest.raises(ConvergenceError, match=r"the stored energy of a Gauss point is not finite"):
        solver.solve(W, np.ones(PLAIN.space.n_nodes))


@pytest.mark.parametrize("alpha", [-0.334, 0.001])
def test_alpha_outside_its_range_is_refused(alpha: float):
    """Fails if an alpha is taken with which the scheme is unstable, or dissipates low modes."""
    with pytest.raises(ParameterError, match=r"hht_alpha must be a finite number in \[-0.333333, 0\]"):
        HHTControls(alpha=alpha)


@pytest.mark.parametrize(("arrival", "said"), [
    (None, "was still running at event_time = 0.0004 s: its tip is at (0.5, 1) mm"),
    (15e-6, "was still running at event_time = 0.0004 s, after it had arrived at 15 µs: its tip is at (0.5, 1) mm")])
def test_a_crack_that_runs_on_after_its_arrival_is_said_to_have_arrived(arrival: float | None, said: str) -> None:
    """Fails if the verdict on a ring that has burst, and is held in one place, does not say so."""
    tracker = SimpleNamespace(cracked_at=np.zeros(3), separated=False, arrival=arrival)
    row = {"tip_x_mm": 0.5, "tip_y_mm": 1.0, "tips": 1}
    sim: Any = SimpleNamespace(state=SimpleNamespace(time=1e-4), crack=SimpleNamespace(tracker=tracker), unfailed="",
                               dissolved=False, ended="", guard=SimpleNamespace(even=False),
                               history=SimpleNamespace(rows=[row]))
    assert verdict(scene(), sim).endswith(said)
