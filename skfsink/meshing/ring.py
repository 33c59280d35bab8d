"""Rings of small, nearly square elements around the round tips of notches.

Where a notch begins to fail is decided by the elements at its tip: by how many there are, and by their shapes. An arc
of an outline with an element size `h` gets elements in rings around it, in polar coordinates: all of them nearly
square, so that they grow with the distance from the centre, out to :data:`REACH` radii of the arc. The rest of the body
is meshed as without, and begins where the rings end.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import MeshError
from .edge import Edge, Point, circle

__all__ = ["Ring", "joined", "parted"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

REACH = 2.0   # radii of the arc
ASPECT = 4.0  # of the elements along the arc: length over thickness


class Ring(NamedTuple):
    """Elements around an arc.

    Attributes
    ----------
    arc: its name.   seams: those of the straight pieces of the outline that the rings end at, at its start and end, or
    None where they end inside of the body.
    centre: of the arc.   radius: of the arc [mm].   start, turn: angles of the arc [rad]; the body is outside of it.
    count, layers: elements along the arc and across.   growth: ratio of the thickness of one layer and the one before.
    outer: radius of the outermost [mm].
    """

    arc: str
    seams: tuple[str | None, str | None]
    centre: Point
    radius: float
    start: float
    turn: float
    count: int
    layers: int
    growth: float
    outer: float

    @property
    def step(self) -> float:
        """Angle of an element [rad]."""
        return abs(self.turn) / self.count

    def at(self, radius: float, share: float) -> Point:
        """Point at a distance from the centre and a share of the turn."""
        angle = self.start + share * self.turn
        return self.centre[0] + radius * math.cos(angle), self.centre[1] + radius * math.sin(angle)

    def polar(self, points: Array) -> tuple[Array, Array]:
        """Distances from the centre [mm], and shares of the turn, of points (n, 2 or 3)."""
        x, y = (points[:, :2] - self.centre).T
        turned = np.arctan2(y, x) - self.start
        sign = math.copysign(1.0, self.turn)
        share = (sign * turned + 1e-6) % (2 * math.pi) - 1e-6
        return np.hypot(x, y), share / abs(self.turn)

    def size(self, x: float, y: float, grading: float) -> float:
        """Size of the elements at a point [mm]: that in the rings, and growing by `grading` outside of them."""
        away = math.hypot(x - self.centre[0], y - self.centre[1])
        inside = min(max(away, self.radius), self.outer)
        return inside * self.step + grading * max(0.0, away - self.outer)

    def quads(self) -> tuple[Array, Indices]:
        """Points (layers+1, count+1, 2), from the arc outwards, and elements (layers*count, 4), by number of these."""
        thickness = np.concatenate([[0.0], np.cumsum(self.growth ** np.arange(self.layers))])
        radii = self.radius + (self.outer - self.radius) * thickness / thickness[-1]
        angles = self.start + self.turn * np.arange(self.count + 1) / self.count
        directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        points = np.array(self.centre) + radii[:, None, None] * directions
        number = np.arange(points.shape[0] * points.shape[1]).reshape(points.shape[:2])
        inner, outer = number[:-1], number[1:]
        quads = np.stack([inner[:, :-1], inner[:, 1:], outer[:, 1:], outer[:, :-1]], axis=-1).reshape(-1, 4)
        return points, quads


def parted(outline: Sequence[Edge], h: float) -> tuple[list[Edge], list[Ring]]:
    """The outline of what is outside of the rings, and the rings; edges between the two have no name.

    Elements on the outermost ring are no larger than `h` [mm].

    Raises
    ------
    MeshError
        The body lies inside of an arc that has an element size, or the rings have no room.
    """
    starts = [outline[i - 1].end for i in range(len(outline))]
    pieces, rings = [[edge] for edge in outline], []
    for i, edge in enumerate(outline):
        if edge.via is None or edge.h is None:
            continue
        centre, radius, angle, turn = circle(starts[i], edge.via, edge.end)
        if turn > 0:
            raise MeshError(f"the body lies inside of the arc {edge.name!r}, which has an element size: rings of "
                            "elements go around an arc; give it none")
        count = 2 * max(2, math.ceil(-turn * radius / edge.h / 2 - 1e-9))
        ring = Ring(edge.name, (None, None), centre, radius, angle, turn, count, *_across(radius, -turn / count, h))
        before, after = outline[i - 1], outline[(i + 1) % len(outline)]
        seams = (before.name if _reaches(ring, 0.0, before, starts[i - 1]) else None,
                 after.name if _reaches(ring, 1.0, after, after.end) else None)
        rings.append(ring._replace(seams=seams))
        first, last = ring.at(ring.outer, 0.0), ring.at(ring.outer, 1.0)
        pieces[i] = [Edge("", last, ring.at(ring.outer, 0.5))]
        if seams[0] is None:
            pieces[i].insert(0, Edge("", first))
        else:
            pieces[i - 1][-1] = pieces[i - 1][-1]._replace(end=first)
        if seams[1] is None:
            pieces[i].append(Edge("", edge.end))
    return [piece for group in pieces for piece in group], rings


def _across(radius: float, step: float, h: float) -> tuple[int, float, float]:
    """Number of layers, even, their growth, and the radius of the outermost, for elements of an angle `step` [rad]."""
    outer = radius * min(REACH, max(1.0 + 4 * step, h / (radius * step)))
    thinnest, thickest = radius * step / ASPECT, outer * step
    layers = 2
    while True:
        growth = (thickest / thinnest) ** (1 / (layers - 1))
        if thinnest * (growth**layers - 1) / (growth - 1) >= outer - radius:
            return layers, growth, outer
        layers += 2


def _reaches(ring: Ring, share: float, edge: Edge, far: Point) -> bool:
    """Whether an edge from that end of the arc to the point `far` is straight, and is the end of the rings too."""
    near, outermost = ring.at(ring.radius, share), ring.at(ring.outer, share)
    ahead = np.subtract(outermost, near)
    along = np.subtract(far, near)
    if edge.via is not None or abs(ahead[0] * along[1] - ahead[1] * along[0]) > 1e-9 * np.hypot(*ahead) * np.hypot(*along):
        return False
    if not np.hypot(*along) > np.hypot(*ahead):
        raise MeshError(f"the boundary {edge.name!r} is too short for the rings of elements around {ring.arc!r}")
    return bool(ahead @ along > 0)


def joined(ring: Ring, points: Array, quads: Indices, lines: dict[str, Indices]) -> tuple[Array, Indices]:
    """Points (n, 3) and quadrilaterals with those of a ring, whose outer nodes they have; `lines` gets its arc."""
    grid, inside = ring.quads()
    shape = grid.shape[:2]
    place = np.full(shape, -1)
    away, angle = ring.polar(points)
    place[-1] = _chain(np.flatnonzero(np.abs(away - ring.outer) < 1e-6 * ring.outer), angle)
    for end, seam in zip((0, -1), ring.seams):
        if seam is None:
            on = (np.abs(angle - (1.0 if end else 0.0)) < 1e-6) & (away < ring.outer * (1 + 1e-6))
            place[:, end] = _chain(np.flatnonzero(on), away)
    new = place < 0
    place[new] = len(points) + np.arange(np.count_nonzero(new))
    added = np.concatenate([grid[new], np.zeros((np.count_nonzero(new), 1))], axis=1)
    for name, chain in ((ring.arc, place[0]), (ring.seams[0], place[:, 0]), (ring.seams[1], place[:, -1])):
        if name is not None:
            here = np.stack([chain[:-1], chain[1:]], axis=1)
            lines[name] = np.concatenate([lines.get(name, np.zeros((0, 2), int)), here])
    return np.concatenate([points, added]), np.concatenate([quads, place.ravel()[inside]])


def _chain(nodes: Indices, along: Array) -> Indices:
    """Numbers of nodes in the order of what they have `along` a line, (n,)."""
    return nodes[np.argsort(along[nodes])]
