"""What every mesh file goes through after it was read: middle nodes and nodes of no element are dropped, with a note.

A note is one line for the user, in the list `mesh.info["notes"]` of the mesh.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import meshio
import numpy as np
from meshio import _mesh

__all__ = ["add_note", "body_blocks", "drop_cells", "drop_empty", "notes_of", "place", "renumber", "tidied",
           "without_middle_nodes", "without_orphans"]

#: nodes at the corners of a cell; those of a cell of higher order come first in all formats that meshio reads
CORNERS = {"vertex": 1, "line": 2, "triangle": 3, "quad": 4, "tetra": 4, "pyramid": 5, "wedge": 6, "hexahedron": 8}
for _kind in ("wedge15", "pyramid13"):  # kinds that meshio (5.3.5) writes of, but makes no blocks of
    _mesh.topological_dimension.setdefault(_kind, 3)
_LAGRANGE = {"CURVE": "line", "TRIANGLE": "triangle", "QUADRILATERAL": "quad", "TETRAHEDRON": "tetra",
             "PYRAMID": "pyramid", "WEDGE": "wedge", "HEXAHEDRON": "hexahedron"}


def notes_of(mesh: meshio.Mesh) -> tuple[str, ...]:
    """The notes on a mesh."""
    return tuple((mesh.info or {}).get("notes", ()))


def add_note(mesh: meshio.Mesh, text: str) -> None:
    """Put a note on a mesh."""
    mesh.info = {**(mesh.info or {}), "notes": [*notes_of(mesh), text]}


def base_of(kind: str) -> str:
    """The cell of first order of the same form: "quad" of "quad8"; `kind` itself if there is none."""
    base = _LAGRANGE.get(kind.removeprefix("VTK_LAGRANGE_"), re.sub(r"\d+$", "", kind))
    return base if base in CORNERS else kind


def body_blocks(mesh: meshio.Mesh) -> list[int]:
    """Numbers of the blocks whose cells are the elements: those of the highest dimension there is, 2 or 3."""
    dims = [block.dim if len(block.data) else 0 for block in mesh.cells]
    dim = max(dims, default=0)
    return [i for i, d in enumerate(dims) if d == dim] if dim >= 2 else []


def tidied(mesh: meshio.Mesh) -> meshio.Mesh:
    """The mesh, changed in place: without middle nodes, and without nodes that belong to no element.

    What is kept keeps its order, so that a mesh with neither of the two stays as it is. Sets and data go along.
    """
    without_middle_nodes(mesh)
    without_orphans(mesh)
    return mesh


def without_middle_nodes(mesh: meshio.Mesh) -> None:
    """Make cells of higher order (quad8, hexahedron20, line3, …) cells of first order, and drop their middle nodes."""
    changed, middle, corner = [], [], []
    for i, block in enumerate(mesh.cells):
        base = base_of(block.type)
        if base == block.type:
            corner.append(block.data.ravel())
            continue
        n = CORNERS[base]
        corner.append(block.data[:, :n].ravel())
        middle.append(block.data[:, n:].ravel())
        if len(block.data) and block.dim >= 2:
            changed.append(block.type)
        mesh.cells[i] = meshio.CellBlock(base, np.ascontiguousarray(block.data[:, :n]))
    if not middle:
        return
    dropped = np.setdiff1d(np.concatenate(middle), np.concatenate(corner))
    _keep(mesh, np.setdiff1d(np.arange(len(mesh.points)), dropped), "middle nodes")
    if len(dropped):
        kinds = ", ".join(sorted(set(changed))) or "lines"
        add_note(mesh, f"{len(dropped)} middle node(s) of {kinds} were dropped: elements have nodes at their corners "
                       "only, and straight edges")


def without_orphans(mesh: meshio.Mesh) -> None:
    """Drop nodes that belong to no element, and the lines, faces and points that have such a node."""
    elements = body_blocks(mesh)
    if not elements:
        return
    used = np.zeros(len(mesh.points), bool)
    for i in elements:
        used[mesh.cells[i].data] = True
    if used.all():
        return
    orphans = np.flatnonzero(~used)
    such = place(mesh.points[orphans[0]])
    for i, block in enumerate(mesh.cells):
        if i not in elements and len(block.data) and not (whole := used[block.data].all(axis=1)).all():
            if block.dim:  # a point says no more than its node
                add_note(mesh, f"{np.count_nonzero(~whole)} cell(s) ({block.type}) are no part of the body and were "
                               f"dropped, such as one at {place(mesh.points[block.data[~whole][0]].mean(axis=0))}")
            drop_cells(mesh, i, whole)
    add_note(mesh, f"{len(orphans)} node(s) belong to no element and were dropped, such as one at {such}")
    _keep(mesh, np.flatnonzero(used), "nodes that belong to no element")


def drop_cells(mesh: meshio.Mesh, number: int, keep: np.ndarray) -> None:
    """Drop the cells of block `number` that are not in the mask `keep`, with their data, from all sets."""
    block = mesh.cells[number]
    mesh.cells[number] = meshio.CellBlock(block.type, block.data[keep])
    index = np.cumsum(keep) - 1
    for name, members in list(mesh.cell_sets.items()):
        if number < len(members) and (cells := members[number]) is not None and len(cells):
            members[number] = index[cells[keep[cells]]]
            if not len(members[number]) and not any(m is not None and len(m) for m in members):
                _leave_out(mesh, name, "parts that are no part of the body")
                del mesh.cell_sets[name]
    for data in mesh.cell_data.values():
        data[number] = np.asarray(data[number])[keep]


def drop_empty(mesh: meshio.Mesh) -> None:
    """Drop blocks without cells."""
    kept = [i for i, block in enumerate(mesh.cells) if len(block.data)]
    mesh.cells = [mesh.cells[i] for i in kept]
    mesh.cell_sets = {name: [members[i] if i < len(members) else None for i in kept]
                      for name, members in mesh.cell_sets.items()}
    mesh.cell_data = {name: [data[i] for i in kept] for name, data in mesh.cell_data.items()}


def place(point: Sequence[float] | np.ndarray) -> str:
    """A point for a message [mm]; z only where it is not 0."""
    shown = [f"{x:.6g}" for x in point]
    return f"({', '.join(shown[:2] if len(shown) > 2 and float(shown[2]) == 0 else shown)})"


def renumber(mesh: meshio.Mesh, number: np.ndarray, lost: str = "") -> None:
    """Give each node its new number, -1 to those that no cell has; the first of those with one number is kept.

    A set of nodes that has none of those kept is left out, with a note that says what was `lost`.
    """
    kept = np.unique(number, return_index=True)[1][int(number.min() < 0):]
    mesh.points = mesh.points[kept]
    mesh.gmsh_periodic = None
    for block in mesh.cells:
        block.data = number[block.data].astype(block.data.dtype)
    for key, values in mesh.point_data.items():
        mesh.point_data[key] = np.asarray(values)[kept]
    for name, nodes in list(mesh.point_sets.items()):
        left = number[nodes]
        mesh.point_sets[name] = left[left >= 0]
        if len(nodes) and not (left >= 0).any():
            del mesh.point_sets[name]
            if not name.startswith("gmsh:"):
                _leave_out(mesh, name, lost)


def _keep(mesh: meshio.Mesh, kept: np.ndarray, lost: str) -> None:
    """Keep only the nodes `kept`, ascending."""
    if len(kept) < len(mesh.points):
        number = np.full(len(mesh.points), -1)
        number[kept] = np.arange(len(kept))
        renumber(mesh, number, lost)


def _leave_out(mesh: meshio.Mesh, name: str, lost: str) -> None:
    shown = name if name.isprintable() else ascii(name)[1:-1]
    also = ", such as a reference point" if lost.startswith("nodes") else ""
    add_note(mesh, f"the boundary {shown[:100]!r} has only {lost}{also}, and is left out")
