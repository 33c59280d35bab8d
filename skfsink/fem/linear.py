"""What solves for the displacements of statics, by name: adding a solver is its class, and a line in `LINEAR`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from .direct import BACKENDS, Factorization
from .multigrid import Multigrid
from .pattern import Pattern
from .petsc import OnOneRank, Petsc
from .petsc_matrix import GAMG, PETSC, is_there
from .space import Space

__all__ = ["AUTO", "LARGE_FACTORS", "LINEAR", "Solver", "linear_for", "solver"]

Solver = Factorization | Multigrid | Petsc


def _direct(backend: str | None, space: Space, free: np.ndarray, pattern: Pattern, threads: int) -> Solver:
    return Factorization(pattern, backend, threads)


#: "direct" takes the first of the backends of :class:`.Factorization` that is installed
LINEAR: dict[str, Callable[[Space, np.ndarray, Pattern, int], Solver]] = {
    "direct": partial(_direct, None), **{name: partial(_direct, name) for name in BACKENDS}, "multigrid": Multigrid,
    **{name: partial(OnOneRank, name) for name in PETSC}}


AUTO = "auto"        #: takes one of `LINEAR` by the size of the body
SMALL = 200_000      # displacements whose factors are never large
LARGE_FACTORS = 6.0  #: GB, of a thick solid of 500,000 displacements: past them iterations take less time and memory


def linear_for(asked: str, space: Space) -> str:
    """What solves for the displacements of a body: what is `asked` for, by name, or with "auto" what suits its size.

    Those are factors, and for solids whose factors pass `LARGE_FACTORS` petsc-gamg, or multigrid without PETSc; see
    :mod:`skfsink.study.tangent` for what each takes.
    """
    if asked != AUTO:
        return asked
    if space.dim == 2 or space.X.size <= SMALL or 8e-9 * space.dim**2 * space.factor_entries <= LARGE_FACTORS:
        return "direct"
    return GAMG if is_there() else "multigrid"


def solver(name: str, space: Space, free: np.ndarray, pattern: Pattern, threads: int) -> Solver:
    """A solver over the unknowns that are `free` (n*dim,), of matrices on the `pattern` of these."""
    return LINEAR[name](space, free, pattern, threads)
