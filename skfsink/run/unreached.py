"""The part of a load history that an event does not come to."""

from __future__ import annotations

from itertools import chain

import numpy as np

from ..loads.grips import Ramp
from ..loads.pressure import Filling
from ..loads.rotation import Rotation
from ..scene.scene import Scene

__all__ = ["unreached"]


def unreached(scene: Scene, begin: float, end: float) -> str:
    """A warning where a ramp turns back, or moves on from a rest, after the load time `end` [s] of an event that begins
    at `begin` [s]: cycles that were asked for and are not computed; "" where none does.
    """
    turns = [turn for ramp in _ramps(scene) if (turn := _turn(ramp, begin, end)) is not None]
    if not turns:
        return ""
    why, cure = ("a quasi-static event is passes at the load of the onset", "a load history after the onset takes a "
                 "dynamic event, at its own rate") if scene.controls.analysis == "quasistatic" else (
        f"the event lasts {end - begin:.3g} s", "event_time makes it longer, and cycles as fast as an event are in it")
    return (f"the load history turns at load time {min(turns):.4g} s, which this run does not come to: it begins to "
            f"fail at {begin:.4g} s, and {why}; what comes later is not computed: {cure}")


def _ramps(scene: Scene) -> list[Ramp]:
    """All courses of the load, in no order."""
    courses = [*(grip.angle for grip in scene.grips if isinstance(grip, Rotation)),
               *chain.from_iterable(grip.velocity for grip in scene.grips if not isinstance(grip, Rotation)),
               *chain.from_iterable(traction.rate for traction in scene.tractions),
               *(load.inflow if isinstance(load, Filling) else load.rate for load in scene.pressures)]
    return [course for course in courses if isinstance(course, Ramp)]


def _turn(ramp: Ramp, begin: float, end: float) -> float | None:
    """The first of its times after `end` from which it moves in another direction than before; None without one.

    The direction before is that at `begin`; a ramp that comes to rest and stays there does not turn.
    """
    times = np.array([begin, *(t for t in ramp.times if t > begin)])
    values = np.array([ramp.value(t) for t in times])
    direction = np.sign(np.diff(values))
    for k in range(1, direction.size):
        if direction[k] != 0.0 and direction[k] != direction[k - 1] and times[k] > end:
            return float(times[k])
    return None
