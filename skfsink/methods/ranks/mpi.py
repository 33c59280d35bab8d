"""The exchange of parts of a body on several ranks, by MPI.

Sums are made in the order of the ranks, so that all of them get the same bits, and so does a second run.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ...fem.exchange import Unknowns
from .partition import Numbers

if TYPE_CHECKING:
    from mpi4py import MPI

__all__ = ["MPIExchange", "wait"]

PAUSE = 5e-4   # s
#: lets other processes run, for which a sleep of 0 s takes 50 us
give_way: Callable[[], None] = getattr(os, "sched_yield", lambda: time.sleep(0.0))


def wait(request: MPI.Request, idle: float = np.inf) -> None:
    """Wait, and give the processor to others meanwhile: ranks may be more than cores.

    After `idle` [s] it looks every half a millisecond only.
    """
    if request.Test():
        return
    began = time.perf_counter()
    while not request.Test():
        if time.perf_counter() - began > idle:
            time.sleep(PAUSE)
        else:
            give_way()


class MPIExchange:
    """See :class:`.Exchange`.

    Memory: counts, and buffers and numbers that are made once; `whole`, `over`, `total`, `totals`, `sums`, `greatest`,
    `maxima`, `dot` and `norm` depend on no earlier call.

    Parameters
    ----------
    comm: the ranks.
    part: what this rank has.
    n_nodes: of the whole body.

    Attributes
    ----------
    halos, sums_made: sums at the nodes between parts, and numbers gathered from all, so far.
    """

    def __init__(self, comm: MPI.Intracomm, part: Numbers, n_nodes: int) -> None:
        self.comm, self.part, self.n_nodes = comm, part, n_nodes
        self.counted, self.number = slice(0, part.counted), int(comm.rank)
        shared = [nodes for _, nodes in sorted(part.shared.items())]
        self._between = np.unique(np.concatenate([*shared, np.zeros(0, np.int64)])).astype(np.int64)
        self._turns = sorted([*part.shared, comm.rank])  # ranks in the order in which their shares are added
        self._buffers: dict[int, dict[int, tuple[np.ndarray, np.ndarray]]] = {}
        self._unknowns: dict[int, tuple[np.ndarray, _Unknowns]] = {}
        self.halos = self.sums_made = 0

    def counts(self, n: int) -> np.ndarray:
        """Mask of the nodes that count in this part, which has n of them."""
        return np.arange(n) < self.part.counted

    def whole(self, x: np.ndarray) -> np.ndarray:
        """Make the shares of nodal values (n,) or (n, k) whole, in place; returns `x`."""
        wide = x if x.ndim == 2 else x[:, None]
        k = wide.shape[1]
        if k not in self._buffers:
            self._buffers[k] = {rank: (np.empty((nodes.size, k)), np.empty((nodes.size, k)))
                                for rank, nodes in self.part.shared.items()}
        self.halos += 1
        buffers, shared, comm = self._buffers[k], self.part.shared, self.comm
        requests = [comm.Irecv(buffers[rank][1], rank) for rank in shared]
        for rank, nodes in shared.items():
            np.take(wide, nodes, axis=0, out=buffers[rank][0])
            requests.append(comm.Isend(buffers[rank][0], rank))
        own = wide[self._between]
        wide[self._between] = 0.0
        for request in requests:
            wait(request)
        for rank in self._turns:
            if rank == comm.rank:
                wide[self._between] += own
            else:
                wide[shared[rank]] += buffers[rank][1]
        return x

    def _each(self, values: np.ndarray) -> np.ndarray:
        """Values (m,) of each rank, (ranks, m)."""
        self.sums_made += 1
        found = np.empty((self.comm.size, *values.shape))
        wait(self.comm.Iallgather(np.ascontiguousarray(values, float), found))
        return found

    def total(self, value: float) -> float:
        """Sum of a number of each part."""
        return self.totals((value,))[0]

    def totals(self, values: tuple[float, ...]) -> tuple[float, ...]:
        """Sums of several."""
        return tuple(self.sums(np.array(values, float)).tolist())

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Sums of arrays of the same shape in all parts."""
        total: np.ndarray = np.zeros(values.shape)
        for one in self._each(values):
            total += one
        return total

    def greatest(self, value: float) -> float:
        """The greatest of a number of each part; not a number if one of them is none."""
        return float(self._each(np.array([value], float)).max())

    def maxima(self, values: np.ndarray) -> np.ndarray:
        """The greatest of arrays of the same shape in all parts, entry by entry."""
        greatest: np.ndarray = self._each(values).max(axis=0)
        return greatest

    def dot(self, x: np.ndarray, y: np.ndarray) -> float:
        """Product over the whole body of two nodal fields (n,) that are whole."""
        return self.total(float(x[self.counted] @ y[self.counted]))

    def norm(self, x: np.ndarray) -> float:
        """Root of the product with itself."""
        return math.sqrt(self.dot(x, x))

    def all(self, values: np.ndarray) -> np.ndarray:
        """Values (m, ...) of this part and all others, in the order of the parts."""
        return np.concatenate(self.comm.allgather(values))

    def over(self, mask: np.ndarray) -> Unknowns:
        """Vectors over the unknowns marked in `mask` (n k,), k of them at a node."""
        kept = self._unknowns.get(id(mask))
        if kept is None or kept[0] is not mask:
            kept = self._unknowns[id(mask)] = mask, _Unknowns(self, mask)
        return kept[1]

    def same(self, pieces: np.ndarray, count: int, holds: np.ndarray) -> tuple[np.ndarray, int]:
        """One number in the whole body for each of the `count` pieces of this part, and how many there are in it."""
        nodes = self._between[holds[self._between]]
        return self._joined(self.part.nodes[nodes], pieces[nodes], count)

    def _joined(self, places: np.ndarray, pieces: np.ndarray, count: int) -> tuple[np.ndarray, int]:
        """The same for pieces (m,) of this part at places (m,), by numbers that all parts give them: one at each place.
        """
        counts = np.array(self.comm.allgather(count))
        first = np.concatenate([[0], np.cumsum(counts)])
        links = self.all(np.column_stack([places, first[self.comm.rank] + pieces]))
        total, place = int(first[-1]), np.unique(links[:, 0], return_inverse=True)[1]
        size = total + int(place.max(initial=-1)) + 1
        graph = coo_array((np.ones(len(links)), (links[:, 1], total + place)), shape=(size, size))
        label = connected_components(graph, directed=False)[1]
        names, number = np.unique(label[:total], return_inverse=True)
        return number[first[self.comm.rank]:first[self.comm.rank] + count], names.size


class _Unknowns:
    """See :class:`.Unknowns`."""

    def __init__(self, exchange: MPIExchange, mask: np.ndarray) -> None:
        part, n = exchange.part, exchange.part.nodes.size
        self._exchange, k = exchange, mask.size // n
        self._place = np.flatnonzero(mask)
        self._wide = np.zeros((n, k))
        node, component = np.divmod(self._place, k)
        self.counted = node < part.counted
        marked = np.zeros(exchange.n_nodes * k)
        numbers = part.nodes[node] * k + component
        marked[exchange.all(numbers)] = 1.0
        number = np.cumsum(marked).astype(np.int64) - 1
        self.numbers, self.size = number[numbers], int(marked.sum())

    def whole(self, x: np.ndarray) -> None:
        """Make shares (m,) whole, in place."""
        self._wide.reshape(-1)[self._place] = x
        x[:] = self._exchange.whole(self._wide).reshape(-1)[self._place]

    def total(self, value: float) -> float:
        """Sum of a number of each part."""
        return self._exchange.total(value)

    def dot(self, x: np.ndarray, y: np.ndarray) -> float:
        """Product over the whole body of two vectors (m,) that are whole."""
        return self.total(float(x[self.counted] @ y[self.counted]))
