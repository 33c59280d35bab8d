"""A crushed point: how J^(-2/3) goes on where the volume ratio J comes close to zero, or is negative.

Of a point that is pressed flat or turned inside out J^(-2/3) has no meaning, and its derivative no bound. Below a floor
J_0 it goes on by its tangent,

    R(J) = J_0^(-2/3) s,   s = 1 + 2/3 (1 - J/J_0)   for J < J_0,

so that energy and stress are finite and continuous for every deformation, the stress is the derivative of the energy,
and a point that is inside out is driven back.
"""

from __future__ import annotations

import numpy as np

__all__ = ["J_FLOOR", "crush_factor", "crushed"]

J_FLOOR = 0.02  #: J_0, below which a point is crushed


def crush_factor(J, floor=J_FLOOR):  # type: ignore[no-untyped-def]
    """The factor s below the floor; of numbers in compiled loops, of arrays beside them."""
    return 1.0 + 2 / 3.0 * (1.0 - J / floor)


def crushed(J: np.ndarray, floor: float = J_FLOOR) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """J not below the floor, the factor s, and J_e with R' = -2/3 R/J_e, which is J above the floor."""
    floored = np.maximum(J, floor)
    s = np.ones_like(floored)
    if floor > 0.0:
        s = np.where(floor > J, crush_factor(J, floor), 1.0)
    return floored, s, floored * s
