"""The two-pass mesh: a first pass on elements twice as large finds the path, a corridor of fine elements is laid along.

The corridor is as wide as the sink's reach asks for, some lengths l on both sides of what failed in the first pass. A
finer mesh may crack elsewhere: where branches leave the corridor the run says so.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt

from ..errors import MeshError, OutputError
from ..meshing.sample import shape_mesh
from ..meshing.vtu import write_mesh
from ..scene.arrange import laid_out
from ..scene.options import Options
from ..scene.scene import Scene
from ..scene.stored import CORRIDOR
from ..system.files import prepare_folder, replaced
from .display import Display
from .simulate import Simulation

__all__ = ["Corridor", "corridor_report", "first_pass", "lay_corridor"]

FIRST_PASS, PATH = "first-pass", "corridor.npz"
log = logging.getLogger(__name__)


class Corridor:
    """Where elements are fine: within `width` of the places that a first pass has found to fail.

    Parameters
    ----------
    places: in the section [mm], (n, 2).   length_scale: l [mm].

    Attributes
    ----------
    width: on each side [mm].   cell: to within which distances are known [mm].
    """

    WIDTH = 4.0     # lengths l on each side of what failed
    CELLS = 4       # cells of the map of distances in l
    MARGIN = 10.0   # lengths l that the map reaches beyond the places; farther off, its edge counts

    def __init__(self, places: np.ndarray, length_scale: float) -> None:
        self.places, self.length_scale = places, length_scale
        self.width = self.WIDTH * length_scale
        self.cell = length_scale / self.CELLS
        self._corner = places.min(axis=0) - self.MARGIN * length_scale
        shape = np.ceil((places.max(axis=0) + self.MARGIN * length_scale - self._corner) / self.cell).astype(int) + 1
        away = np.ones(shape, bool)
        away[tuple(((places - self._corner) / self.cell).astype(int).T)] = False
        self._map: list[list[float]] = (distance_transform_edt(away) * self.cell).tolist()
        self._size = shape.tolist()

    def __call__(self, x: float, y: float) -> float:
        """Distance of a point from the corridor [mm], to within a cell; 0 inside."""
        p, q = (x - self._corner[0]) / self.cell, (y - self._corner[1]) / self.cell
        i, j = min(max(int(p), 0), self._size[0] - 1), min(max(int(q), 0), self._size[1] - 1)
        beyond = self.cell * math.hypot(p - min(max(p, 0), self._size[0]), q - min(max(q, 0), self._size[1]))
        return max(0.0, self._map[i][j] + beyond - self.width)


def first_pass(scene: Scene, folder: Path, display: Display) -> tuple[np.ndarray, dict[str, Any]]:
    """Run `scene` in a folder without drawing; places that failed, in the section (n, 2) [mm], and what it cost.

    Raises
    ------
    MeshError
        Nothing failed.
    """
    prepare_folder(folder, overwrite=True)
    controls = replace(scene.controls, start="onset", stop="",
                       analysis="dynamic" if scene.controls.analysis == "both" else scene.controls.analysis)
    simulation = Simulation(replace(scene, controls=controls), folder, display)
    space = scene.sample.space
    display.say(f"first pass on {space.n_elements} elements")
    state = simulation.run()
    if not state.deleted.any():
        raise MeshError("the first pass found no crack, so there is no path to lay a corridor along: raise "
                        "event_time, or take mesh_layout = 'corridor'")
    wall = simulation.cost()["wall"]
    return (scene.flat(space.X[space.conn[state.deleted]].mean(axis=1)),
            {"elements": space.n_elements, "wall_s": wall["loading"] + wall["event"]})


def lay_corridor(scene: Scene, arguments: Mapping[str, Any], options: Options, folder: Path,
                 display: Display) -> Options:
    """Make the mesh of two passes in the folder of a run, and return the options with it.

    `scene` is that of the first pass, made from the `arguments` of the case function.

    Raises
    ------
    MeshError
        Nothing failed in the first pass, or gmsh made no mesh.
    """
    places, cost = first_pass(scene, folder / FIRST_PASS, display)
    start = time.perf_counter()
    corridor = Corridor(places, options.length_scale)
    mesh = shape_mesh(scene.case, arguments, laid_out(scene.case, arguments["mesh"], options, corridor))
    with replaced(folder / CORRIDOR) as part:
        write_mesh(part, mesh)
    with replaced(folder / PATH) as part, open(part, "wb") as file:
        np.savez_compressed(file, places=places, length_scale=options.length_scale, elements=cost["elements"],
                            wall_s=cost["wall_s"], mesh_s=time.perf_counter() - start)
    return replace(options, corridor=folder / CORRIDOR)


def corridor_report(simulation: Simulation, folder: Path) -> dict[str, Any]:
    """How much of the crack of a finished run is in the corridor in `folder`, and what that cost; for the summary.

    Where the crack has left the corridor it warns.

    Raises
    ------
    OutputError
        The folder holds no corridor.
    """
    try:
        with np.load(folder / PATH, allow_pickle=False) as stored:
            corridor = Corridor(stored["places"], float(stored["length_scale"]))
            cost = {name: round(float(stored[name]), 3) for name in ("wall_s", "mesh_s")}
            elements = int(stored["elements"])
    except (OSError, KeyError, ValueError) as error:
        raise OutputError(f"{folder / PATH} is missing or damaged: {error}") from None
    scene, state = simulation.scene, simulation.state
    space = scene.sample.space
    middle = scene.flat(space.X[space.conn[state.deleted]].mean(axis=1).reshape(-1, space.dim))
    outside = sum(corridor(x, y) > corridor.cell for x, y in middle.tolist())
    if outside:
        with simulation.notes:
            log.warning("the crack has left the corridor of the first pass: %d of %d elements failed outside of it, "
                        "where elements are larger; take mesh_layout = 'corridor'", outside, len(middle))
    return {"width_mm": corridor.width, "failed": len(middle), "failed_outside": outside,
            "first_pass": {"elements": elements, **cost}}
