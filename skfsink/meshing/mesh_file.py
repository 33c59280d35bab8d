"""Mesh files of the user: read within bounds of size, and checked before anything is computed on them.

A file is not trusted. It may claim more than it holds, name other files, or hold what is no body; each of these is a
MeshError of one line, and nothing is written.
"""

from __future__ import annotations

import contextlib
import io
import os
import stat
import warnings
from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np

from ..errors import MeshError, SkfsinkError
from .files.bounds import LARGEST
from .files.orientation import oriented
from .files.tidy import place, tidied
from .kept_mesh import SUFFIX, read_kept
from .vtu import read_mesh

__all__ = ["check_indices", "check_mesh", "one_line", "quietly", "read_mesh_file"]

POINTERS = (".xdmf", ".xmf", ".node", ".ele")  # formats that are spread over several files
CORNERS = {"vertex": 1, "line": 2, "quad": 4, "hexahedron": 8}
EXTENT = (1e-9, 1e9)       # mm across


def one_line(text: str) -> str:
    """`text` as it may stand in a message: what cannot be printed escaped, cut after 200 characters."""
    text = text if text.isprintable() else ascii(text)[1:-1]
    return text if len(text) <= 200 else text[:200] + "…"


def quietly(source: Callable[[], meshio.Mesh], failure: str) -> meshio.Mesh:
    """The mesh from a library that prints, exits and raises what it likes.

    Raises
    ------
    MeshError
        `failure`, and the first line of the reason.
    """
    try:
        with (contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()),
              warnings.catch_warnings(action="ignore")):
            return source()
    except SkfsinkError:
        raise
    except (Exception, SystemExit) as error:
        reason = str(error).strip() or type(error).__name__
        raise MeshError(f"{failure}: {one_line(reason.splitlines()[0])}") from None


def read_mesh_file(path: Path, raw: bool = False) -> meshio.Mesh:
    """The mesh in a file, without middle nodes and nodes of no element, checked by :func:`check_mesh`.

    A `raw` one has these nodes, and is only seen to name none that do not exist.

    Raises
    ------
    MeshError
        There is no such file, it is too large, names other files, cannot be read, or holds no mesh to compute on.
    """
    shown = one_line(str(path))
    failure = f"the mesh file {shown} cannot be read"
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        cure = r": folders are parted by / here, not by \ as on Windows" if "\\" in str(path) and os.sep == "/" else ""
        raise MeshError(f"there is no mesh file {shown}{cure}") from None
    if not stat.S_ISREG(status.st_mode):
        raise MeshError(f"there is no mesh file {shown}: what has that name is no file with content")
    if status.st_size > LARGEST:
        raise MeshError(f"{failure}: it has {status.st_size / 1e9:.1f} GB, the most is {LARGEST / 1e9:.0f} GB")
    if (suffix := path.suffix.lower()) in POINTERS:
        raise MeshError(f"{failure}: it names other files; put the mesh into one file, such as VTU")
    mesh = quietly(lambda: read_kept(path) if suffix == SUFFIX else read_mesh(path), failure)
    quietly(lambda: _sound(mesh), failure)
    check_indices(shown, mesh)
    if raw:
        return mesh
    check_mesh(shown, tidied(mesh))
    return oriented(mesh)


def check_mesh(name: str, mesh: meshio.Mesh) -> None:
    """See that points, elements and boundaries belong together.

    Raises
    ------
    MeshError
        Elements or boundaries name nodes that do not exist, an element has a node twice or is there twice, nodes have
        no finite coordinates, plane elements do not lie in a plane of constant z, or the body is not of a size in mm.
    """
    check_indices(name, mesh)
    points = mesh.points
    kind = next((k for k in ("hexahedron", "quad") if len(mesh.cells_dict.get(k, ()))), None)
    if kind is None:
        return  # the sample says what is there instead
    if not np.isfinite(points).all():
        raise MeshError(f"mesh {name}: the mesh has a node whose coordinates are not finite numbers")
    extents = [points[:, i].max() / 2 - points[:, i].min() / 2 for i in range(3)]  # halves: no overflow
    if not EXTENT[0] <= 2 * max(extents[:2]) <= EXTENT[1]:
        raise MeshError(f"mesh {name} must be {EXTENT[0]:g} to {EXTENT[1]:g} mm across; got {2 * max(extents[:2]):g}")
    if kind == "quad" and extents[2] > 1e-6 * max(extents[:2]):
        flat = next((axis for axis, extent in zip("xy", extents) if extent <= 1e-6 * max(extents)), "")
        cure = f"they lie at one {flat}: turn the mesh, so that its coordinates are x and y" if flat else \
            f"they reach over {2 * extents[2]:g} mm: lay it flat, or save the solid elements"
        raise MeshError(f"mesh {name} must have its quadrilaterals in a plane of constant z; {cure}")
    nodes = np.sort(mesh.cells_dict[kind].astype(np.int64), axis=1)
    if (twice := (nodes[:, 1:] == nodes[:, :-1]).any(axis=1)).any():
        at = place(points[nodes[twice.argmax()]].mean(axis=0)[:2 if kind == "quad" else 3])
        raise MeshError(f"mesh {name}: element {int(twice.argmax())} is inverted or degenerate: it has a node twice, "
                        f"near {at} mm; if that is how your program writes triangles or wedges, convert it with "
                        f"skfsink mesh {name} OUT.vtu")
    rows = np.ascontiguousarray(nodes).view(np.dtype((np.void, nodes.itemsize * nodes.shape[1]))).ravel()
    kept = np.unique(rows, return_index=True)[1]
    if len(kept) < len(rows):
        first = np.setdiff1d(np.arange(len(rows)), kept)[0]
        middle = place(points[nodes[first]].mean(axis=0)[:2 if kind == "quad" else 3])
        raise MeshError(f"mesh {name} has {len(rows) - len(kept)} element(s) more than once, such as one near "
                        f"{middle} mm: leave the copies out")


def check_indices(name: str, mesh: meshio.Mesh) -> None:
    """See that elements and boundaries name nodes and cells that exist, and elements as many as they have (MeshError).
    """
    points, blocks = mesh.points, mesh.cells
    for block in blocks:
        if np.shape(block.data)[1:] != (CORNERS.get(block.type, np.shape(block.data)[-1]),):
            raise MeshError(f"mesh {name} has elements ({block.type}) with a number of nodes that is not theirs")
        if not isinstance(block.data, np.ndarray) or block.data.dtype.kind not in "iu" or (
                block.data.size and not 0 <= block.data.min() <= block.data.max() < len(points)):
            raise MeshError(f"mesh {name} has elements with nodes that do not exist")
    for boundary, members in mesh.cell_sets.items():
        for block, index in zip(blocks, members):
            if index is not None and len(index) and not 0 <= np.min(index) <= np.max(index) < len(block.data):
                raise MeshError(f"mesh {name}: the boundary {one_line(boundary)!r} has cells that do not exist")
    for boundary, nodes in mesh.point_sets.items():
        if len(nodes) and not 0 <= nodes.min() <= nodes.max() < len(points):
            raise MeshError(f"mesh {name}: the boundary {one_line(boundary)!r} has nodes that do not exist")


def _sound(mesh: meshio.Mesh) -> meshio.Mesh:
    """Give the arrays of a mesh the types and shapes that they are to have."""
    points = np.asarray(mesh.points, float)
    if points.ndim != 2 or not 2 <= points.shape[1] <= 3:
        raise ValueError("its points are not given by two or three coordinates")
    mesh.points = np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])
    mesh.point_sets = {name: np.asarray(nodes, np.int64).ravel() for name, nodes in mesh.point_sets.items()}
    for members in mesh.cell_sets.values():
        members[:] = [None if index is None else np.asarray(index, np.int64).ravel() for index in members]
    return mesh
