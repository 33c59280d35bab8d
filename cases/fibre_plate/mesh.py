"""Makes the mesh of the plate with fibres: `python cases/fibre_plate/mesh.py`; needs gmsh.

It is the single-edge notched plate of the paper at half its size, with elements of l/1.5 all over: the tear may turn.
"""

from __future__ import annotations

from pathlib import Path

from skfsink.meshing.shapes import SHAPES
from skfsink.meshing.vtu import write_mesh

SIDE, NOTCH, FINE = 2.0, 0.5, 0.1 / 1.5  # of the plate, of its notch, of elements [mm]

if __name__ == "__main__":
    folder = Path(__file__).parent / "meshes"
    folder.mkdir(exist_ok=True)
    write_mesh(folder / "coarse.vtu", SHAPES["single_edge_notch"].make(side=SIDE, notch=NOTCH, h=FINE, h_coarse=FINE))
