"""Implicit Hilber-Hughes-Taylor integration (Eq. 25-29), with adaptive steps.

    M a_{n+1} + (1 + alpha) F_{n+1} - alpha F_n = 0,        F: internal and viscous force less the loads,
    u_{n+1} = u_n + dt v_n + dt^2 [(1/2 - beta) a_n + beta a_{n+1}],
    v_{n+1} = v_n + dt [(1 - g) a_n + g a_{n+1}],       beta = (1 - alpha)^2/4,  g = 1/2 - alpha.

The two fields are coupled either by iterating them together in each step as in Fig. 2 of the paper, or by a single
pass: gamma from the last accepted state, then Newton's method at that gamma. The paper's HHT weights on gamma
(Eq. 25) multiply an equation that has no rate term; they change its iteration, not its solution, and are left out.

A step is accepted when, over the nodes that still have mass, the largest residual is below `force_tolerance` times
the mean force of the elements on their nodes plus the mean inertia, the last correction below `correction_tolerance`
times the increment, gamma has settled, no live point is inside out, and the scheme has not fed in more energy than
`gain_tolerance` allows. Where elements fail a step is at most 0.1 l/c_s. History and deletions are
committed on accepted steps only.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..errors import ConvergenceError, ParameterError
from ..fields.body import Body
from ..fields.deletion import delete_failed
from ..fields.density import Density
from ..fields.energy import Ledger
from ..fields.state import State
from .controls import EventControls, HHTControls
from .hht_ledger import Balance, book_motion, book_sink, book_viscous
from .hht_trial import Scheme, Trial
from .looked import OneBody

__all__ = ["HHT"]

log = logging.getLogger(__name__)


class HHT(OneBody):
    """Integrates a :class:`State`; see the module for the scheme.

    Memory: step size and the terms of the balances at the last accepted state: after `begin`, `start` or `restore`,
    `run` and `step` go on with that one state, `reaction` is of it; `memory` gives what a checkpoint needs. An attempt
    that is given up leaves nothing behind but a shorter step.

    Parameters
    ----------
    body: the balances, and what loads it. A step ends at each corner of its loading.
    controls: options.
    to_onset: in loading, steps are long, and near the limit load what takes iterations is that gamma follows slowly:
        factors are kept for it, and a step in which it runs away is cut at once, without a warning.

    Attributes
    ----------
    dt: size of the next step [s].   rejected: steps given up.   iterations: Newton iterations made.
    """

    added_mass = 0.0

    GROW = 1.5  # times the last step is the next one at the most

    def __init__(self, body: Body, controls: HHTControls | None = None, *, to_onset: bool = False) -> None:
        self.body, self.momentum, self.density, self.loading = body, body.momentum, body.density, body.loading
        self.controls, self.to_onset = controls or HHTControls(), to_onset
        self.space, self.free = body.space, body.free
        if not self.free.any():
            raise ParameterError("every node is held in every direction, so that nothing can move by itself: take "
                                 "integrator = 'explicit', or analysis = 'quasistatic'")
        self.scheme = Scheme(body, self.controls, to_onset)
        self.inertia, self.solver, self._held = self.scheme.inertia, self.scheme.solver, self.scheme.held
        self._grip_velocity, self._knot = self.loading.velocity(0.0), np.inf
        self.dt = self.controls.dt_first or self.controls.dt
        self._rate = np.zeros_like(self.space.X)  # du/dt of the last step
        self.rejected = self.iterations = 0
        self._cut = False  # whether a step was cut because a crack ran through it

    @classmethod
    def of(cls, body: Body, controls: EventControls) -> HHT:
        """The integrator of a body, with its options among the :class:`.Controls`."""
        return cls(body, controls.hht)

    @property
    def reaction(self) -> np.ndarray:
        """Internal and viscous force of the last accepted state, less the loads, (n, dim)."""
        return self._now.force

    @property
    def factorisations(self) -> int:
        """Numerical factorisations made so far."""
        return self.solver.count

    def start(self, state: State) -> None:
        """Forces and masses of `state`; after a resume :meth:`restore` does it."""
        self._grip_velocity, self._knot = self.loading.velocity(state.grip), self.loading.corner(state.grip)
        self.momentum.set_time(state.grip)
        self.momentum.set_gamma(state.gamma, state.deleted)
        force, viscous = self._forces(state)
        self._loads, self._pressures = self._dead_loads, self.momentum.pressure_values
        self._now = Balance(force, -self.momentum.unheld(force).ravel()[self.free], self.momentum.gamma,
                            self.momentum.W, self.inertia.matrix(), self.inertia.places(), viscous)

    def _forces(self, state: State) -> tuple[np.ndarray, np.ndarray | None]:
        """Internal and viscous force of a state less the loads, and the viscous one, None without viscosity."""
        force = self.momentum.force(state.u)
        if not self.momentum.is_viscous:
            return force, None
        viscous = self.momentum.viscous_force(state.u, state.v)
        return force + viscous, viscous

    def begin(self, state: State) -> None:
        """Set the body in motion: accelerations from the forces, energies of the start."""
        state.v[self._held] = self.loading.motion(state.grip)[self._held]
        self.start(state)
        self.solver.factorize(self._now.mass)
        state.a[...] = 0.0
        state.a.reshape(-1)[self.free] = self.solver.solve(self._now.inertia)
        state.ledger.elastic = self.momentum.energy
        state.ledger.kinetic = self._kinetic(self._now, state.v)
        state.ledger.loads, state.ledger.contact = self.momentum.loads, self.momentum.pressed
        state.ledger.initial = (state.ledger.elastic + state.ledger.kinetic + state.ledger.loads
                                + state.ledger.contact)

    def _kinetic(self, balance: Balance, v: np.ndarray) -> float:
        return self.inertia.kinetic(balance.mass, balance.places, v)

    def run(self, state: State, t_end: float) -> Iterator[State]:
        """Step until `t_end` [s], yielding the state after each accepted step."""
        while state.time < t_end:
            self.step(state)
            yield state

    def step(self, state: State) -> None:
        """One accepted time step; halves the step until one is.

        Raises
        ------
        ConvergenceError
            No step down to `dt_least` converges.
        """
        if self.controls.coupling == "single":
            self._damage(state)
        while True:
            end = min(state.grip + self.dt, self._knot)
            dt = self.dt if end < self._knot else end - state.grip
            trial = Trial(self.scheme, state, self._now, dt, end)
            if self.loading.smooth:
                trial.predict(self.loading.mean(state.grip, end, dt), self._rate, self.loading.motion(end))
            else:
                trial.predict(self._grip_velocity, self._rate)
            accepted = trial.iterate()
            self.iterations += trial.corrections
            if accepted and self._accept(state, trial):
                break
            if trial.cracked and not (self.to_onset or self._cut):
                self._cut = True
                log.warning("a step of %.3g s would let a crack run through at once: steps in which elements fail are "
                            "cut to 0.1 l/c_s = %.3g s; hht_dt at or below it spares the attempts", dt,
                            self.scheme.failing_step)
            self.rejected += 1
            self.dt = 0.5 * dt
            if self.dt < self.controls.dt_least:
                raise ConvergenceError(f"the implicit integration stalled at t = {state.time:.4g} s: no step down to "
                                       f"{self.controls.dt_least:.1g} s converges; lower hht_dt (now "
                                       f"{self.controls.dt:g} s), or take integrator = 'explicit'")
        if trial.corrections <= self.controls.max_iterations // 2:
            self.dt = min(self.dt * self.GROW, self.controls.dt)

    def _damage(self, state: State) -> None:
        """Single pass: bring gamma up to the history of the accepted state, at fixed displacement and velocity."""
        momentum, ledger, old = self.momentum, state.ledger, self._now
        new = self.density.update(state.W_max, Density(state.gamma, state.sink))
        state.gamma, state.sink = new.gamma, new.sink
        momentum.set_time(state.grip)
        momentum.set_gamma(state.gamma, state.deleted)
        self._book_loads(state)
        ledger.drop(self.space.w, old.W, old.gamma, momentum.gamma)
        places, mass = self.inertia.places(), self.inertia.matrix()
        ledger.sink_kinetic += float(np.vdot(old.places - places, self.inertia.half_v2(state.v)))
        momentum.book_contact(ledger, state.u)
        force, viscous = self._forces(state)
        self._now = Balance(force, self.inertia.times(mass, state.a.ravel()[self.free]), momentum.gamma, old.W, mass,
                            places, viscous)

    @property
    def _dead_loads(self) -> np.ndarray | None:
        return None if self.momentum.dead is None else self.momentum.dead.values

    def _book_loads(self, state: State) -> None:
        """Work of the dead loads that have changed at fixed displacement, as where elements under them are gone."""
        if self.momentum.dead is not None and self._loads is not None:
            state.ledger.work += self.momentum.dead.changed(self._loads, state.u)
            self._loads = self.momentum.dead.values

    # --- a step that is taken ---
    def _accept(self, state: State, trial: Trial) -> bool:
        """Take a step; False, and nothing has changed, if the scheme feeds in too much energy in it."""
        momentum, dt, v = self.momentum, trial.dt, trial.velocity
        new = Balance(trial.force, -trial.weighted, momentum.gamma, momentum.W, trial.mass, self.inertia.places(),
                      trial.viscous)
        ledger = replace(state.ledger)
        loads = self._book(ledger, state, trial, new, v)
        energy = max(abs(ledger.initial), ledger.elastic + ledger.kinetic, self.momentum.energy,
                     self.body.least_energy)
        if not state.ledger.numerical - ledger.numerical <= self.controls.gain_tolerance * energy:
            return False
        state.ledger, self._loads, self._pressures = ledger, loads, momentum.pressure_values
        self._rate = (trial.u - state.u) / dt
        state.u, state.gamma, state.sink = trial.u, trial.density.gamma, trial.density.sink
        state.a, state.v = trial.a.copy(), v
        state.W_max = np.maximum(state.W_max, new.W)
        state.time += dt
        state.grip = trial.end
        state.step += 1
        self._bury(state, new)
        if trial.end == self._knot:
            self._grip_velocity, self._knot = self.loading.velocity(trial.end), self.loading.corner(trial.end)
            before = self.inertia.guided(self._now.places, state.v)
            state.v[self._held] = self.loading.motion(trial.end)[self._held]
            gained = self.inertia.guided(self._now.places, state.v) - before
            state.ledger.kinetic += gained
            state.ledger.work += gained
            if self.momentum.is_viscous:
                force, viscous = self._forces(state)
                self._now = self._now._replace(force=force, viscous=viscous)
        return True

    def _book(self, ledger: Ledger, state: State, trial: Trial, new: Balance, v: np.ndarray) -> np.ndarray | None:
        """Book a step, with the velocity `v` (n, dim) after it, in a ledger of the state before; returns dead loads."""
        old, dead, du = self._now, self.momentum.dead, trial.u - state.u
        half_v2 = self.inertia.half_v2(state.v), self.inertia.half_v2(v)
        stored, rest = book_sink(ledger, self.space.w, old, new, half_v2)
        accelerations = state.a.ravel()[self.free], trial.a.ravel()[self.free]
        motion = book_motion(self.inertia, old, new, accelerations, du.ravel()[self.free], (trial.dt, self.controls))
        motion -= rest
        stored += self.momentum.pressed - ledger.contact
        ledger.contact = self.momentum.pressed
        held = float((0.5 * (old.force + new.force) * du)[self._held].sum())
        ledger.numerical += held - stored - motion
        mean = 0.5 * (old.places + new.places)
        ledger.work += held + self.inertia.guided(mean, v) - self.inertia.guided(mean, state.v)
        book_viscous(ledger, old, new, du)
        given = self.momentum.pressure_work(state.u, trial.u, self._pressures)
        ledger.numerical += given
        ledger.book_pressure(given)
        if dead is not None and self._loads is not None:
            ledger.numerical += dead.effort(self._loads, du)
            ledger.work += dead.changed(self._loads, state.u + 0.5 * du)
            return dead.values
        return self._loads

    def _bury(self, state: State, new: Balance) -> None:
        """Delete what has failed in a step; nodes without mass stand still."""
        momentum, ledger = self.momentum, state.ledger
        failed = delete_failed(self.space, state, self.body.deletion, self.density.failure_energy).size
        if failed or momentum.contact is not None:
            momentum.set_gamma(state.gamma, state.deleted)
        if failed:
            self._book_loads(state)
            ledger.deletion += float(np.einsum("eq,eq,eq->", self.space.w, new.gamma - momentum.gamma, new.W))
        mass, places = self.inertia.matrix(), self.inertia.places()
        moving = self._kinetic(new, state.v)
        dead = self.space.lump(momentum.gamma) <= 0.0
        state.v[dead] = 0.0
        state.a[dead] = 0.0
        ledger.kinetic = self.inertia.kinetic(mass, places, state.v)
        ledger.deletion += moving - ledger.kinetic  # with what the mass floor of dead nodes still had
        momentum.book_contact(ledger, state.u)
        force, viscous = self._forces(state)
        ledger.elastic, ledger.loads = momentum.energy, momentum.loads
        self._now = Balance(force, new.inertia, momentum.gamma, momentum.W, mass, places, viscous)

    def step_share(self, state: State) -> float:
        """Infinity: the scheme has no stability limit."""
        return np.inf

    # --- checkpoints ---
    def sync(self, state: State) -> None:
        """Nothing to do: the state is complete after every step."""

    def memory(self) -> dict[str, np.ndarray]:
        """What the integrator remembers beyond the state, for a checkpoint."""
        return {"inertia": self._now.inertia, "rate": self._rate, **self.momentum.memory(),
                **{name: np.array(getattr(self, name)) for name in ("dt", "rejected", "iterations")}}

    def restore(self, state: State, memory: dict[str, np.ndarray]) -> None:
        """Go on exactly where :meth:`memory` was taken."""
        self.momentum.restore(memory)
        self.start(state)
        self._now = self._now._replace(inertia=memory["inertia"])
        self._rate = memory["rate"]
        self.dt = memory["dt"].item()
        self.rejected, self.iterations = memory["rejected"].item(), memory["iterations"].item()
