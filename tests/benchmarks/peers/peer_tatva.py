"""tatva: the energy in JAX; force by differentiation, tangent by coloured Jacobian products.

Colours are worked off one after the other, which is faster than all at once, and takes a seventh of the memory in 3D.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from measure import Peer
from problem import Problem
from sparse import corrected

jax.config.update("jax_enable_x64", True)

from tatva.element import Hexahedron8, Quad4  # noqa: E402
from tatva.mesh import Mesh  # noqa: E402
from tatva.operator import Operator  # noqa: E402
from tatva.sparse import ColoredMatrix, linearized_jacfwd, pattern_from_mesh  # noqa: E402

__all__ = ["PEERS"]


class Tatva(Peer):
    packages = ("tatva", "jax", "numpy", "scipy")
    solver = "SuperLU"

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        dim, shape = problem.dim, problem.X.shape
        mesh = Mesh(jnp.asarray(problem.X), jnp.asarray(problem.cells))
        op = Operator(mesh, Quad4() if dim == 2 else Hexahedron8(), cache_weights=True)
        V = op.integrate_per_element(jnp.ones((len(problem.cells), 2**dim)))

        def energy(u: jax.Array) -> jax.Array:
            F = op.grad(u.reshape(shape)) + jnp.eye(dim)
            J = jnp.linalg.det(F)
            I1 = J ** (-2 / 3) * (jnp.sum(F * F, axis=(-2, -1)) + (1.0 if dim == 2 else 0.0))
            J_bar = op.integrate_per_element(J) / V
            return (op.integrate(problem.c1 * (I1 - 3) + problem.c2 * (I1 - 3) ** 2)
                    + jnp.sum(V * problem.k / 2 * (J_bar - 1) ** 2))

        matrix = ColoredMatrix.from_csr(pattern_from_mesh(mesh, dim))
        self.both = jax.jit(linearized_jacfwd(jax.grad(energy), matrix, color_batch_size=1))

    def assemble(self, u: np.ndarray) -> np.ndarray:
        force, matrix = self.both(jnp.asarray(u.ravel()))
        self.K = matrix.to_csr()
        return np.asarray(force).reshape(u.shape)

    def solve(self, force: np.ndarray, move: np.ndarray) -> np.ndarray:
        return corrected(self.K, force, move, self.problem.held, self.solver)


class Pardiso(Tatva):
    solver = "PARDISO"
    packages = (*Tatva.packages, "pypardiso")


PEERS = {"": Tatva, "pardiso": Pardiso}
