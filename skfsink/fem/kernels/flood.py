"""The elements that some reach over sides, among those that are marked, and the sides at which they end."""

from __future__ import annotations

import numpy as np

from ...system.jit import njit

__all__ = ["flood"]


@njit(cache=True)
def flood(sides, elements, marked, start, reached, ends):  # type: ignore[no-untyped-def]
    """Let `reached` (ne,) spread from the elements `start` (k,), which are `marked` (ne,), to marked ones over sides.

    `sides` (k, ne) are those of the elements, and `elements` (2, sides) those of a side, the second -1 at the surface.
    `ends` (sides,) becomes 1 where the first element of a side is not marked and the second is reached, 2 where the
    second is not marked and the first is reached.
    """
    waiting, count = np.empty(marked.sum(), np.int64), 0
    for e in start:
        if not reached[e]:
            reached[e] = True
            waiting[count] = e
            count += 1
    while count > 0:
        count -= 1
        here = waiting[count]
        for k in range(sides.shape[0]):
            side = sides[k, here]
            which = 0 if elements[1, side] == here else 1
            there = elements[which, side]
            if there < 0:
                continue
            if not marked[there]:
                ends[side] = which + 1
            elif not reached[there]:
                reached[there] = True
                waiting[count] = there
                count += 1
