"""Regular meshes from the coordinates of their lines: rectangles and boxes, and what a map makes of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import meshio
import numpy as np

from ..errors import MeshError

__all__ = ["grid_mesh"]


def grid_mesh(x: Sequence[float] | np.ndarray, y: Sequence[float] | np.ndarray,
              z: Sequence[float] | np.ndarray | None = None, *,
              place: Callable[[np.ndarray], np.ndarray] | None = None) -> meshio.Mesh:
    """Quadrilaterals between lines x and y, or hexahedra with z as well; :func:`.write_mesh` writes them to a file.

    Rows of equal elements steer a crack: where its path matters take :func:`.mesh_outline`. Nodes that `place` brings
    to one place, as those of a ring, become one by `merge_nodes` of a custom scene.

    Parameters
    ----------
    x, y, z: coordinates of the lines [mm], ascending, at least two each.
    place: maps the points (n, 3) to where they belong, and must not turn the body inside out.

    Raises
    ------
    MeshError
        Coordinates are no ascending numbers.
    """
    axes = [np.asarray(axis, float) for axis in ((x, y) if z is None else (x, y, z))]
    for name, axis in zip("xyz", axes):
        if axis.ndim != 1 or len(axis) < 2 or not (np.diff(axis) > 0).all():
            raise MeshError(f"a grid needs at least two ascending coordinates {name}; got {axis.tolist()!r:.80}")
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))
    points = np.column_stack([points, np.zeros((len(points), 3 - len(axes)))])
    number = np.arange(len(points)).reshape([len(axis) for axis in axes])
    flat = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    if z is None:
        cells = [("quad", np.stack(flat, axis=-1).reshape(-1, 4))]
    else:
        corners = [corner[..., k] for k in (slice(None, -1), slice(1, None)) for corner in flat]
        cells = [("hexahedron", np.stack(corners, axis=-1).reshape(-1, 8))]
    return meshio.Mesh(points if place is None else place(points), cells)
