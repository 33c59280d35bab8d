"""Observers of a run: when they look, what they see, and what a resumed run gives back to them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from guarded import NOTCHED, Stop, scene, simulation

from skfsink.errors import CheckpointError, Interrupted, ParameterError
from skfsink.fields.stress import principal_stresses
from skfsink.run.display import Display
from skfsink.run.observers.frames import Frames
from skfsink.run.observers.observer import Observer
from skfsink.run.observers.view import View
from skfsink.run.simulate import Simulation
from skfsink.scene.scene import Scene


class Looks(Observer):
    """Notes each call, with the time."""

    kept = ("calls",)

    def __init__(self, every: float | None = 2e-6) -> None:
        self.every = every
        self.calls: list[list[Any]] = []

    def loading(self, view: View) -> None:
        self.calls.append(["loading", view.state.grip])

    def onset(self, view: View) -> None:
        self.calls.append(["onset", view.load])

    def begin(self, view: View) -> None:
        self.calls.append(["begin", view.state.time])

    def look(self, view: View) -> None:
        self.calls.append(["look", view.state.time])

    def finish(self, view: View) -> None:
        self.calls.append(["finish", view.state.time])


class Steps(Looks):
    """The same under another name."""


class Stress(Observer):
    """Greatest principal stress on the line x = 0.7 mm."""

    every, kept = 1e-6, ("rows",)

    def __init__(self) -> None:
        self.rows: list[list[float]] = []

    def look(self, view: View) -> None:
        middle = view.body.space.X[view.body.space.conn].mean(axis=1)
        on_line = np.abs(middle[:, 0] - 0.7) < 0.05
        self.rows.append([view.state.time, float(np.nanmax(principal_stresses(view.stress[on_line])))])

    def finish(self, view: View) -> None:
        np.savetxt(view.folder / "line.csv", self.rows, delimiter=",")


def event(**controls: Any) -> Scene:
    """The notched block, whose crack runs."""
    return scene(NOTCHED.sample, **{"event_time": 1.2e-5, "overshoot": 0.01, "checkpoint_every": 1e6,
                                    "frame_every": 4e-6, **controls})


def test_an_observer_looks_on_its_own_schedule(tmp_path: Path) -> None:
    """Fails if an observer is called out of order, or not once after each of its intervals."""
    looks, steps = Looks(), Steps(None)
    run = simulation(event(), tmp_path, looks, steps)
    run.run()
    kinds = [kind for kind, _ in looks.calls]
    begin = kinds.index("begin")
    assert kinds[:begin] == ["loading"] * (begin - 1) + ["onset"] and begin > 3
    assert kinds[begin:] == ["begin", *["look"] * (len(kinds) - begin - 2), "finish"]
    times = np.array([time for kind, time in looks.calls[begin:] if kind == "look"])
    assert times[0] == 0.0 and times[-1] == run.state.time  # the first state and the last one
    np.testing.assert_array_equal((times[1:-1] / 2e-6).astype(int), np.arange(1, len(times) - 1))
    assert max(times[1:-1] - 2e-6 * np.arange(1, len(times) - 1)) < 2 * run.integrator.dt  # type: ignore[union-attr]
    assert len([kind for kind, _ in steps.calls if kind == "look"]) == run.costs.steps + 2


def test_a_quasistatic_run_counts_passes(tmp_path: Path) -> None:
    """Fails if seconds are asked of a clock that counts passes."""
    looks = Looks(1e-6)
    looks.every_passes = 3
    run = simulation(event(analysis="quasistatic"), tmp_path, looks)
    run.run()
    passes = [time for kind, time in looks.calls if kind == "look"]
    assert passes[:-1] == list(range(0, run.state.step, 3))[:len(passes) - 1] and passes[-1] == run.state.step


@pytest.mark.parametrize("stop", [pytest.param(3, marks=pytest.mark.slow), 60])
def test_a_resumed_run_gives_an_observer_back_what_it_kept(stop: int, tmp_path: Path) -> None:
    """Fails if rows of an observer are lost, doubled or altered where a run goes on, in loading or in the event.

    A checkpoint knows observers by name: they come in another order here. Seen to fail with memories by place.
    """
    for name, after in (("whole", 10**9), ("broken", stop)):
        run = simulation(event(), tmp_path / name, Stress(), Looks(), Stop(after))
        if name == "whole":
            run.run()
            calls = run.observers.of(Looks).calls
            continue
        with pytest.raises(Interrupted):
            run.run()
        again = Simulation(event(), tmp_path / name, Display(True), resume=True, observers=[Looks(), Stress()])
        again.run()
        assert again.observers.of(Looks).calls == calls
    whole, broken = (np.loadtxt(tmp_path / name / "line.csv", delimiter=",") for name in ("whole", "broken"))
    np.testing.assert_array_equal(whole, broken)
    assert len(whole) == 14 and (whole[:, 1] > 0).all()


def test_the_stress_an_observer_sees_is_that_of_the_frames(tmp_path: Path) -> None:
    """Fails if a stress is kept from a state before, or principal stresses are not eigenvalues of the frame's."""
    run = simulation(event(), tmp_path, stress := Stress())
    run.run()
    frame = meshio.read(tmp_path / "series" / "run_0001.vtu").cell_data["stress"][0]
    time = run.frames.times[1]
    middle = NOTCHED.sample.space.X[NOTCHED.sample.space.conn].mean(axis=1)
    xx, yy, zz, xy, yz, xz = frame[np.abs(middle[:, 0] - 0.7) < 0.05].T
    tensors = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)
    seen = next(value for at, value in stress.rows if at == time)
    assert seen == pytest.approx(np.nanmax(np.linalg.eigvalsh(tensors)), rel=1e-6)


def test_an_observer_takes_the_place_of_a_standard_one(tmp_path: Path) -> None:
    """Fails if frames come as often as the scene says where an observer says otherwise."""
    run = simulation(event(), tmp_path, Frames(every=1e-6))
    run.run()
    assert run.frames.times[0] == 0.0 and len(run.frames.times) > 10
    assert len(list((tmp_path / "series").glob("run_*.vtu"))) == len(run.frames.times)


def test_observers_that_cannot_be(tmp_path: Path) -> None:
    """Fails if two share a name, or a run goes on without one that has a memory, or with one that lacks it."""
    class Crack(Observer):
        """Not that of a run."""

    with pytest.raises(ParameterError, match="two observers are called Looks"):
        simulation(event(), tmp_path, Looks(), Looks())
    with pytest.raises(ParameterError, match="the observer Crack would take the place"):
        simulation(event(), tmp_path, Crack())
    with pytest.raises(Interrupted):
        simulation(event(), tmp_path / "with", Stress(), Stop(5)).run()
    before = (tmp_path / "with" / "history.csv").read_bytes()
    with pytest.raises(CheckpointError, match=r"has the observer Stress: resume it from Python, with run\(scene"):
        Simulation(event(), tmp_path / "with", Display(True), resume=True)
    with pytest.raises(CheckpointError, match="was begun without the observer Looks"):
        Simulation(event(), tmp_path / "with", Display(True), resume=True, observers=[Stress(), Looks()])
    assert (tmp_path / "with" / "history.csv").read_bytes() == before
