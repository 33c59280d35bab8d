"""Tolerance: what it costs to make steps again that do not keep the energy, and what it brings, at the default step.

The crack runs 1 mm in the paper's tissue and 0.5 mm in a rubber of its own strength, on three meshes each. Where
elements fail the path is sensitive to rounding-like differences, so every run is made at three Courant numbers that
differ by 1 %. The reference of a mesh is the mean of three such runs with an eighth of the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..methods.controls import ExplicitControls
from .chart import page
from .meshes import load_plate
from .part import Part, Planned, Points
from .plate import Plate, warm

__all__ = ["DISTURBED", "SEEDS", "TOLERANCE", "errors_of", "summary"]

RUNS = {"aaa": 1.0, "gent": 0.5}     # how far the crack runs in each law [mm]
SECONDS = {"aaa": 1.0, "gent": 3.0}  # of a run, about
SEEDS = ("0", "1", "2")
DISTURBED = (0.99, 1.0, 1.01)        # of the Courant number
DEFAULT = ExplicitControls.energy_tolerance
#: name, share of the default Courant number, tolerance of the energy
METHODS = {"reference": (0.125, 2e-6), "off": (1.0, 0.0), "1e-04": (1.0, 1e-4), "2e-05": (1.0, 2e-5),
           "2e-06": (1.0, 2e-6)}
#: what is compared: how it is called
MEASURES = {"arrival_us": "arrival time", "D": "$D$ at the arrival", "U": "$U$ at the arrival"}


Runs = Sequence[tuple[str, dict[str, Any]]]  # the mesh, and what came out


@cache
def _plate(law: str, seed: str) -> Plate:
    return Plate.of_law(load_plate(f"plate{seed}"), law)


@dataclass(frozen=True)
class _Run:
    """Computes a point: a law, a mesh, and the options of the explicit scheme."""

    law: str
    seed: str
    controls: ExplicitControls

    def __call__(self) -> dict[str, Any]:
        warm(2)
        return _plate(self.law, self.seed).event(lambda plate: plate.explicit(self.controls), run=RUNS[self.law])


def plan(quick: bool) -> list[Planned]:
    """Every tolerance, and the reference, at three Courant numbers on three meshes; if quick, once, of the tissue."""
    planned = []
    for law in ("aaa",) if quick else RUNS:
        for method, (share, tolerance) in METHODS.items():
            for seed in SEEDS[:1] if quick else SEEDS:
                for disturbed in (1.0,) if quick else DISTURBED:
                    courant = ExplicitControls.courant * share * disturbed
                    planned.append(Planned(
                        f"{law}/{method}/{courant:.4g}/{seed}",
                        _Run(law, seed, ExplicitControls(courant, energy_tolerance=tolerance)), SECONDS[law] / share))
    return planned


# --- what comes out ---
def errors_of(runs: Runs, reference: Runs, name: str) -> np.ndarray:
    """Errors (n,) of a measure in some runs, relative to the mean of the reference's runs on the same mesh."""
    true = {seed: np.mean([p[name] for s, p in reference if s == seed]) for seed, _ in runs}
    return np.array([point[name] / true[seed] - 1 for seed, point in runs])


def summary(points: Points) -> list[dict[str, Any]]:
    """A row a law and method: mean `steps`, `rejected`, `cost` [s]; of each measure (mean, root mean square) errors.

    Errors are relative to the reference of the same mesh, those of the reference are its scatter about its mean. A
    method of which runs failed has `failed`, how many, instead.
    """
    groups: dict[tuple[str, str], list[tuple[str, dict[str, Any]]]] = {}
    for key, point in points.items():
        law, method, _, seed = key.split("/")
        groups.setdefault((law, method), []).append((seed, point))
    rows = []
    for (law, method), runs in groups.items():
        row: dict[str, Any] = {"law": law, "method": method,
                               "cost": float(np.mean([point["cpu_s"] for _, point in runs]))}
        failed = sum("failed" in point for _, point in runs)
        if failed:
            row["failed"] = f"{failed} of {len(runs)} runs fail"
            rows.append(row)
            continue
        for name in ("steps", "rejected"):
            row[name] = float(np.mean([point[name] for _, point in runs]))
        for name in MEASURES:
            errors = errors_of(runs, groups[law, "reference"], name)
            row[name] = float(errors.mean()), float(np.sqrt(np.mean(errors**2)))
        rows.append(row)
    return rows


COLOURS = {"aaa": "#33658a", "gent": "#a63d40"}
MARKS = {"off": "x", "1e-04": "^", "2e-05": "*", "2e-06": "s"}


def draw(points: Points, path: Path) -> None:
    """Error against processor time, a panel a measure; dotted lines are the scatter of the reference."""
    rows = summary(points)
    with page(path, "Steps that do not keep the energy are made again: error against cost", 2, 2, 5.6) as axes:
        for ax, (name, label) in zip(axes, MEASURES.items()):
            _panel(ax, rows, name)
            ax.set(xscale="log", yscale="log", xlabel="processor time (s)", ylabel=f"relative error of the {label}")
        axes[-1].set_axis_off()
        axes[-1].legend(*axes[0].get_legend_handles_labels(), loc="upper left", borderaxespad=0)


def _panel(ax: Axes, rows: list[dict[str, Any]], measure: str) -> None:
    for law in dict.fromkeys(row["law"] for row in rows):
        mine = {row["method"]: row for row in rows if row["law"] == law}
        good = {method: row for method, row in mine.items() if "failed" not in row and method in MARKS}
        ax.plot([row["cost"] for row in good.values()], [row[measure][1] for row in good.values()], linewidth=0.8,
                color=COLOURS[law])
        for method, mark in MARKS.items():
            row, label = mine[method], f"{law}, {_text(METHODS[method][1])}"
            if method in good:
                ax.plot(row["cost"], row[measure][1], mark, ms=9 if mark == "*" else 5, linestyle="none",
                        color=COLOURS[law], label=f"{label}{', default' if METHODS[method][1] == DEFAULT else ''}")
            else:
                ax.plot([], [], " ", label=f"{label}: {row['failed']}")
        reference = mine["reference"]
        if "failed" not in reference and reference[measure][1] > 0.0:
            ax.axhline(reference[measure][1], color=COLOURS[law], linewidth=0.8, linestyle=":",
                       label=f"{law}, scatter of the reference")


def _text(tolerance: float) -> str:
    """A tolerance as it is written."""
    if not tolerance:
        return "off"
    power = int(np.floor(np.log10(tolerance) + 1e-9))
    front = tolerance / 10.0**power
    return (f"${front:.0f}\\cdot" if front > 1.5 else "$") + f"10^{{{power}}}$"


def table(points: Points) -> list[str]:
    """A row a law and tolerance: steps, processor time, and mean errors with root mean squares in brackets."""
    lines = ["| law | tolerance | steps | rejected | processor time (s) | arrival | $D$ | $U$ |", "|---" * 8 + "|"]
    for row in summary(points):
        share, tolerance = METHODS[row["method"]]
        name = (f"{_text(tolerance)}, Courant {ExplicitControls.courant * share:g} (reference)"
                if row["method"] == "reference" else
                _text(tolerance) + (", default" if tolerance == DEFAULT else ""))
        if "failed" in row:
            lines.append(f"| `{row['law']}` | {name} | {row['failed']} | | {row['cost']:.2f} | | | |")
            continue
        means = ["" if row["method"] == "reference" else f"{100 * row[name][0]:+.1f} % " for name in MEASURES]
        errors = [f"{mean}({100 * row[name][1]:.1f} %)" for mean, name in zip(means, MEASURES)]
        lines.append(f"| `{row['law']}` | {name} | {row['steps']:.0f} | {row['rejected']:.0f} | {row['cost']:.2f} | "
                     + " | ".join(errors) + " |")
    return lines


TOLERANCE = Part("tolerance", plan, draw, table)
