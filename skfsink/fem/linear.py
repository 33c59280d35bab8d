"""What solves for the displacements of statics, by name: adding a solver is its class, and a line in `LINEAR`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from .direct import BACKENDS, Factorization
from .multigrid import Multigrid
from .pattern import Pattern
from .petsc import OnOneRank, Petsc
from .petsc_matrix import PETSC
from .space import Space

__all__ = ["LINEAR", "Solver", "solver"]

Solver = Factorization | Multigrid | Petsc


def _direct(backend: str | None, space: Space, free: np.ndarray, pattern: Pattern, threads: int) -> Solver:
    return Factorization(pattern, backend, threads)


#: "direct" takes the first of the backends of :class:`.Factorization` that is installed
LINEAR: dict[str, Callable[[Space, np.ndarray, Pattern, int], Solver]] = {
    "direct": partial(_direct, None), **{name: partial(_direct, name) for name in BACKENDS}, "multigrid": Multigrid,
    **{name: partial(OnOneRank, name) for name in PETSC}}


def solver(name: str, space: Space, free: np.ndarray, pattern: Pattern, threads: int) -> Solver:
    """A solver over the unknowns that are `free` (n*dim,), of matrices on the `pattern` of these."""
    return LINEAR[name](space, free, pattern, threads)
