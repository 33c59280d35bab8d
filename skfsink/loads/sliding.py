"""Nodes that slide on planes which are not normal to an axis: constraints, and what they leave of forces and matrices.

A node on planes with the unit normals n_i (orthonormal rows of N) has du with N du = 0. Balances stay in the axes of
the body; with the projection P = 1 - N^T N at these nodes (1 elsewhere) they become

    P f = 0,    P K P + s N^T N,    P M P,

whose solutions have no part along N, whatever s > 0 is. The matrices keep the pattern of K, and positive definite ones
stay so. N^T N f is the force of the plane; planes stand still, so that it does no work.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy

import numpy as np
from scipy.sparse import csr_array

from ..errors import MeshError, ParameterError, place_text
from ..fem.pattern import Pattern
from ..fem.selection import Selection
from ..fem.space import Space

__all__ = ["FLAT", "SlidingPlanes", "normal_of"]

FLAT = 1e-6     # of the size of the body: distance of the nodes of a plane from it
SAME = 1e-4     # angle [rad] up to which two planes are one; flat boundaries of one plane differ by less
PARALLEL = 1e-2  # angle up to which they are too near to each other to be told apart
_AXES = "xyz"


def normal_of(space: Space, nodes: np.ndarray, boundary: str) -> np.ndarray:
    """Unit normal (dim,) of the plane that the nodes of a boundary lie in, with a first component that is positive.

    It is exactly an axis where they have one coordinate in common.

    Raises
    ------
    MeshError
        They do not lie in one plane, or in many.
    """
    X, size = space.X[nodes], float(np.ptp(space.X, axis=0).max())
    flat = np.flatnonzero(np.ptp(X, axis=0) <= FLAT * size)
    off = X - X.mean(axis=0)
    _, s, rows = np.linalg.svd(off, full_matrices=False)
    if s.size < space.dim - 1 or s[space.dim - 2] <= FLAT * size:
        raise MeshError(f"boundary {boundary!r} cannot slide: its nodes ({len(nodes)}) lie in many planes, on a "
                        f"{'point' if space.dim == 2 else 'line'}; name all nodes of a flat side")
    if flat.size:
        return np.eye(space.dim)[flat[0]]
    normal: np.ndarray = rows[-1] * (np.sign(rows[-1][np.flatnonzero(np.abs(rows[-1]) > 1e-9)[0]]))
    far = np.abs(off @ normal)
    if far.max() > FLAT * size:
        raise MeshError(f"boundary {boundary!r} cannot slide: its node at {place_text(X[far.argmax()])} mm is "
                        f"{far.max():.2g} mm off the plane through all of them (at most {FLAT * size:.1g}); name each "
                        f"flat side apart")
    return normal


class SlidingPlanes:
    """What planes oblique to the axes hold of a body.

    Memory: how data on a pattern become those of a constrained matrix, which `constrained` keeps for each pattern that
    it was given; it depends on no earlier call. In a part of a body, its space last given to `on`, over which `matrix`
    is.

    Parameters
    ----------
    space: the mesh.
    planes: nodes of each, its normal (dim,), and the name of its boundary.
    free: (n, dim) mask of what grips along axes leave free. Nodes of which nothing is left are held in it from then on.
    moving: (n, dim) mask of what such grips move.

    Attributes
    ----------
    nodes: that slide, (k,), each once.
    normals: N of each, (k, dim-1, dim), rows of zeros where there are fewer planes; zero in what grips hold.

    Raises
    ------
    ParameterError
        A plane is crossed by the motion of a grip, or two planes at a node are nearly parallel.
    """

    def __init__(self, space: Space, planes: Sequence[tuple[np.ndarray, np.ndarray, str]], free: np.ndarray,
                 moving: np.ndarray) -> None:
        self.space, self._free = space, free
        found: dict[int, list[np.ndarray]] = {}
        for nodes, normal, name in planes:
            for node in nodes.tolist():
                self._hold(node, normal, name, found.setdefault(node, []), moving[node])
        full = [node for node, rows in found.items() if len(rows) == free[node].sum()]
        free[full] = False
        self.nodes = np.array(sorted(node for node, rows in found.items() if rows and node not in {*full}), int)
        self.normals = np.zeros((self.nodes.size, space.dim - 1, space.dim))
        for i, node in enumerate(self.nodes.tolist()):
            self.normals[i, :len(found[node])] = found[node]
        self._across = np.einsum("kqi,kqj->kij", self.normals, self.normals)
        self._along = np.eye(space.dim) - self._across
        self._maps: dict[int, tuple[Pattern, _Map]] = {}

    def _hold(self, node: int, normal: np.ndarray, name: str, rows: list[np.ndarray], moving: np.ndarray) -> None:
        """Add a plane to the `rows` of a node."""
        place = place_text(self.space.X[node])
        for i in np.flatnonzero(moving & (np.abs(normal) > SAME)):
            raise ParameterError(f"the node at {place} mm slides on the plane of {name}, and a grip moves it along "
                                 f"{_AXES[i]}, through the plane: leave {_AXES[i]} out of that grip, or end one of the "
                                 f"boundaries short of the other")
        left = np.where(self._free[node], normal, 0.0)
        left = left - sum((row * (row @ left) for row in rows), np.zeros_like(left))
        length = float(np.linalg.norm(left))
        if length < SAME:
            return
        if length < PARALLEL:
            raise ParameterError(f"the node at {place} mm slides on the plane of {name} and is held by another that is "
                                 f"parallel to it within {np.degrees(length):.2g} degrees (at least "
                                 f"{np.degrees(PARALLEL):.2g}): make one plane of them, or leave one out")
        rows.append(left / length)

    # --- parts of a body ---
    def of_part(self, part: Selection) -> SlidingPlanes:
        """The nodes that a part of the body has, to be put `on` the space of this part."""
        own, here = copy(self), part.node[self.nodes]
        mine = here >= 0
        own.nodes, own.normals, own._free = here[mine], self.normals[mine], self._free[part.nodes]
        own._across, own._along, own._maps = self._across[mine], self._along[mine], {}
        del own.space
        return own

    def on(self, space: Space) -> None:
        """Hold the nodes of the `space` of the part."""
        self.space = space

    def _whole(self, x: np.ndarray) -> np.ndarray:
        """Shares (k, dim) at the nodes that slide, made whole."""
        everywhere = np.zeros((self.space.n_nodes, self.space.dim))
        everywhere[self.nodes] = x
        whole: np.ndarray = self.space.exchange.whole(everywhere)[self.nodes]
        return whole

    # --- vectors and matrices ---
    def along(self, x: np.ndarray) -> np.ndarray:
        """P x: vectors at nodes (n, dim) without their parts along the normals."""
        y = x.copy()
        y[self.nodes] = np.einsum("kij,kj->ki", self._along, x[self.nodes])
        return y

    def matrix(self) -> csr_array:
        """P over all unknowns, (n*dim, n*dim)."""
        dim, n = self.space.dim, self.space.n_nodes
        blocks = np.broadcast_to(np.eye(dim), (n, dim, dim)).copy()
        blocks[self.nodes] = self._along
        rows, columns = (np.broadcast_to(i, blocks.shape) + dim * np.arange(n)[:, None, None]
                         for i in np.meshgrid(np.arange(dim), np.arange(dim), indexing="ij"))
        return csr_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(n * dim,) * 2)

    def across(self, x: np.ndarray) -> np.ndarray:
        """N x: parts along the normals of vectors at nodes (..., n, dim), flattened to (..., m)."""
        rows = np.any(self.normals != 0.0, axis=2)
        parts: np.ndarray = np.einsum("kqi,...ki->...kq", self.normals, x[..., self.nodes, :])[..., rows]
        return parts

    def constrained(self, pattern: Pattern, data: np.ndarray) -> np.ndarray:
        """Data of P A P + s N^T N for a symmetric matrix A with `data` on a pattern over the free unknowns.

        s is the least entry of the diagonal of A at the node, which adds no eigenvalue beyond those of A. In a part of
        a body data are its shares.
        """
        if id(pattern) not in self._maps:
            self._maps[id(pattern)] = pattern, self._map(pattern)
        return self._maps[id(pattern)][1].of(data)

    def _map(self, pattern: Pattern) -> _Map:
        dim, n = self.space.dim, self.space.n_nodes
        dofs = np.flatnonzero(self._free.ravel())
        number = np.full(n * dim, -1)
        number[dofs] = np.arange(dofs.size)
        place = np.full(n, -1)
        place[self.nodes] = np.arange(self.nodes.size)
        along = np.concatenate([self._along, np.eye(dim)[None]])  # the last one is that of all other nodes: place -1
        rows, columns = np.repeat(np.arange(pattern.size), np.diff(pattern.indptr)), pattern.indices
        (a, i), (b, j) = divmod(dofs[rows], dim), divmod(dofs[columns], dim)
        entries = np.flatnonzero((place[a] >= 0) | (place[b] >= 0))
        a, i, b, j = a[entries], i[entries], b[entries], j[entries]
        numbers = pattern.matrix(np.arange(1, pattern.nnz + 1))
        to, of, weights = [], [], []
        for k in range(dim):
            for m in range(dim):
                weight = along[place[a], i, k] * along[place[b], j, m]
                there = np.flatnonzero(weight != 0.0)
                p, q = number[a[there] * dim + k], number[b[there] * dim + m]
                if pattern.upper:
                    p, q = np.minimum(p, q), np.maximum(p, q)
                to.append(there)
                of.append(np.asarray(numbers[p, q]).ravel() - 1 if p.size else p)  # a sparse array is what is empty
                weights.append(weight[there])
        turn = csr_array((np.concatenate(weights), (np.concatenate(to), np.concatenate(of))),
                         shape=(entries.size, pattern.nnz))
        own = np.flatnonzero(a == b)
        diagonals = np.where(self._free[self.nodes], pattern.diagonal[number.reshape(n, dim)[self.nodes]], -1)
        counted = self.space.exchange.counts(n)[a[own]]
        across = self._across[place[a[own]], i[own], j[own]] * counted
        return _Map(entries, turn, own, place[a[own]], across, diagonals, self._whole)


class _Map:
    """Entries of a matrix that change, what they become of the data, and where s N^T N is added."""

    def __init__(self, entries: np.ndarray, turn: csr_array, own: np.ndarray, owner: np.ndarray, across: np.ndarray,
                 diagonals: np.ndarray, whole: Callable[[np.ndarray], np.ndarray]) -> None:
        self._whole = whole
        self._entries, self._turn, self._own, self._owner = entries, turn, own, owner
        self._across, self._diagonals = across, diagonals

    def of(self, data: np.ndarray) -> np.ndarray:
        new, there = data.copy(), self._diagonals >= 0
        turned = self._turn @ data
        diagonal = self._whole(np.where(there, data[self._diagonals], 0.0))
        least = np.where(there, np.abs(diagonal), np.inf).min(axis=1)
        turned[self._own] += least[self._owner] * self._across
        new[self._entries] = turned
        return new
