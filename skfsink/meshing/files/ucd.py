"""UCD files of AVS (`.inp`, `.avs`, `.ucd`), which deal.II, LaGriT and Cubit write as text.

The material numbers of cells become sets `material:1`, ...

The format is described at https://lanl.github.io/LaGriT/pages/docs/read_avs.html.
"""

from __future__ import annotations

import re
from pathlib import Path

import meshio
import numpy as np

from .numbers import Text, places, whole
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
    lines = [line.split() for line in text.splitlines() if line.strip() and not line.lstrip().startswith(b"#")]
    n_nodes, n_cells, n_point_data, n_cell_data, _ = (int(word) for word in lines[0])
    if len(lines) < 1 + n_nodes + n_cells:
        raise Unreadable(f"it has fewer lines than the {n_nodes} nodes and {n_cells} cells that it says")
    nodes, cells, rest = lines[1:1 + n_nodes], lines[1 + n_nodes:1 + n_nodes + n_cells], lines[1 + n_nodes + n_cells:]
    rows = _numbers(nodes, 0, 4, "nodes")
    kinds: dict[str, list[int]] = {}
    for i, words in enumerate(cells):
        kinds.setdefault(words[2].decode(errors="replace").lower(), []).append(i)
    blocks = []
    for kind, index in kinds.items():
        if kind not in KINDS:
            raise Unreadable(f"it has cells {kind[:20]!r}, which cannot be read")
        name, order = KINDS[kind]
        asked = _numbers([cells[i] for i in index], 3, 3 + len(order), f"cells {kind}")
        blocks.append((name, places(whole(rows[:, 0]), whole(asked))[:, order]))
    point_data, rest = _data(rest, n_point_data, n_nodes)
    cell_data, rest = _data(rest, n_cell_data, n_cells)
    cell_data["material"] = np.array([int(words[1]) for words in cells])
    return meshio.Mesh(rows[:, 1:], blocks, point_data=point_data,
                       cell_data={name: [values[index] for index in kinds.values()]
                                  for name, values in cell_data.items()})


def _numbers(lines: list[list[bytes]], first: int, end: int, what: str) -> np.ndarray:
    """Numbers of the words of lines from the `first` to the `end`, which is that of the lines."""
    if any(len(words) != end for words in lines):
        raise Unreadable(f"its list of {what} has lines of more or fewer words than {end}")
    text = b" ".join(word for words in lines for word in words[first:])
    return Text(text, f"its list of {what}").values.reshape(len(lines), -1)


def _data(lines: list[list[bytes]], count: int, n: int) -> tuple[dict[str, np.ndarray], list[list[bytes]]]:
    """Data of one component by name, and the lines that follow; the order is that of nodes or cells."""
    if not count:
        return {}, lines
    sizes = [int(word) for word in lines[0][1:]]
    names = [b" ".join(words).partition(b",")[0].strip().decode(errors="replace") for words in lines[1:1 + len(sizes)]]
    rows = lines[1 + len(sizes):1 + len(sizes) + n]
    if len(rows) != n:
        raise Unreadable("it has data, but not as many as nodes or cells")
    values = _numbers(rows, 1, 1 + sum(sizes), "data")
    first = np.cumsum([0, *sizes])
    return ({name: values[:, at] for name, at, size in zip(names, first, sizes) if size == 1},
            lines[1 + len(sizes) + n:])
