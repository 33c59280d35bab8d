"""Points of the unit square and cube at which forms are integrated, and the shape functions there.

A rule has 2 points in each direction, all of one weight. Along an axis they are those of Gauss, or the ends of the
element. Both are exact for linear functions along an axis; with Gauss points in all directions, the rule of all other
forms, for cubic ones.
"""

from __future__ import annotations

import numpy as np

__all__ = ["AXES", "points", "shape_functions"]

#: reference axes in scikit-fem's numbering; its hexahedra are left-handed, so the first two change places
AXES = {2: [0, 1], 3: [1, 0, 2]}
GAUSS = 0.5 - 0.5 / np.sqrt(3.0)  # abscissa of the first Gauss point on [0, 1]


def points(dim: int, ends: int = 0) -> np.ndarray:
    """Points (nq, dim) on [0, 1], the first coordinate running fastest: the point q is next to the node q.

    Along axis i they are the ends of the element where bit i of `ends` is set, else Gauss points.
    """
    upper = (np.arange(2**dim)[:, None] >> np.arange(dim)) & 1
    first = np.where((ends >> np.arange(dim)) & 1, 0.0, GAUSS)
    found: np.ndarray = np.where(upper, 1 - first, first)
    return found


def shape_functions(xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shape functions (nq, na) and their reference gradients (nq, na, dim) at the points `xi` (nq, dim)."""
    dim = xi.shape[1]
    upper = (np.arange(2**dim)[:, None] >> np.arange(dim)) & 1
    factor = np.where(upper[None], xi[:, None], 1 - xi[:, None])       # (q, a, i): value along direction i
    slope = np.where(upper, 1.0, -1.0)
    N = factor.prod(axis=2)
    dN = np.stack([slope[:, i] * np.delete(factor, i, axis=2).prod(axis=2) for i in range(dim)], axis=2)
    return N, dN
