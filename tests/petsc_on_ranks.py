"""What `mpiexec -n N python tests/petsc_on_ranks.py` checks on all ranks: tangents in parts against the whole one."""

from __future__ import annotations

import numpy as np
from on_ranks import COMM, check, stretched, whole_body

from skfsink.fem.direct import Factorization
from skfsink.fem.pattern import Pattern
from skfsink.fem.petsc import OnOneRank
from skfsink.fem.petsc_matrix import PETSC
from skfsink.fields.body import Body
from skfsink.methods.controls import ExplicitControls
from skfsink.methods.ranks.part import parts_of
from skfsink.methods.ranks.tangent import TangentOfPart

SQUEEZED = 0.5  # of its height: the body buckles


def check_solver(name: str, body: Body, u: np.ndarray, dim: int) -> None:
    """Solutions in parts are those of factors of the whole body, found in as many iterations as on one rank."""
    space, part = body.space, list(parts_of(body, ExplicitControls(), COMM.size))[COMM.rank]
    pattern = Pattern(space, dim, body.free, upper=True)
    factors, alone = Factorization(pattern), OnOneRank(name, space, body.free, pattern)
    tangent, numbers = TangentOfPart(COMM), part.numbers
    tangent.take(part, name)
    unknowns = (numbers.nodes[:numbers.counted, None] * dim + np.arange(dim)).ravel()
    own = (np.cumsum(body.free) - 1)[unknowns[body.free[unknowns]]]
    b = np.sin(1.0 + 2.4 * np.arange(pattern.size))
    for share in (0.5, 1.0):  # the second is put in the place of the first
        data = body.momentum.tangent(pattern, share * u, convex=True)
        assert factors.factorize(data) and alone.factorize(data)
        tangent.assemble(share * u[numbers.nodes], body.momentum.gamma[numbers.elements], True)
        check("definite", tangent.prepare(), 1.0, 0.0)
        x, iterations, met = tangent.conjugate(b[own], 1e-9, 500)
        check(f"{name}: met", met, 1.0, 0.0)
        check(f"{name}: solution", x, factors.solve(b)[own], 1e-5)
        check(f"{name}: iterations", iterations, alone.conjugate(data, b, 1e-9, 500)[1], 0.3)
    if alone.exact:
        check("substitution", tangent.substitute(b[own]), factors.solve(b)[own], 1e-7)
        bent = -(1.0 - SQUEEZED) * space.X * np.eye(dim)[1]
        expected = factors.factorize(body.momentum.tangent(pattern, bent))
        tangent.assemble(bent[numbers.nodes], body.momentum.gamma[numbers.elements], False)
        check("signs of pivots", tangent.prepare(), expected, 0.0)
        check("not definite", expected, 0.0, 0.0)
    tangent.release()
    alone.release()


def main() -> None:
    """Check a plane body, one in space, and one of revolution, with a region and damage."""
    for dim, rings in ((2, False), (3, False), (2, True)):
        body = whole_body(dim, rings)
        state = stretched(body)
        body.momentum.set_gamma(state.gamma, state.deleted)
        for name in PETSC:
            check_solver(name, body, state.u, dim)
    print(f"rank {COMM.rank} of {COMM.size}: as the whole body", flush=True)


if __name__ == "__main__":
    main()
