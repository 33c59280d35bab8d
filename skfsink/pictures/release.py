"""Picture of the energy release rates of a run: G and speed of each tip against time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from .plot import RED, STYLE, WIDTH, save

__all__ = ["release_picture"]


@matplotlib.rc_context(STYLE)
def release_picture(columns: Mapping[str, np.ndarray], path: str | Path, title: str, toughness: float) -> None:
    """G of each tip, with its mean, and the speed below, against time or passes.

    Parameters
    ----------
    columns: as :func:`.load_release` gives them.
    toughness: psi_f l of the sink law, the energy per area of a failed band as wide as l [N/mm], for comparison.
    """
    clock = "time_s" if "time_s" in columns else "pass"
    scale, label = (1e6, "time since onset (µs)") if clock == "time_s" else (1.0, "pass")
    event = columns["phase"] == "event"
    figure = Figure((WIDTH / 2 + 0.6, 4.2), layout="constrained")
    ax, low = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
    colours = matplotlib.colormaps["viridis"]
    numbers = np.unique(columns["tip"][event])
    for i, number in enumerate(numbers):
        rows = event & (columns["tip"] == number)
        colour, time = colours(0.85 * i / max(1, len(numbers) - 1)), scale * columns[clock][rows]
        values, mean = columns["G_N_per_mm"][rows], columns["G_mean_N_per_mm"][rows]
        timed, known = np.isfinite(mean).any(), np.isfinite(values).any()
        name = f"tip {number}" if len(numbers) < 6 and known else None
        ax.plot(time, values, ".", markersize=3, alpha=0.5 if timed else 1.0, color=colour,
                label=None if timed else name)
        if timed:
            ax.plot(time, mean, color=colour, label=name and name + ", mean")
        low.plot(time, columns["speed_m_per_s"][rows], color=colour)
    onset = columns["G_N_per_mm"][~event]
    if np.isfinite(onset).any():
        ax.axhline(onset[0], color=RED, linewidth=0.8, label="at the onset")
    ax.axhline(toughness, color="0.3", linewidth=0.8, linestyle="--", label=r"$\psi_fl$ of the sink law")
    ax.set(ylabel="energy release rate $G$ (N/mm)", ylim=(0, None))
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    low.set(xlabel=label, ylabel="speed (m/s)", ylim=(0, None))
    figure.align_ylabels()
    save(figure, path, title)
