"""Initial cracks that the mesh has not: the elements of a band along a line or a surface, or of a named set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import ParameterError, choose, place_text
from ..fem.space import Space

__all__ = ["LIPS", "InitialCrack", "crack_along", "crack_of_elements", "of_length"]

LIPS = ("broken", "whole")
FLAT = 1e-6   # of its size: how far the corners of a polygon may be from its plane
_SLIGHT = 1e-6  # of the size of an element: one that a line enters by less is not crossed


@dataclass(frozen=True, eq=False)
class InitialCrack:
    """Elements that are broken from the start.

    Attributes
    ----------
    name: of the crack.
    elements: their numbers, ascending.
    lips: "broken" as of a crack that has run: the density falls to 0 over the length l beside it; or "whole" as of a
        cut, or of a slit in the mesh.
    extent: length of the line [mm], or area of the surface [mm^2]; None of a set of elements.
    reach: of a line, from where to where along it its elements reach [mm from the first point]; None of others.
    tips: of a line, where it ends there and in which direction it points: place [mm] and unit vector of each end.
    """

    name: str
    elements: np.ndarray
    lips: str
    extent: float | None = None
    reach: tuple[float, float] | None = None
    tips: tuple[tuple[np.ndarray, np.ndarray], ...] = ()

    def __post_init__(self) -> None:
        choose(f"crack {self.name}: lips", self.lips, LIPS)

    def width(self, space: Space) -> float | None:
        """Volume (area, if the mesh is plane) of the elements over the extent [mm]; None of a set of elements."""
        return None if self.extent is None else float(space.extent[self.elements].sum() / self.extent)


def crack_of_elements(space: Space, name: str, elements: np.ndarray, lips: str) -> InitialCrack:
    """The crack of a set of elements (ParameterError)."""
    found = np.unique(np.asarray(elements, np.int64))
    if not found.size or found[0] < 0 or found[-1] >= space.n_elements:
        raise ParameterError(f"crack {name}: its elements must be some of those of the mesh, 0 to "
                             f"{space.n_elements - 1}; got {found.size} of {found[:1]} to {found[-1:]}")
    return InitialCrack(name, found, lips)


def crack_along(space: Space, name: str, points: Sequence[Sequence[float]], lips: str,
                width: float | None = None) -> InitialCrack:
    """The crack along a polyline (plane bodies), or in a flat polygon (bodies in space).

    Without a `width` it is as narrow as the mesh allows: the elements that the line or surface crosses, whose middle is
    beside it and not beyond its ends; an element whose middle is at an end is taken. With one these, and all whose
    middle is within half of it.

    Parameters
    ----------
    points: ends and corners of the line, or corners of the polygon on the way round [mm], (m, dim).
    lips: of :data:`LIPS`.
    width: of the band [mm].

    Raises
    ------
    ParameterError
        They are no line or polygon, no element lies in the band, or the mesh allows no band as narrow.
    """
    corners = np.asarray(points, float)
    least = 2 if space.dim == 2 else 3
    if corners.ndim != 2 or corners.shape[1] != space.dim or len(corners) < least:
        raise ParameterError(f"crack {name}: points must be {least} or more of {space.dim} coordinates [mm], as "
                             f"the mesh; got {points!r:.80}")
    band = _Line(space, corners) if space.dim == 2 else _Polygon(space, name, corners)
    if not band.extent > 0.0:
        raise ParameterError(f"crack {name}: its points are no {'line' if space.dim == 2 else 'surface'}")
    crossed = band.crossed()
    taken = crossed if width is None else crossed | band.within(0.5 * width)
    if not taken.any():
        raise ParameterError(f"crack {name}: no element lies in it; " + _cure(space, band.distance()))
    elements = np.flatnonzero(taken)
    line = band if isinstance(band, _Line) else None
    found = InitialCrack(name, elements, lips, band.extent, *(() if line is None else line.ends(elements)))
    if width is not None and crossed.any():
        narrow = InitialCrack(name, np.flatnonzero(crossed), lips, band.extent).width(space)
        if narrow is not None and width < narrow * (1 - 1e-6):
            raise ParameterError(f"crack {name}: width {width:.3g} mm is less than the mesh allows there, "
                                 f"{narrow:.3g} mm: the elements that it crosses; leave width out, or refine the mesh")
    return found


def of_length(points: Sequence[Sequence[float]], length: float) -> list[list[float]]:
    """The polyline that begins as `points` (m, dim) and is `length` [mm] long: cut short, or lengthened straight on."""
    corners, left = [np.asarray(points[0], float)], length
    for number, point in enumerate(points[1:], 2):
        arm = np.asarray(point, float) - corners[-1]
        size = float(np.linalg.norm(arm))
        if size > 0.0 and (size >= left or number == len(points)):
            corners.append(corners[-1] + arm * (left / size))
            break
        corners.append(np.asarray(point, float))
        left -= size
    return [corner.tolist() for corner in corners]


def _cure(space: Space, distance: np.ndarray) -> str:
    """Why no element is in a band whose middles are at that `distance` from it (ne,) [mm], and what to do."""
    near = int(np.argmin(distance))
    if not distance[near] < space.h[near]:
        return "it leaves the body: give points in the body"
    digit = 10.0 ** (np.floor(np.log10(distance[near])) - 2)
    width = np.ceil(2 * distance[near] / digit * (1 + 1e-9)) * digit
    return (f"it runs along their edges: the middle of the nearest is at "
            f"{place_text(space.X[space.conn[near]].mean(axis=0))} mm; give a width of at least {width:.4g} mm, which "
            f"takes those on both sides of the edges, or points beside them")


class _Line:
    """A polyline in the plane, and the middles of elements beside it."""

    def __init__(self, space: Space, corners: np.ndarray) -> None:
        self.space = space
        arms = np.diff(corners, axis=0)
        lengths = np.linalg.norm(arms, axis=1)
        self.extent = float(lengths.sum())
        self._starts, self._lengths = corners[:-1][lengths > 0], lengths[lengths > 0]
        self._along = arms[lengths > 0] / self._lengths[:, None]
        self._joints = corners[1:-1]
        self._middles = space.X[space.conn].mean(axis=1)

    def crossed(self) -> np.ndarray:
        """Mask (ne,) of the elements that a segment crosses, with their middle beside it, or that hold a joint."""
        space, mask = self.space, np.zeros(self.space.n_elements, bool)
        slack = _SLIGHT * space.h
        for start, along, length in zip(self._starts, self._along, self._lengths):
            normal = np.array([-along[1], along[0]])
            height = ((space.X - start) @ normal)[space.conn]
            s = (self._middles - start) @ along
            mask |= ((height.min(axis=1) < -slack) & (height.max(axis=1) > slack)
                     & (s >= -slack) & (s <= length + slack))
        return mask | self._at_joints(0.5 * float(space.h.min()))

    def within(self, radius: float) -> np.ndarray:
        """Mask (ne,) of the elements whose middle is beside the line within `radius`, or as near to a joint."""
        return self._at_joints(radius) | (self.distance() <= radius * (1 + 1e-9))

    def distance(self) -> np.ndarray:
        """Distance of the middles to the line, infinite beyond its ends [mm], (ne,)."""
        least = np.full(self.space.n_elements, np.inf)
        for start, along, length in zip(self._starts, self._along, self._lengths):
            arm = self._middles - start
            s, height = arm @ along, np.abs(arm @ np.array([-along[1], along[0]]))
            np.minimum(least, np.where((s >= -1e-9 * length) & (s <= length * (1 + 1e-9)), height, np.inf), out=least)
        return least

    def ends(self, elements: np.ndarray
             ) -> tuple[tuple[float, float], tuple[tuple[np.ndarray, np.ndarray], ...]]:
        """From where to where along the line, lengthened beyond its ends, elements reach [mm]; the places of these two
        ends and the directions that the line has there."""
        X = self.space.X[self.space.conn[elements]].reshape(-1, self.space.dim)
        first = float(((X - self._starts[0]) @ self._along[0]).min())
        last = float(((X - self._starts[-1]) @ self._along[-1]).max())
        tips = ((self._starts[0] + first * self._along[0], -self._along[0]),
                (self._starts[-1] + last * self._along[-1], self._along[-1]))
        return (first, float(self._lengths[:-1].sum()) + last), tips

    def _at_joints(self, radius: float) -> np.ndarray:
        near = np.zeros(self.space.n_elements, bool)
        for joint in self._joints:
            near |= np.linalg.norm(self._middles - joint, axis=1) <= radius
        return near


class _Polygon:
    """A flat polygon in space, and the middles of elements above and below it."""

    def __init__(self, space: Space, name: str, corners: np.ndarray) -> None:
        self.space = space
        centre = corners.mean(axis=0)
        axes = np.linalg.svd(corners - centre)[2]
        flat = (corners - centre) @ axes.T
        if np.abs(flat[:, 2]).max() > FLAT * np.abs(flat).max():
            raise ParameterError(f"crack {name}: its points are not in one plane")
        self._flat = flat[:, :2]
        x, y = self._flat.T
        self.extent = float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)
        self._nodes = (space.X - centre) @ axes.T
        self._middles = self._nodes[space.conn].mean(axis=1)

    def _over(self) -> np.ndarray:
        """Mask (ne,) of the elements whose middle is above or below it: a ray crosses its sides oddly often, or it is
        over a side."""
        px, py = self._middles[:, 0], self._middles[:, 1]
        odd = np.zeros(len(px), bool)
        for a, b in zip(self._flat, np.roll(self._flat, -1, axis=0)):
            if a[1] != b[1]:
                between = (a[1] > py) != (b[1] > py)
                odd ^= between & (px < a[0] + (py - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
        return odd | (self._from_sides() <= _SLIGHT * self.space.h)

    def _from_sides(self) -> np.ndarray:
        """Distance of the middles, put into the plane, from the nearest side [mm], (ne,)."""
        least = np.full(len(self._middles), np.inf)
        for a, b in zip(self._flat, np.roll(self._flat, -1, axis=0)):
            side, arm = b - a, self._middles[:, :2] - a
            share = np.clip(arm @ side / max(float(side @ side), 1e-300), 0.0, 1.0)
            np.minimum(least, np.linalg.norm(arm - share[:, None] * side, axis=1), out=least)
        return least

    def crossed(self) -> np.ndarray:
        """Mask (ne,) of the elements that its plane crosses, with their middle above or below it."""
        height, slack = self._nodes[self.space.conn][:, :, 2], _SLIGHT * self.space.h
        return (height.min(axis=1) < -slack) & (height.max(axis=1) > slack) & self._over()

    def within(self, radius: float) -> np.ndarray:
        """Mask (ne,) of the elements whose middle is above or below it within `radius`."""
        mask: np.ndarray = self.distance() <= radius * (1 + 1e-9)
        return mask

    def distance(self) -> np.ndarray:
        """Height of the middles over it, infinite beyond its sides [mm], (ne,)."""
        return np.where(self._over(), np.abs(self._middles[:, 2]), np.inf)
