"""Raised mass: what it costs to resolve the tip of a notch, and what it moves to raise the mass of the elements there.

The crack of a small plate runs 1 mm from a tip with rings of elements around it, on three meshes, with none, some and
more of the volume raised in mass. Where elements fail the path is sensitive to rounding-like differences, so every run
is made at three Courant numbers that differ by 1 %. The reference of a mesh is the mean of its three runs without
raised mass. Solves for gamma are as far apart in time in all runs, the default where that is not cut short: without
raised mass ten short steps, the most there are between two solves by default, take a tenth of it. The same plates
without rings are what a notch costs that is not resolved; they begin to fail later.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ..methods.controls import ExplicitControls
from .chart import page
from .meshes import load_plate
from .part import Part, Planned, Points
from .plate import Plate, warm
from .tolerance import DISTURBED, SEEDS, errors_of

__all__ = ["RAISED", "summary"]

DEFAULT = ExplicitControls.raised_mass
#: mesh, and share of the volume whose elements get more mass
METHODS = {"reference": ("tip", 0.0), "0.001": ("tip", 0.001), "0.003": ("tip", 0.003), "0.01": ("tip", 0.01),
           "0.03": ("tip", 0.03), "no rings": ("plate", 0.0)}
#: what is compared: how it is called
MEASURES = {"start": "time of the first 0.25 mm", "transit": "time from 0.25 to 1 mm", "D": "$D$ at the arrival",
            "U": "$U$ at the arrival"}
SECONDS = {"reference": 8.0}  # of a run, about


@cache
def _plate(mesh: str, seed: str) -> Plate:
    return Plate(load_plate(f"{mesh}{seed}"))


@dataclass(frozen=True)
class _Run:
    """Computes a point: a mesh and the options of the explicit scheme."""

    mesh: str
    seed: str
    controls: ExplicitControls

    def __call__(self) -> dict[str, Any]:
        """Times [us] of the first quarter of the way and of the rest, energies, steps, mass added and cost."""
        warm(2)
        plate = _plate(self.mesh, self.seed)
        onset = plate.onset_figures["opening_mm"]
        scheme = plate.explicit(replace(self.controls, gamma_every=_steps_between_solves(plate, self.controls)))
        found = plate.event(lambda _: scheme)
        start = float(found["passed_us"][len(found["passed_us"]) // 4 - 1])
        return {**{name: found[name] for name in ("D", "U", "steps", "rejected", "cpu_s")}, "start": start,
                "transit": found["arrival_us"] - start, "added_mass": scheme.added_mass,
                "gamma_every": scheme.controls.gamma_every, "onset_mm": onset,
                "elements": plate.sample.space.n_elements}


def _steps_between_solves(plate: Plate, controls: ExplicitControls) -> int:
    """How many of the first steps fit in the longest time between two solves for gamma."""
    state, scheme = plate.onset, plate.explicit(controls)
    state.begin_event(plate.overshoot)
    scheme.begin(state)
    scheme.step(state)
    return max(1, int(scheme.interval.longest / scheme.dt))


def plan(quick: bool) -> list[Planned]:
    """Every share of the volume at three Courant numbers on three meshes; if quick, once."""
    return [Planned(f"{method}/{ExplicitControls.courant * disturbed:.4g}/{seed}",
                    _Run(mesh, seed, ExplicitControls(ExplicitControls.courant * disturbed, raised_mass=share)),
                    SECONDS.get(method, 1.5))
            for method, (mesh, share) in METHODS.items()
            for seed in (SEEDS[:1] if quick else SEEDS) for disturbed in ((1.0,) if quick else DISTURBED)]


# --- what comes out ---
def summary(points: Points) -> list[dict[str, Any]]:
    """A row a method: mean `steps`, `cost` [s], `added`; of each measure (mean, its standard error, root mean square).

    Errors are relative to the reference of the same mesh; those of the reference are its scatter about its mean.
    """
    groups: dict[str, list[tuple[str, dict[str, Any]]]] = {}
    for key, point in points.items():
        method, _, seed = key.split("/")
        if "failed" not in point:
            groups.setdefault(method, []).append((seed, point))
    rows = []
    for method, runs in groups.items():
        row: dict[str, Any] = {"method": method, "runs": len(runs)}
        for name, key in (("steps", "steps"), ("cost", "cpu_s"), ("added", "added_mass"), ("onset", "onset_mm")):
            row[name] = float(np.mean([point[key] for _, point in runs]))
        for name in MEASURES:
            errors = errors_of(runs, groups["reference"], name)
            sure = float(errors.std(ddof=1) / np.sqrt(len(errors))) if len(errors) > 1 else 0.0
            row[name] = float(errors.mean()), sure, float(np.sqrt(np.mean(errors**2)))
        rows.append(row)
    return rows


def draw(points: Points, path: Path) -> None:
    """Mean error of each measure with its standard error, against processor time."""
    rows = summary(points)
    with page(path, "A resolved notch: mass raised at its tip, against cost", 2, 2, 5.2) as axes:
        for ax, (name, label) in zip(axes, MEASURES.items()):
            for row, mark in zip(rows, "ov^*sx"):
                mean, sure, _ = row[name]
                ax.errorbar([row["cost"]], [100 * mean], [100 * sure], fmt=mark, capsize=3, linewidth=0.9,
                            ms=9 if mark == "*" else 5, label=_name(row["method"]))
            ax.axhspan(-0.5, 0.5, color="0.9")
            ax.set(xscale="log", xlabel="processor time (s)", ylabel="change (%)", title=label)
        axes[0].legend(fontsize=6)


def _name(method: str) -> str:
    if method == "no rings":
        return "no rings, no raised mass"
    share = METHODS[method][1]
    return "none (reference)" if not share else f"{share:g}{', default' if share == DEFAULT else ''}"


def table(points: Points) -> list[str]:
    """A row a share: mass added, steps, processor time, mean changes ± their standard errors (root mean squares)."""
    lines = ["| `raised_mass` | mass added | onset (mm) | steps | processor time (s) | "
             + " | ".join(label for label in MEASURES.values()) + " |", "|---" * (5 + len(MEASURES)) + "|"]
    for row in summary(points):
        cells = [f"{100 * mean:+.1f} ± {100 * sure:.1f} % ({100 * square:.1f} %)" if row["method"] != "reference" else
                 f"({100 * square:.1f} %)" for mean, sure, square in (row[name] for name in MEASURES)]
        first = [_name(row["method"]), f"{100 * row['added']:.1f} %", f"{row['onset']:.4f}", f"{row['steps']:,.0f}",
                 f"{row['cost']:.2f}"]
        lines.append(f"| {' | '.join(first + cells)} |")
    return lines


RAISED = Part("raised", plan, draw, table)
