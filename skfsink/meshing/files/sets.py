"""Arrays of whole numbers on cells and points, read as regions and boundaries.

An array `boundary:NAME` marks the set NAME with values other than 0. Any other array of whole numbers `NAME` gives a
set `NAME:1`, `NAME:2`, ... for each of its values; if these are 0 and 1 only, it also is the set NAME. On elements
these are regions; on edges, faces, vertices and points they are boundaries. Arrays that number all elements or points
are left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import meshio
import numpy as np

from .unreadable import Unreadable

__all__ = ["BOUNDARY_PREFIX", "join_boundaries", "named_sets"]

BOUNDARY_PREFIX = "boundary:"
MOST = 1000  # values of an array that numbers regions
FEW = 32     # an array of more values than this that are all different numbers elements or points, not regions
DIMENSION = {"vertex": 0, "line": 1, "line3": 1, "triangle": 2, "triangle6": 2, "quad": 2, "quad8": 2, "quad9": 2}


def named_sets(mesh: meshio.Mesh) -> meshio.Mesh:
    """Add the sets that the arrays of a mesh stand for; sets that it has keep their members.

    Cell sets are of elements and their facets, by block; sets of nodes are those of cells of lower dimension and of
    points. Numbers may be given anew in each dimension: where facets have one, edges and points of it are left out.

    Raises
    ------
    Unreadable
        An array has not as many values as there are cells or points.
    """
    dims, body = _dimensions(mesh)
    starts = np.cumsum([0, *(len(block.data) for block in mesh.cells)])[1:-1]
    nodes: dict[str, list[np.ndarray]] = {}
    facets = set()
    for key, values in list(mesh.cell_data.items()):
        if any(len(part) != len(block.data) for part, block in zip(values, mesh.cells, strict=True)):
            raise Unreadable(f"its data {key} are not as many as its cells")
        is_boundary = key.startswith(BOUNDARY_PREFIX)
        for name, mask in _masks(key, values):
            members = [np.flatnonzero(part) for part in np.split(mask, starts)]
            lower = [block.data[index].ravel() for block, dim, index in zip(mesh.cells, dims, members)
                     if dim < body - 1 and len(index)]
            if any(len(index) for dim, index in zip(dims, members) if dim == body - 1):
                facets.add(name)
            if lower and (is_boundary or name not in facets):
                nodes.setdefault(name, []).extend(lower)
            members = [index if dim >= body - 1 else index[:0] for dim, index in zip(dims, members)]
            if any(len(index) for index in members) or (is_boundary and not lower):
                mesh.cell_sets.setdefault(name, members)
        if is_boundary:
            del mesh.cell_data[key]
    for key, values in list(mesh.point_data.items()):
        if len(values) != len(mesh.points):
            raise Unreadable(f"its data {key} are not as many as its points")
        is_boundary = key.startswith(BOUNDARY_PREFIX)
        for name, mask in _masks(key, [values]):
            if is_boundary or (name not in nodes and name not in facets):
                nodes.setdefault(name, []).append(np.flatnonzero(mask))
        if is_boundary:
            del mesh.point_data[key]
    for name, parts in nodes.items():
        mesh.point_sets.setdefault(name, np.unique(np.concatenate(parts)).astype(np.int64))
    return join_boundaries(mesh)


def _masks(key: str, parts: Sequence[np.ndarray]) -> Iterator[tuple[str, np.ndarray]]:
    """Names of the sets of an array, which is given by blocks of cells, and who is in each."""
    values = np.concatenate([np.asarray(part).reshape(len(part), -1) for part in parts]) if parts else np.zeros((0, 1))
    if values.shape[1] != 1 or values.dtype.kind not in "iufb":
        return
    values = values[:, 0]
    if key.startswith(BOUNDARY_PREFIX):
        yield key.removeprefix(BOUNDARY_PREFIX), values != 0
        return
    if values.dtype.kind == "f" and not (np.isfinite(values).all() and (values == np.floor(values)).all()
                                         and len(values) and values.min() < values.max()
                                         and np.abs(values).max() < 2**53):
        return  # a field
    found = np.unique(values)
    if len(found) > MOST or any(FEW < len(part) == len(np.unique(part)) for part in parts):
        return
    for value in found.tolist():
        yield f"{key}:{int(value)}", values == value
    if found.tolist() == [0, 1]:
        yield key, values == 1


def join_boundaries(mesh: meshio.Mesh) -> meshio.Mesh:
    """Where a boundary consists of facets and of nodes, make it one of nodes."""
    dims, body = _dimensions(mesh)
    for name in mesh.cell_sets.keys() & mesh.point_sets.keys():
        for i, (block, dim) in enumerate(zip(mesh.cells, dims)):
            index = mesh.cell_sets[name][i]
            if dim == body - 1 and index is not None and len(index):
                mesh.point_sets[name] = np.union1d(mesh.point_sets[name], block.data[index].ravel())
                mesh.cell_sets[name][i] = np.zeros(0, np.int64)
    return mesh


def _dimensions(mesh: meshio.Mesh) -> tuple[list[int], int]:
    """Dimensions of the blocks and of the body."""
    dims = [DIMENSION.get(block.type, 3) for block in mesh.cells]
    return dims, max((dim for dim, block in zip(dims, mesh.cells) if len(block.data)), default=0)
