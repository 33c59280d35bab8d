"""Contact of crack faces without a search: elements that bear no force are a third medium between the lips.

An element that exerts no force any more (:meth:`.Momentum.effective`) has the energy V psi_c(J_bar) of a medium that
resists being crushed, and nothing else. With d = J_c - J_bar and the modulus k_c

    psi_c = 0 (d < 0),   k_c d^3/(6 delta) (d < delta),   k_c [(d - delta)^2 + delta (d - delta) + delta^2/3]/2 beyond:

its second derivative rises from 0 to k_c over delta. All three are continuous, finite and monotone for any J_bar, of
elements that are inside out as well.

Nodes that have lost nearly all of their mass cannot bear the medium's force: the explicit step would fall. They follow
the lips, u_f = H u_l, with the harmonic interpolation H of the undeformed mesh, and the medium's force on them goes to
the lips by H^T. It is the derivative of the energy as a function of u_l alone. Rows of H sum to 1 and reproduce linear
functions (at a few corners of the surface constants alone), so that the total force is zero and so is its moment.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csc_matrix, csr_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from ..fem.backend import Part
from ..fem.direct import Rows
from ..fem.space import Space
from ..system.jit import njit

__all__ = ["Contact"]


class Contact:
    """The medium between the lips of a crack.

    Memory: the medium, the nodes that follow and their interpolation are of the last `update`; `energy` is of the last
    `add_force`, `evaluate`, `renew` or `restore`; `rest` is of all `renew` so far, and belongs into a checkpoint.

    Parameters
    ----------
    space: the spaces.
    parts: the body by its materials, whose moduli the medium has.
    free: (n*dim,) mask of the degrees of freedom that nothing holds; the others do not follow.

    Attributes
    ----------
    medium: numbers of the elements that bear no force, ascending.
    massless: (n, dim) mask of the free degrees of freedom of nodes without an element that bears force; they follow.
    energy: of the medium [N mm; N mm/mm in 2D].
    rest: J_c of the elements, (ne,); it falls only.
    """

    J_C = 0.95     # J_bar below which the medium resists
    DELTA = 0.05   # of J_bar, over which its modulus rises
    STIFF = 20.0   # k_c over the shear modulus, unless the bulk modulus is less
    BEARS = 0.05   # mass of a node, relative to the intact one, from which on it bears the medium's force

    def __init__(self, space: Space, parts: Sequence[Part], free: np.ndarray) -> None:
        self.space, self._free = space, free.reshape(-1, space.dim)
        self._modulus = np.empty(space.n_elements)
        for material, elements, _ in parts:
            self._modulus[slice(None) if elements is None else elements] = min(
                material.bulk_modulus, self.STIFF * material.shear_modulus)
        self.rest = np.full(space.n_elements, self.J_C)
        self._energies = np.zeros(space.n_elements)
        self.medium = np.zeros(0, np.int64)
        self.massless = np.zeros(space.X.shape, bool)
        self._moved = np.zeros(0, np.int64)  # numbers of those degrees of freedom
        self._bears = np.ones(space.n_nodes, bool)
        self._followers: list[_Followers] = []
        self._inverse_mass = np.zeros(space.n_nodes)
        self.energy = 0.0

    # --- the medium ---
    def update(self, gamma: np.ndarray, mass: np.ndarray, intact: np.ndarray) -> None:
        """Take the medium from the density that the force sees (ne, nq), and the lips from masses of nodes (n,) [t].

        `intact` are those of the intact body.
        """
        space = self.space
        medium = np.flatnonzero(_forceless(gamma))
        bears = mass >= self.BEARS * intact
        if not (np.array_equal(medium, self.medium) and np.array_equal(bears, self._bears)):
            self.medium, self._bears = medium, bears
            living = np.ones(space.n_elements, bool)
            living[medium] = False
            alive = np.zeros(space.n_nodes, bool)
            alive[space.conn[living]] = True
            self.massless = ~alive[:, None] & self._free
            self._moved = np.flatnonzero(self.massless)
            self._tie()
        inverse = np.repeat(1.0 / np.maximum(mass, self.BEARS * intact)[:, None], space.dim, axis=1)
        self._inverse_mass = self.follow(inverse).max(axis=1)

    def _tie(self) -> None:
        """Find the nodes of the medium that follow, and what they follow."""
        space, self._followers = self.space, []
        near = np.zeros(space.n_nodes, bool)
        near[space.conn[self.medium]] = True
        weak = near & ~self._bears
        if not weak.any():
            return
        weights = _Weights(space, weak)
        for i in range(space.dim):
            nodes = weights.anchored(np.flatnonzero(weak & self._free[:, i]))
            if not nodes.size:
                continue
            same = next((one for one in self._followers if np.array_equal(one.nodes, nodes)), None)
            if same is not None:
                same.components.append(i)
            else:
                self._followers.append(_Followers(weights, nodes, i))

    def follow(self, values: np.ndarray) -> np.ndarray:
        """Nodal values (n, dim) with those of the nodes that follow taken from the lips."""
        placed = values.copy()
        for one in self._followers:
            one.interpolate(placed)
        return placed

    def place(self, values: np.ndarray) -> np.ndarray:
        """Let nodes without mass follow the lips in nodal values (n, dim), such as displacements; see `follow`."""
        if not self._followers:
            return values
        placed = self.follow(values)
        values.reshape(-1)[self._moved] = placed.reshape(-1)[self._moved]
        return placed

    # --- energy and force ---
    def evaluate(self, placed: np.ndarray) -> float:
        """Energy at the displacement `placed` (n, dim) [mm], in which nodes follow."""
        self._sum(self._pressed(placed)[1])
        return self.energy

    def _sum(self, energy: np.ndarray) -> None:
        self._energies[...] = 0.0
        self._energies[self.medium] = energy
        self.energy = float(energy.sum())

    def add_force(self, placed: np.ndarray, out: np.ndarray) -> None:
        """Add the force at the displacement `placed`, in which nodes follow, to `out` (n, dim) [N; N/mm in 2D].

        Sets `energy`.
        """
        J_bar, energy = self._pressed(placed)
        self._sum(energy)
        if self.energy == 0.0:
            return
        space, force = self.space, np.zeros_like(out)
        _add_force(space.X + placed, space.nodes, space.dN, space.w, self.medium, J_bar,
                   (self._modulus, self.rest, self.DELTA), force)
        for one in self._followers:
            one.pass_on(force)
        out += force

    def renew(self, placed: np.ndarray) -> float:
        """Energy at the displacement `placed` after an :meth:`update`, which raises that of no element.

        One that would have more has joined, or has a node that has begun to follow: its `rest` is lowered until it has
        what it had at the last evaluation. Contact thus takes energy from the body, and gives none.
        """
        if self.medium.size:
            J_bar, energy = self._pressed(placed)
            before = self._energies[self.medium]
            stiffness = self._modulus[self.medium] * self.space.V[self.medium]
            lowered = J_bar + _depth(before / stiffness, self.DELTA)
            self.rest[self.medium] = np.where(energy > before, np.minimum(self.rest[self.medium], lowered),
                                              self.rest[self.medium])
        return self.evaluate(placed)

    def restore(self, rest: np.ndarray, placed: np.ndarray) -> float:
        """Energy at the displacement `placed` with the `rest` of a checkpoint."""
        self.rest = rest.copy()
        return self.evaluate(placed)

    def _pressed(self, placed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """J_bar and energy of the elements of the medium."""
        space = self.space
        J_bar, energy = np.empty(self.medium.size), np.empty(self.medium.size)
        _crushed(space.X + placed, space.nodes, space.dN, space.w, self.medium,
                 (self._modulus, self.rest, self.DELTA), J_bar, energy)
        return J_bar, energy

    def stiffest(self, u: np.ndarray) -> float:
        """Bound of the highest frequency squared that the medium adds [1/s^2] at the displacement `u` (n, dim).

        Twice the greatest of an element by itself, since two of them share a lip, with its geometric part. The inverse
        mass of a node that follows is interpolated: H diag(1/m) H^T is at most that, where H >= 0.
        """
        if not self.medium.size:
            return 0.0
        space, placed = self.space, self.follow(u)
        J_bar, energy = self._pressed(placed)
        if not energy.any():
            return 0.0
        return 2.0 * float(_stiffest(space.X + placed, space.nodes, space.dN, space.w, self.medium, J_bar,
                                     (self._modulus, self.rest, self.DELTA), self._inverse_mass))


class _Weights:
    """Weights of the nodes around each `weak` node (n,): its row of the Laplacian, made exact for linear functions."""

    def __init__(self, space: Space, weak: np.ndarray) -> None:
        n, na = space.n_nodes, space.conn.shape[1]
        around = np.flatnonzero(weak[space.conn].any(axis=1))
        local = np.einsum("eq,eqai,eqbi->eab", space.w[around], space.dN[around], space.dN[around])
        rows = np.repeat(space.conn[around], na, axis=1).ravel()
        columns = np.tile(space.conn[around], (1, na)).ravel()
        matrix = csr_array(coo_array((local.ravel(), (rows, columns)), shape=(n, n)))
        matrix.sum_duplicates()
        for a in np.flatnonzero(weak):
            _make_linear(matrix, int(a), space.X)
        self.matrix = matrix

    def anchored(self, nodes: np.ndarray) -> np.ndarray:
        """Those of `nodes` that are joined, through others of them, to a node that is not among them."""
        if not nodes.size:
            return nodes
        inner = self.matrix[nodes][:, nodes]
        _, piece = connected_components(inner, directed=False)
        outer = np.ones(self.matrix.shape[0], bool)
        outer[nodes] = False
        reaches = abs(self.matrix[nodes]) @ outer.astype(float) > 0.0
        found: np.ndarray = nodes[np.bincount(piece, reaches)[piece] > 0]
        return found


def _make_linear(matrix: csr_array, a: int, X: np.ndarray) -> None:
    """Give a node `a` on the surface a row of its own, which takes linear functions of X (n, dim) to 0.

    The row of the Laplacian does so inside of the body. On a plane face the new one has the nodes of that face alone:
    weights 1/r^2, each changed by as small a share as it takes. A node at a corner, which has none, keeps its row.
    """
    here = slice(matrix.indptr[a], matrix.indptr[a + 1])
    columns, row = matrix.indices[here], matrix.data[here]
    others = columns != a
    arms = (X[columns[others]] - X[a]).T
    if (np.abs(arms @ row[others]) <= 1e-10 * (np.abs(arms) @ np.abs(row[others])).max()).all():
        return
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


class _Followers:
    """Nodes that follow in some components, and the factors of their interpolation."""

    def __init__(self, weights: _Weights, nodes: np.ndarray, component: int) -> None:
        self.nodes, self.components = nodes, [component]
        rows = weights.matrix[nodes]
        lu = splu(rows[:, nodes].tocsc())
        self._factors = _Factors(_columns(lu.L), _columns(lu.U), lu.perm_r, lu.perm_c)
        rows = csr_array(rows - rows.multiply(np.isin(np.arange(rows.shape[1]), nodes)[None, :]))
        rows.eliminate_zeros()
        self._rows = Rows(rows.indptr, rows.indices, rows.data)

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


@njit(cache=True)
def _forceless(gamma):  # type: ignore[no-untyped-def]
    """Mask of the elements without a Gauss point that exerts a force."""
    found = np.ones(gamma.shape[0], np.bool_)
    for e in range(gamma.shape[0]):
        for q in range(gamma.shape[1]):
            if gamma[e, q] > 0.0:
                found[e] = False
    return found


@njit(cache=True)
def _psi(d, delta):  # type: ignore[no-untyped-def]
    """psi_c, psi_c' and psi_c'' for a modulus of 1 at d = J_c - J_bar."""
    if d <= 0.0:
        return 0.0, 0.0, 0.0
    if d < delta:
        return d * d * d / (6 * delta), -d * d / (2 * delta), d / delta
    past = d - delta
    return 0.5 * (past * past + delta * past + delta * delta / 3), -(past + 0.5 * delta), 1.0


def _depth(psi: np.ndarray, delta: float) -> np.ndarray:
    """The d >= 0 at which a modulus of 1 has the energy `psi`."""
    past = 0.5 * (np.sqrt(np.maximum(8.0 * psi - delta * delta / 3, 0.0)) - delta)
    return np.where(psi < delta * delta / 6, np.cbrt(6 * delta * psi), delta + past)


@njit(cache=True)
def _gradient(x, nodes, slopes, F):  # type: ignore[no-untyped-def]
    """F at a Gauss point from the positions of the nodes and their `slopes`; returns J."""
    dim = x.shape[1]
    F[...] = 0.0
    for a in range(nodes.size):
        for i in range(dim):
            for k in range(dim):
                F[i, k] += x[nodes[a], i] * slopes[a, k]
    if dim == 2:
        return F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
    return (F[0, 0] * (F[1, 1] * F[2, 2] - F[1, 2] * F[2, 1]) - F[0, 1] * (F[1, 0] * F[2, 2] - F[1, 2] * F[2, 0])
            + F[0, 2] * (F[1, 0] * F[2, 1] - F[1, 1] * F[2, 0]))


@njit(cache=True)
def _crushed(x, conn, dN, w, medium, law, J_bar, energy):  # type: ignore[no-untyped-def]
    """J_bar and energy of the elements of the medium."""
    modulus, rest, delta = law
    F = np.empty((x.shape[1], x.shape[1]))
    for m in range(medium.size):
        e = medium[m]
        volume, size = 0.0, 0.0
        for q in range(w.shape[1]):
            size += w[e, q]
        if x.shape[1] == 2:  # half the product of the diagonals
            a, b, c, d = conn[e, 0], conn[e, 1], conn[e, 2], conn[e, 3]
            volume = 0.5 * ((x[d, 0] - x[a, 0]) * (x[c, 1] - x[b, 1]) - (x[d, 1] - x[a, 1]) * (x[c, 0] - x[b, 0]))
        else:
            for q in range(w.shape[1]):
                volume += w[e, q] * _gradient(x, conn[e], dN[e, q], F)
        J_bar[m] = volume / size
        energy[m] = size * modulus[e] * _psi(rest[e] - J_bar[m], delta)[0]


@njit(cache=True)
def _arms(x, nodes, dN, w, F, b):  # type: ignore[no-untyped-def]
    """V dJ_bar/du of an element into `b` (na, dim); returns its volume."""
    dim, size = x.shape[1], 0.0
    b[...] = 0.0
    for q in range(w.size):
        _gradient(x, nodes, dN[q], F)
        size += w[q]
        for i in range(dim):
            for k in range(dim):
                if dim == 2:
                    cofactor = F[1 - i, 1 - k] if i == k else -F[1 - i, 1 - k]
                else:
                    i1, i2, k1, k2 = (i + 1) % 3, (i + 2) % 3, (k + 1) % 3, (k + 2) % 3
                    cofactor = F[i1, k1] * F[i2, k2] - F[i1, k2] * F[i2, k1]
                for a in range(nodes.size):
                    b[a, i] += w[q] * cofactor * dN[q, a, k]
    return size


@njit(cache=True)
def _add_force(x, conn, dN, w, medium, J_bar, law, out):  # type: ignore[no-untyped-def]
    modulus, rest, delta = law
    dim, na = x.shape[1], conn.shape[1]
    F, b = np.empty((dim, dim)), np.empty((na, dim))
    for m in range(medium.size):
        e = medium[m]
        if J_bar[m] >= rest[e]:
            continue
        _arms(x, conn[e], dN[e], w[e], F, b)
        pressure = modulus[e] * _psi(rest[e] - J_bar[m], delta)[1]
        for a in range(na):
            for i in range(dim):
                out[conn[e, a], i] += pressure * b[a, i]


@njit(cache=True)
def _stiffest(x, conn, dN, w, medium, J_bar, law, inverse_mass):  # type: ignore[no-untyped-def]
    """Greatest bound of the frequency squared of an element of the medium by itself."""
    modulus, rest, delta = law
    dim, na = x.shape[1], conn.shape[1]
    F, b = np.empty((dim, dim)), np.empty((na, dim))
    greatest = 0.0
    for m in range(medium.size):
        e = medium[m]
        if J_bar[m] >= rest[e]:
            continue
        size = _arms(x, conn[e], dN[e], w[e], F, b)
        _, slope, curvature = _psi(rest[e] - J_bar[m], delta)
        total = 0.0
        for a in range(na):
            square, flat = 0.0, 0.0
            for i in range(dim):
                square += b[a, i] * b[a, i]
                mean = 0.0
                for q in range(w.shape[1]):
                    mean += w[e, q] * dN[e, q, a, i]
                flat += mean * mean
            total += (curvature * square - slope * np.sqrt(flat * max(flat, square))) * inverse_mass[conn[e, a]]
        greatest = max(greatest, modulus[e] * total / size)
    return greatest
