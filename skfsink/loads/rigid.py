"""Rigid motions that the grips of a body leave free.

A body can move as far as no held degree of freedom resists a translation or a turn of it; one of revolution can move
along its axis alone. Pieces that share no more
than a node (in space: an edge) turn about it, so that each has motions of its own; nodes that pieces share move alike.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from ..errors import place_text
from ..fem.space import Space
from .schedule import Loading
from .sliding import SlidingPlanes

__all__ = ["Motion", "free_motions", "moves_as_a_whole", "pieces"]

RESISTED = 1e-11  # share of the greatest resistance from which on a motion is held; rounding gives 1e-15
_AXES = "xyz"


@dataclass(frozen=True)
class Motion:
    """A rigid motion that nothing resists.

    Attributes
    ----------
    piece: what moves: "the body", or a piece of it by its elements and its place.
    name: how, as "move along x" or "turn about (0, 1) mm".
    cure: what to hold.
    unheld: whether the piece is held by nothing at all, neither a grip nor a piece that is held.
    """

    piece: str
    name: str
    cure: str
    unheld: bool


def pieces(space: Space) -> np.ndarray:
    """Number of the piece of each element, (ne,): elements are joined by whole sides (2D) or faces (3D)."""
    f2t = space.mesh.f2t
    first, second = f2t[:, (f2t >= 0).all(axis=0)]
    n = space.n_elements
    _, label = connected_components(csr_array((np.ones(first.size), (first, second)), shape=(n, n)), directed=False)
    return np.asarray(label)


def free_motions(space: Space, free: np.ndarray, label: np.ndarray | None = None,
                 sliding: SlidingPlanes | None = None) -> Iterator[Motion]:
    """The rigid motions left to the body, or to its :func:`pieces`, by the mask `free` (n*dim,) of what is not held,
    and by planes that nodes slide on.
    """
    label = pieces(space) if label is None else label
    count, held = int(label.max()) + 1, ~free.reshape(space.X.shape)
    gripped = held & [False, True] if space.axisymmetric else held
    if space.axisymmetric:  # rings resist all of these but along the axis
        held = held | [True, False]
    size = float(np.ptp(space.X, axis=0).max())
    centre = space.X.mean(axis=0)
    X = (space.X - centre) / size
    modes = np.stack(list(_modes(X)))  # (nm, n, dim)
    nm = len(modes)
    members = [np.unique(space.conn[label == k]) for k in range(count)]
    stiffness = np.zeros((count * nm, count * nm))
    joined = csr_array((count, count))
    for k, nodes in enumerate(members):
        grasp = modes[:, nodes][:, held[nodes]]
        if sliding is not None:
            inside = np.isin(np.arange(space.n_nodes), nodes)[:, None]
            grasp = np.concatenate([grasp, sliding.across(modes * inside)], axis=1)
        block = slice(k * nm, (k + 1) * nm)
        stiffness[block, block] += grasp @ grasp.T
    if count > 1:
        joined = _join(stiffness, members, modes)
    clusters, cluster = connected_components(joined, directed=False)
    for c in range(clusters):
        joined = np.flatnonzero(cluster == c)
        columns = (joined[:, None] * nm + np.arange(nm)).ravel()
        values, vectors = np.linalg.eigh(stiffness[np.ix_(columns, columns)])
        nodes = np.concatenate([members[k] for k in joined])
        if not gripped[nodes].any() and (sliding is None or not np.isin(nodes, sliding.nodes).any()):
            yield Motion(_named(space, label, joined, count), "move", "", unheld=True)
            continue
        null = vectors[:, values < RESISTED * values[-1]].T.reshape(-1, len(joined), nm)
        for i, piece in enumerate(joined):
            moving = null[:, i]
            if len(moving) and np.abs(moving).max() > 1e-6:
                for name, cure in _names(moving, space.dim, centre, size):
                    yield Motion(_named(space, label, np.array([piece]), count), name, cure, unheld=False)


def _join(stiffness: np.ndarray, members: list[np.ndarray], modes: np.ndarray) -> csr_array:
    """Make nodes that pieces share move alike; the pieces that do are the entries of the matrix returned."""
    nm = len(modes)
    owner: dict[int, int] = {}
    links = np.zeros((len(members),) * 2)
    for k, nodes in enumerate(members):
        for node in nodes.tolist():
            if (j := owner.setdefault(node, k)) == k:
                continue
            a, b = modes[:, node] @ modes[:, node].T, slice(k * nm, (k + 1) * nm)
            c = slice(j * nm, (j + 1) * nm)
            stiffness[b, b] += a
            stiffness[c, c] += a
            stiffness[b, c] -= a
            stiffness[c, b] -= a
            links[j, k] = 1.0
    return csr_array(links)


def _modes(X: np.ndarray) -> Iterator[np.ndarray]:
    """Translations, then turns, of the points X (n, dim); a turn in the plane (j, i) moves i with -x_j."""
    dim = X.shape[1]
    for row in np.eye(dim):
        yield np.broadcast_to(row, X.shape)
    for i, j in _planes(dim):
        turn = np.zeros_like(X)
        turn[:, i], turn[:, j] = -X[:, j], X[:, i]
        yield turn


def _planes(dim: int) -> list[tuple[int, int]]:
    return [(0, 1)] if dim == 2 else [(1, 2), (2, 0), (0, 1)]


def _names(motions: np.ndarray, dim: int, centre: np.ndarray, size: float) -> Iterator[tuple[str, str]]:
    """What the space of `motions` (m, nm) consists of, translations first, with their cures."""
    _, s, rows = np.linalg.svd(motions)
    basis = rows[:int((s > 1e-6).sum())]
    # translations: combinations without a turn
    left, s, _ = np.linalg.svd(basis[:, dim:])
    turning = int((s > 1e-6).sum())
    shifts = left[:, turning:].T @ basis[:, :dim]
    along = [i for i in range(dim) if len(shifts) and np.linalg.norm(shifts[:, i]) > 1.0 - 1e-6]
    for i in along:
        yield f"move along {_AXES[i]}", f"hold {_AXES[i]} at one boundary, such as {_AXES[i]} = 0"
    shifts[:, along] = 0.0
    for shift in np.linalg.svd(shifts)[2][:len(shifts) - len(along)]:
        yield (f"move along ({', '.join(f'{x:.2g}' for x in shift)})",
               "hold one boundary in one more direction, as by x = 0")
    for turn in left[:, :turning].T @ basis:
        t, w = turn[:dim] * size, turn[dim:]
        if dim == 2:
            at = centre + np.array([-t[1], t[0]]) / w[0]
            yield (f"turn about {_place(at)} mm",
                   "hold a boundary at two places, or in one more direction")
        else:
            at = centre + np.cross(w, t) / (w @ w)
            axis = np.round(w / w[np.argmax(np.abs(w))], 6)
            yield (f"turn about the axis ({', '.join(f'{x + 0.0:.2g}' for x in axis)}) through {_place(at)} mm",
                   "hold a boundary at two places, or in one more direction")


def _place(x: np.ndarray) -> str:
    return place_text(np.round(x, 9) + 0.0)  # no -0


def _named(space: Space, label: np.ndarray, joined: np.ndarray, count: int) -> str:
    if len(joined) == count:
        return "the body"
    elements = np.flatnonzero(np.isin(label, joined))
    middle = space.X[space.conn[elements]].mean(axis=(0, 1))
    return f"the piece of {len(elements)} elements around {_place(middle)} mm"


def moves_as_a_whole(space: Space, loading: Loading, label: np.ndarray) -> bool:
    """Whether grips that move only carry every one of the :func:`pieces` along, and strain none, at all load times."""
    held = ~loading.free.reshape(space.X.shape)
    members = [np.unique(space.conn[label == k]) for k in range(int(label.max()) + 1)]
    if loading.turns:
        others = np.setdiff1d(np.flatnonzero(held.any(axis=1)), loading.turns[0].nodes)
        return len(members) == 1 and not others.size and loading.sliding is None
    moved = False
    for t in (0.0, *loading.knots):
        v = loading.velocity(t)
        moved = moved or bool(v[held].any())
        for nodes in members:
            whole = np.zeros(space.dim)
            for i in range(space.dim):
                speeds = v[nodes[held[nodes, i]], i]
                if speeds.size and np.ptp(speeds) > 1e-12 * np.abs(speeds).max():
                    return False
                whole[i] = speeds[0] if speeds.size else 0.0
            if space.axisymmetric and whole[0] != 0.0:  # it widens
                return False
            if loading.sliding is not None and whole.any():
                inside = np.isin(np.arange(space.n_nodes), nodes)[:, None]
                if np.abs(loading.sliding.across(np.where(inside, whole, 0.0))).max() > 1e-9 * np.abs(whole).max():
                    return False
    return moved
