"""Pieces into which cracks have cut a body."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from ..fem.space import Space

__all__ = ["SPENT", "Fragments", "debris", "fragments", "joined", "pieces_at"]

SPENT = 1e-2        # nodes with a lower gamma carry nothing, and their displacement has no meaning


class Fragments(NamedTuple):
    """Pieces that bear force.

    `pieces`: their number.   `debris`: of those, the ones smaller than a square (cube) of side l; of rings their
    section.   `debris_share`: the part of the undeformed body that is debris.
    """

    pieces: int
    debris: int
    debris_share: float


def joined(conn: np.ndarray, holds: np.ndarray) -> np.ndarray:
    """Number of the piece (ne,) of each element of `conn` (ne, na): elements that share a node that `holds` are one.

    `holds` (ne, na) is of an element and its node; an element of whose nodes none holds is a piece of its own.
    """
    ne, n = len(conn), int(conn.max(initial=0)) + 1
    starts = np.concatenate([[0], np.cumsum(holds.sum(axis=1)), np.full(n, holds.sum())]).astype(np.int32)
    nodes = (ne + conn[holds]).astype(np.int32)  # a graph of elements, then nodes: far less than one of elements alone
    graph = csr_array((np.ones(nodes.size, np.int8), nodes, starts), shape=(ne + n, ne + n))
    _, piece = connected_components(graph, directed=False)
    return np.asarray(piece[:ne])


def fragments(space: Space, gamma: np.ndarray, deleted: np.ndarray, length_scale: float, floor: float) -> Fragments:
    """The pieces at the nodal density `gamma` (n,), of elements that are not `deleted` (ne,), joined where it is above
    `floor`."""
    alive, piece = pieces_at(space, gamma, deleted, floor)
    if not alive.size:
        return Fragments(0, 0, 0.0)
    volume = np.bincount(piece, space.V[alive])
    small = volume[np.bincount(piece, space.extent[alive]) < length_scale**space.dim]
    return Fragments(volume.size, small.size, float(small.sum() / space.V.sum()))


def debris(space: Space, gamma: np.ndarray, deleted: np.ndarray, held: np.ndarray, length_scale: float) -> np.ndarray:
    """Numbers of the elements of pieces smaller than l, joined above `SPENT`, without a node that is `held` (n,)."""
    alive, piece = pieces_at(space, gamma, deleted, SPENT)
    own, holds = np.zeros(space.n_nodes, np.int64), np.zeros(space.n_nodes, bool)
    of_nodes = space.conn[alive]
    own[of_nodes], holds[of_nodes] = piece[:, None], True
    holds &= gamma > SPENT
    whole, count = space.exchange.same(own, int(piece.max(initial=-1)) + 1, holds)
    piece = whole[piece]
    volume = space.exchange.sums(np.bincount(piece, space.extent[alive], count))
    kept = space.exchange.sums(np.bincount(piece[held[of_nodes].any(axis=1)], minlength=count))
    small = (volume < length_scale**space.dim) & (kept == 0)
    return alive[small[piece]]


def pieces_at(space: Space, gamma: np.ndarray, deleted: np.ndarray, floor: float) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the elements that bear force, ascending, and the piece that each of them belongs to."""
    holds = (gamma[space.conn] > floor) & ~deleted[:, None]
    alive = np.flatnonzero(holds.any(axis=1))
    return alive, joined(space.conn[alive], holds[alive]) if alive.size else alive
