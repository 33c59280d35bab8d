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

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import meshio
import numpy as np
from cyclopts import Parameter

from ..meshing.outline import Edge, SizeField, mesh_outline
from ..meshing.sample import Sample, mesh_sample
from .chart import page
from .part import Part, Planned, Points
from .plate import Plate
from .speed_accuracy import measure

__all__ = ["ONSET", "Tip", "notch", "plate_mesh"]

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
        plate = Plate.of_law(sample, self.law)
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
        found += [Tip(n, 0.0, radius, law, seed) for n in sizes
                  for seed in SEEDS[:2 if law == "aaa" else 1]]
    return found


def plan(quick: bool) -> list[Planned]:
    """A point a notch and mesh."""
    return [Planned(tip.key, tip, 5.0) for tip in tips(quick)]


# --- what comes out ---
NEAR = 0.1  # thickness over radius below which openings are taken to be linear in it


def reference(points: Sequence[dict[str, Any]]) -> float:
    """Opening at the onset for elements of no thickness [mm]: where a straight line through those that have less than
    `NEAR` of the radius begins, of meshes with rings."""
    near = [p for p in points if p["rings"] and p["thickness"] < NEAR]
    thickness, opening = np.array([(p["thickness"], p["opening_mm"]) for p in near]).T
    return float(np.polyfit(thickness, opening, 1)[1])


def delays(points: Points) -> dict[tuple[str, str], list[dict[str, Any]]]:
    """The points of each law and radius, with their `kind` of mesh, `size`, `rings`, and `late`: the delay over the
    :func:`reference` of their law and radius."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for key, point in points.items():
        law, radius, kind, size, _ = key.split("/")
        if "failed" not in point:
            groups.setdefault((law, radius), []).append({**point, "kind": kind, "size": size, "rings": "rings" in kind})
    for group in groups.values():
        true = reference(group)
        for point in group:
            point["late"] = point["opening_mm"] / true - 1
    return groups


def curve(points: Points) -> tuple[float, float, float]:
    """Delay over the thickness of the elements, as a share of the radius, of all meshes with rings: its mean, the
    factor within which they lie (one standard deviation), and the exponent if the delay is a power of the thickness."""
    found = [p for group in delays(points).values() for p in group if p["rings"]]
    x, y = np.log([(p["thickness"], p["late"]) for p in found]).T
    return float(np.exp(np.mean(y - x))), float(np.exp(np.std(y - x))), float(np.polyfit(x, y, 1)[0])


def unstructured(points: Points) -> tuple[float, float]:
    """Mean and standard deviation of the delay less that of the :func:`curve`, of unstructured meshes."""
    slope, *_ = curve(points)
    off = [p["late"] - slope * p["thickness"] for group in delays(points).values() for p in group if not p["rings"]]
    return float(np.mean(off)), float(np.std(off, ddof=1)) if len(off) > 1 else 0.0


COLOURS = {("aaa", "0.05"): "#33658a", ("aaa", "0.1"): "#55a630", ("aaa", "0.025"): "#e09f3e",
           ("gent", "0.05"): "#a63d40"}
MARKS = {"unstructured": "o", "rings 1": "s", "rings 2": "D", "rings 4": "^", "rings 8": "*"}


def draw(points: Points, path: Path) -> None:
    """Delay of each onset against where the first Gauss point is, and against the number of elements."""
    groups = delays(points)
    slope, *_ = curve(points)
    with page(path, "How late the onset at a notch is", 1, 2, 3.6) as axes:
        for ax, x in zip(axes, ("thickness", "per_radius")):
            for kind, mark in MARKS.items():
                for name, group in groups.items():
                    mine = [p for p in group if p["kind"] == kind and p["late"] > 0]
                    scale = FIRST if x == "thickness" else 1.0
                    ax.plot([scale * p[x] for p in mine], [100 * p["late"] for p in mine], mark, ms=3.5, linestyle="",
                            color=COLOURS[name], fillstyle="none" if kind == "unstructured" else "full")
            ax.set(xscale="log", yscale="log", ylabel="delay of the onset (% of the opening)")
        t = np.array([0.007, 1.0])
        axes[0].plot(FIRST * t, 100 * slope * t, "k-", linewidth=0.8, label="in proportion")
        axes[0].set_xlabel("first Gauss point below the surface / radius")
        axes[1].set_xlabel("elements in a radius along the tip")
        for (law, radius), colour in COLOURS.items():
            if (law, radius) in groups:
                axes[0].plot([], [], "-", color=colour, label=f"{law}, radius {radius} mm")
        for kind, mark in MARKS.items():
            if any(p["kind"] == kind for group in groups.values() for p in group):
                axes[1].plot([], [], mark, color="k", ms=3.5, fillstyle="none" if kind == "unstructured" else "full",
                             label=kind.replace("rings ", "rings, aspect "))
        for ax in axes:
            ax.legend(fontsize=6)


def table(points: Points) -> list[str]:
    """A row a law, radius and kind of mesh: size, elements in a radius, thickness, opening and delay, with scatter."""
    lines = ["| law, radius [mm] | elements at the tip | meshes | elements in a radius | thickness / radius | "
             "opening [mm] | late |", "|---" * 7 + "|"]
    for (law, radius), group in delays(points).items():
        lines.append(f"| `{law}`, {radius} | extrapolated | | | 0 | {reference(group):.4f} | 0 |")
        kinds = sorted({(p["kind"], float(p["size"])) for p in group}, key=lambda k: ([*MARKS].index(k[0]), k[1]))
        for kind, size in kinds:
            mine = [p for p in group if (p["kind"], float(p["size"])) == (kind, size)]
            opening, late = (np.array([p[name] for p in mine]) for name in ("opening_mm", "late"))
            scatter = [f" ± {values.std(ddof=1):.{digits}f}" if len(mine) > 1 else ""
                       for values, digits in ((opening, 4), (100 * late, 1))]
            lines.append(
                f"| | {kind.replace('rings ', 'rings, aspect ')}, l/{size:g} | {len(mine)} | "
                f"{np.mean([p['per_radius'] for p in mine]):.1f} | {np.mean([p['thickness'] for p in mine]):.3f} | "
                f"{opening.mean():.4f}{scatter[0]} | {100 * late.mean():.1f}{scatter[1]} % |")
    slope, factor, exponent = curve(points)
    mean, beside = unstructured(points)
    return [*lines, "", f"Rings: the delay is {slope:.2f} times thickness / radius, within a factor of {factor:.2f} "
            f"(as a power: of the exponent {exponent:.2f}).", "", f"Unstructured meshes lie {100 * mean:+.1f} ± "
            f"{100 * beside:.1f} % of the opening beside that."]


ONSET = Part("onset", plan, draw, table)


def notch(*, quick: Annotated[bool, FLAG] = False, fresh: Annotated[bool, FLAG] = False,
          out: Path = Path("results/study/notch"), quiet: Annotated[bool, FLAG] = False) -> None:
    """Measure how late an onset is that begins at a notch, for the elements at its tip.

    Parameters
    ----------
    quick
        Five meshes, in a minute.
    fresh
        Measure all points anew; without it, those in the folder are kept.
    out
        Folder for the figures and the picture.
    quiet
        Show no progress.
    """
    measure("notch", [ONSET], out, quick, fresh, quiet)


if __name__ == "__main__":
    from ..cli.program import command

    command(notch, package="study")
