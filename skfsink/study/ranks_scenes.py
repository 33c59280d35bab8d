"""The scenes on two ranks against one: `python -m skfsink.study.ranks --only scenes`.

Each coarse scene, and the pressurised aneurysm, is computed on one rank and on two, with the same solver of the
density, and its event once more on two. Differences are those of rounding, which a crack that branches amplifies.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from shutil import copytree
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ..errors import ParameterError, SkfsinkError
from ..results.history import Table
from ..results.loader import Run, load
from ..system.files import write_atomic
from ..system.shipped import deck_path
from .chart import page
from .part import Part, Planned, Points

__all__ = ["SCENES", "on_ranks"]

#: names, and about how long they take [s]
NAMES = {"dog_bone": 130, "single_edge_notch": 110, "symmetric_double_edge_notch": 120,
         "asymmetric_double_edge_notch": 240, "cylindrical_shell": 700, "simple_shear": 600}
#: decks of the aneurysm, under a pressure and filled by a fluid
DECKS = {"aneurysm": "scene.toml", "aneurysm_filled": "fluid.toml"}
SHOWN = 80     # points of a curve
FLOOR = 1e-17  # below which a difference is drawn as this


def mpiexec() -> str:
    """The `mpiexec` of this environment.

    Raises
    ------
    ParameterError
        There is none.
    """
    found = shutil.which("mpiexec", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]))
    if found is None:
        raise ParameterError("no mpiexec: install skfsink with its extra mpi")
    return found


def on_ranks(count: int, words: list[str]) -> str:
    """What Python with some `words` says on so many ranks.

    Raises
    ------
    SkfsinkError
        It ends with an error.
    """
    done = subprocess.run([*([mpiexec(), "-n", str(count)] if count > 1 else []), sys.executable, *words],
                          capture_output=True, text=True, check=False)
    if done.returncode:
        raise SkfsinkError(f"{' '.join(words[:2])} on {count} ranks ended: "
                           f"{(done.stderr.strip().splitlines() or ['no message'])[-1]}")
    return done.stdout


def _words(name: str, analysis: str, folder: Path) -> list[str]:
    """Arguments of Python for a run of a scene or a deck with conjugate gradients, but for where its files go."""
    if name in DECKS:
        path = deck_path(Path("aneurysm"))
        copytree(path.parent / "meshes", folder / "meshes", dirs_exist_ok=True)
        text = path.with_name(DECKS[name]).read_text(encoding="utf-8")
        write_atomic(folder / "scene.toml", text.replace("[parameters]", '[parameters]\ndensity_solver = "jacobi"', 1))
        return ["-m", "skfsink", "run", str(folder / "scene.toml"), "--quiet"]
    return ["-m", f"skfsink.cases.{name}", "--mesh", "coarse", "--analysis", analysis, "--density-solver", "jacobi",
            "--quiet"]


@dataclass(frozen=True)
class _Event:
    """Computes a point: an event on one rank and twice on two."""

    name: str

    def __call__(self) -> dict[str, Any]:
        with TemporaryDirectory() as folder:
            out = {key: Path(folder) / key for key in ("one", "two", "again")}
            words = _words(self.name, "dynamic", Path(folder))
            for key, count in (("one", 1), ("two", 2), ("again", 2)):
                on_ranks(count, [*words, "--out", str(out[key])])
            one, two = load(out["one"]), load(out["two"])
            return {"elements": one.summary["elements"], "again": _same_bytes(out["two"], out["again"]),
                    **compared(one, two)}


@dataclass(frozen=True)
class _Passes:
    """Computes a point: the quasi-static analysis on one rank and on two, of which the first computes it."""

    name: str

    def __call__(self) -> dict[str, Any]:
        with TemporaryDirectory() as folder:
            out = {count: Path(folder) / str(count) for count in (1, 2)}
            for count, path in out.items():
                on_ranks(count, [*_words(self.name, "quasistatic", Path(folder)), "--out", str(path)])
            summary = load(out[2]).summary
            return {"same": _same_bytes(out[1], out[2]), "passes": summary["cost"]["steps"],
                    "balance": summary["energy"]["balance_error_relative"]}


def _same_bytes(one: Path, other: Path) -> bool:
    """Whether histories and failed elements of two runs are the same to the last bit."""
    return all((one / name).read_bytes() == (other / name).read_bytes() for name in ("history.csv", "deletions.csv"))


def compared(one: Run, two: Run) -> dict[str, Any]:
    """Differences of two runs of an event at the onset, up to the first branch, and at the end; the balances."""
    a, b = one.event, two.event
    rows = min(a["time_s"].size, b["time_s"].size)
    branched = min(_branched(a), _branched(b))
    D = [table["sink_stored"][:rows] + table["sink_kinetic"][:rows] for table in (a, b)]
    apart = np.abs(D[1] - D[0]) / D[0][-1]
    tips = np.max([_apart(a[name][:rows], b[name][:rows])
                   for name in ("tip_x_mm", "tip_y_mm", "tip_z_mm", "crack_length_mm")], axis=0)
    before, shown = a["time_s"][:rows] < branched, np.unique(np.linspace(0, rows - 1, SHOWN).astype(int))
    ends = [run.summary for run in (one, two)]
    return {
        "onset": max(_relative(ends[1]["onset"][name], ends[0]["onset"][name]) for name in ends[0]["onset"]
                     if name == "elastic_energy" or name.startswith(("displacement", "reaction"))),
        "branched_s": branched if branched < np.inf else None, "rows": int(before.sum()),
        "clock_before": float(np.abs(b["time_s"][:rows] - a["time_s"][:rows])[before].max() / a["time_s"][-1]),
        "D_before": float(apart[before].max()), "tips_before_mm": float(tips[before].max()),
        "D_end": _relative(ends[1]["energy"]["D_sink_final"], ends[0]["energy"]["D_sink_final"]),
        "tips_end_mm": float(tips.max()),
        "arrival_end": _relative(*(end["event"]["first_arrival_s"] for end in reversed(ends))),
        "failed": [end["deleted_elements"] for end in ends], "branches": [end["event"]["max_branches"] for end in ends],
        "balance": max(end["energy"]["balance_error_relative"] for end in ends),
        "time_s": a["time_s"][shown], "D_apart": apart[shown]}


def _branched(event: Table) -> float:
    """When there are more branches than cracks began [s]; infinity if there never are."""
    branches = event["branches"]
    began = np.flatnonzero(branches > 0)
    more = np.flatnonzero(branches > branches[began[0]]) if began.size else began
    return float(event["time_s"][more[0]]) if more.size else np.inf


def _apart(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Differences, 0 where neither has a value and infinite where one alone has."""
    known = np.isfinite(a)
    apart: np.ndarray = np.where(known == np.isfinite(b), np.abs(np.nan_to_num(b) - np.nan_to_num(a)), np.inf)
    return apart


def _relative(value: float | None, expected: float | None) -> float:
    if value is None or expected is None:
        return 0.0 if value is expected else np.inf
    return abs(value - expected) / (abs(expected) or 1.0)


def plan(quick: bool) -> list[Planned]:
    """Events first, of the aneurysm and the scenes, then passes."""
    events = [*((name, 60) for name in DECKS), *NAMES.items()]
    if quick:
        events = events[:1]
    return [*(Planned(f"event/{name}", _Event(name), 2.0 * seconds) for name, seconds in events),
            *(Planned(f"passes/{name}", _Passes(name), 3.0 * seconds) for name, seconds in events if name in NAMES)]


# --- what comes out ---
def draw(points: Points, path: Path) -> None:
    """How D of two ranks leaves that of one, against time; a dot where a crack branches first."""
    with page(path, "Two ranks against one", 1, 1, 3.0) as (ax,):
        for name, p in _of(points, "event").items():
            time, apart = 1e6 * np.array(p["time_s"], float), np.maximum(np.array(p["D_apart"], float), FLOOR)
            line, = ax.semilogy(time, apart, lw=0.9, label=name.replace("_", " "))
            if p["branched_s"] is not None:
                at = 1e6 * p["branched_s"]
                ax.plot(at, np.interp(at, time, apart), "o", ms=4, color=line.get_color())
        ax.axhline(1e-6, color="k", ls="--", lw=0.8)
        ax.set(xlabel="time (µs)", ylabel="difference of $D$, of its last value")
        ax.legend(fontsize=6)


def table(points: Points) -> list[str]:
    """A row a scene."""
    lines = ["| scene | elements | onset | first branch (µs) | *D* before it | tips before it (mm) | *D* at the end | "
             "branches, failed elements on one; two | balance | twice the same bytes |", "|---" * 10 + "|"]
    for name, p in _of(points, "event").items():
        at = "never" if p["branched_s"] is None else f"{1e6 * p['branched_s']:.1f}"
        ends = "; ".join(f"{b}, {f}" for b, f in zip(p["branches"], p["failed"]))
        lines.append(f"| {name.replace('_', ' ')} | {p['elements']:,} | {p['onset']:.1e} | {at} | "
                     f"{p['D_before']:.1e} | {p['tips_before_mm']:.1e} | {p['D_end']:.1e} | {ends} | "
                     f"{p['balance']:.1e} | {'yes' if p['again'] else 'no'} |")
    if passes := _of(points, "passes"):
        lines += ["", "| quasi-static, by the first rank | passes | balance | same bytes on two as on one |",
                  "|---" * 4 + "|"]
        lines += [f"| {name.replace('_', ' ')} | {p['passes']} | {p['balance']:.1e} | {'yes' if p['same'] else 'no'} |"
                  for name, p in passes.items()]
    return lines


def _of(points: Points, kind: str) -> Points:
    """The points of events, or of passes, by the name of the scene."""
    return {key.split("/")[1]: p for key, p in points.items() if key.startswith(kind + "/")}


SCENES = Part("scenes", plan, draw, table)
