"""Meshes of triangles, tetrahedra, wedges and mixed elements split into quadrilaterals or hexahedra.

Every element gets a node in its middle, one in the middle of each edge and, in space, of each face. One new element
stands at each of its corners: a triangle becomes three quadrilaterals, a quadrilateral four, a tetrahedron four
hexahedra, a wedge six, a hexahedron eight. What is in the middle of an edge or face depends on that edge or face
alone, so that neighbours of any kind fit. At the tip of a pyramid four edges meet: it has no such split.
"""

from __future__ import annotations

import meshio
import numpy as np

from ...errors import MeshError
from .edges_faces import EDGES, FACES, PARTS, Topology, cycles, edges_of, facets, numbered, parts_of
from .tidy import CORNERS, add_note, base_of, body_blocks, drop_cells, drop_empty, place, renumber

__all__ = ["PLURALS", "counted", "drop_others", "needs_split", "split"]

PLURALS = {"triangle": "triangles", "quad": "quadrilaterals", "tetra": "tetrahedra", "wedge": "wedges",
           "pyramid": "pyramids", "hexahedron": "hexahedra"}
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
        corners = np.sort(mesh.cells[i].data[:, :CORNERS[kinds[i]]], axis=1)
        if (twice := (corners[:, 1:] == corners[:, :-1]).any(axis=1)).any():
            where = mesh.points[corners[twice][0]].mean(axis=0)
            raise MeshError(f"{np.count_nonzero(twice)} of the {PLURALS[kinds[i]]} have a node twice, such as one near "
                            f"{place(where)}: mend the mesh there")
    _drop_strangers(mesh, kinds, body, dim)
    topology = Topology.of(mesh)
    edge_at, face_at = _middles(topology)
    edge_of, middle, n_edges = topology.edge_of, topology.middle, len(topology.edges)
    points, cells, centres = [mesh.points, edge_at, face_at], [], []
    first = n + n_edges + len(topology.faces)
    for i, (kind, c) in enumerate(zip(kinds, topology.corners)):
        columns = [c]
        if kind in EDGES:
            columns.append(n + edge_of[i])
        if kind in FACES:
            if dim == 3:
                columns.append(n + n_edges + topology.face_of[i])
            if i in body:
                columns.append(first + np.arange(len(c))[:, None])
                points.append(edge_at[edge_of[i]].mean(axis=1))
                centres.append(columns[-1][:, 0])
                first += len(c)
        parts = parts_of(kind)
        stack = np.concatenate(columns, axis=1)
        cells.append((PARTS.get(kind, kind), stack[:, parts].reshape(-1, parts.shape[1])))
    sets = _sets_of_nodes(topology, centres)
    number = np.arange(first)
    number[middle[middle >= 0]] = n + np.flatnonzero(middle >= 0)  # for points on middle nodes
    cells = [(kind, number[nodes]) for kind, nodes in cells]
    many = [len(parts_of(kind)) for kind in kinds]
    cell_sets = {name: [None if chosen is None else (np.asarray(chosen, np.int64)[:, None] * k + np.arange(k)).ravel()
                        for chosen, k in zip(members, many)] for name, members in mesh.cell_sets.items()}
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


def _middles(topology: Topology) -> tuple[np.ndarray, np.ndarray]:
    """Points in the middle of the edges and of the faces; edges bend to nodes that are near their middle."""
    mesh, middle = topology.mesh, topology.middle
    ends = mesh.points[topology.edges]
    at = ends.mean(axis=1)
    away = np.linalg.norm(mesh.points[middle] - at, axis=1) / np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    taken = (middle >= 0) & (away <= OFF)
    at[taken] = mesh.points[middle[taken]]
    if (middle >= 0).any():
        add_note(mesh, f"{np.count_nonzero(taken)} middle node(s) of elements of second order are corners now")
        if (odd := np.count_nonzero((middle >= 0) & ~taken)):
            add_note(mesh, f"{odd} middle node(s) were not near the middle of their edges, which are straight now")
    face_at = np.zeros((len(topology.faces), 3))
    for kind, edge_numbers, face_numbers in zip(topology.kinds, topology.edge_of, topology.face_of):
        for j, cycle in enumerate(FACES[kind] if face_numbers.size else ()):
            face_at[face_numbers[:, j]] = at[edge_numbers[:, edges_of(kind, cycle)]].mean(axis=1)
    return at, face_at


def _drop_strangers(mesh: meshio.Mesh, kinds: list[str], body: list[int], dim: int) -> None:
    """Drop lines and faces that are no edge or face of an element; refuse facets of more than two elements."""
    corners = [block.data[:, :CORNERS.get(kind, 1)].astype(np.int64) for kind, block in zip(kinds, mesh.cells)]
    outer = [i for i, block in enumerate(mesh.cells) if block.dim == dim - 1 and kinds[i] in EDGES]
    sides = [facets(kinds[i], corners[i], dim) for i in body]
    outer_sides = [cycles(c, (tuple(range(c.shape[1])),)) if dim == 3 else
                   np.concatenate([c, np.full_like(c, -1)], axis=1)[:, None] for c in (corners[i] for i in outer)]
    rows, numbers = numbered([*sides, *outer_sides], 4)
    count = np.bincount(np.concatenate([x.ravel() for x in numbers[:len(body)]]), minlength=len(rows))
    if (count > 2).any():
        where = rows[np.argmax(count > 2)]
        raise MeshError(f"{np.count_nonzero(count > 2)} {'edges' if dim == 2 else 'faces'} are shared by more than two "
                        f"elements, such as at {place(mesh.points[where[where >= 0]].mean(axis=0))}: elements overlap, "
                        f"or are there twice; mend the mesh there")
    for i, found in zip(outer, numbers[len(body):]):
        _drop(mesh, i, count[found[:, 0]] > 0 if len(found) else np.zeros(0, bool))
    if dim == 3:
        rows, numbers = numbered([c[:, EDGES[k]] if k in EDGES and (i in body or k == "line") else c[:0, None]
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


def _sets_of_nodes(topology: Topology, centres: list[np.ndarray]) -> dict[str, np.ndarray]:
    """The sets of nodes with the new nodes that belong to them, see :func:`split`; `centres` are those of elements."""
    mesh, body, dim = topology.mesh, topology.body, topology.dim
    edges, faces, middle, corners = topology.edges, topology.faces, topology.middle, topology.corners
    if not mesh.point_sets:
        return {}
    n = len(mesh.points)
    sides = topology.face_of if dim == 3 else topology.edge_of
    count = np.bincount(np.concatenate([sides[i].ravel() for i in body]), minlength=len(faces if dim == 3 else edges))
    outside, outer_edge = np.zeros(n + 1, bool), count == 1
    if dim == 3:
        outer_face = count == 1
        outside[faces[outer_face]] = True
        outer_edge = topology.bounding(outer_face)
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
            whole = topology.bounding(whole_face) if whole_face.any() else whole & outer_edge
        else:
            whole &= outer_edge
        listed = np.isin(middle, nodes) & (middle >= 0)
        parts.append(n + np.flatnonzero(np.where(middle >= 0, listed, whole)))
        sets[name] = np.unique(np.concatenate(parts))  # those that are middle nodes go with them
    return sets
