"""The part of a symmetric sample that symmetry leaves to compute, and what its figures say about the whole."""

from __future__ import annotations

from dataclasses import dataclass

import meshio
import numpy as np

from ..errors import MeshError

__all__ = ["Mirror", "Whole", "cut"]

NEAR = 1e-6  # of the size of the sample: nodes that are on a plane


@dataclass(frozen=True)
class Mirror:
    """A plane of symmetry of a sample, and the side of it that is kept.

    Parameters
    ----------
    axis: coordinate that it holds, 0 or 1, in the section and in the body; 1 is between the two grips.
    at: its value in the section [mm].
    along: whether cracks run along the plane: it is no edge they arrive at then.
    """

    axis: int
    at: float
    along: bool = False

    @property
    def between(self) -> bool:
        """Whether the plane is between the two grips, so that a half has only one of them."""
        return self.axis == 1

    @property
    def name(self) -> str:
        """Of the boundary on the plane."""
        return f"mirror-{'xy'[self.axis]}"


@dataclass(frozen=True)
class Whole:
    """Factors from the figures of what is computed to those of the whole sample, in its own unit, and its mirrors."""

    energy: float = 1.0
    load: float = 1.0
    displacement: float = 1.0
    mirrors: tuple[Mirror, ...] = ()

    @classmethod
    def of(cls, mirrors: tuple[Mirror, ...], thickness: float = 1.0) -> Whole:
        """Of a body cut along `mirrors` and computed in another thickness than it has by this factor."""
        parted = any(mirror.between for mirror in mirrors)
        copies = 2.0 ** len(mirrors)
        return cls(copies * thickness, copies * thickness / (2 if parted else 1), 2.0 if parted else 1.0,
                   mirrors)

    def places(self, points: np.ndarray) -> np.ndarray:
        """Points of the section (n, 2) [mm] with their mirror images."""
        for mirror in self.mirrors:
            image = points.copy()
            image[:, mirror.axis] = 2 * mirror.at - image[:, mirror.axis]
            points = np.concatenate([points, image])
        return points


def cut(mesh: meshio.Mesh, mirror: Mirror) -> meshio.Mesh:
    """The part of a plane mesh on one side of a mirror: below it along x, above it along y (where the first grip is).

    Its edges on the plane become the boundary named after the mirror.

    Raises
    ------
    MeshError
        An element lies across the plane, so that there is no half.
    """
    sign = -1.0 if mirror.axis == 0 else 1.0
    points = np.array(mesh.points, float)
    height = sign * (points[:, mirror.axis] - mirror.at)
    near = np.abs(height) <= NEAR * float(np.ptp(points[:, :2], axis=0).max())
    points[near, mirror.axis] = mirror.at
    quads, lines = mesh.cells_dict["quad"], mesh.cells_dict["line"]
    quads = quads[height[quads].mean(axis=1) > 0]
    across = int((~near[quads] & (height[quads] < 0)).any(axis=1).sum())
    if across:
        raise MeshError(f"{across} elements lie across {'xy'[mirror.axis]} = {mirror.at:g} mm, where the mesh should "
                        f"be cut in half: it needs a mesh with its nodes on that line")
    kept = np.zeros(len(points), bool)
    kept[quads] = True
    inside = kept[lines].all(axis=1) & ~near[lines].all(axis=1)
    edges = quads[:, [[0, 1], [1, 2], [2, 3], [3, 0]]].reshape(-1, 2)
    seam = edges[near[edges].all(axis=1)]
    number = np.full(len(points), -1)
    number[kept] = np.arange(int(kept.sum()))
    row = np.full(len(lines), -1)
    row[inside] = np.arange(int(inside.sum()))
    none = np.zeros(0, int)
    sets = {name: [none, row[np.asarray(members[1])]] for name, members in mesh.cell_sets.items()}
    sets = {name: [none, rows[rows >= 0]] for name, (_, rows) in sets.items()}
    sets[mirror.name] = [none, int(inside.sum()) + np.arange(len(seam))]
    return meshio.Mesh(points[kept], [("quad", number[quads]), ("line", number[np.concatenate([lines[inside], seam])])],
                       cell_sets={name: rows for name, rows in sets.items() if len(rows[1])})
