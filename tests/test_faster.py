"""Which of two ways is taken by the clock: by a clock that the tests set."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from skfsink.fem.kernels import faster
from skfsink.fem.kernels.faster import Faster

Times = Callable[[int, bool, bool], float]   # of call number, whether it is by several threads, and the first of a run


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> Callable[[Faster, int, Times], list[bool]]:
    """Calls with a choice that take as long as they are told: the ways that were taken."""
    clock = [0.0]
    monkeypatch.setattr(faster.time, "perf_counter", lambda: clock[0])

    def calls(choice: Faster, count: int, times: Times) -> list[bool]:
        ways: list[bool] = []
        for number in range(count):
            with choice as several:
                clock[0] += times(number, several, not ways or ways[-1] != several)
                ways.append(several)
        return ways

    return calls


Run = Callable[[Faster, int, Times], list[bool]]


def test_the_faster_way_is_taken(run: Run) -> None:
    """Fails if the slower way is taken but for trials, which get rarer the longer it loses."""
    for better in (True, False):
        ways = run(Faster(), 10_000, lambda _, several, __: 1.0 if several is better else 2.0)  # noqa: B023
        wrong = [number for number, way in enumerate(ways) if way is not better]
        assert len(wrong) < 60
        assert max(wrong) > 4096  # it is asked again and again
        assert len([number for number in wrong if number > 5000]) <= 2 * Faster.TRIAL


def test_a_first_call_does_not_count(run: Run) -> None:
    """Fails if a way that is slow when it begins, as threads that slept, is taken for a slow one, at any time."""
    for better in (True, False):
        def times(_: int, several: bool, first: bool) -> float:
            return 1000.0 if first else 1.0 if several is better else 1.5  # noqa: B023

        ways = run(Faster(), 3000, times)
        assert sum(way is not better for way in ways) < 50


def test_a_core_that_is_taken_away_and_given_back(run: Run) -> None:
    """Fails if several threads are kept when they have become slow, or not tried again when they are fast."""
    ways = run(Faster(), 20_000, lambda number, several, _: (0.6 if number < 5000 or number > 10_000 else 30.0)
               if several else 1.0)
    assert sum(ways[4000:5000]) > 980
    assert sum(ways[5000:10_000]) < 80
    assert sum(ways[15_000:]) > 4900


def test_a_trial_that_takes_too_long_is_ended(run: Run) -> None:
    """Fails if a loop is called five times on a core that has other work, though the second call was far too slow."""
    ways = run(Faster(), 1000, lambda _, several, __: 50.0 if several else 1.0)
    tried = "".join("x" if way else " " for way in ways[20:]).split()
    assert tried
    assert max(map(len, tried)) == 2
