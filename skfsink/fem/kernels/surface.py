"""Compiled loops over facets of the deformed surface: a pressure on them, its derivative, the volume they sweep.

With the order of nodes of :mod:`skfsink.fem.facets` the area vector n dA of the edge from x_0 to x_1 is (dy, -dx), and
that of a face x,s × x,t ds dt. Products of shape functions with it are polynomials, which 2 x 2 Gauss points integrate
exactly; along a straight motion the area vector is of second order, and two points integrate it exactly as well. An
edge of a body of revolution, `revolved`, is a ring: n da is 2 pi r (dy, -dx), of one order more, which two points still
integrate exactly.
"""

from __future__ import annotations

import numpy as np

from ...system.jit import njit

__all__ = ["add_pressure", "pressure_tangents", "swept_volumes"]

_G = 0.5 - 0.5 / np.sqrt(3.0)
#: the two Gauss points of the unit interval
GAUSS = np.array([_G, 1.0 - _G])
_s, _t = np.tile(GAUSS, 2), np.repeat(GAUSS, 2)
#: shape functions of a face at its 2 x 2 points, and their derivatives with s and t, (4 points, 4 nodes)
N = np.stack([(1 - _s) * (1 - _t), _s * (1 - _t), (1 - _s) * _t, _s * _t], axis=1)
DS = np.stack([_t - 1, 1 - _t, -_t, _t], axis=1)
DT = np.stack([_s - 1, -_s, 1 - _s, _s], axis=1)


@njit(cache=True)
def add_pressure(facets, p, x, out, revolved):  # type: ignore[no-untyped-def]
    """out (n, dim) += p int N_a n da over the `facets` (f, k) at the positions `x` (n, dim); `p` (f,) [MPa]."""
    if revolved:
        for f in range(facets.shape[0]):
            a, b = facets[f, 0], facets[f, 1]
            for s in GAUSS:
                c = np.pi * p[f] * ((1.0 - s) * x[a, 0] + s * x[b, 0])  # half a way around
                nx, ny = c * (x[b, 1] - x[a, 1]), -c * (x[b, 0] - x[a, 0])
                out[a, 0] += (1.0 - s) * nx
                out[a, 1] += (1.0 - s) * ny
                out[b, 0] += s * nx
                out[b, 1] += s * ny
        return
    if facets.shape[1] == 2:
        for f in range(facets.shape[0]):
            a, b = facets[f, 0], facets[f, 1]
            nx, ny = 0.5 * p[f] * (x[b, 1] - x[a, 1]), -0.5 * p[f] * (x[b, 0] - x[a, 0])
            out[a, 0] += nx
            out[a, 1] += ny
            out[b, 0] += nx
            out[b, 1] += ny
        return
    s, t, n = np.empty(3), np.empty(3), np.empty(3)
    for f in range(facets.shape[0]):
        for q in range(4):
            _tangents(facets[f], x, q, s, t)
            _cross(s, t, n)
            for a in range(4):
                for i in range(3):
                    out[facets[f, a], i] += 0.25 * p[f] * N[q, a] * n[i]


@njit(cache=True)
def swept_volumes(facets, x, dx, weights, out, revolved):  # type: ignore[no-untyped-def]
    """out (f,) = -int w int n . dx da: volume that facets sweep against their normal on the straight way x to x + dx.

    The weight w goes linearly from weights[0] to weights[1] on the way; both are 1 for the volume itself.
    """
    if revolved:
        for f in range(facets.shape[0]):
            a, b = facets[f, 0], facets[f, 1]
            total = 0.0
            for g in GAUSS:
                ra, rb = x[a, 0] + g * dx[a, 0], x[b, 0] + g * dx[b, 0]
                ez = x[b, 1] + g * dx[b, 1] - x[a, 1] - g * dx[a, 1]
                w = weights[0, f] + g * (weights[1, f] - weights[0, f])
                for s in GAUSS:
                    ur, uz = (1.0 - s) * dx[a, 0] + s * dx[b, 0], (1.0 - s) * dx[a, 1] + s * dx[b, 1]
                    total += 0.5 * np.pi * w * ((1.0 - s) * ra + s * rb) * (ez * ur - (rb - ra) * uz)
            out[f] = -total
        return
    if facets.shape[1] == 2:
        for f in range(facets.shape[0]):
            a, b = facets[f, 0], facets[f, 1]
            total = 0.0
            for g in GAUSS:
                ex = x[b, 0] + g * dx[b, 0] - x[a, 0] - g * dx[a, 0]
                ey = x[b, 1] + g * dx[b, 1] - x[a, 1] - g * dx[a, 1]
                w = weights[0, f] + g * (weights[1, f] - weights[0, f])
                total += 0.25 * w * (ey * (dx[a, 0] + dx[b, 0]) - ex * (dx[a, 1] + dx[b, 1]))
            out[f] = -total
        return
    s, t, n = np.empty(3), np.empty(3), np.empty(3)
    now = np.empty((4, 3))
    four = np.arange(4)
    for f in range(facets.shape[0]):
        total = 0.0
        for g in GAUSS:
            w = weights[0, f] + g * (weights[1, f] - weights[0, f])
            for a in range(4):
                for i in range(3):
                    now[a, i] = x[facets[f, a], i] + g * dx[facets[f, a], i]
            for q in range(4):
                _tangents(four, now, q, s, t)
                _cross(s, t, n)
                for a in range(4):
                    for i in range(3):
                        total += 0.125 * w * N[q, a] * n[i] * dx[facets[f, a], i]
        out[f] = -total


@njit(cache=True)
def pressure_tangents(facets, p, x, out, revolved):  # type: ignore[no-untyped-def]
    """out (f, k*dim, k*dim) = derivative of p int N_a n da with the positions of the nodes; not symmetric."""
    out[...] = 0.0
    if revolved:
        shape = np.empty(2)
        for f in range(facets.shape[0]):
            one, two = facets[f, 0], facets[f, 1]
            er, ez = x[two, 0] - x[one, 0], x[two, 1] - x[one, 1]
            for s in GAUSS:
                shape[0], shape[1] = 1.0 - s, s
                r = shape[0] * x[one, 0] + shape[1] * x[two, 0]
                for a in range(2):
                    c = np.pi * p[f] * shape[a]
                    for b in range(2):
                        turn = c * r if b == 1 else -c * r
                        out[f, 2 * a, 2 * b] += c * shape[b] * ez
                        out[f, 2 * a, 2 * b + 1] += turn
                        out[f, 2 * a + 1, 2 * b] -= turn + c * shape[b] * er
        return
    if facets.shape[1] == 2:
        for f in range(facets.shape[0]):
            for a in range(2):
                for b in range(2):
                    sign = 0.5 * p[f] if b == 1 else -0.5 * p[f]
                    out[f, 2 * a, 2 * b + 1] = sign
                    out[f, 2 * a + 1, 2 * b] = -sign
        return
    s, t, d = np.empty(3), np.empty(3), np.empty(3)
    for f in range(facets.shape[0]):
        for q in range(4):
            _tangents(facets[f], x, q, s, t)
            for b in range(4):
                for i in range(3):  # x,s × x,t moves by d × when node b moves
                    d[i] = DS[q, b] * t[i] - DT[q, b] * s[i]
                for a in range(4):
                    c = 0.25 * p[f] * N[q, a]
                    # e_j × d, column by column
                    out[f, 3 * a + 1, 3 * b] -= c * d[2]
                    out[f, 3 * a + 2, 3 * b] += c * d[1]
                    out[f, 3 * a, 3 * b + 1] += c * d[2]
                    out[f, 3 * a + 2, 3 * b + 1] -= c * d[0]
                    out[f, 3 * a, 3 * b + 2] -= c * d[1]
                    out[f, 3 * a + 1, 3 * b + 2] += c * d[0]


@njit(cache=True)
def _tangents(nodes, x, q, s, t):  # type: ignore[no-untyped-def]
    for i in range(3):
        s[i] = t[i] = 0.0
        for a in range(4):
            s[i] += DS[q, a] * x[nodes[a], i]
            t[i] += DT[q, a] * x[nodes[a], i]


@njit(cache=True)
def _cross(s, t, n):  # type: ignore[no-untyped-def]
    n[0] = s[1] * t[2] - s[2] * t[1]
    n[1] = s[2] * t[0] - s[0] * t[2]
    n[2] = s[0] * t[1] - s[1] * t[0]
