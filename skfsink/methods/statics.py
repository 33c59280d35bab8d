"""Statics: loading to the onset (:mod:`.onset`), and quasi-static propagation.

A quasi-static analysis holds the grips just past the onset and lets the crack run through a sequence of equilibria,
giving up at each the energy that a dynamic analysis would turn into motion.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..errors import ConvergenceError
from ..fields.deletion import delete_failed
from ..fields.density import Density
from ..fields.state import State
from .onset import StaticLoading

__all__ = ["Statics"]


class Statics(StaticLoading):
    """Equilibria of a body between grips: loading as of :class:`.StaticLoading`, then a crack through equilibria.

    Memory: that of :class:`.StaticLoading`, and whether the last pass `settled`; `propagate` goes on from there,
    `memory` gives both.
    """

    SNAP = 400  # Newton steps in a pass: the body may snap to a shape far away

    GROWS = 1e-3  # of the sink coefficient of a point in a pass, below which others do not wait for it
    FAILED = 1e6  # sink coefficient past which more of it changes nothing: gamma is 0 there

    IDLE = 100  # passes that change nothing while points wait, after which a run is given up

    settled = False  #: whether the last pass of `propagate` found nothing left to change
    arrested = ""    #: why `propagate` has ended although the caller would have gone on; empty while it has not

    def propagate(self, state: State, advance: float = 0.005, limit: float = 10.0) -> Iterator[State]:
        """Let the crack run through equilibria, yielding after each pass; the caller stops when it has crossed.

        A pass: equilibrium at fixed gamma (the energy it gives up is `released`), then the history, gamma and the
        deletions at fixed displacement (what they take is D). Grips and dead loads stand still while the crack runs;
        where it arrests, `settled` is set, and the next pass moves them on by `advance` of their way so far. It ends
        where the crack has not crossed at `limit` times the way of the start, or when nothing moves any more; then
        `arrested` says which.

        Raises
        ------
        ConvergenceError
            There is no equilibrium, as under dead loads alone; or points wait that are never let go.
        """
        ledger, dead = state.ledger, self.momentum.dead
        furthest, idle, self.arrested = limit * self.clock.way(state.grip), 0, ""
        self.momentum.set_time(state.grip)
        if state.step == 0:
            self.momentum.set_gamma(state.gamma, state.deleted)
            self.momentum.force(state.u)
            ledger.elastic, ledger.loads = self.momentum.energy, self.momentum.loads
            ledger.contact = self.momentum.pressed
            ledger.initial = self.momentum.potential
        while True:
            self.momentum.set_gamma(state.gamma, state.deleted)
            self.momentum.force(state.u)
            if self.settled:
                if not self._advance(state, advance):
                    self.arrested = f"nothing moves after load time {state.grip:.4g} s"
                    return
                if self.clock.way(state.grip) > furthest:
                    self.arrested = f"the grips are at {limit:g} times their way to the onset"
                    return
            else:
                before, start = self.momentum.potential, state.u
                state.u = self._relax(state)
                given = self.momentum.pressure_work(start, state.u)
                ledger.released += before - self.momentum.potential + given
                ledger.book_pressure(given)
            W, loads = self.momentum.W, None if dead is None else dead.values
            postponed = self._follow(state, W)
            new = self.density.update(state.W_max, Density(state.gamma, state.sink))
            gamma = new.gamma
            change = float(np.abs(gamma - state.gamma).max())
            old = self.momentum.gamma
            state.gamma, state.sink = gamma, new.sink
            state.step += 1
            state.time = float(state.step)
            undeleted = self.momentum.effective(gamma, state.deleted)
            delete_failed(self.space, state, self.body.deletion, self.density.failure_energy)
            self.momentum.set_gamma(gamma, state.deleted)
            if dead is not None and loads is not None:
                ledger.work += dead.changed(loads, state.u)
                ledger.loads = dead.potential(state.u)
            ledger.drop(self.space.w, W, old, undeleted)
            ledger.deletion += float(np.einsum("eq,eq,eq->", self.space.w, W, undeleted - self.momentum.gamma))
            ledger.elastic = float(np.einsum("eq,eq,eq->", self.space.w, W, self.momentum.gamma))
            self.momentum.book_contact(ledger, state.u)
            self.settled = change <= self.controls.gamma_tolerance and not postponed
            idle = idle + 1 if postponed and change <= self.controls.gamma_tolerance else 0
            if idle > self.IDLE:
                raise ConvergenceError(f"the last {idle} passes have changed nothing, while points past the energy "
                                       f"limiter wait for others: lower front (now {self.controls.front:g})")
            yield state

    def _relax(self, state: State) -> np.ndarray:
        """The equilibrium of a pass; the history follows equilibria only, or the sink would kill the mesh."""
        try:
            return self.newton.equilibrium(state.u, most=self.SNAP, nearby=True)[0]
        except ConvergenceError as error:
            cure = "take another mesh, or analysis = 'dynamic'"
            dead, followers = self.momentum.dead, self.momentum.followers
            if dead is not None or followers is not None:
                cure = (f"a body that {'pressures' if dead is None else 'tractions'} tear has none; take "
                        f"analysis = 'dynamic', or move a grip instead")
            raise ConvergenceError(f"pass {state.step + 1}: {error}; the history follows equilibria only: "
                                   f"{cure}") from None

    def _follow(self, state: State, W: np.ndarray) -> bool:
        """Let the history follow `W` (ne, nq) where failure is nearest; True if points that fail had to wait.

        Points past the energy limiter wait while another one is much further past it: once that has failed and forces
        have found their new ways, most of them are relieved. How far is W/Phi, with the limiter of each material. Only
        live points count whose sink still grows; the others have failed long ago.
        """
        ratio = W / self.density.phi
        past_limiter = (ratio > 1) & (state.W_max < W)
        furthest = float(ratio[past_limiter & (self.momentum.gamma > 0) & self._fails(state, W)].max(initial=0.0))
        waiting = past_limiter & (self.controls.front * furthest > ratio)
        state.W_max = np.where(waiting, state.W_max, np.maximum(state.W_max, W))
        return bool(waiting.any())

    def _fails(self, state: State, W: np.ndarray) -> np.ndarray:
        """Mask of the points where the sink grows if the history of `state` goes on to `W` (ne, nq)."""
        before, after = map(self.density.coefficients, (state.W_max, np.maximum(state.W_max, W)))
        mask: np.ndarray = (after > (1 + self.GROWS) * before) & (before < self.FAILED)
        return mask

    def _advance(self, state: State, share: float) -> bool:
        """Let grips and dead loads go on by a `share` of their way at fixed gamma, to the new equilibrium.

        False if nothing moves any more.
        """
        held, dead = ~self.free.reshape(state.u.shape), self.momentum.dead
        while self.clock.longest(state.grip) == np.inf:
            knot = self.loading.knot(state.grip)
            if knot == np.inf:
                return False
            state.grip = knot
        force = self.momentum.force(state.u)
        increment = share * self.clock.age(state.grip)
        end = self.clock.end(state.grip, increment)
        increment = increment if end == state.grip + increment else end - state.grip
        before = None if dead is None else dead.values
        pressures = self.momentum.pressure_values
        self.momentum.set_time(end)
        u, new_force = self.newton.equilibrium(self._predict(state.u, increment, state.grip), most=self.SNAP)
        state.ledger.work += 0.5 * float(np.sum((force + new_force)[held] * (u - state.u)[held]))
        if dead is not None and before is not None:
            state.ledger.work += dead.changed(before, 0.5 * (state.u + u))
        state.ledger.book_pressure(self.momentum.pressure_work(state.u, u, pressures, equilibria=True))
        state.u, state.grip = u, end
        return True

    # --- checkpoints ---
    def memory(self) -> dict[str, np.ndarray]:
        """What the analysis remembers beyond the state."""
        return {"settled": np.array(self.settled), "arrested": np.array(self.arrested), **super().memory(),
                **self.momentum.memory()}

    def restore(self, memory: dict[str, np.ndarray]) -> None:
        """Take up what :meth:`memory` gave."""
        self.settled, self.arrested = bool(memory["settled"]), str(memory["arrested"])
        self.momentum.restore(memory)
        super().restore(memory)
