"""The ways to evaluate the weak forms, by name: adding one is its file, and a line in `BACKENDS`.

A form that is to be tried is an entry more: `BACKENDS["mine"] = BACKENDS["forms"]._replace(momentum=...)`.
"""

from __future__ import annotations

from ..errors import choose
from .assembled import AssembledDensity, AssembledMomentum, check_size
from .backend import Backend
from .compiled import CompiledDensity, CompiledMomentum

__all__ = ["BACKENDS", "backend"]

BACKENDS: dict[str, Backend] = {
    "compiled": Backend(CompiledMomentum, CompiledDensity),
    "forms": Backend(AssembledMomentum, AssembledDensity, check_size),
}


def backend(name: str) -> Backend:
    """The backend of that name.

    Raises
    ------
    ParameterError
        There is none.
    """
    return BACKENDS[choose("kernels", name, BACKENDS)]
