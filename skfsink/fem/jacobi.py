"""Conjugate gradients preconditioned by the diagonal, for the density solve: for bodies in parts, or in one piece.

A dead node has a diagonal 10^15 times as large as that of the rest: on the diagonal, where it does not slow the
iteration. It takes about 18 l/h iterations from gamma = 1 to a residual of 1e-8, in any dimension, and needs no
hierarchy: sums at the nodes between parts, and two products, are all that parts have to tell each other.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from .exchange import Exchange

__all__ = ["JacobiCG"]


class JacobiCG:
    """Conjugate gradients for  A x = b, preconditioned by the diagonal.

    Memory: `iterations` and `residual`, of the last solve. `solve` depends on no earlier call.

    Parameters
    ----------
    exchange: between the parts of the body.
    tolerance: of the residual, relative to the norm of b; it ends at `SHARE` of it.
    max_iterations: after which it has not converged.
    """

    SHARE = 1e-3  # of the tolerance: on another number of ranks sums differ by rounding, and results by not much more

    def __init__(self, exchange: Exchange, tolerance: float = 1e-8, max_iterations: int = 3000) -> None:
        self.exchange, self.tolerance, self.max_iterations = exchange, tolerance, max_iterations
        self.iterations = 0          #: of the last solve
        self.residual = 0.0          #: true relative residual of the last solve

    def solve(self, A: csr_array, D: np.ndarray, b: np.ndarray, x: np.ndarray,
              tolerance: float | None = None) -> np.ndarray | None:
        """Solution (n,) of A x = b from the guess `x`; None if it did not converge in `max_iterations`.

        `A` is the share of this part, `D` the diagonal of the whole matrix, `b` whole.
        """
        exchange, self.iterations = self.exchange, 0
        tolerance, size = self.SHARE * (tolerance or self.tolerance), exchange.dot(b, b) ** 0.5
        x = x + (b - exchange.add(A @ x)) / D  # puts the unknowns with a huge diagonal where they belong
        while True:
            r = b - exchange.add(A @ x)  # the true residual; that of the iteration drifts from it by rounding
            self.residual = exchange.dot(r, r) ** 0.5 / size
            if self.residual <= tolerance:
                return x
            if not self._iterate(A, D, r, x, tolerance * size):
                return None

    def _iterate(self, A: csr_array, D: np.ndarray, r: np.ndarray, x: np.ndarray, target: float) -> bool:
        """Iterate on `x`, whose residual is `r`, both changed in place, until the norm of r is `target`."""
        exchange, p, rz_old = self.exchange, np.zeros_like(r), 1.0
        while self.iterations < self.max_iterations:
            z = r / D
            rz = exchange.dot(r, z)
            p *= rz / rz_old
            p += z
            q = exchange.add(A @ p)
            pq = exchange.dot(p, q)
            if not (np.isfinite(pq) and pq > 0.0):
                return False
            x += rz / pq * p
            r -= rz / pq * q
            rz_old = rz
            self.iterations += 1
            if exchange.dot(r, r) <= target * target:
                return True
        return False
