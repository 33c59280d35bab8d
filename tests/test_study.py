"""Studies: the store of points, the Pareto front, rates, and small studies from end to end."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from skfsink.errors import ConvergenceError, InstabilityError, OutputError
from skfsink.study.pareto import pareto_front
from skfsink.study.store import Store


# --- the store ---
def test_a_stopped_study_goes_on_where_it_was(tmp_path: Path):
    """Fails if a stored point is computed again, or one that was interrupted is stored."""
    path, made = tmp_path / "new" / "study.json", []

    def compute(key: str, stop: bool = False):
        def work():
            made.append(key)
            if stop:
                raise KeyboardInterrupt
            return {"value": np.float64(len(key)), "list": (1, 2)}
        return work

    store = Store(path, "a study")
    first = store.point("one", compute("one"))
    assert first["value"] == 3.0 and first["list"] == [1, 2] and first["wall_s"] >= 0 and first["cpu_s"] >= 0
    with pytest.raises(KeyboardInterrupt):
        store.point("three", compute("three", stop=True))
    again = Store(path, "a study")
    assert again.point("one", compute("one")) == first
    again.point("three", compute("three"))
    assert made == ["one", "three", "three"]
    assert list(Store(path, "a study").points) == ["one", "three"]
    assert not list(path.parent.glob(".*")), "a temporary file is left"
    assert not Store(path, "a study", fresh=True).points


@pytest.mark.parametrize("error", [ConvergenceError, InstabilityError])
def test_a_failing_point_is_a_point(tmp_path: Path, error: type[Exception]):
    """Fails if a run that does not converge is dropped, or stops the study, or is run again."""
    def fail():
        raise error("no equilibrium within 3 steps")

    store = Store(tmp_path / "study.json", "a study")
    assert store.point("bad", fail)["failed"] == "no equilibrium within 3 steps"
    assert Store(tmp_path / "study.json", "a study").points["bad"]["failed"]


def test_figures_of_another_machine_are_refused(tmp_path: Path):
    """Fails if points of other versions, machines or studies are mixed with new ones."""
    path = tmp_path / "study.json"
    Store(path, "a study").point("one", lambda: {"value": 1})
    with pytest.raises(OutputError, match="not a file of the study another"):
        Store(path, "another")
    content = json.loads(path.read_text())
    content["machine"]["versions"]["skfsink"] = "0.0.1"
    path.write_text(json.dumps(content))
    with pytest.raises(OutputError, match=r"skfsink 0\.0\.1, and this is .*--fresh"):
        Store(path, "a study")
    path.write_text("{")
    with pytest.raises(OutputError, match="not a file of the study"):
        Store(path, "a study")
    with pytest.raises(OutputError, match="finite numbers only"):
        Store(path, "a study", fresh=True).point("nan", lambda: {"value": float("nan")})


# --- the front ---
def test_pareto_front_of_a_known_set():
    """Fails if a beaten point is on the front, an unbeaten one is not, or their order is wrong."""
    points = [(3, 1), (1, 4), (2, 2), (2, 3), (4, 1), (5, 0.5), (1, 4), (0.5, np.inf), (np.nan, 0.1), (9, 0.6)]
    assert pareto_front(*zip(*points)) == [1, 2, 0, 5]
    assert pareto_front([], []) == []
