"""UCD files of AVS (`.inp`, `.avs`, `.ucd`), which deal.II, LaGriT and Cubit write as text.

The material numbers of cells become sets `material:1`, ...

The format is described at https://lanl.github.io/LaGriT/pages/docs/read_avs.html.
"""

from __future__ import annotations

import re
from pathlib import Path

import meshio
import numpy as np

from .unreadable import Unreadable

__all__ = ["is_ucd", "read_ucd"]

#: name of the block and nodes in its order; the top of a hexahedron comes first in UCD
KINDS = {"pt": ("vertex", [0]), "line": ("line", [0, 1]), "tri": ("triangle", [0, 1, 2]),
         "quad": ("quad", [0, 1, 2, 3]), "tet": ("tetra", [0, 1, 3, 2]), "pyr": ("pyramid", [1, 2, 3, 4, 0]),
         "prism": ("wedge", [3, 4, 5, 0, 1, 2]), "hex": ("hexahedron", [4, 5, 6, 7, 0, 1, 2, 3])}


def is_ucd(begin: bytes) -> bool:
    """Whether a file that begins like this is a UCD file: its first line but comments is of five whole numbers."""
    for line in begin.splitlines():
        if line.strip() and not line.lstrip().startswith(b"#"):
            return re.fullmatch(rb"\s*\d+\s+\d+\s+\d+\s+\d+\s+\d+\s*", line) is not None
    return False


def read_ucd(path: Path) -> meshio.Mesh:
    """The mesh in a UCD file, with its data of one component.

    Raises
    ------
    Unreadable
        It is not of the format, or has more or less than it says.
    """
    text = path.read_bytes()
    if not is_ucd(text[:10**5]):
        raise Unreadable("its first line is not that of a UCD file in text: numbers of nodes, cells and data")
    lines = [line.split() for line in text.decode(errors="replace").splitlines()
             if line.strip() and not line.lstrip().startswith("#")]
    n_nodes, n_cells, n_point_data, n_cell_data, _ = (int(word) for word in lines[0])
    if len(lines) < 1 + n_nodes + n_cells:
        raise Unreadable(f"it has fewer lines than the {n_nodes} nodes and {n_cells} cells that it says")
    nodes, cells, rest = lines[1:1 + n_nodes], lines[1 + n_nodes:1 + n_nodes + n_cells], lines[1 + n_nodes + n_cells:]
    place = {int(words[0]): i for i, words in enumerate(nodes)}
    if len(place) < n_nodes:
        raise Unreadable("it has a node twice")
    points = np.array([[float(x) for x in words[1:4]] for words in nodes]).reshape(-1, 3)
    blocks: dict[str, list[int]] = {}
    for i, words in enumerate(cells):
        if words[2].lower() not in KINDS or len(words) != 3 + len(KINDS[words[2].lower()][1]):
            raise Unreadable(f"it has a cell {' '.join(words[:3])[:40]!r} of a kind or number of nodes that is unknown")
        blocks.setdefault(words[2].lower(), []).append(i)
    point_data, rest = _data(rest, n_point_data, n_nodes)
    cell_data, rest = _data(rest, n_cell_data, n_cells)
    cell_data["material"] = np.array([int(words[1]) for words in cells])
    try:
        connectivity = [(KINDS[kind][0], np.array([[place[int(cells[i][3 + a])] for a in KINDS[kind][1]]
                                                   for i in index])) for kind, index in blocks.items()]
    except KeyError:
        raise Unreadable("it has elements with nodes that do not exist") from None
    return meshio.Mesh(points, connectivity, point_data=point_data,
                       cell_data={name: [values[index] for index in blocks.values()]
                                  for name, values in cell_data.items()})


def _data(lines: list[list[str]], count: int, n: int) -> tuple[dict[str, np.ndarray], list[list[str]]]:
    """Data of one component by name, and the lines that follow; the order is that of nodes or cells."""
    if not count:
        return {}, lines
    sizes = [int(word) for word in lines[0][1:]]
    names = [" ".join(words).partition(",")[0].strip() for words in lines[1:1 + len(sizes)]]
    rows = lines[1 + len(sizes):1 + len(sizes) + n]
    values = np.array([[float(x) for x in row[1:]] for row in rows]).reshape(-1, sum(sizes))
    if len(values) != n:
        raise Unreadable("it has data, but not as many as nodes or cells")
    first = np.cumsum([0, *sizes])
    return ({name: values[:, at] for name, at, size in zip(names, first, sizes) if size == 1},
            lines[1 + len(sizes) + n:])
