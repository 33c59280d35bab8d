"""Places in a body: the elements that hold points, and the shape functions there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import ParameterError, place_text
from .quadrature import shape_functions
from .space import Space

__all__ = ["Places", "find_places"]

ROUNDING = 1e-6   # of the size of an element: a point that far outside of it counts as in it
_STEPS = 30       # of Newton's method


class Places(NamedTuple):
    """Points in elements.

    Attributes
    ----------
    elements: that hold them, (m,).
    N: shape functions of their nodes there, (m, na).
    """

    elements: np.ndarray
    N: np.ndarray

    def at(self, space: Space, nodal: np.ndarray) -> np.ndarray:
        """Values (m, ...) of the Q1 field with nodal values (n, ...)."""
        values: np.ndarray = np.einsum("ma,ma...->m...", self.N, nodal[space.conn[self.elements]])
        return values


def find_places(space: Space, points: np.ndarray) -> Places:
    """The elements that hold the points (m, dim) [mm] of the undeformed body; of several the one of least number.

    Raises
    ------
    ParameterError
        A point is outside of the body; the line begins with it.
    """
    elements, N = np.empty(len(points), int), np.empty((len(points), space.conn.shape[1]))
    corners = space.X[space.conn]
    low, high = corners.min(axis=1), corners.max(axis=1)
    slack = ROUNDING * (high - low).max(axis=1, keepdims=True)
    for i, point in enumerate(points):
        near = np.flatnonzero(((point >= low - slack) & (point <= high + slack)).all(axis=1))
        xi = _reference(corners[near], point)
        inside = np.flatnonzero((np.abs(xi - 0.5) <= 0.5 + ROUNDING).all(axis=1))
        if not inside.size:
            node = int(np.argmin(np.linalg.norm(space.X - point, axis=1)))
            raise ParameterError(f"{place_text(point)} mm is outside of the body, whose nearest node is at "
                                 f"{place_text(space.X[node])} mm")
        elements[i] = near[inside[0]]
        N[i] = shape_functions(np.clip(xi[inside[:1]], 0.0, 1.0))[0][0]
    return Places(elements, N)


def _reference(corners: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Reference coordinates (m, dim) of a point in elements with `corners` (m, na, dim), NaN where none were found."""
    dim = corners.shape[2]
    size = np.ptp(corners, axis=1).max(axis=1)
    xi = np.full((len(corners), dim), 0.5)
    for _ in range(_STEPS):
        N, dN = shape_functions(xi)
        gap = point - np.einsum("ma,mai->mi", N, corners)
        if (np.linalg.norm(gap, axis=1) <= 1e-12 * size).all():
            break
        J = np.einsum("mai,mak->mik", corners, dN)
        flat = np.abs(np.linalg.det(J)) < 1e-12 * size**dim
        J[flat] = np.eye(dim) * size[flat, None, None]
        xi = np.clip(xi + np.linalg.solve(J, gap[..., None])[..., 0], -1.0, 2.0)
    gap = point - np.einsum("ma,mai->mi", shape_functions(xi)[0], corners)
    xi[np.linalg.norm(gap, axis=1) > 1e-9 * size] = np.nan
    return xi
