"""Pieces of an outline: straight lines and circular arcs."""

from __future__ import annotations

import math
from typing import NamedTuple

__all__ = ["Edge", "Point", "circle"]

Point = tuple[float, float]


class Edge(NamedTuple):
    """A piece of an outline, from where the one before ended to `end`: straight, or an arc through `via`.

    Elements along an arc around which the body lies, such as the tip of a notch, are of size `h` [mm] if there is one:
    see :mod:`.ring`.
    """

    name: str
    end: Point
    via: Point | None = None
    h: float | None = None


def circle(start: Point, via: Point, end: Point) -> tuple[Point, float, float, float]:
    """Centre and radius of the arc from `start` through `via` to `end`, its angle at the start, and what it turns by.

    Angles are in radian; the turn is positive if counter-clockwise.
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
