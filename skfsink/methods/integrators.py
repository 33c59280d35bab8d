"""The integrators in time by name: adding one is its class, and a line in `INTEGRATORS`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from ..fields.body import Body
from ..fields.state import State
from .controls import EventControls
from .explicit import Explicit
from .hht import HHT
from .looked import Looked

__all__ = ["INTEGRATORS", "Integrator"]


class Integrator(Looked, Protocol):
    """What a run asks of an integrator: it advances a :class:`.State` in place."""

    @classmethod
    def of(cls, body: Body, controls: EventControls) -> Integrator:
        """The integrator of a body; `controls` are the :class:`.Controls` of its scene."""
        raise NotImplementedError

    @property
    def dt(self) -> float:
        """Size of the step [s], a column of the history."""

    @property
    def reaction(self) -> np.ndarray:
        """Internal force less the dead loads (n, dim) at the current displacement."""

    @property
    def rejected(self) -> int:
        """Steps that were tried and made again, shorter."""

    @property
    def added_mass(self) -> float:
        """Mass that elements have got, lest they shorten the step, of that of the intact body."""

    @property
    def factorisations(self) -> int:
        """Numerical factorisations made so far."""

    def begin(self, state: State) -> None:
        """At the start of the event: velocities, accelerations, and the ledger's first energies."""

    def run(self, state: State, t_end: float) -> Iterator[State]:
        """One accepted step, then `yield state`, until `t_end` [s]."""

    def step_share(self, state: State) -> float:
        """The step over its stability limit at `state`; infinity where there is no limit. Nothing is changed."""

    def sync(self, state: State) -> None:
        """Bring the state up to date, if parts of it are kept elsewhere."""

    def memory(self) -> dict[str, np.ndarray]:
        """Arrays by name, for a checkpoint."""

    def restore(self, state: State, memory: dict[str, np.ndarray]) -> None:
        """Go on with the same bits where :meth:`memory` was taken."""


INTEGRATORS: dict[str, type[Integrator]] = {"explicit": Explicit, "hht": HHT}
