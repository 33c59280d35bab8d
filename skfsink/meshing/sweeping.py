"""Hexahedral meshes from plane ones: a section swept through layers, and a swept plate rolled to a cylinder."""

from __future__ import annotations

from collections.abc import Callable

import meshio
import numpy as np

from ..errors import MeshError, require

__all__ = ["rolled", "swept", "unrolled"]

Map = Callable[[np.ndarray], np.ndarray]


def swept(section: meshio.Mesh, thickness: float, layers: int, place: Map | None = None) -> meshio.Mesh:
    """Hexahedra from the quadrilaterals of `section`, in `layers` of equal thickness over [0, `thickness`].

    The named lines of the section become named surfaces; the two new surfaces get the names `back` and `front`. Nodes
    of one place in the section are numbered one after the other, and so are elements. `place` maps the points
    (n, 3) to where they belong and must not turn the body inside out.

    Raises
    ------
    ParameterError
        `thickness` is not positive or `layers` no whole number of at least 1.
    MeshError
        The section has no quadrilaterals.
    """
    require("thickness", thickness, "mm", low=0, low_open=True)
    layers = int(require("layers", layers, low=1, high=100, whole=True))
    levels, step = layers + 1, np.arange(layers)[None, :, None]
    flat = section.points[:, None, :2]
    height = np.linspace(0, thickness, levels)[None, :, None]
    points = np.concatenate([np.broadcast_to(flat, (len(flat), levels, 2)),
                             np.broadcast_to(height, (len(flat), levels, 1))], axis=2).reshape(-1, 3)
    cells = section.cells_dict
    if "quad" not in cells:
        found = ", ".join(sorted(cells)) or "no cells"
        raise MeshError(f"a section to be swept must have quadrilaterals; it has {found}")
    quads, lines = cells["quad"] * levels, cells.get("line", np.zeros((0, 2), int)) * levels
    hexes = np.concatenate([quads[:, None] + step, quads[:, None] + step + 1], axis=2).reshape(-1, 8)
    walls = np.concatenate([lines[:, None] + step, (lines[:, None] + step + 1)[..., ::-1]], axis=2).reshape(-1, 4)
    faces = np.concatenate([walls, quads[:, ::-1], quads + layers])
    sets = {name: [np.zeros(0, int), (np.asarray(members[1])[:, None] * layers + np.arange(layers)).ravel()]
            for name, members in section.cell_sets.items()}
    for k, name in enumerate(("back", "front")):
        sets[name] = [np.zeros(0, int), len(walls) + k * len(quads) + np.arange(len(quads))]
    return meshio.Mesh(points if place is None else place(points), [("hexahedron", hexes), ("quad", faces)],
                       cell_sets=sets)


def rolled(inner_radius: float, thickness: float) -> Map:
    """Map from a plate to a half cylinder: x is the arc at mean radius, y the axis, z the distance from the inside.

    Points (n, 3) go to (r cos phi, r sin phi, y) with r = inner_radius + z and phi = x over the mean radius.
    """
    mean = inner_radius + thickness / 2

    def place(points: np.ndarray) -> np.ndarray:
        r, phi = inner_radius + points[:, 2], points[:, 0] / mean
        return np.column_stack([r * np.cos(phi), r * np.sin(phi), points[:, 1]])

    return place


def unrolled(inner_radius: float, thickness: float) -> Map:
    """Map from the half cylinder back to its section: points (n, 3) to x along the mean arc and y along the axis."""
    mean = inner_radius + thickness / 2

    def place(points: np.ndarray) -> np.ndarray:
        return np.column_stack([mean * np.arctan2(points[:, 1], points[:, 0]), points[:, 2]])

    return place
