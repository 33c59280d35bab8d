"""Solvers: time, iterations and memory of linear solvers for gamma and for the tangent, against the size.

Plane bodies (2D) and cubes (3D) of elements of l/4, cracked through half of their width. Every solution runs in a
process of its own (:mod:`.systems`); one over the cap of time or memory is recorded as that.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes

from ..errors import ConvergenceError, SkfsinkError
from .chart import page
from .part import Part, Planned, Points
from .rates import observed_rate
from .systems import GIGABYTES, METHODS, OVER_MEMORY, OVER_TIME, SECONDS

__all__ = ["SOLVERS", "exponents"]

SIZES = (1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000)
PATIENCE = 3600.0  # with a process, its assembly and whatever else the machine does meanwhile [s]
ASYMPTOTIC = 9_000  # unknowns from which on the growth is fitted
FIELDS = {"density": "γ", "tangent": "tangent"}


class _Over(ConvergenceError):
    """A solution that took more than the cap allows."""


@dataclass(frozen=True)
class _Solve:
    """Computes a point."""

    field: str
    dim: int
    method: str
    size: int
    over: dict[tuple[str, int, str], str]  # methods that were over the cap at a smaller size

    def __call__(self) -> dict[str, Any]:
        key = self.field, self.dim, self.method
        if key in self.over:
            raise _Over(f"{self.over[key]} at a smaller size already")
        try:
            return self._measure()
        except _Over as error:
            self.over[key] = str(error)
            raise

    def _measure(self) -> dict[str, Any]:
        arguments = [self.field, str(self.dim), self.method, str(self.size)]
        try:
            child = subprocess.run([sys.executable, "-m", "skfsink.study.systems", *arguments], capture_output=True,
                                   text=True, timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            raise _Over(f"over the cap: {PATIENCE:g} s with the assembly") from None
        if child.returncode in (OVER_TIME, OVER_MEMORY):
            raise _Over("over the cap: " + (f"{SECONDS:g} s" if child.returncode == OVER_TIME else f"{GIGABYTES:g} GB"))
        try:
            found: dict[str, Any] = json.loads(child.stdout.splitlines()[-1])
        except (IndexError, ValueError):
            reason = (child.stderr.strip().splitlines() or [f"status {child.returncode}"])[-1]
            raise SkfsinkError(f"the solution of {' '.join(arguments)} ended: {reason}") from None
        if "failed" in found:
            raise ConvergenceError(found["failed"])
        return found


def plan(quick: bool) -> list[Planned]:
    """From small to large systems, method by method."""
    over: dict[tuple[str, int, str], str] = {}
    planned = []
    for field, methods in METHODS.items():
        for dim in (2,) if quick else (2, 3):
            for method in methods:
                for size in (SIZES[0], SIZES[2]) if quick else SIZES:
                    planned.append(Planned(f"{field}/{dim}D/{method}/{size}", _Solve(field, dim, method, size, over),
                                           2.0 + size * 4e-5))
    return planned


# --- what comes out ---
def family(points: Points, field: str, dim: int, method: str) -> list[dict[str, Any]]:
    """Points of a method, by size; those that failed have `failed` and no figures."""
    start = f"{field}/{dim}D/{method}/"
    return [{"size": int(key.removeprefix(start)), **p} for key, p in points.items() if key.startswith(start)]


def cost(point: dict[str, Any]) -> float:
    """Time for a matrix that has changed [s]: setting up and solving."""
    return float(point["setup_s"] + point["solve_s"])


def exponents(points: list[dict[str, Any]]) -> dict[str, float] | None:
    """Growth of time, iterations and memory with the unknowns from 10^4 on; None if fewer than three were solved."""
    found = [p for p in points if "failed" not in p and p["unknowns"] > ASYMPTOTIC]
    if len(found) < 3:
        return None
    n = [p["unknowns"] for p in found]
    return {"time": observed_rate(n, [cost(p) for p in found]),
            "iterations": observed_rate(n, [max(1, p["iterations"]) for p in found]),
            "memory": observed_rate(n, [max(0.01, p["memory_mb"]) for p in found])}


COLOURS = {"direct": "#0b3c5d", "amg": "#a63d40", "lagged": "#e08e79", "intact": "#2e7d5b", "factors": "#c9971c",
           "jacobi": "#6b6b6b"}


#: what is drawn, of a point
VALUES: dict[str, Callable[[dict[str, Any]], float]] = {
    "time": cost, "iterations": lambda p: float(p["iterations"]), "memory": lambda p: max(0.1, p["memory_mb"])}


def draw(points: Points, path: Path) -> None:
    """Time, iterations and memory against the size, a row a field and dimension."""
    rows = [(field, dim) for field in METHODS for dim in (2, 3)
            if any(key.startswith(f"{field}/{dim}D") for key in points)]
    with page(path, "Linear solvers: a matrix that has changed, to a residual of $10^{-8}$", len(rows), 3,
              0.6 + 2.1 * len(rows)) as axes:
        for row, (field, dim) in enumerate(rows):
            for column, (what, label) in enumerate((("time", "processor time (s)"), ("iterations", "iterations"),
                                                    ("memory", "memory (MB)"))):
                _panel(axes[3 * row + column], points, field, dim, what)
                axes[3 * row + column].set_ylabel(f"{FIELDS[field]}, {dim}D: {label}")
        for ax in axes[-3:]:
            ax.set_xlabel("unknowns")


def _panel(ax: Axes, points: Points, field: str, dim: int, what: str) -> None:
    for method, name in METHODS[field].items():
        every = family(points, field, dim, method)
        good = [p for p in every if "failed" not in p]
        if not good or (what == "iterations" and method == "direct"):
            continue
        value = VALUES[what]
        growth = exponents(every)
        label = name + (f" ($n^{{{growth[what]:.2f}}}$)" if growth else "")
        ax.plot([p["unknowns"] for p in good], [value(p) for p in good], "o-", ms=2.5, linewidth=0.9,
                color=COLOURS[method], label=label)
        failed = [p["size"] for p in every if "failed" in p]
        if failed:
            ax.plot(failed, [value(good[-1])] * len(failed), "x", ms=4, color=COLOURS[method])
    ax.set(xscale="log", yscale="log")
    low, high = ax.get_ylim()
    ax.set_ylim(low, high * (high / low) ** 0.45)  # room for the legend
    ax.legend(fontsize=5, loc="upper left", handlelength=1.2)


def table(points: Points) -> list[str]:
    """Growth exponents, and the figures of the largest system solved."""
    lines = ["| system, solver | growth of time, iterations, memory | largest solved | once (s) | "
             "set-up, solution (s) | iterations | memory (MB) | beyond |", "|---" * 8 + "|"]
    for field in METHODS:
        for dim in (2, 3):
            for method, name in METHODS[field].items():
                every = family(points, field, dim, method)
                good = [p for p in every if "failed" not in p]
                if not every:
                    continue
                growth, beyond = exponents(every), [p for p in every if "failed" in p]
                cells = [f"{FIELDS[field]} {dim}D, {name}",
                         " ".join(f"{growth[k]:.2f}" for k in growth) if growth else "–"]
                if good:
                    p = good[-1]
                    cells += [f"{p['unknowns']:,}", f"{p['once_s']:.2g}", f"{p['setup_s']:.2g}, {p['solve_s']:.2g}",
                              str(p["iterations"]), f"{p['memory_mb']:.0f}"]
                else:
                    cells += ["–"] * 5
                cells.append(f"{beyond[0]['size']:,}: {beyond[0]['failed']}" if beyond else "")
                lines.append("| " + " | ".join(cells) + " |")
    return lines


SOLVERS = Part("solvers", plan, draw, table)
