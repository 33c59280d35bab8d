"""The active zone: where gamma changes while a crack runs, and the density solve restricted to it.

The density equation carries a change of the sink over the length l: at a distance r it is felt by exp(-r/l). Between
two solves the crack runs a few per cent of l, so gamma changes near its tips only. The zone is made of the nodes within
some lengths l of where the equation is not met; outside gamma stays what it was. Whether that was right is measured:
the residual of the *whole* system has to meet the target of a solve everywhere, or the zone's solution is only a guess
for one.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from .amg import AmgCG, residual

__all__ = ["ActiveZone"]


class ActiveZone:
    """Solves  A x = b  where the residual of the guess is, and checks the solution everywhere.

    Parameters
    ----------
    X: nodal coordinates [mm], (n, dim).
    length_scale: the characteristic length l [mm].
    amg: the solver of the whole system; the zone uses its part of the hierarchy.

    Attributes
    ----------
    nodes: the nodes of the zone, ascending; none before the first solve.
    solves, misses: solves in the zone, and those of them whose residual outside was too large.
    choices: how often the zone was chosen anew.
    residual: relative residual of the whole system after the last solve.
    """

    RADIUS = 5.0     # lengths l around the sources that belong to the zone
    MARGIN = 2.0     # lengths l by which the sources may move before it is chosen anew
    RECENT = 15      # solves for which a source is remembered
    MOST = 0.6       # of all nodes; a larger zone would not pay, and
    PATIENCE = 10    # solves are made everywhere before another one is looked for
    SHARE = 0.7      # of the target for the solve in the zone; the rest is for what is left outside

    def __init__(self, X: np.ndarray, length_scale: float, amg: AmgCG) -> None:
        self._X, self._l, self._amg = X, length_scale, amg
        self.nodes = np.zeros(0, np.int64)
        self.solves = self.misses = self.choices = 0
        self.residual = 0.0
        self._seen = np.full(len(X), -self.RECENT - 1, np.int64)  # number of the solve in which a node was a source
        self._count = self._next = 0
        self._from = np.zeros(len(X), bool)  # the sources the zone was chosen for
        self._core = np.zeros(len(X), bool)  # where sources do not call for another choice
        self._inner: AmgCG | None = None

    def solve(self, A: csr_array, D: np.ndarray, b: np.ndarray, x: np.ndarray,
              tolerance: float) -> tuple[np.ndarray, bool, int]:
        """The solution from the guess `x` (see :meth:`.AmgCG.solve`), whether it meets the target, and iterations.

        One that does not is the best guess for a solve everywhere.
        """
        size = float(np.linalg.norm(b))
        dead = self._amg.dead(D)
        x = x + np.where(dead, residual(A, x, b) / D, 0.0)  # these follow their sink
        r = residual(A, x, b)
        self.residual = float(np.linalg.norm(r)) / size
        if self.residual <= tolerance:
            return x, True, 0
        self._count += 1
        sources = self._sources(np.abs(r), 0.5 * tolerance * size)
        self._seen[sources] = self._count
        if self._count >= self._next and not self._core[sources].all():
            self._choose(self._seen > self._count - self.RECENT, A)
            if self._inner is None:  # there are too many of them
                self._choose(sources, A)
        if self._inner is None or not self._core[sources].all():
            return x, False, 0
        nodes = self.nodes
        block = csr_array((A.data[self._take], self._indices, self._indptr), shape=(nodes.size,) * 2)
        inside = self._inner.solve(block, D[nodes], b[nodes] - self._coupling @ x, x[nodes], self.SHARE * tolerance,
                                   size)
        if inside is None:
            return x, False, self._inner.iterations
        x[nodes] = inside
        self.residual = float(np.linalg.norm(residual(A, x, b))) / size
        self.solves += 1
        met = self.residual <= 2 * tolerance
        self.misses += not met
        return x, met, self._inner.iterations

    @staticmethod
    def _sources(magnitude: np.ndarray, negligible: float) -> np.ndarray:
        """Mask of the nodes with the largest residuals, such that the others have a norm below `negligible`."""
        level = 0.3 * float(magnitude.max())
        while True:
            sources = magnitude > level
            if float(np.linalg.norm(magnitude[~sources])) <= negligible:
                return sources
            level *= 0.3

    def _choose(self, sources: np.ndarray, A: csr_array) -> None:
        """Choose the zone around `sources` (mask)."""
        self.choices += 1
        self._from = sources
        furthest = (self.RADIUS + self.MARGIN) * self._l
        distance, _ = cKDTree(self._X[sources]).query(self._X, distance_upper_bound=furthest)
        self._core = distance <= self.MARGIN * self._l
        self.nodes = np.flatnonzero(np.isfinite(distance))
        self._inner = None
        if self.nodes.size > self.MOST * len(self._X):
            self._next = self._count + self.PATIENCE
            return
        place = csr_array((np.arange(1, A.nnz + 1), A.indices, A.indptr), shape=A.shape)[self.nodes]
        mine = np.zeros(len(self._X), bool)
        mine[self.nodes] = True
        block = place[:, self.nodes]
        block.sort_indices()
        self._take, self._indptr, self._indices = block.data - 1, block.indptr, block.indices
        keep = ~mine[place.indices]
        rows = np.repeat(np.arange(self.nodes.size), np.diff(place.indptr))[keep]
        self._coupling = csr_array((A.data[place.data[keep] - 1], (rows, place.indices[keep])),
                                   shape=(self.nodes.size, len(self._X)))
        self._inner = self._amg.restricted(self.nodes)

    # --- checkpoints ---
    def memory(self) -> dict[str, np.ndarray]:
        """What decides the zone of the next solves, for a checkpoint."""
        return {"zone_seen": self._seen, "zone_from": self._from, "zone_count": np.array([self._count, self._next])}

    def restore(self, memory: dict[str, np.ndarray], A: csr_array) -> None:
        """Take up what :meth:`memory` gave; `A` is any matrix of the system, of which the couplings are taken."""
        self._seen = memory["zone_seen"]
        if memory["zone_from"].any():
            self._choose(memory["zone_from"], A)
        self._count, self._next = map(int, memory["zone_count"])
