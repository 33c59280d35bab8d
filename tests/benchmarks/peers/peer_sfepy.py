"""SfePy: its generalised Yeoh term with a pressure constant in the element, in 3D; the term has no 2D version."""

from __future__ import annotations

import numpy as np
from measure import Peer
from problem import Problem
from sfepy.base.base import output
from sfepy.discrete import Equation, Equations, FieldVariable, Integral, Material
from sfepy.discrete import Problem as System
from sfepy.discrete.conditions import Conditions
from sfepy.discrete.fem import FEDomain, Field, Mesh
from sfepy.terms import Term
from sparse import SOLVERS

__all__ = ["PEERS"]

output.set_output(quiet=True)


class SfePy(Peer):
    packages = ("sfepy", "numpy", "scipy")
    solver = "SuperLU"

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        mesh = Mesh.from_data("body", problem.X, None, [problem.cells.astype(np.int32)],
                              [np.zeros(len(problem.cells), np.int32)], ["3_8"])
        domain = FEDomain("domain", mesh)
        omega = domain.create_region("Omega", "all")
        vector = Field.from_args("vector", np.float64, "vector", omega, approx_order=1)
        scalar = Field.from_args("scalar", np.float64, "scalar", omega, approx_order=0)
        u, v = FieldVariable("u", "unknown", vector), FieldVariable("v", "test", vector, primary_var_name="u")
        p, q = FieldVariable("p", "unknown", scalar), FieldVariable("q", "test", scalar, primary_var_name="p")
        m = Material("m", par=[problem.c1, problem.c2, 0.0, 1.0, 2.0, 1.0], give=1 / problem.k)
        rule = Integral("i", order=3)
        assert len(rule.get_qp("3_8")[1]) == 2**problem.dim

        def term(text: str, **arguments: object) -> Term:
            return Term.new(text, rule, omega, **arguments)

        balance = (term("dw_tl_he_genyeoh(m.par, v, u)", m=m, v=v, u=u)
                   + term("dw_tl_bulk_pressure(v, u, p)", v=v, u=u, p=p))
        volume = (term("dw_tl_volume(q, u)", q=q, u=u) - term("dw_integrate(q)", q=q)
                  + term("dw_dot(m.give, q, p)", m=m, q=q, p=p))
        self.system = System("body", equations=Equations([Equation("balance", balance), Equation("volume", volume)]))
        self.system.set_bcs(ebcs=Conditions([]))
        self.system.time_update()
        self.system.update_materials()
        self.system.equations.variables.init_state()
        self.K = self.system.mtx_a.copy()
        self.state = np.zeros(problem.X.size + len(problem.cells))
        self.pending = np.zeros(len(problem.cells))
        self.free = np.flatnonzero(np.r_[~problem.held.ravel(), np.ones(len(problem.cells), bool)])

    def assemble(self, u: np.ndarray) -> np.ndarray:
        self.state[:u.size] = u.ravel()
        self.state[u.size:] += self.pending
        self.pending[:] = 0.0
        self.r = self.system.equations.eval_residuals(self.state)
        self.K = self.system.equations.eval_tangent_matrices(self.state, self.K)
        return self.r[:u.size].reshape(u.shape)

    def constraint(self) -> float:
        pressure = self.state[self.problem.X.size:] / self.problem.k
        scale = np.linalg.norm(pressure) * self.system.domain.mesh.cmesh.get_volumes(3).mean()
        return float(np.linalg.norm(self.r[self.problem.X.size:]) / max(scale, 1e-300))

    def solve(self, force: np.ndarray, move: np.ndarray) -> np.ndarray:
        d = np.r_[move.ravel(), np.zeros(len(self.pending))]
        rows = self.K[self.free]
        d[self.free] = SOLVERS[self.solver](rows[:, self.free], -self.r[self.free] - rows @ d)
        self.pending = d[move.size:].copy()
        return d[:move.size].reshape(move.shape)

    def forget(self) -> None:
        self.pending[:] = 0.0


PEERS = {"": SfePy}
