"""The ranks that this program was started on, by `mpiexec -n 4 skfsink run scene.toml`: all of them, as one."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, NoReturn

from ...errors import ParameterError

if TYPE_CHECKING:
    from mpi4py import MPI

__all__ = ["SIZES", "on_all_ranks", "world"]

#: variables with the number of ranks that MPICH and its kin, Open MPI, and MVAPICH set
SIZES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "MV2_COMM_WORLD_SIZE")
NUMBERS = ("PMI_RANK", "OMPI_COMM_WORLD_RANK", "MV2_COMM_WORLD_RANK")


@cache
def world() -> MPI.Intracomm | None:
    """All ranks; None where there is one alone. MPI is loaded only where there are several.

    Raises
    ------
    ParameterError
        There are several, and mpi4py cannot be loaded, or is that of another MPI.
    """
    asked = next((int(os.environ[name]) for name in SIZES if os.environ.get(name, "").isdigit()), 1)
    if asked <= 1:
        return None
    try:
        from mpi4py import MPI
    except (ImportError, RuntimeError) as error:
        raise ParameterError(f"{asked} ranks were started, and mpi4py cannot be loaded ({error}): install skfsink with "
                             f"its extra mpi, or run on one rank") from None
    comm = MPI.COMM_WORLD
    if comm.size != asked:
        raise ParameterError(f"mpiexec has started {asked} ranks, and mpi4py sees {comm.size}: it is of another MPI; "
                             f"take the mpiexec of the same environment")
    return comm


def on_all_ranks(program: Callable[[], object]) -> NoReturn:
    """Run a program, and end with it: where there are several ranks on the first, and let the others serve it.

    Ranks that cannot work together end, with one line of the first of them and exit status 2.
    """
    try:
        comm = world()
    except ParameterError as error:
        if all(os.environ.get(name, "0") == "0" for name in NUMBERS):  # there may be no MPI to ask
            print("skfsink:", error, file=sys.stderr)
        raise SystemExit(2) from None
    if comm is None:
        program()
        raise SystemExit(0)
    from .crew import lead
    lead(comm, program)
