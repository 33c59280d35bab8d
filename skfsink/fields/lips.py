"""The lips of a crack: which way they face, and the nodes between them, which have next to no mass and follow them.

Nodes that have lost nearly all of their mass cannot bear the force of the medium between the lips: the explicit step
would fall. They follow the lips, u_f = H u_l, with the harmonic interpolation H of the undeformed mesh, and the
medium's force on them goes to the lips by H^T. Rows of H sum to 1 and reproduce linear functions (at a few corners of
the surface constants alone), so that the total force is zero and so is its moment.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csc_matrix, csr_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from ..fem.direct import Rows
from ..fem.space import Space
from ..system.jit import njit

__all__ = ["Followers", "Weights", "facing"]

ROUNDS = 20  # of elements from the lips that know where these face


def facing(space: Space, medium: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tangents of the crack in the elements `medium`, (medium, dim-1, dim), and how sure they are, in [0, 1].

    The normal is the first principal direction of the sum of n n^T over faces around between the medium and other
    elements; it is sure as far as the second principal value is less than the first. Elements with no such face near
    know nothing: 0.
    """
    mesh, dim = space.mesh, space.dim
    inside = np.zeros(space.n_elements, bool)
    inside[medium] = True
    one, other = mesh.f2t
    lips = np.flatnonzero((other >= 0) & (inside[one] != inside[other]))
    corners = space.X[mesh.facets[:, lips].T]
    normal = corners[:, 1] - corners[:, 0]
    if dim == 2:
        normal = np.stack([normal[:, 1], -normal[:, 0]], axis=1)
    else:  # the corners are in no order: any three of them span a face whose sides are parallel
        normal = np.cross(normal, corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1)
    tensors = (normal[:, :, None] * normal[:, None, :] / size[:, None, None]).reshape(len(lips), dim * dim)
    nodes, at_nodes = space.conn[medium], np.zeros((space.n_nodes, dim * dim))
    for corner in mesh.facets[:, lips]:
        np.add.at(at_nodes, corner, tensors)
    around = at_nodes[nodes].sum(axis=1)
    around = _spread(around, nodes, at_nodes)  # smooth along the crack
    for _ in range(ROUNDS):
        unknown = np.flatnonzero(~around.any(axis=1))
        if not unknown.size:
            break
        around[unknown] = _spread(around, nodes, at_nodes)[unknown]
    values, vectors = np.linalg.eigh(around.reshape(-1, dim, dim))
    sure = np.divide(values[:, -1] - values[:, -2], values[:, -1] + values[:, -2],
                     out=np.zeros(medium.size), where=values[:, -1] > 0.0)
    return np.ascontiguousarray(np.swapaxes(vectors[:, :, :-1], 1, 2)), sure


def _spread(values: np.ndarray, nodes: np.ndarray, at_nodes: np.ndarray) -> np.ndarray:
    """Sums over the elements, with `nodes` (m, na), that share a node, of `values` (m, k); `at_nodes` is (n, k)."""
    at_nodes[...] = 0.0
    for corner in nodes.T:
        np.add.at(at_nodes, corner, values)
    spread: np.ndarray = at_nodes[nodes].sum(axis=1)
    return spread


class Weights:
    """Weights of the nodes around each node: its row of the Laplacian, made exact for linear functions.

    Memory: `make` keeps the rows of nodes on the surface that it has made; they are the same whenever they are made.

    Attributes
    ----------
    matrix: (n, n), row sums 0. That of a node on the surface is as said once it was among the `weak` of `make`.
    """

    def __init__(self, space: Space) -> None:
        n, na = space.n_nodes, space.conn.shape[1]
        slopes = space.dN
        local = np.einsum("eq,eqai,eqbi->eab", space.w, slopes, slopes)
        rows, columns = np.repeat(space.conn, na, axis=1).ravel(), np.tile(space.conn, (1, na)).ravel()
        self.matrix = csr_array(coo_array((local.ravel(), (rows, columns)), shape=(n, n)))
        self.matrix.sum_duplicates()
        self._X = space.X
        miss = np.abs(self.matrix @ space.X).max(axis=1)
        self._bent = miss > 1e-10 * (abs(self.matrix) @ np.abs(space.X - space.X.mean(axis=0))).max(axis=1)

    def make(self, weak: np.ndarray) -> None:
        """Make the rows of the `weak` nodes, a mask (n,), exact for linear functions."""
        for a in np.flatnonzero(weak & self._bent):
            _make_linear(self.matrix, int(a), self._X)
            self._bent[a] = False


def _make_linear(matrix: csr_array, a: int, X: np.ndarray) -> None:
    """Give a node `a` on the surface a row of its own, which takes linear functions of X (n, dim) to 0.

    The row of the Laplacian does so inside of the body. On a plane face the new one has the nodes of that face alone:
    weights 1/r^2, each changed by as small a share as it takes. A node at a corner, which has none, keeps its row.
    """
    here = slice(matrix.indptr[a], matrix.indptr[a + 1])
    columns, row = matrix.indices[here], matrix.data[here]
    others = columns != a
    arms = (X[columns[others]] - X[a]).T
    weights = 1.0 / np.einsum("ib,ib->b", arms, arms)
    share = np.linalg.lstsq((weights * arms) @ arms.T, arms @ weights, rcond=1e-10)[0] @ arms
    changed = weights * (1.0 - share)
    if changed.sum() > 0.2 * weights.sum():
        row[others] = -changed
        row[~others] = changed.sum()


class _Factors(NamedTuple):
    """P A Q = L U of a sparse matrix; columns of L (unit diagonal) and of U."""

    L: Rows
    U: Rows
    row: np.ndarray     # place of a row in P A Q, (m,)
    column: np.ndarray  # place of a column


class Followers:
    """Nodes that follow in some components, and the factors of their interpolation.

    Parameters
    ----------
    matrix: of :class:`Weights`.
    weak: numbers of nodes, ascending; those that are joined, through others of them, to a node that is not among them
        follow.
    component: of nodal values, in which they follow; `components` may get others.
    """

    def __init__(self, matrix: csr_array, weak: np.ndarray, component: int) -> None:
        self.weak, self.components = weak, [component]
        rows = matrix[weak]
        inner = np.zeros(matrix.shape[0], bool)
        inner[weak] = True
        _, piece = connected_components(rows[:, weak], directed=False)
        anchors = np.add.reduceat(~inner[rows.indices], rows.indptr[:-1])
        anchored = np.bincount(piece, anchors)[piece] > 0
        self.nodes: np.ndarray = weak[anchored]
        if not anchored.all():
            rows = rows[anchored]
        lu = splu(rows[:, self.nodes].tocsc())
        self._factors = _Factors(_columns(lu.L), _columns(lu.U), lu.perm_r, lu.perm_c)
        outer = ~inner[rows.indices]  # of nodes that do not follow
        ends = np.concatenate([[0], np.cumsum(outer)])[rows.indptr]
        self._rows = Rows(ends, rows.indices[outer], rows.data[outer])

    def interpolate(self, values: np.ndarray) -> None:
        """Set the values at the nodes that follow, of nodal values (n, components), to H values."""
        _interpolate(self._factors, self._rows, self.nodes, np.array(self.components), values)

    def pass_on(self, forces: np.ndarray) -> None:
        """Give the forces on the nodes that follow, of nodal forces (n, components), to the others: H^T forces."""
        _pass_on(self._factors, self._rows, self.nodes, np.array(self.components), forces)


def _columns(matrix: csc_matrix) -> Rows:
    """A sparse matrix by columns, with ascending rows."""
    matrix = matrix.tocsc()
    matrix.sort_indices()
    return Rows(matrix.indptr, matrix.indices, matrix.data)


@njit(cache=True)
def _interpolate(factors, rows, nodes, components, values):  # type: ignore[no-untyped-def]
    L, U, m = factors.L, factors.U, nodes.size
    z = np.empty(m)
    for c in components:
        for i in range(m):
            total = 0.0
            for k in range(rows.indptr[i], rows.indptr[i + 1]):
                total -= rows.data[k] * values[rows.indices[k], c]
            z[factors.row[i]] = total
        for j in range(m):
            for k in range(L.indptr[j], L.indptr[j + 1]):
                if L.indices[k] != j:
                    z[L.indices[k]] -= L.data[k] * z[j]
        for j in range(m - 1, -1, -1):
            last = U.indptr[j + 1] - 1
            z[j] /= U.data[last]
            for k in range(U.indptr[j], last):
                z[U.indices[k]] -= U.data[k] * z[j]
        for i in range(m):
            values[nodes[i], c] = z[factors.column[i]]


@njit(cache=True)
def _pass_on(factors, rows, nodes, components, forces):  # type: ignore[no-untyped-def]
    L, U, m = factors.L, factors.U, nodes.size
    z = np.empty(m)
    for c in components:
        for i in range(m):
            z[factors.column[i]] = forces[nodes[i], c]
            forces[nodes[i], c] = 0.0
        for j in range(m):
            last = U.indptr[j + 1] - 1
            for k in range(U.indptr[j], last):
                z[j] -= U.data[k] * z[U.indices[k]]
            z[j] /= U.data[last]
        for j in range(m - 1, -1, -1):
            for k in range(L.indptr[j], L.indptr[j + 1]):
                if L.indices[k] != j:
                    z[j] -= L.data[k] * z[L.indices[k]]
        for i in range(m):
            for k in range(rows.indptr[i], rows.indptr[i + 1]):
                forces[rows.indices[k], c] -= rows.data[k] * z[factors.row[i]]
