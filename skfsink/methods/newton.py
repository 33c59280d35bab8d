"""Equilibrium at fixed gamma: Newton's method with an energy line search that finds one however far away it is.

Factorisations are costly and kept: they first serve as they are (modified Newton), in space corrected by what the steps
since have shown of the tangent (:mod:`.secants`), then as preconditioner of conjugate gradients on the current tangent,
until either is slow. Where the tangent is indefinite, as when a piece comes loose and turns, the step is taken with a
convex one: the pressure in its geometric part is bounded where it would make a Gauss point unstable (see
:mod:`.kernels.tangent`). That is a second derivative of the potential wherever the body is stable, so that the last
steps are Newton's.
"""

from __future__ import annotations

from functools import cached_property
from typing import Self

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, gmres

from ..errors import ConvergenceError
from ..fem.linear import Solver, linear_for, solver
from ..fem.pattern import Pattern
from ..fields.body import Body
from ..fields.momentum import Momentum
from .controls import StaticsControls
from .nearby import CLOSER, Nearby
from .secants import Secants

__all__ = ["Newton"]


class Newton:
    """Finds displacements in equilibrium between grips, at the density and loads last given to `momentum`.

    Memory: factors of a tangent, and secants of the steps with them, which later calls use as long as they serve: of
    which equilibrium within `tolerance` is found, in how many steps, depends on earlier calls to `equilibrium` and
    `predict`, whether their increments were taken or given up. `memory` gives what they were made from,
    `restore` makes them again, `factorisations` counts them, `release` drops them.

    Parameters
    ----------
    momentum: forces and tangents.
    free: (n*dim,) mask of the degrees of freedom that no grip holds.
    tolerance: residual force at which equilibrium is reached, relative to the forces inside and the loads.
    most: Newton steps after which an equilibrium is given up, unless a call says more.
    threads: of the factorisations.
    linear: what solves for steps, a name in :data:`.LINEAR`.

    Attributes
    ----------
    steps: Newton steps made.   iterations: conjugate-gradient iterations.
    """

    LIVE = 1e-3     # nodes with less than this of their mass are not asked for equilibrium
    KEEP = 0.2      # factors are used as they are while each step with them lowers the residual to this fraction
    SECANTS = 0, 12  # most of them that correct such steps, in two and in three dimensions
    PATIENCE = 3    # and such steps that were those of a body far from equilibrium, after which factors are given up
    FAR = 0.5       # far from equilibrium: a step leaves more than this of the residual, or had to be shortened
    INEXACT = 0.02  # relative residual of a step by conjugate gradients, at most
    LEAST_J = 0.05  # of a Gauss point that still carries force; below, a trial is refused
    SHORTEST = 1e-6  # step length at which a direction is given up
    NEARBY = True    # whether equilibria are sought nearby first, where it is asked for
    RIM = 60         # iterations of GMRES, for the rim of a pressurised surface

    def __init__(self, momentum: Momentum, free: np.ndarray, tolerance: float, most: int, threads: int = 1, *,
                 linear: str = "direct") -> None:
        self.momentum, self.free, self.tolerance, self.most = momentum, free, tolerance, most
        self.space = momentum.space
        self._linear, self._threads, self._released = linear, threads, 0
        self.steps = self.iterations = 0
        self._volume = self.space.lump(np.ones_like(self.space.w))
        # a body that has come apart bears no force; this says what counts as none, in the softest material too
        size = float(self.space.V.sum()) ** (1 - 1 / self.space.volume_dim)
        self._least_force = 1e-3 * momentum.shear_moduli[0] * size
        # rounding of the stored energy, most in the stiffest one: I1' - 3 is a difference of numbers of order one
        self._noise = 1e-14 * momentum.shear_moduli[1] * float(self.space.V.sum())
        self._kept: tuple[np.ndarray, np.ndarray] | None = None  # displacement and gamma the factors were made at
        self._secants = Secants(self.SECANTS[self.space.dim - 2])  # of steps with these factors
        self._slow = False  # whether the factors have become too old to be used as they are
        self._spent = 0     # iterations and assemblies since they were made

    @classmethod
    def of(cls, body: Body, controls: StaticsControls) -> Self:
        """That of a body."""
        return cls(body.momentum, body.free, controls.tolerance, controls.max_newton, body.threads,
                   linear=linear_for(controls.linear, body.space))

    def equilibrium(self, u: np.ndarray, tolerance: float | None = None, most: int | None = None,
                    nearby: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Displacement in equilibrium at the current gamma, from the guess `u` with the grips in place, and its force.

        With `nearby` what is around the elements whose gamma has changed is brought to equilibrium first, in turn with
        steps of the whole body, where that serves (see :mod:`.nearby`).

        Raises
        ------
        ConvergenceError
            No equilibrium within `most` steps, or no step that lowers the energy.
        """
        tolerance, most = tolerance or self.tolerance, most or self.most
        momentum, live = self.momentum, self._live()
        u = u.copy()
        force = momentum.force(u)
        energy = momentum.potential
        lowest = min(self.LEAST_J, momentum.least_J)
        last, length, modified, poor = np.inf, 1.0, False, 0
        corrected = self.solver.exact and self._secants.most > 0
        taken: tuple[np.ndarray, np.ndarray] | None = None
        pulled = momentum.load_size(u)
        near = self._nearby() if nearby and corrected else None

        def residual(force: np.ndarray) -> tuple[np.ndarray, float]:
            r = momentum.unheld(force).ravel()[self.free]
            return r, float(np.linalg.norm(r[live])) / (self.scale(force) + pulled)

        for _ in range(most):
            r, error = residual(force)
            if near is not None and error > tolerance:
                way = near.relax(u, max(CLOSER * error, tolerance) * self.scale(force))
                if way is None:
                    near = None
                else:
                    taken = taken and (taken[0] + way.ravel()[self.free], taken[1])
                    r, error = residual(momentum.force(u, force))
                    energy = momentum.potential
            if error <= tolerance:
                return u, force
            self.steps += 1
            if corrected and taken is not None:
                self._secants.add(taken[0], r - taken[1])
            far = length < 1.0 or error > self.FAR * last
            poor = poor + far if modified and corrected else 0
            if far and not 0 < poor < self.PATIENCE:
                self._kept = near = None
            self._slow = self._slow or (modified and not corrected and error > self.KEEP * last)
            last = error
            modified = self.solver.exact and self._kept is not None and not self._slow
            step, fresh = np.zeros(u.shape), False
            while True:
                if modified:
                    d = self._modified(r, momentum.added_stiffness(u, self.free))
                else:
                    d, fresh = self._direction(u, r, self._inexact(error, tolerance))
                step.reshape(-1)[self.free] = d
                step = momentum.unheld(step)
                length, force = self._search(u, step, float(r @ d), energy, lowest)
                if length > 0.0:
                    break
                if fresh:
                    raise ConvergenceError("no equilibrium: the energy falls in no direction Newton's method offers")
                self._slow = True
                if not modified:
                    self._kept = None
                modified, near = False, None
            taken = length * d, r
            u += length * step
            if momentum.contact is not None:
                momentum.contact.place(u)
            energy = momentum.potential
        raise ConvergenceError(f"no equilibrium within {most} Newton steps")

    def alike(self, momentum: Momentum, free: np.ndarray, most: int) -> Newton:
        """The same for another body."""
        return Newton(momentum, free, self.tolerance, most, self._threads, linear=self._linear)

    def scale(self, force: np.ndarray) -> float:
        """What a residual is compared with: the norm of the forces (n, dim) of all nodes, and a least force [N]."""
        return float(np.linalg.norm(force)) + self._least_force

    def predict(self, u: np.ndarray, move: np.ndarray) -> np.ndarray:
        """`u` after the grips have moved by `move` (n, dim; zero at free nodes), to first order in it."""
        eps = 1e-6 * float(self.space.h.min()) / (np.abs(move).max() + 1e-300)
        pull = (self.momentum.force(u + eps * move) - self.momentum.force(u - eps * move)) / (2 * eps)
        d = np.zeros(u.size)
        net = self.momentum.unheld(self.momentum.force(u) + pull)
        d[self.free], _ = self._direction(u, net.ravel()[self.free], 1e-3)
        return u + move + d.reshape(u.shape)

    @cached_property
    def pattern(self) -> Pattern:
        """Of the tangent, the upper triangle."""
        return Pattern(self.space, self.space.dim, self.free, upper=True)

    @cached_property
    def solver(self) -> Solver:
        """What solves for steps, with its count."""
        return solver(self._linear, self.space, self.free, self.pattern, self._threads)

    @property
    def factorisations(self) -> int:
        """Numerical factorisations made."""
        return self._released + (self.solver.count if "solver" in vars(self) else 0)

    def release(self) -> None:
        """Free the memory of factors and pattern; they are made again when they are needed."""
        self._released = self.factorisations
        if "solver" in vars(self):
            self.solver.release()
            del self.solver
        vars(self).pop("pattern", None)
        self._kept = None
        self._secants.clear()

    # --- directions ---
    def tangent(self, u: np.ndarray, convex: bool = False) -> np.ndarray:
        """The tangent at `u`, as the solver takes it."""
        return self.momentum.tangent(self.pattern, u, convex)

    def _nearby(self) -> Nearby | None:
        """What is around the elements that have changed since the factors were made, of a body between grips alone."""
        momentum = self.momentum
        others = (momentum.dead, momentum.followers, momentum.contact, momentum.sliding)
        if not self.NEARBY or self._kept is None or any(other is not None for other in others):
            return None
        return Nearby.of(self, self._kept[1])

    def _live(self) -> np.ndarray:
        live: np.ndarray = self.space.lump(self.momentum.gamma) > self.LIVE * self._volume
        return np.repeat(live, self.space.dim)[self.free]

    def _inexact(self, error: float, tolerance: float) -> float:
        """Relative residual of a step; less with multigrid near equilibrium, which saves Newton steps, not iterations.

        It is the `error` that is left, as of Newton's own steps (Eisenstat and Walker 1996), but not below what takes
        the error to a tenth of the `tolerance`.
        """
        if self.solver.exact:
            return self.INEXACT
        return min(self.INEXACT, max(error, 0.1 * tolerance / error))

    def _direction(self, u: np.ndarray, r: np.ndarray, tolerance: float = INEXACT) -> tuple[np.ndarray, bool]:
        """A step that lowers the residual force `r` at `u`, and whether the factors behind it are those of `u`."""
        data = self.tangent(u)
        added, skew = self.momentum.added_stiffness(u, self.free), self.momentum.skew_stiffness(u, self.free)
        plane = self.space.dim - 2
        most, worth = self.solver.MOST[plane], self.solver.WORTH[plane]
        if self._kept is not None and added is None and skew is None and self._spent < worth:
            d, iterations, met = self.solver.conjugate(data, -r, tolerance, most)
            self.iterations += iterations
            self._spent += iterations + 2  # an assembly takes as long as two
            if not met:
                self._kept = None  # new ones, at the next step if this one is of use
            if met or iterations > most // 2:
                return d, False
        self._factorise(u, data)
        if not self.solver.exact and added is None and skew is None:
            return self._iterate(u, data, r, tolerance), True
        if skew is None or not self.solver.definite:
            return self._solve(r, added), True
        d, iterations = self._krylov(data, skew, added, r)
        self.iterations += iterations
        return d, True

    def _modified(self, r: np.ndarray, added: np.ndarray | None) -> np.ndarray:
        """A step by factors of an earlier tangent, with what later steps have shown."""
        return self._secants.solve(self.solver.apply, -r) if added is None else self._solve(r, added)

    def _iterate(self, u: np.ndarray, data: np.ndarray, r: np.ndarray, tolerance: float) -> np.ndarray:
        """Solution of K d = -r by conjugate gradients; of a positive definite matrix like K where that curves down."""
        most = self.solver.MOST[self.space.dim - 2]
        d, iterations, _ = self.solver.conjugate(data, -r, tolerance, most)
        self.iterations += iterations
        if not d.any() and r.any():
            data = self.tangent(u, convex=True)
            self.solver.factorize(data)
            d, iterations, _ = self.solver.conjugate(data, -r, tolerance, most)
            self.iterations += iterations
            self._kept = None
        return d

    def _krylov(self, data: np.ndarray, skew: csr_array, added: np.ndarray | None,
                r: np.ndarray) -> tuple[np.ndarray, int]:
        """Solution of (K + S + B B^T) d = -r with the skew part `skew` of the load stiffness, and iterations made.

        GMRES, with the factors of K as preconditioner. They are few: S acts on the rim of a pressurised surface only.
        """
        count, matrix = 0, self.pattern.symmetric(data) + skew

        def times(x: np.ndarray) -> np.ndarray:
            y: np.ndarray = matrix @ x
            return y if added is None else y + added @ (added.T @ x)

        def counted(_: float) -> None:
            nonlocal count
            count += 1

        shape = matrix.shape
        d, _ = gmres(LinearOperator(shape, times, dtype=float), -r, rtol=1e-10, restart=self.RIM, maxiter=1,
                     M=LinearOperator(shape, lambda b: -self._solve(b, added), dtype=float), callback=counted,
                     callback_type="pr_norm")
        return d, count

    def _solve(self, r: np.ndarray, B: np.ndarray | None) -> np.ndarray:
        """Solution of (K + B B^T) d = -r with the factors of K; without B of K d = -r."""
        return self.solver.apply(-r) if B is None else self.solver.solve_sum(B, -r)

    def _factorise(self, u: np.ndarray, data: np.ndarray) -> None:
        """Factors of the tangent at `u`, or of a positive definite matrix like it."""
        self._kept, self._slow, self._spent = (u.copy(), self.momentum.gamma.copy()), False, 0
        self._secants.clear()
        if self.solver.factorize(data, indefinite=False):
            return
        data = self.tangent(u, convex=True)
        if not self.solver.factorize(data, indefinite=False):  # not seen: the convex tangent is definite
            self._stiffen(data)

    def _stiffen(self, data: np.ndarray) -> None:
        """Factors of a positive definite matrix with a diagonal above that of `data`."""
        diagonal = np.abs(data[self.pattern.diagonal])
        shift, definite = 1e-4, False
        while not definite:
            data[self.pattern.diagonal] += shift * diagonal
            shift *= 4
            if not shift < 1e8:
                raise ConvergenceError("no equilibrium: the tangent is not finite")
            definite = self.solver.factorize(data, indefinite=False)

    def _search(self, u: np.ndarray, step: np.ndarray, slope: float, energy: float,
                lowest: float) -> tuple[float, np.ndarray]:
        """Length, halved from 1, with which `step` lowers the potential and inverts no Gauss point, and force there.

        The length is 0 if there is none.
        """
        momentum, length, force = self.momentum, 1.0, np.empty_like(u)
        while slope < 0.0 and length >= self.SHORTEST:
            end = u + length * step
            momentum.force(end, force)
            fits = momentum.least_J >= lowest and np.isfinite(momentum.energy)
            if fits and (momentum.potential - momentum.pressure_work(u, end)
                         <= energy + 1e-4 * length * slope + self._noise):
                return length, force
            length *= 0.5
        return 0.0, force

    # --- checkpoints ---
    def memory(self) -> dict[str, np.ndarray]:
        """What the factors were made from, for a checkpoint."""
        if self._kept is None:
            return {}
        return {"kept_u": self._kept[0], "kept_gamma": self._kept[1], "slow": np.array(self._slow),
                "spent": np.array(self._spent), **self._secants.memory()}

    def restore(self, memory: dict[str, np.ndarray]) -> None:
        """Make the factors again; the density of `momentum` is left as it is."""
        self._kept = None
        if "kept_u" not in memory:
            return
        momentum, gamma = self.momentum, self.momentum.gamma
        momentum.gamma = memory["kept_gamma"]
        self._factorise(memory["kept_u"], self.tangent(memory["kept_u"]))
        momentum.gamma = gamma
        self._slow, self._spent = bool(memory["slow"]), int(memory["spent"])
        self._secants.restore(memory)
