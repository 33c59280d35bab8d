"""A crack in glass: plates with a slit, and the energy that a crack takes in a strip, which sets the limiter Phi.

Glass is a neo-Hookean law with E = 32 GPa, nu = 0.2 and G_c = 3 J/m^2, those of the branching plate
(:mod:`.validation_branching`). A strip with the elements of a body is pulled apart slowly until its crack runs; what
the crack takes, G = W H over psi_f l, is that of the body too, and Phi follows from it.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import meshio
import numpy as np

from ..errors import ConvergenceError
from ..loads.grips import Grip, Ramp
from ..material import NeoHookean, SinkLaw
from ..meshing.cracks import crack_of_elements
from ..meshing.outline import Edge, SizeField, completed, mesh_outline
from ..meshing.sample import Sample, mesh_sample
from ..results.history import History, Table
from ..run.display import Display
from ..run.simulate import Simulation
from ..scene.controls import Controls
from ..scene.scene import Scene
from .plate import first_passages

__all__ = ["BROKEN", "GLASS", "PER_LENGTH", "POISSON", "SEEDS", "TOUGHNESS", "YOUNG", "Strip", "computed",
           "cracked_mesh", "event_of", "limiter", "strip_of", "tip_elements", "toughness"]

YOUNG, POISSON = 32000.0, 0.2  # [MPa]
GLASS = NeoHookean(mu=YOUNG / (2 * (1 + POISSON)), bulk_modulus=YOUNG / (3 * (1 - 2 * POISSON)), density=2450.0)
TOUGHNESS = 3e-3               # G_c [N/mm]
BROKEN = 4.0                   # of the slit, from its tip, that is a crack which has run, in l
PER_LENGTH = 3                 # elements in l
SEEDS = range(3)               # of the meshes of the strip
STRIP_TIME = 100e-6            # in which a strip with l = 0.5 mm is loaded [s], from this share of its stretch on
STRIP_FIRST = 0.35
STRIP_MOST = 1.3               # times psi_f l that W H is then


def cracked_mesh(length: float, height: float, cut: float, h: float, fine: float, seed: int = 0,
                 holds: bool = False) -> meshio.Mesh:
    """Plate with a slit of no width from the middle of its left edge; needs gmsh.

    Elements are of size `h` ahead of the slit, within `fine` of mid-height. The upper half is the mirror image of the
    lower one. With `holds`, `waist` and `waist above` are a short piece of the long edges at mid-length, and `foot` is
    the middle of the right edge: a body under tractions must be held somewhere.
    """
    middle, at, piece = height / 2, length / 2, height / 40
    outline = [Edge("bottom", (length, 0)), Edge("right", (length, middle)), Edge("seam", (cut, middle)),
               Edge("slit", (0, middle)), Edge("left", (0, 0))]
    if holds:
        outline[:2] = [Edge("bottom", (at - piece, 0)), Edge("waist", (at + piece, 0)), Edge("bottom", (length, 0)),
                       Edge("right", (length, middle - piece)), Edge("foot", (length, middle))]
    corridor = (cut - 12 * h, length, middle - fine, middle)
    half = mesh_outline(outline, SizeField(h, 12 * h, (corridor,)), seed=seed)
    return completed(half, "seam", lambda points: points * (1, -1) + (0, height),
                     {"bottom": "top"} | ({"waist": "waist above"} if holds else {}))


def tip_elements(sample: Sample, cut: float, back: float) -> np.ndarray:
    """Elements at the last `back` [mm] of the slit, which are broken: the crack has come that way."""
    nodes, X = sample.nodes("slit"), sample.space.X
    nodes = nodes[(X[nodes, 0] < cut - 1e-9) & (X[nodes, 0] > cut - back)]
    return np.flatnonzero(np.isin(sample.space.conn, nodes).any(axis=1))


def computed(scene: Scene) -> tuple[Table, Simulation]:
    """The history of a scene, and its run."""
    with tempfile.TemporaryDirectory() as folder, Display(quiet=True) as display:
        simulation = Simulation(scene, Path(folder), display)
        simulation.run()
        rows = History.load(Path(folder) / "history.csv")
    return rows, simulation


def event_of(rows: Table) -> dict[str, np.ndarray]:
    """Course of the event: time [s], way of the leading tip, D, energies, each an array."""
    event = rows["phase"] == "event"
    found = {short: rows[name][event] for short, name in
             {"time": "time_s", "x": "tip_x_mm", "stored": "sink_stored_N_mm_per_mm",
              "moving": "sink_kinetic_N_mm_per_mm", "elastic": "elastic_N_mm_per_mm",
              "kinetic": "kinetic_N_mm_per_mm"}.items()}
    return found | {"D": found["stored"] + found["moving"]}


@dataclass(frozen=True)
class Strip:
    """A clamped strip of 20 l with a crack that has run, pulled apart slowly until the crack runs on.

    Parameters
    ----------
    per_length: elements in l; the strip is the same in lengths l, whatever l is.
    seed: of the mesh.
    """

    per_length: int = PER_LENGTH
    seed: int = 0

    def __call__(self) -> dict[str, Any]:
        """W H when the tip has gone l, over psi_f l; D per length and speed on the way from 2 l to 16 l.

        Raises
        ------
        ConvergenceError
            It has not run that far.
        """
        l, phi = 0.5, 0.01
        height, length, cut = 20 * l, 60 * l, 20 * l
        sample = mesh_sample("strip", cracked_mesh(length, height, cut, l / self.per_length, 4 * l, self.seed))
        law = SinkLaw(phi=phi, length_scale=l)
        band = law.failure_energy * l
        stiffness = GLASS.bulk_modulus + 4 / 3 * GLASS.shear_modulus
        way = height * np.sqrt(2 * STRIP_MOST * band / (height * stiffness)) / 2
        pulled, back = (Ramp((0.0, 1.0, 1.0 + STRIP_TIME), (0.0, sign * STRIP_FIRST * way, sign * way))
                        for sign in (1, -1))
        crack = crack_of_elements(sample.space, "crack", tip_elements(sample, cut, BROKEN * l), "broken")
        grips = (Grip("top", (0.0, pulled)), Grip("bottom", (0.0, back)))
        scene = Scene("study", "strip", {}, sample, GLASS, law, grips, cracks=(crack,), event_at=1.0,
                      controls=Controls(event_time=STRIP_TIME, record_every=5e-7, frame_every=STRIP_TIME,
                                        checkpoint_every=600.0, aftermath=1e-6))
        event = event_of(computed(scene)[0])
        gone = np.fmax.accumulate(np.nan_to_num(event["x"] - cut, nan=0.0))
        marks = np.array([l, 2 * l, 16 * l])
        if gone[-1] < marks[-1]:
            raise ConvergenceError(f"the crack has run {gone[-1]:.2f} mm of {marks[-1]:g} mm")
        started, first, last = first_passages(event["time"], gone, marks)
        at_first, at_last = (np.interp((first, last), event["time"], event["D"]))
        share = STRIP_FIRST + (1 - STRIP_FIRST) * started / STRIP_TIME
        lifted = np.diag([1.0, 1.0 + 2 * way * share / height, 1.0])
        return {"per_length": self.per_length, "elements": sample.space.n_elements,
                "G_over_band": float(GLASS.energy(lifted)) * height / band,
                "D_over_band": float(at_last - at_first) / (14 * l) / band,
                "speed_over_rayleigh": 14 * l / (last - first) * 1e-3 / GLASS.rayleigh_wave_speed}


@cache
def strip_of(per_length: int, seed: int) -> dict[str, Any]:
    """What a strip says, computed once."""
    return Strip(per_length, seed)()


def toughness(per_length: int) -> float:
    """G at which a crack runs, over psi_f l, with that many elements in l: the mean of strips on several meshes."""
    return float(np.mean([strip_of(per_length, seed)["G_over_band"] for seed in SEEDS]))


def limiter(l: float, per_length: int = PER_LENGTH) -> float:
    """The limiter Phi [MPa] with which a crack in glass takes G_c, for a length l [mm] with so many elements in it."""
    return TOUGHNESS / toughness(per_length) / (SinkLaw(phi=1.0).failure_energy * l)
