"""Runs that end before their time: by a condition with a name, by a limit, by a function; in both analyses, resumed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import skfsink as sk
from skfsink.errors import CheckpointError, OutputError, ParameterError
from skfsink.scene.stop import Condition, read_stop, stop_of

FAST: dict[str, Any] = {"length_scale": 0.6, "quiet": True}


def ran(mesh: Path, out: Path, **keywords: Any) -> sk.Result:
    """The small plate, of 0.3 mm elements."""
    return sk.single_edge_notch(mesh=str(mesh), out=out, **{**FAST, **keywords})


def begins_as(part: sk.Run, whole: sk.Run) -> bool:
    """Whether the history of one run is the beginning of that of another, but for the last row."""
    n = len(part.history["step"]) - 1
    return n > 3 and all(np.array_equal(column[:n], whole.history[name][:n], equal_nan=column.dtype.kind == "f")
                         for name, column in part.history.items())


def test_conditions_are_read() -> None:
    """Fails if a limit loses its unit, a condition its name, or text that is none is taken."""
    assert read_stop("") == read_stop(" ") == ()
    assert read_stop("arrival, time > 50 us,crack_length>2") == (
        Condition("arrival"), Condition("time", 5e-5), Condition("crack_length", 2.0))
    assert read_stop(", ".join(map(str, read_stop("displacement > 3 um, passes > 7")))) == (
        Condition("displacement", 3e-3), Condition("passes", 7.0))
    assert stop_of("arrival, time > 1 s, passes > 7", "dynamic") == "arrival, time > 1.0 s"
    assert stop_of("arrival, time > 1 s, passes > 7", "quasistatic") == "arrival, passes > 7.0"
    for bad, words in (("arival", "must name one of arrival, "), ("time", r"needs a limit, such as 'time > 2 s'$"),
                       ("passes", r"such as 'passes > 2'$"), ("arrival > 2", "has no limit"),
                       ("time > 2 mm", "must be a quantity in s"), (3, "must be text"), ("arrival,", "must name one")):
        with pytest.raises(ParameterError, match=words):
            read_stop(bad)  # type: ignore[arg-type]
    for analysis, condition in (("dynamic", "passes > 3"), ("quasistatic", "time > 1 s")):
        with pytest.raises(ParameterError, match="is for the other analysis"):
            sk.Options(analysis=analysis, stop=condition)


@pytest.mark.parametrize("analysis", ["dynamic", "quasistatic"])
def test_a_limit_ends_the_event_where_it_is_passed(analysis: str, mesh: Path, tmp_path: Path) -> None:
    """Fails if a run goes on past its limit, ends before it, computes otherwise up to there, or does not say why."""
    whole = ran(mesh, tmp_path / "whole", analysis=analysis, event_time=6e-5)
    part = ran(mesh, tmp_path / "part", analysis=analysis, event_time=6e-5, stop="crack_length > 0.7 mm")
    length = part.event["crack_length_mm"]
    assert np.nanmax(length[:-2]) <= 0.7 < length[-1] < whole.event["crack_length_mm"][-1]  # the end is looked at twice
    assert begins_as(part, whole)
    why = "it was to stop at crack_length > 0.7 mm"
    summary = json.loads((tmp_path / "part" / "summary.json").read_text())
    assert summary["end"] == why and f"because {why}; the leading tip is at (" in part.verdict
    assert whole.summary["end"] != why and sk.load(part.folder).parameters["stop"] == "crack_length > 0.7 mm"


def test_of_several_conditions_the_first_ends_a_run(mesh: Path, tmp_path: Path) -> None:
    """Fails if only one of the conditions counts, or a limit in time is not that of the event."""
    result = ran(mesh, tmp_path / "out", stop="arrival, time > 5 us, crack_length > 3 mm")
    assert result.summary["end"] == "it was to stop at time > 5e-06 s"
    assert 5e-6 < result.state.time < 6.5e-6 and result.summary["event"]["first_arrival_s"] is None


def test_a_limit_in_the_loading_ends_it(mesh: Path, tmp_path: Path) -> None:
    """Fails if a body that is to be loaded up to a displacement only is loaded to its failure."""
    result = ran(mesh, tmp_path / "out", stop="displacement > 0.05 mm", analysis="both")
    for part in result.parts.values():
        displacement = part.history["grip_displacement_mm"]
        assert not part.failed and (displacement[:-1] <= 0.05).all() and 0.05 < displacement[-1] < 0.15
        assert part.summary["end"] == "it was to stop at displacement > 0.05 mm"
        assert "the loading ended because it was to stop" in part.verdict


def test_an_event_may_end_before_its_first_step(mesh: Path, tmp_path: Path) -> None:
    """Fails if a run whose condition holds as its event begins, here since a loading from rest goes past it, does not
    end as others do."""
    result = ran(mesh, tmp_path / "out", start="rest", speed="1000 mm/s", stop="displacement > 0.05 mm")
    assert result.summary["end"] == "it was to stop at displacement > 0.05 mm" and result.state.step == 0
    assert result.history["grip_displacement_mm"][-1] > 0.05 and (tmp_path / "out" / "checkpoint.npz").exists()


def test_a_function_ends_a_run_and_can_say_why(mesh: Path, tmp_path: Path) -> None:
    """Fails if a function is not asked, is asked between records, or the folder claims to describe its run."""
    asked: list[float] = []

    def kinetic(view: sk.View) -> str:
        if view.occasion == "step":
            asked.append(view.state.time)
        return "a tenth in motion" if view.state.ledger.kinetic > 0.1 * view.state.ledger.elastic else ""

    result = ran(mesh, tmp_path / "out", stop=kinetic)
    event = result.event
    share = event["kinetic"] / event["elastic"]
    assert share[-1] > 0.1 and (share[:-2] <= 0.1).all()
    assert result.summary["end"] == "it was to stop at a tenth in motion"
    assert 0.8 < len(asked) / (result.state.time / 1e-6) < 1.2  # once a microsecond
    assert sk.load(result.folder).made_in_python == ("stop",)
    with pytest.raises(OutputError, match=r"were made in Python \(stop\): resume it from there, with stop=…, the same"):
        sk.single_edge_notch(resume=result.folder, quiet=True)
    again = sk.single_edge_notch(resume=result.folder, stop=kinetic, quiet=True)
    assert again.summary["end"] == result.summary["end"] and again.state.time == result.state.time


class Cut(sk.Observer):
    """Interrupts a run at a time."""

    def __init__(self, at: float) -> None:
        self.at = at

    def pause(self, view: sk.View) -> None:
        """As Ctrl-C does."""
        if view.state.phase == "event" and view.state.time >= self.at:
            view.save()
            raise KeyboardInterrupt


@pytest.mark.parametrize("stop", ["crack_length > 0.7 mm", lambda view: view.tips.length > 0.7])
def test_a_resumed_run_ends_at_the_same_state(stop: Any, mesh: Path, tmp_path: Path) -> None:
    """Fails if a run that goes on overlooks its end, finds another, or takes another function for its own."""
    whole = ran(mesh, tmp_path / "whole", stop=stop)
    with pytest.raises(sk.SkfsinkError, match="interrupted"):
        ran(mesh, tmp_path / "cut", stop=stop, observers=[Cut(1.2e-5)])
    if callable(stop):
        with pytest.raises(CheckpointError):
            sk.single_edge_notch(resume=tmp_path / "cut", stop=lambda view: view.tips.length > 0.9, quiet=True)
    went_on = sk.single_edge_notch(resume=tmp_path / "cut", stop=stop, quiet=True)
    assert went_on.state.u.tobytes() == whole.state.u.tobytes() and went_on.verdict == whole.verdict
    assert (tmp_path / "cut" / "history.csv").read_bytes() == (tmp_path / "whole" / "history.csv").read_bytes()
