"""The tangent of a part of a body, which a rank assembles and solves with as the first one asks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...fem.pattern import Pattern
from ...fem.petsc_matrix import Matrix
from .part import PartOfBody

if TYPE_CHECKING:
    from mpi4py import MPI

__all__ = ["TangentOfPart"]


class TangentOfPart:
    """One rank with the tangent of its part, for statics that the first rank leads.

    Memory: the part and its `matrix`, from `take` to `release`, as `assemble` gave it its values; see :class:`.Matrix`.
    """

    def __init__(self, comm: MPI.Intracomm) -> None:
        self._comm = comm
        self._matrix: Matrix | None = None

    def do(self, task: str, *arguments: Any) -> Any:
        """One of the methods below, by name."""
        return getattr(self, task)(*arguments)

    def take(self, part: PartOfBody, solver: str) -> None:
        """Take up a part of the body, and the solver of that name."""
        if self._matrix is not None:  # that of an earlier analysis
            self.release()
        self._momentum = part.balance(self._comm)
        space, free = self._momentum.space, part.loading.free
        self._pattern = Pattern(space, space.dim, free, upper=True)
        self._matrix = Matrix(solver, space, free, self._pattern, self._comm)

    def assemble(self, u: np.ndarray, gamma: np.ndarray, convex: bool) -> None:
        """The tangent at the displacement `u` of the part (n, dim) and its density at Gauss points (ne, nq)."""
        self._momentum.gamma = gamma
        self.matrix.set(self._momentum.tangent(self._pattern, u, convex))

    def prepare(self) -> bool:
        """See :meth:`.Matrix.prepare`."""
        return self.matrix.prepare()

    def conjugate(self, b: np.ndarray, tolerance: float, most: int) -> tuple[np.ndarray, int, bool]:
        """See :meth:`.Matrix.conjugate`."""
        return self.matrix.conjugate(b, tolerance, most)

    def substitute(self, b: np.ndarray) -> np.ndarray:
        """See :meth:`.Matrix.substitute`."""
        return self.matrix.substitute(b)

    def release(self) -> None:
        """Free the memory of part and matrix."""
        self.matrix.release()
        self._matrix = None
        del self._momentum, self._pattern

    @property
    def matrix(self) -> Matrix:
        """That of the part."""
        assert self._matrix is not None
        return self._matrix
