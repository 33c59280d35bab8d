"""The fields that evolve."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..fem.space import Space
from .energy import Ledger

__all__ = ["State"]


@dataclass
class State:
    """Everything a run needs to go on from where it is; arrays are owned and changed in place or replaced.

    Attributes
    ----------
    u, v, a: displacement [mm], velocity [mm/s], acceleration [mm/s^2] of the nodes, (n, dim).
    gamma: relative density of the nodes, (n,).
    sink: coefficients 1/(H + eps) that gamma was solved with, (ne, nq); None if gamma is to be solved anew.
    W_max: greatest stored energy each Gauss point has seen [MPa], (ne, nq); H follows from it (Eq. 10).
    deleted: failed elements, (ne,) bool.
    deletions: the ordered log (time, element), with `time` as below.
    grip: displacement of the grips along their velocity, as a time at that velocity [s] (the load clock).
    time: time since the start of the phase [s]; in a quasi-static event the number of the pass.
    step: steps taken in the phase (load increments, passes, time steps).
    phase: "loading", "event" or "done".
    ledger: energies of the phase.
    """

    u: np.ndarray
    v: np.ndarray
    a: np.ndarray
    gamma: np.ndarray
    W_max: np.ndarray
    deleted: np.ndarray
    sink: np.ndarray | None = None
    deletions: list[tuple[float, int]] = field(default_factory=list)
    grip: float = 0.0
    time: float = 0.0
    step: int = 0
    phase: str = "loading"
    ledger: Ledger = field(default_factory=Ledger)

    @classmethod
    def intact(cls, space: Space) -> State:
        """Undeformed, at rest, gamma = 1."""
        zero = np.zeros_like(space.X)
        return cls(zero, zero.copy(), zero.copy(), np.ones(space.n_nodes), np.zeros_like(space.w),
                   np.zeros(space.n_elements, bool))
