"""FElupe: `SolidBodyNearlyIncompressible`, whose mean dilatation is the same element, with its Yeoh model."""

from __future__ import annotations

import felupe as fem
import felupe.constitution.tensortrax as mat
import numpy as np
from measure import Peer
from problem import Problem
from sparse import SOLVERS

__all__ = ["PEERS"]


class FElupe(Peer):
    packages = ("felupe", "tensortrax", "numpy", "scipy")
    solver = "SuperLU"

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        mesh = fem.Mesh(problem.X, problem.cells, "quad" if problem.dim == 2 else "hexahedron")
        if problem.dim == 2:
            field = fem.FieldPlaneStrain(fem.RegionQuad(mesh), dim=2)
        else:
            field = fem.Field(fem.RegionHexahedron(mesh), dim=3)
        self.field = fem.FieldContainer([field])
        umat = mat.Hyperelastic(mat.models.hyperelastic.yeoh, C10=problem.c1, C20=problem.c2, C30=0.0)
        self.body = fem.SolidBodyNearlyIncompressible(umat, self.field, bulk=problem.k)
        dofs = np.arange(problem.X.size)
        held = problem.held.ravel()
        self.dof0, self.dof1 = dofs[held], dofs[~held]

    def assemble(self, u: np.ndarray) -> np.ndarray:
        self.field[0].values[:] = u
        self.r = self.body.assemble.vector(self.field).toarray()[:, 0]
        self.K = self.body.assemble.matrix(self.field)
        return self.r.reshape(u.shape)

    def solve(self, force: np.ndarray, move: np.ndarray) -> np.ndarray:
        system = fem.solve.partition(self.field, self.K, self.dof1, self.dof0, self.r)
        target = (self.field[0].values + move).ravel()[self.dof0]
        return np.asarray(fem.solve.solve(*system, target, solver=SOLVERS[self.solver])).reshape(move.shape)


class Pardiso(FElupe):
    solver = "PARDISO"
    packages = (*FElupe.packages, "pypardiso")


PEERS = {"": FElupe, "pardiso": Pardiso}
