"""Implicit Hilber-Hughes-Taylor integration (Eq. 25-29), with adaptive steps.

    M a_{n+1} + (1 + alpha) F_{n+1} - alpha F_n = 0,        F: internal force less the dead loads,
    u_{n+1} = u_n + dt v_n + dt^2 [(1/2 - beta) a_n + beta a_{n+1}],
    v_{n+1} = v_n + dt [(1 - g) a_n + g a_{n+1}],       beta = (1 - alpha)^2/4,  g = 1/2 - alpha.

The two fields are coupled either by iterating them together in each step as in Fig. 2 of the paper, or by a single
pass: gamma from the last accepted state, then Newton's method at that gamma. The paper's HHT weights on gamma
(Eq. 25) multiply an equation that has no rate term; they change its iteration, not its solution, and are left out.

A step is accepted when, over the nodes that still have mass, the largest residual is below `force_tolerance` times
the mean force of the elements on their nodes plus the mean inertia, the last correction below `correction_tolerance`
times the increment, and gamma has settled. Where elements fail a step is at most 0.1 l/c_s. History and deletions are
committed on accepted steps only.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..errors import ConvergenceError, ParameterError
from ..fem.direct import Factorization
from ..fem.pattern import Pattern
from ..fields.deletion import delete_failed
from ..fields.density import Density, DensitySolver
from ..fields.momentum import Momentum
from ..fields.state import State
from ..loads.schedule import Loading
from .controls import HHTControls
from .inertia import Inertia

__all__ = ["HHT"]

log = logging.getLogger(__name__)


class _Trial(NamedTuple):
    u: np.ndarray
    a: np.ndarray
    density: Density
    force: np.ndarray
    W: np.ndarray
    mass: np.ndarray
    places: np.ndarray


class HHT:
    """Integrates a :class:`State`; see the module for the scheme.

    Memory: step size, forces, inertia and masses of the last accepted state: after `begin`, `start` or `restore`, `run`
    and `step` go on with that one state; `memory` gives what a checkpoint needs. An attempt that is given up leaves
    nothing behind but a shorter step.

    Parameters
    ----------
    momentum, density: the two fields.
    free: (n*dim,) mask of the degrees of freedom that no grip holds.
    motion: of the held ones, as a :class:`.Loading`, or as their velocity (n, dim) [mm/s]. Where a ramp has a knot a
        step ends.
    deletion: gamma at which an element fails.

    Attributes
    ----------
    dt: size of the next step [s].   rejected: steps given up.   iterations: Newton iterations made.
    reaction: (n, dim) internal force of the last accepted state, less the dead loads.
    loading: in loading, steps are long, and near the limit load what takes iterations is that gamma follows slowly:
        factors are kept for it, and a step in which it runs away is cut at once, without a warning.
    """

    loading = False
    FRESH, KEPT = 3, 25  # iterations of a loading step with factors of their own; then these serve so many
    GROW = 1.5
    LEAST_J = 0.02

    def __init__(self, momentum: Momentum, density: DensitySolver, free: np.ndarray, motion: np.ndarray | Loading,
                 controls: HHTControls | None = None, deletion: float = 1e-6, threads: int = 1) -> None:
        self.momentum, self.density, self.deletion = momentum, density, deletion
        self.controls = controls or HHTControls()
        self.space = momentum.space
        if not free.any():
            raise ParameterError("every node is held in every direction, so that nothing can move by itself: take "
                                 "--integrator explicit, or --analysis quasistatic")
        self.free = free
        self._held = ~free.reshape(-1, self.space.dim)
        self._motion = Loading.of(self.space, free, motion)
        self._grip_velocity, self._knot = self._motion.velocity(0.0), np.inf
        self._pattern = Pattern(self.space, self.space.dim, free, upper=True)
        self.inertia = Inertia(momentum, self._pattern, free, self.controls.mass, self.controls.mass_floor)
        self.solver = Factorization(self._pattern, threads=threads)
        self.dt = self.controls.dt_first or self.controls.dt
        size = float(np.ptp(self.space.X, axis=0).max())
        slowest, fastest = (speed * 1e3 for speed in momentum.shear_wave_speeds)
        self._transit = size / slowest  # of the slowest shear wave through the body [s]
        self._rate = np.zeros_like(self.space.X)                           # du/dt of the last step
        self._failing_step = 0.1 * density.law.length_scale / fastest  # a crack may run in any of the materials
        h = float(self.space.h.min())  # forces and displacements so small that rounding hides them
        self._rounding = 1e-9 * momentum.shear_moduli[1] * h ** (self.space.dim - 1), 1e-9 * h
        self.rejected = self.iterations = 0
        self._cut = False  # whether a step was cut because a crack ran through it

    def start(self, state: State) -> None:
        """Forces and masses of `state`; after a resume :meth:`restore` does it."""
        self.momentum.set_time(state.grip)
        self._grip_velocity, self._knot = self._motion.velocity(state.grip), self._motion.knot(state.grip)
        self.momentum.set_gamma(state.gamma, state.deleted)
        self.reaction = self.momentum.force(state.u)
        self._loads = self._dead_loads
        self._W = self.momentum.W
        self._gamma = self.momentum.gamma
        self._mass, self._places = self.inertia.matrix(), self.inertia.places()

    def begin(self, state: State) -> None:
        """Set the body in motion: accelerations from the forces, energies of the start."""
        self.start(state)
        state.v[self._held] = self._grip_velocity[self._held]
        self._inertia = -self.reaction.ravel()[self.free]
        self.solver.factorize(self._mass)
        state.a[...] = 0.0
        state.a.reshape(-1)[self.free] = self.solver.solve(self._inertia)
        state.ledger.elastic = self.momentum.energy
        state.ledger.kinetic = self.inertia.kinetic(self._mass, state.v)
        state.ledger.loads = self.momentum.loads
        state.ledger.initial = state.ledger.elastic + state.ledger.kinetic + state.ledger.loads

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
            trial, iterations = self._attempt(state, dt, end)
            if trial is not None:
                break
            self.rejected += 1
            self.dt = 0.5 * dt
            if self.dt < self.controls.dt_least:
                raise ConvergenceError(f"the implicit integration stalled at t = {state.time:.4g} s: no step down to "
                                       f"{self.controls.dt_least:.1g} s converges; lower --hht-dt (now "
                                       f"{self.controls.dt:g} s), or take --integrator explicit")
        self._accept(state, trial, dt, end)
        if iterations <= self.controls.max_iterations // 2:
            self.dt = min(self.dt * self.GROW, self.controls.dt)

    def _damage(self, state: State) -> None:
        """Single pass: bring gamma up to the history of the accepted state, at fixed displacement and velocity."""
        momentum, ledger = self.momentum, state.ledger
        new = self.density.update(state.W_max, Density(state.gamma, state.sink))
        state.gamma, state.sink = new.gamma, new.sink
        momentum.set_time(state.grip)
        momentum.set_gamma(state.gamma, state.deleted)
        self._book_loads(state)
        ledger.drop(self.space.w, self._W, self._gamma, momentum.gamma)
        masses = self.inertia.places()
        ledger.sink_kinetic += float(np.vdot(self._places - masses, self.inertia.half_v2(state.v)))
        self._gamma, self._places = momentum.gamma, masses
        self._mass = self.inertia.matrix()
        self.reaction = momentum.force(state.u)
        self._inertia = self.inertia.times(self._mass, state.a.ravel()[self.free])

    @property
    def _dead_loads(self) -> np.ndarray | None:
        return None if self.momentum.dead is None else self.momentum.dead.values

    def _book_loads(self, state: State) -> None:
        """Work of the dead loads that have changed at fixed displacement, as where elements under them are gone."""
        if self.momentum.dead is not None and self._loads is not None:
            state.ledger.work += self.momentum.dead.changed(self._loads, state.u)
            self._loads = self.momentum.dead.values

    def _attempt(self, state: State, dt: float, end: float) -> tuple[_Trial | None, int]:
        c, momentum = self.controls, self.momentum
        free = self.free
        density = Density(state.gamma, state.sink)
        momentum.set_time(end)
        momentum.set_gamma(density.gamma, state.deleted)
        mass = self.inertia.matrix()
        shape = state.u.shape
        base = state.u + dt * state.v + dt * dt * (0.5 - c.beta) * state.a
        if dt <= self._transit:
            u, a = base + dt * dt * c.beta * state.a, state.a.copy()
        else:  # a step in which waves cross the body many times: its motion goes on as in the step before
            u = state.u + dt * self._rate
            a = (u - base) / (c.beta * dt * dt)
        u[self._held] = (state.u + dt * self._grip_velocity)[self._held]
        a[self._held] = 0.0
        correction, settled = np.inf, c.coupling == "single"
        change, growing = np.inf, 0
        for iteration in range(c.max_iterations + 1):
            force = momentum.force(u)
            if not (momentum.least_J > self.LEAST_J and np.isfinite(momentum.energy)):
                return None, iteration
            inertia = self.inertia.times(mass, a.ravel()[free])
            r = inertia + ((1 + c.alpha) * force - c.alpha * self.reaction).ravel()[free]
            live = np.repeat(self.space.lump(momentum.gamma) > 1e-3 * self._volume, shape[1])[free]
            if not live.any():
                return None, iteration  # a trial that kills the whole body
            level = momentum.tiles.mean_force() + float(np.mean(np.abs(inertia[live]))) + self._rounding[0]
            increment = float(np.abs((u - state.u).ravel()[free][live]).max()) + self._rounding[1]
            balanced = np.abs(r[live]).max() <= c.force_tolerance * level
            if balanced and correction <= c.correction_tolerance * increment and settled:
                if dt > self._failing_step and float((state.gamma - density.gamma).max()) > 0.5:
                    # converged, but to a crack that has run through a single step
                    if not (self.loading or self._cut):
                        log.warning("a step of %.3g s would let a crack run through at once: steps in which elements "
                                    "fail are cut to 0.1 l/c_s = %.3g s; --hht-dt at or below it spares the attempts",
                                    dt, self._failing_step)
                        self._cut = True
                    return None, iteration
                return _Trial(u, a, density, force, momentum.W, mass, self.inertia.places()), iteration
            if iteration == c.max_iterations:
                break
            self.iterations += 1
            try:
                if not self.loading or iteration < self.FRESH or iteration % self.KEPT == 0:
                    self.solver.factorize(mass / (c.beta * dt * dt)
                                          + (1 + c.alpha) * momentum.tangent(self._pattern, u))
                d = self.solver.solve(-r, tolerance=1e-8)
            except ConvergenceError:
                return None, iteration
            step = np.zeros(u.size)
            step[free] = d
            correction = float(np.abs(d[live]).max())
            u = u + step.reshape(shape)
            a = a + step.reshape(shape) / (c.beta * dt * dt)  # not from u - base, which cancels at small steps
            if c.coupling == "iterated":
                momentum.force(u)
                if not (momentum.least_J > self.LEAST_J and np.isfinite(momentum.energy)):
                    return None, iteration
                gamma = density.gamma
                try:
                    density = self.density.update(np.maximum(state.W_max, momentum.W), density)
                except ConvergenceError:  # of a trial that stretches points beyond what the sink can take
                    return None, iteration
                last, change = change, float(np.abs(density.gamma - gamma).max())
                settled = change <= c.gamma_tolerance
                growing = growing + 1 if change > last else 0
                if self.loading and growing >= 3:
                    return None, iteration
                momentum.set_gamma(density.gamma, state.deleted)
                mass = self.inertia.matrix()
        return None, c.max_iterations

    @property
    def _volume(self) -> np.ndarray:
        return self.density.load

    def _accept(self, state: State, trial: _Trial, dt: float, end: float) -> None:
        c, ledger, free, momentum = self.controls, state.ledger, self.free, self.momentum
        g = c.newmark_gamma
        gamma_new = momentum.gamma
        a0, a1 = state.a.ravel()[free], trial.a.ravel()[free]
        v0 = state.v.ravel()[free]
        v1 = v0 + dt * ((1 - g) * a0 + g * a1)
        du = trial.u - state.u
        w, gamma_old = self.space.w, self._gamma
        total = np.maximum(gamma_old + gamma_new, 1e-300)
        weight = w * (gamma_old - gamma_new) / total
        # A change of gamma W splits exactly into (mean W) d(gamma) + (mean gamma) dW. With W averaged by the gammas and
        # the harmonic mean of gamma, a point that dies within the step is booked with the energy it had, not with what
        # its shape is worth afterwards.
        ledger.sink_stored += float(np.einsum("eq,eq->", weight, gamma_old * self._W + gamma_new * trial.W))
        stored = float(np.einsum("eq,eq,eq->", w, 2 * gamma_old * gamma_new / total, trial.W - self._W))
        v1_full = state.v.copy()
        v1_full.reshape(-1)[free] = v1
        m0, m1 = self._places, trial.places
        k0, k1 = self.inertia.half_v2(state.v), self.inertia.half_v2(v1_full)
        both = np.maximum(m0 + m1, 1e-300)
        ledger.sink_kinetic += float(np.sum((m0 - m1) / both * (m0 * k0 + m1 * k1)))
        # numerical dissipation: the scheme's equations put into the change of kinetic energy at that mean gamma
        dM = trial.mass - self._mass
        inertia = -((1 + c.alpha) * trial.force - c.alpha * self.reaction).ravel()[free]
        da, mean_a = a1 - a0, 0.5 * (a0 + a1)
        M_mean_a = 0.5 * (inertia + self._inertia) - 0.25 * self.inertia.times(dM, da)
        M_da = inertia - self._inertia - self.inertia.times(dM, mean_a)
        v_mean = du.ravel()[free] / dt - dt * (c.beta - g / 2) * da
        motion = dt * float(v_mean @ (M_mean_a + (g - 0.5) * M_da))
        motion -= float(np.sum((m0 - m1) ** 2 / (2 * both) * (k1 - k0)))
        work = 0.5 * (self.reaction + trial.force) * du
        held = float(work[self._held].sum())
        ledger.numerical += held - stored - motion
        ledger.work += held
        if momentum.dead is not None and self._loads is not None:
            ledger.numerical += momentum.dead.effort(self._loads, du)
            ledger.work += momentum.dead.changed(self._loads, state.u + 0.5 * du)
            self._loads = momentum.dead.values
        # commit
        self._rate = du / dt
        state.u, state.gamma, state.sink = trial.u, trial.density.gamma, trial.density.sink
        state.a = trial.a.copy()
        state.v.reshape(-1)[free] = v1
        state.W_max = np.maximum(state.W_max, trial.W)
        state.time += dt
        state.grip = end
        state.step += 1
        before = gamma_new
        if delete_failed(self.space, state, self.deletion, self.density.failure_energy).size:
            momentum.set_gamma(state.gamma, state.deleted)
            self._book_loads(state)
            ledger.deletion += float(np.einsum("eq,eq,eq->", w, before - momentum.gamma, trial.W))
        self._mass, self._places = self.inertia.matrix(), self.inertia.places()
        moving = self.inertia.kinetic(trial.mass, state.v)
        dead = self.space.lump(momentum.gamma) <= 0.0
        state.v[dead] = 0.0
        state.a[dead] = 0.0
        kinetic = self.inertia.kinetic(self._mass, state.v)
        ledger.deletion += moving - kinetic  # with what the mass floor of dead nodes still had
        ledger.kinetic = kinetic
        self.reaction = momentum.force(state.u)
        ledger.elastic, ledger.loads = momentum.energy, momentum.loads
        if end == self._knot:
            self._grip_velocity, self._knot = self._motion.velocity(end), self._motion.knot(end)
            state.v[self._held] = self._grip_velocity[self._held]
        self._inertia, self._W, self._gamma = inertia, momentum.W, momentum.gamma

    def sync(self, state: State) -> None:
        """Nothing to do: the state is complete after every step."""

    def memory(self) -> dict[str, np.ndarray]:
        """What the integrator remembers beyond the state, for a checkpoint."""
        return {"inertia": self._inertia, "rate": self._rate,
                "scalars": np.array([self.dt, self.rejected, self.iterations])}

    def restore(self, state: State, memory: dict[str, np.ndarray]) -> None:
        """Go on exactly where :meth:`memory` was taken."""
        self.start(state)
        self._inertia, self._rate = memory["inertia"], memory["rate"]
        self.dt = float(memory["scalars"][0])
        self.rejected, self.iterations = int(memory["scalars"][1]), int(memory["scalars"][2])
