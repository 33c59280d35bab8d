"""Compiled loops over facets of the deformed surface: a pressure on them, its derivative, the volume they sweep.

With the order of nodes of :mod:`skfsink.fem.facets` the area vector n dA of the edge from x_0 to x_1 is (dy, -dx), and
that of a face x,s × x,t ds dt, which is bilinear in s and t. Products of shape functions with it are integrated
exactly. Along a straight motion the area vector is of second order, and two Gauss points integrate it exactly as well,
also with a weight that goes linearly. An edge of a body of revolution, `revolved`, is a ring: n da is 2 pi r (dy, -dx),
of one order more, which two points still integrate exactly.
"""

from __future__ import annotations

import numpy as np

from ...system.jit import njit

__all__ = ["add_pressure", "pressure_tangents", "swept_volumes"]

_G = 0.5 - 0.5 / np.sqrt(3.0)
#: the two Gauss points of the unit interval
GAUSS = np.array([_G, 1.0 - _G])
_36TH = 1.0 / 36.0
_s, _t = np.tile(GAUSS, 2), np.repeat(GAUSS, 2)
#: shape functions of a face at its 2 x 2 points, and their derivatives with s and t, (4 points, 4 nodes)
N = np.stack([(1 - _s) * (1 - _t), _s * (1 - _t), (1 - _s) * _t, _s * _t], axis=1)
DS = np.stack([_t - 1, 1 - _t, -_t, _t], axis=1)
DT = np.stack([_s - 1, -_s, 1 - _s, _s], axis=1)


@njit(cache=True)
def add_pressure(facets, owner, p, X, u, out, revolved):  # type: ignore[no-untyped-def]
    """out (n, dim) += p int N_a n da over the `facets` (f, k) of the mesh with positions `X` + `u` (n, dim).

    Each has the pressure of its `owner` (f,) among `p` (loads,) [MPa].
    """
    dim = X.shape[1]
    if revolved or dim == 2:
        c = np.empty((2, 2))
        for f in range(facets.shape[0]):
            value = p[owner[f]]
            for a in range(2):
                for i in range(2):
                    c[a, i] = X[facets[f, a], i] + u[facets[f, a], i]
            one, two = facets[f, 0], facets[f, 1]
            if revolved:
                for s in GAUSS:
                    half = np.pi * value * ((1.0 - s) * c[0, 0] + s * c[1, 0])  # of the way around
                    nx, ny = half * (c[1, 1] - c[0, 1]), -half * (c[1, 0] - c[0, 0])
                    out[one, 0] += (1.0 - s) * nx
                    out[one, 1] += (1.0 - s) * ny
                    out[two, 0] += s * nx
                    out[two, 1] += s * ny
            else:
                nx, ny = 0.5 * value * (c[1, 1] - c[0, 1]), -0.5 * value * (c[1, 0] - c[0, 0])
                out[one, 0] += nx
                out[one, 1] += ny
                out[two, 0] += nx
                out[two, 1] += ny
        return
    c, n, force = np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 3))
    for f in range(facets.shape[0]):
        value = p[owner[f]]
        for a in range(4):
            for i in range(3):
                c[a, i] = X[facets[f, a], i] + u[facets[f, a], i]
        _corner_normals(c, n)
        _integrate(n, force)
        for a in range(4):
            for i in range(3):
                out[facets[f, a], i] += value * force[a, i]


@njit(cache=True)
def swept_volumes(facets, owner, weights, X, u, end, out, revolved):  # type: ignore[no-untyped-def]
    """out (f,) = -int w int n . dx da: volume that facets sweep against their normal on the way from `u` to `end`.

    The way is straight, both its ends (n, dim); the weight w of the `owner` (f,) of a facet goes linearly from
    `weights[0]` to `weights[1]`, each (loads,), and both are 1 for the volume itself.
    """
    dim = X.shape[1]
    if revolved or dim == 2:
        x, dx = np.empty((2, 2)), np.empty((2, 2))
        for f in range(facets.shape[0]):
            for a in range(2):
                for i in range(2):
                    node = facets[f, a]
                    x[a, i], dx[a, i] = X[node, i] + u[node, i], end[node, i] - u[node, i]
            total = 0.0
            for g in GAUSS:
                w = weights[0, owner[f]] + g * (weights[1, owner[f]] - weights[0, owner[f]])
                ra, rb = x[0, 0] + g * dx[0, 0], x[1, 0] + g * dx[1, 0]
                ex, ey = rb - ra, x[1, 1] + g * dx[1, 1] - x[0, 1] - g * dx[0, 1]
                if revolved:
                    for s in GAUSS:
                        ur, uz = (1.0 - s) * dx[0, 0] + s * dx[1, 0], (1.0 - s) * dx[0, 1] + s * dx[1, 1]
                        total += 0.5 * np.pi * w * ((1.0 - s) * ra + s * rb) * (ey * ur - ex * uz)
                else:
                    total += 0.25 * w * (ey * (dx[0, 0] + dx[1, 0]) - ex * (dx[0, 1] + dx[1, 1]))
            out[f] = -total
        return
    c, dc, way, now, n = (np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 3)))
    for f in range(facets.shape[0]):
        for a in range(4):
            for i in range(3):
                node = facets[f, a]
                c[a, i], dc[a, i] = X[node, i] + u[node, i], end[node, i] - u[node, i]
        _integrate(dc, way)
        total = 0.0
        for g in GAUSS:
            w = weights[0, owner[f]] + g * (weights[1, owner[f]] - weights[0, owner[f]])
            for a in range(4):
                for i in range(3):
                    now[a, i] = c[a, i] + g * dc[a, i]
            _corner_normals(now, n)
            swept = 0.0
            for a in range(4):
                for i in range(3):
                    swept += n[a, i] * way[a, i]
            total += 0.5 * w * swept
        out[f] = -total


@njit(cache=True)
def pressure_tangents(facets, p, x, out, revolved):  # type: ignore[no-untyped-def]
    """out (f, k*dim, k*dim) = derivative of p int N_a n da with the positions `x` (n, dim) of the nodes; not symmetric.

    `p` (f,) is of the facets [MPa].
    """
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
def _corner_normals(c, n):  # type: ignore[no-untyped-def]
    """n (4, 3) = x,s × x,t at the corners `c` (4, 3) of a face, between which it is bilinear."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        s0j, s1j, t0j, t1j = c[1, j] - c[0, j], c[3, j] - c[2, j], c[2, j] - c[0, j], c[3, j] - c[1, j]
        s0k, s1k, t0k, t1k = c[1, k] - c[0, k], c[3, k] - c[2, k], c[2, k] - c[0, k], c[3, k] - c[1, k]
        n[0, i], n[1, i] = s0j * t0k - s0k * t0j, s0j * t1k - s0k * t1j
        n[2, i], n[3, i] = s1j * t0k - s1k * t0j, s1j * t1k - s1k * t1j


@njit(cache=True)
def _integrate(n, out):  # type: ignore[no-untyped-def]
    """out (4, 3) = int N_a n ds dt over a face; `n` is bilinear, with the values `n` (4, 3) at the corners."""
    for i in range(3):
        y0, y1 = 2.0 * n[0, i] + n[1, i], n[0, i] + 2.0 * n[1, i]
        y2, y3 = 2.0 * n[2, i] + n[3, i], n[2, i] + 2.0 * n[3, i]
        out[0, i], out[1, i] = (2.0 * y0 + y2) * _36TH, (2.0 * y1 + y3) * _36TH
        out[2, i], out[3, i] = (y0 + 2.0 * y2) * _36TH, (y1 + 2.0 * y3) * _36TH


@njit(cache=True)
def _tangents(nodes, x, q, s, t):  # type: ignore[no-untyped-def]
    for i in range(3):
        s[i] = t[i] = 0.0
        for a in range(4):
            s[i] += DS[q, a] * x[nodes[a], i]
            t[i] += DT[q, a] * x[nodes[a], i]
