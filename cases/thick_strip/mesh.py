"""Makes the meshes of the thick strip: `python cases/thick_strip/mesh.py`, or one of them by its name."""

from __future__ import annotations

import sys
from pathlib import Path

import meshio
import numpy as np

import skfsink as sk

SIZE = 4.0, 2.5, 0.8  # length, height and thickness [mm]

#: meshes by name: size of the cubes [mm]
MESHES = {"coarse": 0.1, "fine": 0.05, "million": 0.02}


def strip(h: float) -> meshio.Mesh:
    """A box of cubes of size `h` about, with a row in the middle of its height; its corner is at the origin."""
    counts = round(SIZE[0] / h), 2 * round(SIZE[1] / h / 2 - 0.5) + 1, round(SIZE[2] / h)
    return sk.grid_mesh(*(np.linspace(0.0, size, n + 1) for size, n in zip(SIZE, counts, strict=True)))


if __name__ == "__main__":
    for name in sys.argv[1:] or ["coarse"]:
        mesh = strip(MESHES[name])
        sk.write_mesh(Path(__file__).parent / "meshes" / f"{name}.vtu", mesh)
        print(f"{name}: {len(mesh.cells_dict['hexahedron'])} elements")
