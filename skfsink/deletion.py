"""Failed elements: deleted when the relative density is spent at every Gauss point (Sec. 4)."""

from __future__ import annotations

import numpy as np

from .space import Space
from .state import State

__all__ = ["delete_failed"]


def delete_failed(space: Space, state: State, threshold: float, failure_energy: float) -> np.ndarray:
    """Mark the elements that failed since the last accepted state; returns their numbers, ascending.

    An element fails when gamma <= `threshold` at all its Gauss points. It is logged with the time, and its area
    (volume) times psi_f is added to U (Eq. 30). Call it on accepted states only: a trial that is given up must not
    leave holes.
    """
    spent = space.at_gauss(state.gamma) <= threshold
    failed = np.flatnonzero(spent.all(axis=1) & ~state.deleted)
    if failed.size:
        state.deleted[failed] = True
        state.deletions.extend((state.time, int(e)) for e in failed)
        state.ledger.paper += failure_energy * float(space.V[failed].sum())
    return failed
