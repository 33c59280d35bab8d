"""How a body is loaded at each load time: what is held, how fast grips move, dead loads and pressures."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from copy import copy

import numpy as np

from ..errors import ParameterError, place_text
from ..fem.selection import Selection
from ..fem.space import Space
from .curve import Curve
from .dead_load import DeadLoad
from .follower import FollowerLoads
from .grips import Grip, Ramp, Sliding, Traction
from .nodal import NodalLoads, Together
from .pressure import Filling, Pressure
from .rotation import Rotation, Turn
from .sliding import SlidingPlanes, normal_of

__all__ = ["Loading"]

_AXES = "xyz"


class Loading:
    """Grips, tractions and pressures on a mesh.

    Between two *knots*, the times at which a ramp has a point, grips move at constant velocity, and tractions and
    pressures change at a constant rate. A :class:`.Curve` has knots too, where load increments end; it is no straight
    line between them, and time steps pass them: these end at *corners*, where velocities jump.

    Parameters
    ----------
    space: the mesh. The nodes on the axis of a body of revolution are held along r, whatever grips say.
    grips, tractions: each with the nodes of its boundary.
    others: loads of other kinds.
    pressures: pressures and fillings, each with the nodes of its boundary.
    stop: a load time at which an increment ends, as at a knot [s].

    Attributes
    ----------
    free: (n*dim,) mask of the degrees of freedom that no grip holds; those of nodes on oblique planes are free.
    sliding: what planes oblique to the axes hold, None if there are none.
    knots: ascending, all > 0 [s].
    corners: those of them that are points of ramps, or ends of curves.
    smooth: whether a grip follows a curve or turns, so that its velocity changes all the time.
    turns: nodes that grips turn about an axis.
    tractions: as forces at nodes, None if there are none.
    dead: all dead loads, None if there are none.
    followers: the pressures, None if there are none.

    Raises
    ------
    ParameterError
        A grip or traction has not as many components as the mesh, two grips move a node differently, or a body under
        tractions or pressures can move as a whole; or a grip turns a body of revolution, or moves its axis.
    MeshError
        The mesh has no facet a traction or pressure could act on, or a boundary that is to slide is not flat.
    """

    def __init__(self, space: Space, grips: Sequence[tuple[np.ndarray, Grip]],
                 tractions: Sequence[tuple[np.ndarray, Traction]] = (), others: Sequence[NodalLoads] = (),
                 pressures: Sequence[tuple[np.ndarray, Pressure | Filling]] = (), stop: float = np.inf) -> None:
        self._moves: list[tuple[np.ndarray, int, float | Ramp]] = []
        free = np.ones(space.X.shape, bool)
        grips, oblique = _planes(space, grips)
        holders = np.full(space.X.shape, -1)  # number of the grip that holds a component of a node
        turned = [(nodes, grip) for nodes, grip in grips if isinstance(grip, Rotation)]
        grips = [(nodes, grip) for nodes, grip in grips if not isinstance(grip, Rotation)]
        for number, (nodes, grip) in enumerate(grips):
            if len(grip.velocity) != space.dim:
                raise ParameterError(f"grip {grip.boundary} must have {space.dim} components, as the mesh; got "
                                     f"{len(grip.velocity)}")
            for i, value in enumerate(grip.velocity):
                if value is not None:
                    for other in np.setdiff1d(holders[nodes, i], -1):
                        if (there := grips[other][1]).velocity[i] != value:
                            at = space.X[nodes[holders[nodes, i] == other][0]]
                            raise ParameterError(
                                f"grips {there.boundary} and {grip.boundary} both hold {_AXES[i]} of the node at "
                                f"({', '.join(f'{x:.3g}' for x in at)}) and move it differently: leave {_AXES[i]} out "
                                f"of one of them, or end one of the boundaries short of the other")
                    holders[nodes, i] = number
                    free[nodes, i] = False
                    self._moves.append((nodes, i, value))
        if space.axisymmetric:
            _hold_axis(space, grips, turned, free)
        self.turns = _turns(space, turned, free)
        self.sliding: SlidingPlanes | None = None
        if oblique:
            moving = np.zeros_like(free)
            for nodes, i, value in self._moves:
                moving[nodes, i] |= any(value.values) if isinstance(value, Ramp) else value != 0.0
            for turn in self.turns:
                moving[turn.nodes] = True
            self.sliding = SlidingPlanes(space, oblique, free, moving)
        self.free = free.ravel()
        values = [*(value for *_, value in self._moves), *(v for _, traction in tractions for v in traction.rate),
                  *(turn.angle for turn in self.turns), *(ramp for load in others for ramp in load.ramps),
                  *(load.rate if isinstance(load, Pressure) else load.inflow for _, load in pressures)]
        ramps = [value for value in values if isinstance(value, Ramp)]
        self.knots: tuple[float, ...] = tuple(sorted({
            *(float(t) for ramp in ramps for t in ramp.times if t > 0), *([stop] if 0.0 < stop < np.inf else [])}))
        self.corners: tuple[float, ...] = tuple(sorted({
            float(t) for ramp in ramps for t in (ramp.times[-1:] if isinstance(ramp, Curve) else ramp.times) if t > 0}))
        self.smooth = bool(self.turns) or any(isinstance(value, Curve) for *_, value in self._moves)
        self.tractions = DeadLoad(space, tractions) if tractions else None
        loads = [*([self.tractions] if self.tractions is not None else []), *others]
        self.dead: NodalLoads | None = Together(loads, space.n_nodes) if len(loads) > 1 else loads[0] if loads else None
        self.followers = FollowerLoads(space, pressures) if pressures else None
        self._shape = space.X.shape
        self._steady: np.ndarray | None = None
        if not self.turns and not any(isinstance(value, Ramp) for *_, value in self._moves):
            self._steady = self.velocity(0.0)
        if loads or pressures:
            _check_held(space, free, self.sliding)
        if self.followers is not None:
            self.followers.check_closed(self.free, self.sliding)

    @classmethod
    def steady(cls, space: Space, free: np.ndarray, velocity: np.ndarray) -> Loading:
        """Grips that hold all but the degrees of freedom `free` (n*dim,), and move at `velocity` (n, dim) [mm/s]."""
        loading = cls(space, ())
        loading.free, loading._steady = loading.free & free, velocity
        return loading

    def of_part(self, part: Selection) -> Loading:
        """The same for a part of the body, to be put `on` the space of this part.

        Raises
        ------
        ParameterError
            A kind of load cannot be computed in parts.
        """
        own = copy(self)
        own._shape = part.nodes.size, self._shape[1]
        own.free = np.ascontiguousarray(self.free.reshape(self._shape)[part.nodes]).ravel()
        own._moves = [(here[here >= 0], i, value) for held, i, value in self._moves for here in (part.node[held],)]
        own._steady = None if self._steady is None else np.ascontiguousarray(self._steady[part.nodes])
        own.turns = [turn.of_part(part) for turn in self.turns]
        own.sliding = None if self.sliding is None else self.sliding.of_part(part)
        own.followers = None if self.followers is None else self.followers.of_part(part)
        own.dead = None if self.dead is None else self.dead.of_part(part)
        if self.tractions is not None:  # the first of the dead loads
            first = own.dead.loads[0] if isinstance(own.dead, Together) else own.dead
            own.tractions = first if isinstance(first, DeadLoad) else None
        return own

    def on(self, space: Space) -> None:
        """Act on the `space` of the part."""
        for loads in (self.dead, self.followers, self.sliding):
            if loads is not None:
                loads.on(space)

    def knot(self, t: float) -> float:
        """The next knot after load time `t`, infinity if there is none [s]."""
        return _after(self.knots, t)

    def corner(self, t: float) -> float:
        """The next corner after load time `t`, infinity if there is none [s]."""
        return _after(self.corners, t)

    def velocity(self, t: float) -> np.ndarray:
        """Velocity of what is held, from load time `t` up to the next knot, (n, dim) [mm/s]; zero elsewhere.

        That of a curve is its mean between the two knots.
        """
        velocity = self._field(lambda value: value.rate(t))
        for turn in self.turns:
            velocity[turn.nodes] = turn.velocity(t, now=False)
        return velocity

    def motion(self, t: float) -> np.ndarray:
        """Velocity of what is held at load time `t` itself, (n, dim) [mm/s]; at a corner, from there on."""
        velocity = self._field(lambda value: value.slope(t))
        for turn in self.turns:
            velocity[turn.nodes] = turn.velocity(t)
        return velocity

    def mean(self, t: float, end: float, dt: float) -> np.ndarray:
        """Mean velocity from load time `t` to `end`, `dt` [s] later and before the next corner, (n, dim) [mm/s]."""
        velocity = self._field(
            lambda value: (value.value(end) - value.value(t)) / dt if isinstance(value, Curve) else value.rate(t))
        for turn in self.turns:
            velocity[turn.nodes] = (turn.displacement(end) - turn.displacement(t)) / dt
        return velocity

    def _field(self, rate: Callable[[Ramp], float]) -> np.ndarray:
        """Velocities (n, dim), with the `rate` of each ramp."""
        if self._steady is not None:
            return self._steady
        velocity = np.zeros(self._shape)
        for nodes, i, value in self._moves:
            velocity[nodes, i] = rate(value) if isinstance(value, Ramp) else value
        return velocity

    def speed(self, t: float) -> float:
        """Greatest component of the velocity up to the next knot, or mean motion of the side of a filling [mm/s]."""
        filling = 0.0 if self.followers is None else self.followers.speed(t)
        if self._steady is not None:
            return max(float(np.abs(self._steady).max()), filling)
        return max((*(abs(value.rate(t) if isinstance(value, Ramp) else value) for *_, value in self._moves),
                    *(abs(turn.rate(t)) * turn.radius for turn in self.turns), filling))

    def rates(self, t: float) -> np.ndarray:
        """Rates of all components of grips, tractions and pressures from load time `t` up to the next knot, signed."""
        moves = [value.rate(t) if isinstance(value, Ramp) else value for *_, value in self._moves]
        pulls = [] if self.tractions is None else self.tractions.rates(t).ravel().tolist()
        pushes = [] if self.followers is None else self.followers.rates(t).tolist()
        return np.array([*moves, *pulls, *pushes, *(turn.rate(t) for turn in self.turns)], float)

    def rises_in_pressure(self, t: float) -> bool:
        """Whether a given pressure changes from load time `t` on."""
        return self.followers is not None and self.followers.rate(t) > 0.0

    def greatest_pressure(self, u: np.ndarray) -> float:
        """Greatest pressure at the displacement `u` (n, dim), by its amount [MPa]; 0 without any."""
        return 0.0 if self.followers is None else float(np.abs(self.followers.pressures(u)).max())

    def pull(self, t: float) -> float:
        """Fastest change of a traction or a pressure from load time `t` on [MPa/s]."""
        return max((loads.rate(t) for loads in (self.dead, self.followers) if loads is not None), default=0.0)


def _after(times: tuple[float, ...], t: float) -> float:
    """The first of ascending times after t, infinity if there is none [s]."""
    i = bisect_right(times, t)
    return times[i] if i < len(times) else np.inf


def _planes(space: Space, grips: Sequence[tuple[np.ndarray, Grip]]
            ) -> tuple[list[tuple[np.ndarray, Grip]], list[tuple[np.ndarray, np.ndarray, str]]]:
    """The grips, with sliding planes normal to an axis as such; and apart the nodes, normals and names of the others.
    """
    along: list[tuple[np.ndarray, Grip]] = []
    oblique = []
    for nodes, grip in grips:
        if not isinstance(grip, Sliding):
            along.append((nodes, grip))
            continue
        normal = normal_of(space, nodes, grip.boundary)
        if np.abs(normal).max() == 1.0:
            along.append((nodes, Grip(grip.boundary, tuple(0.0 if n else None for n in normal))))
        else:
            oblique.append((nodes, normal, grip.boundary))
    return along, oblique


def _hold_axis(space: Space, grips: Sequence[tuple[np.ndarray, Grip]], turned: Sequence[tuple[np.ndarray, Rotation]],
               free: np.ndarray) -> None:
    """Hold the nodes on the axis of revolution along r; refuse a grip that turns the body or moves them there."""
    if turned:
        raise ParameterError(f"grip {turned[0][1].boundary} turns a body of revolution, and the element axisymmetric "
                             f"has no torsion: take a mesh in space")
    for nodes, grip in grips:
        value, there = grip.velocity[0], nodes[space.on_axis[nodes]]
        if there.size and value is not None and (any(value.values) if isinstance(value, Ramp) else value != 0.0):
            raise ParameterError(f"grip {grip.boundary} moves the node at {place_text(space.X[there[0]])} mm, on the "
                                 f"axis of revolution, along x: leave x out of it, or end the boundary short of it")
    free[space.on_axis, 0] = False


def _turns(space: Space, grips: Sequence[tuple[np.ndarray, Rotation]], free: np.ndarray) -> list[Turn]:
    """The nodes that grips turn; none of them may be held by another one, and nothing of them is `free` any more."""
    turns = []
    for nodes, grip in grips:
        if (held := ~free[nodes].all(axis=1)).any():
            place = place_text(space.X[nodes[held][0]])
            raise ParameterError(f"grip {grip.boundary} turns the node at {place} mm, which another grip holds: end "
                                 f"one of the boundaries short of the other")
        free[nodes] = False
        turns.append(Turn(space.X[nodes], nodes, grip))
    return turns


def _check_held(space: Space, free: np.ndarray, sliding: SlidingPlanes | None) -> None:
    """Refuse a body that can be moved, or turned, without a force: under dead loads it would be."""
    if space.axisymmetric:  # rings resist all of these but along the axis
        free = free & [False, True]
    for i in range(space.dim):
        if free[:, i].all() and sliding is None:
            raise ParameterError(f"no grip holds the body in {_AXES[i]}, and a load would carry it away: hold a "
                                 f"boundary in that direction")
    x = (space.X - space.X.mean(axis=0)) / np.ptp(space.X, axis=0).max()
    modes = [np.broadcast_to(row, x.shape) for row in np.eye(space.dim)]
    for i in range(space.dim):
        for j in range(i):
            turn = np.zeros_like(x)
            turn[:, i], turn[:, j] = x[:, j], -x[:, i]
            modes.append(turn)
    grasp = np.array([np.concatenate([mode[~free], *([] if sliding is None else [sliding.across(mode)])])
                      for mode in modes])
    if np.linalg.eigvalsh(grasp @ grasp.T)[0] < 1e-9:
        if sliding is not None:
            raise ParameterError("the grips let the body move or turn, and a load would carry it away: hold a boundary "
                                 "in one more direction")
        raise ParameterError("the grips let the body turn, and a load would turn it: hold a boundary at two "
                             "places, or in one more direction")
