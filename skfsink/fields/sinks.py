"""Quadratures of the sink term  int gamma dgamma/(H + eps)  by name: adding one is its class, and a line in `SINKS`.

"lumped" (the default) sums rows: with a gradient term without positive off-diagonals the matrix is an M-matrix, and
0 < gamma <= 1. "consistent" is the paper's form (Eq. 21, 24), whose sink varies by 1e15 inside an element: gamma
dips below zero next to a crack and conjugate gradients stall, so it is factorised. "nearest" gives each Gauss point to
the node next to it.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ..fem.backend import DensityBackend
from ..fem.pattern import Pattern
from ..fem.space import Space

__all__ = ["SINKS", "Consistent", "Lumped", "Nearest", "Sink"]


class Sink:
    """A quadrature of the sink term. One that stays on the diagonal derives from it and gives `sums`.

    Attributes
    ----------
    monotone: whether it stays on the diagonal, so that 0 < gamma <= 1 with the gradient "monotone".
    """

    monotone: ClassVar[bool] = True

    def sums(self, space: Space, backend: DensityBackend, values: np.ndarray) -> np.ndarray:
        """Nodal sums (n,) of Gauss point values (ne, nq); of sink and load alike, so that H = 1 gives gamma = 1."""
        raise NotImplementedError

    def assemble(self, pattern: Pattern, backend: DensityBackend, sink: np.ndarray) -> np.ndarray:
        """Data of the matrix of a sink that is not monotone, for the coefficients `sink` (ne, nq)."""
        raise NotImplementedError


class Lumped(Sink):
    """Row sums of the consistent matrix."""

    def sums(self, space: Space, backend: DensityBackend, values: np.ndarray) -> np.ndarray:
        """int values N_a."""
        return backend.lump(values)


class Nearest(Sink):
    """Each Gauss point belongs to the node next to it."""

    def sums(self, space: Space, backend: DensityBackend, values: np.ndarray) -> np.ndarray:
        """Sums of w values over the Gauss points of a node."""
        return space.exchange.whole(np.bincount(space.conn.ravel(), (space.w * values).ravel(), space.n_nodes))


class Consistent(Lumped):
    """The paper's: the mass matrix with the weight 1/(H + eps)."""

    monotone = False

    def assemble(self, pattern: Pattern, backend: DensityBackend, sink: np.ndarray) -> np.ndarray:
        """int sink N_a N_b."""
        return backend.sink(pattern, sink)


SINKS: dict[str, Sink] = {"lumped": Lumped(), "consistent": Consistent(), "nearest": Nearest()}
