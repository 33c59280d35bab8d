"""Observers of a run: when they look, what they see, and what a resumed run gives back to them."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from guarded import NOTCHED, Stop, scene, simulation
from plates import contents, drawing

from skfsink.cases.single_edge_notch import single_edge_notch
from skfsink.errors import CheckpointError, Interrupted, ParameterError
from skfsink.fields.stress import principal_stresses
from skfsink.run.compute import run
from skfsink.run.display import Display
from skfsink.run.observers.frames import Frames
from skfsink.run.observers.history import History
from skfsink.run.observers.observer import Observer
from skfsink.run.observers.onset import Strength
from skfsink.run.observers.view import View
from skfsink.run.simulate import Simulation
from skfsink.scene.options import Options
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


def short(**controls: Any) -> Scene:
    """The same for some steps."""
    return event(**{"event_time": 3e-7, "record_every": 1e-7, **controls})


@pytest.fixture(autouse=True)
def without_pictures() -> Iterator[None]:
    """Runs draw nothing."""
    with drawing(False):
        yield


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


# --- what is refused before anything is touched ---
class Keeps(Observer):
    """Keeps a value, from its making or from its first look on."""

    kept = ("worst",)

    def __init__(self, value: Any, late: bool = False) -> None:
        self.worst, self._value = None if late else value, value

    def look(self, view: View) -> None:
        self.worst = self._value


def with_schedule(**attributes: Any) -> Observer:
    """An observer with these attributes."""
    made = Looks()
    for name, value in attributes.items():
        setattr(made, name, value)
    return made


NO_OBSERVERS: list[tuple[Any, str]] = [
    ([Looks], r"give Looks\(...\), not the class Looks"), (Looks(), r"must be a list: give \[Looks\(...\)\]"),
    (None, "must be a list of observers; got None"), ("abc", "must be a list of observers; got 'abc'"),
    (["abc"], "derives from skfsink.Observer; got 'abc'"), ([len], "derives from skfsink.Observer; got <built-in"),
    ([object()], "derives from skfsink.Observer; got <object"),
    ([Looks(), Looks()], "two observers are called Looks"), ([Looks(0.0)], r"every of the observer Looks must be a "),
    *(([with_schedule(every=every)], r"every of the observer Looks must be a finite number in \(0, inf\) s; got ")
      for every in ("1 us", np.nan, -1e-6)),
    *(([with_schedule(every_passes=every)], r"every_passes of the observer Looks must be a whole number in \[1, inf\)")
      for every in (0, 1.5, "2")),
    ([with_schedule(kept="rows")], r"kept of the observer Looks must be names of attributes, such as .*; got 'rows'"),
    ([with_schedule(kept=(3,))], "kept of the observer Looks must be")]


@pytest.mark.parametrize("observers, message", NO_OBSERVERS)
def test_what_is_no_observer(observers: Any, message: str, tmp_path: Path) -> None:
    """Fails if what cannot look at a run is found out in the course of it, or with a traceback, or by one of two ways.
    """
    with pytest.raises(ParameterError, match=message) as options:
        Options(observers=observers)
    with pytest.raises(ParameterError, match=message) as ran:
        run(short(), tmp_path / "run", observers, quiet=True)
    assert "\n" not in str(options.value) and str(options.value) == str(ran.value)
    assert not (tmp_path / "run").exists()


def test_an_old_run_outlives_observers_that_cannot_be(tmp_path: Path) -> None:
    """Fails if files of the run in a folder are removed before it is known that another can take its place."""
    class Crack(Observer):
        """Not that of a run."""

    class Opened(Observer):
        """Cannot be copied."""

        def __init__(self) -> None:
            self.file = open(__file__)  # noqa: SIM115

    run(short(), tmp_path, quiet=True)
    before = contents(tmp_path)
    used, opened = Looks(), Opened()
    simulation(short(), tmp_path.parent / f"{tmp_path.name}-other", used)
    for observers, message in (([Looks(), Looks()], "two observers"), ([object()], "derives from"), ([used], "was in"),
                               ([Crack()], "would take the place"), ([Keeps({1})], "keeps worst")):
        with pytest.raises(ParameterError, match=message):
            run(short(), tmp_path, observers, overwrite=True, quiet=True)  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match=r"the observer Opened cannot be copied \(.*\), .* in its `prepare`"):
        run(short(analysis="both"), tmp_path, [opened], overwrite=True, quiet=True)
    opened.file.close()
    assert contents(tmp_path) == before


def test_a_resume_that_is_refused_leaves_nothing(tmp_path: Path) -> None:
    """Fails if a folder is made for a run that is not there."""
    with pytest.raises(CheckpointError, match=r"there is no run to go on with in .*: it has no scene\.toml"):
        run(short(), tmp_path / "none", resume=True, quiet=True)
    assert not (tmp_path / "none").exists()


# --- what a checkpoint keeps ---
NOT_KEPT = [
    ({1, 2}, "a value of the type set"), (Path("x"), "a value of the type PosixPath"),
    ({1: 2.0}, "the key 1 of a dict"), ({(1, 2): 3.0}, r"the key \(1, 2\) of a dict"),
    (np.array([None]), "an array of objects"), (np.ma.masked_array([1.0]), "an array of the class MaskedArray"),
    ([[np.ones(2)]], "an array in a list or a dict"), (1j, "a value of the type complex"),
    ([np.longdouble(1)], "a value of the type longdouble"), ([np.complex128(1)], "a value of the type complex128")]


@pytest.mark.parametrize("value, message, late", [*((*one, False) for one in NOT_KEPT),
                                                  *((*one, True) for one in NOT_KEPT[:6:2])])
def test_what_cannot_be_kept_is_said_early(value: Any, message: str, late: bool, tmp_path: Path) -> None:
    """Fails if a value that a checkpoint loses or changes is found out when the event has been computed, or never."""
    text = rf"^the observer Keeps keeps worst with {message}, which a checkpoint cannot give back: keep "
    with pytest.raises(ParameterError, match=text) as error:
        run(event(), tmp_path / "run", [Keeps(value, late)], quiet=True)
    assert "\n" not in str(error.value) and (tmp_path / "run").exists() == late
    if late:
        with open(tmp_path / "run" / "history.csv") as file:
            assert sum(row["phase"] == "event" for row in csv.DictReader(file)) <= 1


def test_what_is_kept_without_being_there(tmp_path: Path) -> None:
    """Fails if an attribute that an observer keeps and does not have, or did not keep, ends with a traceback."""
    class Lacks(Observer):
        """Has no rows."""

        kept = ("rows",)

    with pytest.raises(ParameterError, match="the observer Lacks keeps rows and has no such attribute"):
        simulation(short(), tmp_path / "lacks", Lacks())
    with pytest.raises(Interrupted):
        simulation(short(), tmp_path / "run", Looks(), Stop(2)).run()
    more = Looks()
    more.kept = ("calls", "rows")  # type: ignore[misc]
    with pytest.raises(CheckpointError, match="the observer Looks of the checkpoint has not kept rows"):
        Simulation(short(), tmp_path / "run", Display(True), resume=True, observers=[more])


def test_numbers_of_numpy_are_kept_as_plain_ones(tmp_path: Path) -> None:
    """Fails if a run is lost for an int64 or a float32, or tuples come back as something else than lists."""
    values = {"at": np.int64(7), "rows": [np.float32(0.5), (1, np.True_)], "text": np.str_("x"), "none": None}
    with pytest.raises(Interrupted):
        simulation(short(), tmp_path, Keeps(values), Stop(2)).run()
    again = Keeps(None)
    Simulation(short(), tmp_path, Display(True), resume=True, observers=[again])
    assert again.worst == {"at": 7, "rows": [0.5, [1, True]], "text": "x", "none": None}
    plain = again.worst["at"], again.worst["rows"][0], again.worst["text"]
    assert [type(item) for item in plain] == [int, float, str]


# --- in place of a standard one, and in one run alone ---
class MyHistory(History):
    """A history of your own."""


class MyStrength(Strength):
    """Hears of the greatest load as well."""


def test_a_class_that_derives_from_a_standard_one_takes_its_place(tmp_path: Path) -> None:
    """Fails if two histories write one file, or the second run of both analyses does not find the strength."""
    simulation(short(), tmp_path / "plain").run()
    made = simulation(short(), tmp_path / "own", MyHistory(1e-7))
    made.run()
    assert type(made.history) is MyHistory and len([o for o in made.observers if isinstance(o, History)]) == 1
    assert (tmp_path / "own" / "history.csv").read_bytes() == (tmp_path / "plain" / "history.csv").read_bytes()
    with pytest.raises(ParameterError, match="History and MyHistory would both take the place of History"):
        simulation(short(), tmp_path / "two", History(1e-7), MyHistory(1e-7))


def test_an_observer_belongs_to_one_run(tmp_path: Path) -> None:
    """Fails if rows of another run are among those of an observer, or the copies of both analyses cannot be found."""
    looks = Looks()
    alone = run(short(), tmp_path / "alone", [looks], quiet=True)
    assert alone.observers == (looks,)
    with pytest.raises(ParameterError, match=r"Looks was in a run before and has its rows: make a new one, Looks\("):
        run(short(), tmp_path / "again", [looks], quiet=True)
    assert not (tmp_path / "again").exists()
    run(short(), tmp_path / "alone", [looks], resume=True, quiet=True)  # its own run
    given = Looks()
    both = run(short(analysis="both"), tmp_path / "both", [given, MyStrength()], quiet=True)
    copy, other = (both.parts[name].observers[0] for name in ("dynamic", "quasistatic"))
    assert copy.calls == looks.calls and other.calls != copy.calls and given.calls == []
    strengths = [part.observers[1].greatest for part in both.parts.values()]
    assert strengths[0] == strengths[1] != {}


def test_the_observers_see_the_crack_of_the_same_step(tmp_path: Path) -> None:
    """Fails if Crack does not look before all others, who take the tips from the view."""
    class Moments(Observer):
        """Compares what it sees with the last record of the tracker."""

        every = 1e-6

        def look(self, view: View) -> None:
            if view.tips.branches:
                seen.append(((view.state.time, view.tips.length), view.tracker.track[-1]))

    seen: list[tuple[tuple[float, float], tuple[float, float]]] = []
    made = simulation(event(), tmp_path, Moments())
    assert next(iter(made.observers)) is made.crack
    made.run()
    assert len(seen) > 3 and all(view == record for view, record in seen)


def test_an_interrupted_run_with_observers_says_how_to_go_on(mesh: Path, tmp_path: Path) -> None:
    """Fails if the message names a command that refuses to resume the run, or the way that it names is none."""
    options = {"length_scale": 0.6, "event_time": 1e-6, "quiet": True}
    with pytest.raises(Interrupted) as stopped:
        single_edge_notch(mesh=str(mesh), options=Options(**options, out=tmp_path / "run",
                                                          observers=(Looks(), Stop(3))))
    folder = re.fullmatch(r"interrupted; go on from Python with resume='(.*)' and the same observers",
                          str(stopped.value))[1]  # type: ignore[index]
    result = single_edge_notch(mesh=str(mesh), options=Options(resume=folder, quiet=True, observers=(Looks(),)))
    assert result.observers[0].calls[0][0] == "loading"


def test_progress_before_there_is_a_tip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a place that is not there is shown as nan."""
    shown: list[str] = []
    monkeypatch.setattr(Display, "update", lambda self, done, figures: shown.append(figures))
    simulation(event(), tmp_path).run()
    told = [line for line in shown if "tip" in line]
    assert "  no tip yet  " in told[0] and not any("nan" in line for line in told)
    assert any(re.search(r"  tip \d\.\d\d, \d\.\d\d mm ×1  ", line) for line in told)
