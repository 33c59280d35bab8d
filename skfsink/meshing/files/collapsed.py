"""Elements with a node twice that are elements of another form: triangles, wedges, pyramids and tetrahedra.

Programs that know quadrilaterals and hexahedra alone write these so, such as a triangle as the quadrilateral 1 2 3 3.
"""

from __future__ import annotations

import meshio
import numpy as np

from .orientation import FACETS
from .tidy import CORNERS, add_note, base_of

__all__ = ["uncollapsed"]


def uncollapsed(mesh: meshio.Mesh) -> None:
    """Make collapsed quadrilaterals and hexahedra the cells that they are, each kind in a block at the end.

    What is no such element stays as it is, to be refused. Sets go along; cells of second order lose their middle nodes
    where they are collapsed.
    """
    for i in range(len(mesh.cells)):
        kind = base_of(mesh.cells[i].type)
        if kind not in FACETS:
            continue
        corners = mesh.cells[i].data[:, :CORNERS[kind]].astype(np.int64)
        ordered = np.sort(corners, axis=1)
        found: dict[str, list[tuple[int, list[int]]]] = {}
        for e in np.flatnonzero((ordered[:, 1:] == ordered[:, :-1]).any(axis=1)).tolist():
            if (form := _form(kind, corners[e].tolist())) is not None:
                found.setdefault(form[0], []).append((e, form[1]))
        if found:
            _take_out(mesh, i, found)
            what = ", ".join(f"{len(members)} {name}" for name, members in found.items())
            add_note(mesh, f"{sum(map(len, found.values()))} cell(s) ({mesh.cells[i].type}) with a node twice were "
                           f"taken for what they are: {what}")


def _form(kind: str, nodes: list[int]) -> tuple[str, list[int]] | None:
    """The form of a collapsed element, and its nodes; None if it is none."""
    faces = []
    for face in FACETS[kind] if kind == "hexahedron" else [range(4)]:
        ring = [nodes[a] for k, a in enumerate(face) if nodes[a] != nodes[face[k - 1]]]
        if len(set(ring)) < len(ring):
            return None  # pinched: two corners across are one
        if len(ring) > 2:
            faces.append(ring)
    distinct = len(set(nodes))
    sizes = sorted(map(len, faces))
    if kind == "quad":
        return ("triangle", faces[0]) if sizes == [3] else None
    if (distinct, sizes) == (4, [3, 3, 3, 3]):
        ring = faces[0]
        return "tetra", [*ring, *(set(nodes) - set(ring))]
    if (distinct, sizes) == (5, [3, 3, 3, 3, 4]):
        ring = next(face for face in faces if len(face) == 4)
        return "pyramid", [*ring, *(set(nodes) - set(ring))]
    if (distinct, sizes) == (6, [3, 3, 4, 4, 4]):
        one, other = (face for face in faces if len(face) == 3)
        sides = [face for face in faces if len(face) == 4]
        edges = [(face[k - 1], face[k]) for face in sides for k in range(4)]
        beside = {a: b for edge in edges for a, b in (edge, edge[::-1]) if a in one and b in other}
        return ("wedge", [*one, *(beside[a] for a in one)]) if len(beside) == 3 and not set(one) & set(other) else None
    return None


def _take_out(mesh: meshio.Mesh, number: int, found: dict[str, list[tuple[int, list[int]]]]) -> None:
    """Move cells of a block to new blocks of other kinds."""
    block, first = mesh.cells[number], len(mesh.cells)
    keep = np.ones(len(block.data), bool)
    place = np.full((len(block.data), 2), -1)  # new block and number there
    for k, (kind, members) in enumerate(found.items()):
        rows = [e for e, _ in members]
        keep[rows] = False
        place[rows] = np.column_stack([np.full(len(members), k), np.arange(len(members))])
        mesh.cells.append(meshio.CellBlock(kind, np.array([nodes for _, nodes in members])))
        for data in mesh.cell_data.values():
            data.append(np.asarray(data[number])[rows])
    index = np.cumsum(keep) - 1
    mesh.cells[number] = meshio.CellBlock(block.type, block.data[keep])
    for data in mesh.cell_data.values():
        data[number] = np.asarray(data[number])[keep]
    for members in mesh.cell_sets.values():
        members.extend([None] * (first - len(members)))
        ids = np.asarray([] if members[number] is None else members[number], np.int64)
        members[number] = index[ids[keep[ids]]]
        members.extend(place[ids[place[ids, 0] == k], 1] for k in range(len(found)))
