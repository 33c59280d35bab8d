"""Conjugate gradients preconditioned by the diagonal, for the density solve: for bodies in parts, or in one piece.

A dead node has a diagonal 10^15 times as large as that of the rest: on the diagonal, where it does not slow the
iteration. It takes about 18 l/h iterations from gamma = 1 to a residual of 1e-8, in any dimension, and needs no
hierarchy: sums at the nodes between parts, and two products, are all that parts have to tell each other.
"""

from __future__ import annotations

import copy

import numpy as np
from scipy.sparse import csr_array

from ..system.jit import njit
from .direct import unsigned
from .exchange import Exchange

__all__ = ["JacobiCG"]


class JacobiCG:
    """Conjugate gradients for  A x = b, preconditioned by the diagonal.

    Memory: `iterations` and `residual`, of the last solve. `solve`, `iterate` and `restricted` depend on no earlier
    call.

    Parameters
    ----------
    exchange: between the parts of the body.
    intact: diagonal of A where nothing has failed, (n,).
    tolerance: of the residual, relative to the norm of b; it ends at `SHARE` of it.
    max_iterations: after which it has not converged.
    """

    SHARE = 1e-3  # of the tolerance: on another number of ranks sums differ by rounding, and results by not much more
    DEAD = 3.0    # of the intact diagonal

    def __init__(self, exchange: Exchange, intact: np.ndarray, tolerance: float = 1e-8,
                 max_iterations: int = 3000) -> None:
        self.exchange, self.tolerance, self.max_iterations = exchange, tolerance, max_iterations
        self._intact = intact
        self._counted, self.nodes = exchange.counts(intact.size), np.arange(intact.size, dtype=np.uint32)
        self.iterations = 0          #: of the last solve
        self.residual = 0.0          #: true relative residual of the last solve

    def restricted(self, nodes: np.ndarray) -> JacobiCG:
        """The same for the unknowns `nodes`, the others kept."""
        part = copy.copy(self)
        part.nodes = nodes.astype(np.uint32)
        return part

    def dead(self, D: np.ndarray) -> np.ndarray:
        """Mask of the unknowns whose sink has grown so far that they are what it makes them."""
        return self.DEAD * self._intact <= D

    def sharp(self, tolerance: float | None) -> float:
        """The relative residual at which a solve to a tolerance, that of the solver if not given, ends."""
        return self.SHARE * (tolerance or self.tolerance)

    def residual_of(self, A: csr_array, x: np.ndarray, b: np.ndarray) -> np.ndarray:
        """b - A x."""
        return b - self.exchange.whole(A @ x)

    def settle(self, A: csr_array, D: np.ndarray, b: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Let the values of `x` at dead unknowns follow their sinks, in place; returns the residual."""
        dead = self.dead(D)
        x[dead] += (self.residual_of(A, x, b) / D)[dead]
        return self.residual_of(A, x, b)

    def solve(self, A: csr_array, D: np.ndarray, b: np.ndarray, x: np.ndarray,
              tolerance: float | None = None) -> np.ndarray | None:
        """Solution (n,) of A x = b from the guess `x`; None if it did not converge in `max_iterations`.

        `A` is the share of this part, `D` the diagonal of the whole matrix, `b` whole.
        """
        norm, total = self.exchange.norm, 0
        target, size = self.sharp(tolerance), norm(b)
        x = x + self.residual_of(A, x, b) / D  # puts the unknowns with a huge diagonal where they belong
        for _ in range(5):
            r = self.residual_of(A, x, b)  # the true one; that of the iteration drifts from it by rounding
            self.residual = norm(r) / size
            if self.residual <= target:
                break
            converged = self.iterate(A, D, r, x, target * size)
            total += self.iterations
            if not converged:
                break
        self.iterations = total
        return x if self.residual <= 2 * target else None

    def iterate(self, A: csr_array, D: np.ndarray, r: np.ndarray, x: np.ndarray, target: float) -> bool:
        """Iterate on `x`, whose residual is `r`, both changed in place, until the norm of r over `nodes` is `target`.

        Only the values at `nodes` are changed. False if it did not converge.
        """
        matrix, nodes, exchange, counted = unsigned(A), self.nodes, self.exchange, self._counted
        p, q = np.zeros_like(r), np.zeros_like(r)
        rz_old, alpha, self.iterations = 1.0, 0.0, 0
        rz, square = exchange.totals(_advance(nodes, counted, D, alpha, p, q, x, r))
        while self.iterations < self.max_iterations:
            _direction(nodes, matrix, D, rz / rz_old, r, p, q)
            pq = exchange.total(_product(nodes, counted, p, exchange.whole(q)))
            if not (np.isfinite(pq) and pq > 0.0):
                return False
            rz_old = rz
            rz, square = exchange.totals(_advance(nodes, counted, D, rz / pq, p, q, x, r))
            self.iterations += 1
            if square <= target * target:
                return True
        return False


@njit(cache=True)
def _direction(nodes, A, D, beta, r, p, q):  # type: ignore[no-untyped-def]
    """p = r/D + beta p, and q = A p, in a part of a body its share."""
    indptr, indices, data = A.indptr, A.indices, A.data
    for i in nodes:
        p[i] = r[i] / D[i] + beta * p[i]
    for i in nodes:
        total = 0.0
        for k in range(indptr[i], indptr[i + 1]):
            total += data[k] * p[indices[k]]
        q[i] = total


@njit(cache=True)
def _product(nodes, counted, p, q):  # type: ignore[no-untyped-def]
    """p . q over what counts."""
    total = 0.0
    for i in nodes:
        if counted[i]:
            total += p[i] * q[i]
    return total


@njit(cache=True)
def _advance(nodes, counted, D, alpha, p, q, x, r):  # type: ignore[no-untyped-def]
    """x += alpha p, r -= alpha q; returns r . r/D and r . r over what counts."""
    scaled, square = 0.0, 0.0
    for i in nodes:
        x[i] += alpha * p[i]
        r[i] -= alpha * q[i]
        if counted[i]:
            scaled += r[i] * r[i] / D[i]
            square += r[i] * r[i]
    return scaled, square
