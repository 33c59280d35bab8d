"""Curves of the report, of one run or of several in one picture, as SVG."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ..pictures.plot import STYLE
from ..results.loader import Run
from ..results.loading import pressure_alone, way_to_onset

__all__ = ["COLOURS", "Chart", "energy_chart", "loading_chart", "speed_chart"]

#: Of the runs in their order; they differ in lightness too, and the lines in their dashes.
COLOURS = ("#33658a", "#d1495b", "#2a9d5c", "#8a5a00", "#7b4ea3", "#4d4d4d")
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1)), "-.", (0, (8, 2)), (0, (3, 1, 1, 1, 1, 1)))
_SVG = {**STYLE, "svg.hashsalt": "skfsink", "font.size": 9, "axes.labelsize": 9, "legend.fontsize": 8,
        "xtick.labelsize": 8, "ytick.labelsize": 8}
_SIZE = (6.4, 3.3)  # [in]


@dataclass(frozen=True)
class Chart:
    """A picture with what it says in words."""

    svg: bytes
    alt: str


def _lines(runs: Sequence[Run], labels: Sequence[str], column: str = "") -> list[tuple[Run, str, dict[str, Any]]]:
    """The runs, their labels and looks; the legend has the unit of a column of the history where the runs differ."""
    units = [run.history.units[column] if column else "" for run in runs]
    names = labels if len(set(units)) == 1 else [f"{label}, {unit}" for label, unit in zip(labels, units)]
    return [(run, label, {"color": COLOURS[i % len(COLOURS)], "linestyle": DASHES[i % len(DASHES)], "label": name})
            for i, (run, label, name) in enumerate(zip(runs, labels, names))]


def _unit(runs: Sequence[Run], column: str) -> str:
    return " or ".join(sorted({run.history.units[column] for run in runs}, reverse=True))


@matplotlib.rc_context(_SVG)
def speed_chart(runs: Sequence[Run], labels: Sequence[str],
                waves: Sequence[tuple[float, float] | None]) -> Chart | None:
    """Speed of the leading tip over time, with the wave speeds (c_s, c_R) [m/s] of each material that is known.

    None if no run has a dynamic event.
    """
    figure = Figure(_SIZE, layout="constrained")
    ax = figure.subplots()
    sentences, drawn = [], []
    for run, label, look in _lines(runs, labels):
        event = run.event
        if run.analysis != "dynamic" or len(event["time_s"]) < 2:
            continue
        speed = event["tip_speed_m_per_s"]
        ax.plot(event["time_s"] * 1e6, speed, **look)
        drawn.append((waves[list(labels).index(label)], look["color"]))
        sentences.append(f"{label}: at most {np.nanmax(speed):.3g} m/s")
    if not sentences:
        return None
    known = {pair for pair, _ in drawn if pair is not None}
    for pair in sorted(known):
        colour = "0.25" if len(known) == 1 else next(colour for wave, colour in drawn if wave == pair)
        for value, name, dashes in zip(pair, ("c_s", "c_R"), ("-", "--")):
            ax.axhline(value, color=colour, linewidth=0.8, linestyle=dashes, label=f"${name}$ = {value:.1f} m/s")
        sentences.append(f"shear wave speed c_s {pair[0]:.3g} m/s, Rayleigh wave speed c_R {pair[1]:.3g} m/s")
    ax.set(xlabel="time since onset (µs)", ylabel="speed of the leading tip (m/s)", ylim=(0, None), xmargin=0)
    figure.legend(loc="outside upper left", ncols=3)
    return Chart(_svg(figure), "Speed of the leading tip over time. " + "; ".join(sentences) + ".")


@matplotlib.rc_context(_SVG)
def energy_chart(runs: Sequence[Run], labels: Sequence[str]) -> Chart | None:
    """U and D over the length of the crack, on which dynamic and quasi-static runs can be compared; None if no crack
    grew."""
    figure = Figure(_SIZE, layout="constrained")
    axes = figure.subplots(1, 2, sharex=True)
    sentences = []
    for run, label, look in _lines(runs, labels, "U_paper"):
        event = run.event
        length = event["crack_length_mm"]
        if not len(length) or not np.nanmax(length, initial=0.0) > 0:
            continue
        parts = event["U_paper"], event["sink_stored"] + event["sink_kinetic"]
        unit = event.units["U_paper"]
        for ax, name, values in zip(axes, "UD", parts):
            ax.plot(length, values, **look)
            ax.set(title=f"${name}$", xlabel="length of the crack (mm)")
        sentences.append(f"{label}: U {parts[0][-1]:.3g}, D {parts[1][-1]:.3g} {unit} at the end")
    if not sentences:
        return None
    for ax in axes:  # not before all lines are drawn, which would leave out what goes beyond the first
        ax.set(xlim=(0, None), ylim=(0, None))
    axes[0].set_ylabel(f"energy ({_unit(runs, 'U_paper')})")
    if len(runs) > 1:
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=3)
    return Chart(_svg(figure), "U and D over the length of the crack. " + "; ".join(sentences) + ".")


@matplotlib.rc_context(_SVG)
def loading_chart(runs: Sequence[Run], labels: Sequence[str]) -> Chart | None:
    """Load over the displacement of the grips up to the onset, a dot, or of bodies under pressure alone the pressure
    over the swept volume; None if no run was loaded in more than one step.
    """
    pressed = bool(runs) and all(pressure_alone(way_to_onset(run.folder)) for run in runs)
    across, up, factor = (("swept_volume", "pressure_MPa", 1e3) if pressed else
                          ("grip_displacement_mm", "reaction_N_per_mm", 1.0))
    what = "Pressure over swept volume" if pressed else "Load over displacement"
    figure = Figure((_SIZE[0], 2.6), layout="constrained")
    ax = figure.subplots()
    sentences = []
    for run, label, look in _lines(runs, labels, "reaction_N_per_mm"):
        rows = way_to_onset(run.folder)
        if len(rows["step"]) < 2:
            continue
        x, y = rows[across], factor * rows[up]
        unit = "kPa" if pressed else run.history.units[up]
        ax.plot(np.append(0, x), np.append(0, y), marker=".", **look)
        if run.event["step"].size:
            ax.plot(x[-1:], y[-1:], "o", markersize=5, color=look["color"], zorder=3)  # the onset
        sentences.append(f"{label}: {y[-1]:.3g} {unit} at {x[-1]:.3g} {run.history.units[across]}")
    if not sentences:
        return None
    ax.set(ylabel="pressure (kPa)" if pressed else f"load ({_unit(runs, up)})",
           xlabel=f"swept volume ({_unit(runs, across)})" if pressed else "displacement of the grips (mm)",
           xlim=(0, None), ylim=(0, None))
    if len(runs) > 1:
        figure.legend(loc="outside upper left", ncols=3)
    return Chart(_svg(figure), f"{what} up to the onset. " + "; ".join(sentences) + ".")


def _svg(figure: Figure) -> bytes:
    file = io.BytesIO()
    figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    return file.getvalue()
