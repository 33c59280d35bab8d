"""Explicit central differences with lumped, falling mass: the default integrator of the dynamic event.

Velocity form of the scheme, for the free degrees of freedom:

    u_{n+1} = u_n + dt (v_n + dt/2 a_n),   m a_{n+1} = -f(u_{n+1}),   v_{n+1} = v_n + dt/2 (a_n + a_{n+1}),

with f the internal force less the loads, and with viscosity the viscous force at u_{n+1} and at the mean velocity
of the step that led there.

gamma multiplies stiffness and mass alike, so damage does not lower the stable step. Every few steps gamma is
solved anew; accelerations are kept when the mass changes with it.

With V the mean velocity of a step and f_n = -m a_n, the scheme obeys, exactly,

    K_{n+1} - K_n = - (f_n + f_{n+1})/2 . (u_{n+1} - u_n) + dt^2/8 (f_{n+1}.m^-1 f_{n+1} - f_n.m^-1 f_n),

so the dissipation it adds is the difference between that trapezoidal work (with that of the loads taken back) and the
change of stored energy at fixed gamma, less the last term: that is what the ledger books as numerical. With
viscosity f is the sum of both forces; what in the work and the last term is not of internal forces alone is booked as
viscous.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..fields.active_zone import Zone
from ..fields.body import Body
from ..fields.deletion import delete_debris, delete_failed, left_in
from ..fields.density import Density
from ..fields.state import State
from .controls import EventControls, ExplicitControls
from .looked import OneBody
from .nodal_steps import half_square, kick, move, viscous_work
from .raised_mass import raised_mass, small_elements
from .solve_interval import SolveInterval
from .step_length import StepLength
from .subcycling import Subcycling

__all__ = ["Explicit"]


class Explicit(OneBody):
    """Integrates a :class:`State` from onset on.

    Memory: step size and frequency estimate, forces, masses, the history in tiles, and active zones, all of the state
    last stepped: after `begin`, `start` or `restore`, `run`, `step`, `update_density`, `sync` and `step_share` go on
    with that one state; `memory` gives what a checkpoint needs.

    Parameters
    ----------
    body: the balances, and what loads it. A step ends at each corner of its loading.
    controls: options.

    Attributes
    ----------
    length, interval: of the steps, and between solves for gamma.
    dt: the current step [s].   estimates: frequency estimates made.   factorisations: none.
    added_mass: of the smallest elements, over that of the intact body; see :mod:`.raised_mass`.
    subcycling: short steps of the smallest elements, None without.
    reaction: (n, dim) internal and viscous force less the loads.
    """

    GAMMA_TOLERANCE = 1e-6  # relative residual of a solve for gamma
    _REMEMBERED = ("_elastic", "_since_gamma", "_compression")

    factorisations = 0

    def __init__(self, body: Body, controls: ExplicitControls | None = None) -> None:
        self.body, self.momentum, self.density, self.loading = body, body.momentum, body.density, body.loading
        self.controls = controls or ExplicitControls()
        self.space, self.free = body.space, body.free
        self._free = np.ascontiguousarray(self.free.reshape(-1, self.space.dim))
        self._held: np.ndarray = np.logical_not(self._free.all(axis=1))
        self._exchange = self.space.exchange
        counted = self._exchange.counts(len(self._held))
        self._counts = int(counted.sum())  # the first ones
        self._guided, self._guided_counted = np.flatnonzero(self._held), counted[self._held]
        if self.loading.sliding is not None:
            self._held[self.loading.sliding.nodes] = True
        self._grip_velocity, self._knot = self.loading.velocity(0.0), np.inf
        self._mass_floor = max(self.controls.mass_floor, 1e-12)  # a node without mass or force stays where it is
        self.interval = SolveInterval(body, self.controls.gamma_every)
        long_step, self.subcycling = self.free, None
        share = self.controls.subcycled
        if share and (small := small_elements(self.momentum, share)).size:
            self.subcycling = Subcycling(self.momentum, small, self._free, self.controls, self.interval.longest)
            long_step = (self._free & ~self.subcycling.inner[:, None]).ravel()
        self.length = StepLength(self.momentum, long_step, self.controls, self.interval.longest)
        self._since_gamma = 0
        self._factors, self.added_mass = raised_mass(self.momentum, self.controls.raised_mass)
        self._viscous: np.ndarray | None = None  # viscous force in `reaction`
        self._compression = 0.0
        self._zones: tuple[Zone, ...] = ()

    @classmethod
    def of(cls, body: Body, controls: EventControls) -> Explicit:
        """The integrator of a body, with its options among the :class:`.Controls`."""
        return cls(body, controls.explicit)

    def start(self, state: State) -> None:
        """Forces, masses and accelerations of `state`; to be called once before stepping, and after a resume."""
        self.momentum.set_time(state.grip)
        self._grip_velocity, self._knot = self.loading.velocity(state.grip), self.loading.corner(state.grip)
        self._take_density(state)
        self.reaction = self.momentum.force(state.u)
        self._W = self.momentum.backend.W
        self._take_history(state)
        self._elastic, self._pressed = self.momentum.energy, self.momentum.pressed
        self._compression, self._viscous = 0.0, None
        if self.momentum.is_viscous:
            self._viscous = self.momentum.viscous_force(state.u, state.v)
            self._compression, self._spare_viscous = self.momentum.compression, np.empty_like(self.reaction)
            self.reaction += self._viscous
        self._spare, self._du = np.empty_like(self.reaction), np.empty_like(self.reaction)
        self._next = np.empty_like(state.u), np.empty_like(state.u), np.empty_like(state.u)

    def _take_density(self, state: State) -> float:
        """Take density and deleted elements, and the masses they leave; returns the stored energy that goes."""
        taken = self.momentum.set_gamma(state.gamma, state.deleted)
        if self.subcycling is not None:
            self.subcycling.use(state.gamma, state.deleted)
        self._set_mass()
        return taken

    def _take_history(self, state: State) -> None:
        self._W_max = self.momentum.backend.tile(state.W_max)
        if self.subcycling is not None:
            self.subcycling.start(state.W_max)

    def _give_history(self, state: State) -> None:
        state.W_max = self.momentum.backend.untile(self._W_max)
        if self.subcycling is not None:
            self.subcycling.merge(state.W_max)

    def _set_mass(self) -> None:
        self.mass = self.momentum.lumped_mass(self._mass_floor, self._factors)
        self._moving, contact = self._free, self.momentum.contact
        if contact is not None:
            self._moving = self._free & ~contact.massless
            self.mass[contact.massless.any(axis=1)] = 0.0
        mass = self.mass[:, None]
        self._inverse = np.divide(self._moving, mass, out=np.zeros(self._free.shape), where=mass > 0.0)  # 0 where held
        self._swinging = self._inverse  # in the long step
        if self.subcycling is not None:
            self._swinging = self.subcycling.weigh(self.mass, self._inverse)

    def begin(self, state: State) -> None:
        """Set the body in motion: accelerations from the forces, energies of the start."""
        np.copyto(state.v, self.loading.motion(state.grip), where=~self._free)
        self.start(state)
        np.divide(-self.momentum.unheld(self.reaction), self.mass[:, None], out=state.a, where=self._inverse > 0.0)
        state.a[self._inverse == 0.0] = 0.0
        if self.subcycling is not None:
            self.subcycling.begin(state.u)
        state.ledger.initial = state.ledger.elastic = self._elastic
        state.ledger.kinetic, state.ledger.loads = self._kinetic(state), self.momentum.loads
        state.ledger.contact = self._pressed
        state.ledger.initial += state.ledger.kinetic + state.ledger.loads + self._pressed

    def _kinetic(self, state: State) -> float:
        return self._exchange.dot(self.mass, half_square(state.v))

    # --- the step ---
    def run(self, state: State, t_end: float) -> Iterator[State]:
        """Step until `t_end` [s], yielding the state after each step."""
        while state.time < t_end:
            self.step(state)
            yield state

    def step(self, state: State) -> None:
        """One time step, with the solve for gamma when it is due.

        Raises
        ------
        InstabilityError
            No step, however short, keeps the energy.
        """
        self.length.look(state.step, state.u, self.mass, self._swinging, self._compression)
        if self.subcycling is not None:
            self.subcycling.look(state.step, state.u)
        while not self._try(state):
            if self.length.is_given_up:
                self.length.give_up(state, self._next[1])
        if state.grip == self._knot:
            self._turn(state)
        elif self.loading.smooth:
            self._follow(state)
        self._since_gamma += 1
        if self._since_gamma >= self.interval.steps(self.dt):
            self._since_gamma = 0
            self.update_density(state)

    def _try(self, state: State) -> bool:
        """Take a step, if it keeps the energy; else the state stays as it was, and the next step is shorter."""
        dt, grip, dead = self.length.dt, state.grip + self.length.dt, self.momentum.dead
        if grip >= self._knot:
            dt, grip = self._knot - state.grip, self._knot
        old, before = self.reaction, None if dead is None else dead.values
        pressures = self.momentum.pressure_values
        self.momentum.set_time(grip)
        (u, v, a), du = self._next, self._du
        pace = self.loading.mean(state.grip, grip, dt) if self.loading.smooth else self._grip_velocity
        move((state.u, state.v, state.a), self._moving, pace, dt, (u, v, du))
        if self.subcycling is not None:
            self.subcycling.advance((state.u, state.v, state.a), pace, dt, (u, v, du))
        force = self.momentum.force(u, self._spare)
        viscous = self._viscous
        if viscous is not None:
            speeds = np.where(self._free, v, pace) if self.loading.smooth else v
            new_viscous = self.momentum.viscous_force(u, speeds, self._spare_viscous)
            force += new_viscous
        net = self.momentum.unheld(force)
        trapezoid, held, kinetic, swing = self._exchange.totals(
            kick((v, state.a, a), self._inverse, self.mass, (old, net), du, dt, self._counts))
        ledger = state.ledger
        elastic, pressed = self.momentum.energy, self.momentum.pressed
        energy_fed_in = dt * dt / 8 * swing + (elastic - self._elastic) + (pressed - self._pressed) - trapezoid
        if self.subcycling is not None:
            energy_fed_in += self.subcycling.gain(v, (state.a, a), du)
        if dead is not None and before is not None:
            energy_fed_in -= dead.effort(before, du)
        given = self.momentum.pressure_work(state.u, u, pressures)
        energy_fed_in -= given
        present, initial = elastic + pressed + kinetic, ledger.initial
        energy = max(abs(initial), present, self.body.least_energy)
        if viscous is not None:
            drags = self.momentum.unheld(viscous), self.momentum.unheld(new_viscous)
            work = self._exchange.total(viscous_work(drags, (-self.mass[:, None] * state.a, net), self._inverse, du, dt,
                                                     self._exchange.counted))
            energy_fed_in += work
        if dead is not None or pressures is not None:
            initial = max(abs(initial), present)
            if abs(energy_fed_in) > self.controls.energy_tolerance * energy:  # a body without energy that is loaded
                energy = max(energy, self.length.borne(u, self._inverse))
        if not self.length.accepts(energy_fed_in, energy, initial):
            self.momentum.set_time(state.grip)
            return False
        self._next = state.u, state.v, state.a
        state.u, state.v, state.a = u, v, a
        self.reaction, self._spare = force, old
        np.maximum(self._W_max, self._W, out=self._W_max)
        if self.subcycling is not None:
            self.subcycling.accept()
        if dead is not None and before is not None:
            ledger.work += dead.changed(before, state.u - 0.5 * du)
            ledger.loads = self.momentum.loads
        if viscous is not None:
            self._viscous, self._spare_viscous = new_viscous, viscous
            self._compression = self.momentum.compression
            ledger.viscous += work
        ledger.book_pressure(given)
        ledger.numerical -= energy_fed_in
        ledger.work += held
        ledger.elastic = self._elastic = elastic
        ledger.contact = self._pressed = pressed
        ledger.kinetic = kinetic
        state.time += dt
        state.grip = grip
        state.step += 1
        return True

    def _turn(self, state: State) -> None:
        """At a corner: grips take their new velocities at once; what that needs is their work."""
        self._grip_velocity, self._knot = self.loading.motion(state.grip), self.loading.corner(state.grip)
        before = state.ledger.kinetic
        np.copyto(state.v, self._grip_velocity, where=~self._free)
        state.ledger.kinetic = self._kinetic(state)
        state.ledger.work += state.ledger.kinetic - before

    def _follow(self, state: State) -> None:
        """After a step on a curve: the same, of the nodes that are held alone."""
        nodes = self._guided
        before, held = state.v[nodes], ~self._free[nodes]
        after = np.where(held, self.loading.motion(state.grip)[nodes], before)
        gains = half_square(after) - half_square(before)
        gained = self._exchange.total(float((self.mass[nodes] * self._guided_counted) @ gains))
        state.v[nodes] = after
        state.ledger.kinetic += gained
        state.ledger.work += gained

    def update_density(self, state: State) -> None:
        """Solve for gamma from the history, book what the sink takes, delete failed elements, and debris they leave."""
        momentum, ledger = self.momentum, state.ledger
        self._give_history(state)
        before = Density(state.gamma, state.sink, self._zones)
        now = self.density.update(state.W_max, before, self.GAMMA_TOLERANCE)
        if now is before:
            return
        state.gamma, state.sink, self._zones = now
        failed = delete_failed(self.space, state, self.body.deletion, self.density.failure_energy)
        some = self._exchange.total(failed.size) > 0
        left = left_in(momentum, state.gamma, failed) if some else 0.0
        stored, moving = self._thin(state)
        ledger.sink_stored += stored - left
        ledger.deletion += left
        ledger.sink_kinetic += moving
        if some and self.controls.debris == "remove" and self._exchange.total(
                delete_debris(state, self.density, self._held).size):
            self._take_history(state)
            gone = sum(self._thin(state))
            ledger.deletion += gone
            ledger.debris += gone
        self._renew_contact(state)

    def _thin(self, state: State) -> tuple[float, float]:
        """Take density and deleted elements of `state`; returns the stored and the kinetic energy that go with it."""
        momentum, ledger, mass = self.momentum, state.ledger, self.mass
        dead, loads = momentum.dead, None if momentum.dead is None else momentum.dead.values
        stored = self._take_density(state)
        if self._viscous is not None:
            ratio = np.divide(self.mass, mass, out=np.zeros_like(mass), where=mass > 0.0)
            self._viscous *= ratio[:, None]  # as the inertia, of kept accelerations; 0 without mass
        half_v2, dot = half_square(state.v), self._exchange.dot
        if dead is not None and loads is not None:
            ledger.work += dead.changed(loads, state.u)
            ledger.loads = dead.potential(state.u)
        self._elastic -= stored
        ledger.elastic = self._elastic
        ledger.kinetic = dot(self.mass, half_v2)
        return stored, dot(mass - self.mass, half_v2)

    def sync(self, state: State) -> None:
        """Bring `state.W_max`, and the motion of nodes that follow the lips, up to date."""
        self._give_history(state)
        if self.momentum.contact is not None:
            self.momentum.contact.place(state.v)
            self.momentum.contact.place(state.a)

    def _renew_contact(self, state: State) -> None:
        """Book the energy that the medium loses at fixed displacement as density falls."""
        contact = self.momentum.contact
        if contact is None:
            return
        self.reaction[contact.massless] = 0.0
        contact.book(state.ledger, state.u)
        self._pressed = contact.energy

    # --- the step size ---
    @property
    def dt(self) -> float:
        """The current step [s]."""
        return self.length.dt

    @property
    def estimates(self) -> int:
        """Frequency estimates made."""
        return self.length.estimates

    @property
    def rejected(self) -> int:
        """Steps that were made again at half length."""
        return self.length.rejected

    def step_share(self, state: State) -> float:
        """The step over the stability limit of `state` as it is now; nothing is changed."""
        share = self.length.share(state.u, self.mass, self._swinging, self._compression)
        return share if self.subcycling is None else max(share, self.subcycling.step_share(state.u, self.dt))

    # --- checkpoints ---
    def memory(self) -> dict[str, np.ndarray]:
        """What the integrator remembers beyond the state, for a checkpoint."""
        return {"reaction": self.reaction, "zone_depths": np.array([zone.depth for zone in self._zones], float),
                **{name: np.array(getattr(self, name)) for name in self._REMEMBERED}, **self.length.memory(),
                **({} if self._viscous is None else {"viscous": self._viscous}),
                **({} if self.subcycling is None else self.subcycling.memory()), **self.momentum.memory()}

    def restore(self, state: State, memory: dict[str, np.ndarray]) -> None:
        """Go on exactly where :meth:`memory` was taken."""
        self.momentum.restore(memory)
        self.start(state)
        self.reaction = memory["reaction"]
        if self._viscous is not None:
            self._viscous = memory["viscous"]
        for name in self._REMEMBERED:
            setattr(self, name, memory[name].item())
        self.length.restore(memory)
        if self.subcycling is not None:
            self.subcycling.restore(memory)
        if self.density.zone is not None:
            self._zones = tuple(self.density.zone.of_depth(depth) for depth in memory["zone_depths"])
