"""Sides of elements that lie on each other and do not share their nodes: meshes that do not match, and slits.

A body is open along such sides. Where one side is covered by several that have its corners, a finer mesh meets a
coarser one, or elements lie on top of others; nothing else looks like that, and it is refused. Where nodes coincide and
stay two, the mesh may have a slit, which is noted.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from ...errors import MeshError
from ...fem.facets import facets_of
from ...fem.space import Space
from .tidy import place

__all__ = ["check_sides", "slit_note"]

NEAR = 1e-4   # distance of a node from a side on which it is taken to lie, over the size of the side
WHOLE = 1e-3  # share of a side that others may leave open and yet cover it


class _Sides(NamedTuple):
    """The surface of a body.

    Attributes
    ----------
    nodes: of each side, around it, (f, 2) in the plane and (f, 4) in space.
    size: the distance of its farthest corner from its middle, (f,).
    """

    nodes: np.ndarray
    size: np.ndarray


def check_sides(name: str, space: Space) -> None:
    """Refuse a mesh in which a side belongs to more than two elements, or is covered by smaller ones that share its
    corners (MeshError)."""
    of = np.bincount(space.mesh.t2f.ravel())
    if (many := np.flatnonzero(of > 2)).size:
        where = space.X[space.mesh.facets[:, many[0]]].mean(axis=0)
        raise MeshError(f"mesh {name}: {len(many)} {'edges' if space.dim == 2 else 'faces'} are shared by more than "
                        f"two elements, such as at {place(where)} mm: elements overlap; mend the mesh there")
    sides = _sides(space)
    side, node = _nodes_on(space, sides)
    order = np.argsort(sides.nodes, axis=None)
    first = np.searchsorted(sides.nodes.ravel()[order], np.arange(space.n_nodes + 1))
    width, found = sides.nodes.shape[1], []
    for f in np.unique(side):
        inside = node[slice(*np.searchsorted(side, [f, f + 1]))]
        known = np.concatenate([sides.nodes[f], inside])
        others = np.unique(np.concatenate([order[first[a]:first[a + 1]] // width for a in known]))
        others = others[(others != f) & np.isin(sides.nodes[others], known).all(axis=1)]
        corners = np.isin(sides.nodes[f], sides.nodes[others]).all()
        if corners and _area(space, sides.nodes[others]).sum() >= (1 - WHOLE) * _area(space, sides.nodes[[f]])[0]:
            found.append(inside)
    if found:
        nodes = np.unique(np.concatenate(found))
        raise MeshError(f"mesh {name}: {len(nodes)} node(s) lie in sides of elements that do not have them, such as "
                        f"{place(space.X[nodes[0]])} mm: a finer mesh meets a coarser one, or elements lie on top of "
                        f"others, and nothing would join them there; mesh so that neighbours share all their nodes")


def slit_note(space: Space) -> str:
    """A note on nodes of the surface that coincide and are two, "" if there are none."""
    nodes = np.unique(space.mesh.facets[:, space.mesh.boundary_facets()])
    pairs = cKDTree(space.X[nodes]).query_pairs(NEAR * float(space.h.min()), output_type="ndarray").reshape(-1, 2)
    if not len(pairs):
        return ""
    X = space.X[nodes[pairs[:, 0]]]
    X = np.where(np.abs(X) < 1e-9 * np.ptp(space.X), 0.0, X)
    return (f"{len(pairs)} pair(s) of nodes coincide, between {place(X.min(axis=0))} and {place(X.max(axis=0))} mm: "
            f"the body is open there, as along a slit; if it is not meant, join them by merge_nodes")


def _sides(space: Space) -> _Sides:
    nodes = facets_of(space, space.mesh.boundary_facets()).nodes
    if space.dim == 3:
        nodes = nodes[:, [0, 1, 3, 2]]
    X = space.X[nodes]
    return _Sides(nodes, np.linalg.norm(X - X.mean(axis=1, keepdims=True), axis=2).max(axis=1))


def _nodes_on(space: Space, sides: _Sides) -> tuple[np.ndarray, np.ndarray]:
    """Sides and nodes of the surface that lie on them, and on none of their corners, (m,) each; by side, ascending."""
    nodes, X = np.unique(sides.nodes), space.X
    corner = X[sides.nodes]
    close = cKDTree(X[nodes]).query_ball_point(corner.mean(axis=1), (1 + NEAR) * sides.size)
    side = np.repeat(np.arange(len(close)), [len(found) for found in close])
    node = nodes[np.concatenate([np.asarray(found, np.int64) for found in close])]
    within = NEAR * sides.size[side]
    own = np.linalg.norm(corner[side] - X[node][:, None], axis=2).min(axis=1) <= within
    side, node, within = side[~own], node[~own], within[~own]
    if space.dim == 2:
        a, b = corner[side, 0], corner[side, 1]
        along, to = b - a, X[node] - a
        length = np.linalg.norm(along, axis=1)
        on = np.abs(along[:, 0] * to[:, 1] - along[:, 1] * to[:, 0]) <= within * length
    else:
        normal = np.cross(corner[side, 2] - corner[side, 0], corner[side, 3] - corner[side, 1])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        on = np.abs(((X[node] - corner[side].mean(axis=1)) * normal).sum(axis=1)) <= within
        for k in range(4):
            edge, to = corner[side, (k + 1) % 4] - corner[side, k], X[node] - corner[side, k]
            on &= (np.cross(edge, to) * normal).sum(axis=1) >= -within * np.linalg.norm(edge, axis=1)
    return side[on], node[on]


def _area(space: Space, nodes: np.ndarray) -> np.ndarray:
    """Length or area of sides, (f,)."""
    X = space.X[nodes]
    if space.dim == 2:
        length: np.ndarray = np.linalg.norm(X[:, 1] - X[:, 0], axis=1)
        return length
    area: np.ndarray = 0.5 * np.linalg.norm(np.cross(X[:, 2] - X[:, 0], X[:, 3] - X[:, 1]), axis=1)
    return area
