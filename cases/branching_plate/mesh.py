"""Makes the mesh of the branching plate: `python cases/branching_plate/mesh.py`; needs gmsh."""

from __future__ import annotations

from pathlib import Path

from skfsink.meshing.vtu import write_mesh
from skfsink.study.validation_branching import plate_mesh
from skfsink.study.validation_glass import PER_LENGTH

LENGTH_SCALE = 1.0  # l [mm]

if __name__ == "__main__":
    mesh = plate_mesh(LENGTH_SCALE / PER_LENGTH)
    write_mesh(Path(__file__).parent / "meshes" / "plate.vtu", mesh)
    print(f"plate: {len(mesh.cells_dict['quad'])} elements")
