"""How solvers of a tangent grow with it, on one rank and on two: `python -m skfsink.study.tangent`.

A notched block of hexahedra, cracked through 0.4 of its length and stretched by 10 %: what its tangent costs to
assemble, to prepare (factors, a hierarchy) and to solve with, from 10^4 to 3 10^6 unknowns. Each is solved with in a
process of its own, or in two that `mpiexec` starts. Times are those of the processor, of the first rank: they hang less
than the wall on what the machine does besides; a rank that waits for another counts its waiting. It writes
`tangent.json`, `tangent.md` and a picture, goes on where it was stopped, and needs petsc4py with mpi4py for all of it:
solvers that are not there are left out.
"""

# ruff: noqa: E402

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ..errors import ConvergenceError, ParameterError
from ..fem.petsc_matrix import is_there
from .chart import page
from .part import Part, Planned, Points
from .rates import observed_rate
from .speed_accuracy import measure

__all__ = ["TANGENT", "tangent"]

FLAG = Parameter(negative="", show_default=False)
SOLVE = str(Path(__file__).with_name("tangent_solve.py"))
#: solver, ranks, and the unknowns up to which it is asked
WAYS = (("direct", 1, 300_000), ("petsc-mumps", 1, 300_000), ("multigrid", 1, 1_000_000),
        ("petsc-gamg", 1, 3_000_000), ("petsc-gamg", 2, 1_000_000))
SIZES = (10_000, 30_000, 100_000, 300_000, 1_000_000, 3_000_000)
COLOURS = dict(zip(WAYS, ("#0b3c5d", "#6b6b6b", "#c9971c", "#a63d40", "#2e7d5b")))


@dataclass(frozen=True)
class _Solve:
    """Computes a point."""

    linear: str
    ranks: int
    unknowns: int

    def __call__(self) -> dict[str, Any]:
        words = [sys.executable, "-m", "skfsink.methods.ranks", SOLVE, self.linear, str(self.unknowns)]
        if self.ranks > 1:
            path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
            if (mpiexec := shutil.which("mpiexec", path=path)) is None:
                raise ParameterError("no mpiexec: install that of mpi4py's MPI")
            words = [mpiexec, "-n", str(self.ranks), *words]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        if done.returncode:
            said = [line for line in done.stderr.splitlines() if any(map(str.isalnum, line))]
            raise ConvergenceError((said or ["no message"])[-1])
        found = json.loads(done.stdout.strip().splitlines()[-1])
        return {"ranks": self.ranks, **found}


def plan(quick: bool) -> list[Planned]:
    """From small to large tangents, solver by solver."""
    there = is_there()
    return [Planned(f"{linear}/{ranks}/{size}", _Solve(linear, ranks, size), size * 1e-4)
            for size in (SIZES[:1] if quick else SIZES) for linear, ranks, most in WAYS
            if size <= most and (there or "petsc" not in linear)]


# --- what comes out ---
def family(points: Points, way: tuple[str, int, int]) -> list[dict[str, Any]]:
    """Points of a solver on a number of ranks that were solved."""
    return [p for key, p in points.items() if key.startswith(f"{way[0]}/{way[1]}/") and "failed" not in p]


def solve_s(point: dict[str, Any]) -> float:
    """Processor time of preparing and solving to 1e-6 [s]."""
    return float(point["cost"]["setup"][1] + point["cost"]["solve 1e-06"][1])


#: what is drawn, of a point
VALUES: dict[str, Callable[[dict[str, Any]], float]] = {
    "processor time of set-up and solution (s)": solve_s,
    "iterations to $10^{-6}$": lambda p: float(p["iterations"][1] or "nan"),
    "memory of the first rank (MB)": lambda p: float(p["peaks_mb"][0])}


def label(way: tuple[str, int, int], found: list[dict[str, Any]], value: Callable[[dict[str, Any]], float]) -> str:
    """A solver, its ranks, and the exponent with which a value grows where there are three sizes."""
    name = way[0] + (f", {way[1]} ranks" if way[1] > 1 else "")
    if len(found) < 3:
        return name
    return f"{name} ($n^{{{observed_rate([p['unknowns'] for p in found], [value(p) for p in found]):.2f}}}$)"


def draw(points: Points, path: Path) -> None:
    """Time, iterations and memory against the unknowns."""
    with page(path, "The tangent of a notched block of hexahedra, stretched by 10 %", 1, 3, 3.9) as axes:
        for ax, (title, value) in zip(axes, VALUES.items()):
            for way in WAYS:
                found = family(points, way)
                if found and not (title.startswith("iterations") and way[0] in ("direct", "petsc-mumps")):
                    ax.plot([p["unknowns"] for p in found], [value(p) for p in found], "o-", ms=2.5, lw=0.9,
                            color=COLOURS[way], label=label(way, found, value))
            ax.set(xlabel="unknowns", ylabel=title, xscale="log")
            if title.startswith("iterations"):
                ax.set_ylim(bottom=0)
            else:
                ax.set_yscale("log")
            ax.legend(fontsize=6, loc="upper center", bbox_to_anchor=(0.5, -0.2))


def table(points: Points) -> list[str]:
    """A row a tangent."""
    lines = ["| linear | ranks | unknowns | once (s) | assembly (s) | set-up (s) | to 10⁻² (s) | to 10⁻⁶ (s) | "
             "iterations | wall of set-up and 10⁻⁶ (s) | memory of the ranks (MB) |", "|---" * 11 + "|"]
    for way in WAYS:
        for p in family(points, way):
            c, its = p["cost"], p["iterations"]
            own = " | ".join(f"{c[name][1]:.3g}" for name in ("assembly", "setup", "solve 0.01", "solve 1e-06"))
            wall = c["setup"][0] + c["solve 1e-06"][0]
            once = c["once"][1] + c["first"][1]
            lines.append(f"| {way[0]} | {p['ranks']} | {p['unknowns']:,} | {once:.3g} | {own} | "
                         f"{its[0]}, {its[1]} | {wall:.3g} | {', '.join(f'{mb:,.0f}' for mb in p['peaks_mb'])} |")
    return lines


TANGENT = Part("tangent", plan, draw, table)


def tangent(*, quick: Annotated[bool, FLAG] = False, fresh: Annotated[bool, FLAG] = False,
            out: Path = Path("results/study/tangent"), quiet: Annotated[bool, FLAG] = False) -> None:
    """Measure how solvers of a tangent grow with it.

    Parameters
    ----------
    quick
        The smallest tangent alone, in a minute.
    fresh
        Measure all points anew; without it, those in the folder are kept.
    out
        Folder for the figures and the picture.
    quiet
        Show no progress.
    """
    measure("tangent", [TANGENT], out, quick, fresh, quiet)


if __name__ == "__main__":
    from ..cli.program import command

    command(tangent, package="study")
