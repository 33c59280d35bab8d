"""The surface of a body at a named boundary: its facets, means over it, and the volume that it encloses."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..errors import MeshError, ParameterError, place_text
from .facets import FACETS, boundary_facets, facets_of
from .kernels.surface import swept_volumes
from .places import Places
from .quadrature import points, shape_functions
from .space import Space

__all__ = ["Surface"]

FLAT = 1e-6   # of its size: how far a rim may be from its plane
_QUAD = (0, 1, 3, 2)  # corners of the unit square on the way round, and back


class Surface:
    """Facets of the surface of a body all of whose nodes belong to a boundary.

    Parameters
    ----------
    space: the mesh.
    name: of the boundary, for messages.
    nodes: of the boundary.

    Attributes
    ----------
    facets: nodes of the facets on their way round, (nf, 2) or (nf, 4): in the plane the body is on the left of them, in
        space they turn to the left about the normal that points out of the body.
    elements: of the facets, (nf,).

    Raises
    ------
    MeshError
        No facet of the surface has all its nodes in the boundary.
    """

    def __init__(self, space: Space, name: str, nodes: np.ndarray) -> None:
        self.space, self.name = space, name
        numbers = boundary_facets(space, nodes)
        if not numbers.size:
            raise MeshError(f"boundary {name!r} is no surface: no facet of the surface of the body has all its nodes "
                            f"in it; name all nodes of a side")
        found, table = facets_of(space, numbers), FACETS[space.dim]
        self.elements = found.elements
        self.facets = found.nodes if space.dim == 2 else found.nodes[:, _QUAD]
        self._sides = (found.local[:, None] == table).all(axis=2).argmax(axis=1)

    # --- means ---
    def places(self) -> tuple[Places, np.ndarray]:
        """Points of integration on the facets, and their parts of the undeformed surface [mm^(volume_dim-1)], (m,)."""
        space, dim = self.space, self.space.dim
        flat = points(dim - 1) if dim == 3 else np.array([[0.5 - 0.5 / np.sqrt(3)], [0.5 + 0.5 / np.sqrt(3)]])
        elements, shape, weights = [], [], []
        for side in np.unique(self._sides):
            axis, upper = divmod(int(side), 2)
            N, dN = shape_functions(np.insert(flat, axis, float(upper), axis=1))
            of = self.elements[self._sides == side]
            arms = np.einsum("eai,qak->eqik", space.X[space.conn[of]], np.delete(dN, axis, axis=2))
            area = np.sqrt(np.linalg.det(np.swapaxes(arms, -1, -2) @ arms)) / len(flat)
            if space.axisymmetric:
                area = area * 2.0 * np.pi * (space.X[space.conn[of], 0] @ N.T)
            elements.append(np.repeat(of, len(flat)))
            shape.append(np.tile(N, (of.size, 1)))
            weights.append(area.ravel())
        return Places(np.concatenate(elements), np.concatenate(shape)), np.concatenate(weights)

    # --- the volume ---
    def rims(self) -> list[np.ndarray]:
        """Pieces of the rim, each the directed edges (m, 2) that facets have on one side alone; in the plane the pairs
        (1, 2) of the last and the first node of each open line. None of a closed surface."""
        if self.space.dim == 2:
            return self._ends()
        edges = np.concatenate([self.facets[:, [i, (i + 1) % 4]] for i in range(4)])
        there = {(int(a), int(b)) for a, b in edges}
        open_ = np.array([(a, b) for a, b in edges.tolist() if (b, a) not in there], int).reshape(-1, 2)
        if not len(open_):
            return []
        used, index = np.unique(open_, return_inverse=True)
        index = index.reshape(-1, 2)
        graph = coo_array((np.ones(len(index)), index.T), shape=(used.size,) * 2)
        _, piece = connected_components(graph, directed=False)
        return [open_[piece[index[:, 0]] == k] for k in range(piece.max() + 1)]

    def _ends(self) -> list[np.ndarray]:
        following = dict(self.facets.tolist())
        firsts = sorted(set(following) - set(following.values()))
        found = []
        for first in firsts:
            last = first
            while last in following:
                last = following[last]
            found.append(np.array([[last, first]]))
        return found

    def check_caps(self) -> None:
        """Refuse a rim that no flat cap closes (ParameterError); disks close all rings of a body of revolution."""
        if self.space.axisymmetric:
            return
        rims, X = self.rims(), self.space.X
        cure = "give the position of a point to which straight lines from the rim close it"
        if self.space.dim == 2 and len(rims) > 1:
            raise ParameterError(f"the boundary {self.name!r} is {len(rims)} open lines, and it is not said how they "
                                 f"enclose an area: {cure}")
        for rim in rims if self.space.dim == 3 else []:
            corners = X[np.unique(rim)]
            centred = corners - corners.mean(axis=0)
            height = np.linalg.svd(centred)[2][2] @ centred.T
            if np.abs(height).max() > FLAT * np.abs(centred).max():
                raise ParameterError(f"the rim of the boundary {self.name!r} around "
                                     f"{place_text(corners.mean(axis=0))} mm is not in a plane, and no flat cap closes "
                                     f"it: {cure}")

    def volume(self, x: np.ndarray, apex: np.ndarray | None = None) -> float:
        """(1/dim) int (x - apex) . n dA over the surface at the nodal positions `x` (n, dim) [mm^dim].

        n points out of the body: the volume that a cavity encloses is the negative of it. Without an `apex` open rims
        are closed by flat caps, in space by a fan of triangles to the mean of the rim's nodes; with an `apex` (dim,) by
        straight lines to it, which add nothing. Of a body of revolution disks normal to the axis are the caps, and the
        apex is on the axis (ParameterError).
        """
        if self.space.axisymmetric:
            return self._round_volume(x, apex)
        centre = x[self.facets[0, 0]] if apex is None else apex
        total = _flux(x[self.facets] - centre)
        if apex is None:
            for rim in self.rims():
                corners = x[rim[:, ::-1] if self.space.dim == 3 else rim] - centre
                if self.space.dim == 3:
                    middle = (x[np.unique(rim)] - centre).mean(axis=0)
                    total += float(np.einsum("ei,ei->", np.cross(corners[:, 0], corners[:, 1]),
                                             np.broadcast_to(middle, corners[:, 0].shape))) / 6
                else:
                    total += _flux(corners)
        return total


    def _round_volume(self, x: np.ndarray, apex: np.ndarray | None) -> float:
        """pi int r^2 dz within the rings; with an apex that of the cones to it is left out."""
        if apex is not None:
            if apex[0] != 0.0:
                raise ParameterError(f"the point that closes the boundary {self.name!r} of a body of revolution must "
                                     f"be on its axis, x = 0; got {place_text(apex)} mm")
            return _flux(x[self.facets] - apex, revolved=True)
        (r, z), (s, y) = np.moveaxis(x[self.facets], 0, -1)
        return float(np.pi / 3 * ((r * r + r * s + s * s) * (y - z)).sum())


def _flux(corners: np.ndarray, revolved: bool = False) -> float:
    """(1/dim) int x . n dA over facets with corners (nf, 2 or 4, dim), those in space bilinear; it is exact.

    It is the volume that they sweep on their way from the origin.
    """
    of = corners if corners.shape[1] == 2 else corners[:, _QUAD]
    x, out = of.reshape(-1, of.shape[2]), np.empty(len(of))
    start, owner = np.zeros_like(x), np.zeros(len(of), np.int64)
    swept_volumes(np.arange(len(x)).reshape(of.shape[:2]), owner, np.ones((2, 1)), start, start, x, out, revolved)
    return -float(out.sum())
