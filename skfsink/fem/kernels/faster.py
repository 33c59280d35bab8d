"""Whether several threads are faster than one, asked again and again.

On a machine whose cores have other work they wait for each other, many times as long as the loop takes.
"""

from __future__ import annotations

import time

__all__ = ["Faster"]


class Faster:
    """Chooses between two ways to get the same result, by the clock.

        with choice as several:
            ...  # the one way if `several`, else the other

    The way in use is timed at every call, the other one every `PATIENCE[0]` calls; each time it loses, twice as many
    calls pass before it is tried again, up to `PATIENCE[1]`.
    """

    PATIENCE = (64, 4096)
    WEIGHT = 0.25  # of the last time in the running mean

    def __init__(self) -> None:
        self.several = True
        self._times: dict[bool, float] = {}
        self._trial = False
        self._wait, self._left = self.PATIENCE[0], 0

    def __enter__(self) -> bool:
        self._trial = self._left == 0
        self._way = self.several ^ self._trial
        self._start = time.perf_counter()
        return self._way

    def __exit__(self, *_: object) -> None:
        spent, old = time.perf_counter() - self._start, self._times.get(self._way)
        self._times[self._way] = spent if old is None or self._trial else (1 - self.WEIGHT) * old + self.WEIGHT * spent
        self._left -= 1
        if not self._trial:
            return
        if self._times[self._way] < self._times.get(not self._way, float("inf")):
            self.several, self._wait = self._way, self.PATIENCE[0]
        else:
            self._wait = min(2 * self._wait, self.PATIENCE[1])
        self._left = self._wait
