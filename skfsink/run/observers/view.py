"""A run as its observers see it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from ...fields.body import Body
from ...fields.crack import CrackTracker, Tips
from ...fields.state import State
from ...methods.integrators import Integrator
from ...methods.looked import Looked, OneBody
from ...scene.scene import Scene
from .gauge import Gauge

__all__ = ["View"]


@dataclass(eq=False)
class View:
    """A run at a moment: the scene, the state, and what follows from them.

    Observers change nothing in it, but for :class:`.Crack`, which looks first and sets `tips`, `moment` and `waiting`
    for all others; an observer in its place has to set them too.

    Memory: all of it: the run moves it on with `at`, and `load`, `displacement`, `reaction`, `stress`,
    `stress_is_known`, `crushed`, `step_share` and `crossed_multiple_of` are of the moment it is at.

    Attributes
    ----------
    scene, folder, body: what is computed, where its files go, its balances.
    state: the fields now.
    dt: the last time step [s], 0 in statics.
    before: time of the state at the step before [s], or number of the pass.
    way: in loading, how far it has come, in its largest increments.
    increment: the next load increment [s].   end: of the event at the latest [s].
    occasion: "loading", or in the event "begin", "step" or "end".
    integrator: of the dynamic event, if there is one.
    tracker, tips: the crack, and its tips when it was last looked for.
    moment: what has come with this step: "arrival", "branching", or "".
    on_time: whether the event begins at a load time that was given, before anything fails.
    waiting: whether a body from rest in motion has not cracked yet, which may take thousands of records.
    framed: whether a frame was written at this moment by the ranks themselves, without the stress of the whole body.
    release: greatest energy release rate of a tip [N/mm] at the last look of the first :class:`.EnergyRelease`,
        which sets it as a run begins, and speed of that tip [m/s], each NaN if it is not known; None without one.
    save: writes a checkpoint.   stop_asked: whether the run was asked to stop.
    """

    scene: Scene
    folder: Path
    body: Body
    tracker: CrackTracker
    tips: Tips
    state: State
    integrator: Integrator | None = None
    dt: float = 0.0
    before: float = 0.0
    way: float = 0.0
    increment: float = 0.0
    end: float = np.inf
    occasion: str = "loading"
    moment: str = ""
    on_time: bool = False
    waiting: bool = False
    framed: bool = False
    release: Callable[[View], tuple[float, float]] | None = None
    save: Callable[[], None] = lambda: None
    stop_asked: Callable[[], bool] = lambda: False

    RARER = 50.0  # times the interval between two looks, while the run is waiting

    def __post_init__(self) -> None:
        self.now = self.state.time
        self._stress: np.ndarray | None = None
        self._reaction: np.ndarray | Callable[[], np.ndarray] = np.zeros((0, 0))

    @property
    def reaction(self) -> np.ndarray:
        """Internal force less the dead loads at the displacement, (n, dim) [N; N/mm in 2D]."""
        if not isinstance(self._reaction, np.ndarray):
            self._reaction = self._reaction()
        return self._reaction

    @cached_property
    def gauge(self) -> Gauge:
        """What is reported as load and displacement."""
        return Gauge(self.scene, self.body.loading)

    @property
    def load(self) -> float:
        """The load [N; N/mm in 2D]."""
        return self.gauge.load(self.reaction, self.state.u)

    @property
    def displacement(self) -> float:
        """The displacement [mm]."""
        return self.gauge.displacement(self.state)

    @property
    def quasistatic(self) -> bool:
        """Whether the event is quasi-static: it counts passes, and has no time."""
        return self.scene.controls.analysis == "quasistatic"

    @property
    def clock(self) -> str:
        """What the time of the event counts: "s" or "pass"."""
        return "pass" if self.quasistatic else "s"

    @property
    def looked(self) -> Looked:
        """What knows the stress of the body: the integrator, if there is one."""
        return OneBody(self.body) if self.integrator is None else self.integrator

    @property
    def stress(self) -> np.ndarray:
        """Mean Cauchy stress of the elements [MPa], (ne, 6); see :func:`.cauchy_stress`."""
        if self._stress is None:
            self._stress = self.looked.stress(self.state)
        return self._stress

    @property
    def stress_is_known(self) -> bool:
        """Whether an observer before has asked for the stress of this state."""
        return self._stress is not None

    @property
    def crushed(self) -> np.ndarray:
        """Mask of the elements that no stress is defined for, (ne,)."""
        known = self.looked.crushed(self.state) if self._stress is None else None
        mask: np.ndarray = np.isnan(self.stress).any(axis=1) if known is None else known
        return mask

    @property
    def step_share(self) -> float:
        """The step over its stability limit at this state; infinite where an integrator has none."""
        return np.inf if self.integrator is None else self.integrator.step_share(self.state)

    def at(self, state: State, reaction: np.ndarray | Callable[[], np.ndarray], occasion: str = "loading", *,
           dt: float = 0.0, way: float = 0.0) -> View:
        """Move on to a state; see the attributes. The `reaction` may be what gives it when it is asked for."""
        self.before = state.time if occasion == "begin" else self.now
        self.now = state.time
        self.state, self._reaction, self.occasion, self.dt, self.way = state, reaction, occasion, dt, way
        self.moment, self._stress, self.framed = "", None, False
        return self

    def crossed_multiple_of(self, every: float) -> bool:
        """Whether a multiple of `every` [s], or passes, has been passed in this step."""
        step = (self.RARER if self.waiting else 1.0) * every
        return int(self.state.time / step) != int(self.before / step)
