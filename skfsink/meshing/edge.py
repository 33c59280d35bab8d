"""Pieces of an outline: straight lines and circular arcs."""

from __future__ import annotations

import math
from typing import NamedTuple

__all__ = ["ALONG", "ASPECT", "Edge", "Point", "circle"]

Point = tuple[float, float]

ALONG = 6     # elements in a radius along the tip of a notch, which docs/notches.md finds enough
ASPECT = 8.0  # of the elements along an arc: length over thickness


class Edge(NamedTuple):
    """A piece of an outline, from where the one before ended to `end`: straight, or an arc through `via`.

    An arc around which the body lies, such as the tip of a notch, gets rings of elements (see :mod:`.ring`) if it has
    a size `h` [mm]: that of the elements along it, which are `aspect` times as long as they are thick.
    """

    name: str
    end: Point
    via: Point | None = None
    h: float | None = None
    aspect: float = ASPECT


def circle(start: Point, via: Point, end: Point) -> tuple[Point, float, float, float]:
    """Centre and radius of the arc from `start` through `via` to `end`, its angle at the start, and its turn.

    Angles are in radian; the turn is positive if counter-clockwise. The three points must not be on a line.
    """
    (ax, ay), (bx, by), (cx, cy) = start, via, end
    d = 2 * (ax * (by - cy) + bx * (cy - ay) + cx * (ay - by))
    a, b, c = ax * ax + ay * ay, bx * bx + by * by, cx * cx + cy * cy
    x = (a * (by - cy) + b * (cy - ay) + c * (ay - by)) / d
    y = (a * (cx - bx) + b * (ax - cx) + c * (bx - ax)) / d
    first, last = math.atan2(ay - y, ax - x), math.atan2(cy - y, cx - x)
    turn = (last - first) % (2 * math.pi)
    if (math.atan2(by - y, bx - x) - first) % (2 * math.pi) > turn:
        turn -= 2 * math.pi
    return (x, y), math.hypot(ax - x, ay - y), first, turn
