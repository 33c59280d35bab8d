"""Statics of a body in parts: the first rank iterates, and all of them assemble the tangents and solve with them."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ...errors import ConvergenceError, ParameterError
from ...fem.linear import Solver, linear_for
from ...fem.petsc import Petsc
from ...fem.petsc_matrix import PETSC
from ...fields.body import Body, BodyControls
from ...loads.schedule import Loading
from ..controls import ExplicitControls, StaticsControls
from ..newton import Newton
from ..statics import Statics
from .crew import Crew
from .part import parts_of
from .world import world

__all__ = ["NewtonInParts", "check_statics", "statics_of"]


def statics_of(body: Body, controls: StaticsControls) -> Statics:
    """Statics of a body; with PETSc its tangents are those of all ranks that there are."""
    comm = world()
    if comm is None or linear_for(controls.linear, body.space) not in PETSC:
        return Statics(body, controls)
    newton = NewtonInParts.of(body, controls)
    newton.lead(body, Crew(comm))
    return Statics(body, controls, newton)


def check_statics(loading: Loading, controls: BodyControls, linear: str) -> None:
    """Refuse what cannot be computed with tangents in parts (ParameterError)."""
    what = ("contact" if controls.contact else "pressures and fillings" if loading.followers is not None
            else "planes of an oblique direction" if loading.sliding is not None
            else "kernels forms" if controls.kernels != "compiled" else "")
    if what:
        raise ParameterError(f"linear {linear} on several ranks cannot compute {what}: start it on one rank, or take "
                             f"linear = 'direct', with which the first rank loads the body")


class NewtonInParts(Newton):
    """Newton's method with tangents in parts.

    Memory: that of :class:`.Newton`, and of all ranks, from the first `tangent` to
    `release`: the `solver` of the last one.
    """

    NEARBY = False  # the parts that the ranks have are of the whole body

    def lead(self, body: Body, crew: Crew) -> None:
        """Take the ranks for the body."""
        self._body, self.crew = body, crew

    @cached_property
    def solver(self) -> Solver:
        """What solves for steps on all ranks."""
        return _InParts(self._linear, self._body, self.crew)

    @cached_property
    def pattern(self) -> Any:
        """Each part has its own."""
        raise AssertionError("a body in parts has no pattern as a whole")

    def tangent(self, u: np.ndarray, convex: bool = False) -> np.ndarray:
        assert isinstance(self.solver, _InParts)
        return self.solver.assemble(u, self.momentum.gamma, convex)

    def _stiffen(self, data: np.ndarray) -> None:
        raise ConvergenceError("no equilibrium: the tangent is not positive definite, even where it is made convex; "
                               "take linear = 'direct'")


class _InParts(Petsc):
    """The solver on all ranks; in the place of a matrix it has a number for the one last assembled.

    Memory: the parts on all ranks and the matrix last assembled, until `release`; see :class:`.Petsc`.
    """

    def __init__(self, name: str, body: Body, crew: Crew) -> None:
        super().__init__(name, body.space.dim, int(body.free.sum()))
        parts = list(parts_of(body, ExplicitControls(), crew.size))
        self._crew, self._parts, dim = crew, [part.numbers for part in parts], body.space.dim
        number, self._own = np.cumsum(body.free) - 1, []
        for part in self._parts:
            unknowns = (part.nodes[:part.counted, None] * dim + np.arange(dim)).ravel()
            self._own.append(number[unknowns[body.free[unknowns]]])
        crew.tangent("take", [(part, name) for part in parts])

    def assemble(self, u: np.ndarray, gamma: np.ndarray, convex: bool) -> np.ndarray:
        """Assemble the tangent at `u` (n, dim) and the density `gamma` at Gauss points (ne, nq); what names it."""
        self._crew.tangent("assemble", [(u[p.nodes], gamma[p.elements], convex) for p in self._parts])
        self._last = np.zeros(0)
        return self._last

    def _set(self, data: np.ndarray) -> None:
        assert data is self._last  # of all ranks

    def _prepare(self) -> bool:
        return all(self._crew.tangent("prepare", [()] * self._crew.size))

    def _conjugate(self, b: np.ndarray, tolerance: float, most: int) -> tuple[np.ndarray, int, bool]:
        found = self._crew.tangent("conjugate", [(b[own], tolerance, most) for own in self._own])
        return self._whole([x for x, _, _ in found]), found[0][1], found[0][2]

    def _substitute(self, b: np.ndarray) -> np.ndarray:
        return self._whole(self._crew.tangent("substitute", [(b[own],) for own in self._own]))

    def _whole(self, pieces: list[np.ndarray]) -> np.ndarray:
        x: np.ndarray = np.empty(self._size)
        for own, piece in zip(self._own, pieces):
            x[own] = piece
        return x

    def release(self) -> None:
        """Free the memory of all ranks."""
        super().release()
        self._crew.tangent("release", [()] * self._crew.size)
