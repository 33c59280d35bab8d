"""Mass, Laplacian and weighted mass matrices on a fixed pattern."""

from __future__ import annotations

import numpy as np

from ...system.jit import njit
from ..pattern import Pattern
from ..space import Space

__all__ = ["laplacian", "mass", "weighted_mass"]


def laplacian(space: Space, pattern: Pattern, coefficient: float) -> np.ndarray:
    """Data of  int coefficient Grad N_a . Grad N_b  on a scalar pattern (first term of Eq. 24)."""
    data = np.zeros(pattern.nnz)
    for some in space.chunks():
        _laplacian(space.slopes(some), space.w[some], coefficient, pattern.slots(some), data)
    return data


def weighted_mass(space: Space, pattern: Pattern, weight: np.ndarray) -> np.ndarray:
    """Data of  int weight N_a N_b  on a scalar pattern; `weight` (ne, nq) (second term of Eq. 24)."""
    data = np.zeros(pattern.nnz)
    _mass(space.N, space.w, np.ascontiguousarray(weight), 1, pattern.slot, data)
    return data


def mass(space: Space, pattern: Pattern, gamma: np.ndarray, rho0: float | np.ndarray) -> np.ndarray:
    """Data of the consistent mass matrix  int gamma rho0 N_a N_b I  (Eq. 28) on a displacement pattern.

    `rho0` [t/mm^3] is a number, or one for each element, (ne, 1).
    """
    data = np.zeros(pattern.nnz)
    weight = gamma * rho0
    for some in space.chunks():
        _mass(space.N, space.w[some], weight[some], space.dim, pattern.slots(some), data)
    return data


@njit(cache=True)
def _laplacian(dN, w, coefficient, slot, data):  # type: ignore[no-untyped-def]
    ne, nq, na, dim = dN.shape
    for e in range(ne):
        for a in range(na):
            for b in range(na):
                k = slot[e, a, b]
                if k < 0:
                    continue
                total = 0.0
                for q in range(nq):
                    for i in range(dim):
                        total += w[e, q] * dN[e, q, a, i] * dN[e, q, b, i]
                data[k] += coefficient * total


@njit(cache=True)
def _mass(N, w, weight, block, slot, data):  # type: ignore[no-untyped-def]
    ne, nq = w.shape
    na = N.shape[1]
    for e in range(ne):
        for a in range(na):
            for b in range(na):
                total = 0.0
                for q in range(nq):
                    total += w[e, q] * weight[e, q] * N[q, a] * N[q, b]
                for i in range(block):
                    k = slot[e, block * a + i, block * b + i]
                    if k >= 0:
                        data[k] += total
