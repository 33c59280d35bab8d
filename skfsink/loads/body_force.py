"""Forces per mass, such as weight: nodal forces that keep their direction and fall with the density."""

from __future__ import annotations

from copy import copy
from typing import Self

import numpy as np

from ..errors import ParameterError
from ..fem.selection import Selection
from ..fem.space import Space
from .grips import Ramp
from .nodal import NodalLoads

__all__ = ["BodyForce"]


class BodyForce(NodalLoads):
    """Nodal forces f_a = int gamma rho0 N_a b dV of a force per mass b, which is an acceleration.

    As the inertia, and the lumped mass of the momentum balance without its floor: a body that falls freely is not
    strained. Material without force has no weight.

    Memory: the load time last given to `at` and the density last given to `weigh`; energies are of the loads as these
    left them.

    Parameters
    ----------
    space: the mesh.
    rho0: density of the intact solid, one number or (ne,) [t/mm^3].
    rate: by component the rate of b [mm/s^3], or its course [mm/s^2].
    elements: on which it acts; all without it.

    Raises
    ------
    ParameterError
        It has not as many components as the mesh, or one along r of a body of revolution.
    """

    weighs = True

    def __init__(self, space: Space, rho0: float | np.ndarray, rate: tuple[float | Ramp, ...],
                 elements: np.ndarray | None = None) -> None:
        if len(rate) != space.dim:
            raise ParameterError(f"a body force must have {space.dim} components, as the mesh; got {len(rate)}")
        if space.axisymmetric and (isinstance(rate[0], Ramp) or rate[0] != 0.0):
            raise ParameterError("a body force on a body of revolution acts along its axis: leave x out, which is the "
                                 "radius")
        self.space, self._rates, self._time = space, rate, 0.0
        self._size = float(np.ptp(space.X, axis=0).max())
        self.ramps = tuple(value for value in rate if isinstance(value, Ramp))
        self.elements = np.arange(space.n_elements) if elements is None else np.asarray(elements)
        self.nodes = np.unique(space.conn[self.elements])
        self._rho0 = np.zeros((space.n_elements, 1))
        self._rho0[self.elements, 0] = np.broadcast_to(rho0, space.n_elements)[self.elements]
        self.weigh(np.ones_like(space.w))

    def acceleration(self, t: float) -> np.ndarray:
        """b at load time `t` [s], (dim,) [mm/s^2]."""
        return np.array([value.value(t) if isinstance(value, Ramp) else value * t for value in self._rates])

    def at(self, t: float) -> None:
        """Take the loads of load time `t` [s]."""
        self._time = t
        self.values = self._mass[:, None] * self.acceleration(t)

    def rate(self, t: float) -> float:
        """Change of the greatest stress that it can bring from load time `t` on: rho0 b' times the size [MPa/s]."""
        rates = [value.rate(t) if isinstance(value, Ramp) else value for value in self._rates]
        return float(self._rho0.max() * np.linalg.norm(rates) * self._size)

    def keep(self, alive: np.ndarray) -> None:
        """Nothing: :meth:`weigh` says what is left."""

    def weigh(self, gamma: np.ndarray) -> None:
        """Let the loads be those of material with the relative density `gamma` (ne, nq)."""
        self._mass = self.space.lumped(gamma * self._rho0)[self.nodes]
        self.at(self._time)

    # --- parts of a body ---
    def of_part(self, part: Selection) -> Self:
        """What a part of the body has of it: its elements."""
        own, here = copy(self), part.element[self.elements]
        own.elements, own._rho0 = here[here >= 0], self._rho0[part.elements]
        del own.space, own._mass, own.values
        return own

    def on(self, space: Space) -> None:
        """Act on the `space` of the part."""
        super().on(space)
        self.space, self.nodes = space, np.unique(space.conn[self.elements])
        self.weigh(np.ones_like(space.w))
