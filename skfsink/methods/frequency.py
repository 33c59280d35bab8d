"""The highest eigenfrequency of a body, which limits the explicit step."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la

from ..errors import ConvergenceError, InstabilityError
from ..fem.direct import Rows, add_symmetric_product
from ..fem.pattern import Pattern
from ..fields.momentum import Momentum
from ..system.jit import njit

__all__ = ["highest_frequency"]

STEPS = 60      # of Lanczos's method, whose vectors are kept
RESTARTS = 20   # from what they have found


def highest_frequency(momentum: Momentum, pattern: Pattern, free: np.ndarray, u: np.ndarray, mass: np.ndarray,
                      start: np.ndarray | None = None, *, tolerance: float = 1e-3) -> tuple[float, np.ndarray]:
    """Highest eigenfrequency omega [rad/s] of  K(u) x = omega^2 M x  over the free unknowns, and its vector.

    Lanczos on the mass-scaled tangent of the deformed, damaged body. `start` is a starting vector, best the result of
    the last call. The estimate approaches from below, by about `tolerance`. Nodes without mass do not swing. Contact is
    not in it.
    """
    if not pattern.size:  # every node is held: nothing swings
        return 0.0, np.zeros(0)
    indptr, indices = pattern.indptr.view(np.uint32), pattern.indices.view(np.uint32)
    data = momentum.tangent(pattern, u)
    root = np.sqrt(np.repeat(mass, momentum.space.dim)[free])
    _scale(indptr, indices, data, np.divide(1.0, root, out=np.zeros_like(root), where=root > 0.0))
    # The highest mode sits in one element, and the next one may sit in another, where the last result is zero: add
    # a vector that reaches everywhere, has no symmetry, and is the same every time.
    everywhere = np.sin(1.0 + np.arange(pattern.size) * 2.399963) * np.sqrt(2.0 / pattern.size)
    start = everywhere if start is None else everywhere + start
    square, mode = _lanczos(indptr, indices, data, start / np.linalg.norm(start), tolerance)
    return float(np.sqrt(max(square, 0.0))), mode


def _lanczos(indptr: np.ndarray, indices: np.ndarray, data: np.ndarray, start: np.ndarray,
             tolerance: float) -> tuple[float, np.ndarray]:
    """Greatest eigenvalue of a symmetric matrix, of which the upper triangle is given, and its vector.

    Its residual |A x - value x| is at most `tolerance` of it. The vectors lose their orthogonality, which gives an
    eigenvalue that has been found a second time, but none that is wrong.
    """
    residual, matrix = np.inf, Rows(indptr, indices, data)
    for _ in range(RESTARTS):
        vectors: list[np.ndarray] = [start]
        diagonal: list[float] = []
        beside: list[float] = []
        previous, beta = np.zeros_like(start), 0.0
        while True:
            following = np.empty_like(start)
            alpha, beta = _step(matrix, vectors[-1], previous, beta, following)
            if not np.isfinite(alpha + beta):
                raise InstabilityError("the tangent of the body is not finite: the explicit integration has blown up")
            diagonal.append(alpha)
            last = len(diagonal) - 1
            values, modes = la.eigh_tridiagonal(diagonal, beside, select="i", select_range=(last, last))
            residual = beta * abs(modes[-1, 0]) / max(abs(values[0]), 1e-300)
            if not residual > tolerance or len(vectors) == STEPS:
                break
            previous = vectors[-1]
            vectors.append(following)
            beside.append(beta)
        start = modes[:, 0] @ np.array(vectors)
        start /= np.linalg.norm(start)
        if not residual > tolerance:
            return float(values[0]), start
    raise ConvergenceError(f"no highest frequency was found in {RESTARTS * STEPS} steps of Lanczos's method: its "
                           f"residual is still {residual:.2g} of it")


@njit(cache=True)
def _scale(indptr, indices, data, scale):  # type: ignore[no-untyped-def]
    for i in range(scale.size):
        for k in range(indptr[i], indptr[i + 1]):
            data[k] *= scale[i] * scale[indices[k]]


@njit(cache=True)
def _step(A, v, previous, beta, following):  # type: ignore[no-untyped-def]
    """following = (A v - alpha v - beta previous)/|..| for the upper triangle of A; returns alpha and that norm."""
    for i in range(v.size):
        following[i] = -beta * previous[i]
    add_symmetric_product(A.indptr, A.indices, A.data, v, following)
    alpha = 0.0
    for i in range(v.size):
        alpha += following[i] * v[i]
    square = 0.0
    for i in range(v.size):
        following[i] -= alpha * v[i]
        square += following[i] * following[i]
    norm = np.sqrt(square)
    if norm > 0.0:
        for i in range(v.size):
            following[i] /= norm
    return alpha, norm
