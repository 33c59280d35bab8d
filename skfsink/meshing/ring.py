"""Rings of small elements around the round tips of notches.

When a notch begins to fail is decided by the elements at its tip: the sink sees the energy at the Gauss points, which
lie below the surface, where there is less of it. An arc of an outline with an element size gets elements in rings
around it, in polar coordinates: thin at the surface, and thicker from ring to ring until they are square, out to
:data:`REACH` radii of the arc at the most. The rest of the body is meshed as without, and begins where the rings end.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import MeshError, require
from .edge import Edge, Point, circle

__all__ = ["INNER", "Ring", "joined", "parted"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

REACH = 2.0  # radii of the arc
INNER = ""   # name of the edges between the rings and what is outside of them
NEAR = 1e-6  # of the outermost radius, or of the turn: nodes that are on the edge of the rings
SIDES = 32   # of the polygon that an arc is taken for, where edges may cross


class Ring(NamedTuple):
    """The rings of elements around one arc.

    Attributes
    ----------
    arc: its name.   seams: those of the straight pieces of the outline that the rings end at, at its start and end, or
    None where they end inside of the body.
    centre: of the arc.   radius: of the arc [mm].   start, turn: angles of the arc [rad]; the body is outside of it.
    elements, layers: numbers of elements along the arc and across, even.
    growth: ratio of the thickness of one layer and the one before.   outer: radius of the outermost [mm].
    """

    arc: str
    seams: tuple[str | None, str | None]
    centre: Point
    radius: float
    start: float
    turn: float
    elements: int
    layers: int
    growth: float
    outer: float

    @property
    def step(self) -> float:
        """Angle of an element [rad]."""
        return abs(self.turn) / self.elements

    def at(self, radius: float, share: float) -> Point:
        """Point at a distance from the centre and a share of the turn."""
        angle = self.start + share * self.turn
        return self.centre[0] + radius * math.cos(angle), self.centre[1] + radius * math.sin(angle)

    def polar(self, points: Array) -> tuple[Array, Array]:
        """Distances from the centre [mm], and shares of the turn, of points (n, 2 or 3)."""
        x, y = (points[:, :2] - self.centre).T
        turned = math.copysign(1.0, self.turn) * (np.arctan2(y, x) - self.start)
        return np.hypot(x, y), ((turned + NEAR) % (2 * math.pi) - NEAR) / abs(self.turn)

    def size(self, x: float, y: float, grading: float) -> float:
        """Size of the elements at a point [mm]: that of those of the rings beside it, growing by `grading` outside.

        It is the geometric mean of their length and their thickness.
        """
        away = math.hypot(x - self.centre[0], y - self.centre[1])
        beside = min(max(away, self.radius), self.outer)
        first = (self.outer - self.radius) * (self.growth - 1) / (self.growth**self.layers - 1)
        thickness = first + (self.growth - 1) * (beside - self.radius)
        return math.sqrt(beside * self.step * thickness) + grading * max(0.0, away - self.outer)

    def quads(self) -> tuple[Array, Indices]:
        """Points (layers+1, count+1, 2), from the arc outwards, and elements (layers*count, 4), by number of these."""
        thickness = np.concatenate([[0.0], np.cumsum(self.growth ** np.arange(self.layers))])
        radii = self.radius + (self.outer - self.radius) * thickness / thickness[-1]
        angles = self.start + self.turn * np.arange(self.elements + 1) / self.elements
        directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        points = np.array(self.centre) + radii[:, None, None] * directions
        number = np.arange(points.shape[0] * points.shape[1]).reshape(points.shape[:2])
        inner, outer = number[:-1], number[1:]
        quads = np.stack([inner[:, :-1], inner[:, 1:], outer[:, 1:], outer[:, :-1]], axis=-1).reshape(-1, 4)
        return points, quads


def parted(outline: Sequence[Edge], h: float) -> tuple[list[Edge], list[Ring]]:
    """The outline of what is outside of the rings, and the rings; edges between the two are called `INNER`.

    Elements on the outermost ring are no larger than `h` [mm].

    Raises
    ------
    ParameterError
        The size of the elements along an arc is above `h`, or their aspect below 1.
    MeshError
        An edge has no name, a straight edge has an element size, the body lies inside of an arc that has one, or the
        rings have no room.
    """
    starts = [outline[i - 1].end for i in range(len(outline))]
    pieces, rings = [[edge] for edge in outline], []
    for i, edge in enumerate(outline):
        if edge.name == INNER:
            raise MeshError(f"the edge of the outline to {edge.end} has no name; give it one")
        if edge.h is None:
            continue
        ring = _around(edge, starts[i], h)
        before, after = outline[i - 1], outline[(i + 1) % len(outline)]
        seams = (before.name if _reaches(ring, 0.0, before, starts[i - 1]) else None,
                 after.name if _reaches(ring, 1.0, after, after.end) else None)
        rings.append(ring._replace(seams=seams))
        first, last = ring.at(ring.outer, 0.0), ring.at(ring.outer, 1.0)
        pieces[i] = [Edge(INNER, last, ring.at(ring.outer, 0.5))]
        if seams[0] is None:
            pieces[i].insert(0, Edge(INNER, first))
        else:
            pieces[i - 1][-1] = pieces[i - 1][-1]._replace(end=first)
        if seams[1] is None:
            pieces[i].append(Edge(INNER, edge.end))
    outside = [piece for group in pieces for piece in group]
    if rings and _crosses(outside):
        raise MeshError(f"the rings of elements around {' and '.join(dict.fromkeys(ring.arc for ring in rings))} have "
                        f"no room, out to {max(ring.outer / ring.radius for ring in rings):.3g} radii: give the arc no "
                        "element size, or the body more room there")
    return outside, rings


def _around(edge: Edge, start: Point, h: float) -> Ring:
    """The rings around an arc from `start`, with elements of at most `h` on the outermost; no seams."""
    if edge.via is None:
        raise MeshError(f"the edge {edge.name!r} is straight and has an element size: rings of elements go around an "
                        "arc; give it none")
    size = require(f"the element size along {edge.name!r}", edge.h or 0.0, "mm", low=0, high=h, low_open=True)
    aspect = require(f"the aspect of the elements along {edge.name!r}", edge.aspect, low=1)
    centre, radius, angle, turn = circle(start, edge.via, edge.end)
    if turn > 0:
        raise MeshError(f"the body lies inside of the arc {edge.name!r}, which has an element size: rings of elements "
                        "go around an arc; give it none")
    count = 2 * max(2, math.ceil(-turn * radius / size / 2 - 1e-9))
    return Ring(edge.name, (None, None), centre, radius, angle, turn, count,
                *_across(radius, -turn / count, h, aspect))


def _across(radius: float, step: float, h: float, aspect: float) -> tuple[int, float, float]:
    """Number of layers, even, their growth, and the radius of the outermost, for elements of an angle `step` [rad]."""
    outer = radius * min(REACH, max(1.0 + 4 * step, h / (radius * step)))
    thinnest, thickest = radius * step / aspect, outer * step
    layers = 2
    while True:
        growth = (thickest / thinnest) ** (1 / (layers - 1))
        if thinnest * (growth**layers - 1) / (growth - 1) >= outer - radius:
            return layers, growth, outer
        layers += 2


def _reaches(ring: Ring, share: float, edge: Edge, far: Point) -> bool:
    """Whether an edge from that end of the arc to the point `far` is straight, and is the end of the rings too."""
    near, outermost = ring.at(ring.radius, share), ring.at(ring.outer, share)
    ahead, along = np.subtract(outermost, near), np.subtract(far, near)
    lengths = float(np.hypot(*ahead)), float(np.hypot(*along))
    aside = abs(ahead[0] * along[1] - ahead[1] * along[0])
    if edge.via is not None or aside > 1e-9 * lengths[0] * lengths[1] or ahead @ along < 0:
        return False
    if not lengths[1] > lengths[0] * (1 + NEAR):
        raise MeshError(f"the boundary {edge.name!r} is {lengths[1]:.3g} mm long, too short for the rings of elements "
                        f"around {ring.arc!r}, which need more than {lengths[0]:.3g} mm")
    return True


def _crosses(outline: Sequence[Edge]) -> bool:
    """Whether two edges of an outline cross, with polygons for arcs."""
    corners = []
    for i, edge in enumerate(outline):
        start = outline[i - 1].end
        if edge.via is None:
            corners.append(start)
            continue
        (x, y), radius, angle, turn = circle(start, edge.via, edge.end)
        corners += [(x + radius * math.cos(a), y + radius * math.sin(a))
                    for a in angle + turn * np.arange(SIDES) / SIDES]
    a = np.array(corners)
    b = np.roll(a, -1, axis=0)

    def side(points: Array) -> Array:
        """Which side of each line (rows) points (columns) are on, 0 for on it."""
        ahead, to = b - a, points - a[:, None]
        turned = ahead[:, None, 0] * to[..., 1] - ahead[:, None, 1] * to[..., 0]
        return np.sign(np.where(np.abs(turned) < 1e-9 * np.abs(ahead).max() ** 2, 0.0, turned))

    apart = side(a) * side(b) < 0
    return bool((apart & apart.T).any())


def joined(ring: Ring, points: Array, quads: Indices) -> tuple[Array, Indices, list[tuple[str, Indices]]]:
    """Points (n, 3) and quadrilaterals with those of a ring, which shares their nodes where it ends.

    The third are the pieces of boundaries that are new: names, and lines (m, 2) in the sense of the outline.
    """
    grid, inside = ring.quads()
    place = np.full(grid.shape[:2], -1)
    away, share = ring.polar(points)
    there = (share > -NEAR) & (share < 1 + NEAR)
    place[-1] = _chain(there & (np.abs(away - ring.outer) < NEAR * ring.outer), share)
    for end, seam in zip((0, -1), ring.seams):
        if seam is None:
            on = (np.abs(share + end) < NEAR) & (away < ring.outer * (1 + NEAR))
            place[:, end] = _chain(on, away)
    new = place < 0
    place[new] = len(points) + np.arange(np.count_nonzero(new))
    added = np.concatenate([grid[new], np.zeros((np.count_nonzero(new), 1))], axis=1)
    chains = ((ring.seams[0], place[::-1, 0]), (ring.arc, place[0]), (ring.seams[1], place[:, -1]))
    blocks = [(name, np.stack([chain[:-1], chain[1:]], axis=1)) for name, chain in chains if name is not None]
    return np.concatenate([points, added]), np.concatenate([quads, place.ravel()[inside]]), blocks


def _chain(on: NDArray[np.bool_], along: Array) -> Indices:
    """Numbers of the nodes of a mask (n,) in the order of what they have `along` a line, (n,)."""
    nodes = np.flatnonzero(on)
    return nodes[np.argsort(along[nodes])]
