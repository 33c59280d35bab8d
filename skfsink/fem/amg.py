"""Conjugate gradients preconditioned by pyamg, for the density solve. Every solution's true residual is measured."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
import pyamg
import scipy.sparse.linalg as sla
from scipy.sparse import csc_array, csr_array

from ..system.jit import njit
from .direct import unsigned
from .exchange import ALONE

__all__ = ["AmgCG", "residual", "same_random_vectors"]


@contextmanager
def same_random_vectors() -> Iterator[None]:
    """Within it pyamg, which estimates spectral radii from random vectors, takes the same ones every time."""
    state = np.random.get_state()
    np.random.seed(0)
    try:
        yield
    finally:
        np.random.set_state(state)


class AmgCG:
    """Conjugate gradients for  (L + diag(s)) x = b  with L fixed and s >= its intact value s0, preconditioned by pyamg.

    The smoothed-aggregation hierarchy is built once for the intact matrix L + diag(s0). A solve smooths with the
    *current* matrix and corrects on the hierarchy's coarse levels, leaving out the unknowns whose diagonal has grown
    past `DEAD` times the intact one: their value is settled by the smoother alone, and the intact hierarchy stays
    valid for the rest. It therefore never has to be rebuilt while damage spreads, nor does its cost depend on the
    path that led to the current state.

    Memory: `iterations` and `residual`, of the last solve. `solve`, `iterate` and `restricted` depend on no earlier
    call.
    """

    exchange = ALONE
    DEAD = 3.0           # of the intact diagonal
    OMEGA = 0.8          # greatest Jacobi weight of the smoother
    STABLE = 1.6         # that weight times the spectral radius of D^-1 A at the most; past 2 it would not smooth
    DIRECT_COARSE = 6000  # unknowns of the second level that are factorised rather than coarsened on

    def __init__(self, intact: csr_array, tolerance: float = 1e-8, max_iterations: int = 100) -> None:
        self.tolerance = tolerance
        self.max_iterations = max_iterations
        self.iterations = 0          #: of the last solve
        self.residual = 0.0          #: true relative residual of the last solve
        self._diagonal0 = intact.diagonal()
        self.omega = min(self.OMEGA, self.STABLE / self._radius(intact))  #: Jacobi weight
        with same_random_vectors():
            levels = pyamg.smoothed_aggregation_solver(
                csr_array(intact), strength=("symmetric", {"theta": 0.0}), improve_candidates=None, max_coarse=200)
        self.nodes = np.arange(intact.shape[0], dtype=np.uint32)  #: unknowns it works on
        if len(levels.levels) > 1:
            self._correct_on(csr_array(levels.levels[0].P), csr_array(levels.levels[1].A))
        else:
            self._correct_on(csr_array((intact.shape[0], 0)), csr_array((0, 0)))

    def _correct_on(self, P: csr_array, coarse: csr_array) -> None:
        """Take `coarse` as the second level, with the prolongation P, (unknowns it works on, coarse ones)."""
        self._P, self._R, self._coarse_matrix = P, csr_array(P.T), coarse
        self._coarse: Callable[[np.ndarray], np.ndarray]
        if coarse.shape[0] == 0:
            self._coarse = np.copy
            return
        if coarse.shape[0] <= self.DIRECT_COARSE:
            self._coarse = sla.splu(csc_array(coarse), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                                    options={"SymmetricMode": True}).solve
            return
        with same_random_vectors():
            cycle = pyamg.smoothed_aggregation_solver(coarse, improve_candidates=None).aspreconditioner()
        self._coarse = cycle.matvec

    def restricted(self, nodes: np.ndarray) -> AmgCG:
        """The same for the unknowns `nodes`, the others kept: their part of the hierarchy, none made anew."""
        part = copy.copy(self)
        part.nodes = nodes.astype(np.uint32)
        P = self._P[nodes]
        used = np.unique(P.indices)
        part._correct_on(csr_array(P[:, used]), csr_array(self._coarse_matrix[used][:, used]))
        return part

    def _radius(self, intact: csr_array) -> float:
        """Spectral radius of D^-1 A of the intact matrix; sinks only lower it."""
        if intact.shape[0] < 3:
            return 2.0
        scale = 1.0 / np.sqrt(self._diagonal0)
        start = np.sin(1.0 + np.arange(scale.size) * 2.399963)  # the same every time, without any symmetry
        operator = sla.LinearOperator(intact.shape, dtype=float,
                                      matvec=lambda x: scale * (intact @ (scale * x.ravel())))
        return float(sla.eigsh(operator, k=1, which="LA", v0=start, tol=1e-2, return_eigenvectors=False)[0])

    def dead(self, D: np.ndarray) -> np.ndarray:
        """Mask of the unknowns whose sink has grown so far that the coarse level leaves them out."""
        return self.DEAD * self._diagonal0 <= D

    def sharp(self, tolerance: float | None) -> float:
        """The relative residual at which a solve to a tolerance, that of the solver if not given, ends."""
        return tolerance or self.tolerance

    def residual_of(self, A: csr_array, x: np.ndarray, b: np.ndarray) -> np.ndarray:
        """b - A x."""
        return residual(A, x, b)

    def settle(self, A: csr_array, D: np.ndarray, b: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Let the values of `x` at dead unknowns follow their sinks, in place; returns the residual."""
        r = residual(A, x, b)
        _settle(self.dead(D), D, unsigned(A), x, r)
        return r

    def solve(self, A: csr_array, D: np.ndarray, b: np.ndarray, x: np.ndarray,
              tolerance: float | None = None) -> np.ndarray | None:
        """Solution of A x = b from the guess `x`; None if it did not converge in `max_iterations`.

        `D` is the diagonal of A. It ends at a residual of `tolerance` (that of the solver if not given) relative to
        the norm of b.
        """
        tolerance, size = self.sharp(tolerance), float(np.linalg.norm(b))
        # one Jacobi sweep puts the unknowns with a huge diagonal where they belong
        x = x + residual(A, x, b) / D
        total = 0
        for attempt in range(3):
            r = residual(A, x, b)
            self.residual = float(np.linalg.norm(r)) / size
            if self.residual <= tolerance or attempt == 2:
                break
            if not self.iterate(A, D, r, x, tolerance * size):
                return None
            total += self.iterations
        self.iterations = total
        return x if self.residual <= 2 * tolerance else None

    def iterate(self, A: csr_array, D: np.ndarray, r: np.ndarray, x: np.ndarray, target: float) -> bool:
        """Iterate on `x`, whose residual is `r`, both changed in place, until the norm of r over `nodes` is `target`.

        Only the values at `nodes` are changed. False if it did not converge.
        """
        matrix, R, nodes = unsigned(A), unsigned(self._R), self.nodes
        z, t, p, q = (np.zeros_like(r) for _ in range(4))  # zero outside of `nodes`
        at = _Vectors(x, r, z, t, p, q, self.omega / D, ~self.dead(D))
        part, coarse = np.empty(nodes.size), np.empty(self._R.shape[0])
        rz_old, self.iterations = 1.0, 0
        _advance(nodes, 0.0, at)
        while self.iterations < self.max_iterations:
            _restrict(nodes, matrix, R, at, part, coarse)
            rz = _correct_and_smooth(nodes, matrix, R, at, self._coarse(coarse))
            pq = _direction(nodes, matrix, rz / rz_old, at)
            if not (np.isfinite(pq) and pq > 0.0):
                return False
            rz_old = rz
            self.iterations += 1
            if _advance(nodes, rz / pq, at) <= target:
                return True
        return False


def residual(A: csr_array, x: np.ndarray, b: np.ndarray) -> np.ndarray:
    """b - A x."""
    r = np.empty_like(b)
    _residual(*unsigned(A), x, b, r)
    return r


class _Vectors(NamedTuple):
    """Vectors of an iteration.

    Attributes
    ----------
    x, r: solution and residual.   z, t: what the preconditioner makes of r, before the last smoothing and after.
    p, q: direction, and A p.   smoother: Jacobi weight over the diagonal.
    live: mask of the unknowns that the coarse level corrects.
    """

    x: np.ndarray
    r: np.ndarray
    z: np.ndarray
    t: np.ndarray
    p: np.ndarray
    q: np.ndarray
    smoother: np.ndarray
    live: np.ndarray


# In the loops below a row of A is taken with the whole vector, which is zero outside of `nodes`. The restriction R
# has a row for each coarse unknown, whose columns m stand for nodes[m]; its rows are
# longer than those of the prolongation R^T, and loops over them better to foresee.
@njit(cache=True)
def _row(indptr, indices, data, x, i):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(indptr[i], indptr[i + 1]):
        total += data[k] * x[indices[k]]
    return total


@njit(cache=True)
def _settle(dead, D, A, x, r):  # type: ignore[no-untyped-def]
    """Let the values at `dead` nodes follow their sinks, and the residual r with them (A is symmetric)."""
    indptr, indices, data = A.indptr, A.indices, A.data
    for i in range(x.size):
        if dead[i]:
            change = r[i] / D[i]
            x[i] += change
            for k in range(indptr[i], indptr[i + 1]):
                r[indices[k]] -= data[k] * change


@njit(cache=True)
def _residual(indptr, indices, data, x, b, r):  # type: ignore[no-untyped-def]
    for i in range(x.size):
        r[i] = b[i] - _row(indptr, indices, data, x, i)


@njit(cache=True)
def _restrict(nodes, A, R, at, part, coarse):  # type: ignore[no-untyped-def]
    """coarse = R (r - A z) of the live nodes; `part` takes that residual."""
    indptr, indices, data = A.indptr, A.indices, A.data
    start, column, weight = R.indptr, R.indices, R.data
    z, r, live = at.z, at.r, at.live
    for m in range(nodes.size):
        i = nodes[m]
        part[m] = r[i] - _row(indptr, indices, data, z, i) if live[i] else 0.0
    for c in range(coarse.size):
        coarse[c] = _row(start, column, weight, part, c)


@njit(cache=True)
def _correct_and_smooth(nodes, A, R, at, coarse):  # type: ignore[no-untyped-def]
    """z += R^T coarse at the live nodes, then t = z + smoother (r - A z); returns r.t."""
    indptr, indices, data = A.indptr, A.indices, A.data
    start, column, weight = R.indptr, R.indices, R.data
    z, r, t, smoother, live = at.z, at.r, at.t, at.smoother, at.live
    for c in range(coarse.size):
        value = coarse[c]
        for k in range(start[c], start[c + 1]):
            i = nodes[column[k]]
            if live[i]:
                z[i] += weight[k] * value
    total = 0.0
    for i in nodes:
        t[i] = z[i] + smoother[i] * (r[i] - _row(indptr, indices, data, z, i))
        total += r[i] * t[i]
    return total


@njit(cache=True)
def _direction(nodes, A, beta, at):  # type: ignore[no-untyped-def]
    """p = t + beta p, q = A p; returns p.q."""
    indptr, indices, data = A.indptr, A.indices, A.data
    t, p, q = at.t, at.p, at.q
    for i in nodes:
        p[i] = t[i] + beta * p[i]
    total = 0.0
    for i in nodes:
        q[i] = _row(indptr, indices, data, p, i)
        total += p[i] * q[i]
    return total


@njit(cache=True)
def _advance(nodes, alpha, at):  # type: ignore[no-untyped-def]
    """x += alpha p, r -= alpha q, z = smoother r; returns the norm of r."""
    p, q, x, r, smoother, z = at.p, at.q, at.x, at.r, at.smoother, at.z
    total = 0.0
    for i in nodes:
        x[i] += alpha * p[i]
        r[i] -= alpha * q[i]
        z[i] = smoother[i] * r[i]
        total += r[i] * r[i]
    return np.sqrt(total)
