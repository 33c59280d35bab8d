"""Edges and faces of the cells of a mesh, numbered over the whole mesh, and the parts that a cell is split into."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import meshio
import numpy as np

from .tidy import CORNERS, base_of, body_blocks

__all__ = ["EDGES", "FACES", "PARTS", "Topology", "cycles", "edges_of", "facets", "numbered", "parts_of"]

EDGES = {
    "line": ((0, 1),), "triangle": ((0, 1), (1, 2), (2, 0)), "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    "wedge": ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    "hexahedron": ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))}
FACES = {
    "triangle": ((0, 1, 2),), "quad": ((0, 1, 2, 3),),
    "tetra": ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)),
    "wedge": ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    "hexahedron": ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))}
#: cells of second order: the nodes in the middle of their edges follow those at the corners, in the order of EDGES
SECOND = ("line3", "triangle6", "quad8", "quad9", "tetra10", "wedge15", "wedge18", "hexahedron20", "hexahedron27")

#: the parts of a cell
PARTS = {"triangle": "quad", "tetra": "hexahedron", "wedge": "hexahedron"}
_REFERENCE = {"tetra": ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
              "wedge": ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)),
              "hexahedron": ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))}


@cache
def parts_of(kind: str) -> np.ndarray:
    """Nodes of the parts of a cell, of its corners, edges, faces (in space) and its centre, in that order."""
    if kind not in EDGES:
        return np.zeros((1, 1), int)
    n, edges = CORNERS[kind], [frozenset(edge) for edge in EDGES[kind]]
    if kind == "line":
        return np.array([[0, 2], [2, 1]])
    if kind in ("triangle", "quad"):
        return np.array([[i, n + i, 2 * n, n + (i - 1) % n] for i in range(n)])
    faces, corners = [frozenset(face) for face in FACES[kind]], np.array(_REFERENCE[kind])
    centre, parts = n + len(edges) + len(faces), []
    for v in range(n):
        a, b, c = (next(iter(edge - {v})) for edge in edges if v in edge)
        if np.linalg.det(corners[[a, b, c]] - corners[v]) < 0:
            a, b = b, a
        on = {w: n + edges.index(frozenset((v, w))) for w in (a, b, c)}
        ab, bc, ca = (n + len(edges) + next(i for i, face in enumerate(faces) if {v, *pair} <= face)
                      for pair in ((a, b), (b, c), (c, a)))
        parts.append([v, on[a], ab, on[b], on[c], ca, centre, bc])
    return np.array(parts)


def edges_of(kind: str, cycle: tuple[int, ...]) -> list[int]:
    """Numbers of the edges of a cell that bound one of its faces."""
    edges = [frozenset(edge) for edge in EDGES[kind]]
    return [edges.index(frozenset((a, b))) for a, b in zip(cycle, (*cycle[1:], cycle[0]))]


def cycles(corners: np.ndarray, faces: tuple[tuple[int, ...], ...]) -> np.ndarray:
    """Nodes of the faces of cells, (ne, faces, 4); the last one of a triangle is -1."""
    padded = np.concatenate([corners, np.full((len(corners), 1), -1)], axis=1)
    return padded[:, [(*face, -1)[:4] for face in faces]]


def numbered(tables: list[np.ndarray], width: int) -> tuple[np.ndarray, list[np.ndarray]]:
    """The different rows, whatever the order in each, of tables (ne, k, width), and their numbers (ne, k)."""
    rows = np.concatenate([table.reshape(-1, width) if table.size else np.zeros((0, width), np.int64)
                           for table in tables])
    rows = np.sort(rows, axis=1)
    order = np.lexsort(rows.T[::-1])
    ordered = rows[order]
    fresh = np.ones(len(rows), bool)
    fresh[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    number = np.empty(len(rows), np.int64)
    number[order] = np.cumsum(fresh) - 1
    sizes = [table.shape[:2] if table.size else (0, 0) for table in tables]
    ends = np.cumsum([a * b for a, b in sizes])
    return ordered[fresh], [number[end - a * b:end].reshape(a, b) for end, (a, b) in zip(ends, sizes)]


def facets(kind: str, corners: np.ndarray, dim: int) -> np.ndarray:
    """Edges of plane cells, faces of others, (ne, k, 4) with -1 for what is not there."""
    if dim == 3:
        return cycles(corners, FACES[kind])
    pairs = corners[:, EDGES[kind]]
    return np.concatenate([pairs, np.full_like(pairs, -1)], axis=2)


@dataclass(frozen=True)
class Topology:
    """Cells of a mesh with their edges and faces.

    Attributes
    ----------
    mesh, dim: the mesh, and the dimension of its elements.
    kinds: cell of first order of each block.
    body: numbers of the blocks of elements.
    corners: nodes at the corners of the cells, (ne, k) a block.
    edges: nodes of each edge, (m, 2).
    faces: those of each face, (m, 4), in space only; -1 is the last of a triangle.
    edge_of, face_of: numbers of the edges and faces of the cells, (ne, k) a block.
    middle: node in the middle of each edge, (m,), that cells of second order have there; -1 without.
    """

    mesh: meshio.Mesh
    dim: int
    kinds: list[str]
    body: list[int]
    corners: list[np.ndarray]
    edges: np.ndarray
    faces: np.ndarray
    edge_of: list[np.ndarray]
    face_of: list[np.ndarray]
    middle: np.ndarray

    @classmethod
    def of(cls, mesh: meshio.Mesh) -> Topology:
        """That of a mesh."""
        kinds, body = [base_of(block.type) for block in mesh.cells], body_blocks(mesh)
        dim = mesh.cells[body[0]].dim
        corners = [block.data[:, :CORNERS.get(kind, 1)].astype(np.int64) for kind, block in zip(kinds, mesh.cells)]
        edges, edge_of = numbered([c[:, EDGES[k]] if k in EDGES else c[:0, None] for k, c in zip(kinds, corners)], 2)
        faces, face_of = numbered([cycles(c, FACES[k]) if dim == 3 and k in FACES else c[:0, None]
                                   for k, c in zip(kinds, corners)], 4)
        middle = np.full(len(edges), -1)
        for block, kind, numbers in zip(mesh.cells, kinds, edge_of):
            if block.type in SECOND:
                middle[numbers] = block.data[:, CORNERS[kind]:CORNERS[kind] + numbers.shape[1]]
        return cls(mesh, dim, kinds, body, corners, edges, faces, edge_of, face_of, middle)

    def bounding(self, chosen: np.ndarray) -> np.ndarray:
        """Mask of the edges of the elements' faces in the mask `chosen`."""
        found = np.zeros(max(int(numbers.max()) for numbers in self.edge_of if numbers.size) + 1, bool)
        for i in self.body:
            for j, cycle in enumerate(FACES[self.kinds[i]]):
                found[self.edge_of[i][chosen[self.face_of[i][:, j]]][:, edges_of(self.kinds[i], cycle)]] = True
        return found
