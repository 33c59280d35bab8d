"""When a notched plate begins to fail, against the elements at the tip of its notch.

`python -m skfsink.study.notch` writes `notch.json`, `notch.md` and a picture, and goes on where it was stopped; it
needs gmsh. A plate of 2 x 2 mm with a round-tipped notch of 0.5 mm is pulled apart until it begins to fail, on meshes
that differ at the tip alone: unstructured, or with rings of elements around it (:mod:`skfsink.meshing.ring`).
"""

# ruff: noqa: E402

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import meshio
import numpy as np
from cyclopts import Parameter

from ..material import SinkLaw, limiter_of, material_from
from ..meshing.outline import Edge, SizeField, mesh_outline
from ..meshing.sample import Sample, mesh_sample
from ..run.display import Display
from .chart import page
from .part import Part, Planned, Points
from .plate import Plate
from .rates import extrapolated
from .speed_accuracy import run_parts
from .store import Store

__all__ = ["Tip", "notch", "plate_mesh"]

SIDE, NOTCH = 2.0, 0.5  # of the plate [mm]
L = 0.1                 # length scale of the sink [mm]
H, H_COARSE = L / 3, 0.11
GRADING = 0.15
FIRST = 0.5 - 0.5 / math.sqrt(3)  # of the thickness of an element: the Gauss point that is nearest to the surface
SEEDS = range(5)
FLAG = Parameter(negative="", show_default=False)


@dataclass(frozen=True)
class Tip:
    """A notch and the elements at its tip.

    Parameters
    ----------
    per_length: elements along the tip in a length scale l.   aspect: their length over their thickness in rings; 0 for
    an unstructured mesh.
    radius: of the tip [mm].   law: the material.   seed: of the mesh.
    """

    per_length: float
    aspect: float = 0.0
    radius: float = 0.05
    law: str = "aaa"
    seed: int = 0

    @property
    def key(self) -> str:
        """Law, radius, kind of mesh, size and seed."""
        kind = f"rings {self.aspect:g}" if self.aspect else "unstructured"
        return f"{self.law}/{self.radius:g}/{kind}/{self.per_length:g}/{self.seed}"

    def __call__(self) -> dict[str, Any]:
        """The opening at the onset [mm], and what :func:`measured` says of the elements at the tip."""
        sample = mesh_sample(self.key, plate_mesh(self))
        plate = Plate(sample, material=material_from(self.law), law=SinkLaw(phi=limiter_of(self.law).phi))
        state = plate.onset
        weakest = int(np.argmax(state.W_max.max(axis=1)))
        return {"opening_mm": plate.onset_figures["opening_mm"], "elements": sample.space.n_elements,
                **measured(sample, self.radius, weakest)}


def plate_mesh(tip: Tip) -> meshio.Mesh:
    """The plate with elements of l/3 in a corridor ahead of the notch, but for its tip."""
    r, middle, size = tip.radius, SIDE / 2, L / tip.per_length
    corridor = SizeField(max(H, size) if not tip.aspect else H, H_COARSE,
                         ((NOTCH - 3 * r, SIDE, middle - 0.35, middle + 0.35),), grading=GRADING)
    outline = [Edge("bottom", (SIDE, 0)), Edge("right", (SIDE, SIDE)), Edge("top", (0, SIDE)),
               Edge("left", (0, middle + r)), Edge("notch", (NOTCH - r, middle + r)),
               Edge("notch", (NOTCH - r, middle - r), via=(NOTCH, middle)), Edge("notch", (0, middle - r)),
               Edge("left", (0, 0))]
    if tip.aspect:
        outline[5] = outline[5]._replace(h=size, aspect=tip.aspect)
    least = H if tip.aspect else size

    def beyond(x: float, y: float) -> float:
        """How far a point is from elements of the least size, as far as the corridor allows [mm]."""
        away = math.inf if tip.aspect else max(0.0, math.hypot(x - NOTCH + r, y - middle) - 2 * r)
        return min(away, (corridor(x, y) - least) / GRADING)

    return mesh_outline(outline, SizeField(least, H_COARSE, grading=GRADING, distance=beyond), seed=tip.seed)


def measured(sample: Sample, radius: float, weakest: int) -> dict[str, float]:
    """Elements on the tip within 45 degrees of its crown: number in a radius, and mean thickness over the radius.

    Also the direction of the element `weakest` from the centre of the tip [degrees], and its thickness over the radius.
    """
    space = sample.space
    facets = space.mesh.boundary_facets()
    ends = space.mesh.facets[:, facets]
    from_centre = space.X[ends] - (NOTCH - radius, SIDE / 2)  # (2, nf, 2)
    on = (np.abs(np.hypot(*from_centre.transpose(2, 0, 1)) - radius) < 1e-6).all(axis=0)
    middle = from_centre.mean(axis=0)
    on &= np.abs(np.arctan2(middle[:, 1], middle[:, 0])) < math.pi / 4
    lengths = np.linalg.norm(from_centre[1] - from_centre[0], axis=1)
    element = space.mesh.f2t[0, facets]
    thickness = space.V[element] / lengths
    x, y = space.X[space.conn[weakest]].mean(axis=0) - (NOTCH - radius, SIDE / 2)
    mine = element == weakest
    return {"per_radius": float(radius / lengths[on].mean()), "thickness": float(thickness[on].mean() / radius),
            "direction": math.degrees(math.atan2(y, x)),
            "weakest": float(thickness[mine].mean() / radius) if mine.any() else math.nan}


# --- the plan ---
UNSTRUCTURED = (1.5, 3, 4, 6, 8, 12, 16, 24)  # elements in l
RINGS = (6, 8, 12, 16, 24)
OTHERS = {("aaa", 0.1): (3, 6, 12), ("aaa", 0.025): (6, 12, 24), ("gent", 0.05): (3, 6, 12)}


def tips(quick: bool) -> list[Tip]:
    """All notches and meshes; if quick, some of one seed."""
    if quick:
        return [*(Tip(n) for n in (3, 6)), *(Tip(n, 4.0) for n in (6, 8, 12))]
    found = [Tip(n, aspect) for aspect in (4.0, 1.0, 8.0, 2.0) for n in RINGS
             if aspect in (1.0, 4.0) or n in (6, 12, 24)]
    found += [Tip(n, seed=seed) for seed in SEEDS for n in UNSTRUCTURED]
    for (law, radius), sizes in OTHERS.items():
        found += [Tip(2 * n, aspect, radius, law) for aspect in (4.0, 1.0) for n in sizes]
        found += [Tip(n, 0.0, radius, law, seed) for n in sizes for seed in SEEDS[:3]]
    found += [Tip(n, 4.0, seed=seed) for seed in SEEDS[1:3] for n in (6, 12, 24)]
    return found


def plan(quick: bool) -> list[Planned]:
    """A point a notch and mesh."""
    return [Planned(tip.key, tip, 5.0) for tip in tips(quick)]
