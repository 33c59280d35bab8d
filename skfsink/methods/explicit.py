"""Explicit central differences with lumped, falling mass: the default integrator of the dynamic event.

Velocity form of the scheme, for the free degrees of freedom:

    u_{n+1} = u_n + dt (v_n + dt/2 a_n),   m a_{n+1} = -f(u_{n+1}),   v_{n+1} = v_n + dt/2 (a_n + a_{n+1}),

with f the internal force less the dead loads.

gamma multiplies stiffness and mass alike, so damage does not lower the stable step. Every few steps gamma is
solved anew; accelerations are kept when the mass changes with it.

With V the mean velocity of a step and f_n = -m a_n, the scheme obeys, exactly,

    K_{n+1} - K_n = - (f_n + f_{n+1})/2 . (u_{n+1} - u_n) + dt^2/8 (f_{n+1}.m^-1 f_{n+1} - f_n.m^-1 f_n),

so the dissipation it adds is the difference between that trapezoidal work (with that of the dead loads taken back) and
the change of stored energy at fixed gamma, less the last term: that is what the ledger books as numerical.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..errors import InstabilityError
from ..fem.pattern import Pattern
from ..fields.active_zone import Zone
from ..fields.body import Body
from ..fields.deletion import delete_failed, left_in
from ..fields.density import Density
from ..fields.state import State
from ..system.jit import njit
from .controls import EventControls, ExplicitControls
from .frequency import highest_frequency

__all__ = ["Explicit"]


class Explicit:
    """Integrates a :class:`State` from onset on.

    Memory: step size and frequency estimate, forces, masses, the history in tiles, and active zones, all of the state
    last stepped: after `begin`, `start` or `restore`, `run`, `step`, `update_density`, `sync` and `step_share` go on
    with that one state; `memory` gives what a checkpoint needs.

    Parameters
    ----------
    body: the balances, and what loads it. Where a ramp of its loading has a knot a step ends.
    controls: options.

    Attributes
    ----------
    dt: the current step [s].   estimates: frequency estimates made.   factorisations: none.
    reaction: (n, dim) internal force less the dead loads.
    """

    GAMMA_INTERVAL = 0.03  # l/c_s between solves for gamma; the crack then runs less than 3 % of l
    GAMMA_MOST = 20  # steps between them at the most, lest a failing element that shortens the step keeps failing
    GAMMA_TOLERANCE = 1e-6  # relative residual of a solve for gamma
    CHECK = 5        # steps between looks at the cheap indicator
    RISEN = 25       # steps after which a risen indicator calls for an estimate; until then the step follows it
    FALLEN = 100     # steps after which a fallen one does; until then the step is shorter than it need be
    _REMEMBERED = ("dt", "estimates", "_omega", "_indicator0", "_last_estimate", "_elastic", "_urgent", "_since_gamma")
    FED_IN = 1e-6    # energy a step may feed in before omega_max is estimated at once, of the initial energy

    factorisations = 0

    def __init__(self, body: Body, controls: ExplicitControls | None = None) -> None:
        self.body, self.momentum, self.density, self.loading = body, body.momentum, body.density, body.loading
        self.controls = controls or ExplicitControls()
        self.space, self.free = body.space, body.free
        self._free = np.ascontiguousarray(self.free.reshape(-1, self.space.dim))
        self._grip_velocity, self._knot = self.loading.velocity(0.0), np.inf
        self._pattern = Pattern(self.space, self.space.dim, self.free, upper=True)
        self._mass_floor = max(self.controls.mass_floor, 1e-12)  # a node without mass or force stays where it is
        self.dt = 0.0
        self.estimates = 0
        self._omega = 0.0
        self._mode: np.ndarray | None = None
        self._indicator0 = 0.0
        self._last_estimate = 0
        self._urgent = False
        self._since_gamma = 0
        self._zones: tuple[Zone, ...] = ()

    @classmethod
    def of(cls, body: Body, controls: EventControls) -> Explicit:
        """The integrator of a body, with its options among the :class:`.Controls`."""
        return cls(body, controls.explicit)

    def start(self, state: State) -> None:
        """Forces, masses and accelerations of `state`; to be called once before stepping, and after a resume."""
        self.momentum.set_time(state.grip)
        self._grip_velocity, self._knot = self.loading.velocity(state.grip), self.loading.knot(state.grip)
        self.momentum.set_gamma(state.gamma, state.deleted)
        self._set_mass()
        self.reaction = self.momentum.force(state.u)
        self._W = self.momentum.backend.W
        self._W_max = self.momentum.backend.tile(state.W_max)
        self._elastic = self.momentum.energy
        self._spare, self._du = np.empty_like(self.reaction), np.empty_like(self.reaction)

    def _set_mass(self) -> None:
        self.mass = self.momentum.lumped_mass(self._mass_floor)
        self._inverse = self._free / self.mass[:, None]  # zero where a degree of freedom is held

    def begin(self, state: State) -> None:
        """Set the body in motion: accelerations from the forces, energies of the start."""
        self.start(state)
        np.copyto(state.v, self._grip_velocity, where=~self._free)
        state.a[...] = np.where(self._free, -self.reaction / self.mass[:, None], 0.0)
        state.ledger.initial = state.ledger.elastic = self._elastic
        state.ledger.kinetic, state.ledger.loads = self._kinetic(state), self.momentum.loads
        state.ledger.initial += state.ledger.kinetic + state.ledger.loads

    def _kinetic(self, state: State) -> float:
        return float(self.mass @ _half_square(state.v))

    # --- the step ---
    def run(self, state: State, t_end: float) -> Iterator[State]:
        """Step until `t_end` [s], yielding the state after each step."""
        while state.time < t_end:
            self.step(state)
            yield state

    def step(self, state: State) -> None:
        """One time step, with the solve for gamma when it is due."""
        if self._mode is None or self._urgent or state.step % self.CHECK == 0:
            self._set_step(state)
        dt, grip, dead = self.dt, state.grip + self.dt, self.momentum.dead
        if grip >= self._knot:
            dt, grip = self._knot - state.grip, self._knot
        old, before = self.reaction, None if dead is None else dead.values
        self.momentum.set_time(grip)
        du = self._du
        _move(state.u, state.v, state.a, self._free, self._grip_velocity, dt, du)
        force = self.momentum.force(state.u, self._spare)
        np.maximum(self._W_max, self._W, out=self._W_max)
        trapezoid, held, kinetic, swing = _kick(state.v, state.a, self._inverse, self.mass, old, force, du, dt)
        self.reaction, self._spare = force, old
        ledger = state.ledger
        elastic = self.momentum.energy
        energy_fed_in, scale = dt * dt / 8 * swing + (elastic - self._elastic) - trapezoid, ledger.initial
        if dead is not None and before is not None:
            energy_fed_in -= dead.effort(before, du)
            ledger.work += dead.changed(before, state.u - 0.5 * du)
            ledger.loads, scale = self.momentum.loads, max(abs(scale), elastic + kinetic)
        ledger.numerical -= energy_fed_in
        if energy_fed_in > self.FED_IN * scale:  # first sign of a step that has become too long
            self._urgent = True
        ledger.work += held
        ledger.elastic = self._elastic = elastic
        ledger.kinetic = kinetic
        state.time += dt
        state.grip = grip
        state.step += 1
        if grip == self._knot:
            self._turn(state)
        self._since_gamma += 1
        if self._since_gamma >= self._gamma_every:
            self._since_gamma = 0
            self.update_density(state)
        if state.step % 100 == 0 and not np.isfinite(kinetic + elastic):
            self._blow_up(state)

    def _blow_up(self, state: State) -> None:
        raise InstabilityError(f"the explicit integration blew up at t = {state.time:.4g} s (step {state.step}): "
                               f"lower courant, now {self.controls.courant:g}")

    def _turn(self, state: State) -> None:
        """At a knot: grips take their new velocities at once; what that needs is their work."""
        self._grip_velocity, self._knot = self.loading.velocity(state.grip), self.loading.knot(state.grip)
        before = state.ledger.kinetic
        np.copyto(state.v, self._grip_velocity, where=~self._free)
        state.ledger.kinetic = self._kinetic(state)
        state.ledger.work += state.ledger.kinetic - before

    def update_density(self, state: State) -> None:
        """Solve for gamma from the history, book what the sink takes, delete failed elements."""
        momentum, ledger = self.momentum, state.ledger
        self.sync(state)
        if not np.isfinite(state.W_max.max()):
            self._blow_up(state)
        before = Density(state.gamma, state.sink, self._zones)
        now = self.density.update(state.W_max, before, self.GAMMA_TOLERANCE)
        if now is before:
            return
        state.gamma, state.sink, self._zones = now
        failed = delete_failed(self.space, state, self.body.deletion, self.density.failure_energy)
        left = left_in(momentum, state.gamma, failed) if failed.size else 0.0
        dead, loads = momentum.dead, None if momentum.dead is None else momentum.dead.values
        stored = momentum.set_gamma(state.gamma, state.deleted)
        mass = self.mass
        self._set_mass()
        ledger.sink_stored += stored - left
        ledger.deletion += left
        half_v2 = _half_square(state.v)
        ledger.sink_kinetic += float((mass - self.mass) @ half_v2)
        if dead is not None and loads is not None:
            ledger.work += dead.changed(loads, state.u)
            ledger.loads = dead.potential(state.u)
        self._elastic -= stored
        ledger.elastic = self._elastic
        ledger.kinetic = float(self.mass @ half_v2)

    def sync(self, state: State) -> None:
        """Bring `state.W_max` up to date; between density solves the integrator keeps it tiled."""
        state.W_max = self.momentum.backend.untile(self._W_max)

    @property
    def _gamma_every(self) -> int:
        """Steps between solves for gamma."""
        if self.controls.gamma_every:
            return self.controls.gamma_every
        return min(max(1, int(self._interval / self.dt)), self.GAMMA_MOST)

    @property
    def _interval(self) -> float:
        """Longest time between solves for gamma that leaves the motion of a crack accurate, in any material [s]."""
        return self.GAMMA_INTERVAL * self.density.law.length_scale / (self.momentum.shear_wave_speeds[1] * 1e3)

    # --- the step size ---
    def _set_step(self, state: State) -> None:
        c = self.controls
        indicator = self._indicator(state.u)
        ratio = indicator / self._indicator0 if self._indicator0 > 0 else np.inf
        since = state.step - self._last_estimate
        moved = abs(ratio - 1) > 2 * c.estimate_change and since >= (self.RISEN if ratio > 1 else self.FALLEN)
        if self._mode is None or self._urgent or moved or since >= c.estimate_every:
            self._omega, self._mode = highest_frequency(self.momentum, self._pattern, self.free, state.u, self.mass,
                                                        self._mode)
            self._omega = max(self._omega, indicator**0.5)  # a Rayleigh quotient, in case Lanczos missed that element
            self._indicator0, self._last_estimate, ratio = indicator, state.step, 1.0
            self.estimates += 1
            self._urgent = False
        swings = self._omega > 0.0  # else every node is held
        self.dt = float(c.courant * 2.0 / (self._omega * np.sqrt(max(1.0, ratio)))) if swings else self._interval
        if not c.gamma_every:
            self.dt = min(self.dt, self._interval)  # in plane stress the stable step may be longer

    def step_share(self, state: State) -> float:
        """The step over the stability limit of `state` as it is now; nothing is changed."""
        omega, _ = highest_frequency(self.momentum, self._pattern, self.free, state.u, self.mass, self._mode)
        return 0.5 * self.dt * max(omega, self._indicator(state.u) ** 0.5)

    def _indicator(self, u: np.ndarray) -> float:
        """A lower bound of omega_max^2 that follows it closely; see :meth:`.Momentum.stiffest`."""
        return self.momentum.stiffest(u, self._inverse)

    # --- checkpoints ---
    def memory(self) -> dict[str, np.ndarray]:
        """What the integrator remembers beyond the state, for a checkpoint."""
        assert self._mode is not None
        return {"mode": self._mode, "reaction": self.reaction,
                "zone_depths": np.array([zone.depth for zone in self._zones], int),
                **{name: np.array(getattr(self, name)) for name in self._REMEMBERED}}

    def restore(self, state: State, memory: dict[str, np.ndarray]) -> None:
        """Go on exactly where :meth:`memory` was taken."""
        self.start(state)
        self._mode, self.reaction = memory["mode"], memory["reaction"]
        for name in self._REMEMBERED:
            setattr(self, name, memory[name].item())
        if self.density.zone is not None:
            self._zones = tuple(self.density.zone.of_depth(depth) for depth in memory["zone_depths"])


def _half_square(v: np.ndarray) -> np.ndarray:
    """|v|^2/2 of each row."""
    half: np.ndarray = (v * v) @ np.full(v.shape[1], 0.5)  # several times as fast as einsum on rows of two
    return half


@njit(cache=True)
def _move(u, v, a, free, grip_velocity, dt, du):  # type: ignore[no-untyped-def]
    """Advance v by half a step and u by a step, of which `du` takes the increment."""
    for n in range(u.shape[0]):
        for i in range(u.shape[1]):
            if free[n, i]:
                v[n, i] += 0.5 * dt * a[n, i]
                du[n, i] = dt * v[n, i]
            else:
                du[n, i] = dt * grip_velocity[n, i]
            u[n, i] += du[n, i]


@njit(cache=True)
def _kick(v, a, inverse, mass, old, force, du, dt):  # type: ignore[no-untyped-def]
    """Second half of the step; returns trapezoidal work (all, held), kinetic energy, change of f.m^-1 f (free)."""
    work, held, kinetic, swing = 0.0, 0.0, 0.0, 0.0
    for n in range(v.shape[0]):
        square = 0.0
        for i in range(v.shape[1]):
            f, one_by_m = force[n, i], inverse[n, i]
            if one_by_m > 0.0:
                f0 = -mass[n] * a[n, i]
                a[n, i] = -f * one_by_m
                v[n, i] += 0.5 * dt * a[n, i]
                swing += (f * f - f0 * f0) * one_by_m
                work += 0.5 * (f0 + f) * du[n, i]
            else:
                held += 0.5 * (old[n, i] + f) * du[n, i]
            square += v[n, i] * v[n, i]
        kinetic += 0.5 * mass[n] * square
    return work + held, held, kinetic, swing
