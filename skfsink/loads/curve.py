"""Courses of grips and tractions that are functions of the load time.

A :class:`Curve` is its function wherever a value is asked for: displacements at the ends of load increments and of time
steps, velocities of grips in the event, tractions. A polyline through it, within a tolerance, only says where load
increments end. So grips have no kinks in the event, whose jumps of velocity would send waves.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from numbers import Real

import numpy as np

from ..errors import ParameterError, first_line, require
from .grips import Ramp

__all__ = ["Curve"]

FIRST = 16               # intervals between two given points that are looked at first
LOOKED = 0.27, 0.5, 0.81  # where in an interval the function is held against the chord
SHORTEST = 1e-12         # of the duration: an interval in which a function that is still far from its chord jumps
MOST = 10_000            # points of the polyline
STEP = 1e-2              # of an interval: differences from which velocities are found


@dataclass(frozen=True)
class Curve(Ramp):
    """A displacement [mm] or traction [MPa] that is a function of the load time.

    It is 0 at time 0, and stays at its last value after `until`. Cycles and unloading are as good as loading. Sharp
    bends are allowed, jumps are not.

    Parameters
    ----------
    function: of the load time t [s] in [0, until]; gives a displacement [mm] or a traction [MPa].
    until: time from which on it stands still [s], > 0.
    tolerance: distance of the polyline from the function, over the greatest value of it, in (0, 0.1]; at a sharp bend
        it may be up to twice as far. Load increments end at the points of the polyline; the values there, and all
        others, are those of the function itself.
    points: times [s] that are points of the polyline, such as the beginning and the end of a short pulse, which would
        be missed otherwise.

    Attributes
    ----------
    times, values: of the polyline.

    Raises
    ------
    ParameterError
        The function is none, gives no finite number, is not 0 at time 0, or jumps; also when it does so later.
    """

    times: tuple[float, ...] = field(init=False)
    values: tuple[float, ...] = field(init=False)
    function: Callable[[float], float]
    until: float
    tolerance: float = 1e-3
    points: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise ParameterError(f"a curve needs a function of the load time; got {self.function!r:.80}")
        require("until of a curve", self.until, "s", low=0, low_open=True)
        require("tolerance of a curve", self.tolerance, low=0, high=0.1, low_open=True)
        for point in self.points:
            require("a point of a curve", point, "s", low=0, high=self.until)
        at = sorted({0.0, float(self.until), *map(float, self.points)})
        grid = np.unique(np.concatenate([np.linspace(a, b, FIRST + 1) for a, b in pairwise(at)]))
        samples = {float(t): self._number(float(t)) for t in grid}
        between = [a + x * (b - a) for a, b in pairwise(grid) for x in LOOKED]
        scale = max(map(abs, (*samples.values(), *map(self._number, map(float, between)))))
        if abs(samples[0.0]) > 1e-12 * scale:
            raise ParameterError(f"a curve must be 0 at time 0; got {samples[0.0]:g}: let it rise from 0")
        samples[0.0] = 0.0
        self._refine(samples, self.tolerance * scale)
        object.__setattr__(self, "times", tuple(sorted(samples)))
        object.__setattr__(self, "values", tuple(samples[t] for t in self.times))
        super().__post_init__()

    def _refine(self, samples: dict[float, float], allowed: float) -> None:
        """Add points to the `samples`, by their times, until every chord is as near as `allowed` to the function."""
        ends = sorted(samples)
        open_ = list(pairwise(ends))
        while open_:
            a, b = open_.pop()
            chord = [samples[a] + x * (samples[b] - samples[a]) for x in LOOKED]
            if all(abs(self._number(a + x * (b - a)) - y) <= allowed for x, y in zip(LOOKED, chord)):
                continue
            middle = 0.5 * (a + b)
            if b - a < SHORTEST * self.until:
                raise ParameterError(f"a curve must not jump; this one does at {middle:.6g} s, from {samples[a]:g} to "
                                     f"{samples[b]:g}: let it go there in a time")
            samples[middle] = self._number(middle)
            if len(samples) > MOST:
                raise ParameterError(f"a curve takes more than {MOST:,} points to be within its tolerance of "
                                     f"{self.tolerance:g}: lower `until`, or raise the tolerance")
            open_ += [(a, middle), (middle, b)]

    def _number(self, t: float) -> float:
        try:
            value = self.function(t)
        except Exception as error:  # whatever a user's function raises
            raise ParameterError(f"a curve has no value at {t:.6g} s: its function raises {type(error).__name__} "
                                 f"({first_line(error)})") from None
        plain = value.item() if isinstance(value, np.ndarray | np.generic) and np.ndim(value) == 0 else value
        if isinstance(plain, bool) or not isinstance(plain, Real) or not np.isfinite(float(plain)):
            raise ParameterError(f"a curve must give a finite number; got {value!r:.80} at {t:.6g} s")
        return float(plain)

    def value(self, t: float) -> float:
        """Value of the function at load time `t` [s]."""
        return self._number(float(t)) if 0.0 < t < self.until else 0.0 if t <= 0.0 else self.values[-1]

    def slope(self, t: float) -> float:
        """Rate of the function at load time `t` [s], from differences that are as fine as the polyline is there."""
        if not 0.0 <= t < self.until:
            return 0.0
        i = bisect_right(self.times, t) - 1
        h = STEP * (self.times[i + 1] - self.times[i])
        low, high = t - h, t + h
        if low >= 0.0 and high <= self.until:
            return (self.value(high) - self.value(low)) / (high - low)
        way = h if low < 0.0 else -h  # at an end: from three values on one side
        return (4 * self.value(t + way) - self.value(t + 2 * way) - 3 * self.value(t)) / (2 * way)
