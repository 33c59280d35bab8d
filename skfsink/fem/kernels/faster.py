"""Whether several threads are faster than one, asked again and again.

On a machine whose cores have other work they wait for each other, many times as long as the loop takes.
"""

from __future__ import annotations

import time
from statistics import fmean

__all__ = ["Faster"]


class Faster:
    """Chooses between two ways to get the same result, by the clock.

        with choice as several:
            ...  # the one way if `several`, else the other

    The way in use is timed at every call. After `PATIENCE[0]` calls the other one is tried for `TRIAL` calls, the first
    of which does not count: its threads sleep, and its data are in other caches. The faster one is used from then on.
    Each time the way in use wins, twice as many calls pass before the other is tried again, up to `PATIENCE[1]`, but
    none if it has become `SLOWER` than it was then. A trial ends at once if a call takes `TOO_LONG` times what it
    should.
    """

    FIRST = 4               # calls after which the other way is tried for the first time
    TRIAL = 5               # calls of a trial
    PATIENCE = (64, 4096)
    SLOWER = 1.5
    TOO_LONG = 4.0
    WEIGHT = 0.25           # of the last time in the running mean

    def __init__(self) -> None:
        self.several = True
        self._usual = 0.0                # time of the way in use, a running mean; 0 if it was not timed yet
        self._agreed = float("inf")      # what it was when the ways were last compared
        self._cold = True                # whether the next call is the first of a run
        self._tried: list[float] = []    # times of the other way, in a trial
        self._trial, self._left, self._wait = 0, self.FIRST, self.PATIENCE[0]  # calls

    def __enter__(self) -> bool:
        if self._left == 0 and self._trial == 0:
            self._trial, self._cold = self.TRIAL, True
            self._tried.clear()
        self._start = time.perf_counter()
        return self.several ^ (self._trial > 0)

    def __exit__(self, *_: object) -> None:
        spent, counts = time.perf_counter() - self._start, not self._cold
        self._cold = False
        if self._trial == 0:
            self._left -= 1
            if counts:
                self._usual = ((1 - self.WEIGHT) * self._usual + self.WEIGHT * spent) if self._usual else spent
                if self._usual > self.SLOWER * self._agreed:
                    self._left, self._wait = 0, self.PATIENCE[0] // 2
            return
        self._trial -= 1
        if counts:
            self._tried.append(spent)
            if spent > self.TOO_LONG * self._usual:
                self._trial = 0
        if self._trial == 0:
            self._decide(fmean(self._tried))

    def _decide(self, other: float) -> None:
        """After a trial in which the other way took that long."""
        if other < self._usual:
            self.several, self._usual, self._wait = not self.several, other, self.PATIENCE[0]
        else:
            self._wait = min(2 * self._wait, self.PATIENCE[1])
        self._left, self._cold, self._agreed = self._wait, True, self._usual
