"""The two halves of an explicit step at the nodes: displacements first, and after the force the velocities."""

from __future__ import annotations

import numpy as np

from ..system.jit import njit

__all__ = ["half_square", "kick", "move", "viscous_work"]


def half_square(v: np.ndarray) -> np.ndarray:
    """|v|^2/2 of each row."""
    half: np.ndarray = (v * v) @ np.full(v.shape[1], 0.5)  # several times as fast as einsum on rows of two
    return half


@njit(cache=True)
def move(now, free, grip_velocity, dt, new):  # type: ignore[no-untyped-def]
    """From u, v, a: u after a step, v after half of it, and the increment of u."""
    u, v, a = [x.reshape(x.size) for x in now]
    u_new, v_new, du = [x.reshape(x.size) for x in new]
    moves, held = free.reshape(free.size), grip_velocity.reshape(grip_velocity.size)
    for k in range(u.size):  # without branches, several at once
        half = v[k] + 0.5 * dt * a[k]
        v_new[k] = half if moves[k] else v[k]
        du[k] = dt * (half if moves[k] else held[k])
        u_new[k] = u[k] + du[k]


@njit(cache=True)
def kick(motion, inverse, mass, forces, du, dt, counted):  # type: ignore[no-untyped-def]
    """Second half of the step: v at half of it goes to its end, and a is found there, from the forces before and after.

    Returns trapezoidal work (all, held), kinetic energy, and the change of f.m^-1 f (free), of the first `counted`
    nodes.
    """
    v, a, a_new = motion
    old, force = forces
    work, held, kinetic, swing = 0.0, 0.0, 0.0, 0.0
    rest = work, held, kinetic, swing
    for n in range(v.shape[0]):
        if n == counted:
            rest = work, held, kinetic, swing
        square = 0.0
        for i in range(v.shape[1]):
            f, one_by_m = force[n, i], inverse[n, i]
            if one_by_m > 0.0:
                f0 = -mass[n] * a[n, i]
                a_new[n, i] = -f * one_by_m
                v[n, i] += 0.5 * dt * a_new[n, i]
                swing += (f * f - f0 * f0) * one_by_m
                work += 0.5 * (f0 + f) * du[n, i]
            else:
                a_new[n, i] = a[n, i]
                held += 0.5 * (old[n, i] + f) * du[n, i]
            square += v[n, i] * v[n, i]
        kinetic += 0.5 * mass[n] * square
    if counted < v.shape[0]:
        work, held, kinetic, swing = rest
    return work + held, held, kinetic, swing


def viscous_work(viscous: tuple[np.ndarray, np.ndarray], forces: tuple[np.ndarray, np.ndarray], inverse: np.ndarray,
                 du: np.ndarray, dt: float, counted: slice = slice(None)) -> float:
    """What of the identity of a step is not of internal forces alone, at the nodes that are `counted`.

    `viscous` and whole `forces` are those before and after.
    """
    old, new, whole_old, whole_new, inverse, du = (x[counted] for x in (*viscous, *forces, inverse, du))
    swing = new * (2 * whole_new - new) - old * (2 * whole_old - old)
    return 0.5 * float(np.vdot(old + new, du)) - dt * dt / 8 * float(np.vdot(inverse, swing))
