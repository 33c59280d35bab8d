"""What goes around the axis of a body of revolution, as passes between those of :mod:`.force2d`.

With the stretch f = r/R around the axis F = diag(F_plane, f), and of the plane's F, J = det F and F:F + 1 these passes
make  J f  and  F:F + f^2. The stress P = a F + b cof F is a F + b f cof F in the plane and  a f + b J_plane  around,
which pulls at the nodes with N_a/R along r. Quadrature weights are 2 pi R dA.
"""

from __future__ import annotations

from ...system.jit import njit
from .lanes import FAST, GAUSS_HIGH, GAUSS_LOW, J_FLOOR, LANES

__all__ = ["AROUND", "add_hoop_force", "hoop_stress", "hoop_stretch", "rate_around", "ratio_around", "viscous_stress"]

AROUND = 20  #: row of 1/R in the geometry of a body of revolution, after the weights; there is none in others


@njit(fastmath=FAST)
def ratio_around(z, around, f):  # type: ignore[no-untyped-def]
    """f = r/R at the Gauss points, from r at the nodes (rows 0, 2, 4, 6 of z); of velocities their v_r/R."""
    L, lo, hi = LANES, GAUSS_LOW, GAUSS_HIGH
    for i in range(L):
        x0, x1, x2, x3 = z[i], z[2 * L + i], z[4 * L + i], z[6 * L + i]
        left, right = hi * x0 + lo * x2, hi * x1 + lo * x3
        f[i] = (hi * left + lo * right) * around[i]
        f[L + i] = (lo * left + hi * right) * around[L + i]
        left, right = lo * x0 + hi * x2, lo * x1 + hi * x3
        f[2 * L + i] = (hi * left + lo * right) * around[2 * L + i]
        f[3 * L + i] = (lo * left + hi * right) * around[3 * L + i]


@njit(fastmath=FAST)
def hoop_stretch(f, J, floored, tr):  # type: ignore[no-untyped-def]
    for i in range(f.size):
        J[i] *= f[i]
        floored[i] = J[i] if J[i] > J_FLOOR else J_FLOOR
        tr[i] += f[i] * f[i] - 1.0  # the kinematics of plane strain count F_33 = 1


@njit(fastmath=FAST)
def hoop_stress(F, f, around, ab, hoop):  # type: ignore[no-untyped-def]
    """The stress around over R, and b f in place of b; F has the four components in the plane one after the other."""
    Q = hoop.size
    for i in range(Q):
        a, b = ab[i], ab[Q + i]
        hoop[i] = (a * f[i] + b * (F[i] * F[3 * Q + i] - F[Q + i] * F[2 * Q + i])) * around[i]
        ab[Q + i] = b * f[i]


@njit(fastmath=FAST)
def add_hoop_force(hoop, force):  # type: ignore[no-untyped-def]
    L, lo, hi = LANES, GAUSS_LOW, GAUSS_HIGH
    for i in range(L):
        s0, s1, s2, s3 = hoop[i], hoop[L + i], hoop[2 * L + i], hoop[3 * L + i]
        low_left, low_right = hi * s0 + lo * s1, lo * s0 + hi * s1
        high_left, high_right = hi * s2 + lo * s3, lo * s2 + hi * s3
        force[i] += hi * low_left + lo * high_left
        force[2 * L + i] += hi * low_right + lo * high_right
        force[4 * L + i] += lo * low_left + hi * high_left
        force[6 * L + i] += lo * low_right + hi * high_right


# --- viscosity ---
@njit(fastmath=FAST)
def rate_around(F, f, v, rate):  # type: ignore[no-untyped-def]
    """dJ/dt of a body of revolution, of that of its plane; f and v are r/R and v_r/R."""
    Q = f.size
    for i in range(Q):
        rate[i] = rate[i] * f[i] + v[i] * (F[i] * F[3 * Q + i] - F[Q + i] * F[2 * Q + i])


@njit(fastmath=FAST)
def viscous_stress(F, G, f, v, geo, c, wq, t, hoop):  # type: ignore[no-untyped-def]
    """:func:`.viscous._stress_2d` with the velocity gradient G and v = v_r/R, and the stress around over R."""
    Q = f.size
    for i in range(Q):
        f0, f1, f2, f3 = F[i], F[Q + i], F[2 * Q + i], F[3 * Q + i]
        g0, g1, g2, g3 = f[i] * G[i], f[i] * G[Q + i], f[i] * G[2 * Q + i], f[i] * G[3 * Q + i]
        k0, k1, k2, k3 = geo[i], geo[Q + i], geo[2 * Q + i], geo[3 * Q + i]
        plane = f0 * f3 - f1 * f2
        l00, l01, l10, l11 = g0 * f3 - g1 * f2, g1 * f0 - g0 * f1, g2 * f3 - g3 * f2, g3 * f0 - g2 * f1
        l22 = v[i] * plane
        s = wq[i] - c[i] * (l00 + l11 + l22) * (1 / 3.0)
        s00, s11, s01 = f[i] * (c[i] * l00 + s), f[i] * (c[i] * l11 + s), f[i] * 0.5 * c[i] * (l01 + l10)
        P0, P1, P2, P3 = s00 * f3 - s01 * f1, s01 * f0 - s00 * f2, s01 * f3 - s11 * f1, s11 * f0 - s01 * f2
        t[i] = P0 * k0 + P1 * k1
        t[Q + i] = P0 * k2 + P1 * k3
        t[2 * Q + i] = P2 * k0 + P3 * k1
        t[3 * Q + i] = P2 * k2 + P3 * k3
        hoop[i] = (c[i] * l22 + s) * plane * geo[AROUND * LANES + i]
