"""The active zone: where gamma changes while a crack runs, and the density solve restricted to it.

The density equation carries a change of the sink over the length l: at a distance r it is felt by exp(-r/l). Between
two solves the crack runs a few per cent of l, so gamma changes near its tips only. A zone is made of the nodes around
where the equation is not met, by as many lengths l as the residual there takes to fade; outside gamma stays what it
was. Whether that was right is measured: the residual of the *whole* system has to meet the target of a solve
everywhere. What is left of it outside is taken up in another zone, and if that does not help, the zones' solution is
only a guess for one everywhere.

Zones are chosen by cells as wide as l. The depth of a cell is its distance from the end of the zone, at least. A
zone serves later solves as long as all residuals are deep enough in it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from ..fem.amg import AmgCG
from ..fem.jacobi import JacobiCG
from ..system.jit import njit

__all__ = ["ActiveZone", "Zone"]


class Zone(NamedTuple):
    """A zone.

    Attributes
    ----------
    depth: of each cell [mm], zero outside.
    nodes: those in it, ascending.
    size: their number, in the whole body.
    inner: the solver of their part of the system.
    """

    depth: np.ndarray
    nodes: np.ndarray
    size: float
    inner: AmgCG | JacobiCG


class ActiveZone:
    """Solves  A x = b  where the residual of the guess is, and checks the solution everywhere.

    Zones are handed in and out: which ones a solve finds is the caller's affair, and no solve depends on another.

    Memory: counts and the `residual` of the last solve. `solve` depends on no earlier call.

    Parameters
    ----------
    X: nodal coordinates [mm], (n, dim).
    length_scale: the characteristic length l [mm].
    solver: of the whole system; the zone uses its part of the hierarchy, if it has one.

    Attributes
    ----------
    solves: those made in zones.   misses: solutions in a zone whose residual outside was too large.
    choices: how often a zone was chosen anew.
    residual: relative residual of the whole system after the last solve.
    """

    CELL = 1.0       # width of a cell, lengths l
    RADIUS = 2.5     # lengths l around a node whose residual is the target of the whole system
    DECADE = 1.2     # lengths l more for each decade by which it is larger
    MARGIN = 3.0     # lengths l by which they may move before another zone is chosen
    MOST = 0.6       # of all nodes; a larger zone would not pay
    KEPT = 8         # zones, those used last
    PASSES = 3       # zones one after the other in a solve
    SHARE = 0.7      # of the target for the solve in a zone; the rest is for what is left outside

    def __init__(self, X: np.ndarray, length_scale: float, solver: AmgCG | JacobiCG) -> None:
        self._l, self._solver, self._exchange = length_scale, solver, solver.exchange
        width, exchange = self.CELL * length_scale, solver.exchange
        own, cell = np.unique(np.floor(X / width), axis=0, return_inverse=True)
        cells, places = np.unique(exchange.all(own), axis=0, return_inverse=True)  # those of the whole body
        first = int(exchange.all(np.array([len(own)]))[:exchange.number].sum())
        self._centres = width * np.ascontiguousarray(cells)
        self._cell = places.ravel()[first:first + len(own)][cell.ravel()]
        self._counted = exchange.counts(len(X))
        self._sizes = exchange.sums(np.bincount(self._cell[self._counted], minlength=len(cells)))  # in nodes
        self.solves = self.misses = self.choices = 0
        self.residual = 0.0

    def solve(self, A: csr_array, D: np.ndarray, b: np.ndarray, x: np.ndarray, tolerance: float,
              *, zones: tuple[Zone, ...] = ()) -> tuple[np.ndarray, bool, int, tuple[Zone, ...]]:
        """The solution from the guess `x` (see :meth:`.AmgCG.solve`), whether it meets the target, iterations, zones.

        One that does not is the best guess for a solve everywhere. `zones` are those of the solves before, the one
        used last at the end; so are those returned.
        """
        norm, x = self._exchange.norm, x.copy()
        tolerance, size = self._solver.sharp(tolerance), norm(b)
        r = self._solver.settle(A, D, b, x)
        self.residual = norm(r) / size
        if self.residual <= tolerance:
            return x, True, 0, zones
        total = 0
        for _ in range(self.PASSES):
            zone = self._find(r, tolerance * size, zones)
            if zone is None:
                return x, False, total, zones
            zones = (*[other for other in zones if other is not zone][-self.KEPT + 1:], zone)
            converged = zone.inner.iterate(A, D, r, x, self.SHARE * tolerance * size)
            total += zone.inner.iterations
            if not converged:
                return x, False, total, zones
            r = self._solver.residual_of(A, x, b)
            self.residual = norm(r) / size
            if self.residual <= 2 * tolerance:
                self.solves += 1
                return x, True, total, zones
            self.misses += 1
        return x, False, total, zones

    def _find(self, r: np.ndarray, target: float, zones: tuple[Zone, ...]) -> Zone | None:
        """The smallest of `zones` that is deep enough for the residual `r`, or a new one; None if that is too large."""
        need, exchange = np.zeros(len(self._centres)), self._exchange
        level = _level(exchange.sums(_squares(r, self._counted, target)), target)
        _reach(r, self._cell, (level, target), self.RADIUS * self._l, self.DECADE * self._l, need)
        need = exchange.maxima(need)
        fit = [zone for zone in zones if (zone.depth >= need).all()]
        if fit:
            return min(fit, key=lambda zone: zone.size)
        depth = np.zeros_like(need)
        if not _deepen(self._centres, need, self.MARGIN * self._l, self._sizes, self.MOST, depth):
            return None
        self.choices += 1
        return self.of_depth(depth)

    def of_depth(self, depth: np.ndarray) -> Zone:
        """The zone with these depths of the cells [mm], as a checkpoint keeps them."""
        nodes = np.flatnonzero(depth[self._cell])
        return Zone(depth, nodes, float(self._sizes[depth > 0].sum()), self._solver.restricted(nodes))


@njit(cache=True)
def _squares(r, counted, target):  # type: ignore[no-untyped-def]
    """Sums of squares of the residuals that count, by powers of two, from 2^-48 of the target on."""
    squares = np.zeros(64)
    for i in range(r.size):
        if counted[i]:
            squares[min(max(math.frexp(r[i] / target)[1] + 48, 0), 63)] += r[i] * r[i]
    return squares


@njit(cache=True)
def _level(squares, target):  # type: ignore[no-untyped-def]
    """Residual below which the norm of all is half of the target."""
    power, rest = 0, squares[0]
    while power < 63 and rest + squares[power + 1] <= 0.25 * target * target:
        power += 1
        rest += squares[power]
    return 2.0 ** (power - 48) * target


@njit(cache=True)
def _reach(r, cell, sizes, radius, decade, need):  # type: ignore[no-untyped-def]
    """Depth that the residual needs in each cell, where it is at least the level; `sizes` are level and target."""
    level, target = sizes
    for i in range(r.size):
        if abs(r[i]) >= level:
            need[cell[i]] = max(need[cell[i]], radius + decade * np.log10(abs(r[i]) / target))


@njit(cache=True)
def _deepen(centres, need, margin, sizes, most, depth):  # type: ignore[no-untyped-def]
    """Depth of all cells in the zone that reaches `need` and `margin` farther around each cell with a need.

    `centres` ascend along the first axis. False as soon as the zone has more than a share `most` of all nodes, of which
    a cell has `sizes`.
    """
    left, sources = most * sizes.sum(), np.flatnonzero(need)
    if sizes[sources].sum() > left:
        return False
    for first in range(16):  # far from each other at first: a large zone is soon known to be one
        for s in sources[first::16]:
            reach = need[s] + margin
            near, far = np.searchsorted(centres[:, 0], np.array([centres[s, 0] - reach, centres[s, 0] + reach]))
            for c in range(near, far):
                square = 0.0
                for i in range(centres.shape[1]):
                    square += (centres[c, i] - centres[s, i]) ** 2
                least = reach - depth[c]
                if least > 0.0 and square < least * least:
                    if depth[c] == 0.0:
                        left -= sizes[c]
                    depth[c] = reach - np.sqrt(square)
            if left < 0.0:
                return False
    return True
