"""Statics: Newton's method with an energy line search, loading to the onset, and quasi-static propagation.

Up to a sharp limit the loaded body is elastic and gamma hardly moves; beyond it no static solution exists. Loading
looks for that limit, the *onset*, by bisection on the load. A quasi-static analysis then holds the grips just past
the onset and lets the crack run through a sequence of equilibria, giving up at each the energy that a dynamic
analysis would turn into motion.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .deletion import delete_failed
from .density import DensitySolver
from .errors import ConvergenceError, require
from .direct import Factorization
from .momentum import Momentum
from .space import Pattern
from .state import State

__all__ = ["Statics", "StaticsControls"]


@dataclass(frozen=True)
class StaticsControls:
    """Options of the static analyses.

    Parameters
    ----------
    tolerance: residual force at which equilibrium is reached, relative to the forces inside, in (0, 0.01].
    gamma_tolerance: change of gamma in a pass at which the coupled fields are converged, in (0, 0.01].
    increment: first (and largest) load increment, as displacement of a grip over the size of the body, in (0, 0.5].
    onset_tolerance: width of the last bisection interval of the onset, relative to the load, in (0, 0.1].
    max_newton: Newton steps after which an equilibrium is given up, >= 3.
    max_passes: passes over the two fields after which a load increment is given up, >= 3.
    """

    tolerance: float = 1e-7
    gamma_tolerance: float = 1e-5
    increment: float = 0.01
    onset_tolerance: float = 5e-4
    max_newton: int = 40
    max_passes: int = 80

    def __post_init__(self) -> None:
        require("static-tolerance", self.tolerance, low=0, high=0.01, low_open=True)
        require("gamma-tolerance", self.gamma_tolerance, low=0, high=0.01, low_open=True)
        require("increment", self.increment, low=0, high=0.5, low_open=True)
        require("onset-tolerance", self.onset_tolerance, low=0, high=0.1, low_open=True)
        require("max-newton", self.max_newton, low=3, whole=True)
        require("max-passes", self.max_passes, low=3, whole=True)


class Statics:
    """Equilibria of a body between grips.

    Parameters
    ----------
    momentum, density: the two fields.
    free: (n*dim,) mask of the degrees of freedom that no grip holds.
    grip_velocity: (n, dim) velocity of the held ones [mm/s]; at load time t they are displaced by velocity times t.
    deletion: gamma at which an element fails.
    """

    LIVE = 1e-3     # nodes with less than this of their mass are not asked for equilibrium
    KEEP = 0.2      # a factorisation is kept while each step with it lowers the residual to this fraction
    LEAST_J = 0.05  # of a Gauss point that still carries force; below, a trial is refused

    def __init__(self, momentum: Momentum, density: DensitySolver, free: np.ndarray, grip_velocity: np.ndarray,
                 controls: StaticsControls | None = None, deletion: float = 1e-6, threads: int = 1) -> None:
        self.momentum, self.density, self.deletion = momentum, density, deletion
        self.controls = controls or StaticsControls()
        self.space = momentum.space
        self.free = free
        self.grip_velocity = grip_velocity
        self.pattern = Pattern(self.space, self.space.dim, free, upper=True)
        self.solver = Factorization(self.pattern, threads=threads)
        self._volume = self.space.lump(np.ones_like(self.space.w))
        # a body that has come apart bears no force; this says what counts as none
        size = float(self.space.V.sum()) ** (1 - 1 / self.space.dim)
        self._least_force = 1e-3 * momentum.material.shear_modulus * size
        # rounding of the stored energy: I1' - 3 is a difference of numbers of order one
        self._noise = 1e-14 * momentum.material.shear_modulus * float(self.space.V.sum())
        self.newton_steps = 0
        self.settled = False      #: whether the last sweep of `propagate` found nothing left to change
        self.increment = 0.0      #: current load increment, as load time [s]; 0 before the first
        self._stale = True

    # --- equilibrium at fixed gamma ---
    def _live(self) -> np.ndarray:
        live: np.ndarray = self.space.lump(self.momentum.gamma) > self.LIVE * self._volume
        return np.repeat(live, self.space.dim)[self.free]

    def equilibrium(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement in equilibrium at the current gamma, from the guess `u` with the grips in place, and its force.

        Raises
        ------
        ConvergenceError
            No equilibrium within `max_newton` steps, or no step that lowers the energy.
        """
        c, live, momentum = self.controls, self._live(), self.momentum
        u = u.copy()
        force = momentum.force(u)
        energy = momentum.energy
        lowest = min(self.LEAST_J, momentum.least_J)
        last, fresh = np.inf, False
        for _ in range(c.max_newton):
            r = force.ravel()[self.free]
            error = float(np.linalg.norm(r[live]) / (np.linalg.norm(force) + self._least_force))
            if error <= c.tolerance:
                return u, force
            self.newton_steps += 1
            if self._stale or error > self.KEEP * last:
                self.solver.factorize(momentum.tangent(self.pattern, u))
                self._stale, fresh = False, True
            last = error
            d = self.solver.solve(-r, tolerance=1e-6)
            slope = float(r @ d)
            if slope >= 0:  # indefinite tangent: go down the gradient, scaled by the diagonal
                diagonal = np.abs(momentum.tangent(self.pattern, u)[self.pattern.diagonal])
                d = -r / np.maximum(diagonal, 1e-12 * diagonal.max())
                slope = float(r @ d)
            step = np.zeros(u.shape)
            step.reshape(-1)[self.free] = d
            length = 1.0
            while True:
                trial = momentum.force(u + length * step)
                fits = momentum.least_J >= lowest and np.isfinite(momentum.energy)
                if fits and momentum.energy <= energy + 1e-4 * length * slope + self._noise:
                    break
                length *= 0.5
                self._stale = True
                if length < 1e-6:
                    if not fresh:
                        break
                    raise ConvergenceError("no equilibrium: the energy falls in no direction Newton's method offers")
            if length < 1e-6:  # the direction came from an old factorisation
                force = momentum.force(u)
                continue
            u += length * step
            force, energy = trial, momentum.energy
        raise ConvergenceError(f"no equilibrium within {c.max_newton} Newton steps")

    def _predict(self, u: np.ndarray, increment: float) -> np.ndarray:
        """`u` after moving the grips for a further load time `increment`, to first order in it."""
        move = self.grip_velocity * increment
        size = np.abs(move).max() + 1e-300
        eps = 1e-6 * float(self.space.h.min()) / size
        self.solver.factorize(self.momentum.tangent(self.pattern, u))
        self._stale = False
        pull = (self.momentum.force(u + eps * move) - self.momentum.force(u - eps * move)) / (2 * eps)
        residual = self.momentum.force(u)
        d = np.zeros(u.size)
        d[self.free] = self.solver.solve(-(residual + pull).ravel()[self.free], tolerance=1e-6)
        return u + move + d.reshape(u.shape)

    # --- both fields ---
    def _settle(self, state: State, u: np.ndarray) -> tuple[np.ndarray, ...] | None:
        """Iterate the two fields from the guess `u`; (u, force, gamma, W_max, W), or None if they run away."""
        c = self.controls
        gamma, W_max = state.gamma, state.W_max
        last, growing = np.inf, 0
        for _ in range(c.max_passes):
            try:
                u, force = self.equilibrium(u)
            except ConvergenceError:
                return None
            W = self.momentum.W
            W_max = np.maximum(state.W_max, W)
            new = self.density.solve(W_max, gamma)
            change = float(np.abs(new - gamma).max())
            gamma = new
            self.momentum.set_gamma(gamma, state.deleted)
            if change <= c.gamma_tolerance:
                return u, force, gamma, W_max, W
            growing = growing + 1 if change > 0.98 * last else 0
            if growing >= 3 or gamma.min() < 0.2:
                return None
            last = change
        return None

    def load(self, state: State) -> Iterator[State]:
        """Load `state` to the onset, yielding it after each accepted increment; the last one is the onset.

        The ledger's work is the trapezoidal work of the grips, so its balance shows the error of the increments.
        """
        c = self.controls
        size = float(np.ptp(self.space.X, axis=0).max())
        speed = float(np.abs(self.grip_velocity).max())
        if self.increment == 0.0:
            self.increment = c.increment * size / speed
        ledger = state.ledger
        held = ~self.free.reshape(state.u.shape)
        self.momentum.set_gamma(state.gamma, state.deleted)
        force = self.momentum.force(state.u)
        W = self.momentum.W
        while True:
            self.momentum.set_gamma(state.gamma, state.deleted)
            try:
                settled = self._settle(state, self._predict(state.u, self.increment))
            except ConvergenceError:
                settled = None
            if settled is None:
                self.increment *= 0.5
                if self.increment <= c.onset_tolerance * (state.grip + self.increment):
                    if state.grip == 0.0:
                        raise ConvergenceError("the body finds no equilibrium under the smallest load increment")
                    self.momentum.set_gamma(state.gamma, state.deleted)
                    self.momentum.force(state.u)
                    return
                continue
            u, new_force, gamma, W_max, W_new = settled
            ledger.work += 0.5 * float(np.sum((force + new_force)[held] * (u - state.u)[held]))
            before = self.momentum.effective(state.gamma, state.deleted)
            ledger.drop(self.space.w, 0.5 * (W + W_new), before, self.momentum.gamma)
            state.u, state.gamma, state.W_max = u, gamma, W_max
            force, W = self.momentum.force(state.u), W_new  # at the settled gamma, as after a resume
            state.grip += self.increment
            state.time = state.grip
            state.step += 1
            ledger.elastic = self.momentum.energy
            yield state

    # --- quasi-static propagation ---
    def propagate(self, state: State, advance: float = 0.005, limit: float = 3.0) -> Iterator[State]:
        """Let the crack run through equilibria, yielding after each sweep; the caller stops when it has crossed.

        A sweep: equilibrium at fixed gamma (the energy it gives up is `released`), then the history, gamma and the
        deletions at fixed displacement (what they take is D). The grips stand still while the crack runs; where it
        arrests, `settled` is set, and the next sweep moves them on by `advance` times their displacement.

        Raises
        ------
        ConvergenceError
            The crack has not crossed at `limit` times the displacement of the start.
        """
        ledger = state.ledger
        furthest = limit * state.grip
        if state.step == 0:
            self.momentum.set_gamma(state.gamma, state.deleted)
            self.momentum.force(state.u)
            ledger.initial = ledger.elastic = self.momentum.energy
        while True:
            self.momentum.set_gamma(state.gamma, state.deleted)
            self.momentum.force(state.u)
            self._stale = True  # so that a sweep depends on the state alone
            if self.settled:
                self._advance(state, advance * state.grip)
                if state.grip > furthest:
                    raise ConvergenceError(f"the crack has not crossed the sample at {limit:g} times the onset load")
            else:
                before = self.momentum.energy
                state.u, _ = self.equilibrium(state.u)
                ledger.released += before - self.momentum.energy
            W = self.momentum.W
            state.W_max = np.maximum(state.W_max, W)
            gamma = self.density.solve(state.W_max, state.gamma)
            change = float(np.abs(gamma - state.gamma).max())
            old = self.momentum.gamma
            state.gamma = gamma
            state.step += 1
            state.time = float(state.step)
            undeleted = self.momentum.effective(gamma, state.deleted)
            delete_failed(self.space, state, self.deletion, self.density.law.failure_energy)
            self.momentum.set_gamma(gamma, state.deleted)
            ledger.drop(self.space.w, W, old, undeleted)
            ledger.deletion += float(np.einsum("eq,eq,eq->", self.space.w, W, undeleted - self.momentum.gamma))
            ledger.elastic = float(np.einsum("eq,eq,eq->", self.space.w, W, self.momentum.gamma))
            self.settled = change <= self.controls.gamma_tolerance
            yield state

    def _advance(self, state: State, increment: float) -> None:
        """Move the grips on by a load time `increment` at fixed gamma, to the new equilibrium."""
        held = ~self.free.reshape(state.u.shape)
        force = self.momentum.force(state.u)
        u, new_force = self.equilibrium(self._predict(state.u, increment))
        state.ledger.work += 0.5 * float(np.sum((force + new_force)[held] * (u - state.u)[held]))
        state.u = u
        state.grip += increment

    # --- checkpoints ---
    def memory(self) -> dict[str, np.ndarray]:
        """What loading remembers beyond the state."""
        return {"increment": np.array(self.increment), "settled": np.array(self.settled)}

    def restore(self, memory: dict[str, np.ndarray]) -> None:
        """Take up what :meth:`memory` gave."""
        self.increment, self.settled = float(memory["increment"]), bool(memory["settled"])
        self._stale = True
