"""Facets of elements, with their nodes in the order that puts the normal outside of the element."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from skfem.refdom import Refdom, RefHex, RefQuad

from .quadrature import AXES
from .space import Space

__all__ = ["FACETS", "Facets", "boundary_facets", "facets_of"]

#: Local nodes of the facets of an element. In the plane the normal of the edge from a to b is (dy, -dx); in space the
#: nodes are at (0, 0), (1, 0), (0, 1) and (1, 1) of (s, t), and the normal is x,s × x,t.
FACETS = {2: np.array([[2, 0], [1, 3], [0, 1], [3, 2]]),
          3: np.array([[0, 4, 2, 6], [1, 3, 5, 7], [0, 1, 4, 5], [2, 6, 3, 7], [0, 2, 1, 3], [4, 5, 6, 7]])}


def _in_order_of(refdom: type[Refdom]) -> np.ndarray:
    """Those facets in the order in which scikit-fem numbers the sides of an element."""
    dim = len(refdom.p)
    local = refdom.p[AXES[dim]].T.astype(int) @ 2 ** np.arange(dim)  # its corners by our numbers
    return np.array([next(facet for facet in FACETS[dim] if set(facet) == set(local[corners]))
                     for corners in refdom.facets])


_FACETS_OF_SIDES = {2: _in_order_of(RefQuad), 3: _in_order_of(RefHex)}


class Facets(NamedTuple):
    """Some facets, f of them, each of one element.

    Attributes
    ----------
    elements: to which they belong, (f,).
    local: their nodes by the numbers in the element, (f, k), k = 2 in the plane and 4 in space.
    nodes: the same by the numbers in the mesh, (f, k).
    """

    elements: np.ndarray
    local: np.ndarray
    nodes: np.ndarray

    def some(self, mask: np.ndarray) -> Facets:
        """Those where a `mask` (f,) is true."""
        kept = np.flatnonzero(mask)
        return Facets(self.elements[kept], self.local[kept], self.nodes[kept])

    @classmethod
    def joined(cls, parts: Sequence[Facets]) -> Facets:
        """All of several."""
        return cls(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def facets_of(space: Space, numbers: np.ndarray, side: np.ndarray | int = 0) -> Facets:
    """Facets by the `numbers` (f,) they have in the mesh, each of its first or second element, `side` 0 or 1 (f,)."""
    elements = space.mesh.f2t[side, numbers]
    local = _FACETS_OF_SIDES[space.dim][(space.mesh.t2f[:, elements] == numbers).argmax(axis=0)]
    return Facets(elements, local, space.conn[elements[:, None], local])


def boundary_facets(space: Space, nodes: np.ndarray) -> np.ndarray:
    """Numbers of the facets of the surface that have all their nodes among `nodes` (k,)."""
    boundary: np.ndarray = space.mesh.boundary_facets()
    inside = np.zeros(space.n_nodes, bool)
    inside[nodes] = True
    found: np.ndarray = boundary[inside[space.mesh.facets[:, boundary]].all(axis=0)]
    return found
