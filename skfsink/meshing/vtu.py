"""Mesh files with named boundaries: VTU files written by this program, and whatever else can be read."""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import escape

import meshio
import numpy as np

from .files.formats import read_format
from .files.sets import BOUNDARY_PREFIX

__all__ = ["read_mesh", "write_mesh"]


def write_mesh(path: str | Path, mesh: meshio.Mesh) -> None:
    """Write a mesh to a VTU file.

    A cell set becomes the cell data `boundary:<name>`, 1 on its cells; a point set the point data of that name. Arrays
    of vectors, of three components, are written as they are.
    """
    flags = {_array_name(name): [np.isin(np.arange(len(block.data)), index).astype(np.int8)
                                 for block, index in zip(mesh.cells, members, strict=True)]
             for name, members in mesh.cell_sets.items()}
    cells = [(block.type, block.data.astype(np.int32)) for block in mesh.cells]
    nodes = {_array_name(name): np.isin(np.arange(len(mesh.points)), members).astype(np.int8)
             for name, members in mesh.point_sets.items()}
    flags |= {name: data for name, data in mesh.cell_data.items() if all(np.shape(part)[1:] == (3,) for part in data)}
    nodes |= {name: data for name, data in mesh.point_data.items() if np.shape(data)[1:] == (3,)}
    meshio.write(path, meshio.Mesh(mesh.points, cells, point_data=nodes, cell_data=flags), file_format="vtu")


def read_mesh(path: str | Path) -> meshio.Mesh:
    """Read a mesh written by `write_mesh`, or any other mesh file that can be read, with its sets."""
    return read_format(Path(path))


def _array_name(name: str) -> str:
    """Name of the array of a set, as it may stand between quotes in XML: meshio (5.3.5) writes names as they are.

    It is pure ASCII, since meshio opens the file in the encoding of the machine.
    """
    text = escape(BOUNDARY_PREFIX + name, {'"': "&quot;", "\t": "&#9;", "\n": "&#10;", "\r": "&#13;"})
    return text.encode("ascii", "xmlcharrefreplace").decode()
