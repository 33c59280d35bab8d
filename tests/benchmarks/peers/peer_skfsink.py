"""skfsink: its own Newton method, and the full Newton method that drives the other libraries."""

from __future__ import annotations

from typing import Any

import numpy as np
import skfem
from measure import Clock, Peer
from problem import Problem
from skfem.io.meshio import INV_HEX_MAPPING

from skfsink.fem.space import Space
from skfsink.fields.momentum import Momentum
from skfsink.material import AAA
from skfsink.methods.newton import Newton

__all__ = ["PEERS"]


class Full(Peer):
    """Tangent and factorisation at each iteration."""

    solver = "PARDISO"
    packages = ("scikit-fem", "numba", "pypardiso", "numpy", "scipy")

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        quad = problem.dim == 2
        cells = problem.cells if quad else problem.cells[:, INV_HEX_MAPPING[:8]]
        mesh = (skfem.MeshQuad if quad else skfem.MeshHex)(np.ascontiguousarray(problem.X.T),
                                                           np.ascontiguousarray(cells.T))
        material = AAA(bulk_modulus=problem.k, c1=problem.c1, c2=problem.c2)
        self.momentum = Momentum(Space(mesh), material, self.element)
        self.newton = Newton(self.momentum, ~problem.held.ravel(), problem.tolerance, 40)
        self.u = np.zeros(problem.X.shape)

    def assemble(self, u: np.ndarray) -> np.ndarray:
        self.u = u
        self.data = self.momentum.tangent(self.newton.pattern, u)
        return self.momentum.force(u)

    def solve(self, force: np.ndarray, move: np.ndarray) -> np.ndarray:
        d, free = move.ravel().copy(), self.newton.free
        if move.any():  # what the grips pull at free nodes, by central differences, as `Newton.predict` does
            eps = 1e-6 * float(self.momentum.space.h.min()) / np.abs(move).max()
            ahead, behind = self.momentum.force(self.u + eps * move), self.momentum.force(self.u - eps * move)
            force = force + (ahead - behind) / (2 * eps)
        self.newton.solver.factorize(self.data)
        d[free] = self.newton.solver.solve(-force.ravel()[free])
        return d.reshape(move.shape)


class Plain(Full):
    """The standard element: J at each Gauss point."""

    element = "plain"


class Own(Full):
    """The Newton method of skfsink, which keeps factors as long as they are of use."""

    def warm_up(self, clock: Clock) -> None:
        """Compile; from now on the clock sees the parts of the method."""
        zero = np.zeros_like(self.u)
        for elongation in self.problem.elongation[:2]:
            self.newton.equilibrium(self.newton.predict(zero, self.problem.grips(elongation)))
        self.newton.restore({})  # no factors to begin with
        momentum, solver = self.momentum, self.newton.solver
        for owner, name in ((momentum, "force"), (momentum, "tangent"), (solver, "factorize"), (solver, "apply")):
            setattr(owner, name, clock.timed(name, getattr(owner, name)))
        self.clock = clock

    def step(self, u: np.ndarray, grips: np.ndarray, clock: Clock) -> tuple[np.ndarray, np.ndarray, int, float]:
        """Equilibrium at new grips; the prediction is counted as an iteration."""
        held, before = self.problem.held, self.newton.steps
        guess = self.newton.predict(u, np.where(held, grips - u, 0.0))
        u, force = self.newton.equilibrium(guess)
        residual = float(np.linalg.norm(force[~held]) / np.linalg.norm(force))
        return u, force, self.newton.steps - before + 1, residual

    def extra(self) -> dict[str, Any]:
        """Sums of the parts, and how often the tangent was factorised."""
        c = self.clock
        return {"assembly_ms": c.median("tangent") + c.median("force"),
                "solve_ms": c.median("factorize") + c.median("apply"),
                "tangents": len(c.times["tangent"]), "factorisations": len(c.times["factorize"])}


PEERS = {"": Own, "full": Full, "plain": Plain}
