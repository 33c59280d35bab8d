"""What this machine can do at most, and the share of it that an explicit step reaches.

Bandwidth is that of the triad a = b + s c on arrays that fit no cache; the peak is that of multiply-adds on registers.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numba import njit, prange, set_num_threads

#: Bytes the force loops have to move for one element: read or written once each, nothing kept in a cache. Elements:
#: connectivity, geometry (d xi/d X, weights), gamma, W and energy written, nodal forces written and read again with
#: their places. Nodes (one an element): position, force.
FORCE_BYTES = {2: 16 + 160 + 32 + 40 + 128 + 20 + 32, 3: 32 + 640 + 64 + 72 + 384 + 36 + 48}

#: What an explicit step moves besides. Elements: W read, greatest W read and written. Nodes: X, mass, u, v, a read and
#: written, the old force.
STEP_BYTES = {2: FORCE_BYTES[2] + 96 + 136, 3: FORCE_BYTES[3] + 192 + 200}

#: Floating-point operations of the force loops for one element, counted in the source (an addition, a multiplication
#: or a division is one). At a Gauss point: F 32 (3D 45), J and F:F 12 (31), J^(-2/3) 25, law and factors 16 (20),
#: stress and pull-back 24 (99), energy 4; besides, reference gradients (3D), J_bar and nodal forces 80 (600).
FLOPS = {2: 4 * (32 + 12 + 25 + 16 + 24 + 4) + 80, 3: 8 * (45 + 31 + 25 + 20 + 99 + 4) + 600}


@njit(parallel=True, fastmath=True)
def _triad(a, b, c):  # type: ignore[no-untyped-def]
    for i in prange(a.size):
        a[i] = b[i] + 3.0 * c[i]


@njit(parallel=True, fastmath=True)
def _multiply_add(out, rounds):  # type: ignore[no-untyped-def]
    for p in prange(out.size // 128):
        x = np.empty(128)
        for i in range(128):
            x[i] = i * 1e-3
        for _ in range(rounds):
            for i in range(128):  # sixteen vectors of eight: enough to hide the latency
                x[i] = x[i] * 0.999 + 1e-3
        for i in range(128):
            out[128 * p + i] = x[i]


def _best(function: Any, repeat: int) -> float:
    function()
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def limits(threads: int) -> dict[str, float]:
    """Greatest bandwidth [GB/s] and speed [GFlop/s] seen with that many threads."""
    set_num_threads(threads)
    a, b, c = (np.ones(16_000_000) for _ in range(3))
    bandwidth = 32 * a.size / _best(lambda: _triad(a, b, c), 8) / 1e9  # with a read before it is written
    out, rounds = np.empty(128 * threads), 2_000_000
    speed = 2 * out.size * rounds / _best(lambda: _multiply_add(out, rounds), 4) / 1e9
    return {"threads": threads, "bandwidth_GB_per_s": bandwidth, "peak_GFlop_per_s": speed}


def reached(dim: int, elements: int, ms: float, most: dict[str, float], moved: int) -> dict[str, float]:
    """Bytes, `moved` for an element, and operations of what takes `ms`, and the share of `most` that it reaches."""
    traffic, work = moved * elements / ms / 1e6, FLOPS[dim] * elements / ms / 1e6
    return {"bytes_an_element": moved, "flops_an_element": FLOPS[dim], "GB_per_s": traffic, "GFlop_per_s": work,
            "share_of_bandwidth": traffic / most["bandwidth_GB_per_s"],
            "share_of_peak": work / most["peak_GFlop_per_s"]}
