"""The highest eigenfrequency of a body, and the strongest damping, which limit the explicit step."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg as la

from ..errors import ConvergenceError, InstabilityError
from ..fem.direct import Rows, add_symmetric_product
from ..fem.exchange import Unknowns
from ..fem.pattern import Pattern
from ..fields.momentum import Momentum
from ..system.jit import njit

__all__ = ["highest_damping", "highest_frequency", "stable_step"]

#: following = A v - beta previous, of v, previous, beta and following; of a part of a body its share
Product = Callable[[np.ndarray, np.ndarray, float, np.ndarray], None]

STEPS = 60      # of Lanczos's method, whose vectors are kept
RESTARTS = 20   # from what they have found


def highest_frequency(momentum: Momentum, pattern: Pattern | None, free: np.ndarray, u: np.ndarray, mass: np.ndarray,
                      start: np.ndarray | None = None, *, tolerance: float = 1e-3) -> tuple[float, np.ndarray]:
    """Highest eigenfrequency omega [rad/s] of  K(u) x = omega^2 M x  over the free unknowns, and its vector.

    Lanczos on the mass-scaled tangent of the deformed, damaged body, assembled on a `pattern` or, without one, by
    differences of forces. `start` is a starting vector, best the result of the last call. The estimate approaches from
    below, by about `tolerance`. Nodes without mass do not swing. Contact is not in it.
    """
    unknowns = momentum.space.exchange.over(free)
    if not unknowns.size:  # every node is held: nothing swings
        return 0.0, np.zeros(0)
    scale = _inverse_root(np.repeat(mass, momentum.space.dim)[free])
    product = (_by_forces(momentum, free, u, scale, unknowns) if pattern is None else
               _by_matrix(pattern, momentum.tangent(pattern, u), scale, unknowns))
    square, mode = _greatest(product, unknowns, start, tolerance)
    return float(np.sqrt(max(square, 0.0))), mode


def highest_damping(momentum: Momentum, pattern: Pattern, free: np.ndarray, u: np.ndarray, mass: np.ndarray,
                    *, compression: float = 0.0, tolerance: float = 1e-3) -> float:
    """Greatest eigenvalue c [1/s] of  C(u) x = c M x  over the free unknowns, C the derivative of the viscous force.

    Elements count as compressed by `compression`; see :meth:`.Momentum.viscous_tangent`. A mode of the frequency omega
    and the damping ratio xi has c = 2 xi omega.
    """
    unknowns = momentum.space.exchange.over(free)
    if not unknowns.size:
        return 0.0
    data = momentum.viscous_tangent(pattern, u, np.zeros_like(u), compression)
    scale = _inverse_root(np.repeat(mass, momentum.space.dim)[free])
    damping, _ = _greatest(_by_matrix(pattern, data, scale, unknowns), unknowns, None, tolerance)
    return max(damping, 0.0)


def stable_step(omega: float, damping: float) -> float:
    """Limit of the explicit step [s] where viscous forces take the velocity half a step before; `omega` > 0.

    With K <= omega^2 M and C <= c M every mode is stable for  dt^2 omega^2 + 2 dt c <= 4, which is
    dt <= 2/omega (sqrt(1 + xi^2) - xi), xi = c/(2 omega); that the two extremes need not be one mode makes it shorter.
    """
    return 4.0 / (damping + float(np.hypot(damping, 2.0 * omega)))


def _inverse_root(mass: np.ndarray) -> np.ndarray:
    """1/sqrt(m), 0 without mass."""
    root = np.sqrt(mass)
    return np.divide(1.0, root, out=np.zeros_like(root), where=root > 0.0)


def _by_matrix(pattern: Pattern, data: np.ndarray, scale: np.ndarray, unknowns: Unknowns) -> Product:
    """Of a matrix on a pattern, scaled in place on both sides."""
    indptr, indices = pattern.indptr.view(np.uint32), pattern.indices.view(np.uint32)
    _scale(indptr, indices, data, scale)
    matrix = Rows(indptr, indices, data)

    def product(v: np.ndarray, previous: np.ndarray, beta: float, following: np.ndarray) -> None:
        _product(matrix, v, previous, beta, unknowns.counted, following)

    return product


def _by_forces(momentum: Momentum, free: np.ndarray, u: np.ndarray, scale: np.ndarray, unknowns: Unknowns) -> Product:
    """Of the derivative of the force at `u`, scaled on both sides."""
    derivative, d = momentum.along(u), np.zeros_like(u)

    def product(v: np.ndarray, previous: np.ndarray, beta: float, following: np.ndarray) -> None:
        d.reshape(-1)[free] = scale * v
        np.multiply(scale, derivative(d).reshape(-1)[free], out=following)
        following[unknowns.counted] -= beta * previous[unknowns.counted]

    return product


def _greatest(product: Product, unknowns: Unknowns, start: np.ndarray | None,
              tolerance: float) -> tuple[float, np.ndarray]:
    """Greatest eigenvalue of a symmetric matrix, of which a `product` is given, and its vector."""
    # The highest mode sits in one element, and the next one may sit in another, where the last result is zero: add
    # a vector that reaches everywhere, has no symmetry, and is the same every time.
    everywhere = np.sin(1.0 + unknowns.numbers * 2.399963) * np.sqrt(2.0 / unknowns.size)
    start = everywhere if start is None else everywhere + start
    start = start / np.sqrt(unknowns.dot(start, start))
    return _lanczos(product, unknowns, start, tolerance)


def _lanczos(product: Product, unknowns: Unknowns, start: np.ndarray, tolerance: float) -> tuple[float, np.ndarray]:
    """Greatest eigenvalue of a symmetric matrix, and its vector.

    Its residual |A x - value x| is at most `tolerance` of it. The vectors lose their orthogonality, which gives an
    eigenvalue that has been found a second time, but none that is wrong.
    """
    residual = np.inf
    kept: np.ndarray = np.empty((STEPS, start.size))  # memory is taken as they are written
    for _ in range(RESTARTS):
        kept[0], count = start, 1
        diagonal: list[float] = []
        beside: list[float] = []
        previous, beta, following = np.zeros_like(start), 0.0, np.empty_like(start)
        while True:
            last_one = kept[count - 1]
            product(last_one, previous, beta, following)
            unknowns.whole(following)
            alpha = unknowns.total(_along(following, last_one, unknowns.counted))
            beta = float(np.sqrt(unknowns.total(_without(following, last_one, alpha, unknowns.counted))))
            if beta > 0.0:
                following /= beta
            if not np.isfinite(alpha + beta):
                raise InstabilityError("the tangent of the body is not finite: the explicit integration has blown up")
            diagonal.append(alpha)
            last = len(diagonal) - 1
            values, modes = la.eigh_tridiagonal(diagonal, beside, select="i", select_range=(last, last))
            residual = beta * abs(modes[-1, 0]) / max(abs(values[0]), 1e-300)
            if not residual > tolerance or count == STEPS:
                break
            previous, kept[count] = last_one, following
            beside.append(beta)
            count += 1
        start = modes[:, 0] @ kept[:count]
        start /= np.sqrt(unknowns.dot(start, start))
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
def _product(A, v, previous, beta, counted, following):  # type: ignore[no-untyped-def]
    """following = A v - beta previous for the upper triangle of A, of a part of a body its share."""
    for i in range(v.size):
        following[i] = -beta * previous[i] if counted[i] else 0.0
    add_symmetric_product(A.indptr, A.indices, A.data, v, following)


@njit(cache=True)
def _along(following, v, counted):  # type: ignore[no-untyped-def]
    """alpha = following . v over what counts."""
    alpha = 0.0
    for i in range(v.size):
        if counted[i]:
            alpha += following[i] * v[i]
    return alpha


@njit(cache=True)
def _without(following, v, alpha, counted):  # type: ignore[no-untyped-def]
    """following -= alpha v; returns its square over what counts."""
    square = 0.0
    for i in range(v.size):
        following[i] -= alpha * v[i]
        if counted[i]:
            square += following[i] * following[i]
    return square
