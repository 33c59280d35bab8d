"""Where nodes of Abaqus models are: systems of coordinates, and instances that are moved and turned."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from .abaqus_lines import Block
from .abaqus_numbers import Numbers

__all__ = ["System", "turned"]


@dataclass(frozen=True)
class System:
    """A system of coordinates: its axes, one a row (3, 3), and its origin [as the nodes]."""

    axes: np.ndarray = field(default_factory=lambda: np.eye(3))
    origin: np.ndarray = field(default_factory=lambda: np.zeros(3))

    @classmethod
    def of(cls, block: Block) -> System:
        """That of `*SYSTEM`: an origin, a point on the first axis and one in the plane of the first two."""
        coordinates: list[float] = []
        for _, row in Numbers(block, whole=False).rows():
            coordinates += [*row, *[0.0] * (-len(row) % 3)]
        if len(coordinates) not in (0, 3, 6, 9):
            raise block.error(f"*SYSTEM takes one, two or three points; got {len(coordinates)} numbers")
        points = np.array(coordinates).reshape(-1, 3)
        axes = np.eye(3)
        if len(points) > 1 and (points[1] != points[0]).any():
            along = (points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
            up = np.cross(along, points[2] - points[0]) if len(points) > 2 else np.array([0.0, 0.0, 1.0])
            up = up - (up @ along) * along
            if np.linalg.norm(up) <= 1e-12 * max(1.0, float(np.abs(points).max())):
                raise block.error("the points of *SYSTEM are on one line")
            up /= np.linalg.norm(up)
            axes = np.array([along, np.cross(up, along), up])
        return cls(axes, points[0] if len(points) else np.zeros(3))

    def placed(self, points: np.ndarray, block: Block) -> np.ndarray:
        """Points (n, 3) of a `*NODE` in this system; its SYSTEM= says whether they are in cylinder coordinates (C) or
        in those of a sphere (S), with angles in degrees."""
        kind = block.parameters.get("SYSTEM", "R").upper()[:1]
        if kind in ("C", "S"):
            r, theta = points[:, 0], np.radians(points[:, 1])
            up = np.radians(points[:, 2]) if kind == "S" else None
            flat, z = (r, points[:, 2]) if up is None else (r * np.cos(up), r * np.sin(up))
            points = np.column_stack([flat * np.cos(theta), flat * np.sin(theta), z])
        elif kind != "R":
            raise block.error(f"SYSTEM={kind} is unknown: R, C or S")
        if (self.axes == np.eye(3)).all() and not self.origin.any():
            return points
        return points @ self.axes + self.origin


def turned(points: np.ndarray, block: Block) -> np.ndarray:
    """Points (n, 3) moved and turned as the data lines of `*INSTANCE` say: first moved, then turned."""
    lines = [row for _, row in Numbers(block, whole=False).rows()]
    if not lines:
        return points
    if len(lines[0]) == 7:  # an empty first line
        lines = [[0.0], *lines]
    if len(lines) > 2 or len(lines[0]) > 3 or (len(lines) == 2 and len(lines[1]) != 7):
        raise block.error("an instance is placed by a line of 3 and one of 7 numbers")
    points = points + np.array([*lines[0], 0.0, 0.0][:3])
    if len(lines) == 1 or not lines[1][6]:
        return points
    a, b, angle = np.array(lines[1][:3]), np.array(lines[1][3:6]), math.radians(lines[1][6])
    if not (length := float(np.linalg.norm(b - a))) > 0:
        raise block.error("the two points on the axis of its rotation are one", 1)
    axis, from_a = (b - a) / length, points - a
    quarter = round(lines[1][6] / 90)
    cos, sin = ((1, 0, -1, 0)[quarter % 4], (0, 1, 0, -1)[quarter % 4]) if lines[1][6] == 90 * quarter else (
        math.cos(angle), math.sin(angle))
    along: np.ndarray = (from_a @ axis)[:, None] * axis
    return a + along + cos * (from_a - along) + sin * np.cross(axis, from_a)
