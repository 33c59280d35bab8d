"""Short steps of their own for the smallest elements, so that the few at the tip of a notch do not shorten all steps.

Impulses in two time steps (Verlet-I, r-RESPA; Tuckerman, Berne & Martyna 1992): in a step dt the nodes get

    v += dt/2 a_s;  p times with h = dt/p:  v += h/2 a_f,  u += h v,  a_f = -F(u)/m,  v += h/2 a_f;  v += dt/2 a_s,

F the force of the fast elements, a_s = a - a_f the acceleration by all other forces. A node that no fast element
touches has a_f = 0, for which this is the step of :class:`.Explicit`, as it is for all nodes with p = 1.

Fast are the elements that together fill at most a share of the volume and swing fastest by themselves, as those of
:mod:`.raised_mass`, and some layers of their neighbours. Without these the scheme resonates where a mode of the fast
elements swings by a multiple of half a period in a step: such modes die away where elements are as large as the others,
so that the other forces, which act at nodes behind them, do not reach them.

The long step keeps to the limit of the body whose nodes inside of the fast elements are held, the short one to that of
the fast elements by themselves. Both kicks and short steps change the kinetic energy by the work of the forces they
take, to rounding, the short ones but for the term of :mod:`.explicit`.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ..errors import ParameterError
from ..fem.exchange import ALONE
from ..fem.selection import Selection, selected_mesh
from ..fem.space import Space
from ..fields.momentum import Momentum
from ..loads.schedule import Loading
from ..material.regions import among
from ..system.jit import njit
from .controls import ExplicitControls
from .step_length import StepLength

__all__ = ["Subcycling", "check_subcycling"]

Motion = tuple[np.ndarray, np.ndarray, np.ndarray]


class Subcycling:
    """The fast elements of a body, and the short steps of their nodes.

    Memory: density and masses last given to `use` and `weigh`, the limit of the short step last estimated by `look`,
    the history and accelerations since `start` and `begin`, and the step tried last by `advance`, which `gain` and
    `accept` are of; `merge` and `step_share` read it. `memory` gives what a checkpoint needs.

    Parameters
    ----------
    momentum: the balance of momentum of the body.
    small: numbers (s,) of the elements that need short steps; layers around them take them too.
    free: mask of its free unknowns (n, dim).
    controls: options.
    longest: step [s] that is not exceeded where nothing swings.

    Attributes
    ----------
    elements, nodes: numbers of the fast elements (m,) and their nodes (k,), ascending.
    inner: mask of the nodes that no other element touches (n,).
    evaluations: forces of the fast elements that were evaluated.

    Raises
    ------
    ParameterError
        The body has what subcycling does not know.
    """

    LAYERS = 3

    def __init__(self, momentum: Momentum, small: np.ndarray, free: np.ndarray, controls: ExplicitControls,
                 longest: float) -> None:
        _check(momentum)
        space = momentum.space
        fast, touched = np.zeros(space.n_elements, bool), np.zeros(space.n_nodes, bool)
        fast[small] = True
        for _ in range(self.LAYERS):
            touched[space.conn[fast]] = True
            fast = touched[space.conn].any(axis=1)
        touched[space.conn[fast]] = True
        self.inner = touched.copy()
        self.inner[space.conn[~fast]] = False
        self.elements, self.nodes = np.flatnonzero(fast), np.flatnonzero(touched)
        part = Selection(self.elements, self.nodes, space.n_elements, space.n_nodes)
        self._momentum = Momentum(Space(selected_mesh(space, part), space.axisymmetric), momentum.material,
                                  momentum.element, momentum.force_floor, kernels=momentum.kernels,
                                  regions=among(momentum.regions, self.elements))
        self._backend = self._momentum.backend
        free = free[self.nodes]
        self._length = _ShortStep(self._momentum, free.ravel(), controls, longest)
        self._mass, self._inverse = np.zeros(len(free)), np.zeros(free.shape)
        self._a = np.zeros(free.shape)
        self._tried = self._a, 0.0
        self._W_max, self._W = (np.zeros_like(self._backend.W) for _ in range(2))
        self._dt = np.inf
        self.evaluations = 0

    # --- what the body is now ---
    def use(self, gamma: np.ndarray, deleted: np.ndarray) -> None:
        """Take the nodal densities (n,) and the deleted elements (ne,) of the body."""
        self._momentum.set_gamma(gamma[self.nodes], deleted[self.elements])

    def weigh(self, mass: np.ndarray, inverse: np.ndarray) -> np.ndarray:
        """Take masses (n,) and inverse masses (n, dim) of the body; gives these with the nodes inside held."""
        self._mass, self._inverse = mass[self.nodes], inverse[self.nodes]
        return np.where(self.inner[:, None], 0.0, inverse)

    def start(self, W_max: np.ndarray) -> None:
        """Go on from the history (ne, nq) of the body."""
        self._W_max = self._backend.tile(W_max[self.elements])

    def merge(self, W_max: np.ndarray) -> None:
        """Enter in the history (ne, nq) of the body what the fast elements went through in short steps."""
        W_max[self.elements] = np.maximum(W_max[self.elements], self._backend.untile(self._W_max))

    def begin(self, u: np.ndarray) -> None:
        """Accelerations by the fast elements at the displacement `u` (n, dim) of the body."""
        force = np.empty_like(self._a)
        self._backend.force(u[self.nodes], force)
        self._a = -force * self._inverse

    # --- a step ---
    def look(self, step: int, u: np.ndarray) -> None:
        """Find how long short steps may be, before step number `step` from the displacement `u` (n, dim)."""
        self._length.look(step, u[self.nodes], self._mass, self._inverse)

    def steps(self, dt: float) -> int:
        """Short steps in one of `dt` [s], >= 1."""
        return max(1, int(np.ceil(dt / self._length.dt * (1.0 - 1e-9))))

    def advance(self, now: Motion, pace: np.ndarray, dt: float, new: Motion) -> None:
        """Take the short steps of a step `dt` [s].

        `now` are displacement, velocity and acceleration of the body, `pace` is the velocity of what is held (n, dim).
        In `new`, displacement, velocity and increment of the displacement, those of the free nodes of the fast elements
        are replaced; the velocity is one to which half a step with the whole acceleration is to be added.
        """
        count = self.steps(dt)
        h = dt / count
        u, v, held = now[0][self.nodes], now[1][self.nodes], pace[self.nodes]
        a, force, W = self._a.copy(), np.empty_like(self._a), self._W
        gain = _kick(v, now[2][self.nodes] - a, self._mass, self._inverse, 0.5 * dt)
        W[...] = 0.0
        for _ in range(count):
            _drift(u, v, a, held, self._inverse, h)
            self._backend.force(u, force)
            gain += _close(v, a, force, self._mass, self._inverse, h)
            np.maximum(W, self._backend.W, out=W)
        self.evaluations += count
        _enter(self.nodes, self._inverse, (u, v, a), 0.5 * dt, now[0], new)
        self._tried, self._dt = (a, gain), dt

    def gain(self, v: np.ndarray, a: tuple[np.ndarray, np.ndarray], du: np.ndarray) -> float:
        """Kinetic energy the step tried last has added to the free nodes, less what the identity of one step has.

        `v`, accelerations `a` before and after, and `du` are those of the body (n, dim), `v` at the end of the step.
        """
        fast, gain = self._tried
        return gain + float(_difference(self.nodes, self._inverse, self._mass, v, a, fast, du, self._dt))

    def accept(self) -> None:
        """Keep the step tried last."""
        self._a = self._tried[0]
        np.maximum(self._W_max, self._W, out=self._W_max)

    def step_share(self, u: np.ndarray, dt: float) -> float:
        """The short steps of a step `dt` [s] over their limit at the displacement `u` (n, dim) of the body."""
        share = self._length.share(u[self.nodes], self._mass, self._inverse)
        return share * dt / self.steps(dt) / self._length.dt

    # --- checkpoints ---
    def memory(self) -> dict[str, np.ndarray]:
        """What a checkpoint needs."""
        return {"fast_a": self._a, **{f"short_{name}": value for name, value in self._length.memory().items()}}

    def restore(self, memory: dict[str, np.ndarray]) -> None:
        """Go on where :meth:`memory` was taken."""
        self._a = memory["fast_a"]
        self._length.restore({name.removeprefix("short_"): value for name, value in memory.items()
                              if name.startswith("short_")})


class _ShortStep(StepLength):
    """The limit of the short step, followed in every long one: fast elements fail in few of these.

    Memory: see :class:`.StepLength`.
    """

    CHECK = 1


class _Controls(Protocol):
    @property
    def contact(self) -> bool: ...

    @property
    def bulk_viscosity_linear(self) -> float: ...

    @property
    def bulk_viscosity_quadratic(self) -> float: ...


def check_subcycling(loading: Loading, controls: _Controls, viscosity: float) -> None:
    """Refuse a scene that subcycling does not know (ParameterError); `viscosity` is the greatest of its materials."""
    _refuse({"contact": controls.contact, "dead loads": loading.dead is not None,
             "pressures": loading.followers is not None, "an oblique plane on which nodes slide":
             loading.sliding is not None, "viscosity": viscosity > 0.0 or controls.bulk_viscosity_linear > 0.0
             or controls.bulk_viscosity_quadratic > 0.0})


def _check(momentum: Momentum) -> None:
    _refuse({"several ranks": momentum.space.exchange is not ALONE,
             "contact": momentum.contact is not None, "dead loads": momentum.dead is not None,
             "pressures": momentum.followers is not None, "an oblique plane on which nodes slide":
             momentum.sliding is not None, "viscosity": momentum.is_viscous})


def _refuse(there: dict[str, bool]) -> None:
    if what := next((name for name, is_there in there.items() if is_there), ""):
        raise ParameterError(f"subcycled does not know {what}: take subcycled 0, and raised_mass "
                             f"{ExplicitControls.raised_mass:g}")


# --- loops over the nodes of the fast elements; inverse masses are 0 where a node is held ---
@njit(cache=True)
def _kick(v, a, mass, inverse, dt):  # type: ignore[no-untyped-def]
    """v += dt a; returns the kinetic energy it adds."""
    gain = 0.0
    for n in range(v.shape[0]):
        for i in range(v.shape[1]):
            if inverse[n, i] > 0.0:
                dv = dt * a[n, i]
                gain += mass[n] * dv * (v[n, i] + 0.5 * dv)
                v[n, i] += dv
    return gain


@njit(cache=True)
def _drift(u, v, a, pace, inverse, h):  # type: ignore[no-untyped-def]
    """First half of a short step: v at half of it, u at its end."""
    for n in range(v.shape[0]):
        for i in range(v.shape[1]):
            if inverse[n, i] > 0.0:
                v[n, i] += 0.5 * h * a[n, i]
                u[n, i] += h * v[n, i]
            else:
                u[n, i] += h * pace[n, i]


@njit(cache=True)
def _close(v, a, force, mass, inverse, h):  # type: ignore[no-untyped-def]
    """Second half of a short step; returns the kinetic energy it has added, by the identity of :mod:`.explicit`."""
    gain = 0.0
    for n in range(v.shape[0]):
        for i in range(v.shape[1]):
            if inverse[n, i] > 0.0:
                a0, a1 = a[n, i], -force[n, i] * inverse[n, i]
                gain += mass[n] * (0.5 * h * (a0 + a1) * v[n, i] + h * h / 8 * (a1 * a1 - a0 * a0))
                a[n, i] = a1
                v[n, i] += 0.5 * h * a1
    return gain


@njit(cache=True)
def _enter(nodes, inverse, fast, half, before, new):  # type: ignore[no-untyped-def]
    """Put u, v and du in the arrays of the body; v without half a step of the acceleration by the fast elements."""
    u, v, a = fast
    for k in range(nodes.size):
        n = nodes[k]
        for i in range(u.shape[1]):
            if inverse[k, i] > 0.0:
                new[0][n, i] = u[k, i]
                new[1][n, i] = v[k, i] - half * a[k, i]
                new[2][n, i] = u[k, i] - before[n, i]


@njit(cache=True)
def _difference(nodes, inverse, mass, v, a, fast, du, dt):  # type: ignore[no-untyped-def]
    """Kinetic energy of the last half kick, less what the identity of one step has for these nodes."""
    total = 0.0
    for k in range(nodes.size):
        n = nodes[k]
        for i in range(v.shape[1]):
            if inverse[k, i] > 0.0:
                a0, a1 = a[0][n, i], a[1][n, i]
                dv = 0.5 * dt * (a1 - fast[k, i])
                one = 0.5 * (a0 + a1) * du[n, i] + dt * dt / 8 * (a1 * a1 - a0 * a0)
                total += mass[k] * (dv * (v[n, i] - 0.5 * dv) - one)
    return total
