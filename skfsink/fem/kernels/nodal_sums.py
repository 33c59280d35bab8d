"""Sums at the nodes of what the elements have there, by one thread or several; no sum depends on how many."""

from __future__ import annotations

from ...system.jit import njit, prange

__all__ = ["SUMS"]


@njit
def _sums(local, start, offset, lanes, out, first, last):  # type: ignore[no-untyped-def]
    """Of the nodes from `first` to `last`: entries of node a begin at start[a], component i of one i lanes on."""
    dim = out.shape[1]
    two = 2 * lanes
    for a in range(first, last):
        f0, f1, f2 = 0.0, 0.0, 0.0
        for k in range(start[a], start[a + 1]):
            at = offset[k]
            f0 += local[at]
            f1 += local[at + lanes]
            if dim == 3:
                f2 += local[at + two]
        out[a, 0] = f0
        out[a, 1] = f1
        if dim == 3:
            out[a, 2] = f2


@njit(cache=True)
def _alone(local, start, offset, lanes, out):  # type: ignore[no-untyped-def]
    _sums(local, start, offset, lanes, out, 0, out.shape[0])
    return 0.0


@njit(cache=True, parallel=True)
def _shared(local, start, offset, lanes, out, returned):  # type: ignore[no-untyped-def]
    shares, n = returned.size, out.shape[0]
    for s in prange(shares):
        _sums(local, start, offset, lanes, out, n * s // shares, n * (s + 1) // shares)
        returned[s] = 0.0


#: for one thread, and for several; see :mod:`.shared`
SUMS = _alone, _shared
