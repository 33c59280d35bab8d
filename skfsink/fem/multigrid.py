"""Conjugate gradients with algebraic multigrid for tangents: what factors of a million unknowns are too large for.

The hierarchy is smoothed aggregation by pyamg, or GAMG by PETSc (:mod:`.petsc_matrix`). Both are given the rigid
motions of the body, which its energy hardly resists; the number of iterations then hardly grows with the size.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pyamg
from scipy.sparse import bsr_array, csr_array, diags_array

from ..errors import ConvergenceError
from .amg import same_random_vectors
from .direct import conjugate, symmetric
from .pattern import Pattern
from .space import Space

__all__ = ["NOT_POSITIVE", "Iterated", "Multigrid", "rigid_motions"]

NOT_POSITIVE = "the tangent of the body has an entry on its diagonal that is not above 0: take linear = 'direct'"


def rigid_motions(X: np.ndarray, centre: np.ndarray | None = None, size: float = 0.0) -> np.ndarray:
    """Translations and infinitesimal rotations of nodes X (n, dim), as columns (n*dim, 3 or 6).

    About a `centre` (dim,) and over a `size` that are those of a body of which X is a part; else of X.
    """
    n, dim = X.shape
    about, size = X.mean(axis=0) if centre is None else centre, size or float(np.ptp(X))
    motions = [np.tile(row, (n, 1)) for row in np.eye(dim)]
    for i in range(dim):
        for j in range(i):
            turn = np.zeros_like(X)
            turn[:, i], turn[:, j] = X[:, j] - about[j], about[i] - X[:, i]
            motions.append(turn / size)
    return np.column_stack([motion.ravel() for motion in motions])


class Iterated:
    """What solves by iteration, or in more than one place: solutions for several right-hand sides.

    Memory: the matrix last given, and what was made of it.
    """

    exact = False
    MOST = (500, 500)   # iterations of a solve, in two and in three dimensions
    WORTH = (40, 40)    # iterations with a hierarchy of another matrix, after which a new one pays
    TOLERANCE = 1e-9    # relative residual of a solve that is not told another

    def __init__(self, dim: int) -> None:
        self._dim, self.count, self.definite = dim, 0, True
        self._data: np.ndarray | None = None

    def conjugate(self, data: np.ndarray, b: np.ndarray, tolerance: float, most: int) -> tuple[np.ndarray, int, bool]:
        """As :meth:`.Factorization.conjugate`."""
        raise NotImplementedError

    def apply(self, b: np.ndarray) -> np.ndarray:
        """Solution with the matrix last given, for the right-hand side b, or columns of b.

        Raises
        ------
        ConvergenceError
            It did not converge.
        """
        if not b.size:
            return b
        if b.ndim == 2:
            return np.column_stack([self.apply(column) for column in b.T])
        return self._solution(b) if b.any() else np.zeros_like(b)

    def _solution(self, b: np.ndarray) -> np.ndarray:
        assert self._data is not None
        x, iterations, met = self.conjugate(self._data, b, self.TOLERANCE, self.MOST[self._dim - 2])
        if not met:
            raise ConvergenceError(f"no solution by multigrid in {iterations} iterations: take linear = 'direct'")
        return x

    def solve_sum(self, B: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Solution of (A + B B^T) x = b, B with few columns, by Woodbury's formula."""
        x, Z = self.apply(b), self.apply(B)
        result: np.ndarray = x - Z @ np.linalg.solve(np.eye(B.shape[1]) + B.T @ Z, B.T @ x)
        return result


class Multigrid(Iterated):
    """What :class:`.Factorization` is, by iteration: "factors" are a hierarchy, and a solve is conjugate gradients.

    Memory: the hierarchy of the matrix last given to `factorize`, which `apply`, `solve_sum` and `conjugate` use and
    `release` drops; `factorize` itself depends on no earlier call.

    Parameters
    ----------
    space: the mesh.
    free: mask of the unknowns, (n*dim,).
    pattern: of these, the upper triangle.

    Attributes
    ----------
    count: hierarchies made.   definite: whether no direction was found in which the last matrix curves down.
    """

    def __init__(self, space: Space, free: np.ndarray, pattern: Pattern, threads: int = 1) -> None:
        super().__init__(space.dim)
        self.pattern, self.threads = pattern, threads
        dim = space.dim
        used = np.repeat(free.reshape(-1, dim).any(axis=1), dim)  # nodes come with all of their components
        number = np.cumsum(used) - 1
        self._place, self._size, self._block = number[free], int(used.sum()), dim
        self._motions = rigid_motions(space.X)[used]
        held = np.ones(self._size, bool)
        held[self._place] = False
        self._motions[held] = 0.0
        self._held = held
        self._cycle: Callable[[np.ndarray], np.ndarray] | None = None
        self._scale = np.ones(self._size)

    def factorize(self, data: np.ndarray, indefinite: bool = True) -> bool:
        """Make the hierarchy of the matrix with these values on the pattern; True, as nobody has seen it curve down."""
        self.count += 1
        self.definite, self._data = True, data
        if not self.pattern.size:
            return True
        small = self.pattern.symmetric(data).tocoo()
        whole = csr_array((small.data, (self._place[small.row], self._place[small.col])), shape=(self._size,) * 2)
        whole = csr_array(whole + diags_array(self._held.astype(float)))
        diagonal = whole.diagonal()
        if not (diagonal > 0.0).all():
            raise ConvergenceError(NOT_POSITIVE)
        self._scale = 1.0 / np.sqrt(diagonal)
        scaled = csr_array(diags_array(self._scale) @ whole @ diags_array(self._scale))
        self._cycle = self._hierarchy(scaled, self._motions / self._scale[:, None])
        return True

    def _hierarchy(self, A: csr_array, motions: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """A cycle for the matrix, whose blocks are nodes, with the motions (size, 3 or 6) that it hardly resists."""
        A32 = csr_array((A.data, A.indices.astype(np.int32), A.indptr.astype(np.int32)), A.shape)
        with same_random_vectors():
            solver = pyamg.smoothed_aggregation_solver(bsr_array(A32, blocksize=(self._block,) * 2), B=motions,
                                                       improve_candidates=None, max_coarse=300)
        cycle: Callable[[np.ndarray], np.ndarray] = solver.aspreconditioner().matvec
        return cycle

    def _precondition(self, r: np.ndarray) -> np.ndarray:
        assert self._cycle is not None
        wide = np.zeros(self._size)
        wide[self._place] = r
        wide = self._scale * self._cycle(self._scale * wide)
        z: np.ndarray = wide[self._place]
        return z

    def conjugate(self, data: np.ndarray, b: np.ndarray, tolerance: float, most: int) -> tuple[np.ndarray, int, bool]:
        """Solution of  A x = b  with A = `data` on the pattern and the hierarchy kept.

        It ends as :meth:`.Factorization.conjugate` does.
        """
        x, iterations, met = conjugate(symmetric(self.pattern.matrix(data)), self._precondition, b, tolerance, most)
        self.definite = self.definite and (met or iterations == most)
        return x, iterations, met

    def release(self) -> None:
        """Free the memory of the hierarchy."""
        self._cycle = self._data = None
