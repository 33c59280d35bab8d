"""Cells of VTK as blocks of elements: pixels and voxels become quadrilaterals and hexahedra, nothing is left out."""

from __future__ import annotations

from collections.abc import Sequence

import meshio
import numpy as np

from .unreadable import Unreadable

__all__ = ["vtk_mesh"]

#: name of a block and the nodes that are taken, by VTK's number of the kind
CELLS: dict[int, tuple[str, list[int]]] = {
    1: ("vertex", [0]), 3: ("line", [0, 1]), 5: ("triangle", [0, 1, 2]), 8: ("quad", [0, 1, 3, 2]),
    9: ("quad", [*range(4)]), 10: ("tetra", [*range(4)]), 11: ("hexahedron", [0, 1, 3, 2, 4, 5, 7, 6]),
    12: ("hexahedron", [*range(8)]), 13: ("wedge", [0, 2, 1, 3, 5, 4]), 14: ("pyramid", [*range(5)]),
    21: ("line3", [*range(3)]), 22: ("triangle6", [*range(6)]), 23: ("quad8", [*range(8)]),
    24: ("tetra10", [*range(10)]), 25: ("hexahedron20", [*range(20)]), 26: ("wedge15", [*range(15)]),
    27: ("pyramid13", [*range(13)]), 28: ("quad9", [*range(9)]), 29: ("hexahedron27", [*range(27)]),
}
#: kinds of any number of nodes, corners first, of which the corners are taken
CORNERS = {30: "quad", 33: "hexahedron", 34: "triangle", 35: "line", 68: "line", 69: "triangle", 70: "quad",
           71: "tetra", 72: "hexahedron", 73: "wedge", 74: "pyramid"}
NUMBER = {"line": 2, "triangle": 3, "quad": 4, "tetra": 4, "hexahedron": 8, "wedge": 6, "pyramid": 5}
EMPTY, POLY_VERTEX, POLY_LINE, POLYGON = 0, 2, 4, 7


def vtk_mesh(points: np.ndarray, connectivity: np.ndarray, ends: np.ndarray, types: np.ndarray,
             cell_data: dict[str, np.ndarray], point_data: dict[str, np.ndarray]) -> meshio.Mesh:
    """Blocks of cells by kind, each in the order of the file.

    Parameters
    ----------
    points: (n, 3).
    connectivity: nodes of all cells one after another.
    ends: where the nodes of each cell end in `connectivity`, (ne,).
    types: VTK's numbers of their kinds, (ne,).
    cell_data, point_data: values (ne, ...), (n, ...).

    Raises
    ------
    Unreadable
        A cell of a kind that cannot be read, or with a number of nodes that is not its own.
    """
    sizes = np.diff(ends, prepend=0)
    if len(ends) != len(types) or (sizes < 0).any() or (len(ends) and ends[-1] != len(connectivity)):
        raise Unreadable("its cells do not have the nodes that they say")
    for values, n in (*((v, len(types)) for v in cell_data.values()), *((v, len(points)) for v in point_data.values())):
        if len(values) != n:
            raise Unreadable("it has data, but not as many as points or cells")
    notes: list[str] = []
    pieces: list[tuple[str, np.ndarray, np.ndarray]] = []
    kinds, first = np.unique(types, return_index=True)
    for kind in kinds[np.argsort(first)].tolist():
        for size in np.unique(sizes[types == kind]).tolist():
            cells = np.flatnonzero((types == kind) & (sizes == size))
            nodes = connectivity[(ends[cells] - size)[:, None] + np.arange(size)]
            pieces += _pieces(kind, cells, nodes, notes)
    blocks: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for name, cells, nodes in pieces:
        blocks.setdefault(name, []).append((cells, nodes))
    joined = {}
    for name, parts in blocks.items():
        cells = np.concatenate([part[0] for part in parts])
        order = np.argsort(cells, kind="stable")
        joined[name] = cells[order], np.concatenate([part[1] for part in parts])[order]
    return meshio.Mesh(points, [(name, nodes) for name, (_, nodes) in joined.items()], info={"notes": notes},
                       cell_data={key: [values[cells] for cells, _ in joined.values()]
                                  for key, values in cell_data.items()}, point_data=point_data)


def _pieces(kind: int, cells: np.ndarray, nodes: np.ndarray,
            notes: list[str]) -> Sequence[tuple[str, np.ndarray, np.ndarray]]:
    """Cells of one kind and number of nodes: name, which they are, their nodes."""
    size = nodes.shape[1]
    if kind in CELLS and len(CELLS[kind][1]) == size:
        return [(CELLS[kind][0], cells, nodes[:, CELLS[kind][1]])]
    if kind == POLYGON and size in (3, 4):
        return [("triangle" if size == 3 else "quad", cells, nodes)]
    if kind in CORNERS and size >= NUMBER[CORNERS[kind]]:
        name = CORNERS[kind]
        if size > NUMBER[name]:
            notes.append(f"{len(cells)} elements of higher order are taken by their corners")
        return [(name, cells, nodes[:, :NUMBER[name]])]
    if kind == POLY_VERTEX:
        return [("vertex", np.repeat(cells, size), nodes.reshape(-1, 1))]
    if kind == POLY_LINE and size > 1:
        lines = np.stack([nodes[:, :-1], nodes[:, 1:]], axis=2)
        return [("line", np.repeat(cells, size - 1), lines.reshape(-1, 2))]
    if kind == EMPTY:
        return []
    raise Unreadable(f"it has {len(cells)} cell(s) of VTK's kind {kind} with {size} nodes, which cannot be read; "
                     "save quadrilaterals (9) or hexahedra (12)")
