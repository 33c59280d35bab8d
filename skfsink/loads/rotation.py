"""Boundaries that a grip turns about an axis."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field

import numpy as np

from ..errors import ParameterError, require
from ..fem.selection import Selection
from .grips import Grip, Ramp

__all__ = ["Rotation", "Turn"]


@dataclass(frozen=True)
class Rotation(Grip):
    """A boundary that is held in all directions and turned, as a rigid one, about an axis that stands still.

    Parameters
    ----------
    boundary: its name.
    angle: the rate of the angle [degrees/s], or its course [degrees]; counterclockwise in the plane, by the right hand
        about `axis` in space. It may go beyond a full turn.
    centre: a point of the axis [mm], with as many components as the mesh.
    axis: its direction in space, of any length; none in the plane.

    Raises
    ------
    ParameterError
        A component is no number, or the axis has no direction.
    """

    velocity: tuple[float | Ramp | None, ...] = field(default=(), init=False)
    angle: float | Ramp
    centre: tuple[float, ...]
    axis: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.angle, Ramp):
            require(f"angle of the grip {self.boundary}", self.angle, "degrees/s")
        for value in self.centre:
            require(f"centre of the grip {self.boundary}", value, "mm")
        for value in self.axis:
            require(f"axis of the grip {self.boundary}", value)
        if self.axis and not any(self.axis):
            raise ParameterError(f"axis of the grip {self.boundary} must have a direction; got {self.axis}")

    @property
    def moves(self) -> bool:
        return isinstance(self.angle, Ramp) or self.angle != 0.0


class Turn:
    """The motion of the nodes of a :class:`Rotation`.

    Parameters
    ----------
    X: where they are in the undeformed body, (k, dim) [mm].
    nodes: their numbers, (k,).
    grip: what turns them.

    Attributes
    ----------
    radius: greatest distance of a node from the axis [mm].

    Raises
    ------
    ParameterError
        Centre or axis do not have as many components as the mesh, or all nodes are on the axis.
    """

    def __init__(self, X: np.ndarray, nodes: np.ndarray, grip: Rotation) -> None:
        dim = X.shape[1]
        if len(grip.centre) != dim or len(grip.axis) != (3 if dim == 3 else 0):
            raise ParameterError(f"grip {grip.boundary} must have a centre of {dim} components"
                                 f"{' and an axis of 3' if dim == 3 else ' and no axis'}, as the mesh; got "
                                 f"{len(grip.centre)} and {len(grip.axis)}")
        self.nodes, self.angle, self.centre, self._dim = nodes, grip.angle, np.array(grip.centre, float), dim
        axis = np.array(grip.axis if dim == 3 else (0.0, 0.0, 1.0), float)
        self._axis = axis / np.linalg.norm(axis)
        arms = np.zeros((len(X), 3))
        arms[:, :dim] = X - self.centre
        self._along = np.outer(arms @ self._axis, self._axis)
        self._cos, self._sin = arms - self._along, np.cross(self._axis, arms)
        self.radius = float(np.linalg.norm(self._cos, axis=1).max())
        if not self.radius > 0.0:
            raise ParameterError(f"grip {grip.boundary} turns nothing: all nodes of its boundary are on the axis")

    def of_part(self, part: Selection) -> Turn:
        """The motion of the nodes that a part of the body has."""
        own, here = copy(self), part.node[self.nodes]
        mine = here >= 0
        own.nodes, own._along = here[mine], self._along[mine]
        own._cos, own._sin = self._cos[mine], self._sin[mine]
        return own

    def rate(self, t: float) -> float:
        """Rate of the angle from load time `t` up to the next knot [rad/s]."""
        return float(np.radians(self.angle.rate(t) if isinstance(self.angle, Ramp) else self.angle))

    def turned(self, t: float) -> float:
        """Angle at load time `t` [rad]."""
        return float(np.radians(self.angle.value(t) if isinstance(self.angle, Ramp) else self.angle * t))

    def displacement(self, t: float) -> np.ndarray:
        """Displacement at load time `t`, (k, dim) [mm]."""
        c, s = np.cos(self.turned(t)), np.sin(self.turned(t))
        moved: np.ndarray = ((c - 1.0) * self._cos + s * self._sin)[:, :self._dim]
        return moved

    def velocity(self, t: float, *, now: bool = True) -> np.ndarray:
        """Velocity at load time `t`, (k, dim) [mm/s]; without `now` at the mean rate of the angle up to the next knot.
        """
        rate = float(np.radians(self.angle.slope(t))) if now and isinstance(self.angle, Ramp) else self.rate(t)
        c, s = np.cos(self.turned(t)), np.sin(self.turned(t))
        return rate * (c * self._sin - s * self._cos)[:, :self._dim]

    def moment(self, x: np.ndarray, f: np.ndarray) -> float:
        """Moment about the axis of forces f (n, dim) at the places x (n, dim) of all nodes [N mm; N mm/mm in 2D]."""
        arms, forces = np.zeros((2, self.nodes.size, 3))
        arms[:, :self._dim], forces[:, :self._dim] = x[self.nodes] - self.centre, f[self.nodes]
        return float((np.cross(arms, forces) @ self._axis).sum())
