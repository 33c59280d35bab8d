"""Makes the meshes of the thick strip: `python cases/thick_strip/mesh.py`, or one of them by its name."""

from __future__ import annotations

import sys
from pathlib import Path

import meshio
import numpy as np

from skfsink.meshing.vtu import write_mesh

SIZE = 4.0, 2.5, 0.8  # length, height and thickness [mm]

#: meshes by name: size of the cubes [mm]
MESHES = {"coarse": 0.1, "fine": 0.05, "million": 0.02}


def strip(h: float) -> meshio.Mesh:
    """A box of cubes of size `h` about, with a row in the middle of its height; its corner is at the origin."""
    nx, ny, nz = round(SIZE[0] / h), 2 * round(SIZE[1] / h / 2 - 0.5) + 1, round(SIZE[2] / h)
    x, y, z = (np.linspace(0.0, size, n + 1) for size, n in zip(SIZE, (nx, ny, nz), strict=True))
    number = np.arange((nx + 1) * (ny + 1) * (nz + 1)).reshape(nz + 1, ny + 1, nx + 1)
    points = np.stack([axis.ravel() for axis in np.meshgrid(z, y, x, indexing="ij")][::-1], axis=-1)
    face = [(slice(None, -1), slice(None, -1)), (slice(None, -1), slice(1, None)),
            (slice(1, None), slice(1, None)), (slice(1, None), slice(None, -1))]
    below_above = slice(None, -1), slice(1, None)
    cells = np.stack([number[(layer, *corner)] for layer in below_above for corner in face], axis=-1)
    sets = {"bottom": number[:, 0].ravel(), "top": number[:, -1].ravel()}
    return meshio.Mesh(points, [("hexahedron", cells.reshape(-1, 8))], point_sets=sets)


if __name__ == "__main__":
    for name in sys.argv[1:] or ["coarse"]:
        mesh = strip(MESHES[name])
        write_mesh(Path(__file__).parent / "meshes" / f"{name}.vtu", mesh)
        print(f"{name}: {len(mesh.cells_dict['hexahedron'])} elements")
