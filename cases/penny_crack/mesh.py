"""Makes the meshes of the cylinder with a penny-shaped crack: `python cases/penny_crack/mesh.py`."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np

from skfsink.meshing.vtu import write_mesh

RADIUS, HEIGHT = 2.0, 4.0    # of the cylinder [mm]; its axis is y, its middle y = 0
BAND = 0.6                   # half height of what is fine [mm]
GROWTH = 1.15                # of the rows of elements above and below

#: meshes by name: elements from the axis to the side
MESHES = {"coarse": 30, "fine": 60}


def cylinder(across: int) -> meshio.Mesh:
    """The half plane of the cylinder: squares around the middle plane, in which a row of elements lies."""
    h = RADIUS / across
    rows = 2 * round(BAND / h - 0.5) + 1
    steps = [h * GROWTH]
    while sum(steps) < HEIGHT / 2 - rows * h / 2:
        steps.append(steps[-1] * GROWTH)
    above = rows * h / 2 + np.cumsum(steps) * (HEIGHT / 2 - rows * h / 2) / sum(steps)
    y = np.concatenate([-above[::-1], np.linspace(-rows * h / 2, rows * h / 2, rows + 1), above])
    x = np.linspace(0.0, RADIUS, across + 1)
    number = np.arange(y.size * x.size).reshape(y.size, x.size)
    points = np.stack([*np.meshgrid(x, y), np.zeros(number.shape)], axis=-1).reshape(-1, 3)
    cells = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1)
    sets = {"bottom": number[0], "top": number[-1], "side": number[:, -1]}
    return meshio.Mesh(points, [("quad", cells.reshape(-1, 4))], point_sets=sets)


if __name__ == "__main__":
    for name, across in MESHES.items():
        mesh = cylinder(across)
        write_mesh(Path(__file__).parent / "meshes" / f"{name}.vtu", mesh)
        print(f"{name}: {len(mesh.cells_dict['quad'])} elements")
