"""What a run reports as its load and its displacement."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...fields.state import State
from ...loads.grips import Ramp
from ...loads.rotation import Rotation, Turn
from ...loads.schedule import Loading
from ...scene.scene import Scene

__all__ = ["Gauge"]


class Gauge:
    """Load and displacement of a scene.

    The load is the force on the first grip that ever moves, along its motion; of one that follows ramps that is its
    motion in the last stretch of time in which it moves, or away from where it began if it moves back then. The
    displacement is that of this grip relative to the last other one, in the same direction. Of a grip that turns they
    are the moment about its axis over the radius of its outermost node, and the way of this node. Without a grip that
    moves they are those of the first traction: its force, and the mean displacement of its boundary relative to that of
    the last other traction, or to the grips. Without these they are those of the first pressure: its force, pressure
    times the deformed area of its boundary, and the volume by which the boundary has opened over its undeformed area.
    """

    def __init__(self, scene: Scene, loading: Loading) -> None:
        self.scene, self.loading = scene, loading
        self._grip = scene.moving
        self._turn: Turn | None = None
        if self._grip is None:
            self._direction = _unit(_last(scene.tractions[0].rate)) if scene.tractions else np.zeros(0)
            return
        if isinstance(self._grip, Rotation):
            self._turn = loading.turns[[grip for grip in scene.grips if isinstance(grip, Rotation)].index(self._grip)]
            self._direction = _unit(_last((self._grip.angle,)))
            return
        self._nodes = scene.sample.nodes(self._grip.boundary)
        self._direction = _unit(_last(self._grip.velocity))
        other = scene.opposite
        self._others = None if other is None else scene.sample.nodes(other.boundary)
        self._clock = not any(isinstance(v, Ramp) for grip in (self._grip, other) if grip for v in grip.velocity)

    def load(self, reaction: np.ndarray, u: np.ndarray) -> float:
        """The load [N; N/mm in 2D] for the `reaction`, force of the body less the loads, at displacement `u` (n, dim).
        """
        if self._turn is not None:
            x = self.scene.sample.space.X + u
            return float(self._direction[0]) * self._turn.moment(x, reaction) / self._turn.radius
        if self._grip is not None:
            return float((reaction[self._nodes] @ self._direction).sum())
        loads, followers = self.loading.tractions, self.loading.followers
        if loads is None and followers is not None:
            return float(followers.pressures(u)[0] * followers.area(u)[0])
        return 0.0 if loads is None else float(loads.resultant(0) @ self._direction)

    def displacement(self, state: State) -> float:
        """The displacement [mm]."""
        if self._grip is None:
            if self.loading.tractions is None and (followers := self.loading.followers) is not None:
                return float(followers.swept(state.u)[0] / followers.areas[0])
            return self._of_traction(state.u)
        if self._turn is not None:
            return float(self._direction[0]) * self._turn.turned(state.grip) * self._turn.radius
        if self._clock:
            return state.grip * self.scene.speed
        u = state.u[self._nodes].mean(axis=0)
        return float((u if self._others is None else u - state.u[self._others].mean(axis=0)) @ self._direction)

    def _of_traction(self, u: np.ndarray) -> float:
        loads, tractions = self.loading.tractions, self.scene.tractions
        if loads is None:
            return 0.0
        moved = loads.mean(0, u)
        if tractions[-1].boundary != tractions[0].boundary:
            moved = moved - loads.mean(len(tractions) - 1, u)
        return float(moved @ self._direction)


def _last(values: Sequence[float | Ramp | None]) -> np.ndarray:
    """Rates of the components in the last stretch of time in which one of them changes."""
    ramps = [v for v in values if isinstance(v, Ramp)]
    times = sorted({0.0, *(t for v in values if isinstance(v, Ramp) for t in v.times)}, reverse=True)
    for t in times:
        rates = np.array([v.rate(t) if isinstance(v, Ramp) else v or 0.0 for v in values])
        if rates.any():
            end = min((knot for ramp in ramps for knot in ramp.times if knot > t), default=t)
            middle = np.array([v.value(0.5 * (t + end)) if isinstance(v, Ramp) else 0.0 for v in values])
            return -rates if float(middle @ rates) < 0.0 else rates
    return np.zeros(len(values))


def _unit(vector: np.ndarray) -> np.ndarray:
    unit: np.ndarray = vector / (np.linalg.norm(vector) or 1.0)
    return unit
