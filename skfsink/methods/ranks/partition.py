"""Which rank has which elements: parts of about equal size with short borders, by METIS."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import skfem
from scipy.sparse import csr_array

from ...errors import ParameterError
from ...fem.selection import Selection, selected_mesh
from ...fem.space import Space

__all__ = ["Numbers", "check_ranks", "mesh_of", "numbers", "partition"]


@dataclass(frozen=True)
class Numbers:
    """Which of the whole body a part has.

    Attributes
    ----------
    elements: their numbers in the whole body, ascending, (me,).
    nodes: those of these elements, (mn,); first those that count here, ascending, then the others, ascending.
    counted: how many count here: nodes between parts count in the first of them.
    shared: by rank, nodes that it has too, by their numbers in this part, in the order of the whole body.
    """

    elements: np.ndarray
    nodes: np.ndarray
    counted: int
    shared: dict[int, np.ndarray]


def check_ranks(ranks: int, elements: int) -> None:
    """Refuse more ranks than elements (ParameterError)."""
    if ranks > elements:
        raise ParameterError(f"{ranks} ranks cannot share {elements} elements: start at most as many ranks as elements")


def partition(conn: np.ndarray, parts: int) -> np.ndarray:
    """Number of the part of each element (ne,), of `parts`, for the nodes of the elements `conn` (ne, na).

    Raises
    ------
    ParameterError
        There are more parts than elements, or METIS is not there.
    """
    ne, na = conn.shape
    check_ranks(parts, ne)
    if parts == 1:
        return np.zeros(ne, np.int64)
    try:
        import pymetis
    except ImportError:
        raise ParameterError("several ranks need METIS to part a body: install skfsink with its extra mpi") from None
    touches = csr_array((np.ones(conn.size, np.int8), conn.ravel(), np.arange(0, conn.size + 1, na)))
    beside = csr_array(touches @ touches.T)
    faces = (beside.data >= na // 2) & (beside.data < na)  # elements that share a side (face), not themselves
    start = np.concatenate([[0], np.cumsum(faces)])[beside.indptr]
    _, part = pymetis.part_graph(parts, pymetis.CSRAdjacency(start, beside.indices[faces]))
    return _without_holes(np.asarray(part, np.int64), parts)


def _without_holes(part: np.ndarray, parts: int) -> np.ndarray:
    """Give empty parts, which METIS may leave on tiny meshes, an element of the largest."""
    part = part.copy()
    for p in range(parts):
        if not (part == p).any():
            part[np.flatnonzero(part == np.bincount(part, minlength=parts).argmax())[0]] = p
    return part


def numbers(conn: np.ndarray, part: np.ndarray) -> list[Numbers]:
    """What each part of :func:`partition` has."""
    n, parts, na = int(conn.max()) + 1, int(part.max()) + 1, conn.shape[1]
    pairs = np.unique(conn.ravel() * parts + np.repeat(part, na))  # nodes with their parts, both ascending
    node, of = np.divmod(pairs, parts)
    start = np.searchsorted(node, np.arange(n + 1))
    owner, several = of[start[:-1]], np.diff(start) > 1
    found = []
    for p in range(parts):
        has = node[of == p]
        nodes = np.concatenate([has[owner[has] == p], has[owner[has] != p]])
        here = np.full(n, -1)
        here[nodes] = np.arange(nodes.size)
        between = has[several[has]]
        others = np.concatenate([np.zeros(0, np.int64), *(of[start[i]:start[i + 1]] for i in between)])
        with_them = np.repeat(between, np.diff(start)[between])
        shared = {int(q): here[with_them[others == q]] for q in np.unique(others) if q != p}
        found.append(Numbers(np.flatnonzero(part == p), nodes, int((owner[has] == p).sum()), shared))
    return found


def mesh_of(space: Space, part: Numbers) -> skfem.Mesh:
    """Elements and nodes of a part, of the mesh of the whole body."""
    return selected_mesh(space, Selection(part.elements, part.nodes, space.n_elements, space.n_nodes))
