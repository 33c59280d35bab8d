"""Makes the meshes of the aneurysm: `python cases/aneurysm/mesh.py`."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np

from skfsink.meshing.vtu import write_mesh

NECK, SAC = 0.6, 1.0         # inner radii at the neck and in the middle [mm]
WALL, THINNEST = 0.2, 0.16   # thickness of the wall, and at its thinnest place, in the middle on the side z > 0 [mm]
HALF_LENGTH = 2.5            # from the middle, a plane of symmetry, to the neck [mm]
SPOT = 0.5                   # extent of the thin place [mm]

#: meshes by name: elements around, from the middle to the neck, through the media and through the adventitia
MESHES = {"coarse": (64, 24, 1, 1), "fine": (128, 48, 2, 2)}


def sac(around: int, along: int, media: int, adventitia: int) -> meshio.Mesh:
    """Half of the sac, x >= 0: a tube whose radius falls from the middle to the neck, with two layers equally thick."""
    layers = media + adventitia
    angle = np.arange(around) * 2 * np.pi / around
    x = np.linspace(0.0, HALF_LENGTH, along + 1)
    depth = np.concatenate([np.linspace(0.0, 0.5, media + 1), np.linspace(0.5, 1.0, adventitia + 1)[1:]])
    k, j, i = np.meshgrid(np.arange(layers + 1), np.arange(along + 1), np.arange(around), indexing="ij")
    inner = NECK + (SAC - NECK) * np.cos(np.pi / 2 * x[j] / HALF_LENGTH) ** 2
    way = np.hypot(SAC * np.angle(np.exp(1j * (angle[i] - np.pi / 2))), x[j])
    wall = WALL - (WALL - THINNEST) * np.exp(-((way / SPOT) ** 2))
    r = inner + depth[k] * wall
    points = np.stack([x[j], r * np.cos(angle[i]), r * np.sin(angle[i])], axis=-1).reshape(-1, 3)
    number = np.arange(points.shape[0]).reshape(layers + 1, along + 1, around)
    nxt = np.roll(number, -1, axis=2)
    cells = np.stack([number[:-1, :-1], number[1:, :-1], nxt[1:, :-1], nxt[:-1, :-1],
                      number[:-1, 1:], number[1:, 1:], nxt[1:, 1:], nxt[:-1, 1:]], axis=-1)
    layer = np.broadcast_to(np.arange(layers)[:, None, None], cells.shape[:3]).ravel()
    sets = {"inner": number[0], "outer": number[-1], "middle": number[:, 0], "neck": number[:, -1]}
    return meshio.Mesh(points, [("hexahedron", cells.reshape(-1, 8))],
                       point_sets={name: nodes.ravel() for name, nodes in sets.items()},
                       cell_sets={"adventitia": [np.flatnonzero(layer >= media)]})


def section(around: int, through: int) -> meshio.Mesh:
    """The section of the middle, in the plane of y and z of the sac, which are x and y here; all of its wall is 0.2 mm.

    "below" are the nodes through the wall at the bottom, "foot" is the outermost of them.
    """
    angle, r = np.arange(around) * 2 * np.pi / around - np.pi / 2, SAC + WALL * np.linspace(0.0, 1.0, through + 1)
    x, y = np.outer(r, np.cos(angle)), np.outer(r, np.sin(angle))
    points = np.stack([x, y, np.zeros_like(x)], axis=-1)
    number = np.arange((through + 1) * around).reshape(through + 1, around)
    nxt = np.roll(number, -1, axis=1)
    cells = np.stack([number[:-1], number[1:], nxt[1:], nxt[:-1]], axis=-1)
    sets = {"inner": number[0], "outer": number[-1], "below": number[:, 0], "foot": number[-1:, 0]}
    return meshio.Mesh(points.reshape(-1, 3), [("quad", cells.reshape(-1, 4))], point_sets=sets)


if __name__ == "__main__":
    for name, counts in MESHES.items():
        mesh = sac(*counts)
        write_mesh(Path(__file__).parent / "meshes" / f"{name}.vtu", mesh)
        print(f"{name}: {len(mesh.cells_dict['hexahedron'])} elements")
    mesh = section(217, 6)  # an odd number, so that elements lie across the top
    write_mesh(Path(__file__).parent / "meshes" / "section.vtu", mesh)
    print(f"section: {len(mesh.cells_dict['quad'])} elements")
