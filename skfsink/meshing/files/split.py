"""Meshes of triangles, tetrahedra, wedges and mixed elements split into quadrilaterals or hexahedra.

Every element gets a node in its middle, one in the middle of each edge and, in space, of each face. One new element
stands at each of its corners: a triangle becomes three quadrilaterals, a quadrilateral four, a tetrahedron four
hexahedra, a wedge six, a hexahedron eight. What is in the middle of an edge or face depends on that edge or face
alone, so that neighbours of any kind fit. At the tip of a pyramid four edges meet: it has no such split.
"""

from __future__ import annotations

from functools import cache

import meshio
import numpy as np

from ...errors import MeshError
from .tidy import CORNERS, add_note, base_of, body_blocks, drop_cells, drop_empty, place, renumber

__all__ = ["PLURALS", "counted", "drop_others", "needs_split", "split"]

PLURALS = {"triangle": "triangles", "quad": "quadrilaterals", "tetra": "tetrahedra", "wedge": "wedges",
           "pyramid": "pyramids", "hexahedron": "hexahedra"}
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
OFF = 0.2  # a middle node further from the middle of its edge than this, over the edge, is not taken for it


def counted(mesh: meshio.Mesh) -> str:
    """The elements of a mesh in words: "40 triangles and 200 quadrilaterals"."""
    numbers: dict[str, int] = {}
    for i in body_blocks(mesh):
        kind = base_of(mesh.cells[i].type)
        numbers[kind] = numbers.get(kind, 0) + len(mesh.cells[i].data)
    words = [f"{n} {PLURALS.get(kind, kind)}" for kind, n in numbers.items()]
    return " and ".join([", ".join(words[:-1]), words[-1]] if words[1:] else words)


def needs_split(mesh: meshio.Mesh) -> bool:
    """Whether there are other elements than quadrilaterals, or than hexahedra in space."""
    return any(base_of(mesh.cells[i].type) not in ("quad", "hexahedron") for i in body_blocks(mesh))


def drop_others(mesh: meshio.Mesh) -> None:
    """Drop cells that a mesh of quadrilaterals or hexahedra has no use for, such as triangles, with a note."""
    for i, block in enumerate(mesh.cells):
        if base_of(block.type) not in ("vertex", "line", "quad", "hexahedron"):
            _drop(mesh, i, np.zeros(len(block.data), bool))


def split(mesh: meshio.Mesh) -> meshio.Mesh:
    """A mesh of quadrilaterals, or hexahedra in space, from one of any elements but pyramids; sets go along.

    The middle nodes of elements of second order become the nodes in the middle of edges. A set of elements, or of lines
    or faces, has the parts of its members. A set of nodes that are all on the outside of the body gains the middles of
    the edges and faces there that have all their nodes in it; in space only those of its faces and their edges, unless
    it has no whole face and is a curve. A set with a node inside the body, or with all nodes, is a part of the body,
    and gains the middles of all edges, faces and elements that have all their nodes in it.

    Raises
    ------
    MeshError
        There are pyramids or polygons, or edges (in space: faces) that more than two elements share.
    """
    drop_empty(mesh)
    body = body_blocks(mesh)
    kinds = [base_of(block.type) for block in mesh.cells]
    others = sorted({kinds[i] for i in body} - set(FACES))
    if others:
        raise MeshError(f"the mesh has {counted(mesh)}: {', '.join(PLURALS.get(k, k) for k in others)} cannot be split "
                        f"into hexahedra that fit their neighbours; mesh the body with triangles or quadrilaterals, "
                        f"tetrahedra, wedges or hexahedra")
    before, dim, n = counted(mesh), mesh.cells[body[0]].dim, len(mesh.points)
    for i, kind in enumerate(kinds):  # what is neither element nor facet, such as a polygon beside tetrahedra
        if kind not in EDGES and kind != "vertex":
            _drop(mesh, i, np.zeros(len(mesh.cells[i].data), bool))
    for i in body:
        own = np.sort(mesh.cells[i].data[:, :CORNERS[kinds[i]]], axis=1)
        if (twice := (own[:, 1:] == own[:, :-1]).any(axis=1)).any():
            where = mesh.points[own[twice][0]].mean(axis=0)
            raise MeshError(f"{np.count_nonzero(twice)} of the {PLURALS[kinds[i]]} have a node twice, such as one near "
                            f"{place(where)}: mend the mesh there")
    _drop_strangers(mesh, kinds, body, dim)
    corners = [block.data[:, :CORNERS.get(kind, 1)].astype(np.int64) for kind, block in zip(kinds, mesh.cells)]

    # --- edges, and what is in their middle ---
    edges, edge_of = _numbered([c[:, EDGES[k]] if k in EDGES else c[:0, None] for k, c in zip(kinds, corners)], 2)
    ends = mesh.points[edges]
    middle = np.full(len(edges), -1)
    for block, kind, own in zip(mesh.cells, kinds, edge_of):
        if block.type in SECOND:
            middle[own] = block.data[:, CORNERS[kind]:CORNERS[kind] + own.shape[1]]
    at = ends.mean(axis=1)
    away = np.linalg.norm(mesh.points[middle] - at, axis=1) / np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    taken = (middle >= 0) & (away <= OFF)
    at[taken] = mesh.points[middle[taken]]
    if (middle >= 0).any():
        add_note(mesh, f"{np.count_nonzero(taken)} middle node(s) of elements of second order are corners now")
        if (odd := np.count_nonzero((middle >= 0) & ~taken)):
            add_note(mesh, f"{odd} middle node(s) were not near the middle of their edges, which are straight now")

    # --- faces ---
    solid = dim == 3
    faces, face_of = _numbered([_cycles(c, FACES[k]) if solid and k in FACES else c[:0, None]
                                for k, c in zip(kinds, corners)], 4)
    face_at = np.zeros((len(faces), 3))
    for kind, own_edges, own in zip(kinds, edge_of, face_of):
        for j, cycle in enumerate(FACES[kind] if own.size else ()):
            face_at[own[:, j]] = at[own_edges[:, _edges_of(kind, cycle)]].mean(axis=1)

    # --- nodes and cells ---
    points, cells, centres = [mesh.points, at, face_at], [], []
    first = n + len(edges) + len(faces)
    for i, (kind, c) in enumerate(zip(kinds, corners)):
        columns = [c]
        if kind in EDGES:
            columns.append(n + edge_of[i])
        if kind in FACES:
            if solid:
                columns.append(n + len(edges) + face_of[i])
            if i in body:
                columns.append(first + np.arange(len(c))[:, None])
                points.append(at[edge_of[i]].mean(axis=1))
                centres.append(columns[-1][:, 0])
                first += len(c)
        parts = _parts(kind)
        stack = np.concatenate(columns, axis=1)
        cells.append((PARTS.get(kind, kind), stack[:, parts].reshape(-1, parts.shape[1])))
    sets = _sets_of_nodes(mesh, body, dim, edges, faces, middle, edge_of, face_of, corners, centres)
    number = np.arange(first)
    number[middle[middle >= 0]] = n + np.flatnonzero(middle >= 0)  # for points on middle nodes
    cells = [(kind, number[nodes]) for kind, nodes in cells]
    many = [len(_parts(kind)) for kind in kinds]
    cell_sets = {name: [None if own is None else (np.asarray(own, np.int64)[:, None] * k + np.arange(k)).ravel()
                        for own, k in zip(members, many)] for name, members in mesh.cell_sets.items()}
    cell_data = {name: [np.repeat(values, k, axis=0) for values, k in zip(data, many)]
                 for name, data in mesh.cell_data.items()}
    new = meshio.Mesh(np.vstack(points), cells, cell_sets=cell_sets, cell_data=cell_data, point_sets=sets,
                      info=mesh.info)
    used = np.zeros(first, bool)
    for _, nodes in cells:
        used[nodes] = True
    renumber(new, np.where(used, np.cumsum(used) - 1, -1), "middle nodes")
    add_note(new, f"{before} were split into {counted(new)}")
    return new


#: the parts of a cell
PARTS = {"triangle": "quad", "tetra": "hexahedron", "wedge": "hexahedron"}
_REFERENCE = {"tetra": ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
              "wedge": ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)),
              "hexahedron": ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))}


@cache
def _parts(kind: str) -> np.ndarray:
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


def _edges_of(kind: str, cycle: tuple[int, ...]) -> list[int]:
    """Numbers of the edges of a cell that bound one of its faces."""
    edges = [frozenset(edge) for edge in EDGES[kind]]
    return [edges.index(frozenset((a, b))) for a, b in zip(cycle, (*cycle[1:], cycle[0]))]


def _cycles(corners: np.ndarray, faces: tuple[tuple[int, ...], ...]) -> np.ndarray:
    """Nodes of the faces of cells, (ne, faces, 4); the last one of a triangle is -1."""
    padded = np.concatenate([corners, np.full((len(corners), 1), -1)], axis=1)
    return padded[:, [(*face, -1)[:4] for face in faces]]


def _numbered(tables: list[np.ndarray], width: int) -> tuple[np.ndarray, list[np.ndarray]]:
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


def _facets(kind: str, corners: np.ndarray, dim: int) -> np.ndarray:
    """Edges of plane cells, faces of others, (ne, k, 4) with -1 for what is not there."""
    if dim == 3:
        return _cycles(corners, FACES[kind])
    pairs = corners[:, EDGES[kind]]
    return np.concatenate([pairs, np.full_like(pairs, -1)], axis=2)


def _drop_strangers(mesh: meshio.Mesh, kinds: list[str], body: list[int], dim: int) -> None:
    """Drop lines and faces that are no edge or face of an element; refuse facets of more than two elements."""
    corners = [block.data[:, :CORNERS.get(kind, 1)].astype(np.int64) for kind, block in zip(kinds, mesh.cells)]
    outer = [i for i, block in enumerate(mesh.cells) if block.dim == dim - 1 and kinds[i] in EDGES]
    sides = [_facets(kinds[i], corners[i], dim) for i in body]
    own = [_cycles(c, (tuple(range(c.shape[1])),)) if dim == 3 else
           np.concatenate([c, np.full_like(c, -1)], axis=1)[:, None] for c in (corners[i] for i in outer)]
    rows, numbers = _numbered([*sides, *own], 4)
    count = np.bincount(np.concatenate([x.ravel() for x in numbers[:len(body)]]), minlength=len(rows))
    if (count > 2).any():
        where = rows[np.argmax(count > 2)]
        raise MeshError(f"{np.count_nonzero(count > 2)} {'edges' if dim == 2 else 'faces'} are shared by more than two "
                        f"elements, such as at {place(mesh.points[where[where >= 0]].mean(axis=0))}: elements overlap, "
                        f"or are there twice; mend the mesh there")
    for i, found in zip(outer, numbers[len(body):]):
        _drop(mesh, i, count[found[:, 0]] > 0 if len(found) else np.zeros(0, bool))
    if dim == 3:
        rows, numbers = _numbered([c[:, EDGES[k]] if k in EDGES and (i in body or k == "line") else c[:0, None]
                                   for i, (k, c) in enumerate(zip(kinds, corners))], 2)
        there = np.zeros(len(rows), bool)
        for i in body:
            there[numbers[i]] = True
        for i, kind in enumerate(kinds):
            if kind == "line" and len(numbers[i]):
                _drop(mesh, i, there[numbers[i][:, 0]])


def _drop(mesh: meshio.Mesh, number: int, keep: np.ndarray) -> None:
    if not keep.all():
        block = mesh.cells[number]
        add_note(mesh, f"{np.count_nonzero(~keep)} cell(s) ({block.type}) are no edge or face of an element and were "
                       f"dropped, such as one at {place(mesh.points[block.data[~keep][0]].mean(axis=0))}")
        drop_cells(mesh, number, keep)


def _sets_of_nodes(mesh: meshio.Mesh, body: list[int], dim: int, edges: np.ndarray, faces: np.ndarray,
                   middle: np.ndarray, edge_of: list[np.ndarray], face_of: list[np.ndarray],
                   corners: list[np.ndarray], centres: list[np.ndarray]) -> dict[str, np.ndarray]:
    """The sets of nodes with the new ones that belong to them; see :func:`split`."""
    if not mesh.point_sets:
        return {}
    n, kinds = len(mesh.points), [base_of(block.type) for block in mesh.cells]
    sides = face_of if dim == 3 else edge_of
    count = np.bincount(np.concatenate([sides[i].ravel() for i in body]), minlength=len(faces if dim == 3 else edges))
    outside, outer_edge = np.zeros(n + 1, bool), count == 1
    if dim == 3:
        outer_face = count == 1
        outside[faces[outer_face]] = True
        outer_edge = _bounding(edge_of, face_of, kinds, body, outer_face)
    else:
        outside[edges[outer_edge]] = True
    outside[-1] = True  # what stands for no node
    sets = {}
    for name, nodes in mesh.point_sets.items():
        member = np.zeros(n + 1, bool)
        member[nodes] = member[-1] = True
        parts = [np.asarray(nodes, np.int64)]
        inside = bool((~outside[np.setdiff1d(nodes, middle)]).any()) or all(member[corners[i]].all() for i in body)
        whole, whole_face = member[edges].all(axis=1), member[faces].all(axis=1)
        if inside:
            parts += [n + len(edges) + np.flatnonzero(whole_face)]
            parts += [centre[member[corners[i]].all(axis=1)] for i, centre in zip(body, centres)]
        elif dim == 3:
            whole_face &= outer_face
            parts += [n + len(edges) + np.flatnonzero(whole_face)]
            whole = _bounding(edge_of, face_of, kinds, body, whole_face) if whole_face.any() else whole & outer_edge
        else:
            whole &= outer_edge
        given = np.isin(middle, nodes) & (middle >= 0)
        parts.append(n + np.flatnonzero(np.where(middle >= 0, given, whole)))
        sets[name] = np.unique(np.concatenate(parts))  # those that are middle nodes go with them
    return sets


def _bounding(edge_of: list[np.ndarray], face_of: list[np.ndarray], kinds: list[str], body: list[int],
              chosen: np.ndarray) -> np.ndarray:
    """Mask of the edges of the `chosen` faces, a mask."""
    found = np.zeros(max(int(own.max()) for own in edge_of if own.size) + 1, bool)
    for i in body:
        for j, cycle in enumerate(FACES[kinds[i]]):
            found[edge_of[i][chosen[face_of[i][:, j]]][:, _edges_of(kinds[i], cycle)]] = True
    return found
