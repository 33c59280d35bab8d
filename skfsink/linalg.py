"""Linear solvers on fixed patterns: sparse factorisation, and conjugate gradients preconditioned by pyamg.

Neither returns a solution whose true residual was not measured.
"""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np
import pyamg
import scipy.sparse.linalg as sla
from numba import njit
from scipy.sparse import csc_array, csr_array

from .errors import ConvergenceError
from .space import Pattern

os.environ.setdefault("MKL_CBWR", "AUTO,STRICT")  # the same bits from one run to the next, whatever the alignment

__all__ = ["AmgCG", "Factorization", "symmetric_product"]

try:
    import pypardiso
    from pypardiso.pardiso_wrapper import PyPardisoError
except ImportError:  # not x86-64: SuperLU does it, several times slower
    pypardiso = None


class Factorization:
    """Direct solver for symmetric matrices on one pattern (upper triangle); the analysis is done once.

    Parameters
    ----------
    pattern: upper-triangular pattern.
    backend: "pardiso" (MKL), "superlu" (SciPy), or None for the first that is installed.
    threads: threads of the factorisation; results are the same to the last bit only with one.

    PARDISO is told that the matrix is positive definite; where it is not, it is factorised again as indefinite.
    """

    def __init__(self, pattern: Pattern, backend: str | None = None, threads: int = 1) -> None:
        self.pattern = pattern
        self.backend = backend or ("pardiso" if pypardiso is not None else "superlu")
        self.threads = threads
        self.count = 0            #: numerical factorisations made
        self.definite = True      #: whether the last matrix was found positive definite (PARDISO only)
        self._handles: dict[int, object] = {}
        self._lu: sla.SuperLU | None = None
        self._matrix: csr_array | None = None
        self._whole: csr_array | None = None

    def factorize(self, data: np.ndarray) -> None:
        """Factorise the matrix with these values on the pattern."""
        self.count += 1
        self._matrix = self.pattern.matrix(data)
        self._whole = None
        if self.backend == "superlu":
            self._whole = self.pattern.symmetric(data)
            self._lu = sla.splu(csc_array(self._whole), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                                options={"SymmetricMode": True})
            return
        try:
            self._pardiso(2, 22)
            self.definite = True
        except PyPardisoError:
            self._pardiso(-2, 22)
            self.definite = False

    def solve(self, b: np.ndarray, tolerance: float = 1e-9) -> np.ndarray:
        """Solution of A x = b; refined once if its relative residual is above `tolerance`.

        Raises
        ------
        ConvergenceError
            The residual stays above 1000 times the tolerance: the matrix is singular to rounding.
        """
        x = self._apply(b)
        scale = float(np.linalg.norm(b))
        if scale == 0.0:
            return x
        for attempt in range(3):
            r = b - self._times(x)
            error = float(np.linalg.norm(r)) / scale
            if error <= tolerance:
                return x
            if attempt < 2:
                x = x + self._apply(r)
        if not error <= 1000 * tolerance:
            raise ConvergenceError(f"the factorised system is singular to rounding: relative residual {error:.1e}, "
                                   f"allowed {1000 * tolerance:.0e}")
        return x

    def release(self) -> None:
        """Free the memory of the factors."""
        for handle in self._handles.values():
            handle.free_memory(everything=True)  # type: ignore[attr-defined]
        self._handles.clear()
        self._lu = None

    def _times(self, x: np.ndarray) -> np.ndarray:
        assert self._matrix is not None
        A = self._matrix
        if not self.pattern.upper:
            return A @ x
        return symmetric_product(*_unsigned(A), x)

    def _apply(self, b: np.ndarray) -> np.ndarray:
        if self.backend == "superlu":
            assert self._lu is not None
            return self._lu.solve(b)
        return self._pardiso(2 if self.definite else -2, 33, b)

    def _pardiso(self, kind: int, phase: int, b: np.ndarray | None = None) -> np.ndarray:
        handle = self._handles.get(kind)
        right = np.zeros((self.pattern.size, 1)) if b is None else np.ascontiguousarray(b[:, None])
        if handle is None:
            handle = self._handles[kind] = pypardiso.PyPardisoSolver(mtype=kind)
            handle.libmkl.MKL_Set_Num_Threads(self.threads)
            handle.set_phase(11)
            handle._call_pardiso(self._matrix, right)
        handle.set_phase(phase)  # type: ignore[attr-defined]
        return handle._call_pardiso(self._matrix, right)[:, 0]  # type: ignore[attr-defined]


class AmgCG:
    """Conjugate gradients for  (L + diag(s)) x = b  with L fixed and s >= its intact value s0, preconditioned by pyamg.

    The smoothed-aggregation hierarchy is built once for the intact matrix L + diag(s0). A solve smooths with the
    *current* matrix and corrects on the hierarchy's coarse levels, leaving out the unknowns whose diagonal has grown
    past `DEAD` times the intact one: their value is settled by the smoother alone, and the intact hierarchy stays
    valid for the rest. It therefore never has to be rebuilt while damage spreads, nor does its cost depend on the
    path that led to the current state.
    """

    DEAD = 3.0           # of the intact diagonal
    OMEGA = 0.8          # Jacobi weight of the smoother
    DIRECT_COARSE = 6000  # unknowns of the second level that are factorised rather than coarsened on

    def __init__(self, intact: csr_array, tolerance: float = 1e-8, max_iterations: int = 100) -> None:
        self.tolerance = tolerance
        self.max_iterations = max_iterations
        self.iterations = 0          #: of the last solve
        self.residual = 0.0          #: true relative residual of the last solve
        self._diagonal0 = intact.diagonal()
        state = np.random.get_state()
        np.random.seed(0)  # pyamg estimates spectral radii from random vectors
        try:
            levels = pyamg.smoothed_aggregation_solver(
                csr_array(intact), strength=("symmetric", {"theta": 0.0}), improve_candidates=None, max_coarse=200)
        finally:
            np.random.set_state(state)
        self._P: csr_array | None = None
        if len(levels.levels) > 1:
            self._P = csr_array(levels.levels[0].P)
            self._R = csr_array(self._P.T)
            coarse = csr_array(levels.levels[1].A)
            self._coarse: Callable[[np.ndarray], np.ndarray]
            if coarse.shape[0] <= self.DIRECT_COARSE:
                self._coarse = sla.splu(csc_array(coarse), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                                        options={"SymmetricMode": True}).solve
            else:
                np.random.seed(0)
                try:
                    cycle = pyamg.smoothed_aggregation_solver(coarse, improve_candidates=None).aspreconditioner()
                finally:
                    np.random.set_state(state)
                self._coarse = cycle.matvec

    def solve(self, A: csr_array, D: np.ndarray, b: np.ndarray, x: np.ndarray,
              reduction: float = 0.0) -> np.ndarray | None:
        """Solution of A x = b from the guess `x`; None if it did not converge in `max_iterations`.

        `D` is the diagonal of A. With `reduction` the solve may stop when the residual is that fraction of the one of
        the guess, or 1e-6, whichever is less: what is left then is that fraction of what the solve had to change.
        """
        smoother = self.OMEGA / D
        live = (self.DEAD * self._diagonal0 > D).astype(float)
        indptr, indices, data = _unsigned(A)
        size = float(np.linalg.norm(b))
        r = np.empty_like(b)
        x = x.copy()
        # one Jacobi sweep puts the unknowns with a huge diagonal where they belong
        _residual(indptr, indices, data, x, b, r)
        x += r / D
        target, total = 0.0, 0
        for attempt in range(3):
            _residual(indptr, indices, data, x, b, r)
            self.residual = float(np.linalg.norm(r)) / size
            if attempt == 0:
                target = max(self.tolerance, min(reduction * self.residual, 1e-6))
            if self.residual <= target or attempt == 2:
                break
            if self._iterate(A, r, x, smoother, live, target * size) is None:
                return None
            total += self.iterations
        self.iterations = total
        return x if self.residual <= 2 * target else None

    def _iterate(self, A: csr_array, r: np.ndarray, x: np.ndarray, smoother: np.ndarray, live: np.ndarray,
                 target: float) -> bool | None:
        indptr, indices, data = _unsigned(A)
        z, t, q = np.empty_like(r), np.empty_like(r), np.empty_like(r)
        p = np.zeros_like(r)
        rz_old, self.iterations = 1.0, 0
        while self.iterations < self.max_iterations:
            np.multiply(smoother, r, out=z)
            if self._P is not None:
                _masked_residual(indptr, indices, data, z, r, live, t)
                z += live * (self._P @ self._coarse(self._R @ t))
            rz = _smooth(indptr, indices, data, z, r, smoother, t)  # t = smoothed z
            p *= rz / rz_old
            p += t
            rz_old = rz
            pq = _product(indptr, indices, data, p, q)
            if not (np.isfinite(pq) and pq > 0.0):
                return None
            self.iterations += 1
            if _advance(rz / pq, p, q, x, r) <= target:
                return True
        return None


@njit(cache=True)
def symmetric_product(indptr, indices, data, x):  # type: ignore[no-untyped-def]
    y = np.zeros(x.size)
    for i in range(x.size):
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            y[i] += data[k] * x[j]
            if j != i:
                y[j] += data[k] * x[i]
    return y


def _unsigned(A: csr_array) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """CSR arrays with unsigned indices, which spares the compiled loops a test for negative ones: 2.7 times as fast."""
    return A.indptr.view(np.uint32), A.indices.view(np.uint32), A.data


@njit(cache=True)
def _row(indptr, indices, data, x, i):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(indptr[i], indptr[i + 1]):
        total += data[k] * x[indices[k]]
    return total


@njit(cache=True)
def _residual(indptr, indices, data, x, b, r):  # type: ignore[no-untyped-def]
    for i in range(x.size):
        r[i] = b[i] - _row(indptr, indices, data, x, i)


@njit(cache=True)
def _masked_residual(indptr, indices, data, z, r, mask, t):  # type: ignore[no-untyped-def]
    for i in range(z.size):
        t[i] = mask[i] * (r[i] - _row(indptr, indices, data, z, i))


@njit(cache=True)
def _smooth(indptr, indices, data, z, r, smoother, t):  # type: ignore[no-untyped-def]
    """t = z + smoother (r - A z); returns r.t."""
    total = 0.0
    for i in range(z.size):
        t[i] = z[i] + smoother[i] * (r[i] - _row(indptr, indices, data, z, i))
        total += r[i] * t[i]
    return total


@njit(cache=True)
def _product(indptr, indices, data, p, q):  # type: ignore[no-untyped-def]
    """q = A p; returns p.q."""
    total = 0.0
    for i in range(p.size):
        q[i] = _row(indptr, indices, data, p, i)
        total += p[i] * q[i]
    return total


@njit(cache=True)
def _advance(alpha, p, q, x, r):  # type: ignore[no-untyped-def]
    """x += alpha p, r -= alpha q; returns the norm of r."""
    total = 0.0
    for i in range(x.size):
        x[i] += alpha * p[i]
        r[i] -= alpha * q[i]
        total += r[i] * r[i]
    return np.sqrt(total)
