"""Pieces shared by the two force loops: the width of a tile, and J^(-2/3) without division or library calls."""

from __future__ import annotations

import numpy as np

from ...material import crushed
from ...material.crushed import J_FLOOR
from ...system.jit import njit

LANES = 32             #: quadrilaterals in a tile
LANES_3D = 16          #: hexahedra in a tile; their working set is eight times as large
FAST = {"contract", "arcp", "nsz", "reassoc"}  #: floating-point freedoms that keep NaN and infinity as they are

GAUSS_LOW = 0.5 - 0.5 / np.sqrt(3.0)
GAUSS_HIGH = 0.5 + 0.5 / np.sqrt(3.0)


@njit(fastmath=FAST)
def guess_inverse_cbrt(bits, guess):  # type: ignore[no-untyped-def]
    """Bit patterns of J > 0 to those of J^(-1/3), within 4 %: a third of the exponent, the sign turned."""
    for i in range(bits.size):
        guess[i] = 0x553EF0FF289DD796 - np.int64(np.float64(bits[i]) * (1.0 / 3.0))


@njit(fastmath=FAST)
def refine_inverse_cbrt(J, r):  # type: ignore[no-untyped-def]
    """r ~ J^(-1/3) to J^(-2/3) by two fourth-order Householder steps on 1 - J r^3 = 0 (4e-2 -> 1e-5 -> 1e-16).

    J is turned into 1/J.
    """
    for i in range(J.size):
        s = r[i]
        h = 1.0 - J[i] * s * s * s
        s = s * (1.0 + h * (1 / 3.0 + h * (2 / 9.0 + h * (14 / 81.0))))
        h = 1.0 - J[i] * s * s * s
        s = s * (1.0 + h * (1 / 3.0 + h * (2 / 9.0 + h * (14 / 81.0))))
        r[i] = s * s
        J[i] = s * s * s


crush_factor = njit(crushed.crush_factor)


@njit(fastmath=FAST)
def continue_below_floor(J, inverse, R):  # type: ignore[no-untyped-def]
    """R = J^(-2/3) and 1/J, found at `J_FLOOR` where J is below it, to what they are there; see :mod:`.crushed`."""
    count = 0
    for i in range(J.size):
        count += J[i] < J_FLOOR
    if count:
        for i in range(J.size):
            if J[i] < J_FLOOR:
                R[i] *= crush_factor(J[i])
                inverse[i] /= crush_factor(J[i])
