"""Mass of the implicit scheme, lumped or consistent (Eq. 28), for the density last given to the momentum balance."""

from __future__ import annotations

import numpy as np

from ..fem.direct import symmetric_product
from ..fem.pattern import Pattern
from ..fields.momentum import Momentum

__all__ = ["Inertia"]



class Inertia:
    """Mass matrices on the pattern of the tangent, and kinetic energy by the places the mass sits at.

    Parameters
    ----------
    momentum: whose density counts.
    pattern: upper triangle over the free unknowns.
    free: (n*dim,) mask of these.
    kind: "lumped" by row sums, mass at the nodes, or "consistent", mass at the Gauss points.
    floor: least lumped mass, as a fraction of the intact one.
    """

    def __init__(self, momentum: Momentum, pattern: Pattern, free: np.ndarray, kind: str, floor: float) -> None:
        self.momentum, self.space, self.free, self.kind, self.floor = momentum, momentum.space, free, kind, floor
        self._pattern = pattern

    def places(self) -> np.ndarray:
        """Mass by place: at the nodes (n,), or for Eq. (28) at the Gauss points (ne, nq) [t; t/mm in 2D]."""
        if self.kind == "lumped":
            return self.momentum.lumped_mass(self.floor)
        return self.space.w * self.momentum.rho0 * self.momentum.gamma

    def half_v2(self, v: np.ndarray) -> np.ndarray:
        """|v|^2/2 in the same places [mm^2/s^2]."""
        if self.kind == "lumped":
            return 0.5 * np.einsum("ai,ai->a", v, v)
        at_gauss = np.einsum("qa,eai->eqi", self.space.N, v[self.space.conn])
        return 0.5 * np.einsum("eqi,eqi->eq", at_gauss, at_gauss)

    def matrix(self) -> np.ndarray:
        """Data of the mass matrix on the pattern."""
        if self.kind == "consistent":
            return self.momentum.consistent_mass(self._pattern)
        data = np.zeros(self._pattern.nnz)
        data[self._pattern.diagonal] = np.repeat(self.places(), self.space.dim)[self.free]
        return data

    def times(self, mass: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Product of a matrix with the data `mass` and x over the free unknowns."""
        p = self._pattern
        return symmetric_product(p.indptr.view(np.uint32), p.indices.view(np.uint32), mass, x)

    def kinetic(self, mass: np.ndarray, places: np.ndarray, v: np.ndarray) -> float:
        """Kinetic energy of the body at velocities v (n, dim), what is held included, of mass in both its forms."""
        free = v.ravel()[self.free]
        return 0.5 * float(free @ self.times(mass, free)) + self.guided(places, v)

    def guided(self, places: np.ndarray, v: np.ndarray) -> float:
        """What the motion of held unknowns adds to the kinetic energy of the free ones; 0 where they stand still."""
        free = np.where(self.free.reshape(v.shape), v, 0.0)
        return float(np.vdot(places, self.half_v2(v) - self.half_v2(free)))
