"""EasyFEA: the standard element with the energy in JAX, and its own Newton method; it has no mean dilatation."""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from measure import Clock, Peer
from problem import Problem

jax.config.update("jax_enable_x64", True)

from EasyFEA import ElemType, Mesh, Models, Simulations  # noqa: E402
from EasyFEA.FEM import GroupElemFactory  # noqa: E402

__all__ = ["PEERS"]


def _energy(C: Any, c1: float, c2: float, k: float) -> Any:
    I3 = jnp.linalg.det(C)
    z = I3 ** (-1 / 3) * jnp.trace(C) - 3
    return c1 * z + c2 * z**2 + k / 2 * (jnp.sqrt(I3) - 1) ** 2


class EasyFEA(Peer):
    element = "plain"
    packages = ("easyfea", "jax", "pypardiso")
    solver = "PARDISO"

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        kind = ElemType.QUAD4 if problem.dim == 2 else ElemType.HEXA8
        X = np.zeros((len(problem.X), 3))
        X[:, :problem.dim] = problem.X
        mesh = Mesh({kind: GroupElemFactory.Create(kind, problem.cells, X)})
        law = Models.HyperElastic.AutoDiff(problem.dim, partial(_energy, c1=problem.c1, c2=problem.c2, k=problem.k))
        self.simulation = Simulations.HyperElastic(mesh, law, absTol=1e-30, relTol=problem.tolerance, incTol=1e-30)
        self.simulation.solver = "pypardiso"

    def warm_up(self, clock: Clock) -> None:
        """Compile; from now on the clock sees the assemblies."""
        self._load(self.problem.grips(self.problem.elongation[0]))
        s = self.simulation
        s._Set_solutions(s.problemType, np.zeros(self.problem.X.size))
        s.Assembly = clock.timed("assembly", s.Assembly)

    def step(self, u: np.ndarray, grips: np.ndarray, clock: Clock) -> tuple[np.ndarray, np.ndarray, int, float]:
        """Equilibrium at new grips."""
        s, before = self.simulation, len(clock.times["assembly"])
        clock.timed("step", self._load)(grips)
        times = clock.times["assembly"][before:]
        clock.times["solve"].append((clock.times["step"][-1] - sum(times)) / len(times))
        # the residual its last assembly left is that before the last correction: assemble once more
        *_, minus_force = s.Assembly(s.problemType)
        force = -np.asarray(minus_force.todense()).reshape(u.shape)
        residual = float(np.linalg.norm(force[~self.problem.held]) / np.linalg.norm(force))
        return s._Get_u_n(s.problemType).reshape(u.shape).copy(), force, len(times), residual

    def _load(self, grips: np.ndarray) -> None:
        s, problem = self.simulation, self.problem
        s.Bc_Init()
        names = s.Get_unknowns()
        for nodes in (problem.top, problem.bottom):
            s.add_dirichlet(nodes, [grips[nodes, i] for i in range(problem.dim)], names)
        s.Solve()


PEERS = {"": EasyFEA}
