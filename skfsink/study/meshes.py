"""The small plates of the studies, 2 x 2 mm with a notch of 0.5 mm: `python -m skfsink.study.meshes` makes them.

`plate` is unstructured, `tip` is like it but for rings of small elements around the tip, `half` is the lower half of a
plate with the symmetry line as its boundary `seam`, and `slit` is such a half whose notch has no width. A number is the
seed of another mesh of the same sizes, `fine` has elements of l/4 instead of l/2.
They are committed in `cases/study/meshes`; making them needs gmsh.
"""

from __future__ import annotations

import math
from pathlib import Path

import meshio
import numpy as np

from ..meshing.outline import Edge, SizeField, completed, mesh_outline
from ..meshing.sample import Sample, load_sample
from ..meshing.shapes import single_edge_notch_mesh
from ..meshing.sweeping import swept
from ..meshing.vtu import write_mesh

__all__ = ["NOTCH", "SIDE", "half_plate_mesh", "load_plate", "refined"]

SIDE, NOTCH, WIDTH = 2.0, 0.5, 0.1  # of the plates [mm]


def half_plate_mesh(*, notch_width: float = WIDTH, h: float = 0.05, seed: int = 0) -> meshio.Mesh:
    """Lower half of the plate with a notch of this width, 0 for a slit; `seam` is the symmetry line ahead of it."""
    middle, r = SIDE / 2, notch_width / 2
    outline = [Edge("bottom", (SIDE, 0)), Edge("right", (SIDE, middle)), Edge("seam", (NOTCH, middle))]
    if r > 0:
        s = r * math.sqrt(0.5)
        outline.append(Edge("notch", (NOTCH - r, middle - r), via=(NOTCH - r + s, middle - s)))
    outline += [Edge("notch", (0, middle - r)), Edge("left", (0, 0))]
    return mesh_outline(outline, SizeField(h, 0.11, ((NOTCH - 0.15, SIDE, middle - 0.5, middle),)), seed=seed)


def load_plate(name: str, mirrored: bool = False, slab: tuple[float, int] | None = None) -> Sample:
    """One of the committed plates by name.

    `mirrored` completes a half with its image; `slab` is the thickness [mm] and the number of layers of hexahedra.
    """
    def lift(mesh: meshio.Mesh) -> meshio.Mesh:
        if mirrored:
            mesh = completed(mesh, "seam", lambda p: p * (1, -1) + (0, SIDE), {"bottom": "top"})
        return mesh if slab is None else swept(mesh, *slab)

    return load_sample("study", name, lift=lift)


def refined(mesh: meshio.Mesh, centre: tuple[float, float] | None = None) -> meshio.Mesh:
    """Each quadrilateral divided into four, each line into two; boundaries keep their names.

    Nodes on the rounding of the notch, half a circle around `centre` open to the left, are put on that circle.
    """
    quads, lines, points = mesh.cells_dict["quad"], mesh.cells_dict["line"], mesh.points
    sides = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=2), axis=2).reshape(-1, 2)
    edges, number = np.unique(sides, axis=0, return_inverse=True)
    n = len(points)
    middle = n + number.reshape(-1, 4)
    inside = n + len(edges) + np.arange(len(quads))
    points = np.concatenate([points, points[edges].mean(axis=1), points[quads].mean(axis=1)])
    quarters = np.stack([np.stack([quads[:, k], middle[:, k], inside, middle[:, k - 1]], axis=1) for k in range(4)],
                        axis=1)
    place = {(int(a), int(b)): n + k for k, (a, b) in enumerate(edges)}
    halves = np.array([[(a, place[min(a, b), max(a, b)]), (place[min(a, b), max(a, b)], b)] for a, b in lines.tolist()])
    sets = {name: [np.zeros(0, int), np.concatenate([2 * np.asarray(m[1]), 2 * np.asarray(m[1]) + 1])]
            for name, m in mesh.cell_sets.items()}
    if centre is not None:
        nodes = np.unique(halves.reshape(-1, 2)[sets["notch"][1]])
        arc = nodes[points[nodes, 0] > centre[0] - 1e-9]
        away = points[arc, :2] - centre
        distance = np.linalg.norm(away, axis=1, keepdims=True)
        points[arc, :2] = centre + distance.max() * away / distance
    return meshio.Mesh(points, [("quad", quarters.reshape(-1, 4)), ("line", halves.reshape(-1, 2))], cell_sets=sets)


def main() -> None:
    """Make the meshes and write them to `cases/study/meshes` of the checkout."""
    folder = Path(__file__).resolve().parents[2] / "cases" / "study" / "meshes"
    folder.mkdir(parents=True, exist_ok=True)
    made = {}
    for seed in range(3):
        for name, h_tip in (("plate", 0.0), ("tip", None)):
            made[f"{name}{seed}"] = single_edge_notch_mesh(side=SIDE, notch=NOTCH, h=0.05, h_tip=h_tip, half_height=0.5,
                                                           seed=seed)
        made[f"half{seed}"] = half_plate_mesh(seed=seed)
        made[f"slit{seed}"] = half_plate_mesh(notch_width=0.0, seed=seed)
    made["half_fine"] = half_plate_mesh(h=0.025)
    made["slit_fine"] = half_plate_mesh(notch_width=0.0, h=0.025)
    for name, mesh in made.items():
        write_mesh(folder / f"{name}.vtu", mesh)
        print(f"{name}: {len(mesh.cells_dict['quad'])} elements")


if __name__ == "__main__":
    main()
