"""torch-fem: the standard element with the energy in PyTorch; it has no element with a mean dilatation."""

from __future__ import annotations

import numpy as np
import torch
from measure import Peer
from problem import Problem
from torchfem import Planar, Solid
from torchfem.materials import Hyperelastic3D, HyperelasticPlaneStrain
from torchfem.sparse import sparse_solve

__all__ = ["PEERS"]

torch.set_default_dtype(torch.double)
torch.set_num_threads(1)


class TorchFEM(Peer):
    element = "plain"
    packages = ("torch-fem", "torch", "pypardiso")
    solver = "PARDISO"

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        dim = problem.dim

        def energy(F: torch.Tensor, params: torch.Tensor) -> torch.Tensor:
            c1, c2, k = params
            J = (F[0, 0] * (F[1, 1] * F[2, 2] - F[1, 2] * F[2, 1]) - F[0, 1] * (F[1, 0] * F[2, 2] - F[1, 2] * F[2, 0])
                 + F[0, 2] * (F[1, 0] * F[2, 1] - F[1, 1] * F[2, 0]))
            z = J ** (-2 / 3) * torch.sum(F * F) - 3
            return c1 * z + c2 * z**2 + k / 2 * (J - 1) ** 2

        kind, material = (Planar, HyperelasticPlaneStrain) if dim == 2 else (Solid, Hyperelastic3D)
        self.model = kind(torch.as_tensor(problem.X), torch.as_tensor(problem.cells),
                          material(energy, [problem.c1, problem.c2, problem.k]))
        m = self.model
        points = (m.n_int, m.n_elem)
        self.start = (torch.zeros(m.n_nod, dim), torch.eye(dim).expand(*points, dim, dim).clone(),
                      torch.zeros(*points, dim, dim), torch.zeros(*points, m.n_state))
        self.de0 = torch.zeros(m.n_elem, dim, dim)
        self.held = torch.as_tensor(np.flatnonzero(problem.held.ravel()))
        self.nobody = self.held[:0]
        m.K = torch.empty(0)

    def assemble(self, u: np.ndarray) -> np.ndarray:
        m = self.model
        self.k, f, *_ = m.integrate_material(*self.start, torch.as_tensor(u.ravel()), self.de0, 0)
        self.K = m.assemble_matrix(self.k, self.held)
        return m.assemble_rhs(f).numpy().reshape(u.shape)

    def solve(self, force: np.ndarray, move: np.ndarray) -> np.ndarray:
        rhs, d = -torch.as_tensor(force.ravel()), torch.as_tensor(move.ravel())
        if move.any():
            rhs = rhs - self.model.assemble_matrix(self.k, self.nobody) @ d
        rhs[self.held] = d[self.held]
        x, *_ = sparse_solve(self.K, rhs, method="direct")
        return x.numpy().reshape(move.shape)


PEERS = {"": TorchFEM}
