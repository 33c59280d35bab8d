"""How an explicit event scales with the ranks of MPI: `python -m skfsink.study.ranks`.

A notched block of hexahedra is pulled apart by grips that move from the start; one event is computed on one, two and
more ranks, each time by `mpiexec` as a user would. Strong scaling is on one body, weak on a body for each rank. It
writes `ranks.json`, `ranks.md` and a picture, goes on where it was stopped, and needs the extra mpi. A model of the
cost of a step, fitted to what was measured, says what limits more ranks than the machine has cores.
"""

# ruff: noqa: E402

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import json
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import meshio
import numpy as np
from cyclopts import Parameter

from ..system.files import write_atomic
from .chart import page
from .part import Part, Planned, Points
from .ranks_scenes import SCENES, on_ranks
from .speed_accuracy import measure

__all__ = ["RANKS", "ranks"]

FLAG = Parameter(negative="", show_default=False)
H = 0.05                    # of the hexahedra [mm]: l/2
SIZE = {"strong": (50_000, 200_000, 1_000_000), "weak": (100_000,)}   # elements: of the body, and of each rank
COUNTS = {50_000: (1, 2, 4, 8), 200_000: (1, 2, 4), 1_000_000: (1, 2)}   # ranks, of each body of strong scaling
EVENT = str(Path(__file__).with_name("ranks_event.py"))
STEPS = 150                 # about, of the event
BODIES, CLUSTERS = (10**7, 10**8), (64, 1_024, 16_384)   # hexahedra and cores that are predicted
LATENCY, BANDWIDTH = 2e-6, 1e10   # of a network of a cluster [s; bytes/s], assumed
DECK = """case = "custom"

[parameters]
title = "A notched block pulled apart"
mesh = "block.vtu"
density_solver = "jacobi"
event_time = "{time:.3g} s"
frame_every = "1 s"
record_every = "{record:.3g} s"
checkpoint_every = 1e6
event_at = 0

[[grips]]
boundary = "top"
x = 0
y = "5 m/s"
z = 0

[[grips]]
boundary = "bottom"
x = 0
y = "-5 m/s"
z = 0
"""


def block(elements: int) -> meshio.Mesh:
    """A block of about so many cubes, five times as long as high and thick, with a slot through it from the left."""
    n = max(2, round((elements / 5) ** (1 / 3)))
    shape = 5 * n, 2 * (n // 2) + 1, n
    x, y, z = np.meshgrid(*[H * np.arange(m + 1) for m in shape], indexing="ij")
    number = np.arange(x.size).reshape(x.shape)
    corners = [number[i:i + shape[0], j:j + shape[1], k:k + shape[2]].ravel()
               for i, j, k in ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))]
    cells, points = np.column_stack(corners), np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    i, j, _ = np.meshgrid(*[np.arange(m) for m in shape], indexing="ij")
    cells = cells[~((i < n) & (j == shape[1] // 2)).ravel()]
    used, cells = np.unique(cells, return_inverse=True)
    return meshio.Mesh(points[used], [("hexahedron", cells.reshape(-1, 8))])


@dataclass(frozen=True)
class _Event:
    """Computes a point: an event of a body on some ranks."""

    elements: int
    count: int

    def __call__(self) -> dict[str, Any]:
        with tempfile.TemporaryDirectory() as name:
            folder, mesh = Path(name), block(self.elements)
            meshio.write(folder / "block.vtu", mesh)
            step = 0.5 * H / 600e3  # s, of the waves of 590 m/s
            write_atomic(folder / "scene.toml", DECK.format(time=STEPS * step, record=STEPS * step / 10))
            words = [*(["-m", "skfsink.methods.ranks"] if self.count > 1 else []), EVENT, str(folder)]
            found = json.loads(on_ranks(self.count, words).strip().splitlines()[-1])
        cost = found["cost"]
        told = cost.get("ranks", {"peak_rss_mb": [cost["peak_rss_mb"]], "halos": 0, "sums": 0, "gamma_iterations": 0})
        return {"elements": found["elements"], "ranks": self.count, "steps": cost["steps"], "step_s": found["step_s"],
                "event_s": cost["wall_s"]["event"], "solves": cost["gamma_solves"], "peaks_mb": told["peak_rss_mb"],
                "halos": told["halos"], "sums": told["sums"], "gamma_iterations": told["gamma_iterations"],
                "D": found["D"]}


def plan(quick: bool) -> list[Planned]:
    """Bodies of one size on more and more ranks, and bodies that grow with them."""
    planned = []
    for size in (5_000,) if quick else SIZE["strong"]:
        for count in COUNTS.get(size, (1, 2)):
            planned.append(Planned(f"strong/{size}/{count}", _Event(size, count), size * 1e-3))
    for size in () if quick else SIZE["weak"]:
        for count in (1, 2):
            planned.append(Planned(f"weak/{size}/{count}", _Event(size * count, count), size * count * 1e-3))
    return planned


# --- what comes out ---
def step_time(point: dict[str, Any]) -> float:
    """Wall time of a step with its share of solves and records, without what begins and ends an event [s]."""
    return float(point["step_s"])


@dataclass(frozen=True)
class Costs:
    """A model of the time of a step, fitted to what was measured.

    Attributes
    ----------
    element: time of a hexahedron [s].   exchange: of an exchange between two ranks, its Python included [s].
    halos, sums, solves: exchanges at nodes between parts, sums of numbers, and solves for gamma, in a step.
    """

    element: float
    exchange: float
    halos: float
    sums: float
    solves: float

    @classmethod
    def fitted(cls, points: Points) -> Costs | None:
        """To the largest body on one rank, and the smallest one on two; None as long as one of them is missing."""
        strong = [p for key, p in points.items() if key.startswith("strong") and "failed" not in p]
        alone, two = [p for p in strong if p["ranks"] == 1], [p for p in strong if p["ranks"] == 2]
        if not alone or not two:
            return None
        large, small = max(alone, key=lambda p: p["elements"]), min(two, key=lambda p: p["elements"])
        element, steps = step_time(large) / large["elements"], small["steps"]
        made = (small["halos"] + small["sums"]) / steps
        rest = step_time(small) - element * small["elements"] / 2
        return cls(element, max(rest, 0.0) / made, small["halos"] / steps, small["sums"] / steps,
                   small["solves"] / steps)

    def parts(self, elements: float, ranks: float) -> dict[str, float]:
        """Time of a step of a body on ranks of a cluster, by what it is spent on [s]."""
        own = elements / ranks
        border = 8 * 2 * 6 * own ** (2 / 3)  # bytes: two numbers a node on the mean, of the six sides of a cube
        return {"elements": self.element * own,
                "borders": self.halos * (self.exchange + LATENCY + border / BANDWIDTH),
                "sums": self.sums * (self.exchange + LATENCY * np.log2(ranks) + 8 * ranks / BANDWIDTH),
                "gamma to the first rank": self.solves * 8 * elements / BANDWIDTH}


def draw(points: Points, path: Path) -> None:
    """Time of a step against the ranks, how much faster they are than one, and what the model says of more of them."""
    cores, costs = os.cpu_count() or 1, Costs.fitted(points)
    with page(path, "An explicit event on several ranks", 1, 3, 3.8) as axes:
        if costs is not None:
            ranks = np.logspace(0, 5, 60)
            for body, style in zip(BODIES, ("--", "-")):
                found = [costs.parts(body, count) for count in ranks]
                axes[2].loglog(ranks, [1e3 * sum(f.values()) for f in found], "k" + style,
                               label=f"{body:.0e} hexahedra".replace("e+0", "e"))
                for name in found[0]:
                    if style == "-":
                        axes[2].loglog(ranks, [1e3 * f[name] for f in found], lw=0.8, label=name)
            axes[2].set(xlabel="ranks", ylabel="time of a step (ms)", ylim=(1e-2, 1e6), title="model")
        for size in sorted({p["elements"] for key, p in points.items() if key.startswith("strong")}):
            mine = [p for key, p in points.items() if key.startswith("strong") and p["elements"] == size]
            counts = np.array([p["ranks"] for p in mine])
            times = np.array([step_time(p) for p in mine])
            axes[0].loglog(counts, 1e3 * times, "o-", label=f"{size:,} hexahedra")
            axes[1].plot(counts, times[0] / times, "o-", label=f"{size:,} hexahedra")
        axes[1].plot([1, cores], [1, cores], "k--", lw=0.8, label=f"{cores} cores")
        axes[0].set(xlabel="ranks", ylabel="time of a step (ms)")
        axes[1].set(xlabel="ranks", ylabel="times as fast as one")
        for ax in axes:
            ax.legend(fontsize=6, loc="upper center", bbox_to_anchor=(0.5, -0.2))


def table(points: Points) -> list[str]:
    """A row an event."""
    lines = ["| | hexahedra | ranks | steps | solves for γ | time of a step (ms) | "
             "times as fast | memory of the first rank, of others (MB) | *D* (N mm) |", "|---" * 9 + "|"]
    for key, p in points.items():
        kind, size, _ = key.split("/")
        one = points.get(f"{kind}/{size}/1")
        grown = p["elements"] / one["elements"] if one else 1.0
        first, *others = p["peaks_mb"]
        memories = [first, *([max(others)] if others else [])]
        faster = f"{grown * step_time(one) / step_time(p):.2f}" if one else ""
        lines.append(f"| {kind} | {p['elements']:,} | {p['ranks']} | {p['steps']} | {p['solves']} | "
                     f"{1e3 * step_time(p):.2f} | {faster} | "
                     f"{', '.join(f'{mb:,.0f}' for mb in memories)} | {p['D']:.9g} |")
    costs = Costs.fitted(points)
    if costs is None:
        return lines
    lines += ["", f"Model: {1e6 * costs.element:.3g} µs a hexahedron and step, {1e6 * costs.exchange:.3g} µs an "
              f"exchange; in a step {costs.halos:.1f} sums at nodes between parts, {costs.sums:.1f} of numbers, "
              f"{costs.solves:.2f} solves. Assumed of a cluster: {1e6 * LATENCY:g} µs, {BANDWIDTH / 1e9:g} GB/s.", "",
              "| hexahedra | ranks | time of a step (ms) | elements | borders | sums | γ to the first rank "
              "| efficiency |", "|---" * 8 + "|"]
    for body in BODIES:
        for count in CLUSTERS:
            parts = costs.parts(body, count)
            whole = sum(parts.values())
            lines.append(f"| {body:,} | {count:,} | {1e3 * whole:.3g} | "
                         + " | ".join(f"{part / whole:.0%}" for part in parts.values())
                         + f" | {parts['elements'] / whole:.0%} |")
    return lines


RANKS = Part("scaling", plan, draw, table)
PARTS = {"scaling": RANKS, "scenes": SCENES}


def ranks(*, only: Literal["scaling", "scenes"] | None = None, quick: Annotated[bool, FLAG] = False,
          fresh: Annotated[bool, FLAG] = False, out: Path = Path("results/study/ranks"),
          quiet: Annotated[bool, FLAG] = False) -> None:
    """Measure how an explicit event scales with the ranks of MPI, and hold the scenes on two ranks against one.

    Parameters
    ----------
    only
        The scaling, or the scenes, alone.
    quick
        A small body on one and two ranks, in a minute.
    fresh
        Measure all points anew; without it, those in the folder are kept.
    out
        Folder for the figures and the picture.
    quiet
        Show no progress.
    """
    measure("ranks", [PARTS[only]] if only else list(PARTS.values()), out, quick, fresh, quiet)


if __name__ == "__main__":
    from ..cli.program import command

    command(ranks, package="study")
