"""The relative density: history of the stored energy, and the solve of the mass balance for gamma (Eq. 6-10, 20-24).

    int l^2 Grad gamma . Grad dgamma + gamma dgamma/(H + eps) = int dgamma

The matrix of the gradient term has no positive off-diagonals, unless it is asked for as the rule of Gauss gives it. The
sink term has several quadratures, see :mod:`.sinks`. Where it stays on the diagonal the system is solved by conjugate
gradients with an algebraic multigrid preconditioner, else it is factorised.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from ..errors import ConvergenceError, choose
from ..fem.amg import AmgCG
from ..fem.backends import backend
from ..fem.direct import Factorization
from ..fem.jacobi import JacobiCG
from ..fem.pattern import Pattern
from ..fem.space import Space
from ..material import SinkLaw
from ..material.regions import Region, by_element, check_lengths, rest_of
from ..system.jit import njit
from .active_zone import ActiveZone, Zone
from .sinks import SINKS

__all__ = ["GRADIENTS", "SOLVERS", "Density", "DensitySolver"]

log = logging.getLogger(__name__)

#: matrices of the gradient term: without positive off-diagonals (see :mod:`.gradient`), or as integrated by Gauss
GRADIENTS = ("monotone", "gauss")
#: of sinks that stay on the diagonal: conjugate gradients with multigrid, or with the diagonal alone
SOLVERS = ("multigrid", "jacobi")


class Density(NamedTuple):
    """The relative density of a state, with what it was found from.

    It belongs to its state: a method that gives up a step goes back to the one of the state before.

    Attributes
    ----------
    gamma: nodal values, (n,).
    sink: coefficients 1/(H + eps) whose solution gamma is, (ne, nq); None if that is not known.
    zones: active zones in which it was found, to look in first the next time (see :mod:`.active_zone`).
    """

    gamma: np.ndarray
    sink: np.ndarray | None = None
    zones: tuple[Zone, ...] = ()


class DensitySolver:
    """Solves for the nodal gamma, given the greatest stored energy W each Gauss point has seen.

    Its solutions are functions of the arguments alone: what it keeps between calls are counts.

    Memory: counts, the `residual` of the last solve and the analysis of the matrix (`factorisations`), which `release`
    drops. `solve` and `update` depend on no earlier call.

    Parameters
    ----------
    space: the spaces.
    law: sink and flux parameters, of the elements that are in no region.
    sink: one of :data:`.SINKS`.
    unchanged: a solve is left out when no sink coefficient moved by more than this, relatively, since the last one.
    active_zone: solves with a tolerance of their own are made where gamma changes (see :mod:`.active_zone`).
    solver: one of :data:`SOLVERS`; that of a body in several parts is "jacobi".
    regions: elements with limiters of their own; the length l and epsilon are those of `law`.
    kernels: what evaluates the weak forms, a name in :data:`.BACKENDS`.
    absent: numbers of elements that the balance leaves out, as if the mesh had a cut there; gamma is 0 at their nodes
        that no other element has.
    gradient: one of :data:`GRADIENTS`, of the sinks that stay on the diagonal; that of others is always "gauss".

    Attributes
    ----------
    parts: numbers of elements and their law, for each law that has some.
    phi, failure_energy: Phi and psi_f [MPa], numbers, or where regions differ one for each element, (ne, 1) and (ne,).
    solves, skipped: how often it was solved, and left out because H had not changed.
    iterations: conjugate-gradient iterations so far.
    fallbacks: solves in which AMG-CG did not converge and the matrix was factorised instead.
    """

    def __init__(self, space: Space, law: SinkLaw, sink: str = "lumped", *, tolerance: float = 1e-8,
                 unchanged: float = 1e-12, active_zone: bool = True, solver: str = "multigrid",
                 regions: Sequence[Region] = (), kernels: str = "compiled", gradient: str = "monotone",
                 absent: np.ndarray | None = None) -> None:
        choose("sink", sink, SINKS)
        choose("gradient", gradient, GRADIENTS)
        choose("density_solver", solver, SOLVERS)
        self.space, self.law, self.sink, self._quadrature = space, law, sink, SINKS[sink]
        self.gradient = gradient
        self.unchanged = unchanged
        check_lengths(law, regions)
        ne = space.n_elements
        parts = [(rest_of(regions, ne), law), *((region.elements, region.sink_law) for region in regions)]
        self.parts = [(elements, law) for elements, law in parts if elements.size]
        phi = by_element(ne, law.phi, regions, lambda region: region.sink_law.phi)
        self.phi = phi[:, None] if isinstance(phi, np.ndarray) else phi
        self.failure_energy = by_element(ne, law.failure_energy, regions, lambda region: region.sink_law.failure_energy)
        self.absent = np.zeros(0, np.int64) if absent is None else absent
        self.backend = backend(kernels).density(space, law.length_scale)
        self.load = self._lump(np.ones_like(space.w))
        self._bounded = self._quadrature.monotone and gradient == "monotone"
        self._counted = space.exchange.counts(space.n_nodes)
        self.active_zone, self._solver, self._tolerance = active_zone and self._quadrature.monotone, solver, tolerance
        self._released = 0
        self._prepare()
        self._residual = 0.0
        self.solves = self.skipped = self.iterations = self.fallbacks = 0

    def _prepare(self) -> None:
        """Matrices, and what solves with them."""
        space = self.space
        self.pattern = Pattern(space)
        self._assembled = Pattern(space, absent=self.absent) if self.absent.size else self.pattern
        self._laplacian = self.backend.laplacian(self._assembled, monotone=self._bounded)
        self._laplacian[self.pattern.diagonal[self.load == 0.0]] = 1.0
        self._data, self._laplacian_diagonal = self._laplacian.copy(), self._laplacian[self.pattern.diagonal]
        self._direct: Factorization | None = None
        self.zone: ActiveZone | None = None
        if self._solver == "jacobi" and self._quadrature.monotone:
            intact = self._assemble(np.ones_like(space.w))[self.pattern.diagonal]
            self._iterative: AmgCG | JacobiCG = JacobiCG(space.exchange, space.exchange.whole(intact), self._tolerance)
        else:
            self._iterative = AmgCG(self.pattern.matrix(self._assemble(np.ones_like(space.w))), self._tolerance)
        if self.active_zone:
            self.zone = ActiveZone(space.X, self.law.length_scale, self._iterative)

    def release(self) -> None:
        """Free the memory of matrices and solvers; they are made again when they are needed."""
        self._released = self.factorisations
        for name in ("pattern", "_assembled", "_laplacian", "_data", "_laplacian_diagonal", "_direct", "zone",
                     "_iterative"):
            vars(self).pop(name, None)

    @property
    def residual(self) -> float:
        """True relative residual of the last iterative solve, over the whole body."""
        return self._residual

    @property
    def _error(self) -> float:
        """Bound of the error of gamma: A^-1 is positive, and A carries gamma = 1 to at least the load."""
        exchange, least = self.space.exchange, float(self.load[self.load > 0.0].min(initial=np.inf))
        return 1e-9 + self._residual * float(exchange.norm(self.load) / -exchange.greatest(-least))

    @property
    def factorisations(self) -> int:
        """Numerical factorisations made so far."""
        direct = vars(self).get("_direct")
        return self._released + (0 if direct is None else int(direct.count))

    def solve(self, W_max: np.ndarray, gamma: np.ndarray, tolerance: float | None = None) -> np.ndarray:
        """Nodal gamma (n,) for the history `W_max` (ne, nq) [MPa], from the guess `gamma`; see :meth:`update`."""
        return self.update(W_max, Density(gamma), tolerance).gamma

    def update(self, W_max: np.ndarray, before: Density, tolerance: float | None = None) -> Density:
        """The density for the history `W_max` (ne, nq) [MPa]: `before` itself where no sink coefficient has moved.

        Given a `tolerance` of the relative residual, other than the solver's, it looks in the active zones of `before`
        first.

        Raises
        ------
        ConvergenceError
            The history is not finite, or the solution with a sink on the diagonal leaves (0, 1] by more than its error:
            with the gradient "gauss" on some meshes, with "monotone" on none but by rounding.
        """
        exchange = self.space.exchange
        if not np.isfinite(exchange.greatest(float(W_max.max()))):  # infinite, it would make a dead point in silence
            raise ConvergenceError("the stored energy of a Gauss point is not finite")
        sink = self.coefficients(W_max)
        if before.sink is not None and not exchange.total(_changed(sink, before.sink, self.unchanged)):
            self.skipped += 1
            return before
        self.solves += 1
        if "pattern" not in vars(self):
            self._prepare()
        data = self._assemble(sink)
        result, zones = None, before.zones
        if self._quadrature.monotone or sink.max() < 1e3 * sink.min():
            diagonal = exchange.whole(data[self.pattern.diagonal])
            result, zones = self._iterate(self.pattern.matrix(data), diagonal, before, tolerance)
        if result is None:
            result = self._factorise(data)
        least, most = -exchange.greatest(-float(result.min())), exchange.greatest(float(result.max()))
        if self._quadrature.monotone and not (-self._error < least and most < 1 + self._error):
            why = ("its equation was not solved accurately enough" if self._bounded else "the mesh has elements so "
                   "tall, flat or distorted that gradient gauss has no maximum principle: take gradient monotone")
            raise ConvergenceError(f"the relative density left (0, 1]: {least:.3g} to {most:.6g}; {why}")
        return Density(result, sink, zones)

    def coefficients(self, W_max: np.ndarray) -> np.ndarray:
        """Sink coefficients 1/(H + eps) of Eq. (9, 10), (ne, nq), each element by its law."""
        if len(self.parts) == 1:
            return self.parts[0][1].coefficients(W_max)
        sink = np.empty_like(W_max)
        for elements, law in self.parts:
            sink[elements] = law.coefficients(W_max[elements])
        return sink

    def _iterate(self, A: csr_array, D: np.ndarray, before: Density,
                 tolerance: float | None) -> tuple[np.ndarray | None, tuple[Zone, ...]]:
        """Solution by iteration, in the active zone where that is enough, None if it did not converge; and the zones.

        Raises
        ------
        ConvergenceError
            It did not converge, and the solver has no multigrid.
        """
        gamma, zones = before.gamma, before.zones
        if self.zone is not None and tolerance is not None:
            gamma, met, iterations, zones = self.zone.solve(A, D, self.load, gamma, tolerance, zones=zones)
            self.iterations += iterations
            self._residual = self.zone.residual
            if met:
                return gamma, zones
        solver = self._iterative
        result = solver.solve(A, D, self.load, gamma, tolerance)
        self.iterations += solver.iterations
        self._residual = solver.residual
        if result is None and isinstance(solver, JacobiCG):
            raise ConvergenceError(f"no density in {solver.max_iterations} conjugate gradients with the diagonal, of "
                                   f"a residual of {solver.residual:.2g}: take density_solver multigrid, on one rank")
        return result, zones

    def _assemble(self, sink: np.ndarray) -> np.ndarray:
        """Data of the matrix, in a part of a body its share of it."""
        if not self._quadrature.monotone:
            return self._laplacian + self._quadrature.assemble(self._assembled, self.backend, sink)
        self._data[self.pattern.diagonal] = self._laplacian_diagonal + self._lump(sink) * self._counted
        return self._data  # one array for all solves: only the diagonal changes

    def _lump(self, values: np.ndarray) -> np.ndarray:
        """Nodal sums (n,) of Gauss point values; of sink and load alike, so that H = 1 gives gamma = 1."""
        if self.absent.size:
            values = values.copy()
            values[self.absent] = 0.0
        return self._quadrature.sums(self.space, self.backend, values)

    def _factorise(self, data: np.ndarray) -> np.ndarray:
        """Direct solve, on the matrix scaled to a unit diagonal: its entries span fifteen decades."""
        if self._direct is None:
            if self._quadrature.monotone:
                log.warning("conjugate gradients on the %s sink did not converge in %d iterations; factorising",
                            self.sink, self._iterative.max_iterations)
            else:
                log.warning("the %s sink varies by more than 1e3 inside an element, where conjugate gradients stall; "
                            "factorising instead", self.sink)
            self._direct = Factorization(Pattern(self.space, upper=True))
        self.fallbacks += 1
        upper = self._direct.pattern
        A = self.pattern.matrix(data)
        scale = 1.0 / np.sqrt(A.diagonal())
        rows = np.repeat(np.arange(upper.size), np.diff(upper.indptr))
        keep = self.pattern.indices >= np.repeat(np.arange(self.pattern.size), np.diff(self.pattern.indptr))
        self._direct.factorize(data[keep] * scale[rows] * scale[upper.indices])
        return scale * self._direct.solve(scale * self.load, tolerance=1e-10)


@njit(cache=True)
def _changed(new, old, tolerance):  # type: ignore[no-untyped-def]
    for e in range(new.shape[0]):
        for q in range(new.shape[1]):
            if abs(new[e, q] - old[e, q]) > tolerance * old[e, q]:
                return True
    return False
