"""NGSolve: Q1/P0 by the variation of an energy with a pressure, which is condensed in the element."""

from __future__ import annotations

import netgen.meshing as nm
import ngsolve as ng
import numpy as np
from measure import Peer
from problem import Problem

__all__ = ["PEERS"]

ng.SetNumThreads(1)
ng.ngsglobals.msg_level = 0


class NGSolve(Peer):
    packages = ("ngsolve",)
    solver = "sparsecholesky"

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        dim = problem.dim
        self.mesh = _mesh(problem)
        kind = ng.ET.QUAD if dim == 2 else ng.ET.HEX
        self.fes = ng.VectorH1(self.mesh, order=1) * ng.L2(self.mesh, order=0)
        n = len(problem.X)
        held = problem.held.T.ravel()      # component by component, as the space numbers its unknowns
        free = self.fes.FreeDofs(coupling=True)
        for i in np.flatnonzero(held):
            free[int(i)] = False
        self.free, self.n = free, n
        u, p = self.fes.TrialFunction()
        F = ng.Id(dim) + ng.Grad(u)
        J = ng.Det(F)
        I1 = J ** (-2 / 3) * (ng.InnerProduct(F, F) + (1 if dim == 2 else 0))
        energy = problem.c1 * (I1 - 3) + problem.c2 * (I1 - 3) ** 2 + p * (J - 1) - p * p / (2 * problem.k)
        rule = ng.IntegrationRule(kind, 3)
        assert len(rule.points) == 2**dim
        self.a = ng.BilinearForm(self.fes, symmetric=True, condense=True)
        self.a += ng.Variation(energy.Compile() * ng.dx(intrules={kind: rule}))
        self.state = ng.GridFunction(self.fes)
        self.r, self.d = self.state.vec.CreateVector(), self.state.vec.CreateVector()
        self.pending = np.zeros(len(self.state.vec) - dim * n)

    def assemble(self, u: np.ndarray) -> np.ndarray:
        values = self.state.vec.FV().NumPy()
        values[:u.size] = u.T.ravel()
        values[u.size:] += self.pending
        self.pending[:] = 0.0
        self.a.Apply(self.state.vec, self.r)
        self.a.AssembleLinearization(self.state.vec)
        return self.r.FV().NumPy()[:u.size].reshape(u.shape[::-1]).T.copy()

    def constraint(self) -> float:
        size, values = self.problem.X.size, self.state.vec.FV().NumPy()
        volume_change = np.linalg.norm(values[size:]) / self.problem.k * np.sqrt(self._volume2)
        return float(np.linalg.norm(self.r.FV().NumPy()[size:]) / max(volume_change, 1e-300))

    def solve(self, force: np.ndarray, move: np.ndarray) -> np.ndarray:
        a, size = self.a, move.size
        inverse = a.mat.Inverse(self.free, inverse=self.solver)
        d, rhs = self.d, self.r.CreateVector()
        d[:] = 0.0
        d.FV().NumPy()[:size] = move.T.ravel()
        rhs.data = -self.r
        rhs.data += a.harmonic_extension_trans * rhs
        rhs.data -= a.mat * d
        d.data += inverse * rhs
        d.data += a.harmonic_extension * d
        d.data -= a.inner_solve * self.r
        out = d.FV().NumPy()
        self.pending = out[size:].copy()
        return out[:size].reshape(move.shape[::-1]).T.copy()

    def forget(self) -> None:
        self.pending[:] = 0.0

    @property
    def _volume2(self) -> float:
        """Mean square of the volumes of the elements."""
        if not hasattr(self, "_v2"):
            volumes = ng.Integrate(ng.CoefficientFunction(1.0), self.mesh, element_wise=True).NumPy()
            self._v2 = float(np.mean(volumes**2))
        return self._v2


def _mesh(problem: Problem) -> ng.Mesh:
    dim = problem.dim
    mesh = nm.Mesh(dim=dim)
    points = [mesh.Add(nm.MeshPoint(nm.Pnt(*x, *([0.0] * (3 - dim))))) for x in problem.X.tolist()]
    if dim == 2:
        index = mesh.Add(nm.FaceDescriptor(surfnr=1, domin=1, bc=1))
        for cell in problem.cells:
            mesh.Add(nm.Element2D(index, [points[i] for i in cell]))
    else:
        for cell in problem.cells:
            mesh.Add(nm.Element3D(1, [points[i] for i in cell]))
    return ng.Mesh(mesh)


PEERS = {"": NGSolve}
