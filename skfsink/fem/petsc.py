"""Solvers of the displacements of statics by PETSc: GAMG before conjugate gradients, or MUMPS's factors.

What there is of PETSc in them is in :mod:`.petsc_matrix`.
"""

from __future__ import annotations

import numpy as np

from .direct import Factorization
from .multigrid import Iterated
from .pattern import Pattern
from .petsc_matrix import MUMPS, Matrix, check
from .space import Space

__all__ = ["OnOneRank", "Petsc"]


class Petsc(Iterated):
    """What :class:`.Factorization` is, by PETSc: the matrix is elsewhere, see :class:`.OnOneRank`.

    Memory: the matrix last given, and its hierarchy or factors, which `apply`, `solve_sum` and `conjugate` use and
    `release` drops; `factorize` itself depends on no earlier call.

    Parameters
    ----------
    name: one of :data:`PETSC`.
    dim: dimension of the body.
    size: number of unknowns.

    Attributes
    ----------
    count: hierarchies or factorisations made.
    definite: whether no direction was found in which the last matrix curves down.

    Raises
    ------
    ParameterError
        petsc4py is not there.
    """

    def __init__(self, name: str, dim: int, size: int) -> None:
        super().__init__(dim)
        check(name)
        self._name, self._size, self.exact = name, size, name == MUMPS
        if self.exact:
            self.MOST, self.WORTH = Factorization.MOST, Factorization.WORTH

    def factorize(self, data: np.ndarray, indefinite: bool = True) -> bool:
        """Make the hierarchy or the factors of the matrix with these values on the pattern.

        False if factors are of a matrix that is not positive definite; nobody has seen a hierarchy curve down.
        """
        self.count += 1
        self.definite, self._data = True, data
        if self._size:
            self._set(data)
            self.definite = self._prepare()
        return self.definite

    def conjugate(self, data: np.ndarray, b: np.ndarray, tolerance: float, most: int) -> tuple[np.ndarray, int, bool]:
        """Solution of  A x = b  with A = `data` on the pattern and the hierarchy or the factors kept.

        It ends as :meth:`.Factorization.conjugate` does.
        """
        if data is not self._data:
            self._set(data)
            self._data = data
        x, iterations, met = self._conjugate(b, tolerance, most)
        self.definite = self.definite and (met or iterations == most)
        return x, iterations, met

    def _solution(self, b: np.ndarray) -> np.ndarray:
        return self._substitute(b) if self.exact else super()._solution(b)

    def release(self) -> None:
        """Free the memory of the matrix, and of what was made of it."""
        self._data = None

    # --- of the matrix, see :class:`.Matrix` ---
    def _set(self, data: np.ndarray) -> None:
        raise NotImplementedError

    def _prepare(self) -> bool:
        raise NotImplementedError

    def _conjugate(self, b: np.ndarray, tolerance: float, most: int) -> tuple[np.ndarray, int, bool]:
        raise NotImplementedError

    def _substitute(self, b: np.ndarray) -> np.ndarray:
        raise NotImplementedError


class OnOneRank(Petsc):
    """The same with the matrix of a body in one piece.

    Memory: see :class:`.Petsc`.

    Parameters
    ----------
    name: one of :data:`PETSC`.
    space: the mesh.
    free: mask of the unknowns, (n*dim,).
    pattern: of these, the upper triangle.
    """

    def __init__(self, name: str, space: Space, free: np.ndarray, pattern: Pattern, threads: int = 1) -> None:
        super().__init__(name, space.dim, pattern.size)
        self.pattern, self.threads = pattern, threads
        self._space, self._free = space, free
        self._made: Matrix | None = None

    @property
    def _matrix(self) -> Matrix:
        self._made = self._made or Matrix(self._name, self._space, self._free, self.pattern)
        return self._made

    def _set(self, data: np.ndarray) -> None:
        self._matrix.set(data)

    def _prepare(self) -> bool:
        return self._matrix.prepare()

    def _conjugate(self, b: np.ndarray, tolerance: float, most: int) -> tuple[np.ndarray, int, bool]:
        return self._matrix.conjugate(b, tolerance, most)

    def _substitute(self, b: np.ndarray) -> np.ndarray:
        return self._matrix.substitute(b)

    def release(self) -> None:
        """Free the memory of the matrix, and of what was made of it."""
        super().release()
        if self._made is not None:
            self._made.release()
        self._made = None
