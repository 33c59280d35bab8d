"""What the balances of momentum and of mass ask of whatever evaluates their weak forms on a mesh."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np

from ..material import Material
from .forms import BulkViscosity
from .pattern import Pattern
from .space import Space

__all__ = ["Backend", "BulkViscosity", "DensityBackend", "MomentumBackend", "Part"]


class Part(NamedTuple):
    """Elements of one material: their numbers, ascending, and the directions of their fibres, if any.

    `elements` is None for the whole body. `fibres` is (elements, families, 3); it is None for a law of I1' alone.
    """

    material: Material
    elements: np.ndarray | None
    fibres: np.ndarray | None

    def numbers(self, own: np.ndarray | slice) -> np.ndarray | slice:
        """Numbers in the mesh of elements by their numbers in the part."""
        return own if self.elements is None else self.elements[own]


def among(parts: Sequence[Part], elements: np.ndarray) -> Iterator[tuple[Part, np.ndarray, np.ndarray]]:
    """The parts that `elements` (m,) are of, in any order; of each its ones by their numbers among the m, and in it."""
    for part in parts:
        here = np.arange(elements.size) if part.elements is None else np.flatnonzero(np.isin(elements, part.elements))
        if not here.size:
            continue
        own = elements[here]
        yield part, here, own if part.elements is None else np.searchsorted(part.elements, own)


class MomentumBackend(Protocol):
    """Evaluates the momentum balance for one mesh, its parts and one of the elements of :mod:`.elements`.

    Values at the Gauss points may have a layout of the backend's own: `tile` and `untile` go there and back.

    Memory: the relative density last given to `set_gamma` or `relax`, of which `force`, `along`, `viscous_force` and
    `stiffest` are; `W`, `energy` and `mean_force` are of the last `force`.

    Attributes
    ----------
    gamma: relative density at the Gauss points as the force uses it, in the layout.
    W: stored energy density of the undamaged material [MPa], in the layout; always the same array.
    """

    gamma: np.ndarray
    W: np.ndarray

    def tile(self, values: np.ndarray) -> np.ndarray:
        """A copy of values (ne, nq) in the layout."""

    def untile(self, values: np.ndarray) -> np.ndarray:
        """A copy of values in the layout as (ne, nq)."""

    def set_gamma(self, gamma: np.ndarray) -> None:
        """Use the relative densities (ne, nq) from now on."""

    def relax(self, nodal: np.ndarray, deleted: np.ndarray, floor: float) -> float:
        """Use the Q1 field with nodal values (n,), zero below `floor` and in `deleted` elements (ne,), from now on.

        Returns the energy [N mm; N mm/mm in 2D] its fall takes from the stored energy of the last evaluation.
        """

    def force(self, u: np.ndarray, out: np.ndarray) -> float:
        """Internal force (Eq. 17) at the displacement `u` (n, dim) [mm] into `out` (n, dim) [N; N/mm in 2D].

        Returns the least J at a Gauss point with gamma > 0, at the most 1.
        """

    def along(self, u: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """The derivative of that force at `u`, as a function of a displacement (n, dim).

        It is of the density at the time of the call, and valid until this changes. What `force` has left is not
        touched.
        """

    @property
    def energy(self) -> float:
        """gamma-weighted stored energy at the last evaluation [N mm; N mm/mm in 2D]."""

    def mean_force(self) -> float:
        """Mean magnitude of the forces the elements exert on their nodes, by component, at the last evaluation."""

    def tangent(self, pattern: Pattern, u: np.ndarray, gamma: np.ndarray, convex: bool) -> np.ndarray:
        """Data of the tangent (Eq. 15, 18, 19) on `pattern`; with `convex` one that is positive at every point."""

    def mass(self, pattern: Pattern, gamma: np.ndarray) -> np.ndarray:
        """Data of the consistent mass matrix (Eq. 28) on `pattern`."""

    def lump(self, values: np.ndarray) -> np.ndarray:
        """Row sums (n,) of the scalar mass matrix with weight `values` (ne, nq):  int values N_a."""

    def stiffest(self, u: np.ndarray, inverse_mass: np.ndarray) -> float:
        """Cheap lower bound of the highest frequency squared [1/s^2]; see :meth:`.Momentum.stiffest`."""

    def viscous_force(self, u: np.ndarray, v: np.ndarray, out: np.ndarray) -> float:
        """Viscous force at displacement `u` and velocity `v` (n, dim) [mm; mm/s] into `out` (n, dim) [N; N/mm in 2D].

        Returns the greatest compression -L/c_d min(0, D) of an element with gamma > 0, 0 without bulk viscosity. What
        `force` has left is not touched.
        """

    def viscous_tangent(self, pattern: Pattern, motion: tuple[np.ndarray, np.ndarray], gamma: np.ndarray,
                        compression: float) -> np.ndarray:
        """Data of the derivative of that force with the velocity on `pattern`; see :meth:`.Momentum.viscous_tangent`.

        `motion` are displacement and velocity.
        """


class DensityBackend(Protocol):
    """Evaluates the matrices of the mass balance (Eq. 21, 24) on one mesh."""

    def laplacian(self, pattern: Pattern, *, monotone: bool) -> np.ndarray:
        """Data of  int l^2 Grad N_a . Grad N_b  on a scalar pattern.

        If `monotone` no off-diagonal is positive (see :mod:`.gradient`), else it is integrated at the Gauss points.
        """

    def sink(self, pattern: Pattern, sink: np.ndarray) -> np.ndarray:
        """Data of  int sink N_a N_b  on a scalar pattern; `sink` (ne, nq) is 1/(H + eps)."""

    def lump(self, values: np.ndarray) -> np.ndarray:
        """Row sums (n,) of that matrix for the sink `values` (ne, nq):  int values N_a."""


class _MakesMomentum(Protocol):
    def __call__(self, space: Space, parts: Sequence[Part], element: str, *, threads: int = 1,
                 bulk_viscosity: BulkViscosity = ...) -> MomentumBackend: ...


class _MakesDensity(Protocol):
    def __call__(self, space: Space, length_scale: float) -> DensityBackend: ...


def _any_size(space: Space) -> None:
    """Refuse no body."""


class Backend(NamedTuple):
    """A way to evaluate the weak forms: makers of its two halves, and what refuses a body it is not made for."""

    momentum: _MakesMomentum
    density: _MakesDensity
    check: Callable[[Space], None] = _any_size
