"""Exodus II files of Cubit, MOOSE and SEACAS, where they are in the classic form of netCDF.

Element blocks become sets of elements, node sets and side sets boundaries, by their names; without one they are called
`block:1`, `nodeset:1`, `sideset:1` by their numbers. Files in the form of HDF5 are refused: to read them would take
libraries that nothing else here needs, where `ncks -6 in.e out.e` or `nccopy -6` makes classic ones of them.

The format is described at https://sandialabs.github.io/seacas-docs/exodusII-new.pdf.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import meshio
import numpy as np

from .unreadable import Unreadable

__all__ = ["read_exodus"]

#: name of the block by the beginning of the element's type and its number of nodes
KINDS = {("QUA", 4): "quad", ("QUA", 8): "quad8", ("QUA", 9): "quad9", ("SHE", 4): "quad", ("SHE", 8): "quad8",
         ("SHE", 9): "quad9", ("HEX", 8): "hexahedron", ("HEX", 20): "hexahedron20", ("HEX", 27): "hexahedron27",
         ("TRI", 3): "triangle", ("TRI", 6): "triangle6", ("TET", 4): "tetra", ("TET", 10): "tetra10",
         ("WED", 6): "wedge", ("PYR", 5): "pyramid", ("SPH", 1): "vertex", ("BAR", 2): "line", ("BEA", 2): "line",
         ("TRU", 2): "line", ("EDG", 2): "line", ("BAR", 3): "line3", ("BEA", 3): "line3", ("TRU", 3): "line3"}
#: nodes in VTK's order, where that is another one
ORDER = {"hexahedron20": [*range(12), 16, 17, 18, 19, 12, 13, 14, 15],
         "hexahedron27": [*range(12), 16, 17, 18, 19, 12, 13, 14, 15, 23, 24, 25, 26, 21, 22, 20]}
#: corners of the sides of elements, by the number of the side less one
SIDES = {"quad": [[0, 1], [1, 2], [2, 3], [3, 0]],
         "shell": [[0, 1, 2, 3], [3, 2, 1, 0], [0, 1], [1, 2], [2, 3], [3, 0]],
         "triangle": [[0, 1], [1, 2], [2, 0]],
         "hexahedron": [[0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [0, 4, 7, 3], [0, 3, 2, 1], [4, 5, 6, 7]],
         "tetra": [[0, 1, 3], [1, 2, 3], [0, 3, 2], [0, 2, 1]]}
HDF5 = b"\x89HDF"


def read_exodus(path: Path) -> meshio.Mesh:
    """The mesh in an Exodus file.

    Raises
    ------
    Unreadable
        It is in the form of HDF5, or is none.
    """
    with path.open("rb") as file:
        begin = file.read(4)
    if begin == HDF5:
        raise Unreadable("it is in the form of HDF5; make a classic one with `nccopy -6 in.e out.e`, or save it as VTU")
    if begin[:3] != b"CDF" or begin[3:] not in (b"\1", b"\2"):
        raise Unreadable("it is no Exodus file in the classic form of netCDF; save it as VTU")
    from scipy.io import netcdf_file

    with warnings.catch_warnings(action="ignore"), netcdf_file(str(path), "r", mmap=False) as source:
        values = {name: np.array(variable.data) for name, variable in source.variables.items()
                  if name.startswith(("coord", "connect", "eb_", "ns_", "ss_", "node_ns", "elem_ss", "side_ss"))}
        types = {name: source.variables[name].elem_type.decode() for name in values
                 if name.startswith("connect") and hasattr(source.variables[name], "elem_type")}
    return _mesh(values, types)


def _mesh(values: dict[str, np.ndarray], types: dict[str, str]) -> meshio.Mesh:
    axes = [values[f"coord{x}"] for x in "xyz" if f"coord{x}" in values] or [*values.get("coord", ())]
    if not axes:
        raise Unreadable("it has no coordinates")
    points = np.zeros((len(axes[0]), 3))
    points[:, :len(axes)] = np.stack(axes, axis=1)
    cells: list[tuple[str, np.ndarray]] = []
    corners: list[np.ndarray] = []  # nodes of every element, in the order of the file, and where its sides are listed
    forms: list[str] = []
    sets: dict[str, list[int]] = {}  # numbers of the blocks
    for i, name in enumerate(_named(values, "eb", "connect", "block")):
        nodes = values.get(f"connect{i + 1}")
        if nodes is None or nodes.ndim != 2:
            continue  # an empty block
        form = types.get(f"connect{i + 1}", "")[:3].upper()
        if (kind := KINDS.get((form, nodes.shape[1]))) is None:
            raise Unreadable(f"its block {name!r} has elements {types.get(f'connect{i + 1}', '')[:20]!r} with "
                             f"{nodes.shape[1]} nodes, which cannot be read")
        nodes = nodes.astype(np.int64) - 1
        if nodes.size and not 0 <= nodes.min() <= nodes.max() < len(points):
            raise Unreadable("it has elements with nodes that do not exist")
        sets.setdefault(name, []).append(len(cells))
        cells.append((kind, nodes[:, ORDER.get(kind, slice(None))]))
        corners.append(nodes)
        forms.append("shell" if form == "SHE" and len(axes) == 3 else kind.rstrip("0123456789"))
    members = {name: {block: np.arange(len(cells[block][1])) for block in blocks} for name, blocks in sets.items()}
    _add_side_sets(values, cells, corners, forms, members)
    nodes_of = {name: np.unique(values[f"node_ns{i + 1}"].astype(np.int64) - 1)
                for i, name in enumerate(_named(values, "ns", "node_ns", "nodeset")) if f"node_ns{i + 1}" in values}
    return meshio.Mesh(points, cells, point_sets=nodes_of,
                       cell_sets={name: [found.get(i, np.zeros(0, np.int64)) for i in range(len(cells))]
                                  for name, found in members.items()})


def _add_side_sets(values: dict[str, np.ndarray], cells: list[tuple[str, np.ndarray]], corners: list[np.ndarray],
                   forms: list[str], members: dict[str, dict[int, np.ndarray]]) -> None:
    """Append a block of facets for each side set, and enter it in `members`."""
    first = np.cumsum([0, *(len(nodes) for nodes in corners)])
    for i, name in enumerate(_named(values, "ss", "elem_ss", "sideset")):
        if f"elem_ss{i + 1}" not in values or f"side_ss{i + 1}" not in values:
            continue
        elements = values[f"elem_ss{i + 1}"].astype(np.int64) - 1
        sides = values[f"side_ss{i + 1}"].astype(np.int64) - 1
        if len(elements) != len(sides) or (elements.size and not 0 <= elements.min() <= elements.max() < first[-1]):
            raise Unreadable(f"its side set {name!r} has elements that do not exist")
        facets: dict[int, list[np.ndarray]] = {}
        owner = np.searchsorted(first, elements, "right") - 1
        for block in np.unique(owner).tolist():
            table = SIDES.get(forms[block])
            for side in np.unique(sides[owner == block]).tolist():
                if table is None or not 0 <= side < len(table):
                    raise Unreadable(f"its side set {name!r} has side {side + 1} of elements {forms[block]}, which is "
                                     "not known")
                chosen = elements[(owner == block) & (sides == side)] - first[block]
                facets.setdefault(len(table[side]), []).append(corners[block][chosen][:, table[side]])
        for n, parts in facets.items():
            members.setdefault(name, {})[len(cells)] = np.arange(sum(map(len, parts)))
            cells.append(({2: "line", 3: "triangle", 4: "quad"}[n], np.concatenate(parts)))


def _named(values: dict[str, np.ndarray], short: str, variable: str, word: str) -> list[str]:
    """Names of the blocks or sets of a kind, in the order of their variables."""
    n = max((int(name.removeprefix(variable)) for name in values
             if name.startswith(variable) and name.removeprefix(variable).isdigit()), default=0)
    numbers: Any = values.get(f"{short}_prop1", np.arange(1, n + 1))
    names: Any = values.get(f"{short}_names", ())
    texts = [b"".join(row.ravel().tolist()).split(b"\0")[0].decode(errors="replace").strip() for row in names]
    return [texts[i] if i < len(texts) and texts[i] else
            f"{word}:{int(numbers[i]) if i < len(numbers) else i + 1}" for i in range(n)]
