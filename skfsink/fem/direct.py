"""Sparse factorisation of symmetric matrices on a fixed pattern, and conjugate gradients with a factorisation kept.

No direct solve returns a solution whose true residual was not measured.
"""

from __future__ import annotations

import ctypes
import math
import os
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from copy import copy
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse.linalg as sla
from scipy.sparse import csc_array, csr_array
from threadpoolctl import ThreadpoolController

from ..errors import ConvergenceError, ParameterError
from ..system.jit import njit
from .pattern import Pattern

os.environ.setdefault("MKL_CBWR", "AUTO,STRICT")  # the same bits from one run to the next, whatever the alignment

__all__ = ["BACKENDS", "Factorization", "add_symmetric_product", "conjugate", "one_thread_of_openblas", "symmetric",
           "symmetric_product", "unsigned"]

Vectors = Callable[[np.ndarray], np.ndarray]

try:
    import pypardiso
except ImportError:  # not x86-64: CHOLMOD does it where it is installed, else SuperLU, several times slower
    pypardiso = None

BACKENDS = {"pardiso": "pypardiso", "cholmod": "sksparse", "superlu": "scipy"}  #: and the modules that they come with


def _is_there(backend: str) -> bool:
    if backend != "cholmod":
        return backend == "superlu" or pypardiso is not None
    try:
        import sksparse.cholmod  # noqa: F401
    except ImportError:
        return False
    return True


def _backend(asked: str | None) -> str:
    """That asked for, or the first one that is installed; ParameterError if it is not there."""
    if asked is not None and not _is_there(asked):
        raise ParameterError(f"linear {asked} needs {BACKENDS[asked]}, which is not installed: install it, or take "
                             f"linear = 'direct'")
    return asked or next(filter(_is_there, BACKENDS))


def one_thread_of_openblas() -> AbstractContextManager[Any]:
    """Keeps NumPy's and SciPy's sums of short vectors to one thread, which is faster; PARDISO has its own."""
    return ThreadpoolController().select(internal_api="openblas").limit(limits=1)


class Factorization:
    """Direct solver for symmetric matrices on one pattern (upper triangle); the analysis is done once.

    Memory: the factors of the matrix last given to `factorize`, which `solve`, `solve_sum`, `apply` and `conjugate`
    use and `release` drops; `factorize` itself depends on no earlier call.

    Parameters
    ----------
    pattern: upper-triangular pattern.
    backend: "pardiso" (MKL), "cholmod" (SuiteSparse, by scikit-sparse), "superlu" (SciPy), or None for the first of
        them that is installed.
    threads: threads of the factorisation by PARDISO; results are the same to the last bit only with one.

    PARDISO and CHOLMOD are told that the matrix is positive definite; where it is not, it is factorised again as
    indefinite by PARDISO, or by SuperLU in the place of CHOLMOD.

    Raises
    ------
    ParameterError
        The backend that was asked for is not installed.
    """

    exact = True     # whether `apply` is a solution in no time
    MOST = (5, 12)   # iterations of `conjugate` that pay, in two and in three dimensions
    WORTH = (10, 24)  # that take as long as a factorisation, on a body of 50,000 elements

    def __init__(self, pattern: Pattern, backend: str | None = None, threads: int = 1) -> None:
        self.pattern = pattern
        self.backend = _backend(backend)
        self.threads = threads
        self.count = 0            #: numerical factorisations made
        self.definite = True      #: whether the last matrix was found positive definite
        self._handles: dict[int, _Pardiso] = {}
        self._lu: sla.SuperLU | None = None
        self._cholesky: Any = None
        self._matrix: csr_array | None = None

    def factorize(self, data: np.ndarray, indefinite: bool = True) -> bool:
        """Factorise the matrix with these values on the pattern; False if it is not positive definite.

        One that is not is factorised all the same, unless `indefinite` is False.
        """
        self.count += 1
        if not self.pattern.size:  # every node is held: nothing is unknown
            return True
        self._matrix = self.pattern.matrix(data)
        if self.backend == "pardiso":
            self.definite = self._handle(2).factorize(data)
            if not self.definite and indefinite and not self._handle(-2).factorize(data):
                raise ConvergenceError("the matrix cannot be factorised")
            return self.definite
        self._lu = None
        if self.backend == "superlu":
            self.definite = self._by_superlu(data)
        else:
            self.definite = self._by_cholmod(self._matrix)
            if not self.definite and indefinite:
                self._by_superlu(data)
        return self.definite

    def _by_superlu(self, data: np.ndarray) -> bool:
        self._lu = lu = sla.splu(csc_array(self.pattern.symmetric(data)), permc_spec="MMD_AT_PLUS_A",
                                 diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        return bool((lu.perm_r == lu.perm_c).all() and (lu.U.diagonal() > 0).all())

    def _by_cholmod(self, matrix: csr_array) -> bool:
        """CHOLMOD reads the lower triangle, and analyses it once: entries that are zero now have to be in it."""
        from sksparse import cholmod
        lower = csc_array(matrix.T)  # the same arrays
        if self._cholesky is None:
            self._cholesky = cholmod.analyze(lower, mode="supernodal", ordering_method="best")
        try:
            self._cholesky.cholesky_inplace(lower)
        except cholmod.CholmodNotPositiveDefiniteError:
            return False
        return True

    def solve(self, b: np.ndarray, tolerance: float = 1e-9) -> np.ndarray:
        """Solution of A x = b; refined once if its relative residual is above `tolerance`.

        Raises
        ------
        ConvergenceError
            The residual stays above 1000 times the tolerance: the matrix is singular to rounding.
        """
        if not b.size:
            return b
        x = self.apply(b)
        scale = float(np.linalg.norm(b))
        if scale == 0.0:
            return x
        for attempt in range(3):
            r = b - self._times(x)
            error = float(np.linalg.norm(r)) / scale
            if error <= tolerance:
                return x
            if attempt < 2:
                x = x + self.apply(r)
        if not error <= 1000 * tolerance:
            raise ConvergenceError(f"the factorised system is singular to rounding: relative residual {error:.1e}, "
                                   f"allowed {1000 * tolerance:.0e}")
        return x

    def apply(self, b: np.ndarray) -> np.ndarray:
        """Forward and backward substitution for the right-hand side b, or columns of b; the residual is not looked at.
        """
        if not b.size:
            return b
        if self._lu is not None:
            return self._lu.solve(b)
        if self.backend != "pardiso":
            return np.asarray(self._cholesky(b))
        return self._handle(2 if self.definite else -2).solve(b)

    def solve_sum(self, B: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Solution of (A + B B^T) x = b, B with few columns, by Woodbury's formula and one step of refinement."""
        x, Z = self.apply(b), self.apply(B)
        small = np.linalg.inv(np.eye(B.shape[1]) + B.T @ Z)
        x -= Z @ (small @ (B.T @ x))
        r = self.apply(b - self._times(x) - B @ (B.T @ x))
        refined: np.ndarray = x + r - Z @ (small @ (B.T @ r))
        return refined

    def conjugate(self, data: np.ndarray, b: np.ndarray, tolerance: float, most: int) -> tuple[np.ndarray, int, bool]:
        """Solution of  A x = b  by conjugate gradients, with A = `data` on the pattern and the factors kept.

        The factors must be of a positive definite matrix near A. Ends at a relative residual of `tolerance`, after
        `most` iterations, or where A curves down; returns the last iterate, which is a direction of descent of
        x.A x/2 - b.x in any case but zero iterations, their number, and whether the tolerance was met.
        """
        return conjugate(symmetric(self.pattern.matrix(data)), self.apply, b, tolerance, most)

    def release(self) -> None:
        """Free the memory of the factors."""
        self._handles.clear()
        self._lu = self._cholesky = None

    def _times(self, x: np.ndarray) -> np.ndarray:
        assert self._matrix is not None
        if not self.pattern.upper:
            return self._matrix @ x
        return symmetric_product(*unsigned(self._matrix), x)

    def _handle(self, kind: int) -> _Pardiso:
        if kind not in self._handles:
            self._handles[kind] = _Pardiso(self.pattern, kind, self.threads)
        return self._handles[kind]


@cache
def _library() -> Any:
    """The wrapper of PARDISO as it is made: once, since its search for MKL takes a third of a second."""
    return pypardiso.PyPardisoSolver()


class _Pardiso:
    """MKL's PARDISO on one pattern: `kind` 2 for positive definite, -2 for indefinite symmetric matrices.

    MKL's memory is freed with the object.
    """

    ANALYSE, FACTORIZE, SOLVE, RELEASE = 11, 22, 33, -1
    NOT_DEFINITE = -4

    def __init__(self, pattern: Pattern, kind: int, threads: int) -> None:
        self._pattern, self._kind, self._data = pattern, kind, np.zeros(pattern.nnz)
        self._threads = threads
        self._handle = handle = copy(_library())
        handle.pt, handle.iparm = np.zeros_like(handle.pt), np.zeros_like(handle.iparm)
        handle.iparm[0] = 1       # the values below, none by default
        handle.iparm[1] = 2       # nested dissection
        handle.iparm[9] = 8       # pivots below 1e-8 are perturbed (indefinite)
        handle.iparm[20] = 1      # Bunch-Kaufman pivoting (indefinite)
        handle.iparm[23] = 1      # two-level factorisation: a tenth faster and smaller, on one thread too
        handle.iparm[34] = 1      # indices from zero
        self._empty = np.zeros(pattern.size)
        self._call(self.ANALYSE)

    def factorize(self, data: np.ndarray) -> bool:
        """Numerical factorisation; False if a pivot has the wrong sign."""
        self._data = data
        return self._call(self.FACTORIZE) == 0

    def solve(self, b: np.ndarray) -> np.ndarray:
        columns = np.ascontiguousarray(b.T)
        x = np.empty_like(columns)
        self._call(self.SOLVE, columns, x)
        return x.T

    def __del__(self) -> None:
        if "_empty" in vars(self) and not sys.is_finalizing():
            self._call(self.RELEASE)

    def _call(self, phase: int, b: np.ndarray | None = None, x: np.ndarray | None = None) -> int:
        handle, pattern = self._handle, self._pattern
        b = self._empty if b is None else b
        x = self._empty if x is None else x
        count = b.shape[0] if b.ndim == 2 else 1  # of right-hand sides
        numbers = [ctypes.byref(ctypes.c_int32(i)) for i in (1, 1, self._kind, phase, pattern.size)]
        index = ctypes.POINTER(ctypes.c_int32)
        error = ctypes.c_int32(0)
        # MKL's number of threads is one for the process: each call brings its own, and leaves the other as it was
        before = handle.libmkl.MKL_Set_Num_Threads_Local(self._threads)
        try:
            handle._mkl_pardiso(
                handle.pt.ctypes.data_as(ctypes.POINTER(handle._pt_type[0])), *numbers,
                self._data.ctypes.data_as(ctypes.c_void_p), pattern.indptr.ctypes.data_as(index),
                pattern.indices.ctypes.data_as(index), handle.perm.ctypes.data_as(index),
                ctypes.byref(ctypes.c_int32(count)), handle.iparm.ctypes.data_as(index),
                ctypes.byref(ctypes.c_int32(0)),
                b.ctypes.data_as(ctypes.c_void_p), x.ctypes.data_as(ctypes.c_void_p), ctypes.byref(error))
        finally:
            handle.libmkl.MKL_Set_Num_Threads_Local(before)
        if error.value not in (0, self.NOT_DEFINITE):
            raise ConvergenceError(f"the direct solver failed: PARDISO reports error {error.value}"
                                   + (" (not enough memory)" if error.value in (-2, -9) else ""))
        return int(error.value)


def conjugate(times: Vectors, precondition: Vectors, b: np.ndarray, tolerance: float, most: int,
              total: Callable[[float], float] = float) -> tuple[np.ndarray, int, bool]:
    """Conjugate gradients on a matrix by what it makes of vectors; see :meth:`Factorization.conjugate`.

    `total` adds what the products of parts of vectors are, where these are shared.
    """
    x, r = np.zeros_like(b), b.copy()
    target = tolerance * math.sqrt(total(float(b @ b)))
    p, rz_old = np.zeros_like(b), 1.0
    for iteration in range(most):
        z = precondition(r)
        rz = total(float(r @ z))
        p *= rz / rz_old
        p += z
        rz_old = rz
        q = times(p)
        pq = total(float(p @ q))
        if not pq > 0.0:
            return x, iteration, False
        x += rz / pq * p
        r -= rz / pq * q
        if math.sqrt(total(float(r @ r))) <= target:
            return x, iteration + 1, True
    return x, most, False


def symmetric(A: csr_array) -> Vectors:
    """What the matrix with the upper triangle A makes of a vector."""
    rows = unsigned(A)

    def times(x: np.ndarray) -> np.ndarray:
        y: np.ndarray = symmetric_product(*rows, x)
        return y
    return times


@njit(cache=True)
def add_symmetric_product(indptr, indices, data, x, y):  # type: ignore[no-untyped-def]
    """y += A x for the upper triangle of A."""
    for i in range(x.size):
        total, xi = 0.0, x[i]
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            total += data[k] * x[j]
            if j != i:
                y[j] += data[k] * xi
        y[i] += total


@njit(cache=True)
def symmetric_product(indptr, indices, data, x):  # type: ignore[no-untyped-def]
    """y = A x for the upper triangle of A."""
    y = np.zeros(x.size)
    add_symmetric_product(indptr, indices, data, x, y)
    return y


class Rows(NamedTuple):
    """A sparse matrix by rows, as compiled loops take it."""

    indptr: np.ndarray
    indices: np.ndarray
    data: np.ndarray


def unsigned(A: csr_array) -> Rows:
    """CSR arrays with unsigned indices, which spares the compiled loops a test for negative ones: 2.7 times as fast."""
    return Rows(A.indptr.view(np.uint32), A.indices.view(np.uint32), A.data)
