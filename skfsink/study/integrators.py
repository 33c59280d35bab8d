"""Time: error of the integrators against their cost, on small plates in which the crack runs 1 mm.

All runs of a plate start from the same onset. The reference is the explicit scheme with a solve for gamma to the full
tolerance in every step, at a Courant number that was halved until nothing moved; the paper's implicit scheme is
another way to the same limit. No step is rejected: what that changes is in :mod:`.tolerance`; and no mass is raised,
which HHT does not know: what that changes is in :mod:`.raised`. Where elements fail the
path is sensitive to rounding-like differences, so errors do not fall smoothly: those of a method are root mean squares
over three meshes of the same sizes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..methods.controls import ExplicitControls, HHTControls
from .chart import draw_front, listed, page
from .meshes import load_plate
from .pareto import pareto_front
from .part import Part, Planned, Points
from .plate import NO_REJECTION, Integrator, Plate, warm

__all__ = ["ERRORS", "TIME", "Method", "errors"]

PLATES = ("plate0", "plate1", "plate2")
CHAIN = (0.2, 0.1, 0.05, 0.025, 0.0125)  # Courant numbers of the reference; the last one is it
#: error measures: what is compared, and how it is called
ERRORS = {"arrival": "arrival time at tip + 1 mm", "D": "$D$ at that time", "history": "tip history, L2"}


@dataclass(frozen=True)
class Method:
    """An integrator with its options: `name` is its key, `family` and `line` say how it is drawn."""

    name: str
    family: str
    line: str
    controls: ExplicitControls | HHTControls

    @property
    def seconds(self) -> float:
        """About how long it takes [s]."""
        return 2.0 if isinstance(self.controls, ExplicitControls) else 2.0 + 0.4e-6 / self.controls.dt

    def make(self, plate: Plate) -> Integrator:
        """The integrator on a plate."""
        return (plate.explicit(self.controls) if isinstance(self.controls, ExplicitControls) else
                plate.hht(self.controls))


def _explicit(courant: float = ExplicitControls.courant, gamma_every: int = 0) -> ExplicitControls:
    return replace(NO_REJECTION[0], courant=courant, gamma_every=gamma_every, raised_mass=0.0)


def methods(quick: bool) -> list[Method]:
    """The methods compared; the defaults of the program are among them, but for rejected steps and raised mass."""
    found = [Method("explicit, default but no rejection", "explicit", "default", _explicit())]
    for courant in (0.9, 0.4) if quick else (0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2):
        for every in (1, 5, 20) if quick else (1, 2, 5, 10, 20):
            found.append(Method(f"explicit, Courant {courant:g}, γ every {every}", "explicit", f"γ every {every}",
                                _explicit(courant, every)))
    found.append(Method("HHT, default but no rejection", "HHT", "default", NO_REJECTION[1]))
    for coupling in ("iterated", "single"):
        for alpha in (-0.05,) if quick else (0.0, -0.05, -0.3):
            for dt in (1.0, 0.25) if quick else (2.0, 1.0, 0.5, 0.25, 0.12, 0.06, 0.03):
                found.append(Method(f"HHT, {coupling}, α {alpha:g}, Δt {dt:g} µs", "HHT", f"{coupling}, α {alpha:g}",
                                    replace(NO_REJECTION[1], alpha=alpha, dt=dt * 1e-6, coupling=coupling)))
    return found


@dataclass(frozen=True)
class _Run:
    """Computes a point: a method on a plate, or without one the onset of the plate."""

    plate: str
    method: Method | None = None
    exact: bool = False

    def __call__(self) -> dict[str, Any]:
        warm(2)
        plate = _body(self.plate)
        if self.method is None:
            return dict(plate.onset_figures)
        return (replace(plate, exact=True) if self.exact else plate).event(self.method.make)


def plan(quick: bool) -> list[Planned]:
    """References first, then every method on every plate."""
    plates = PLATES[:1] if quick else PLATES
    planned = [Planned(f"onset/{plate}", _Run(plate), 2.0) for plate in plates]
    for plate in plates:
        for c in CHAIN[:2] if quick else CHAIN:
            method = Method("", "", "", _explicit(c, 1))
            planned.append(Planned(f"reference {c:g}/{plate}", _Run(plate, method, True), 0.7 / c))
    planned += [Planned(f"{method.name}/{plate}", _Run(plate, method), method.seconds)
                for method in methods(quick) for plate in plates]
    return planned


@cache
def _body(plate: str) -> Plate:
    return Plate(load_plate(plate))


# --- what comes out ---
def errors(point: dict[str, Any], reference: dict[str, Any]) -> dict[str, float]:
    """Relative errors of a run by the names of :data:`ERRORS`; that of the history is relative to the arrival time."""
    passed, true = np.array(point["passed_us"]), np.array(reference["passed_us"])
    return {"arrival": abs(point["arrival_us"] / reference["arrival_us"] - 1),
            "D": abs(point["D"] / reference["D"] - 1),
            "history": float(np.sqrt(np.mean((passed - true) ** 2))) / reference["arrival_us"]}


def summary(points: Points) -> list[dict[str, Any]]:
    """A row a method: name, family, line, cost, errors (root mean squares over the plates) or why it failed."""
    plates = sorted({key.split("/")[1] for key in points if key.startswith("onset/")})
    courants = sorted({float(key.split("/")[0].split()[1]) for key in points if key.startswith("reference ")})
    references = {plate: points[f"reference {courants[0]:g}/{plate}"] for plate in plates}
    rows = [Method(f"reference {c:g}", "reference", "", _explicit(c, 1)) for c in reversed(courants[1:])]
    rows += [method for method in methods(False) if f"{method.name}/{plates[0]}" in points]
    found = []
    for method in rows:
        runs = {plate: points[f"{method.name}/{plate}"] for plate in plates}
        row: dict[str, Any] = {"name": method.name, "family": method.family, "line": method.line}
        failed = [run["failed"] for run in runs.values() if "failed" in run]
        row["cost"] = float(np.mean([run["cpu_s"] for run in runs.values()]))
        if failed:
            row["failed"] = failed[0]
        else:
            each = [errors(run, references[plate]) for plate, run in runs.items()]
            row.update({name: float(np.sqrt(np.mean([e[name] ** 2 for e in each]))) for name in ERRORS})
        found.append(row)
    return found


def draw(points: Points, path: Path) -> None:
    """Error against cost, a panel a measure, with its Pareto front."""
    rows, key = summary(points), dict[str, int]()
    with page(path, "Error of the integrators against their cost: a crack runs 1 mm", 2, 2, 7.2) as axes:
        for ax, (name, label) in zip(axes, ERRORS.items()):
            panel(ax, rows, name, key)
            ax.set_ylabel(f"relative error of the {label}")
        notes = axes[-1]
        notes.set_axis_off()
        notes.legend(*axes[0].get_legend_handles_labels(), loc="upper left", fontsize=6, borderaxespad=0,
                     handlelength=1.5, handletextpad=0.4)
        notes.text(0.55, 1.0, listed(key), transform=notes.transAxes, fontsize=6, va="top", linespacing=1.3)


#: colour and marker of each family, by line
COLOURS = {"γ every 1": "#0b3c5d", "γ every 2": "#33658a", "γ every 5": "#5b8fb9", "γ every 10": "#86bbd8",
           "γ every 20": "#b9d9eb", "iterated, α 0": "#7f1d1d", "iterated, α -0.05": "#a63d40",
           "iterated, α -0.3": "#d98880", "single, α 0": "#7a5c00", "single, α -0.05": "#c9971c",
           "single, α -0.3": "#f2cc8f"}


def panel(ax: Axes, rows: list[dict[str, Any]], measure: str, key: dict[str, int] | None = None) -> None:
    """Points of the methods, the front, and the reference's own uncertainty as a band."""
    good = [row for row in rows if "failed" not in row and row["family"] != "reference"]
    for line in dict.fromkeys(row["line"] for row in good):
        chosen = [row for row in good if row["line"] == line]
        cost, value = [row["cost"] for row in chosen], [row[measure] for row in chosen]
        if line == "default":
            for row, c, e in zip(chosen, cost, value):
                ax.plot(c, e, "*", ms=9, color=COLOURS["γ every 1" if row["family"] == "explicit" else
                                                       "iterated, α -0.05"], mec="k", mew=0.5, zorder=4,
                        label=row["name"])
            continue
        explicit = line in COLOURS and line.startswith("γ")
        ax.plot(cost, value, "o-" if explicit else "s-", ms=3, linewidth=0.6, color=COLOURS[line],
                label=("explicit, " if explicit else "HHT, ") + line)
    last = [row for row in rows if row["family"] == "reference"][-1]
    ax.axhspan(1e-9, last[measure], color="0.9", zorder=0, label="uncertainty of the reference")
    values = [row[measure] for row in good]
    ax.set(xscale="log", yscale="log", ylim=(0.5 * min(last[measure], *values), 2 * max(values)),
           xlabel="processor time (s)")
    draw_front(ax, [row["cost"] for row in good], values, [row["name"] for row in good], key)


def table(points: Points) -> list[str]:
    """The methods on one of the fronts, the defaults, those that failed, and the halving of the reference, by cost."""
    rows = sorted(summary(points), key=lambda row: row["cost"])
    good = [row for row in rows if "failed" not in row and row["family"] != "reference"]
    best = {name: [good[i]["name"] for i in pareto_front([row["cost"] for row in good], [row[name] for row in good])]
            for name in ERRORS}
    lines = ["| method | processor time (s) | arrival | D | tip history |", "|---|---|---|---|---|"]
    for row in rows:
        name = row["name"]
        cells = [f"failed: {row['failed']}", "", ""] if "failed" in row else [
            f"**{100 * row[e]:.2f} %**" if name in best[e] else f"{100 * row[e]:.2f} %" for e in ERRORS]
        if "failed" in row or row["line"] in ("", "default") or any(name in names for names in best.values()):
            lines.append(f"| {name} | {row['cost']:.2f} | " + " | ".join(cells) + " |")
    return lines


TIME = Part("time", plan, draw, table)
