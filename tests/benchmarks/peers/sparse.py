"""Sparse direct solvers for libraries that hand over a SciPy matrix."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse.linalg import spsolve

__all__ = ["SOLVERS", "corrected"]


def _pardiso(K: Any, b: np.ndarray) -> np.ndarray:
    import pypardiso

    return np.asarray(pypardiso.spsolve(K.tocsr(), b))


SOLVERS = {"SuperLU": spsolve, "PARDISO": _pardiso}


def corrected(K: Any, force: np.ndarray, move: np.ndarray, held: np.ndarray, solver: str) -> np.ndarray:
    """Newton correction with the whole tangent `K`: `move` at the grips, the solution of the free rows elsewhere."""
    K, free = K.tocsr(), np.flatnonzero(~held.ravel())
    rows = K[free]
    d = move.ravel().copy()
    d[free] = SOLVERS[solver](rows[:, free], -force.ravel()[free] - rows @ d)
    return d.reshape(move.shape)
