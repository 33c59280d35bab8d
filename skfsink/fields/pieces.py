"""Motion of the pieces into which cracks have cut a body: mass, centre, momentum, energy and spin of each."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..fem.space import Space
from .fragments import SPENT, pieces_at
from .momentum import Momentum
from .state import State

__all__ = ["Pieces", "pieces_of"]

SOME = 8192  # elements whose corners are summed at a time


class Pieces(NamedTuple):
    """The pieces that bear force, the heaviest first; in the plane all is per mm of thickness.

    Those of a body of revolution are rings: their centre is on the axis, and they have momentum along it alone.

    Masses are gamma-weighted and lumped at the nodes, without any that `raised_mass` adds, each element's in its own
    piece: a sum over the pieces is that of the body, but for elements with gamma below 1e-2 at all their nodes, which
    are in no piece. Vectors of a plane body have 2 components, but angular momentum and spin 1, about z.

    Attributes
    ----------
    elements: their number, (p,).   volume: undeformed [mm^volume_dim], (p,).
    mass: [t; t/mm in 2D], (p,).    centre: of mass, in the deformed body [mm], (p, dim).
    velocity: of the centre [mm/s], (p, dim).   momentum: [N s; N s/mm in 2D], (p, dim).
    kinetic: kinetic energy [N mm; N mm/mm in 2D], (p,).   translation, rotation: the parts of it that a rigid piece of
        that momentum and angular momentum would have; the rest is deformation.
    angular_momentum: about the centre [N mm s; N mm s/mm in 2D], (p, 3 or 1).
    spin: that angular momentum over the inertia of the piece as it lies [1/s], (p, 3 or 1).
    extent: volume, or of rings their section, undeformed [mm^dim], (p,).
    """

    elements: np.ndarray
    volume: np.ndarray
    mass: np.ndarray
    centre: np.ndarray
    velocity: np.ndarray
    momentum: np.ndarray
    kinetic: np.ndarray
    translation: np.ndarray
    rotation: np.ndarray
    angular_momentum: np.ndarray
    spin: np.ndarray
    extent: np.ndarray


def pieces_of(momentum: Momentum, state: State) -> Pieces:
    """The pieces of a body at a state, of whose density the momentum balance knows."""
    space = momentum.space
    alive, piece = pieces_at(space, state.gamma, state.deleted, SPENT)
    number = int(piece.max(initial=-1)) + 1
    points = space.w[alive] * momentum.gamma[alive] * (
        momentum.rho0[alive] if isinstance(momentum.rho0, np.ndarray) else momentum.rho0)
    mass = points @ space.N                                       # (alive, na)
    heavy = np.bincount(piece, mass.sum(axis=1), number)
    order = np.argsort(-heavy, kind="stable")
    piece = np.argsort(order)[piece] if number else piece
    return _motion(space, alive, piece, mass, heavy[order], state)


def _motion(space: Space, alive: np.ndarray, piece: np.ndarray, mass: np.ndarray, total: np.ndarray,
            state: State) -> Pieces:
    """Sums over the corners of elements; `mass` (alive, na) of them, `total` (p,) of the pieces."""
    number, dim = len(total), space.dim
    X, way = space.X + state.u, np.ones(dim) if not space.axisymmetric else np.array([0.0, 1.0])

    def sums(of: Callable[[slice], np.ndarray]) -> np.ndarray:
        """Of values (m, na, ...) at the corners of some elements over the pieces, (p, ...)."""
        parts = [of(slice(at, at + SOME)).sum(axis=1) for at in range(0, max(len(alive), 1), SOME)]
        flat = np.concatenate(parts)
        shape, flat = flat.shape[1:], flat.reshape(len(flat), math.prod(flat.shape[1:]))
        found = np.stack([np.bincount(piece, column, number) for column in flat.T], axis=1)
        return found.astype(float).reshape(number, *shape)

    def weight(some: slice) -> np.ndarray:
        """Mass, of a piece without mass its volume."""
        return np.where((total > 0.0)[piece[some], None], mass[some], space.w[alive[some]] @ space.N)

    def x(some: slice) -> np.ndarray:
        return X[space.conn[alive[some]]] * way

    def v(some: slice) -> np.ndarray:
        return state.v[space.conn[alive[some]]] * way

    kinetic = 0.5 * sums(lambda e: mass[e] * (state.v[space.conn[alive[e]]]**2).sum(axis=2))
    centre = sums(lambda e: weight(e)[..., None] * x(e)) / sums(weight)[:, None]
    momentum = sums(lambda e: mass[e][..., None] * v(e))
    velocity = momentum / np.where(total > 0.0, total, 1.0)[:, None]

    def r(some: slice) -> np.ndarray:
        return x(some) - centre[piece[some]][:, None]

    def angular_momentum(some: slice) -> np.ndarray:
        w = v(some) - velocity[piece[some]][:, None]
        if dim == 3:
            return mass[some][..., None] * np.cross(r(some), w)
        return mass[some] * (r(some)[..., 0] * w[..., 1] - r(some)[..., 1] * w[..., 0])

    def inertia_of(some: slice) -> np.ndarray:
        square = (r(some)**2).sum(axis=2)
        if dim == 2:
            return mass[some] * square
        outer = square[..., None, None] * np.eye(3) - r(some)[..., :, None] * r(some)[..., None, :]
        return mass[some][..., None, None] * outer

    angular, inertia = sums(angular_momentum), sums(inertia_of)
    if dim == 2:
        angular, inertia = angular[:, None], inertia[:, None]
        spin = np.divide(angular, inertia, out=np.zeros_like(angular), where=inertia > 0.0)
    else:
        spin = np.einsum("pij,pj->pi", np.linalg.pinv(inertia, hermitian=True), angular)
    return Pieces(np.bincount(piece, minlength=number), sums(lambda e: space.w[alive[e]]), total, centre,
                  velocity, momentum, kinetic,
                  0.5 * (momentum * velocity).sum(axis=1), 0.5 * (angular * spin).sum(axis=1), angular, spin,
                  sums(lambda e: space.dX[alive[e]]))
