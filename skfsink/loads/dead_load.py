"""Dead tractions on a mesh: nodal forces per undeformed area that keep their direction."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Self

import numpy as np
import skfem

from ..errors import MeshError, ParameterError
from ..fem.selection import Selection
from ..fem.space import Space
from .grips import Ramp, Traction
from .nodal import NodalLoads

__all__ = ["DeadLoad"]


class DeadLoad(NodalLoads):
    """Nodal forces f_a = int N_a T dA of tractions T, as far as the material they act on is there.

    A traction acts on the facets of the surface all of whose nodes belong to its boundary. The facets of an element
    that has lost its force, at all its Gauss points, bear no load any more.

    Memory: the load time last given to `at` and the elements last given to `keep`; `resultant`, `idle` and energies
    are of the loads as these left them.

    Parameters
    ----------
    space: the mesh.
    tractions: each with the nodes of its boundary.

    Attributes
    ----------
    elements: of the facets, (f,).

    Raises
    ------
    MeshError
        The mesh has no facet on a boundary.
    ParameterError
        A traction has not as many components as the mesh.
    """

    def __init__(self, space: Space, tractions: Sequence[tuple[np.ndarray, Traction]]) -> None:
        self._rates = [tuple(value for value in traction.rate) for _, traction in tractions]
        boundary, elements, corners, weights, owner = space.mesh.boundary_facets(), [], [], [], []
        for number, (nodes, traction) in enumerate(tractions):
            if len(traction.rate) != space.dim:
                raise ParameterError(f"the traction on {traction.boundary} must have {space.dim} components, as the "
                                     f"mesh; got {len(traction.rate)}")
            facets = boundary[np.isin(space.mesh.facets[:, boundary], nodes).all(axis=0)]
            if not facets.size:
                raise MeshError(f"no traction can act on boundary {traction.boundary!r}: no facet of the surface has "
                                f"all its nodes in it; name all nodes of a side")
            basis = space.measured(skfem.FacetBasis(space.mesh, space.gamma_basis.elem, facets=facets, intorder=2))
            elements.append(basis.tind)
            corners.append(basis.element_dofs.T)
            weights.append(np.stack([(np.asarray(field[0]) * basis.dx).sum(axis=1) for field in basis.basis], axis=1))
            owner.append(np.full(facets.size, number))
        self.elements, weight = np.concatenate(elements), np.concatenate(weights)
        on_facet = weight > 1e-9 * weight.max(axis=1, keepdims=True)  # other nodes of the element have rounding only
        self.nodes, corner = np.unique(np.concatenate(corners)[on_facet], return_inverse=True)
        self._corner, self._weight, self._facet = corner.ravel(), weight[on_facet], np.nonzero(on_facet)[0]
        self._owner = np.concatenate(owner)
        self._time, self._alive = 0.0, np.ones(self.elements.size, bool)
        self._spread()

    def keep(self, alive: np.ndarray) -> None:
        """Let loads act only on the facets whose element is `alive` (f,)."""
        if np.array_equal(alive, self._alive):
            return
        self._alive = alive.copy()
        self._spread()

    def _spread(self) -> None:
        """Areas of the facets that are alive, by their nodes."""
        k = self.nodes.size
        place = self._owner[self._facet] * k + self._corner
        areas = np.bincount(place, self._weight * self._alive[self._facet], minlength=len(self._rates) * k)
        self._areas: np.ndarray = areas.reshape(len(self._rates), k)
        self.at(self._time)

    def at(self, t: float) -> None:
        """Take the loads of load time `t` [s]."""
        self._time = t
        self.values = self._areas.T @ self.traction(t)

    def traction(self, t: float) -> np.ndarray:
        """Tractions at load time `t` [s], (tractions, dim) [MPa]."""
        return np.array([[v.value(t) if isinstance(v, Ramp) else v * t for v in rate] for rate in self._rates])

    def rates(self, t: float) -> np.ndarray:
        """Changes of the tractions from load time `t` on, (tractions, dim) [MPa/s]."""
        return np.array([[v.rate(t) if isinstance(v, Ramp) else v for v in rate] for rate in self._rates])

    def rate(self, t: float) -> float:
        """Fastest change of a traction from load time `t` on [MPa/s]."""
        return float(np.linalg.norm(self.rates(t), axis=1).max())

    def resultant(self, number: int) -> np.ndarray:
        """Force of one of the tractions now, (dim,) [N; N/mm in 2D]; along r of a body of revolution its sum around."""
        total: np.ndarray = self._areas[number].sum() * self.traction(self._time)[number]
        return total

    def idle(self, free: np.ndarray) -> list[tuple[int, int]]:
        """Numbers and axes of the components that strain nothing, as all nodes they act on are held; `free` (n, dim).
        """
        return [(number, axis) for number, rate in enumerate(self._rates) for axis, value in enumerate(rate)
                if (isinstance(value, Ramp) or value) and not free[self.nodes[self._areas[number] > 0.0], axis].any()]

    def mean(self, number: int, u: np.ndarray) -> np.ndarray:
        """Mean of `u` (n, dim) over the boundary of one of the tractions, (dim,), while it is whole."""
        full = np.bincount(self._corner, self._weight * (self._owner[self._facet] == number), minlength=self.nodes.size)
        mean: np.ndarray = full @ u[self.nodes] / full.sum()
        return mean

    # --- parts of a body ---
    def of_part(self, part: Selection) -> Self:
        """What a part of the body has of them: the facets of its elements."""
        own, mine = copy(self), part.element[self.elements] >= 0
        entry = mine[self._facet]
        own.elements, own._owner, own._alive = part.element[self.elements[mine]], self._owner[mine], self._alive[mine]
        corners, own._corner = np.unique(self._corner[entry], return_inverse=True)
        own.nodes, own._weight = part.node[self.nodes[corners]], self._weight[entry]
        own._facet = (np.cumsum(mine) - 1)[self._facet[entry]]
        own._spread()
        return own
