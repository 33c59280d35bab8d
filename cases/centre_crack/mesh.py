"""Makes the mesh of the wide strip with a central crack: `python cases/centre_crack/mesh.py`; needs gmsh."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np

from skfsink.meshing.outline import Edge, SizeField, completed, mesh_outline
from skfsink.meshing.vtu import write_mesh

LENGTH, HEIGHT, WIDTH = 10.0, 3.0, 0.1  # of the strip; width of the crack with its round tips [mm]

SIZE, COARSE = 0.05, 0.15  # of elements where the cracks run (l/2), and far away [mm]

#: meshes by name: length of the crack, and distance from mid-height with fine elements [mm]
MESHES = {"strip": (2.0, 0.9), "short": (0.4, 1.2)}


def strip(crack: float, fine: float) -> meshio.Mesh:
    """The strip around the origin with a crack of that length in its middle, fine within `fine` of mid-height.

    The right half is the mirror image of the left one.
    """
    end, top, r, tip = LENGTH / 2, HEIGHT / 2, WIDTH / 2, crack / 2
    outline = [Edge("bottom", (0, -top)), Edge("seam", (0, -r)), Edge("crack", (r - tip, -r)),
               Edge("crack", (r - tip, r), via=(-tip, 0)), Edge("crack", (0, r)), Edge("seam", (0, top)),
               Edge("top", (-end, top)), Edge("left", (-end, -top))]
    corridor = (-end, 0.2 - tip, -fine, fine)

    def mirrored(points: np.ndarray) -> np.ndarray:
        return points * (-1, 1)

    half = mesh_outline(outline, SizeField(SIZE, COARSE, (corridor,)))
    return completed(half, "seam", mirrored, {"left": "right"})


if __name__ == "__main__":
    for name, (crack, fine) in MESHES.items():
        mesh = strip(crack, fine)
        write_mesh(Path(__file__).parent / "meshes" / f"{name}.vtu", mesh)
        print(f"{name}: {len(mesh.cells_dict['quad'])} elements")
