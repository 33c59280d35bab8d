"""Makes the meshes of the strip with an edge cut: `python cases/pure_shear/mesh.py`; needs gmsh.

One strip is meshed; the others are the same with rows of elements added to its left edge or to its long edges. So all
have the same elements around the tip of the cut, and differ in the length of the cut or the height only.
"""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import meshio
import numpy as np

from skfsink.meshing.outline import Edge, SizeField, mesh_outline
from skfsink.meshing.vtu import write_mesh

LENGTH, HEIGHT, CUT = 10.0, 1.5, 2.0  # of the strip and of the cut [mm]
WIDTH = 0.1                          # of the cut, whose tip is round [mm]
TIP, FINE, COARSE = 0.02, 0.05, 0.15  # element sizes at the tip, where the crack runs (l/2), and elsewhere [mm]
CORRIDOR, GRADING = 0.55, 0.15        # distance from mid-height with elements of size `FINE` [mm]

#: strips by name: what is added to the cut, and to the height [mm]
STRIPS = {"cut2": (0.0, 0.0), "cut3": (1.0, 0.0), "cut4": (2.0, 0.0), "tall": (0.0, 0.75)}


def strip() -> meshio.Mesh:
    """The strip [0, LENGTH] x [0, HEIGHT] with a cut from the left edge at mid-height."""
    middle, r = HEIGHT / 2, WIDTH / 2

    def distance(x: float, y: float) -> float:
        tip = max(0.0, math.hypot(x - CUT, y - middle) - 0.15)
        away = max(0.0, CUT - 0.2 - x, abs(y - middle) - CORRIDOR)
        return min(tip, (FINE - TIP) / GRADING) + away

    outline = [Edge("bottom", (LENGTH, 0)), Edge("right", (LENGTH, HEIGHT)), Edge("top", (0, HEIGHT)),
               Edge("left", (0, middle + r)), Edge("cut", (CUT - r, middle + r)),
               Edge("cut", (CUT - r, middle - r), via=(CUT, middle)), Edge("cut", (0, middle - r)),
               Edge("left", (0, 0))]
    return mesh_outline(outline, SizeField(TIP, COARSE, grading=GRADING, distance=distance))


def grown(mesh: meshio.Mesh, at: np.ndarray, step: tuple[float, float], rows: int) -> meshio.Mesh:
    """The quadrilaterals of the mesh, and `rows` more on its boundary edges between the nodes `at`, a `step` each."""
    points, quads = mesh.points[:, :2], mesh.cells_dict["quad"]
    edges = quads[:, [[0, 1], [1, 2], [2, 3], [3, 0]]].reshape(-1, 2)
    edges = edges[np.isin(edges, at).all(axis=1)]
    nodes, ends = np.unique(edges, return_inverse=True)
    ends = ends.reshape(-1, 2)
    layers = [nodes, *(len(points) + k * len(nodes) + np.arange(len(nodes)) for k in range(rows))]
    points = np.concatenate([points, *(points[nodes] + (k + 1) * np.array(step) for k in range(rows))])
    added = [np.column_stack([inner[ends[:, ::-1]], outer[ends]]) for inner, outer in pairwise(layers)]
    return meshio.Mesh(np.column_stack([points, np.zeros(len(points))]), [("quad", np.concatenate([quads, *added]))])


def variant(base: meshio.Mesh, cut: float, height: float) -> meshio.Mesh:
    """The strip with a longer cut, or higher, and with its corner at the origin."""
    tip = np.unique(base.cells_dict["line"][base.cell_sets["cut"][1]])
    tip = tip[base.points[tip, 0] > CUT - WIDTH]  # the boundary "cut" is that of the tip: the flanks have no use
    mesh = base
    for end, axis, more in ((0.0, 0, -cut), (0.0, 1, -height / 2), (HEIGHT, 1, height / 2)):
        rows = round(abs(more) / COARSE)
        if rows:
            at = np.flatnonzero(np.abs(mesh.points[:, axis] - end) < 1e-9)
            mesh = grown(mesh, at, (more / rows, 0.0) if axis == 0 else (0.0, more / rows), rows)
    points = mesh.points - mesh.points.min(axis=0)
    line = base.cells_dict["line"]
    line = line[np.isin(line, tip).all(axis=1)]
    return meshio.Mesh(points, [("quad", mesh.cells_dict["quad"]), ("line", line)],
                       cell_sets={"cut": [np.zeros(0, int), np.arange(len(line))]})


if __name__ == "__main__":
    base = strip()
    for name, (cut, height) in STRIPS.items():
        mesh = variant(base, cut, height)
        write_mesh(Path(__file__).parent / "meshes" / f"{name}.vtu", mesh)
        print(f"{name}: {len(mesh.cells_dict['quad'])} elements")
