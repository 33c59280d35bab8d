"""scikit-fem: forms for Q1/P0 with the pressure condensed, and the single form of `skfsink.fem.forms`."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
import skfem
from measure import Peer
from problem import Problem
from skfem.helpers import ddot, det, grad, inv, transpose
from skfem.io.meshio import INV_HEX_MAPPING
from sparse import SOLVERS

__all__ = ["PEERS"]


class Condensed(Peer):
    """Two forms: the tangent of displacement at fixed pressure, and that of the element volume.

    The pressure is constant in an element, p = k (J_bar - 1), so that the condensed tangent is
    K + B^T diag(k/V) B with one row of B an element.
    """

    packages = ("scikit-fem", "numpy", "scipy")
    solver = "SuperLU"

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        quad = problem.dim == 2
        cells = problem.cells if quad else problem.cells[:, INV_HEX_MAPPING[:8]]
        mesh = (skfem.MeshQuad if quad else skfem.MeshHex)(np.ascontiguousarray(problem.X.T),
                                                           np.ascontiguousarray(cells.T))
        q1, q0 = (skfem.ElementQuad1, skfem.ElementQuad0) if quad else (skfem.ElementHex1, skfem.ElementHex0)
        self.basis = skfem.Basis(mesh, skfem.ElementVector(q1()), intorder=2)
        self.constants = self.basis.with_element(q0())
        self.dV = np.abs(np.asarray(self.basis.dx))
        assert self.dV.shape[1] == 2**problem.dim
        self.D = np.flatnonzero(problem.held.ravel())
        self.forms = _forms(problem)

    def assemble(self, u: np.ndarray) -> np.ndarray:
        residual, tangent, volume = self.forms
        w = _kinematics(self.basis.interpolate(u.ravel()))
        J, V = w["J"], self.dV.sum(axis=1)
        p = self.problem.k * (np.sum(J * self.dV, axis=1) / V - 1)
        fields = {**w, "p": np.broadcast_to(p[:, None], self.dV.shape)}
        B = volume.assemble(self.basis, self.constants, **w)
        self.K = tangent.assemble(self.basis, **fields) + B.T @ sp.diags(self.problem.k / V) @ B
        return residual.assemble(self.basis, **fields).reshape(u.shape)

    def solve(self, force: np.ndarray, move: np.ndarray) -> np.ndarray:
        system = skfem.condense(self.K, -force.ravel(), x=move.ravel(), D=self.D)
        return skfem.solve(*system, solver=lambda A, b: SOLVERS[self.solver](A, b)).reshape(move.shape)


class CondensedPardiso(Condensed):
    solver = "PARDISO"
    packages = (*Condensed.packages, "pypardiso")


class OneForm(Condensed):
    """`skfsink.fem.forms`: J_bar by a mean over the element inside the form."""

    def __init__(self, problem: Problem) -> None:
        from skfsink.fem.forms import momentum_forms
        from skfsink.material import AAA

        super().__init__(problem)
        self.one = momentum_forms(AAA(bulk_modulus=problem.k, c1=problem.c1, c2=problem.c2))
        self.gamma = np.ones_like(self.dV)

    def assemble(self, u: np.ndarray) -> np.ndarray:
        fields = {"displacement": self.basis.interpolate(u.ravel()), "gamma": self.gamma, "dV": self.dV}
        self.K = self.one.tangent.assemble(self.basis, **fields)
        return self.one.residual.assemble(self.basis, **fields).reshape(u.shape)


def _kinematics(u: Any) -> dict[str, np.ndarray]:
    """What the forms need of the deformation, once an assembly: F, J, G = F^-T, I1' and its derivative by F."""
    dim = u.grad.shape[0]
    F = np.zeros((3, 3, *u.grad.shape[2:]))
    F[:] = np.eye(3)[:, :, None, None]
    F[:dim, :dim] += u.grad
    J, G = det(F), transpose(inv(F))[:dim, :dim]
    I1 = J ** (-2 / 3) * ddot(F, F)
    F = F[:dim, :dim]
    return {"F": F, "J": J, "G": G, "I1": I1, "dI1": 2 * (J ** (-2 / 3) * F - I1 / 3 * G)}


def _forms(problem: Problem) -> tuple[Any, Any, Any]:
    c1, c2 = problem.c1, problem.c2

    @skfem.LinearForm
    def residual(v: Any, w: Any) -> np.ndarray:
        J, G, I1, dI1 = w["J"], w["G"], w["I1"], w["dI1"]
        return ddot((c1 + 2 * c2 * (I1 - 3)) * dI1 + w["p"] * J * G, grad(v))

    @skfem.BilinearForm
    def tangent(u: Any, v: Any, w: Any) -> np.ndarray:
        F, J, G, I1, dI1 = w["F"], w["J"], w["G"], w["I1"], w["dI1"]
        a, b = grad(u), grad(v)
        ga, gb, scale = ddot(G, a), ddot(G, b), J ** (-2 / 3)
        cross = np.einsum("ij...,ji...->...", *(np.einsum("ki...,kj...->ij...", G, x) for x in (a, b)))
        second = 2 * scale * (ddot(a, b) - 2 / 3 * (ddot(F, a) * gb + ddot(F, b) * ga)) \
            + I1 * (4 / 9 * ga * gb + 2 / 3 * cross)
        return (2 * c2 * ddot(dI1, a) * ddot(dI1, b) + (c1 + 2 * c2 * (I1 - 3)) * second
                + w["p"] * J * (ga * gb - cross))

    @skfem.BilinearForm
    def volume(u: Any, q: Any, w: Any) -> np.ndarray:
        return q * w["J"] * ddot(w["G"], grad(u))

    return residual, tangent, volume


PEERS = {"": Condensed, "pardiso": CondensedPardiso, "one-form": OneForm}
