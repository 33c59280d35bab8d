"""Which reader a mesh file goes to: by its suffix, and by what it begins with where a suffix has two meanings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import meshio

from .gmsh import read_gmsh
from .sets import named_sets

__all__ = ["read_format"]


def read_format(path: Path) -> meshio.Mesh:
    """The mesh in a file, with named sets; notes for the user are in `info["notes"]`.

    Raises
    ------
    ValueError
        What is wrong with the file, and what to do, in one line.
    """
    suffix = path.suffix.lower()
    if suffix not in READERS:
        raise ValueError(f"{f'files {suffix}' if suffix else 'a file without a suffix'} cannot be read; what can is "
                         f"{', '.join(READERS)}")
    mesh = READERS[suffix](path)
    mesh.info = mesh.info or {}
    mesh.info.setdefault("notes", [])
    return mesh


def _msh(path: Path) -> meshio.Mesh:
    with path.open("rb") as file:
        if file.read(1) == b"(":
            raise ValueError("it is a mesh of Fluent, whose cells are given by their faces; save it as VTU or CGNS, "
                             "and that with gmsh or ParaView as MSH 4.1 or VTU")
    return read_gmsh(path)


def _vtu(path: Path) -> meshio.Mesh:
    return named_sets(meshio.read(path, "vtu"))


def _inp(path: Path) -> meshio.Mesh:
    return meshio.read(path, "abaqus")


READERS: dict[str, Callable[[Path], meshio.Mesh]] = {
    ".msh": _msh, ".vtu": _vtu, ".inp": _inp,
}
