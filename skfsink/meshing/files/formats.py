"""Which reader a mesh file goes to: by its suffix, and by what it begins with where a suffix has two meanings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import meshio

from ...errors import SkfsinkError
from .abaqus import read_abaqus
from .exodus import read_exodus
from .gmsh import read_gmsh
from .nastran import read_nastran
from .sets import named_sets
from .ucd import is_ucd, read_ucd
from .unreadable import Unreadable
from .vtk import read_vtk
from .vtu import read_vtu

__all__ = ["read_format"]

#: what to do with files of other programs
CURES = {
    **dict.fromkeys((".med", ".rmed", ".mmed"), "open it in gmsh (File, Export) and save it as MSH 4.1"),
    **dict.fromkeys((".cgns", ".unv", ".mesh", ".meshb", ".p3d", ".step", ".stp", ".iges", ".igs", ".brep", ".geo"),
                    "open it in gmsh, mesh it if it is a geometry, and save it as MSH 4.1"),
    **dict.fromkeys((".pvtu", ".pvd", ".vtm", ".vtp", ".vts", ".vtr", ".vti", ".vtkhdf", ".foam", ".case", ".cas"),
                    "open it in ParaView and save it as VTU"),
    **dict.fromkeys((".xdmf", ".xmf", ".h5", ".hdf5", ".xml"),
                    "open it in ParaView, or with meshio in Python, and save it as VTU"),
    ".odb": "save the Abaqus model as an input file (.inp)", ".cae": "save the Abaqus model as an input file (.inp)",
    ".cdb": "save it as a Nastran file (.bdf) or as VTU", ".k": "save it as a Nastran file (.bdf) or as VTU",
    **dict.fromkeys((".stl", ".obj", ".ply", ".off"), "mesh what is inside with gmsh and save it as MSH 4.1"),
    **dict.fromkeys((".gz", ".zip", ".bz2", ".xz", ".7z"), "unpack it"),
}


def read_format(path: Path) -> meshio.Mesh:
    """The mesh in a file, with named sets; notes for the user are in `info["notes"]`.

    Raises
    ------
    Unreadable, SkfsinkError
        What is wrong with the file, and what to do, in one line.
    """
    name, reader = _reader(path)
    try:
        mesh = reader(path)
    except (Unreadable, SkfsinkError):
        raise
    except MemoryError:
        raise Unreadable("it needs more memory than a mesh file of its size should") from None
    except Exception as error:
        raise Unreadable(f"it is damaged, or not of the format {name}") from error
    mesh.info = {"notes": [], **(mesh.info or {})}
    return mesh


def _reader(path: Path) -> tuple[str, Callable[[Path], meshio.Mesh]]:
    """Name and reader of the format of a file."""
    suffix = path.suffix.lower()
    if suffix in CURES:
        raise Unreadable(f"files {suffix} are not read; {CURES[suffix]}")
    if suffix not in READERS:
        raise Unreadable(f"{f'files {suffix[:20]}' if suffix else 'files without a suffix'} are not read; what is: "
                         f"{', '.join(READERS)}; save it as one of these")
    with path.open("rb") as file:
        begin = file.read(10**5)
    if suffix == ".msh" and begin.lstrip().startswith(b"("):
        raise Unreadable("it is a mesh of Fluent, whose cells are given by their faces; open it in ParaView and save "
                         "it as VTU")
    if suffix == ".vtk" and begin.lstrip().startswith(b"<"):
        suffix = ".vtu"
    if suffix == ".inp" and is_ucd(begin):
        suffix = ".ucd"
    return READERS[suffix]


def _with_sets(reader: Callable[[Path], meshio.Mesh]) -> Callable[[Path], meshio.Mesh]:
    """A reader that gives a mesh the sets that its arrays of whole numbers stand for."""
    return lambda path: named_sets(reader(path))


READERS: dict[str, tuple[str, Callable[[Path], meshio.Mesh]]] = {
    ".msh": ("MSH", read_gmsh), ".vtu": ("VTU", _with_sets(read_vtu)), ".vtk": ("VTK", _with_sets(read_vtk)),
    ".inp": ("Abaqus", read_abaqus),
    **dict.fromkeys((".avs", ".ucd"), ("UCD", _with_sets(read_ucd))),
    **dict.fromkeys((".bdf", ".nas", ".fem", ".nastran"), ("Nastran", _with_sets(read_nastran))),
    **dict.fromkeys((".e", ".exo", ".ex2", ".exii"), ("Exodus", read_exodus)),
}
