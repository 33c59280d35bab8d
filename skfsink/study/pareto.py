"""Pareto front of points of cost and error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

__all__ = ["pareto_front"]


def pareto_front(cost: Sequence[float], error: Sequence[float]) -> list[int]:
    """Numbers of the points that no other one beats in both `cost` and `error`, by rising cost.

    A point is beaten by one that is as good in both and better in one. A lower error counts if it is so by more than a
    millionth: what differs by rounding is equal, and of equal points the first is kept. Points that are not finite are
    never on the front.
    """
    cost_, error_ = np.asarray(cost, float), np.asarray(error, float)
    front: list[int] = []
    best = np.inf
    for i in np.lexsort((error_, cost_)):
        if np.isfinite(cost_[i]) and error_[i] < (1 - 1e-6) * best:
            front.append(int(i))
            best = float(error_[i])
    return front
