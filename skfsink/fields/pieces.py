"""Motion of the pieces into which cracks have cut a body: mass, centre, momentum, energy and spin of each."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..fem.space import Space
from .fragments import SPENT, pieces_at
from .momentum import Momentum
from .state import State

__all__ = ["Pieces", "pieces_of"]


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
    nodes, number, dim = space.conn[alive], len(total), space.dim

    def sums(values: np.ndarray) -> np.ndarray:
        """Of values (alive, na, ...) over the pieces, (p, ...)."""
        flat = values.sum(axis=1).reshape(len(alive), math.prod(values.shape[2:]))
        found = np.stack([np.bincount(piece, column, number) for column in flat.T], axis=1)
        return found.astype(float).reshape(number, *values.shape[2:])

    weight = np.where((total > 0.0)[piece, None], mass, (space.w[alive] @ space.N))  # of one without mass its volume
    x, v = (space.X + state.u)[nodes], state.v[nodes]
    kinetic = 0.5 * sums(mass * (v**2).sum(axis=2))
    if space.axisymmetric:
        x, v = x * [0.0, 1.0], v * [0.0, 1.0]
    centre = sums(weight[..., None] * x) / sums(weight)[:, None]
    momentum = sums(mass[..., None] * v)
    velocity = momentum / np.where(total > 0.0, total, 1.0)[:, None]
    r, w = x - centre[piece][:, None], v - velocity[piece][:, None]
    if dim == 2:
        angular = sums(mass * (r[..., 0] * w[..., 1] - r[..., 1] * w[..., 0]))[:, None]
        inertia = sums(mass * (r**2).sum(axis=2))[:, None]
        spin = np.divide(angular, inertia, out=np.zeros_like(angular), where=inertia > 0.0)
    else:
        angular = sums(mass[..., None] * np.cross(r, w))
        outer = (r**2).sum(axis=2)[..., None, None] * np.eye(3) - r[..., :, None] * r[..., None, :]
        inertia = sums(mass[..., None, None] * outer)
        spin = np.einsum("pij,pj->pi", np.linalg.pinv(inertia, hermitian=True), angular)
    return Pieces(np.bincount(piece, minlength=number), sums(space.w[alive]), total, centre,
                  velocity, momentum, kinetic,
                  0.5 * (momentum * velocity).sum(axis=1), 0.5 * (angular * spin).sum(axis=1), angular, spin,
                  sums(space.dX[alive]))
