"""How a body is loaded at each load time: what is held, how fast grips move, dead loads and pressures."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from ..errors import ParameterError
from ..fem.space import Space
from .dead_load import DeadLoad
from .follower import FollowerLoads
from .grips import Grip, Ramp, Traction
from .nodal import NodalLoads, Together
from .pressure import Filling, Pressure

__all__ = ["Loading"]

_AXES = "xyz"


class Loading:
    """Grips, tractions and pressures on a mesh.

    Between two *knots*, the times at which a ramp has a point, grips move at constant velocity, and tractions and
    pressures change at a constant rate.

    Parameters
    ----------
    space: the mesh.
    grips, tractions: each with the nodes of its boundary.
    others: loads of other kinds.
    pressures: pressures and fillings, each with the nodes of its boundary.

    Attributes
    ----------
    free: (n*dim,) mask of the degrees of freedom that no grip holds.
    knots: ascending, all > 0 [s].
    tractions: as forces at nodes, None if there are none.
    dead: all dead loads, None if there are none.
    followers: the pressures, None if there are none.

    Raises
    ------
    ParameterError
        A grip or traction has not as many components as the mesh, two grips move a node differently, or a body under
        tractions or pressures can move as a whole.
    MeshError
        The mesh has no facet a traction or pressure could act on.
    """

    def __init__(self, space: Space, grips: Sequence[tuple[np.ndarray, Grip]],
                 tractions: Sequence[tuple[np.ndarray, Traction]] = (), others: Sequence[NodalLoads] = (),
                 pressures: Sequence[tuple[np.ndarray, Pressure | Filling]] = ()) -> None:
        self._moves: list[tuple[np.ndarray, int, float | Ramp]] = []
        free = np.ones(space.X.shape, bool)
        holders = np.full(space.X.shape, -1)  # number of the grip that holds a component of a node
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
        self.free = free.ravel()
        values = [value for *_, value in self._moves] + [v for _, traction in tractions for v in traction.rate]
        values += [load.rate if isinstance(load, Pressure) else load.inflow for _, load in pressures]
        ramps = [value for value in values if isinstance(value, Ramp)]
        self.knots: tuple[float, ...] = tuple(sorted({float(t) for ramp in ramps for t in ramp.times if t > 0}))
        self.tractions = DeadLoad(space, tractions) if tractions else None
        loads = [*([self.tractions] if self.tractions is not None else []), *others]
        self.dead: NodalLoads | None = Together(loads, space.n_nodes) if len(loads) > 1 else loads[0] if loads else None
        self.followers = FollowerLoads(space, pressures) if pressures else None
        self._shape = space.X.shape
        self._steady: np.ndarray | None = None
        if not any(isinstance(value, Ramp) for *_, value in self._moves):
            self._steady = self.velocity(0.0)
        if loads or pressures:
            _check_held(space, free)
        if self.followers is not None:
            self.followers.check_closed(self.free)

    @classmethod
    def steady(cls, space: Space, free: np.ndarray, velocity: np.ndarray) -> Loading:
        """Grips that hold all but the degrees of freedom `free` (n*dim,), and move at `velocity` (n, dim) [mm/s]."""
        loading = cls(space, ())
        loading.free, loading._steady = free, velocity
        return loading

    def knot(self, t: float) -> float:
        """The next knot after load time `t`, infinity if there is none [s]."""
        i = bisect_right(self.knots, t)
        return self.knots[i] if i < len(self.knots) else np.inf

    def velocity(self, t: float) -> np.ndarray:
        """Velocity of what is held, from load time `t` up to the next knot, (n, dim) [mm/s]; zero elsewhere."""
        if self._steady is not None:
            return self._steady
        velocity = np.zeros(self._shape)
        for nodes, i, value in self._moves:
            velocity[nodes, i] = value.rate(t) if isinstance(value, Ramp) else value
        return velocity

    def speed(self, t: float) -> float:
        """Greatest component of that velocity, or mean motion of the boundary of a filling [mm/s]."""
        speed = float(np.abs(self.velocity(t)).max())
        return speed if self.followers is None else max(speed, self.followers.speed(t))

    def rises_in_pressure(self, t: float) -> bool:
        """Whether a given pressure changes from load time `t` on."""
        return self.followers is not None and self.followers.rate(t) > 0.0

    def greatest_pressure(self, u: np.ndarray) -> float:
        """Greatest pressure at the displacement `u` (n, dim), by its amount [MPa]; 0 without any."""
        return 0.0 if self.followers is None else float(np.abs(self.followers.pressures(u)).max())

    def pull(self, t: float) -> float:
        """Fastest change of a traction or a pressure from load time `t` on [MPa/s]."""
        return max((loads.rate(t) for loads in (self.dead, self.followers) if loads is not None), default=0.0)


def _check_held(space: Space, free: np.ndarray) -> None:
    """Refuse a body that can be moved, or turned, without a force: under dead loads it would be."""
    for i in range(space.dim):
        if free[:, i].all():
            raise ParameterError(f"no grip holds the body in {_AXES[i]}, and a load would carry it away: hold a "
                                 f"boundary in that direction")
    x = (space.X - space.X.mean(axis=0)) / np.ptp(space.X, axis=0).max()
    modes = [np.broadcast_to(row, x.shape) for row in np.eye(space.dim)]
    for i in range(space.dim):
        for j in range(i):
            turn = np.zeros_like(x)
            turn[:, i], turn[:, j] = x[:, j], -x[:, i]
            modes.append(turn)
    grasp = np.array([mode[~free] for mode in modes])
    if np.linalg.eigvalsh(grasp @ grasp.T)[0] < 1e-9:
        raise ParameterError("the grips let the body turn, and a load would turn it: hold a boundary at two "
                             "places, or in one more direction")
