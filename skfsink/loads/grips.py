"""What moves, guides and pulls a body: grips, sliding planes, dead tractions, and ramps in time."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field

import numpy as np

from ..errors import ParameterError, require

__all__ = ["Grip", "Ramp", "Sliding", "Traction", "Velocity"]


@dataclass(frozen=True)
class Ramp:
    """A displacement [mm] or traction [MPa] that is piecewise linear in the load time.

    It is 0 before the first time, and stays at the last value after the last one.

    Parameters
    ----------
    times: load times [s], ascending, the first >= 0; a first one later than 0 is preceded by 0 at time 0.
    values: at these times.

    Raises
    ------
    ParameterError
        Fewer than two points, times that do not ascend, or a value other than 0 at time 0.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.times) < 2 or len(self.times) != len(self.values):
            raise ParameterError(f"a ramp must have at least two points [time, value]; got {len(self.times)} times and "
                                 f"{len(self.values)} values")
        for value in self.values:
            require("ramp value", value)
        for time in self.times:
            require("ramp time", time, "s", low=0)
        if not (np.diff(self.times) > 0).all():
            raise ParameterError(f"the times of a ramp must ascend; got {', '.join(f'{t:g}' for t in self.times)}")
        if self.times[0] == 0.0 and self.values[0] != 0.0:
            raise ParameterError(f"a ramp must be 0 at time 0; got {self.values[0]:g}: let it rise from 0")
        if self.times[0] > 0.0:
            object.__setattr__(self, "times", (0.0, *self.times))
            object.__setattr__(self, "values", (0.0, *self.values))

    def value(self, t: float) -> float:
        """Value at load time `t` [s]."""
        return float(np.interp(t, self.times, self.values))

    def rate(self, t: float) -> float:
        """Its rate from load time `t` [s] on, up to the next of :attr:`times`; 0 after the last one."""
        i = bisect_right(self.times, t) - 1
        if i + 1 >= len(self.times):
            return 0.0
        return (self.values[i + 1] - self.values[i]) / (self.times[i + 1] - self.times[i])

    def slope(self, t: float) -> float:
        """Its rate at load time `t` [s] itself; where it has two, at one of :attr:`times`, that from there on."""
        return self.rate(t)


@dataclass(frozen=True)
class Grip:
    """A boundary that moves as given: by component a velocity [mm/s], a ramp of the displacement, or None (free)."""

    boundary: str
    velocity: tuple[float | Ramp | None, ...]

    @property
    def moves(self) -> bool:
        """Whether it moves at some time."""
        return any(isinstance(value, Ramp) or value for value in self.velocity)


@dataclass(frozen=True)
class Sliding(Grip):
    """A flat boundary, of any direction, that slides on its plane: held along its normal, free along the plane.

    `velocity` is no argument of it: nothing is moved.
    """

    velocity: tuple[float | Ramp | None, ...] = field(default=(), init=False)


@dataclass(frozen=True)
class Velocity:
    """The velocity that a region, or with an empty name the body, has as the event begins, by component [mm/s]."""

    region: str
    velocity: tuple[float, ...]


@dataclass(frozen=True)
class Traction:
    """A dead traction on a boundary, per undeformed area: by component a rate [MPa/s] or a ramp of the traction."""

    boundary: str
    rate: tuple[float | Ramp, ...]
