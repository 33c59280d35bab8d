"""A notched plate loaded to its onset once, from which the events of a study start; nothing is written to disk."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Any, Protocol

import numpy as np

from ..errors import ConvergenceError, InstabilityError
from ..fields.body import Body
from ..fields.density import Density, DensitySolver
from ..fields.momentum import Momentum
from ..fields.state import State
from ..loads.grips import Grip
from ..material import AAA, Material, SinkLaw, limiter_of, material_from
from ..meshing.sample import Sample
from ..methods.controls import ExplicitControls, HHTControls, StaticsControls
from ..methods.explicit import Explicit
from ..methods.hht import HHT
from ..methods.statics import Statics
from ..scene.scene import Scene
from .meshes import load_plate

__all__ = ["NO_REJECTION", "PULLED", "SLAB", "SPEED", "Front", "Integrator", "Make", "Plate", "first_passages", "warm"]

#: options of the two integrators with which no step is rejected for its energy
NO_REJECTION = ExplicitControls(energy_tolerance=0.0), HHTControls(gain_tolerance=1.0)
SPEED = 1e-3  # of a grip [mm/s]; it only sets the clock of the loading
#: both ends of a plate move apart and are held sideways
PULLED = (Grip("top", (0.0, SPEED)), Grip("bottom", (0.0, -SPEED)))
#: the same for a slab of hexahedra whose faces are held in z: plane strain
SLAB = (Grip("top", (0.0, SPEED, 0.0)), *(Grip(face, (None, None, 0.0)) for face in ("back", "front")),
        Grip("bottom", (0.0, -SPEED, 0.0)))


class Integrator(Protocol):
    """What an event asks of an integrator."""

    @property
    def rejected(self) -> int:
        """Steps that were made again, shorter."""

    def begin(self, state: State) -> None:
        """Set the body in motion."""

    def run(self, state: State, t_end: float) -> Iterator[State]:
        """Step until `t_end` [s], yielding the state after each step."""


Make = Callable[["Plate"], Integrator]


class _Exact(DensitySolver):
    """Solves for gamma to the full tolerance every time."""

    def update(self, W_max: np.ndarray, before: Density, tolerance: float | None = None) -> Density:
        return super().update(W_max, before)


@dataclass(frozen=True, eq=False)
class Plate:
    """A notched plate between grips, and how it is modelled.

    Parameters
    ----------
    sample: the plate; its boundary `notch` ends at the tip, and the crack runs on in x.
    grips: what moves it.   parts: how many bodies like this make the whole plate, 2 for a half.
    material, law: stored energy and sink.
    sink, element, force_floor, deletion, overshoot: as those of :class:`.Controls`.
    exact: solve for gamma to the full tolerance in every step, for references.
    onset_tolerance: width of the last interval of the bisection for the onset, relative to the load.
    """

    sample: Sample
    grips: tuple[Grip, ...] = PULLED
    parts: int = 1
    material: Material = field(default_factory=AAA)
    law: SinkLaw = field(default_factory=SinkLaw)
    sink: str = "lumped"
    element: str = "jbar"
    force_floor: float = 1e-3
    deletion: float = 1e-6
    overshoot: float = 0.005
    exact: bool = False
    onset_tolerance: float = 5e-4

    @classmethod
    def of_law(cls, sample: Sample, law: str, **settings: Any) -> Plate:
        """The plate of a law of the library, by name, with its own limiter; `settings` are other parameters."""
        return cls(sample, material=material_from(law), law=SinkLaw(phi=limiter_of(law).phi), **settings)

    @cached_property
    def scene(self) -> Scene:
        """The body as a scene, which knows what is held."""
        return Scene("study", "study", {}, self.sample, self.material, self.law, self.grips)

    @cached_property
    def body(self) -> Body:
        """Its balances, and what loads it."""
        momentum = Momentum(self.sample.space, self.material, self.element, self.force_floor)
        density = (_Exact if self.exact else DensitySolver)(self.sample.space, self.law, self.sink)
        return Body(momentum, density, self.scene.loading(), self.deletion)

    @property
    def momentum(self) -> Momentum:
        """The balance of momentum."""
        return self.body.momentum

    @property
    def density(self) -> DensitySolver:
        """The balance of mass."""
        return self.body.density

    def held_at(self, opening: float) -> dict[str, float]:
        """:meth:`figures` of the intact plate in equilibrium at an opening of the grips [mm]."""
        state, statics = State.intact(self.sample.space), self.statics()
        state.grip = opening / (2 * SPEED)
        self.momentum.set_gamma(state.gamma, state.deleted)
        move = self.body.loading.velocity(0.0) * state.grip
        state.u, _ = statics.newton.equilibrium(statics.newton.predict(state.u, move))
        statics.newton.release()
        return self.figures(state)

    def statics(self) -> Statics:
        """A new solver of equilibria."""
        return Statics(self.body, StaticsControls(onset_tolerance=self.onset_tolerance))

    def figures(self, state: State) -> dict[str, float]:
        """Opening of the grips [mm], force on the first [N/mm], elastic energy [N mm/mm] of the whole plate."""
        self.momentum.set_gamma(state.gamma, state.deleted)
        force = self.momentum.force(state.u)
        grip = self.grips[0]
        along = np.array([v or 0.0 for v in grip.velocity]) / SPEED
        reaction = float((force[self.sample.nodes(grip.boundary)] @ along).sum())
        thickness = self.thickness
        return {"opening_mm": state.grip * 2 * SPEED, "reaction_N_per_mm": reaction / thickness,
                "elastic_N": self.momentum.energy * self.parts / thickness}

    @property
    def thickness(self) -> float:
        """Thickness of a slab [mm], 1 in plane strain: figures are those for a unit of it."""
        X = self.sample.space.X
        return float(np.ptp(X[:, 2])) if X.shape[1] == 3 else 1.0

    @cached_property
    def _loaded(self) -> tuple[State, dict[str, float]]:
        state = State.intact(self.sample.space)
        cpu = time.process_time()
        for _ in self.statics().load(state):
            pass
        cpu = time.process_time() - cpu
        return state, {**self.figures(state), "gamma_min": float(state.gamma.min()), "loading_cpu_s": cpu}

    @property
    def onset(self) -> State:
        """A copy of the state at the onset, found once."""
        return self._loaded[0].copy()

    @property
    def onset_figures(self) -> dict[str, float]:
        """:meth:`figures` at the onset, with the least gamma and the processor time of the loading."""
        return self._loaded[1]

    def explicit(self, controls: ExplicitControls) -> Explicit:
        """The explicit integrator of this plate."""
        return Explicit(self.body, controls)

    def hht(self, controls: HHTControls) -> HHT:
        """The implicit integrator of this plate."""
        return HHT(self.body, controls)

    def event(self, make: Make, run: float = 1.0, places: int = 20, limit: float = 1.5e-4) -> dict[str, Any]:
        """Let the crack run from just past the onset until its tip has gone `run` [mm].

        Returns
        -------
        `arrival_us`: when the tip passed +`run`, interpolated within the step.   `passed_us`: when it passed each of
        `places` equal parts of the way.   `D`, `U`: energies at the arrival [N mm/mm].   `steps`, `rejected`,
        `dt_us`: number of steps, of those made again, and their mean size.   `cpu_s`: processor time of the integration
        alone.

        Raises
        ------
        ConvergenceError
            The crack has not gone that far after `limit` [s], or the integrator gives up.
        InstabilityError
            The ledger is open, or energy was fed in, by more than 5 % of that of the onset.
        """
        state = self.onset
        state.begin_event(self.overshoot)
        integrator = make(self)
        front = Front(self.sample)
        integrator.begin(state)
        marks = np.linspace(0, run, places + 1)[1:]
        track = [(0.0, 0.0, 0.0, 0.0)]
        steps = integrator.run(state, limit)
        cpu, seen = 0.0, state.gamma
        while track[-1][1] < run:
            before = time.process_time()
            done = next(steps, None)
            cpu += time.process_time() - before
            if done is None:
                raise ConvergenceError(f"the crack has run {track[-1][1]:.2f} mm of {run:g} mm in {limit * 1e6:g} µs")
            if state.gamma is not seen:
                seen = state.gamma
                way = max(front.tip(seen), track[-1][1])
                track.append((state.time, way, state.ledger.sink, state.ledger.paper))
                self._guard(state)
        times, way, sink, paper = np.array(track).T
        passed = first_passages(times, way, marks)
        scale = self.parts / self.thickness
        return {"arrival_us": passed[-1] * 1e6, "passed_us": passed * 1e6,
                "D": float(np.interp(passed[-1], times, sink)) * scale, "U": paper[-1] * scale, "steps": state.step,
                "rejected": integrator.rejected, "dt_us": state.time / state.step * 1e6, "cpu_s": cpu}

    def _guard(self, state: State) -> None:
        ledger = state.ledger
        worst = max(ledger.error(ledger.initial), -ledger.numerical / ledger.initial)
        if not worst <= 0.05:
            raise InstabilityError(f"the ledger is open, or energy was fed in, by {worst:.2%} of that of the onset at "
                                   f"{state.time * 1e6:.2f} µs")


class Front:
    """How far a crack has come: the farthest point in x of the line gamma = 0.1, from the tip of the notch [mm]."""

    GAMMA = 0.1

    def __init__(self, sample: Sample) -> None:
        space = sample.space
        X, notch = space.X, sample.nodes("notch")
        self._tip = float(X[notch, 0].max())
        rows = np.repeat(np.arange(space.n_nodes), np.diff(space.graph.indptr))
        cols = space.graph.indices
        # not where a crack may start at the grips
        near = abs(X[:, 1] - X[notch[np.argmax(X[notch, 0])], 1]) < 0.3 * float(np.ptp(X[:, 0]))
        keep = (rows < cols) & near[rows] & near[cols]
        self._a, self._b, self._x = rows[keep], cols[keep], X[:, 0]

    def tip(self, gamma: np.ndarray) -> float:
        """Its distance for the nodal values `gamma` (n,), linear along the lines between nodes of an element."""
        low, high = gamma[self._a], gamma[self._b]
        cut = (low < self.GAMMA) != (high < self.GAMMA)
        if not cut.any():
            return 0.0
        a, b, low, high = self._a[cut], self._b[cut], low[cut], high[cut]
        part = (self.GAMMA - low) / (high - low)
        return max(0.0, float((self._x[a] + part * (self._x[b] - self._x[a])).max()) - self._tip)


def first_passages(times: Sequence[float] | np.ndarray, way: np.ndarray, marks: np.ndarray) -> np.ndarray:
    """When a way that never falls first reached each of `marks`, linear within a step; it must reach them all."""
    after = np.searchsorted(way, marks, side="left")
    t, x = np.asarray(times), np.asarray(way)
    before = np.maximum(after - 1, 0)
    rise = np.where(after > 0, x[after] - x[before], 1.0)
    return np.where(after > 0, t[before] + (marks - x[before]) / rise * (t[after] - t[before]), t[0])


@cache
def warm(dim: int) -> None:
    """Compile or load all that runs need, so that the first one that is measured is not charged for it."""
    plate = Plate(load_plate("plate0", slab=None if dim == 2 else (0.05, 1)), PULLED if dim == 2 else SLAB)
    plate.event(lambda plate: plate.explicit(ExplicitControls()), run=0.05)
    if dim == 2:
        plate.event(lambda plate: plate.hht(HHTControls()), run=0.05)
