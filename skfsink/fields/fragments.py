"""Pieces into which cracks have cut a body."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from ..fem.space import Space

__all__ = ["Fragments", "fragments", "joined"]


class Fragments(NamedTuple):
    """Pieces that bear force.

    `pieces`: their number.   `debris`: of those, the ones smaller than a square (cube) of side l.   `debris_share`: the
    part of the undeformed body that is debris.
    """

    pieces: int
    debris: int
    debris_share: float


def joined(conn: np.ndarray, holds: np.ndarray) -> np.ndarray:
    """Number of the piece (ne,) of each element of `conn` (ne, na): elements that share a node that `holds` are one.

    `holds` (ne, na) is of an element and its node; an element of whose nodes none holds is a piece of its own.
    """
    element, corner = np.nonzero(holds)
    touches = csr_array((np.ones(len(element), np.int8), (element, conn[element, corner])),
                        shape=(len(conn), int(conn.max(initial=0)) + 1))
    _, piece = connected_components(touches @ touches.T, directed=False)
    return np.asarray(piece)


def fragments(space: Space, gamma: np.ndarray, deleted: np.ndarray, length_scale: float, floor: float) -> Fragments:
    """The pieces at the nodal density `gamma` (n,), of elements that are not `deleted` (ne,), joined where it is above
    `floor`."""
    holds = (gamma[space.conn] > floor) & ~deleted[:, None]
    alive = np.flatnonzero(holds.any(axis=1))
    if not alive.size:
        return Fragments(0, 0, 0.0)
    volume = np.bincount(joined(space.conn[alive], holds[alive]), space.V[alive])
    debris = volume[volume < length_scale**space.dim]
    return Fragments(volume.size, debris.size, float(debris.sum() / space.V.sum()))
