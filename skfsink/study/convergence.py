"""Whether an event converges with the mesh: `python -m skfsink.study.convergence`.

The single-edge notched plate breaks on finer and finer elements, on several meshes of each size that differ by their
seed, and the dog-bone with two, three and four layers of hexahedra over its thickness. It writes `convergence.json`,
`convergence.md` and pictures, goes on where it was stopped, and needs gmsh.
"""

# ruff: noqa: E402

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from matplotlib.collections import PolyCollection

from ..meshing.shapes import single_edge_notch_mesh
from ..meshing.vtu import write_mesh
from ..results.history import History
from ..run.display import Display
from ..run.quantities import crack_cells, failed_until, measured
from ..run.simulate import Simulation
from ..scene.options import Options
from .chart import page
from .ladder import scene_of
from .part import Part, Planned, Points
from .rates import RATES, extrapolated
from .speed_accuracy import measure

__all__ = ["EVENT", "LAYERS", "Event", "convergence"]

L = 0.1  # length scale of the sink [mm]
SIZES, SEEDS = (3, 4, 5, 6, 8, 12), range(5)  # elements in l
FAR = 0.1  # of the finest mean, that an extrapolated value may be away from it
DRAWN = 0  # seed of the meshes whose cracks are drawn
HALF_HEIGHT = 0.8  # of the fine elements ahead of the notch [mm]
#: what is compared, as it is called, and with how many digits
QUANTITIES = {"onset_displacement": ("displacement at the onset (mm)", 5), "D": ("$D$ at the arrival (N mm/mm)", 4),
              "D_per_length": ("$D$ per crack length (N/mm)", 4), "tip_speed": ("mean tip speed (m/s)", 1),
              "first_branch": ("$x$ of the first branch (mm)", 2), "U": ("$U$ at the arrival (N mm/mm)", 4)}
FLAG = Parameter(negative="", show_default=False)


def run_event(case: str, mesh: str, **dimensions: Any) -> dict[str, Any]:
    """The dynamic event of a case: its :func:`.measured` quantities, those of its crack, its elements and steps.

    `crack_length` [mm] is that of all branches up to the first arrival: squares of side l that the crack goes through,
    times l. `first_branch` [mm] is where the leading tip is when a second branch appears, None if there is none.
    `cracked` has the middle and the side of a square of equal area [mm] of each element that failed up to there, of a
    plane body.
    """
    scene, _ = scene_of(case, Options(frame_every=5e-5), mesh, **dimensions)
    with tempfile.TemporaryDirectory() as folder, Display(quiet=True) as display:
        simulation = Simulation(scene, Path(folder), display)
        state = simulation.run()
        rows = History.load(Path(folder) / "history.csv")
    tracker, quantities = simulation.crack.tracker, measured(scene, simulation)
    length = L * len(crack_cells(scene, state, tracker.arrival))
    space, failed = scene.sample.space, failed_until(state, tracker.arrival)
    middles = space.X[space.conn[failed]].mean(axis=1)
    branched = np.flatnonzero((rows["branches"] > 1) & (rows["phase"] == "event"))
    D = quantities["D"]
    return {**quantities, "crack_length": length, "D_per_length": D / length if D and length else None,
            "first_branch": float(rows["tip_x_mm"][branched[0]]) if len(branched) else None,
            "cracked": np.column_stack([middles, np.sqrt(space.V[failed])]).round(4) if space.dim == 2 else [],
            "branches": tracker.max_branches, "elements": space.n_elements,
            "steps": simulation.cost()["steps"]}


@dataclass(frozen=True)
class Event:
    """The single-edge notched plate with elements of l / `per_length` ahead of its notch, on the mesh of a seed."""

    per_length: int
    seed: int

    @property
    def key(self) -> str:
        """Size and seed."""
        return f"{self.per_length}/{self.seed}"

    def __call__(self) -> dict[str, Any]:
        """What :func:`run_event` says of it."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "plate.vtu"
            write_mesh(path, single_edge_notch_mesh(h=L / self.per_length, half_height=HALF_HEIGHT, seed=self.seed))
            found = run_event("single_edge_notch", str(path))
        if self.seed != DRAWN:
            del found["cracked"]
        return found


def plan(quick: bool) -> list[Planned]:
    """A point a size and seed, all seeds of a size first; if quick, two seeds of the two sizes l/2 and l/3."""
    if quick:
        return [Planned(e.key, e, 30.0) for e in (Event(n, seed) for n in (2, 3) for seed in (0, 1))]
    return [Planned(event.key, event, 0.4 * n**3) for n in SIZES for event in (Event(n, seed) for seed in SEEDS)]


def plan_layers(quick: bool) -> list[Planned]:
    """The dog-bone with two, three and four layers; none if quick."""
    return [] if quick else [Planned(f"{n}", partial(run_event, "dog_bone", "coarse", layers=n), 40.0 * n)
                             for n in (2, 3, 4)]


# --- what comes out ---
def sizes(points: Points) -> dict[int, list[dict[str, Any]]]:
    """The points of each size, by the elements in l, that did not fail."""
    groups: dict[int, list[dict[str, Any]]] = {}
    for key, point in points.items():
        if "failed" not in point:
            groups.setdefault(int(key.split("/")[0]), []).append(point)
    return dict(sorted(groups.items()))


def numbers(group: Sequence[dict[str, Any]], quantity: str) -> np.ndarray:
    """The values of a quantity that there are, (n,)."""
    return np.array([p[quantity] for p in group if p[quantity] is not None], float)


def limit(groups: dict[int, list[dict[str, Any]]], quantity: str) -> tuple[float, float] | None:
    """Extrapolated mean of a quantity and its observed rate; None with fewer than three sizes.

    None as well if the means do not converge in the range of sizes: if no rate between those tried fits best, or the
    extrapolated value is farther than `FAR` from the finest mean.
    """
    known = {n: float(values.mean()) for n, group in groups.items() if len(values := numbers(group, quantity))}
    if len(known) < 3:
        return None
    value, rate = extrapolated([L / n for n in known], list(known.values()))
    far = abs(value / known[max(known)] - 1) > FAR
    return None if far or rate in (RATES[0], RATES[-1]) else (value, rate)


def draw(points: Points, path: Path) -> None:
    """Each quantity against the element size: the meshes, their mean and standard deviation, and the limit."""
    groups = sizes(points)
    with page(path, "Single-edge notched plate, finer and finer elements", 2, 3, 4.6) as axes:
        for ax, (quantity, (label, _)) in zip(axes, QUANTITIES.items()):
            for n, group in groups.items():
                values = numbers(group, quantity)
                if not len(values):
                    continue
                ax.plot(np.full(len(values), 1 / n), values, "o", color="#a63d40", ms=3, fillstyle="none")
                ax.errorbar([1 / n], [values.mean()], values.std(ddof=1) if len(values) > 1 else None, fmt="s",
                            color="k", ms=3.5, capsize=3, linewidth=1)
            if (found := limit(groups, quantity)) is not None:
                ax.axhline(found[0], color="#33658a", linestyle="--", linewidth=0.8)
            low, high = ax.get_ylim()
            ax.set(xlabel="element size over $l$", ylabel=label, xlim=(0, None))
            if quantity == "onset_displacement":
                ax.set_ylim(0.99 * low, 1.01 * high)
            else:
                ax.set_ylim(0, 1.05 * high)
    draw_cracks(groups, path.with_stem(f"{path.stem}_cracks"))


def draw_cracks(groups: dict[int, list[dict[str, Any]]], path: Path) -> None:
    """The elements that had failed at the arrival, on one mesh of each size, in the undeformed plate."""
    drawn = {n: points[0]["cracked"] for n, points in groups.items() if "cracked" in points[0]}
    if not drawn:
        return
    with page(path, "Elements that have failed when the crack arrives, on one mesh of each size", 2,
              -(-len(drawn) // 2), 4.6) as axes:
        for ax in axes[len(drawn):]:
            ax.set_axis_off()
        for ax, (n, cracked) in zip(axes, drawn.items()):
            middles, side = np.split(np.array(cracked, float).reshape(-1, 3), [2], axis=1)
            corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
            ax.add_collection(PolyCollection(middles[:, None] + side[:, None] * corners, facecolor="k"))
            ax.set(xlim=(0.9, 4.0), ylim=(0.9, 3.1), aspect="equal", title=f"$l/{n}$", xlabel="$x$ (mm)",
                   ylabel="$y$ (mm)")


def draw_layers(points: Points, path: Path) -> None:
    """Each quantity of the dog-bone over the number of layers, over its value with the most."""
    with page(path, "Dog-bone, layers over the thickness", 1, 1, 2.8, 3.4) as (ax,):
        for quantity, label in (("onset_displacement", "displacement at the onset"), ("U", "$U$"), ("D", "$D$"),
                                ("tip_speed", "mean tip speed")):
            known = {int(n): p[quantity] for n, p in points.items() if p.get(quantity)}
            if known:
                ax.plot(list(known), np.array(list(known.values())) / known[max(known)], "o-", ms=3, label=label)
        ax.set(xlabel="layers", ylabel="over the value with the most layers", ylim=(0.8, 1.2), xticks=[2, 3, 4])
        if points:
            ax.legend(fontsize=6)


def table(points: Points) -> list[str]:
    """A row a size: meshes, mean and standard deviation of each quantity, and the limits and rates."""
    groups = sizes(points)
    names = [label.replace("$", "*") for label, _ in QUANTITIES.values()]
    lines = ["| h | meshes | elements | " + " | ".join(names) + " | branches |", "|---" * (4 + len(names)) + "|"]
    for n, group in groups.items():
        cells = []
        for quantity, (_, digits) in QUANTITIES.items():
            values = numbers(group, quantity)
            spread = f" ± {values.std(ddof=1):.{digits}f}" if len(values) > 1 else ""
            cells.append(f"{values.mean():.{digits}f}{spread}" if len(values) else "–")
        lines.append(f"| l/{n} | {len(group)} | {np.mean([p['elements'] for p in group]):,.0f} | " + " | ".join(cells)
                     + f" | {np.mean([p['branches'] for p in group]):.1f} |")
    found = [(limit(groups, quantity), digits) for quantity, (_, digits) in QUANTITIES.items()]
    ends = ["–" if f is None else f"{f[0]:.{digits}f} ({f[1]:.1f})" for f, digits in found]
    lines.append("| limit (rate) | | | " + " | ".join(ends) + " | |")
    return lines


def table_layers(points: Points) -> list[str]:
    """A row a number of layers."""
    lines = ["| layers | elements | onset (mm) | *U* (N mm) | *D* (N mm) | tip speed (m/s) | branches |",
             "|---" * 7 + "|"]
    for n, p in points.items():
        if "failed" not in p:
            lines.append(f"| {n} | {p['elements']:,} | {p['onset_displacement']:.4f} | {p['U']:.4f} | {p['D']:.4f} | "
                         f"{p['tip_speed']:.1f} | {p['branches']} |")
    return lines


EVENT = Part("event", plan, draw, table)
LAYERS = Part("layers", plan_layers, draw_layers, table_layers)


def convergence(*, quick: Annotated[bool, FLAG] = False, fresh: Annotated[bool, FLAG] = False,
                out: Path = Path("results/study/convergence"), quiet: Annotated[bool, FLAG] = False) -> None:
    """Measure how an event changes with the size of the elements, and with the layers of a solid.

    Parameters
    ----------
    quick
        Two seeds of the sizes l/2 and l/3, in two minutes.
    fresh
        Measure all points anew; without it, those in the folder are kept.
    out
        Folder for the figures and the pictures.
    quiet
        Show no progress.
    """
    measure("convergence", [EVENT] if quick else [EVENT, LAYERS], out, quick, fresh, quiet)


if __name__ == "__main__":
    from ..cli.program import command

    command(convergence, package="study")
