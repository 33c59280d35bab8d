"""The surface on which pressures act: boundaries where their elements bear force, and the lips of cracks from them."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

import numpy as np

from ..errors import MeshError, ParameterError
from ..fem.facets import Facets, boundary_facets, facets_of
from ..fem.kernels.flood import flood
from ..fem.kernels.relax import without_force
from ..fem.selection import Selection
from ..fem.space import Space

__all__ = ["WettedSurface"]


class WettedSurface:
    """Facets that several loads act on.

    Memory: the facets, and `area` of them, are of the density last given to `keep`; in a part of a body on its space
    last given to `on`, as are `nodes`. `of_part` is of the undamaged facets.

    Parameters
    ----------
    space: the mesh.
    boundaries: of each load, name and nodes; it acts on the facets of the surface that have all their nodes in it.
    cracks: numbers of the loads that act in the cracks from their boundary as well.

    Attributes
    ----------
    boundary, boundary_owner: facets of the undamaged boundaries, and the load of each, (b,).
    bears: those of them that bear load now, (b,).
    facets, owner: all that bear load now, and the load of each, (f,).

    Raises
    ------
    MeshError
        The mesh has no facet on a boundary.
    ParameterError
        Two loads act on one facet.
    """

    def __init__(self, space: Space, boundaries: Sequence[tuple[str, np.ndarray]], cracks: Sequence[int]) -> None:
        self.space, self._cracks = space, tuple(cracks)
        numbers = []
        for name, nodes in boundaries:
            found = boundary_facets(space, nodes)
            if not found.size:
                raise MeshError(f"no pressure can act on boundary {name!r}: no facet of the surface has all its nodes "
                                f"in it; it must be on the surface, and have all nodes of a side")
            numbers.append(found)
        everywhere = np.concatenate(numbers)
        self.boundary_owner = np.repeat(np.arange(len(numbers)), [found.size for found in numbers])
        places, first = np.unique(everywhere, return_index=True)
        if places.size < everywhere.size:
            again = np.setdiff1d(np.arange(everywhere.size), first)[0]
            both = self.boundary_owner[everywhere == everywhere[again]]
            names = " and ".join(repr(boundaries[k][0]) for k in both[:2])
            raise ParameterError(f"two pressures act on one side of an element, of boundaries {names}: end one short "
                                 f"of the other")
        self.boundary = facets_of(space, everywhere)
        self.bears = np.ones(everywhere.size, bool)
        self._gone = np.zeros(space.n_elements, bool)  # elements without force, at the last `keep`
        none = np.zeros(0, np.int64)
        self._between, self._between_numbers = facets_of(space, none), none  # sides that part this one from others
        self.facets, self.owner = self._whole = self.boundary, self.boundary_owner

    # --- parts of a body ---
    def of_part(self, part: Selection) -> WettedSurface:
        """The undamaged facets of a part of the body, to be put `on` the space of this part."""
        own = copy(self)
        mine = part.element[self.boundary.elements] >= 0
        own.boundary, own.boundary_owner = _in_part(self.boundary.some(mine), part), self.boundary_owner[mine]
        own.bears = np.ones(own.boundary_owner.size, bool)
        if self._cracks:
            sides = self.space.mesh.f2t
            here = (part.element[sides] >= 0) & (sides >= 0)
            own._between_numbers = np.flatnonzero((sides[1] >= 0) & (here.sum(axis=0) == 1))
            side = here[1, own._between_numbers].astype(int)
            own._between = _in_part(facets_of(self.space, own._between_numbers, side), part)
        del own.space, own.facets, own.owner, own._whole, own._gone
        return own

    def on(self, space: Space) -> None:
        """Lie on the `space` of the part."""
        self.space, self._gone = space, np.zeros(space.n_elements, bool)
        self.facets, self.owner = self._whole = self.boundary, self.boundary_owner

    # --- the surface at a density ---

    def keep(self, gamma: np.ndarray, deleted: np.ndarray, floor: float) -> bool:
        """Let loads act where elements bear force; returns whether these are others than before.

        Elements do not that are `deleted` (ne,), or have the nodal density `gamma` (n,) below `floor` at all their
        Gauss points.
        """
        gone = np.empty(self.space.n_elements, bool)
        without_force(self.space.nodes, gamma, self.space.N, deleted, floor, gone)
        if self.space.exchange.greatest(float(not np.array_equal(gone, self._gone))) == 0.0:
            return False
        self._gone = gone
        bears = ~gone[self.boundary.elements]
        if not np.array_equal(bears, self.bears):
            self.bears, self._whole = bears, (self.boundary.some(bears), self.boundary_owner[bears])
        elif not self._cracks:
            return False
        parts, owners = [self._whole[0]], [self._whole[1]]
        for k in self._cracks:
            for lips in self._lips(gone, self.boundary.elements[self.boundary_owner == k]):
                parts.append(lips)
                owners.append(np.full(lips.elements.size, k))
        self.facets, self.owner = Facets.joined(parts), np.concatenate(owners)
        return True

    @property
    def nodes(self) -> np.ndarray:
        """Nodes of the facets that bear load now, (k,)."""
        return np.unique(self.facets.nodes)

    def _lips(self, gone: np.ndarray, at: np.ndarray) -> list[Facets]:
        """Sides of elements that bear force, towards elements that are `gone` and joined by sides to some `at` (k,).

        Those towards elements of this part, and those towards others.
        """
        mesh, exchange, between = self.space.mesh, self.space.exchange, self._between.elements
        reached, ends = np.zeros(gone.size, bool), np.zeros(mesh.nfacets, np.int8)
        beyond = np.zeros(between.size, bool)
        start = at[gone[at]]
        while exchange.greatest(float(start.size)) > 0.0:  # once more in a part that others reach
            flood(mesh.t2f, mesh.f2t, gone, start, reached, ends)
            beyond = np.isin(self._between_numbers, exchange.all(self._between_numbers[reached[between]]))
            start = between[beyond & gone[between] & ~reached[between]]
        lips = [np.flatnonzero(ends == side) for side in (1, 2)]
        side = np.repeat([0, 1], [some.size for some in lips])
        return [facets_of(self.space, np.concatenate(lips), side), self._between.some(beyond & ~gone[between])]

    def area(self, u: np.ndarray) -> np.ndarray:
        """Areas of the facets, deformed by `u` (n, dim), (f,) [mm^2; mm in 2D]."""
        x = (self.space.X + u)[self.facets.nodes]
        if self.space.dim == 2:
            length: np.ndarray = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
            return length * np.pi * x[..., 0].sum(axis=1) if self.space.axisymmetric else length
        one, two = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), np.cross(x[:, 2] - x[:, 3], x[:, 1] - x[:, 3])
        area: np.ndarray = 0.5 * (np.linalg.norm(one, axis=1) + np.linalg.norm(two, axis=1))
        return area


def _in_part(facets: Facets, part: Selection) -> Facets:
    """Facets by the numbers of their elements and nodes in a part."""
    return Facets(part.element[facets.elements], facets.local, part.node[facets.nodes])
