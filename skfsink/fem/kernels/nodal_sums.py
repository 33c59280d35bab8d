"""Sums at the nodes of what the elements have there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...system.jit import njit

__all__ = ["Sums", "sum_at_nodes"]


class Sums(NamedTuple):
    """Nodes, and where their sums go.

    Attributes
    ----------
    start: where the entries of each node begin, and where those of the last one end, (n+1,).   out: sums (n, dim).
    """

    start: np.ndarray
    out: np.ndarray

    def share(self, s: int, shares: int) -> Sums:
        """Share number `s` of `shares`: a run of neighbouring nodes."""
        n = len(self.out)
        a, b = n * s // shares, n * (s + 1) // shares
        return Sums(self.start[a:b + 1], self.out[a:b])


@njit(cache=True, nogil=True)
def sum_at_nodes(local, offset, lanes, nodes):  # type: ignore[no-untyped-def]
    """Add the entries `offset` of what is `local`; component i of an entry is i lanes on."""
    start, out = nodes.start, nodes.out
    n, dim = out.shape
    two = 2 * lanes
    for a in range(n):
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
    return 0.0
