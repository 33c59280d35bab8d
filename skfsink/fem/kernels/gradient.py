"""The gradient term of the mass balance without positive off-diagonals, element by element (theory, Sec. 5).

An element that has none at the Gauss points keeps that matrix G. Others blend it with V_s, the matrix of a rule whose
points lie at the ends of the element along some of its axes s:

    K(t, s) = (1 - t) G + t V_s,   0 <= t <= 1.

All of them are quadratures of the same integral. Of s and t those are taken whose positive off-diagonals have the least
sum, and of several such the least trace. What is still positive, D = max(0, off-diagonals), becomes a flux between its
two nodes:  K - D + diag(D 1), which is symmetric, has no row sums and no negative eigenvalues. Rules whose Jacobian is
not positive at all points, as at the corner of an element that is not convex, are left out. In a body of revolution all
rules have the weight 2 pi R.
"""

from __future__ import annotations

import numpy as np

from ...system.jit import njit
from ..pattern import Pattern
from ..quadrature import points, shape_functions
from ..space import Space
from .cofactor import cofactor

__all__ = ["LEAST_JACOBIAN", "monotone", "monotone_laplacian"]

ROUNDING = 1e-12         # of the trace: sums of off-diagonals, and traces, that differ by less are equal
LEAST_JACOBIAN = 1e-6    #: of the mean one, at the points of a rule that is used


def monotone_laplacian(space: Space, pattern: Pattern, coefficient: float) -> np.ndarray:
    """Data of  int coefficient Grad N_a . Grad N_b  on a scalar pattern, without positive off-diagonals."""
    data = np.zeros(pattern.nnz)
    rules = [shape_functions(points(space.dim, ends)) for ends in range(1, 2**space.dim)]
    N, gradients = (np.array(values) for values in zip(*rules))
    for some in space.chunks():
        _laplacian(space.X[space.conn[some]], space.slopes(some), (space.w[some], space.dX[some]),
                   (N, gradients, space.axisymmetric), coefficient, pattern.slots(some), data)
    return data


def monotone(matrices: np.ndarray, usable: np.ndarray) -> np.ndarray:
    """Element matrices (ne, na, na) without positive off-diagonals, of those of the rules, (ne, rules, na, na).

    The first rule is that of Gauss; the others count where they are `usable`, (ne, rules).
    """
    out = np.empty_like(matrices[:, 0])
    _monotone(np.ascontiguousarray(matrices), np.ascontiguousarray(usable), out)
    return out


@njit(cache=True)
def _monotone(matrices, usable, out):  # type: ignore[no-untyped-def]
    for e in range(matrices.shape[0]):
        _blend(matrices[e], usable[e], out[e])
        _move(out[e])


@njit(cache=True)
def _laplacian(x, dN, weights, ends, coefficient, slot, data):  # type: ignore[no-untyped-def]
    w, dX = weights
    N, gradients, revolved = ends
    ne, nq, na, dim = dN.shape
    rules = 1 + gradients.shape[0]
    matrices, K = np.zeros((rules, na, na)), np.empty((na, na))
    usable = np.ones(rules, np.bool_)
    for e in range(ne):
        volume = 0.0
        for q in range(nq):
            volume += dX[e, q]
        for a in range(na):
            for b in range(na):
                total = 0.0
                for q in range(nq):
                    for i in range(dim):
                        total += w[e, q] * dN[e, q, a, i] * dN[e, q, b, i]
                matrices[0, a, b] = total
        if _positive(matrices[0], matrices[0], 0.0) > 0.0:
            for s in range(1, rules):
                rule = N[s - 1], gradients[s - 1], revolved
                usable[s] = _stiffness(x[e], rule, LEAST_JACOBIAN * volume, matrices[s])
        _blend(matrices, usable, K)
        _move(K)
        for a in range(na):
            for b in range(na):
                if slot[e, a, b] >= 0:
                    data[slot[e, a, b]] += coefficient * K[a, b]


@njit(cache=True)
def _stiffness(x, rule, least, K):  # type: ignore[no-untyped-def]
    """Int Grad N_a . Grad N_b by a rule with reference `gradients` (nq, na, dim); False if a Jacobian is too small."""
    N, gradients, revolved = rule
    nq, na, dim = gradients.shape
    J, C, c = np.empty((dim, dim)), np.empty((dim, dim)), np.empty((na, dim))
    K[:] = 0.0
    for q in range(nq):
        J[:] = 0.0
        for a in range(na):
            for i in range(dim):
                for k in range(dim):
                    J[i, k] += x[a, i] * gradients[q, a, k]
        det = cofactor(J, C)
        if det <= least:
            return False
        for a in range(na):
            for i in range(dim):
                c[a, i] = 0.0
                for k in range(dim):
                    c[a, i] += C[i, k] * gradients[q, a, k]
        scale = nq * det
        if revolved:
            radius = 0.0
            for a in range(na):
                radius += N[q, a] * x[a, 0]
            scale /= 2.0 * np.pi * max(radius, 1e-300)
        for a in range(na):
            for b in range(na):
                total = 0.0
                for i in range(dim):
                    total += c[a, i] * c[b, i]
                K[a, b] += total / scale
    return True


@njit(cache=True)
def _blend(matrices, usable, K):  # type: ignore[no-untyped-def]
    """The blend with the least sum of positive off-diagonals, and of several the one with the least trace, into K."""
    G = matrices[0]
    K[:] = G
    least, trace = _positive(G, G, 0.0), _trace(G)
    equal = ROUNDING * trace
    if least <= equal:
        return
    shares = np.empty(1 + G.size // 2)
    for s in range(1, matrices.shape[0]):
        if not usable[s]:
            continue
        V = matrices[s]
        for t in shares[:_corners(G, V, shares)]:
            found, size = _positive(G, V, t), (1.0 - t) * _trace(G) + t * _trace(V)
            if found < least - equal or (found <= least + equal and size < trace - equal):
                least, trace = min(found, least), size
                K[:] = (1.0 - t) * G + t * V


@njit(cache=True)
def _corners(G, V, shares):  # type: ignore[no-untyped-def]
    """Shares t > 0 at which the sum of positive off-diagonals can be least, into `shares`; returns their number.

    It is linear in between: they are 1, and those at which an off-diagonal changes its sign.
    """
    shares[0], count = 1.0, 1
    for a in range(G.shape[0]):
        for b in range(a):
            if (G[a, b] > 0.0) != (V[a, b] > 0.0):
                shares[count] = G[a, b] / (G[a, b] - V[a, b])
                count += 1
    return count


@njit(cache=True)
def _positive(G, V, t):  # type: ignore[no-untyped-def]
    """Sum of the positive off-diagonals of (1 - t) G + t V."""
    total = 0.0
    for a in range(G.shape[0]):
        for b in range(a):
            total += max(0.0, (1.0 - t) * G[a, b] + t * V[a, b])
    return total


@njit(cache=True)
def _trace(K):  # type: ignore[no-untyped-def]
    total = 0.0
    for a in range(K.shape[0]):
        total += K[a, a]
    return total


@njit(cache=True)
def _move(K):  # type: ignore[no-untyped-def]
    """K - D + diag(D 1), D the positive off-diagonals of K, in place."""
    for a in range(K.shape[0]):
        for b in range(a):
            if K[a, b] > 0.0 or K[b, a] > 0.0:
                D = 0.5 * (K[a, b] + K[b, a])
                K[a, a] += D
                K[b, b] += D
                K[a, b] = K[b, a] = 0.0
