"""Any mesh made one that a run can be computed on: of quadrilaterals or hexahedra, in mm, with named boundaries."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import meshio
import numpy as np

from ...errors import MeshError, ParameterError
from ...units import LONGEST, in_unit
from ..mesh_file import EXTENT, check_mesh, one_line, read_mesh_file
from .collapsed import uncollapsed
from .orientation import FACETS, oriented
from .pieces import merged, shortest
from .split import drop_others, needs_split, split
from .tidy import add_note, body_blocks, without_middle_nodes, without_orphans

__all__ = ["converted"]

NEAR = 1e-6  # distance of a node from a plane that it is on, over the size of the body; or
CLOSE = 1e-3  # over the shortest edge


def converted(path: Path, unit: str = "mm", merge_nodes: float = 0.0, boundaries: Sequence[str] = ()) -> meshio.Mesh:
    """The mesh in a file, made one of quadrilaterals or hexahedra; its notes say what was done.

    Parameters
    ----------
    path: of the file.
    unit: of its coordinates.
    merge_nodes: distance within which nodes become one, after the change of unit [mm].
    boundaries: new ones, NAME=x:1.5, NAME=y:min or NAME=z:max: facets on the outside that lie in a plane.

    Raises
    ------
    MeshError
        The file cannot be read, or its mesh cannot be converted.
    ParameterError
        There is no such unit, or a boundary is not of that form.
    """
    planes = [_plane(text) for text in boundaries]
    try:
        factor = in_unit("from", f"1 {unit}", "mm")
    except ParameterError:
        raise ParameterError(f"from must be a unit of length, such as m or inch; got {unit[:LONGEST]!r}") from None
    mesh, name = read_mesh_file(path, raw=True), one_line(str(path))
    if not body_blocks(mesh):
        raise MeshError(f"mesh {name} has no elements: it has "
                        f"{', '.join(sorted({block.type for block in mesh.cells})) or 'no cells'}")
    if factor != 1:
        mesh.points = mesh.points * factor
        add_note(mesh, f"coordinates in {unit} were made mm")
    without_orphans(mesh)
    if not np.isfinite(mesh.points).all():
        raise MeshError(f"mesh {name}: the mesh has a node whose coordinates are not finite numbers")
    if (far := float(np.abs(mesh.points).max())) > EXTENT[1]:
        raise MeshError(f"mesh {name} must lie within {EXTENT[1]:g} mm of the origin; it reaches {far:g} mm")
    uncollapsed(mesh)
    merged(name, mesh, merge_nodes)
    if needs_split(mesh):
        try:
            mesh = split(mesh)
        except MeshError as error:
            raise MeshError(f"mesh {name}: {error}") from None
    else:
        without_middle_nodes(mesh)
        drop_others(mesh)
    check_mesh(name, mesh)
    oriented(mesh)
    _add_planes(mesh, planes)
    return _plain(mesh)


def _plane(text: str) -> tuple[str, int, str | float]:
    """Name, axis and place of a boundary."""
    form = re.fullmatch(r"([^=]+)=([xyz]):(.+)", text.strip())
    if form is None or not form[1].strip().isprintable():
        raise ParameterError(f"boundary must be NAME=x:1.5, or with y or z, or min or max for the number; got {text!r}")
    end = form[3].strip()
    place = end if end in ("min", "max") else in_unit(f"boundary {form[1]}", end, "mm", plain=True)
    return form[1].strip(), "xyz".index(form[2]), place


def _add_planes(mesh: meshio.Mesh, planes: Sequence[tuple[str, int, str | float]]) -> None:
    """Name the facets on the outside that lie in planes."""
    if not planes:
        return
    kind, facet = ("hexahedron", "quad") if mesh.cells[body_blocks(mesh)[0]].dim == 3 else ("quad", "line")
    cells = mesh.cells_dict[kind].astype(np.int64)
    facets = np.concatenate([cells[:, corners] for corners in FACETS[kind]])
    _, number, count = np.unique(np.sort(facets, axis=1), axis=0, return_inverse=True, return_counts=True)
    facets = facets[count[number.ravel()] == 1]
    near = max(NEAR * float(np.ptp(mesh.points, axis=0).max()), CLOSE * shortest(mesh.points, [cells])[0])
    found: dict[str, list[np.ndarray]] = {}
    for name, axis, place in planes:
        if name in mesh.point_sets.keys() | mesh.cell_sets.keys():
            raise ParameterError(f"the mesh has a set {name!r} of its own: take another name for the boundary")
        if kind == "quad" and axis == 2:
            raise ParameterError(f"boundary {name}: a plane body has no edges in z that are not all its edges: take a "
                                 f"place in x or y")
        x = mesh.points[:, axis]
        at = float(x.min() if place == "min" else x.max()) if isinstance(place, str) else place
        on = (np.abs(x - at) <= near)[facets].all(axis=1)
        if not on.any():
            what = "face" if kind == "hexahedron" else "edge"
            raise MeshError(f"boundary {name}: no {what} on the outside lies in {'xyz'[axis]} = {at:g} mm; the body is "
                            f"between {x.min():g} and {x.max():g} mm")
        found.setdefault(name, []).append(np.flatnonzero(on))
    members = {name: np.unique(np.concatenate(parts)) for name, parts in found.items()}
    kept = np.unique(np.concatenate(list(members.values())))
    for sets in mesh.cell_sets.values():
        sets.extend([None] * (len(mesh.cells) - len(sets)) + [np.zeros(0, np.int64)])
    n = len(mesh.cells)
    for name, chosen in members.items():
        mesh.cell_sets[name] = [np.zeros(0, np.int64)] * n + [np.searchsorted(kept, chosen)]
    mesh.cells.append(meshio.CellBlock(facet, facets[kept]))


def _plain(mesh: meshio.Mesh) -> meshio.Mesh:
    """The mesh with what a file of ours holds: cells, sets of cells, sets of nodes, and no empty ones."""
    kept = [i for i, block in enumerate(mesh.cells) if len(block.data) and block.type != "vertex"]
    points = {name: np.unique(nodes) for name, nodes in mesh.point_sets.items() if len(nodes)}
    sets: dict[str, list[np.ndarray]] = {}
    for name, members in mesh.cell_sets.items():
        indices = [np.asarray([] if m is None else m, np.int64) for m in members]
        for block, index in zip(mesh.cells, indices):
            if block.type == "vertex" and len(index):
                points[name] = np.union1d(points.get(name, np.zeros(0, np.int64)), block.data[index].ravel())
        indices += [np.zeros(0, np.int64)] * (len(mesh.cells) - len(indices))
        if not name.startswith("gmsh:") and any(len(indices[i]) for i in kept):
            sets[name] = [indices[i] for i in kept]
    points = {name: nodes for name, nodes in points.items() if not name.startswith("gmsh:")}
    return meshio.Mesh(mesh.points, [mesh.cells[i] for i in kept], cell_sets=sets, point_sets=points, info=mesh.info)
