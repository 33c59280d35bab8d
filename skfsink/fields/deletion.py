"""Failed elements: deleted when the relative density is spent at every Gauss point (Sec. 4)."""

from __future__ import annotations

import numpy as np

from ..fem.space import Space
from ..system.jit import njit
from .density import DensitySolver
from .fragments import debris
from .momentum import Momentum
from .state import State

__all__ = ["delete_debris", "delete_failed", "left_in"]

GONE = 800.0  # W/Phi from which on H is zero in double precision, for any m


def delete_failed(space: Space, state: State, threshold: float, failure_energy: float | np.ndarray) -> np.ndarray:
    """Mark the elements that failed since the last accepted state; returns their numbers, ascending.

    An element fails when gamma <= `threshold` at all its Gauss points. It is logged with the time, and its area
    (volume) times psi_f, a number or one for each element (ne,), is added to U (Eq. 30). Call it on accepted states
    only: a trial that is given up must not leave holes.
    """
    failed = np.flatnonzero(_spent(state.gamma, space.nodes, space.N, threshold, state.deleted))
    if failed.size:
        state.deleted[failed] = True
        state.deletions.extend((state.time, int(e)) for e in failed)
    if space.exchange.total(failed.size):
        if isinstance(failure_energy, np.ndarray):
            used = float(failure_energy[failed] @ space.V[failed])
        else:
            used = failure_energy * float(space.V[failed].sum())
        state.ledger.paper += space.exchange.total(used)
    return failed


def delete_debris(state: State, density: DensitySolver, held: np.ndarray) -> np.ndarray:
    """Mark the elements of :func:`.debris`, of pieces without a node that is `held` (n,); returns their numbers.

    They are logged as failed elements are, but are no part of U: they have not failed. Their history becomes that of
    failed elements, so that gamma goes to zero there with the next solve.
    """
    found = debris(density.space, state.gamma, state.deleted, held, density.law.length_scale)
    if found.size:
        state.deleted[found] = True
        state.deletions.extend((state.time, int(e)) for e in found)
        phi = np.broadcast_to(density.phi, state.W_max.shape)
        state.W_max[found] = np.maximum(state.W_max[found], GONE * phi[found])
    return found


def left_in(momentum: Momentum, gamma: np.ndarray, failed: np.ndarray) -> float:
    """Stored energy [N mm; N mm/mm in 2D] that the elements `failed` still bear at the nodal density `gamma` (n,).

    It is that of the last force evaluation, and zero where `gamma` is below the force floor at all Gauss points, as
    with the defaults: elements that fail bear no force any more.
    """
    at_gauss = momentum.effective(gamma, np.zeros(momentum.space.n_elements, bool))[failed]
    left = 0.0
    if at_gauss.any():
        left = float(np.einsum("eq,eq,eq->", momentum.space.w[failed], at_gauss, momentum.W[failed]))
    return momentum.space.exchange.total(left)


@njit(cache=True)
def _spent(nodal, conn, N, threshold, deleted):  # type: ignore[no-untyped-def]
    """Mask of the elements, not yet deleted, whose Q1 field is at most `threshold` at all Gauss points."""
    out = np.zeros(conn.shape[0], np.bool_)
    nq, na = N.shape
    for e in range(conn.shape[0]):
        if deleted[e]:
            continue
        out[e] = True
        for q in range(nq):
            value = 0.0
            for a in range(na):
                value += N[q, a] * nodal[conn[e, a]]
            if value > threshold:
                out[e] = False
                break
    return out
