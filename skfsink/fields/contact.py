"""Contact of crack faces without a search: elements that bear no force are a third medium between the lips.

An element that exerts no force any more (:meth:`.Momentum.effective`) resists being crushed between the lips
(:mod:`.medium`), and nothing else. Nodes between the lips follow them (:mod:`.lips`). The force on the lips is the
derivative of the energy as a function of their displacement alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..fem.backend import Part
from ..fem.space import Space
from ..system.jit import njit
from .energy import Ledger
from .lips import Followers, Weights, facing
from .medium import Law, Strips, depth, missing, pulls, push, stiffest

__all__ = ["Contact"]


class Contact:
    """The medium between the lips of a crack.

    Memory: the medium, its tangents, the nodes that follow and their interpolation are of the last `update`, and
    `follow`, `place`, `stiffest` and `tangent` with them; `energy` is of the last `add_force`, `evaluate` or `renew`,
    and `book` goes on from it; `rest` is of all `renew` so far, and belongs into a checkpoint.

    Parameters
    ----------
    space: the spaces.
    parts: the body by its materials, whose shear moduli the medium has.
    free: (n*dim,) mask of the degrees of freedom that nothing holds; the others do not follow.

    Attributes
    ----------
    medium: numbers of the elements that bear no force, ascending.
    massless: (n, dim) mask of the free degrees of freedom of nodes without an element that bears force; they follow.
    energy: of the medium [N mm; N mm/mm in 2D].
    rest: r of the elements, (ne,); 1, and falls only.
    """

    BEARS = 0.05  # mass of a node, relative to the intact one, from which on it bears the medium's force

    def __init__(self, space: Space, parts: Sequence[Part], free: np.ndarray) -> None:
        self.space, self._free = space, free.reshape(-1, space.dim)
        ne, dim = space.n_elements, space.dim
        modulus = np.empty(ne)
        for material, elements, _ in parts:
            modulus[slice(None) if elements is None else elements] = material.shear_modulus
        self.rest = np.ones(ne)
        self._strips = Strips.of(space)
        self._law = Law(modulus, self.rest, np.zeros((ne, dim - 1, dim)), np.zeros(ne), 3 if dim == 2 else 2)
        self._energies = np.zeros(0, np.int64), np.zeros(0)  # elements, and what each had at the last one
        self._force = np.empty_like(space.X)
        self.medium = np.zeros(0, np.int64)
        self.massless = np.zeros(space.X.shape, bool)
        self._moved = np.zeros(0, np.int64)  # numbers of those degrees of freedom
        self._bears = np.ones(space.n_nodes, bool)
        self._weak = np.zeros(space.n_nodes, bool)
        self._weights: Weights | None = None  # of the whole mesh, from the first failure on
        self._followers: list[Followers] = []
        self._masses = np.ones(space.n_nodes), np.ones(space.n_nodes)  # of nodes now, and of the intact body
        self._changed = True  # whether `update` has changed anything since `renew`
        self.energy = 0.0

    # --- the medium ---
    def update(self, gamma: np.ndarray, mass: np.ndarray, intact: np.ndarray) -> None:
        """Take the medium from the density that the force sees (ne, nq), and the lips from masses of nodes (n,) [t].

        `intact` are those of the intact body.
        """
        self._masses = mass, intact
        medium, bears = np.flatnonzero(_forceless(gamma)), mass >= self.BEARS * intact
        grown = not np.array_equal(medium, self.medium)
        if grown:
            self.medium = medium
            living = np.ones(self.space.n_elements, bool)
            living[medium] = False
            alive = np.zeros(self.space.n_nodes, bool)
            alive[self.space.conn[living]] = True
            self.massless = ~alive[:, None] & self._free
            self._moved = np.flatnonzero(self.massless)
            self._law.tangents[medium], self._law.sure[medium] = facing(self.space, medium)
        if grown or not np.array_equal(bears, self._bears):
            self._bears, self._changed = bears, True
            self._tie()

    def _tie(self) -> None:
        """Find the nodes of the medium that follow, and what they follow."""
        space = self.space
        near = np.zeros(space.n_nodes, bool)
        near[space.conn[self.medium]] = True
        weak = near & ~self._bears
        if np.array_equal(weak, self._weak):
            return
        self._weak, self._followers = weak, []
        if self._weights is None:
            self._weights = Weights(space)
        self._weights.make(weak)
        for i in range(space.dim):
            nodes = np.flatnonzero(weak & self._free[:, i])
            same = next((one for one in self._followers if np.array_equal(one.weak, nodes)), None)
            if same is not None:
                same.components.append(i)
            elif nodes.size:
                self._followers.append(Followers(self._weights.matrix, nodes, i))

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
        return self._sum(self._pressed(placed)[2])

    def _sum(self, energy: np.ndarray) -> float:
        self._energies, self.energy = (self.medium, energy), float(energy.sum())
        return self.energy

    def add_force(self, placed: np.ndarray, out: np.ndarray) -> None:
        """Add the force at the displacement `placed`, in which nodes follow, to `out` (n, dim) [N; N/mm in 2D].

        Sets `energy`.
        """
        if not self.medium.size:
            self.energy = 0.0
            return
        found, force = np.empty((3, self.medium.size)), self._force
        push(self.space.X + placed, self._strips, self._law, self.medium, found, force)
        if self._sum(found[2]) == 0.0:
            return
        for one in self._followers:
            one.pass_on(force)
        out += force

    def renew(self, u: np.ndarray) -> float:
        """Energy at the displacement `u` (n, dim) after an :meth:`update`, which raises that of no element.

        One that would have more has joined, or has another normal, or a node that has begun to follow: its `rest` is
        lowered until it has what it had at the last evaluation. Contact thus takes energy from the body, and gives
        none. Nodes without mass are moved in `u`; see `place`.
        """
        if not self._changed:
            return self.energy
        self._changed, placed = False, self.place(u)
        d, J_bar, energy = self._pressed(placed)
        numbers, energies = self._energies
        had = np.zeros(self.space.n_elements)
        had[numbers] = energies
        more = energy > had[self.medium]
        if more.any():
            medium, J_bar, d = self.medium[more], J_bar[more], d[more]
            kept = depth(had[medium] / (self._law.modulus[medium] * self.space.V[medium]), self._law.n)
            self.rest[medium] *= (J_bar + kept) / (J_bar + d)
        return self.evaluate(placed)

    def book(self, ledger: Ledger, u: np.ndarray) -> None:
        """Let it :meth:`renew` at the displacement `u` after the density has fallen, and book what it loses."""
        before, ledger.contact = self.energy, self.renew(u)
        ledger.deletion += before - ledger.contact

    def _pressed(self, placed: np.ndarray) -> np.ndarray:
        """d, J_bar and energy of the elements of the medium, (3, medium)."""
        found = np.empty((3, self.medium.size))
        missing(self.space.X + placed, self._strips, self._law, self.medium, found)
        return found

    def tangent(self, u: np.ndarray) -> np.ndarray | None:
        """Matrix B (free unknowns, m) of the convex part B B^T of the medium's tangent at the displacement u (n, dim).

        A column for each element that is pressed, None if none is; the other part, of its pressure, is small where
        that is.
        """
        if not self.medium.size:
            return None
        placed = self.follow(u)
        d = self._pressed(placed)[0]
        pressed, d = self.medium[d > 0.0], d[d > 0.0]
        if not pressed.size:
            return None
        found = np.empty((pressed.size, self.space.conn.shape[1], self.space.dim))
        pulls(self.space.X + placed, self._strips, self._law, pressed, d, found)
        B = np.zeros((pressed.size, *self.space.X.shape))
        for nodes, pull, column in zip(self.space.conn[pressed], found, B):
            column[nodes] = pull
            for one in self._followers:
                one.pass_on(column)
        return B.reshape(pressed.size, -1).T[self._free.ravel()]

    def stiffest(self, u: np.ndarray) -> float:
        """Bound of the highest frequency squared that the medium adds [1/s^2] at the displacement `u` (n, dim).

        Twice the greatest of an element by itself, since two of them share a lip. The inverse mass of a node that
        follows is interpolated: H diag(1/m) H^T is at most that, where H >= 0.
        """
        if not self.medium.size:
            return 0.0
        placed = self.follow(u)
        d, _, energy = self._pressed(placed)
        if not energy.any():
            return 0.0
        mass, intact = self._masses
        inverse = np.repeat(1.0 / np.maximum(mass, self.BEARS * intact)[:, None], self.space.dim, axis=1)
        return 2.0 * float(stiffest(self.space.X + placed, self._strips, self._law, self.medium, d,
                                    self.follow(inverse).max(axis=1)))


@njit(cache=True)
def _forceless(gamma):  # type: ignore[no-untyped-def]
    """Mask of the elements without a Gauss point that exerts a force."""
    found = np.ones(gamma.shape[0], np.bool_)
    for e in range(gamma.shape[0]):
        for q in range(gamma.shape[1]):
            if gamma[e, q] > 0.0:
                found[e] = False
    return found
