"""Static loading to the onset of failure, and what it shares with quasi-static propagation.

Grips and dead loads follow the load time, the clock of the loading. Up to a sharp limit the loaded body is elastic
and gamma hardly moves; beyond it no stable equilibrium exists. Loading looks for that limit, the *onset*, by bisection
on the load. Before a crack can begin the whole body may soften: the load then falls while the grips go on. Such
equilibria are followed as long as they are stable, which is tested there (see :meth:`StaticLoading.stable`), so that
the onset is the last stable state, and the strength the greatest load on the way to it.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..errors import ConvergenceError
from ..fem.indicators import greatest_stretch
from ..fields.body import Body
from ..fields.density import Density
from ..fields.state import State
from .controls import StaticsControls
from .load_time import LoadTime
from .newton import Newton

__all__ = ["StaticLoading"]

log = logging.getLogger(__name__)


class _Settled(NamedTuple):
    """Both fields in equilibrium, and the stored energy then."""

    u: np.ndarray
    force: np.ndarray
    density: Density
    W_max: np.ndarray
    W: np.ndarray


class StaticLoading:
    """Equilibria of a body between grips.

    Memory: the next increment and the factors of :class:`.Newton`; `load` goes on from them, `stable` uses the factors,
    `memory` gives both. Of an increment that is given up only its length and these factors are left; the fields are
    those of the state.

    Parameters
    ----------
    body: the balances, and what loads it.
    controls: options.
    newton: what finds equilibria; None for :class:`.Newton` on this rank.
    """

    SOUND = 0.999   # least gamma of a body that is as good as intact
    SOFT = 0.5, 0.02  # growth of the load, of that at the same gamma, and loss of it, past which a body softens
    FINE = 1 / 16, 0.01  # of the largest increment (or what settles the onset, if that is more), and of the way so
    # far: increments of a body that softens
    OPEN = 0.04     # share of the stored energy by which the ledger may open in an increment, unless it is fine
    PERTURBED = 1e-3, 12  # change of gamma by which stability is tested, and passes for it
    OVER = 2.0      # least W/Phi of all points at which a body that has not failed is no body of this theory
    STRETCHED = 20.0  # greatest stretch to which a body is loaded
    STALLED = 0.9  # factor of the changes of gamma a pass from which on the load is within 0.1 % of the onset
    until = np.inf  #: load time at which loading ends without an onset [s]
    LEAST = 1e-6  # part of the first increment at which a body without load is given up

    def __init__(self, body: Body, controls: StaticsControls | None = None, newton: Newton | None = None) -> None:
        self.body, self.momentum, self.density, self.loading = body, body.momentum, body.density, body.loading
        self.controls = controls or StaticsControls()
        self.space, self.free = body.space, body.free
        self.clock = LoadTime(self.loading, body.size, self.momentum.material.shear_modulus, self.controls.increment)
        self.newton = newton or Newton.of(body, self.controls)
        self.increment = 0.0      #: current load increment, as load time [s]; 0 before the first
        self.refused = ""         #: why the last increment was given up: "no equilibrium", "runs away", "passes",
        #: "softens" (the increment is too long to follow the load over its peak), "open" (too long for the ledger) or
        #: "unstable"
        self.unfailed = ""        #: why loading has ended without an onset; empty where there was one
        self.factor = 0.0         #: ratio of the last two changes of gamma in the iteration of the two fields

    def equilibrium(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement in equilibrium at the current gamma, from the guess `u`; see :meth:`.Newton.equilibrium`."""
        return self.newton.equilibrium(u)

    @property
    def newton_steps(self) -> int:
        """Newton steps made so far."""
        return self.newton.steps

    @property
    def factorisations(self) -> int:
        """Numerical factorisations made so far."""
        return self.newton.factorisations

    def _predict(self, u: np.ndarray, increment: float, t: float = 0.0) -> np.ndarray:
        """`u` after moving the grips from load time `t` on for a time `increment`, to first order in it.

        The dead loads are those last given to the momentum balance.
        """
        return self.newton.predict(u, self.loading.mean(t, t + increment, increment) * increment)

    # --- both fields ---
    def _settle(self, state: State, u: np.ndarray) -> _Settled | None:
        """Iterate the two fields from the guess `u`; None if they run away."""
        c = self.controls
        density, W_max = Density(state.gamma, state.sink), state.W_max
        last, growing, self.refused = np.inf, 0, "no equilibrium"
        for _ in range(c.max_passes):
            try:
                u, force = self.newton.equilibrium(u, max(c.tolerance, min(1e-5, 1e-3 * last)))
            except ConvergenceError:
                return None
            W = self.momentum.W
            W_max = np.maximum(state.W_max, W)
            gamma, density = density.gamma, self.density.update(W_max, density)
            change = float(np.abs(density.gamma - gamma).max())
            gamma = density.gamma
            self.momentum.set_gamma(gamma, state.deleted)
            if change <= c.gamma_tolerance:
                return _Settled(u, force, density, W_max, W)
            growing, self.factor = growing + 1 if change > 0.98 * last else 0, change / last
            if growing >= 3 or self.body.kept(gamma).min() < 0.2:
                self.refused = "runs away"
                return None
            last = change
        self.refused = "passes"
        return None

    def stable(self, state: State, settled: _Settled) -> bool:
        """Whether a state that has settled stays as it is when gamma is perturbed at fixed grips.

        A weakening of gamma by chance, uneven as that of a real material, is put through the two fields again and
        again, each time made as large as at first: power iteration on the iteration of the two fields. What grows there
        runs away.
        """
        size, passes = self.PERTURBED
        u, gamma = settled.u, settled.density.gamma
        change = -np.random.default_rng(0).random(gamma.size)
        growth = 0.0
        for _ in range(passes):
            self.momentum.set_gamma(gamma + size / np.abs(change).max() * change, state.deleted)
            try:
                u, _ = self.newton.equilibrium(u)
            except ConvergenceError:
                return False
            change = self.density.solve(np.maximum(settled.W_max, self.momentum.W), gamma) - gamma
            growth = float(np.abs(change).max()) / size
            if growth == 0.0:
                break
        return growth < 1.0

    def _growth(self, state: State, settled: _Settled, force: np.ndarray) -> tuple[float, float]:
        """Growth of the force on the grips along their motion from `force` (n, dim) on, and what it loses by gamma.

        The first is relative to the growth at the same gamma (1 where that is none, or lost in rounding), the second to
        the force itself.
        """
        held = ~self.free.reshape(state.u.shape)
        move = (settled.u - state.u)[held]
        self.momentum.set_gamma(state.gamma, state.deleted)
        elastic = float((self.momentum.force(settled.u) - force)[held] @ move)
        self.momentum.set_gamma(settled.density.gamma, state.deleted)
        if elastic <= 1e-6 * float(np.linalg.norm(force[held]) * np.linalg.norm(move)):
            return 1.0, 0.0
        actual = float((settled.force - force)[held] @ move)
        return actual / elastic, (elastic - actual) / max(abs(float(settled.force[held] @ move)), actual)

    def _refused(self, state: State, settled: _Settled, increment: float, force: np.ndarray) -> str:
        """Why an increment at whose end the body has settled cannot be taken; empty if it can."""
        if self.body.kept(settled.density.gamma).min() > self.SOUND:
            return ""
        growth, loss = self._growth(state, settled, force)
        if growth > self.SOFT[0] and loss < self.SOFT[1]:
            return ""
        way = self.clock.age(state.grip + increment)
        fine = max(self.FINE[0] * self.clock.longest(state.grip), self.controls.onset_tolerance * way)
        if increment > min(fine, self.FINE[1] * way):
            return "softens"
        return "" if growth > 0.0 or self.stable(state, settled) else "unstable"

    def load(self, state: State) -> Iterator[State]:
        """Load `state` to the onset, yielding it after each accepted increment; the last one is the onset.

        An increment ends at the next knot of the loading at the latest; a stretch in which nothing moves is passed
        over. The ledger's work is trapezoidal, so its balance shows the error of the increments. Where nothing moves
        any more, or the body has been loaded beyond sense without failing, loading ends, and `unfailed` says why.

        Raises
        ------
        ConvergenceError
            There is no equilibrium under the smallest increment.
        """
        c, dead = self.controls, self.momentum.dead
        ledger, self.unfailed = state.ledger, ""
        held = ~self.free.reshape(state.u.shape)
        self.momentum.set_time(state.grip)
        self.momentum.set_gamma(state.gamma, state.deleted)
        force = self.momentum.force(state.u)
        W = self.momentum.W
        while state.grip < self.until and not self._beyond(state, W):
            longest = self.clock.longest(state.grip)
            if longest == np.inf:
                state.grip = state.time = self.loading.knot(state.grip)
                self.momentum.set_time(state.grip)
                continue
            self.increment = self.increment or longest
            end = self.clock.end(state.grip, self.increment)
            increment = self.increment if end == state.grip + self.increment else end - state.grip
            self.momentum.set_gamma(state.gamma, state.deleted)  # the loads of an increment given up were of its gamma
            before = None if dead is None else dead.values
            pressures = self.momentum.pressure_values
            self.momentum.set_time(end)
            try:
                settled = self._settle(state, self._predict(state.u, increment, state.grip))
            except ConvergenceError:
                settled, self.refused = None, "no equilibrium"
            if settled is not None and (reason := self._refused(state, settled, increment, force)):
                settled, self.refused = None, reason
            if settled is None:
                self.increment = 0.5 * increment
                self.momentum.set_time(state.grip)
                if state.step == 0 and self.increment < self.LEAST * longest:
                    raise ConvergenceError("the body finds no equilibrium under the smallest load increment")
                if (state.step and self.refused != "softens"  # which has a shorter increment that is taken
                        and self.increment <= c.onset_tolerance * (self.clock.age(state.grip) + self.increment)):
                    self._doubt(state)
                    self.momentum.set_gamma(state.gamma, state.deleted)
                    self.momentum.force(state.u)
                    return
                continue
            trial = replace(ledger)
            trial.work += 0.5 * float(np.sum((force + settled.force)[held] * (settled.u - state.u)[held]))
            if dead is not None and before is not None:
                trial.work += dead.changed(before, 0.5 * (state.u + settled.u))
            trial.book_pressure(self.momentum.pressure_work(state.u, settled.u, pressures, equilibria=True))
            intact = self.momentum.effective(state.gamma, state.deleted)
            self.momentum.set_gamma(settled.density.gamma, state.deleted)
            trial.drop(self.space.w, 0.5 * (W + settled.W), intact, self.momentum.gamma)
            after = self.momentum.force(settled.u)  # at the settled gamma, as after a resume
            trial.elastic, trial.loads = self.momentum.energy, self.momentum.loads
            trial.contact = self.momentum.pressed
            opened, allowed = abs(trial.balance - ledger.balance), self.OPEN * max(trial.elastic, ledger.elastic)
            if opened > allowed and increment > self.FINE[0] * longest:
                self.increment, self.refused = 0.5 * increment, "open"
                self.momentum.set_time(state.grip)
                continue
            state.ledger = ledger = trial
            state.u, state.gamma, state.sink = settled.u, settled.density.gamma, settled.density.sink
            state.W_max = settled.W_max
            force, W = after, settled.W
            if end == self.loading.knot(state.grip):
                self.increment = 0.0  # the next one is by the rates that follow
            state.grip = state.time = end
            state.step += 1
            yield state

    def _beyond(self, state: State, W: np.ndarray) -> bool:
        """Whether there is nothing more to load, or no sense in it; `unfailed` takes the reason."""
        live = self.momentum.effective(state.gamma, state.deleted) > 0  # not those of an increment given up
        over = float((W / self.density.phi)[live].min(initial=np.inf))
        if self.clock.longest(state.grip) == np.inf and self.loading.knot(state.grip) == np.inf:
            self.unfailed = f"nothing moves after load time {state.grip:.4g} s"
        elif over > self.OVER:
            self.unfailed = f"every point is past its energy limiter, by W/Phi = {over:.3g} and more"
            log.warning("no point has failed, although all are past their energy limiter (the least W/Phi is %.3g, "
                        "points fail near 1): loading ends; the regions' phi, m and the length l do not belong to this "
                        "body", over)
        elif (stretch := greatest_stretch(self.space, state.u, np.any(live, axis=1))) > self.STRETCHED:
            self.unfailed = f"the body is stretched by more than {self.STRETCHED:g}"
            log.warning("the body is stretched by %.3g without failing (the most is %g): loading ends; lower phi, or "
                        "take a material that stiffens", stretch, self.STRETCHED)
        return bool(self.unfailed)

    def _doubt(self, state: State) -> None:
        """Say so where the onset is not where the sink runs away."""
        if self.refused == "passes" and self.factor < self.STALLED:
            log.warning("the onset may be too low: the last load increment was given up after %d passes over the two "
                        "fields while the change of gamma still fell (by a factor of %.3f a pass); raise max_passes",
                        self.controls.max_passes, self.factor)
        elif self.refused == "no equilibrium" and self.loading.rises_in_pressure(state.grip):
            log.warning("the onset is the greatest pressure that the body bears (%.4g MPa), not where the sink runs "
                        "away: past it there is no equilibrium at a given pressure; a filling in the place of the "
                        "pressure goes on past it", self.loading.greatest_pressure(state.u))
        elif self.refused == "no equilibrium":
            log.warning("the onset is where Newton's method ends, not where the sink runs away: the body may buckle or "
                        "be torn by its grips; refine the mesh, or check grips and constants")

    # --- checkpoints ---
    def memory(self) -> dict[str, np.ndarray]:
        """What loading remembers beyond the state."""
        return {"increment": np.array(self.increment), "unfailed": np.array(self.unfailed), **self.newton.memory()}

    def restore(self, memory: dict[str, np.ndarray]) -> None:
        """Take up what :meth:`memory` gave."""
        self.increment, self.unfailed = float(memory["increment"]), str(memory["unfailed"])
        self.newton.restore(memory)
