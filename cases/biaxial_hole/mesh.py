"""Makes the meshes of the square plate with a round hole: `python cases/biaxial_hole/mesh.py`; needs gmsh."""

from __future__ import annotations

import math
from pathlib import Path

import meshio
import numpy as np

from skfsink.meshing.outline import Edge, SizeField, completed, mesh_outline
from skfsink.meshing.vtu import write_mesh

SIDE, RADIUS = 8.0, 0.5  # of the plate and of the hole, whose centre is the origin [mm]
TILT = math.radians(70)  # of the seam between the halves: neither a side nor a diagonal lies in it

#: meshes by name: element size within `FINE` of the centre, and far away [mm]
MESHES = {"plate": (0.05, 0.2), "coarse": (0.1, 0.5)}
FINE = 2.0  # [mm]


def plate(h: float, h_coarse: float, side: float = SIDE, radius: float = RADIUS, fine: float = FINE) -> meshio.Mesh:
    """The plate [-side/2, side/2]^2 with a hole in its middle; the right half is the left one turned half round."""
    half, ray = side / 2, np.array([math.cos(TILT), math.sin(TILT)])
    tip, rim = ray * half / ray[1], ray * radius

    def turned(points: np.ndarray) -> np.ndarray:
        return -points

    def distance(x: float, y: float) -> float:
        return max(0.0, math.hypot(x, y) - fine)

    outline = [Edge("seam", tuple(-rim)), Edge("hole", tuple(rim), via=(-radius * ray[1], radius * ray[0])),
               Edge("seam", tuple(tip)), Edge("top", (-half, half)), Edge("left", (-half, -half)),
               Edge("bottom", tuple(-tip))]
    part = mesh_outline(outline, SizeField(h, h_coarse, distance=distance), image=turned)
    return completed(part, "seam", turned, {"left": "right", "top": "bottom", "bottom": "top"})


if __name__ == "__main__":
    for name, (h, h_coarse) in MESHES.items():
        mesh = plate(h, h_coarse)
        write_mesh(Path(__file__).parent / "meshes" / f"{name}.vtu", mesh)
        print(f"{name}: {len(mesh.cells_dict['quad'])} elements")
