"""Faces of a body that have passed through each other: nothing keeps them apart without contact."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...fem.space import Space
from ...pictures.body import FACETS, outer_facets
from ...system.jit import njit

__all__ = ["Overlap", "overlap"]

LIVE = 0.5        # gamma of all nodes of an element that counts: further down its shape means little
SLIGHT = 0.05     # of the size of an element: faces that slide along each other, or rounding, stay below it
MOST = 400        # nodes whose depth is measured, picked evenly if there are more
_CHUNK = 2_000_000           # pairs of nodes and facets at a time
_ROUNDING = 1e-6             # of the size of an element
_SMOOTH = 3                  # rings of facets over which the outward direction at a node is a mean
_CELLS = {2: 512, 3: 96}     # of the grid in which nodes are looked for, along its longest side


class Overlap(NamedTuple):
    """How far a body overlaps itself.

    Attributes
    ----------
    depth: greatest distance of a node of the surface from the face it has passed through [mm].
    place: that node on the undeformed body [mm], (dim,).
    size: h of the element it lies in [mm].
    inside: number of nodes of the surface that lie inside of the body.
    """

    depth: float
    place: np.ndarray
    size: float
    inside: int


def overlap(space: Space, u: np.ndarray, gamma: np.ndarray, deleted: np.ndarray) -> Overlap | None:
    """Where the body that is left passes through itself at the displacement `u` (n, dim); None where it does not.

    The body is made of the elements that are not `deleted` (ne,) and whose nodes all have a relative density `gamma`
    (n,) of at least `LIVE`; its surface of their outer facets, along a notch or a crack too. A node of the surface that
    lies in an element which does not have it shows that two faces have passed through each other, unless an element
    that has the node is inside out. The depth is the distance to the nearest facet that looks the other way: exact
    between plane faces, otherwise to the error of the chords of the mesh. Less than `SLIGHT` of an element is none.

    Faces that meet the mirror image of the body at a plane of symmetry are not seen.
    """
    x = space.X + u
    elements = np.flatnonzero(~deleted & (gamma[space.conn] >= LIVE).all(axis=1))
    if not elements.size:
        return None
    conn = space.conn[elements]
    element, facet = np.nonzero(outer_facets(space, elements))
    faces = conn[element[:, None], FACETS[space.dim][facet]]
    nodes = np.unique(faces)
    seen, home = _inside(x, conn, nodes, float(np.median(space.h)))
    count = len(seen)
    if not count:
        return None
    picked = np.unique(np.linspace(0, len(seen) - 1, min(len(seen), MOST)).astype(int))
    seen, home = seen[picked], home[picked]
    depth = _depth(x, faces, seen)
    worst = int(np.argmax(depth))
    size = float(space.h[elements[home[worst]]])
    return Overlap(float(depth[worst]), space.X[seen[worst]], size, count) if depth[worst] > SLIGHT * size else None


def _upright(x: np.ndarray) -> np.ndarray:
    """Mask of the elements with corners `x` (nl, na, dim) that are inside out at none of them."""
    dim = x.shape[2]
    positive = np.ones(len(x), bool)
    for a in range(2**dim):
        arms = [x[:, a ^ 1 << i] - x[:, a] for i in range(dim)]
        size = (arms[0][:, 0] * arms[1][:, 1] - arms[0][:, 1] * arms[1][:, 0] if dim == 2
                else np.einsum("ei,ei->e", np.cross(arms[0], arms[1]), arms[2]))
        positive &= size * (-1.0) ** a.bit_count() > 0
    return positive


def _inside(x: np.ndarray, conn: np.ndarray, nodes: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
    """Nodes among `nodes` (nb,) that lie in an element of `conn` (nl, na) which does not have them; those elements.

    `h` is the usual size of an element [mm].
    """
    points, dim = x[nodes], x.shape[1]
    # a grid of cells; what flies far off counts to the outermost ones
    first, last = np.quantile(points, (0.01, 0.99), axis=0)
    width = max(h, float((last - first).max()) / _CELLS[dim])
    shape = np.maximum(np.ceil((last - first) / width), 1).astype(int)
    cell = np.clip(np.floor((points - first) / width), 0, shape - 1).astype(int) @ np.append(1, np.cumprod(shape[:-1]))
    order = np.argsort(cell, kind="stable")
    begin = np.searchsorted(cell[order], np.arange(int(shape.prod()) + 1))
    pairs = _boxed(x, conn, nodes, _Grid(order, begin, first, width, shape))
    if not len(pairs):
        return pairs[:, 0], pairs[:, 1]
    node, element = nodes[pairs[:, 0]], pairs[:, 1]
    touched = np.zeros(len(x), bool)
    touched[node] = True
    beside = np.flatnonzero(touched[conn].any(axis=1))
    inverted = conn[beside[~_upright(x[conn[beside]])]]
    touched[inverted] = False
    hit = touched[node] & _upright(x[conn[element]]) & _in_element(x[conn[element]], x[node])
    node, element = node[hit], element[hit]
    _, found = np.unique(node, return_index=True)
    return node[found], element[found]


class _Grid(NamedTuple):
    """Cells of a `width` [mm], `shape` (dim,) of them from `first` (dim,) on.

    Those of the nodes in cell c are `order[begin[c]:begin[c + 1]]`.
    """

    order: np.ndarray
    begin: np.ndarray
    first: np.ndarray
    width: float
    shape: np.ndarray


@njit(cache=True)
def _boxed(x, conn, nodes, grid):  # type: ignore[no-untyped-def]
    """Pairs (m, 2) of a place in `nodes` and an element of `conn` whose box holds that node, and which has it not.

    `grid` is a :class:`_Grid` of the nodes.
    """
    order, begin, first, width, shape = grid.order, grid.begin, grid.first, grid.width, grid.shape
    na, dim = conn.shape[1], x.shape[1]
    found = np.empty((256, 2), np.int64)
    low, high = np.zeros(dim), np.zeros(dim)
    start, stop = np.zeros(3, np.int64), np.zeros(3, np.int64)
    count = 0
    for e in range(conn.shape[0]):
        for d in range(dim):
            low[d] = high[d] = x[conn[e, 0], d]
            for a in range(1, na):
                low[d] = min(low[d], x[conn[e, a], d])
                high[d] = max(high[d], x[conn[e, a], d])
            slack = _ROUNDING * (high[d] - low[d])
            low[d], high[d] = low[d] - slack, high[d] + slack
            start[d] = min(max(np.floor((low[d] - first[d]) / width), 0), shape[d] - 1)
            stop[d] = min(max(np.floor((high[d] - first[d]) / width), 0), shape[d] - 1)
        for k in range(start[2], stop[2] + 1):
            for j in range(start[1], stop[1] + 1):
                row = (k * shape[1] + j) * shape[0]
                for i in range(begin[row + start[0]], begin[row + stop[0] + 1]):
                    p = nodes[order[i]]
                    inside = True
                    for d in range(dim):
                        inside = inside and low[d] <= x[p, d] <= high[d]
                    if not inside:
                        continue
                    for a in range(na):
                        inside = inside and conn[e, a] != p
                    if inside:
                        if count == found.shape[0]:
                            found = np.concatenate((found, np.empty_like(found)))
                        found[count, 0], found[count, 1] = order[i], e
                        count += 1
    return found[:count]


def _in_element(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Mask of the points (m, dim) inside of the elements with these corners (m, na, dim), by Newton's method."""
    dim, na = points.shape[1], corners.shape[1]
    bits = (np.arange(na)[:, None] >> np.arange(dim)) & 1
    xi = np.full(points.shape, 0.5)
    scale = np.ptp(corners, axis=1).max(axis=1) if len(points) else np.zeros(0)
    error = np.full(len(points), np.inf)
    for _ in range(12):
        factor = np.where(bits, xi[:, None], 1 - xi[:, None])          # (m, na, dim)
        gap = points - np.einsum("ma,mai->mi", factor.prod(axis=2), corners)
        error = np.linalg.norm(gap, axis=1)
        if (error <= 1e-9 * scale).all():
            break
        J = np.stack([np.einsum("ma,mai->mi", np.delete(factor, k, axis=2).prod(axis=2) * np.where(bits[:, k], 1, -1),
                                corners) for k in range(dim)], axis=2)
        singular = np.abs(np.linalg.det(J)) < 1e-12 * scale**dim
        J[singular] = np.eye(dim) * scale[singular, None, None]
        xi = np.clip(xi + np.linalg.solve(J, gap[..., None])[..., 0], -0.5, 1.5)
    return (error <= _ROUNDING * scale) & (np.abs(xi - 0.5) <= 0.5 + _ROUNDING).all(axis=1)


def _depth(x: np.ndarray, faces: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Distance [mm] of nodes (m,) to the nearest of the facets (nf, corners) whose outward normals oppose theirs."""
    corners = x[faces]
    if x.shape[1] == 2:
        edge = corners[:, 1] - corners[:, 0]
        normal = np.column_stack([edge[:, 1], -edge[:, 0]])
    else:
        normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    out, around = np.zeros_like(x), normal
    for _ in range(_SMOOTH):  # outward at the nodes: lips of a crack are jagged
        out = np.column_stack([np.bincount(faces.ravel(), np.repeat(part, faces.shape[1]), len(x))
                               for part in around.T])
        around = out[faces].sum(axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    level = np.einsum("fi,fi->f", corners[:, 0], normal) + _ROUNDING * np.ptp(corners, axis=1).max(axis=1)
    depth = np.empty(len(nodes))
    step = max(1, _CHUNK // max(1, len(faces)))
    for start in range(0, len(nodes), step):
        some = nodes[start:start + step]
        row, column = np.nonzero((out[some] @ normal.T < 0) & (x[some] @ normal.T <= level))
        least = np.full(len(some), np.inf)
        np.minimum.at(least, row, _distance(x[some[row]], corners[column]))
        depth[start:start + step] = np.where(np.isfinite(least), least, 0.0)
    return depth


def _distance(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Distance of points (m, dim) to facets (m, 2 or 4, dim), one each; a facet in space is two triangles."""
    if corners.shape[1] == 2:
        return _to_segment(points, corners[:, 0], corners[:, 1])
    return np.minimum(_to_triangle(points, corners[:, [0, 1, 2]]), _to_triangle(points, corners[:, [0, 2, 3]]))


def _to_segment(points: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    along = np.einsum("mi,mi->m", points - a, b - a) / np.maximum(np.einsum("mi,mi->m", b - a, b - a), 1e-300)
    gap: np.ndarray = np.linalg.norm(points - a - np.clip(along, 0, 1)[:, None] * (b - a), axis=1)
    return gap


def _to_triangle(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.maximum(np.linalg.norm(normal, axis=1), 1e-300)
    above = np.einsum("mi,mi->m", points - corners[:, 0], normal) / length
    over = np.ones(len(points), bool)
    edges = []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        edge = corners[:, b] - corners[:, a]
        over &= np.einsum("mi,mi->m", np.cross(normal, edge), points - corners[:, a]) >= 0
        edges.append(_to_segment(points, corners[:, a], corners[:, b]))
    return np.where(over, np.abs(above), np.min(edges, axis=0))
