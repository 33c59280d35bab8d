"""A body in pieces: found, refused with the cure, and joined where nodes coincide."""

from __future__ import annotations

import itertools
import math

import meshio
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ...errors import MeshError, require
from ...fem.space import Space
from .tidy import add_note, body_blocks, place, renumber

__all__ = ["check_one_piece", "hinge_note", "hinges", "merged"]

CLOSE = 1e-3  # distance of nodes that are taken for one, over the shortest edge of an element


def piece_of(n_nodes: int, cells: list[np.ndarray]) -> np.ndarray:
    """Number of the piece each node is in, (n,): elements `cells` of one piece share nodes, in a chain."""
    first = np.concatenate([np.repeat(nodes[:, 0], nodes.shape[1] - 1) for nodes in cells])
    other = np.concatenate([nodes[:, 1:].ravel() for nodes in cells])
    graph = coo_array((np.ones(len(first), np.int8), (first, other)), shape=(n_nodes, n_nodes))
    found: np.ndarray = connected_components(graph, directed=False)[1]
    return found


def check_one_piece(name: str, path: str, space: Space, option: bool = False) -> None:
    """See that the body is in one piece (MeshError, which says how many nodes coincide, and what to do).

    `name` is that of the mesh, `path` that of its file; `option` says that the scene has the parameter `merge_nodes`.
    """
    piece = piece_of(space.n_nodes, [space.conn])
    n = int(piece.max()) + 1
    if n == 1:
        return
    owner = piece[space.conn[:, 0]]
    counts = np.bincount(owner)
    order = np.argsort(-counts, kind="stable")
    sizes = ", ".join(f"{counts[i]}" for i in order[:5]) if n > 2 else " and ".join(f"{counts[i]}" for i in order)
    smallest = space.X[space.conn[np.argmax(owner == order[-1])]].mean(axis=0)
    found = (f"mesh {name} is in {n} pieces that share no node ({sizes}{', …' if n > 5 else ''} elements, the smallest "
             f"near {place(smallest)} mm)")
    edge = shortest(space.X, [space.conn])[0]
    pairs = _pairs(space.X, CLOSE * edge)
    pairs = pairs[piece[pairs[:, 0]] != piece[pairs[:, 1]]]
    if not len(pairs):
        others = cKDTree(space.X[piece != order[-1]])
        gap = float(others.query(space.X[piece == order[-1]])[0].min())
        raise MeshError(f"{found}, and no nodes of theirs coincide (the smallest is {gap:.3g} mm from the next): a run "
                        f"is of one body; mesh the parts so that they share their nodes, or leave the others out")
    away = float(np.linalg.norm(space.X[pairs[:, 0]] - space.X[pairs[:, 1]], axis=1).max())
    within = _round_up(max(2 * away, 1e-9 * float(np.ptp(space.X, axis=0).max()), min(1e-6, CLOSE * edge / 10)))
    graph = coo_array((np.ones(len(pairs), np.int8), (piece[pairs[:, 0]], piece[pairs[:, 1]])), shape=(n, n))
    left = connected_components(graph, directed=False)[0]
    rest = f" ({left} pieces would be left)" if left > 1 else ""
    here = f"give merge_nodes = \"{within} mm\", or " if option else ""
    raise MeshError(f"{found}; {len(pairs)} pairs of nodes coincide within {within} mm: {here}mend the file with "
                    f"skfsink mesh {path} OUT.vtu --merge-nodes {within}mm{rest}")


def hinges(space: Space) -> np.ndarray:
    """Nodes at which parts of a body meet that share no edge (in three dimensions: no face)."""
    beside = space.mesh.f2t
    inner = beside[:, beside[1] >= 0]
    graph = coo_array((np.ones(inner.shape[1], np.int8), (inner[0], inner[1])), shape=(space.n_elements,) * 2)
    n, part = connected_components(graph, directed=False)
    if n == 1:
        return np.zeros(0, np.int64)
    low, high = np.full(space.n_nodes, n), np.full(space.n_nodes, -1)
    np.minimum.at(low, space.conn, part[:, None])
    np.maximum.at(high, space.conn, part[:, None])
    return np.flatnonzero(low < high)


def hinge_note(space: Space) -> str:
    """A note on the :func:`hinges` of a body, "" if there are none."""
    nodes = hinges(space)
    if not len(nodes):
        return ""
    what = "node" if space.dim == 2 else "node or edge"
    return (f"parts of the body hang together by a single {what}, at {len(nodes)} node(s), such as "
            f"{place(space.X[nodes[0]])} mm: a hinge, or a crack that goes too far; if it is not meant, mend the mesh "
            f"there")


def merged(name: str, mesh: meshio.Mesh, tolerance: float) -> meshio.Mesh:
    """The mesh, changed in place, with one node where several are within `tolerance` [mm] of each other; 0 merges none.

    Sets have the nodes and cells of all. Notes say how many nodes went, where, and where a slit may have been closed.

    Raises
    ------
    ParameterError
        The tolerance is no length.
    MeshError
        An element would lose a node.
    """
    require("merge_nodes", tolerance, "mm", low=0)
    cells = [mesh.cells[i].data for i in body_blocks(mesh)]
    if not tolerance or not cells:
        return mesh
    edge, block, element = shortest(mesh.points, cells)
    number = element + sum(len(nodes) for nodes in cells[:block])
    at = place(mesh.points[cells[block][element]].mean(axis=0))
    if edge <= tolerance:
        raise MeshError(f"mesh {name}: merging nodes within {tolerance:g} mm would collapse element {number} near {at}"
                        f", which has nodes {edge:.3g} mm apart: give a merge_nodes smaller than that")
    pairs = _pairs(mesh.points, tolerance)
    if not len(pairs):
        add_note(mesh, f"no two nodes are within {tolerance:g} mm of each other: merge_nodes has changed nothing")
        return mesh
    n = len(mesh.points)
    graph = coo_array((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    group = connected_components(graph, directed=False)[1]
    kept = np.unique(group, return_index=True)[1]  # by group, the first node of each
    rank = np.argsort(np.argsort(kept))
    for i, nodes in enumerate(cells):
        groups = np.sort(group[nodes], axis=1)
        if (lost := (groups[:, 1:] == groups[:, :-1]).any(axis=1)).any():
            e = int(lost.argmax())
            raise MeshError(f"mesh {name}: merging nodes within {tolerance:g} mm joins a chain of them and would "
                            f"collapse element {e + sum(len(c) for c in cells[:i])} near "
                            f"{place(mesh.points[nodes[e]].mean(axis=0))}: give a smaller merge_nodes")
    piece = piece_of(n, cells)
    gone = np.setdiff1d(np.arange(n), kept)
    inside = gone[piece[gone] == piece[kept[group[gone]]]]
    low, high = mesh.points[gone].min(axis=0), mesh.points[gone].max(axis=0)
    add_note(mesh, f"{len(gone)} node(s) were merged with others within {tolerance:g} mm, between {place(low)} and "
                   f"{place(high)} mm")
    if len(inside):
        low, high = mesh.points[inside].min(axis=0), mesh.points[inside].max(axis=0)
        add_note(mesh, f"{len(inside)} of the merged node(s) joined a piece to itself, between {place(low)} and "
                       f"{place(high)} mm: if these were the two faces of a slit or a crack, it is closed now")
    renumber(mesh, rank[group])
    return mesh


def shortest(X: np.ndarray, cells: list[np.ndarray]) -> tuple[float, int, int]:
    """Least distance of two nodes of an element, with the number of its block and its own there."""
    best = (math.inf, 0, 0)
    for number, nodes in enumerate(cells):
        for a, b in itertools.combinations(range(nodes.shape[1] if len(nodes) else 0), 2):
            away = np.linalg.norm(X[nodes[:, a]] - X[nodes[:, b]], axis=1)
            e = int(away.argmin())
            best = min(best, (float(away[e]), number, e))
    return best


def _pairs(X: np.ndarray, distance: float) -> np.ndarray:
    """Pairs of nodes within a distance, (m, 2)."""
    pairs: np.ndarray = cKDTree(X).query_pairs(distance, output_type="ndarray")
    return pairs.reshape(-1, 2)


def _round_up(length: float) -> str:
    """The next power of ten, as it is written in a deck."""
    return f"1e{math.ceil(math.log10(length) - 1e-9)}"
