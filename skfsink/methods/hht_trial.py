"""A step of the implicit scheme on trial: its prediction, and the iteration of the two fields (Fig. 2 of the paper)."""

from __future__ import annotations

import numpy as np

from ..errors import ConvergenceError
from ..fem.direct import Factorization
from ..fem.indicators import inverted
from ..fem.pattern import Pattern
from ..fields.body import Body
from ..fields.density import Density
from ..fields.state import State
from .controls import HHTControls
from .hht_ledger import Balance
from .inertia import Inertia

__all__ = ["Scheme", "Trial"]


class Scheme:
    """What all steps of an integration share.

    Parameters
    ----------
    body, controls, to_onset: see :class:`.HHT`.

    Attributes
    ----------
    held: mask of the components that grips hold, (n, dim).
    inertia, solver, pattern: mass, and factors of matrices on the pattern of the tangent.
    transit: time of the slowest shear wave through the body [s].
    failing_step: longest step in which elements may fail, 0.1 l/c_s of the fastest material [s].
    rounding: force [N; N/mm in 2D] and displacement [mm] so small that rounding hides them.
    """

    def __init__(self, body: Body, controls: HHTControls, to_onset: bool) -> None:
        self.body, self.controls, self.to_onset = body, controls, to_onset
        momentum, space = body.momentum, body.space
        self.held = ~body.free.reshape(-1, space.dim)
        self.pattern = Pattern(space, space.dim, body.free, upper=True)
        self.inertia = Inertia(momentum, self.pattern, body.free, controls.mass, controls.mass_floor)
        self.solver = Factorization(self.pattern, threads=body.threads)
        slowest, fastest = (speed * 1e3 for speed in momentum.shear_wave_speeds)
        self.transit = body.size / slowest
        self.failing_step = 0.1 * body.density.law.length_scale / fastest  # a crack may run in any of the materials
        h = float(space.h.min())
        self.rounding = 1e-9 * momentum.shear_moduli[1] * h ** (space.dim - 1), 1e-9 * h


class _Rejected(Exception):
    """The trial is given up."""


class Trial:
    """A step from an accepted state, `dt` [s] long, to the load time `end` [s].

    Memory: all of it: `predict`, then `iterate`, and `velocity` of the last of these. The state is not changed; the
    momentum balance is left at the trial. The medium between lips is that of the accepted state throughout.

    Attributes
    ----------
    u, a: displacement [mm] and acceleration [mm/s^2] at its end, (n, dim).
    density: relative density at its end.   force: internal and viscous force less the loads there, (n, dim).
    viscous: viscous force in it, None without viscosity.
    weighted: forces as the scheme weights them, (1 + alpha) F_{n+1} - alpha F_n, over the free unknowns.
    mass: data of the mass matrix.   corrections: Newton steps made.
    cracked: whether it was given up since a crack had run through it.
    """

    FRESH, KEPT = 3, 25  # iterations of a step to the onset with factors of their own; then these serve so many
    LIVE = 0.5           # gamma of a point that must not be inside out
    RUNS_AWAY = 3        # iterations in a row in which the change of gamma grows, at which a step to the onset is cut

    def __init__(self, scheme: Scheme, state: State, old: Balance, dt: float, end: float) -> None:
        self.scheme, self.state, self.old, self.dt, self.end = scheme, state, old, dt, end
        self.momentum, self._free = scheme.body.momentum, scheme.body.free
        self.density = Density(state.gamma, state.sink)
        self.viscous: np.ndarray | None = None
        self._end_velocity: np.ndarray | None = None
        self.corrections, self.cracked = 0, False
        self._correction = self._change = np.inf  # the last ones of displacement [mm] and gamma
        self._settled, self._growing = scheme.controls.coupling == "single", 0

    def predict(self, grip_velocity: np.ndarray, rate: np.ndarray, end_velocity: np.ndarray | None = None) -> None:
        """First guess, with the grips at `grip_velocity` (n, dim) [mm/s]; `rate` is du/dt of the step before.

        `end_velocity` is that of the grips at the end of the step, where it is another one than at its beginning.
        """
        self._end_velocity = end_velocity
        c, dt, state = self.scheme.controls, self.dt, self.state
        self.momentum.set_time(self.end)
        self.momentum.set_gamma(state.gamma, state.deleted, medium=False)
        self.mass = self.scheme.inertia.matrix()
        base = state.u + dt * state.v + dt * dt * (0.5 - c.beta) * state.a
        if dt <= self.scheme.transit:
            self.u, self.a = base + dt * dt * c.beta * state.a, state.a.copy()
        else:  # a step in which waves cross the body many times: its motion goes on as in the step before
            self.u = state.u + dt * rate
            self.a = (self.u - base) / (c.beta * dt * dt)
        held = self.scheme.held
        self.u[held] = (state.u + dt * grip_velocity)[held]
        self.a[held] = 0.0

    def iterate(self) -> bool:
        """Iterate both fields until they are in balance; False where the step has to be given up."""
        try:
            with np.errstate(over="ignore"):  # where a trial runs away, before its energy is no finite number
                return self._converges()
        except _Rejected:
            return False

    def _converges(self) -> bool:
        c = self.scheme.controls
        while True:
            residual, inertia, live = self._residual()
            if self._balanced(residual, inertia, live):
                self.cracked = self._runs_through()
                return not (self.cracked or self._is_inside_out())
            if self.corrections == c.max_iterations:
                return False
            self._correct(residual, live)
            if c.coupling == "iterated":
                self._couple()

    def _evaluate(self) -> None:
        """Force at the displacement; a trial without a finite energy is given up."""
        self.force = self.momentum.force(self.u)
        if not np.isfinite(self.momentum.energy):
            raise _Rejected

    @property
    def velocity(self) -> np.ndarray:
        """Velocity at the end by Newmark's formula (n, dim); what is held moves as the grips do then."""
        free, g = self._free, self.scheme.controls.newmark_gamma
        a0, a1 = self.state.a.ravel()[free], self.a.ravel()[free]
        v = self.state.v.copy()
        v.reshape(-1)[free] = self.state.v.ravel()[free] + self.dt * ((1 - g) * a0 + g * a1)
        if self._end_velocity is not None:
            np.copyto(v, self._end_velocity, where=self.scheme.held)
        return v

    def _residual(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Residual of Eq. (26), inertia in it, and the mask of what still has mass, over the free unknowns."""
        alpha, body = self.scheme.controls.alpha, self.scheme.body
        self._evaluate()
        if self.momentum.is_viscous:
            self.viscous = self.momentum.viscous_force(self.u, self.velocity)
            self.force += self.viscous
        inertia = self.scheme.inertia.times(self.mass, self.a.ravel()[self._free])
        weighted = self.momentum.unheld((1 + alpha) * self.force - alpha * self.old.force)
        self.weighted = weighted.ravel()[self._free]
        whole = body.space.lump(self.momentum.gamma) > 1e-3 * body.density.load
        live = np.repeat(whole, body.space.dim)[self._free]
        if not live.any():
            raise _Rejected  # it kills the whole body
        return inertia + self.weighted, inertia, live

    def _balanced(self, residual: np.ndarray, inertia: np.ndarray, live: np.ndarray) -> bool:
        c, rounding = self.scheme.controls, self.scheme.rounding
        level = self.momentum.backend.mean_force() + float(np.mean(np.abs(inertia[live]))) + rounding[0]
        increment = float(np.abs((self.u - self.state.u).ravel()[self._free][live]).max()) + rounding[1]
        return bool(np.abs(residual[live]).max() <= c.force_tolerance * level
                    and self._correction <= c.correction_tolerance * increment and self._settled)

    def _runs_through(self) -> bool:
        """Whether the step has converged, but to a crack that has run through it."""
        fall = float((self.state.gamma - self.density.gamma).max())
        return self.dt > self.scheme.failing_step and fall > 0.5

    def _is_inside_out(self) -> bool:
        """Whether a live point is."""
        if self.momentum.least_J > 0.0:
            return False
        return inverted(self.scheme.body.space, self.u, self.momentum.gamma)[1] > self.LIVE

    def _correct(self, residual: np.ndarray, live: np.ndarray) -> None:
        """A Newton step of displacement and acceleration at fixed gamma."""
        scheme, factor = self.scheme, self.scheme.controls.beta * self.dt * self.dt
        fresh = not scheme.to_onset or self.corrections < self.FRESH or self.corrections % self.KEPT == 0
        self.corrections += 1
        try:
            if fresh:
                tangent = self.momentum.tangent(scheme.pattern, self.u)
                if self.momentum.is_viscous:
                    rate = scheme.controls.newmark_gamma * self.dt / factor  # dv/du
                    tangent += rate * self.momentum.viscous_tangent(scheme.pattern, self.u, self.velocity)
                scheme.solver.factorize(self.mass / factor + (1 + scheme.controls.alpha) * tangent)
            d = self._solve(-residual)
        except ConvergenceError:
            raise _Rejected from None
        step = np.zeros_like(self.u)
        step.reshape(-1)[self._free] = d
        self._correction = float(np.abs(d[live]).max())
        self.u = self.u + step
        self.a = self.a + step / factor  # not from u - base, which cancels at small steps

    def _solve(self, b: np.ndarray) -> np.ndarray:
        """Solution for the right-hand side `b` with the factors, and with lips that press on each other."""
        solver, B = self.scheme.solver, self.momentum.added_stiffness(self.u, self._free)
        if B is None:
            return solver.solve(b, tolerance=1e-8)
        return solver.solve_sum(np.sqrt(1 + self.scheme.controls.alpha) * B, b)

    def _couple(self) -> None:
        """The density that follows the displacement."""
        state, gamma = self.state, self.density.gamma
        self._evaluate()
        try:
            self.density = self.scheme.body.density.update(np.maximum(state.W_max, self.momentum.W), self.density)
        except ConvergenceError:  # of a trial that stretches points beyond what the sink can take
            raise _Rejected from None
        last, self._change = self._change, float(np.abs(self.density.gamma - gamma).max())
        self._settled = self._change <= self.scheme.controls.gamma_tolerance
        self._growing = self._growing + 1 if self._change > last else 0
        if self.scheme.to_onset and self._growing >= self.RUNS_AWAY:
            raise _Rejected
        self.momentum.set_gamma(self.density.gamma, state.deleted, medium=False)
        self.mass = self.scheme.inertia.matrix()
