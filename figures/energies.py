"""Dynamic against quasi-static analysis of all samples: U, D and tip speed beside the paper, as text and picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import paper
from layout import ANALYSES, RED, WIDTH, save, script, title
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from runs import CASES, key_of

from skfsink.results import reference
from skfsink.results.reference import Reference
from skfsink.system.files import write_atomic


def draw(path: Path) -> None:
    """Draw the picture, and write the table beside it."""
    results = {(case, kind): reference.load(case, key_of(case, kind)) for case in CASES for kind in ANALYSES}
    write_atomic(path.with_suffix(".md"), table(results))
    figure = Figure((WIDTH, 5.4), layout="constrained")
    (axu, axd), (axr, axs) = figure.subplots(2, 2)
    place = np.arange(len(CASES))
    for ax, quantity, text in ((axu, "U_paper", "$U$ of the paper"), (axd, "D_sink", "$D$, taken by the sink")):
        for shift, (kind, (name, colour)) in zip((-0.2, 0.2), ANALYSES.items()):
            values = [energy(results[case, kind], quantity) for case in CASES]
            ax.bar(place + shift, values, 0.38, label=name, color=colour, ec="k", linewidth=0.4)
        ax.set_ylabel(f"{text} (N mm/mm)")
        ax.legend()
    for shift, kind in zip((-0.2, 0.2), ANALYSES):
        printed = [(i + shift, paper.U[case, kind]) for i, case in enumerate(CASES) if (case, kind) in paper.U]
        axu.plot(*np.transpose(printed), "D", color="w", mec="k", markersize=5, label="" if shift > 0 else "paper")
    axu.legend()
    for ax in (axu, axd):
        ax.set_ylim(0, 1.1 * ax.get_ylim()[1])
    _ratios(axr, results)
    speeds = [results[case, "dynamic"].summary["event"]["mean_tip_speed_m_per_s"] or np.nan for case in CASES]
    axs.bar(place, speeds, 0.5, color=RED, ec="k", linewidth=0.4)
    material = results["single_edge_notch", "dynamic"].scene.material
    axs.axhline(material.shear_wave_speed, color="0.3", linewidth=0.8, label="$c_s$")
    axs.axhline(material.rayleigh_wave_speed, color="0.3", linewidth=0.8, linestyle="--", label="$c_R$")
    axs.set(ylabel="mean tip speed (m/s)", ylim=(0, 1.3 * max(material.shear_wave_speed, np.nanmax(speeds))))
    axs.legend(loc="upper right", ncols=2)
    for ax, letter, text in ((axu, "a", "dissipated energy $U$"), (axd, "b", "dissipated energy $D$"),
                             (axr, "c", "dynamic over quasi-static"), (axs, "d", "speed of the crack")):
        title(ax, letter, text)
        ax.set_xticks(place, [paper.SHORT[case] for case in CASES])
    save(figure, path)


def energy(ref: Reference, quantity: str, when: str = "at_arrival") -> float:
    """U_paper or D_sink at the arrival (at the end if nothing arrived), per mm of thickness [N mm/mm]."""
    energies = ref.summary["energy"]
    value = energies[f"{quantity}_{when}"]
    value = energies[f"{quantity}_final"] if value is None else value
    return float(value) / (ref.scene.parameters["thickness"] if ref.space.dim == 3 else 1.0)


def _ratios(ax: Axes, results: dict[tuple[str, str], Reference]) -> None:
    for shift, quantity, name, colour in ((-0.2, "U_paper", "$U$", "0.35"), (0.2, "D_sink", "$D$", "0.75")):
        ratios = [energy(results[case, "dynamic"], quantity) / energy(results[case, "quasistatic"], quantity)
                  for case in CASES]
        ax.bar(np.arange(len(CASES)) + shift, ratios, 0.38, color=colour, ec="k", linewidth=0.4, label=name)
    printed = [(i - 0.2, paper.U[case, "dynamic"] / paper.U[case, "quasistatic"]) for i, case in enumerate(CASES)
               if (case, "quasistatic") in paper.U]
    ax.plot(*np.transpose(printed), "D", color="w", mec="k", markersize=5, label="$U$, paper")
    ax.axhline(1.0, color="k", linewidth=0.6)
    ax.set(ylabel="ratio", ylim=(0, 1.25 * ax.get_ylim()[1]))
    ax.legend(loc="upper right", ncols=3)


def table(results: dict[tuple[str, str], Reference]) -> str:
    """The numbers, a row for each run."""
    rows = ["| sample | mesh | elements | analysis | onset displacement (mm) | *U* at arrival | *U* at the end "
            "| *U*, paper | *D* at arrival | *D* at the end | of it from motion | branches | mean tip speed (m/s) |",
            "|" + "---|" * 13]
    for (case, kind), ref in results.items():
        summary: dict[str, Any] = ref.summary
        event, printed = summary["event"], paper.U.get((case, kind))
        speed = event["mean_tip_speed_m_per_s"]
        motion = summary["energy"]["D_sink_kinetic"] / summary["energy"]["D_sink_final"]
        rows.append(" | ".join([
            f"| {paper.TITLES[case]}", summary["mesh"], f"{summary['elements']:,}", ANALYSES[kind][0],
            f"{summary['onset']['displacement_mm']:.4f}",
            *(f"{energy(ref, 'U_paper', when):.4f}" for when in ("at_arrival", "final")),
            "" if printed is None else f"{printed:.4f}",
            *(f"{energy(ref, 'D_sink', when):.4f}" for when in ("at_arrival", "final")), f"{motion:.0%}",
            str(event["max_branches"]), "" if speed is None else f"{speed:.1f}"]) + " |")
    return "\n".join(["Energies in N mm per mm of thickness.", "", *rows, ""])


if __name__ == "__main__":
    script(draw, __file__)
