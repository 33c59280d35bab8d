"""Length of the explicit step: a share of the stability limit, cut where the scheme feeds in or takes out energy.

The limit, 2/omega_max or less with viscosity, is estimated now and then, and followed by a cheap indicator between. A
step that changes the energy by more than a tolerance is rejected, and made again half as long; when steps have been
calm for a while, their length doubles again.
"""

from __future__ import annotations

from typing import Any, NoReturn

import numpy as np

from ..errors import InstabilityError, place_text
from ..fem.pattern import Pattern
from ..fields.momentum import Momentum
from ..fields.state import State
from .controls import ExplicitControls
from .frequency import highest_damping, highest_frequency, stable_step

__all__ = ["StepLength"]


class StepLength:
    """The length of the next step of one integration.

    Memory: estimate of the limit and its mode, indicator, cuts, calm steps: `look`, `share`, `accepts`,
    `is_given_up`, `borne` and `give_up` go on from the body last looked at and the steps last tried, `rejects` from
    `fix`; `memory` gives what a checkpoint needs.

    Parameters
    ----------
    momentum, free: the momentum balance, and the mask of its free unknowns.
    controls: options.
    longest: step [s] that is not exceeded.

    Attributes
    ----------
    dt: the step [s].   estimates: frequency estimates made.   rejected: steps made again.
    urgent: whether the limit is estimated before the next step.
    cut: how often the step is halved at present.   fixed: see :meth:`fix`, 0 if the step follows the limit.
    """

    CHECK = 5        # steps between looks at the cheap indicator; 1 where the damping grows with the compression
    RISEN = 25       # steps after which a risen indicator calls for an estimate; until then the step follows it
    FALLEN = 100     # steps after which a fallen one does; until then the step is shorter than it need be
    FED_IN = 1e-6    # energy a step may feed in, of the initial one, before the limit is estimated anew
    CALM = 20        # steps without a rejection after which the step doubles
    COMPRESSED = 1e-3  # compression of an element, L/c_d times its rate, that is counted on at least
    ASSEMBLED = 300_000  # unknowns up to which a tangent is assembled for the limit, in space of 1.5 kB each
    CUTS = 20        # halvings at which the integration gives up: a millionth of the limit

    kept = ("dt", "estimates", "rejected", "cut", "urgent", "_omega", "_indicator0", "_last_estimate", "_calm",
            "_damping", "_compression")

    def __init__(self, momentum: Momentum, free: np.ndarray, controls: ExplicitControls, longest: float) -> None:
        self.momentum, self.free, self.controls = momentum, free, controls
        self._longest = np.inf if controls.gamma_every else longest
        self._still = longest  # where nothing swings
        space = momentum.space
        small = momentum.is_viscous or space.exchange.over(free).size <= self.ASSEMBLED
        self._pattern = Pattern(space, space.dim, free, upper=True) if small else None
        self.dt = 0.0
        self.estimates = self.rejected = self.cut = self._calm = 0
        self._omega = self._indicator0 = self._damping = self._compression = 0.0
        self._last_estimate = 0
        self.fixed, self.urgent = 0.0, False
        self.mode: np.ndarray | None = None

    def fix(self, dt: float) -> None:
        """Let every step be `dt` [s] long, whatever the limit is; none is rejected."""
        self.fixed, self.dt = dt, dt

    def look(self, step: int, u: np.ndarray, mass: np.ndarray, inverse: np.ndarray, compression: float = 0.0) -> None:
        """Set `dt` before step number `step`, from the displacement (n, dim) and masses (n,).

        `inverse` are the inverse masses (n, dim), zero where a degree of freedom is held; `compression` is the greatest
        one of an element, see :attr:`.Momentum.compression`.
        """
        every = 1 if self.momentum.bulk_viscosity.quadratic > 0.0 else self.CHECK
        if self.fixed or not (self.mode is None or self.urgent or step % every == 0):
            return
        c = self.controls
        indicator = self.momentum.stiffest(u, inverse)
        ratio = indicator / self._indicator0 if self._indicator0 > 0 else np.inf
        since = step - self._last_estimate
        moved = abs(ratio - 1) > 2 * c.estimate_change and since >= (self.RISEN if ratio > 1 else self.FALLEN)
        if self.mode is None or self.urgent or moved or since >= c.estimate_every:
            self._omega, self.mode = highest_frequency(self.momentum, self._pattern, self.free, u, mass, self.mode)
            self._omega = max(self._omega, indicator**0.5)  # a Rayleigh quotient, in case Lanczos missed that element
            if self.momentum.is_viscous and self._pattern is not None:
                self._compression = max(compression, self.COMPRESSED)
                self._damping = highest_damping(self.momentum, self._pattern, self.free, u, mass,
                                                compression=self._compression)
            self._indicator0, self._last_estimate, ratio = indicator, step, 1.0
            self.estimates += 1
            self.urgent = False
        swings = self._omega > 0.0  # else every node is held
        omega = self._with_others(self._omega * np.sqrt(max(1.0, ratio)), u, inverse)
        dt = float(c.courant * 2.0 / omega) if swings else self._still
        if swings and self.momentum.is_viscous:
            slope = self.momentum.bulk_viscosity.slope
            risen = max(1.0, slope(compression) / slope(self._compression)) if slope(self._compression) else 1.0
            dt = c.courant * stable_step(omega, self._damping * max(1.0, ratio) * risen)
        self.dt = min(dt, self._longest) * 0.5**self.cut  # in plane stress the stable step may be longer

    def share(self, u: np.ndarray, mass: np.ndarray, inverse: np.ndarray, compression: float = 0.0) -> float:
        """The step over the stability limit of a body as it is now; nothing is changed."""
        omega, _ = highest_frequency(self.momentum, self._pattern, self.free, u, mass, self.mode)
        omega = self._with_others(max(omega, self.momentum.stiffest(u, inverse) ** 0.5), u, inverse)
        if self.momentum.is_viscous and self._pattern is not None and omega > 0.0:
            damping = highest_damping(self.momentum, self._pattern, self.free, u, mass, compression=compression)
            return self.dt / stable_step(omega, damping)
        return 0.5 * self.dt * omega

    def _with_others(self, omega: float, u: np.ndarray, inverse: np.ndarray) -> float:
        """Bound of the highest frequency with contact and fluids, from that without them [1/s]."""
        contact, followers = self.momentum.contact, self.momentum.followers
        if contact is None and followers is None:
            return omega
        added = 0.0 if contact is None else contact.stiffest(u)
        added += 0.0 if followers is None else followers.stiffest(u, inverse)
        return float((omega**2 + added) ** 0.5)

    def borne(self, u: np.ndarray, inverse: np.ndarray) -> float:
        """What the body would store at rest under its dead loads and pressures f, at least: sum of f^2/(2 m omega^2).

        `u` (n, dim) is the displacement last evaluated, `inverse` (n, dim) the inverse masses. With f of one node and
        omega the highest frequency no shape of the body is stiffer than that.
        """
        dead, followers = self.momentum.dead, self.momentum.followers
        if self._omega <= 0.0 or (dead is None and followers is None):
            return 0.0
        force = np.zeros_like(u)
        if dead is not None:
            force[dead.nodes] += dead.values
        if followers is not None:
            followers.add_force(u, force)
        square = self.momentum.space.exchange.dot(np.ones(len(u)), np.einsum("ni,ni,ni->n", force, force, inverse))
        return 0.5 * square / self._omega**2

    def accepts(self, error: float, energy: float, initial: float) -> bool:
        """Whether a step may be taken that feeds in the `error` of the `energy` of the body; it is halved if not.

        `initial` is the energy at the start, in which the error is measured where no step is rejected.
        """
        if not self.rejects:
            self.urgent = self.urgent or error > self.FED_IN * initial
            return bool(np.isfinite(error))
        if not (abs(error) <= self.controls.energy_tolerance * energy and np.isfinite(error)):
            self.rejected += 1
            self.cut += 1
            self._calm = 0
            self.dt *= 0.5
            return False
        self._calm += 1
        if self.cut and self._calm >= self.CALM:
            self.cut -= 1
            self._calm = 0
            self.dt *= 2.0
        return True

    @property
    def is_given_up(self) -> bool:
        """Whether a step that was not accepted is the end: the shortest one, or any where none is rejected."""
        return self.cut > self.CUTS or not self.rejects

    def give_up(self, state: State, v: np.ndarray) -> NoReturn:
        """End the integration of `state`, for the velocity `v` (n, dim) that the step tried last has led to.

        Raises
        ------
        InstabilityError
            Always.
        """
        if not self.rejects:
            raise InstabilityError(
                f"the explicit integration blew up at t = {state.time:.4g} s (step {state.step}): lower courant, now "
                f"{self.controls.courant:g}, or reject such steps by an energy_tolerance of "
                f"{ExplicitControls.energy_tolerance:g}")
        space, speed = self.momentum.space, np.abs(np.nan_to_num(v, nan=np.inf)).max(axis=1)
        fastest = int(np.argmax(speed))
        all_parts = space.exchange.all(np.array([[speed[fastest], *space.X[fastest]]]))
        place = all_parts[int(np.argmax(all_parts[:, 0])), 1:]
        raise InstabilityError(
            f"no explicit step down to {self.dt:.2g} s keeps the energy of the body to "
            f"{self.controls.energy_tolerance:g} of it, at t = {state.time:.4g} s (step {state.step}), near "
            f"{place_text(place)} mm of the undeformed body: refine the mesh "
            f"there, raise energy_tolerance, or take integrator = 'hht'")

    @property
    def rejects(self) -> bool:
        """Whether steps that do not keep the energy are made again."""
        return self.controls.energy_tolerance > 0.0 and not self.fixed

    # --- checkpoints ---
    def memory(self) -> dict[str, Any]:
        """What a checkpoint needs."""
        mode = np.zeros(0) if self.mode is None else self.mode  # none before the first step
        return {"mode": mode, **{name: np.array(getattr(self, name)) for name in self.kept}}

    def restore(self, memory: dict[str, np.ndarray]) -> None:
        """Go on where :meth:`memory` was taken."""
        self.mode = memory["mode"] if memory["mode"].size else None
        for name in self.kept:
            setattr(self, name, memory[name].item())
