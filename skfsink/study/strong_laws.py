"""All laws of the library at their own strength: how dynamic runs of a notched plate keep the energy, and agree.

`python -m skfsink.study.strong_laws` writes `strong_laws.json` and `strong_laws.md`, and goes on where it was stopped.
Two plates, each on three meshes, are loaded to their onset and followed for 60 us: one of 2 x 2 mm with a notch of
0.5 mm and elements of l/2, by both integrators, and the paper's with its mesh M3 (l/3), by the explicit one. Meshes of
M3 but the first need gmsh. Runs are compared with the explicit one of the same mesh at a Courant number of 0.1.
How much of a difference is chance, the part `scatter` shows: the same event at Courant numbers that hardly differ.
"""

# ruff: noqa: E402

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import logging
import time
from collections.abc import Sequence
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter

from ..errors import SkfsinkError
from ..fem import indicators
from ..material import MATERIALS, GeneralMaterial
from ..methods.controls import ExplicitControls, HHTControls
from ..run.display import Display
from ..scene.options import Options
from ..scene.registry import find_case
from .chart import page
from .meshes import load_plate
from .part import Part, Planned, Points
from .plate import Front, Plate
from .speed_accuracy import run_parts
from .store import Store

__all__ = ["strong_laws"]

END = 60e-6                  # of the events [s]
SCHEMES = {"explicit": 0.8, "explicit, Courant 0.1": 0.1, "hht": None}
REFERENCE = "explicit, Courant 0.1"
SMALL, PAPER = "2 mm, l/2", "M3"  # the plates
SCATTERED = ("yeoh", "planestress")       # the law and element that differ most from their reference
COURANTS = (*(k / 100 for k in range(76, 85)), *(k / 1000 for k in range(97, 104)))  # of the scattered runs
MINUTES = {"explicit": 0.05, "explicit, Courant 0.1": 0.25, "hht": 0.2}  # of a run of the small one
FLAG = Parameter(negative="", show_default=False)


@cache
def plate(law: str, element: str, size: str, seed: int) -> Plate:
    """The plate of a law with its own limiter."""
    if size == SMALL:
        sample = load_plate(f"plate{seed}")
    else:
        case = find_case("single_edge_notch")
        sample = case.scene({**case.default_arguments, "mesh": size, "mesh_seed": seed}, Options()).sample
    return Plate.of_law(sample, law, element=element)


def event(law: str, element: str, size: str, seed: int, scheme: str, *, courant: float | None = None) -> dict[str, Any]:
    """An event of `END`: energies at its end, how far the crack has come, and what is lost on the way.

    `courant` takes the place of that of the explicit scheme.
    """
    body, courant = plate(law, element, size, seed), courant or SCHEMES[scheme]
    state = body.onset
    state.begin_event(body.overshoot)
    integrator = body.hht(HHTControls()) if courant is None else body.explicit(ExplicitControls(courant=courant))
    front, seen, way, why = Front(body.sample), state.gamma, 0.0, ""
    cpu, arrival, worst = time.process_time(), None, 0.0
    integrator.begin(state)
    try:
        for _ in integrator.run(state, END):
            worst = max(worst, abs(state.ledger.numerical))
            if state.gamma is not seen:
                seen = state.gamma
                way = max(way, front.tip(seen))
                if arrival is None and way >= 1.0:
                    arrival = state.time * 1e6
    except SkfsinkError as error:
        why = str(error)
    ledger = state.ledger
    inside_out = indicators.inverted(body.sample.space, state.u, body.momentum.gamma)
    return {"law": law, "element": element, "size": size, "seed": seed, "scheme": scheme,
            "strength": body.law.phi / body.material.shear_modulus,
            "opening": body.onset_figures["opening_mm"] / float(np.ptp(body.sample.space.X[:, 1])),
            "ended_us": state.time * 1e6, "why": why, "numerical": ledger.numerical / ledger.initial,
            "worst": worst / ledger.initial, "D": ledger.sink, "U": ledger.paper, "way_mm": way,
            "passed_1mm_us": arrival, "steps": state.step, "rejected": integrator.rejected,
            "live_inside_out": bool(inside_out[1] > 0.5), "cpu_s": time.process_time() - cpu}


def plan(quick: bool) -> list[Planned]:
    """Every law, element, plate, mesh and scheme that is asked for."""
    laws = [(law, element) for law, kind in MATERIALS.items() for element in ("jbar", "planestress")
            if element == "jbar" or not issubclass(kind, GeneralMaterial)]
    if quick:
        runs = [(SMALL, 0, scheme) for scheme in SCHEMES if scheme != REFERENCE]
    else:
        runs = [(SMALL, seed, scheme) for seed in range(3) for scheme in SCHEMES]
        runs += [*((PAPER, seed, "explicit") for seed in range(3)), (PAPER, 0, REFERENCE)]
    return [Planned(f"{law}, {element}, {size}, mesh {seed}, {scheme}",
                    partial(event, law, element, size, seed, scheme),
                    60 * MINUTES[scheme] * (1 if size == SMALL else 15))
            for size, seed, scheme in runs for law, element in laws]


def plan_scatter(quick: bool) -> list[Planned]:
    """The event of one law on three meshes, at Courant numbers around the default and around that of the reference."""
    return [Planned(f"{courant:g}, mesh {seed}",
                    partial(event, *SCATTERED, SMALL, seed, "explicit", courant=courant), 3.0 / courant**0.7)
            for courant in (COURANTS[:1] if quick else COURANTS) for seed in range(3)]


def table(points: Points) -> list[str]:
    """A line for each law, element, plate and scheme but the reference: the worst of the meshes, means, and in brackets
    how much they differ from the reference."""
    lines = ["| law, $\\Phi/\\mu$ | element | plate | opening at the onset | scheme | worst energy fed in or "
             "lost | steps rejected | way of the crack [mm] | $D$ | processor time |", "|" + 10 * "---|"]
    groups: dict[tuple[str, str, str, str], list[dict[str, Any]]] = {}
    for p in points.values():
        if "failed" not in p:
            groups.setdefault((p["law"], p["element"], p["size"], p["scheme"]), []).append(p)
    for (law, element, size, scheme), group in sorted(groups.items(), key=_order):
        if scheme == REFERENCE:
            continue
        reference = {p["seed"]: p for p in groups.get((law, element, size, REFERENCE), [])}
        cells = [
            f"`{law}`, {group[0]['strength']:.3g}", f"`{element}`", size,
            f"{np.mean([p['opening'] for p in group]):.0%}",
            scheme + (f", stopped at {min(p['ended_us'] for p in group):.0f} µs" if any(p["why"] for p in group)
                      else ""),
            f"{max(p['worst'] for p in group):.2%}", f"{max(p['rejected'] / max(p['steps'], 1) for p in group):.1%}",
            _against(group, reference, "way_mm"), _against(group, reference, "D"),
            f"{np.mean([p['cpu_s'] for p in group]):.0f} s"]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def _order(group: tuple[tuple[str, str, str, str], Any]) -> tuple[int, bool, bool, int]:
    """Where a line of the table stands."""
    law, element, size, scheme = group[0]
    return list(MATERIALS).index(law), element != "jbar", size != SMALL, list(SCHEMES).index(scheme)


def _against(group: Sequence[dict[str, Any]], reference: dict[int, dict[str, Any]], name: str) -> str:
    """Mean over the meshes, and over those with a reference the mean of the difference, with the greatest of a mesh."""
    mean = f"{np.mean([p[name] for p in group]):.3g}"
    pairs = np.array([(p[name], reference[p["seed"]][name]) for p in group if p["seed"] in reference])
    if not pairs.size or not pairs[:, 1].all():
        return mean
    shares = pairs[:, 0] / pairs[:, 1] - 1
    most = f", a mesh {max(shares, key=abs):+.0%}" if len(shares) > 1 else ""
    return f"{mean} ({pairs[:, 0].mean() / pairs[:, 1].mean() - 1:+.1%}{most})"


def _picture(points: Points, path: Path) -> None:
    """Energy fed in or lost by each run."""
    with page(path, "", 1, 1, 3.0, width=7.0) as axes:
        names = list(dict.fromkeys((p["law"], p["element"]) for p in points.values() if "failed" not in p))
        for k, scheme in enumerate(SCHEMES):
            mine = [p for p in points.values() if p.get("scheme") == scheme]
            axes[0].plot([names.index((p["law"], p["element"])) + 0.2 * (k - 1) for p in mine],
                         [max(p["worst"], 1e-6) for p in mine], "os^"[k], markersize=4, fillstyle="none", label=scheme)
        axes[0].axhline(3e-3, color="0.6", linewidth=0.6, linestyle=":")
        axes[0].set(yscale="log", ylabel="energy fed in or lost (of the onset)")
        axes[0].set_xticks(range(len(names)), [f"{law}\n{element}" for law, element in names], fontsize=5.5)
        axes[0].legend(ncols=3)


def table_scatter(points: Points) -> list[str]:
    """Of the Courant numbers around 0.8 and 0.1: D of each mesh, and the passage of 1 mm, with standard deviations of a
    run; D and the passage of the mean mesh, with standard errors."""
    lines = ["| Courant numbers | runs | $D$, mesh 0 | mesh 1 | mesh 2 | mean of the meshes | crack passes 1 mm [µs] |",
             "|---" * 7 + "|"]
    groups: dict[bool, dict[float, list[dict[str, Any]]]] = {True: {}, False: {}}
    for key, point in points.items():
        courant = float(key.split(",")[0])
        groups[courant > 0.3].setdefault(courant, []).append(point)
    for group in groups.values():
        runs = [p for some in group.values() for p in some]
        if not runs:
            continue
        meshes = {name: [np.array([p[name] for p in runs if p["seed"] == seed]) for seed in range(3)]
                  for name in ("D", "passed_1mm_us")}
        cells = [f"{min(group):g} to {max(group):g}", f"{len(runs)}",
                 *(f"{D.mean():.1f} ± {_deviation(D):.1f}" for D in meshes["D"]),
                 *(f"{np.mean([v.mean() for v in each]):.{digits}f} ± "
                   f"{np.sqrt(sum(_deviation(v) ** 2 / len(v) for v in each)) / len(each):.{digits}f}"
                   for each, digits in zip(meshes.values(), (2, 1)))]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def _deviation(values: np.ndarray) -> float:
    """Standard deviation of a population from a sample; 0 for a single value."""
    return float(values.std(ddof=1)) if len(values) > 1 else 0.0


def _picture_scatter(points: Points, path: Path) -> None:
    """Dissipation of each run against its Courant number, a mark a mesh."""
    with page(path, "", 1, 1, 2.7, width=3.6) as axes:
        for seed in range(3):
            mine = {float(key.split(",")[0]): p["D"] for key, p in points.items() if p["seed"] == seed}
            axes[0].plot([*mine], [*mine.values()], "os^"[seed], markersize=4, fillstyle="none", label=f"mesh {seed}")
        axes[0].set(xscale="log", xlabel="Courant number", ylabel="$D$ after 60 µs")
        axes[0].legend()


PARTS = {"laws": Part("laws", plan, _picture, table),
         "scatter": Part("scatter", plan_scatter, _picture_scatter, table_scatter)}


def strong_laws(*, only: Literal["laws", "scatter"] | None = None, quick: Annotated[bool, FLAG] = False,
                fresh: Annotated[bool, FLAG] = False, out: Path = Path("results/study/strong_laws"),
                quiet: Annotated[bool, FLAG] = False) -> None:
    """Run all laws at their own strength, and one of them again and again.

    Parameters
    ----------
    only
        One part of the study: all laws, or how much the runs of one scatter.
    quick
        The small plate on one mesh, and no reference.
    fresh
        Compute all points anew; without it, those in the folder are kept.
    out
        Folder for the figures and tables.
    quiet
        Show no progress.
    """
    logging.disable(logging.WARNING)
    store = Store(out / "strong_laws.json", "strong_laws", fresh)
    try:
        with Display(quiet) as display:
            run_parts(store, [PARTS[only]] if only else list(PARTS.values()), quick, display)
    finally:
        logging.disable(logging.NOTSET)


if __name__ == "__main__":
    from ..cli.program import command

    command(strong_laws, package="study")
