"""Cofactors of a small matrix, in compiled loops over elements of two or three dimensions."""

from __future__ import annotations

from ...system.jit import njit

__all__ = ["cofactor"]


@njit(cache=True)
def cofactor(F, C):  # type: ignore[no-untyped-def]
    """Cofactors of F (dim, dim) into C; returns its determinant."""
    if F.shape[0] == 2:
        C[0, 0], C[0, 1], C[1, 0], C[1, 1] = F[1, 1], -F[1, 0], -F[0, 1], F[0, 0]
    else:
        for i in range(3):
            m, n = (i + 1) % 3, (i + 2) % 3
            for k in range(3):
                r, s = (k + 1) % 3, (k + 2) % 3
                C[i, k] = F[m, r] * F[n, s] - F[m, s] * F[n, r]
    det = 0.0
    for k in range(F.shape[0]):
        det += F[0, k] * C[0, k]
    return det
