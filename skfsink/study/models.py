"""Model: what a choice of the model saves, and what it moves, on small plates in which the crack runs 1 mm.

Every variant runs on three meshes and is compared with the base of its group on the same mesh, so that what meshes do
to the onset (some per cent at this size) drops out. What is left as noise shows in the group `nothing`, where only the
step is a little different. No step is rejected.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..loads.grips import Grip
from ..material import AAA
from ..methods.controls import ExplicitControls, HHTControls
from .chart import page
from .meshes import load_plate
from .part import Part, Planned, Points
from .plate import NO_REJECTION, PULLED, SLAB, SPEED, Integrator, Plate, warm

__all__ = ["MODEL", "Variant", "changes"]

SEEDS = ("0", "1", "2")
EXPLICIT, IMPLICIT = NO_REJECTION
HALF = (Grip("bottom", (0.0, -SPEED)), Grip("seam", (None, 0.0)))
SHEET = (Grip("top", (0.0, SPEED, 0.0)), Grip("back", (None, None, 0.0)), Grip("bottom", (0.0, -SPEED, 0.0)))


@dataclass(frozen=True)
class Variant:
    """A model: `body` are arguments of :class:`Plate`, `controls` those of the integrator.

    `mesh` is the name of a plate without its seed. The grips are those of a whole plate unless they are among `body`.
    `base` is the name of the variant it is compared with, empty for a base.
    """

    group: str
    name: str
    base: str = "default"
    mesh: str = "plate"
    mirrored: bool = False
    slab: tuple[float, int] | None = None
    body: dict[str, Any] = field(default_factory=dict)
    controls: ExplicitControls | HHTControls = EXPLICIT
    seeds: tuple[str, ...] = SEEDS

    def run(self, seed: str) -> dict[str, Any]:
        """Load the plate of that seed and let the crack run."""
        warm(2 if self.slab is None else 3)
        plate = Plate(load_plate(self.mesh + seed, self.mirrored, self.slab), **{"grips": PULLED, **self.body})
        onset = plate.onset_figures
        return {"onset": onset, **plate.event(self._integrator)}

    def _integrator(self, plate: Plate) -> Integrator:
        c = self.controls
        return plate.explicit(c) if isinstance(c, ExplicitControls) else plate.hht(c)


def variants(quick: bool) -> list[Variant]:
    """The models compared, bases before what is compared with them."""
    found = [Variant("", "default", "")]
    found += [Variant("nothing", f"Courant {c:g}", controls=replace(EXPLICIT, courant=c)) for c in (0.75, 0.85)]
    found += [Variant("bulk modulus", f"k = {k:g} MPa", body={"material": AAA(k)}) for k in (5.0, 50.0, 5000.0)]
    found += [Variant("sink", name, body={"sink": name}) for name in ("consistent", "nearest")]
    found += [Variant("mass", "HHT, lumped", "", controls=IMPLICIT),
              Variant("mass", "HHT, consistent", "HHT, lumped", controls=replace(IMPLICIT, mass="consistent"))]
    found += [Variant("symmetry", "mirrored plate", "", "half", True),
              Variant("symmetry", "half plate", "mirrored plate", "half", body={"grips": HALF, "parts": 2})]
    found += [Variant("dimension", "3D slice, held in z", slab=(0.05, 1), body={"grips": SLAB}),
              Variant("dimension", "3D sheet, free face", slab=(0.05, 1), body={"grips": SHEET})]
    found += [Variant("notch", "slit", "mirrored plate", "slit", True)]
    fine: dict[str, Any] = {"mirrored": True, "seeds": ("_fine",)}
    found += [Variant("notch", "blunt, l/4", "", "half", **fine),
              Variant("notch", "slit, l/4", "blunt, l/4", "slit", **fine)]
    found += [Variant("deletion", f"γ < {d:g}", body={"deletion": d}) for d in (1e-3, 1e-4, 1e-5, 1e-7, 1e-8, 1e-9)]
    found += [Variant("mass floor", f"mass floor {f:g}", controls=replace(EXPLICIT, mass_floor=f))
              for f in (1e-1, 1e-2, 1e-4, 1e-5)]
    found += [Variant("force floor", f"force floor {f:g}", body={"force_floor": f}) for f in (1e-1, 1e-2, 1e-4, 1e-5)]
    found += [Variant("overshoot", f"overshoot {100 * o:g} %", body={"overshoot": o})
              for o in (5e-4, 1e-3, 2e-3, 1e-2, 2e-2, 5e-2)]
    if quick:
        kept = ("default", "Courant 0.75", "k = 50 MPa", "mirrored plate", "half plate", "slit", "γ < 0.001",
                "mass floor 0.01", "overshoot 2 %")
        found = [v for v in found if v.name in kept]
    return found


def plan(quick: bool) -> list[Planned]:
    """Every variant on every mesh."""
    return [Planned(f"{v.name}/{seed}", _Run(v, seed), 8.0 if v.slab or isinstance(v.controls, HHTControls) else 2.0)
            for v in variants(quick) for seed in (v.seeds[:1] if quick else v.seeds)]


@dataclass(frozen=True)
class _Run:
    variant: Variant
    seed: str

    def __call__(self) -> dict[str, Any]:
        return self.variant.run(self.seed)


# --- what comes out ---
#: what may be moved: how it is called, and where it is in a point
MOVED = {"onset opening": ("onset", "opening_mm"), "onset reaction": ("onset", "reaction_N_per_mm"),
         "arrival time": ("arrival_us",), "D": ("D",), "U": ("U",)}


def changes(points: Points) -> list[dict[str, Any]]:
    """A row a variant: `cost` over that of its base, and relative changes, each as (mean, least, greatest) of meshes.

    The cost is the processor time of the loading and the event. A run that failed on some mesh has `failed`.
    """
    rows = []
    for variant in variants(False):
        seeds = [seed for seed in variant.seeds if f"{variant.name}/{seed}" in points]
        if not variant.base or not seeds:
            continue
        row: dict[str, Any] = {"group": variant.group, "name": variant.name, "base": variant.base}
        pairs = [(points[f"{variant.name}/{seed}"], points[f"{variant.base}/{seed}"]) for seed in seeds]
        failed = [p["failed"] for pair in pairs for p in pair if "failed" in p]
        pairs = [pair for pair in pairs if not any("failed" in p for p in pair)]
        if failed:
            row["failed"] = f"{failed[0]} ({len(failed)} of {len(seeds)} meshes)"
        if pairs:
            row["cost"] = _spread([_cost(p) / _cost(base) for p, base in pairs])
            for name, where in MOVED.items():
                row[name] = _spread([_at(p, where) / _at(base, where) - 1 for p, base in pairs])
        rows.append(row)
    return rows


def _cost(point: dict[str, Any]) -> float:
    return float(point["cpu_s"] + point["onset"]["loading_cpu_s"])


def _at(point: Any, where: tuple[str, ...]) -> float:
    for name in where:
        point = point[name]
    return float(point)


def _spread(values: list[float]) -> tuple[float, float, float]:
    return float(np.mean(values)), min(values), max(values)


COLOURS = ("#6b6b6b", "#33658a", "#a63d40", "#7a6c5d", "#2e7d5b", "#c9971c", "#6a4c93")


def draw(points: Points, path: Path) -> None:
    """A line a variant: cost over that of its base, and how far onset, arrival and D move; bars span the meshes."""
    rows = [row for row in changes(points) if "cost" in row]
    groups = list(dict.fromkeys(row["group"] for row in rows))
    names = ("cost", "onset opening", "arrival time", "D", "U")
    labels = ("cost over that\nof the base", "change of the\nonset opening (%)", "change of the\narrival time (%)",
              "change of $D$\nat the arrival (%)", "change of $U$\nat the arrival (%)")
    written = [row["name"] if row["group"] in row["name"] else f"{row['group']}: {row['name']}" for row in rows]
    with page(path, "What choices of the model save, and what they move", 1, 5, 1.4 + 0.17 * len(rows)) as axes:
        for ax, name, label in zip(axes, names, labels):
            for y, row in enumerate(rows):
                mean, low, high = row[name]
                colour = COLOURS[groups.index(row["group"]) % len(COLOURS)]
                ax.plot([low, high], [y, y], color=colour, linewidth=1.6, alpha=0.5)
                ax.plot(mean, y, "o", ms=3.5, color=colour)
            ax.set(xlabel=label, ylim=(len(rows) - 0.4, -0.6))
            ax.set_yticks(range(len(rows)), written if ax is axes[0] else [])
            ax.grid(axis="y", linewidth=0.3, color="0.85")
            if name == "cost":
                ax.axvline(1.0, color="0.4", linewidth=0.6)
            else:
                ax.set_xscale("symlog", linthresh=0.01, linscale=0.3)
                shown = [v for row in rows for v in row[name]]
                ticks = [t for t in (-0.1, 0.0, 0.1, 1.0) if min(shown) <= t <= max(shown)]
                ax.set_xticks(ticks, [f"{100 * t:+g}" if t else "0" for t in ticks])
                ax.minorticks_off()
                ax.tick_params(axis="x", labelsize=6)
                ax.axvline(0.0, color="0.4", linewidth=0.6)
                noise = [row[name] for row in rows if row["group"] == "nothing"]
                if noise:
                    ax.axvspan(min(n[1] for n in noise), max(n[2] for n in noise), color="0.9", zorder=0)


def table(points: Points) -> list[str]:
    """Cost and changes of every variant: mean, and least to greatest over the meshes."""
    lines = ["| variant | against | cost | " + " | ".join(MOVED) + " |", "|---" * (3 + len(MOVED)) + "|"]
    for row in changes(points):
        if "cost" in row:
            cells = [f"× {row['cost'][0]:.2f}"]
            for name in MOVED:
                mean, low, high = (100 * v for v in row[name])
                nothing = max(abs(low), abs(high)) < 0.05
                cells.append("0" if nothing else f"{mean:+.1f} % ({low:+.1f} … {high:+.1f})")
        else:
            cells = ["", *[""] * len(MOVED)]
        if "failed" in row:
            cells[-1] += f" failed: {row['failed']}"
        lines.append(f"| {row['group']}: {row['name']} | {row['base']} | " + " | ".join(cells) + " |")
    return lines


MODEL = Part("model", plan, draw, table)
