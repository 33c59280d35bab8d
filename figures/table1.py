"""Table 1: dissipated energy of the single-edge notched plate on three meshes beside the paper's, text and picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import paper
from layout import BLUE, RED, save, script
from matplotlib.figure import Figure

from skfsink.results import reference
from skfsink.system.files import write_atomic


def draw(path: Path) -> None:
    """Draw the picture, and write the table beside it."""
    results = {mesh: reference.load("single_edge_notch", f"{mesh}-dynamic").summary for mesh in paper.TABLE_1}
    lines = ["| mesh | element size | elements | elements, paper | *U* at arrival | *U* at the end | *U*, paper "
             "| *D* at arrival | branches |", "|---|---|---|---|---|---|---|---|---|"]
    for mesh, (elements, printed) in paper.TABLE_1.items():
        summary = results[mesh]
        energy = summary["energy"]
        lines.append(f"| {mesh} | *l*/{mesh[1:]} | {summary['elements']:,} | {elements:,} "
                     f"| {energy['U_paper_at_arrival']:.3f} | {energy['U_paper_final']:.3f} | {printed:.3f} "
                     f"| {energy['D_sink_at_arrival']:.3f} | {summary['event']['max_branches']} |")
    write_atomic(path.with_suffix(".md"), "\n".join([
        "Single-edge notched plate, dynamic, energies in N mm/mm.", "", *lines, ""]))
    figure = Figure((3.4, 2.5), layout="constrained")
    ax = figure.subplots()
    place = np.arange(len(results))
    for shift, label, colour, values in (
            (-0.2, "paper, Table 1", "0.7", [printed for _, printed in paper.TABLE_1.values()]),
            (0.2, "skfsink, at arrival", RED, [s["energy"]["U_paper_at_arrival"] for s in results.values()])):
        bars = ax.bar(place + shift, values, 0.38, color=colour, ec="k", linewidth=0.4, label=label)
        ax.bar_label(bars, fmt="%.3f", fontsize=7, label_type="center", color="k" if shift < 0 else "w")
    ax.plot(place + 0.2, [s["energy"]["U_paper_final"] for s in results.values()], "_", color=BLUE, markersize=16,
            label="skfsink, at the end")
    ax.set_xticks(place, [f"{mesh}\n{s['elements']:,} elements" for mesh, s in results.items()])
    ax.set(ylabel="dissipated energy $U$ (N mm/mm)", ylim=(0, 1.35 * ax.get_ylim()[1]))
    ax.legend(*(entry[::-1] for entry in ax.get_legend_handles_labels()), loc="upper left")
    save(figure, path)


if __name__ == "__main__":
    script(draw, __file__)
