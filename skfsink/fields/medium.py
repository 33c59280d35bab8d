"""The third medium: the energy of elements without force between the lips of a crack, as one of thin strips.

An element of the medium is a strip between two lips with the normal N of the undeformed crack. Its thickness over the
undeformed one is J_bar/a, where a is the stretch of the lips along it: |F T| in 2D, |F T1 x F T2| in 3D, T tangents and
F the mean deformation gradient. Lips that slide leave it as it is, and so do lips that stretch. It lacks the share

    d = r s(a) - J_bar,     s = 1 + c (cap(a) - 1),     cap = a (a < 1),  1 + (a - 1)/(1 + (a - 1)/M) beyond,

of its volume; r is 1 in general (see :meth:`.Contact.renew`), c in [0, 1] says how sure N is. Where it is not, d is
that of a fluid. An element that is sheared along a wrong N seems to have long lips: cap < 1 + M bounds that. The energy
is V mu psi(d), that of the incompressible neo-Hookean solid pressed to the thickness 1 - d,

    psi' = (1 - d)^-n - (1 - d) (d < 0: 0),    n = 3 in plane strain (2D), 2 in uniaxial stress (3D),

so that a strip bears like the solid that was there; past D psi'' stays what it is there, which drives back a strip that
is inside out. psi and psi' are continuous, finite and monotone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..fem.kernels.cofactor import cofactor
from ..fem.space import Space
from ..system.jit import njit

__all__ = ["Law", "Strips", "depth", "missing", "psi", "pulls", "push", "stiffest"]

FROM = 0.4  # D
CAP = 2.0   # M


class Strips(NamedTuple):
    """All elements as strips.

    Attributes
    ----------
    conn: nodes (ne, na).   dN: gradients of shape functions at Gauss points [1/mm], (ne, nq, na, dim).
    w: volumes of Gauss points [mm^dim], (ne, nq).   slopes: means of `dN`, (ne, na, dim).
    """

    conn: np.ndarray
    dN: np.ndarray
    w: np.ndarray
    slopes: np.ndarray

    @classmethod
    def of(cls, space: Space) -> Strips:
        """Those of a mesh."""
        return cls(space.conn, space.dN, space.w, space.mean_slopes())


class Law(NamedTuple):
    """What the energy of each element depends on beside its deformation.

    Attributes
    ----------
    modulus: mu [MPa], (ne,).   rest: r, (ne,).   tangents: T (ne, dim-1, dim).   sure: c, (ne,).
    n: exponent.
    """

    modulus: np.ndarray
    rest: np.ndarray
    tangents: np.ndarray
    sure: np.ndarray
    n: int


@njit(cache=True)
def psi(d, n):  # type: ignore[no-untyped-def]
    """psi, psi' and psi'' at `d`."""
    if d <= 0.0:
        return 0.0, 0.0, 0.0
    past = max(d - FROM, 0.0)
    left = 1.0 - d + past
    power = left**-n
    energy = 0.5 * (left * left - 1.0) + (power * left - 1.0) / (n - 1)
    force, stiffness = power - left, 1.0 + n * power / left
    return energy + past * (force + 0.5 * stiffness * past), force + stiffness * past, stiffness


def depth(energy: np.ndarray, n: int) -> np.ndarray:
    """The d >= 0 at which psi is `energy`, by Newton's method from above: psi is convex."""
    most, force, stiffness = psi(FROM, n)
    past = (np.sqrt(np.maximum(force**2 + 2 * stiffness * (energy - most), 0.0)) - force) / stiffness
    d = np.sqrt(2 * np.minimum(energy, most) / (1 + n))  # psi > (1 + n) d^2/2
    for _ in range(30):
        left = 1.0 - d
        slope = left**-n - left
        excess = 0.5 * (left**2 - 1) + (left ** (1 - n) - 1) / (n - 1) - np.minimum(energy, most)
        d = d - np.divide(excess, slope, out=np.zeros_like(d), where=slope > 0.0)
    return np.where(energy < most, d, FROM + past)


@njit(cache=True)
def _capped(a):  # type: ignore[no-untyped-def]
    """cap(a) and its derivative."""
    if a < 1.0:
        return a, 1.0
    z = 1.0 + (a - 1.0) / CAP
    return 1.0 + (a - 1.0) / z, 1.0 / (z * z)


@njit(cache=True)
def _cross(p, q, out):  # type: ignore[no-untyped-def]
    out[0] = p[1] * q[2] - p[2] * q[1]
    out[1] = p[2] * q[0] - p[0] * q[2]
    out[2] = p[0] * q[1] - p[1] * q[0]


@njit(cache=True)
def _lip(x, nodes, slopes, tangents, sides, turn):  # type: ignore[no-untyped-def]
    """The stretch a; F T of each tangent into `sides`, and da/d(F T) into `turn`, (dim-1, dim) both."""
    dim = x.shape[1]
    sides[...] = 0.0
    for n in range(nodes.size):
        for t in range(dim - 1):
            along = 0.0
            for k in range(dim):
                along += slopes[n, k] * tangents[t, k]
            for i in range(dim):
                sides[t, i] += x[nodes[n], i] * along
    if dim == 2:
        a = np.sqrt(sides[0, 0] ** 2 + sides[0, 1] ** 2)
        turn[0] = sides[0] / max(a, 1e-12)
        return a
    face = np.empty(3)
    _cross(sides[0], sides[1], face)
    a = np.sqrt(face[0] ** 2 + face[1] ** 2 + face[2] ** 2)
    face /= max(a, 1e-12)
    _cross(sides[1], face, turn[0])
    _cross(face, sides[0], turn[1])
    return a


@njit(cache=True)
def _gradient(x, nodes, slopes, F):  # type: ignore[no-untyped-def]
    """F at a Gauss point from the positions of the nodes and the `slopes` of shape functions."""
    dim = x.shape[1]
    F[...] = 0.0
    for a in range(nodes.size):
        for i in range(dim):
            for k in range(dim):
                F[i, k] += x[nodes[a], i] * slopes[a, k]


@njit(cache=True)
def missing(x, strips, law, medium, out):  # type: ignore[no-untyped-def]
    """d, J_bar and energy of the elements `medium` at the positions `x` (n, dim), into `out` (3, medium)."""
    dim = x.shape[1]
    F, C = np.empty((dim, dim)), np.empty((dim, dim))
    sides, turn = np.empty((dim - 1, dim)), np.empty((dim - 1, dim))
    for m in range(medium.size):
        e = medium[m]
        nodes, size, volume = strips.conn[e], strips.w[e].sum(), 0.0
        if dim == 2:  # half the product of the diagonals
            a, b, c, d = nodes
            volume = 0.5 * ((x[d, 0] - x[a, 0]) * (x[c, 1] - x[b, 1]) - (x[d, 1] - x[a, 1]) * (x[c, 0] - x[b, 0]))
        else:
            for q in range(strips.w.shape[1]):
                _gradient(x, nodes, strips.dN[e, q], F)
                volume += strips.w[e, q] * cofactor(F, C)
        lip = _lip(x, nodes, strips.slopes[e], law.tangents[e], sides, turn)
        out[1, m] = volume / size
        out[0, m] = law.rest[e] * (1.0 + law.sure[e] * (_capped(lip)[0] - 1.0)) - out[1, m]
        out[2, m] = size * law.modulus[e] * psi(out[0, m], law.n)[0]


@njit(cache=True)
def _work(dim):  # type: ignore[no-untyped-def]
    """Scratch of `_pull`: F and its cofactors, (dim, dim); sides and turn of :func:`_lip`, (dim-1, dim)."""
    return np.empty((dim, dim)), np.empty((dim, dim)), np.empty((dim - 1, dim)), np.empty((dim - 1, dim))


@njit(cache=True)
def _pull(x, strips, law, e, work, out):  # type: ignore[no-untyped-def]
    """V dd/du of an element into `out` (na, dim); `work` is that of `_work`. Returns a."""
    F, C, sides, turn = work
    dim, nodes, size = x.shape[1], strips.conn[e], strips.w[e].sum()
    lip = _lip(x, nodes, strips.slopes[e], law.tangents[e], sides, turn)
    share = size * law.rest[e] * law.sure[e] * _capped(lip)[1]
    for n in range(nodes.size):
        out[n] = 0.0
        for t in range(dim - 1):
            along = 0.0
            for k in range(dim):
                along += strips.slopes[e, n, k] * law.tangents[e, t, k]
            for i in range(dim):
                out[n, i] += share * along * turn[t, i]
    for q in range(strips.w.shape[1]):
        _gradient(x, nodes, strips.dN[e, q], F)
        cofactor(F, C)
        for i in range(dim):
            for k in range(dim):
                for n in range(nodes.size):
                    out[n, i] -= strips.w[e, q] * C[i, k] * strips.dN[e, q, n, k]
    return lip


@njit(cache=True)
def push(x, strips, law, medium, found, out):  # type: ignore[no-untyped-def]
    """:func:`missing` into `found`, and the derivative of the energy of the elements `medium` into `out` (n, dim)."""
    dim = x.shape[1]
    missing(x, strips, law, medium, found)
    d = found[0]
    work = _work(dim)
    pull = np.empty((strips.conn.shape[1], dim))
    out[...] = 0.0
    for m in range(medium.size):
        if d[m] <= 0.0:
            continue
        e = medium[m]
        _pull(x, strips, law, e, work, pull)
        pressure = law.modulus[e] * psi(d[m], law.n)[1]
        for n in range(pull.shape[0]):
            for i in range(dim):
                out[strips.conn[e, n], i] += pressure * pull[n, i]


@njit(cache=True)
def pulls(x, strips, law, pressed, d, out):  # type: ignore[no-untyped-def]
    """V dd/du of the elements `pressed`, times the root of mu psi''/V, into `out` (pressed, na, dim)."""
    dim = x.shape[1]
    work = _work(dim)
    for m in range(pressed.size):
        e = pressed[m]
        _pull(x, strips, law, e, work, out[m])
        out[m] *= np.sqrt(law.modulus[e] * psi(d[m], law.n)[2] / strips.w[e].sum())


@njit(cache=True)
def stiffest(x, strips, law, medium, d, inverse_mass):  # type: ignore[no-untyped-def]
    """Greatest bound of the frequency squared of an element by itself [1/s^2], with the inverse masses (n,) [1/t].

    The part of psi'' and, bounded by the traces of the second derivatives of J_bar and of a, that of psi'.
    """
    dim = x.shape[1]
    work = _work(dim)
    pull = np.empty((strips.conn.shape[1], dim))
    greatest = 0.0
    for m in range(medium.size):
        if d[m] <= 0.0:
            continue
        e = medium[m]
        lip, size = _pull(x, strips, law, e, work, pull), strips.w[e].sum()
        sides = work[2]
        _, pressure, curvature = psi(d[m], law.n)
        bent, longest = law.sure[e] * law.rest[e] * _capped(lip)[1] / max(lip, 1e-3), 1.0
        if dim == 3:
            longest = max((sides[0] ** 2).sum(), (sides[1] ** 2).sum())
            bent *= longest
        total = 0.0
        for n in range(pull.shape[0]):
            flat = (strips.slopes[e, n] ** 2).sum()
            total += (curvature * (pull[n] ** 2).sum() / size + pressure * size * flat * (bent + np.sqrt(longest))
                      ) * inverse_mass[strips.conn[e, n]]
        greatest = max(greatest, law.modulus[e] * total)
    return greatest
