"""Observed rates of convergence, and the value for h = 0."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

__all__ = ["RATES", "extrapolated", "observed_rate"]

RATES = np.linspace(0.4, 4.0, 181)  # that are tried


def extrapolated(h: Sequence[float], values: Sequence[float]) -> tuple[float, float]:
    """Limit q and rate p of  values = q + C h^p  that fit best by least squares; at least three sizes h.

    With three sizes it is Richardson's extrapolation. The rate is looked for between 0.4 and 4; a limit far from the
    finest value says that the sequence does not converge in this range.
    """
    h_, v = np.asarray(h, float), np.asarray(values, float)
    best = (np.inf, 0.0, 0.0)
    for p in RATES:
        A = np.column_stack([np.ones_like(h_), (h_ / h_.max()) ** p])
        solution, *_ = np.linalg.lstsq(A, v, rcond=None)
        best = min(best, (float(np.linalg.norm(A @ solution - v)), float(solution[0]), float(p)))
    return best[1], best[2]


def observed_rate(h: Sequence[float], errors: Sequence[float]) -> float:
    """Slope of log error over log h by least squares; it is also the growth exponent of a cost over a size."""
    return float(np.polyfit(np.log(h), np.log(errors), 1)[0])
