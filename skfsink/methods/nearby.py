"""Equilibrium near what has failed, before that of the whole body: nonlinear elimination (Lanzkron, Rose, Wilkes 1996).

A pass of a quasi-static crack fails a few elements. Around them the body jumps, and factors of the tangent before serve
badly there; everywhere else they serve well. So a small body around these elements, held where it is cut from the
rest, is brought to equilibrium by itself, with tangents of its own that cost little, in turn with steps of the whole
body with the factors that it has.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import ConvergenceError
from ..fem.selection import Selection, selected_mesh
from ..fem.space import Space
from ..fields.momentum import Momentum
from ..material.regions import among

if TYPE_CHECKING:
    from .newton import Newton

__all__ = ["Nearby"]

CHANGED = 0.05   # change of gamma at a Gauss point by which its element counts as changed
LAYERS = 3       # of elements around those that have changed
SHARE = 0.25     # of the nodes of a body, above which what has changed is not a small part of it
CLOSER = 0.1     # residual force that is left nearby, of that of the whole body
STEPS = 100      # Newton steps after which no equilibrium is sought nearby any more


class Nearby:
    """The body around some elements, held where it is cut from the rest, at the density that the rest has.

    Memory: that of `newton`, which finds its equilibria.

    Parameters
    ----------
    whole: what finds equilibria of the whole body, and how.
    inside: mask of the nodes of the body that may move, (n,).

    Attributes
    ----------
    nodes: numbers in the whole body of the nodes of this one, (m,).   newton: what finds its equilibria.
    """

    def __init__(self, whole: Newton, inside: np.ndarray) -> None:
        momentum, space = whole.momentum, whole.space
        elements = np.flatnonzero(inside[space.conn].any(axis=1))
        self.nodes = np.unique(space.conn[elements])
        selection = Selection(elements, self.nodes, space.n_elements, space.n_nodes)
        part = Momentum(Space(selected_mesh(space, selection)), momentum.material, momentum.element,
                        momentum.force_floor, regions=among(momentum.regions, elements), kernels=momentum.kernels)
        part.backend.set_gamma(momentum.gamma[elements])
        part.evaluate_by(part.backend)
        free = whole.free.reshape(-1, space.dim)[self.nodes] & inside[self.nodes, None]
        self.newton = whole.alike(part, free.ravel(), STEPS)

    @classmethod
    def of(cls, whole: Newton, gamma: np.ndarray) -> Nearby | None:
        """That around the elements whose density at the Gauss points was another one, `gamma` (ne, nq).

        None if there are none, or so many that what is around them is no small part of the body.
        """
        space = whole.space
        changed = (np.abs(whole.momentum.gamma - gamma) > CHANGED).any(axis=1)
        if not changed.any():
            return None
        inside = np.zeros(space.n_nodes, bool)
        for _ in range(LAYERS + 1):
            inside[space.conn[changed]] = True
            changed = inside[space.conn].any(axis=1)
        return cls(whole, inside) if inside.mean() <= SHARE else None

    def relax(self, u: np.ndarray, force: float) -> np.ndarray | None:
        """Move the nodes of this body in `u` (n, dim) to its equilibrium, up to a residual force of `force` [N].

        Returns the way of all nodes, (n, dim); None if no equilibrium was found, and `u` is what it was.
        """
        newton, way = self.newton, np.zeros_like(u)
        before = u[self.nodes]
        try:
            after, _ = newton.equilibrium(before, force / newton.scale(newton.momentum.force(before)))
        except ConvergenceError:
            return None
        u[self.nodes] = after
        way[self.nodes] = after - before
        return way
