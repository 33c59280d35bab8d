"""The table of a sweep, and its picture."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import MissingExtra
from ..results.history import History, history_units, onset_load
from ..system.files import replaced, write_atomic
from .one import FAILURE, RUN

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["FIGURES", "draw", "read_rows", "read_units", "write_csv", "write_parquet"]

#: columns of the table: name, unit (of `load` and `energy` in `units` of the summary), and where it has the figure
FIGURES: tuple[tuple[str, str, tuple[str | int, ...]], ...] = (
    ("onset_displacement", "mm", ("onset", "displacement_mm")),
    ("onset_load", "load", ("onset",)),
    ("greatest_load", "load", ("loading", "greatest_load")),
    ("onset_boundary", "", ("onset", "boundary")),
    ("onset_x", "mm", ("onset", "place_mm", 0)),
    ("onset_y", "mm", ("onset", "place_mm", 1)),
    ("onset_z", "mm", ("onset", "place_mm", 2)),
    ("U", "energy", ("energy", "U_paper_at_arrival")),
    ("D", "energy", ("energy", "D_sink_at_arrival")),
    ("tip_speed", "m/s", ("event", "mean_tip_speed_m_per_s")),
    ("branches", "", ("event", "max_branches")),
    ("arrival_time", "s", ("event", "first_arrival_s")),
    ("deleted_elements", "", ("deleted_elements",)),
)
DRAWN = ("U", "D", "tip_speed", "branches")


def read_rows(folders: Sequence[Path], varied: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """A row for each run: what varied, the figures of its summary (None where there are none), and its failure.

    A run of both analyses gives a row for each.
    """
    rows = []
    for folder, values in zip(folders, varied):
        path, failure = folder / RUN / "summary.json", folder / FAILURE
        summary = json.loads(path.read_text()) if path.is_file() else {}
        parts = ([summary[name] for name in ("dynamic", "quasistatic")] if summary.get("analysis") == "both"
                 else [summary])
        for part in parts:
            row = {**values, "analysis": part.get("analysis"), **{name: _look(part, at) for name, _, at in FIGURES}}
            row["onset_load"] = onset_load(row["onset_load"] or {})
            row["failure"] = failure.read_text().strip() if failure.is_file() else None if part else "not finished"
            row["verdict"] = part.get("verdict")
            row["folder"] = folder.name
            rows.append(row)
    return rows


def _look(summary: Any, at: tuple[str | int, ...]) -> Any:
    for key in at:
        if isinstance(summary, list) and isinstance(key, int):
            summary = summary[key] if key < len(summary) else None
        else:
            summary = summary.get(key) if isinstance(summary, dict) else None
    return summary


def read_units(folders: Sequence[Path]) -> dict[str, str]:
    """Unit of each figure ("" for none) in the runs of these folders: loads and energies are those of their bodies.

    Of a sweep over plane bodies and bodies in space it says which is which.
    """
    found = filter(None, (_units(folder / RUN) for folder in folders))
    dims = {3 if units["load"] == "N" else 2 for units in found} or {2}
    plane, space = history_units(2), history_units(3)

    def unit(column: str) -> str:
        return f"{plane[column]}, in space {space[column]}" if len(dims) == 2 else history_units(*dims)[column]

    units = {"load": unit("reaction_N_per_mm"), "energy": unit("elastic")}
    return {name: units.get(kind, kind) for name, kind, _ in FIGURES}


def _units(run: Path) -> dict[str, str]:
    """The `units` of a finished run; empty if it is not finished. Before schema 2 the history alone told them."""
    path = run / "summary.json"
    summary = json.loads(path.read_text()) if path.is_file() else {}
    part = "dynamic" if summary.get("analysis") == "both" else ""
    summary = summary.get(part, summary)
    if not summary or "units" in summary:
        return dict(summary.get("units", {}))
    units = History.load(run / part / "history.csv").units
    return {"load": units["reaction_N_per_mm"], "energy": units["elastic"]}


def _heading(name: str, units: Mapping[str, str]) -> str:
    return f"{name} [{units[name]}]" if units.get(name) else name


def write_csv(rows: Sequence[Mapping[str, Any]], path: Path, units: Mapping[str, str]) -> None:
    """Write the rows, with the `units` of the figures in the header."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([_heading(name, units) for name in rows[0]])
    writer.writerows(["" if value is None else value for value in row.values()] for row in rows)
    write_atomic(path, text.getvalue())


def write_parquet(rows: Sequence[Mapping[str, Any]], path: Path, units: Mapping[str, str]) -> None:
    """Write the rows as a Parquet file, with the `units` of the figures in the names of the columns.

    Raises
    ------
    MissingExtra
        pyarrow is not installed.
    """
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise MissingExtra(f"a Parquet table needs pyarrow, which cannot be imported ({error}): "
                           f"install skfsink[sweep]") from None
    table = pyarrow.table({_heading(name, units): [row[name] for row in rows] for name in rows[0]})
    with replaced(path) as temporary:
        parquet.write_table(table, temporary)


def draw(rows: Sequence[Mapping[str, Any]], varied: Sequence[str], path: Path, units: Mapping[str, str]) -> None:
    """Picture of the figures against the first parameter that varies besides the seed of the mesh.

    Each run is a point; where several share a value, their mean and standard deviation are beside them. If only the
    seed varies, the figures are drawn against it, over their mean and standard deviation.
    """
    import matplotlib.pyplot as plt
    from matplotlib.ticker import MaxNLocator

    numeric = [name for name in varied if not isinstance(rows[0][name], str | bool)]
    axis = next((name for name in numeric if name != "mesh_seed"), None)
    ensemble = axis is None and "mesh_seed" in numeric
    across = "mesh_seed" if ensemble else axis
    analyses = sorted({row["analysis"] for row in rows if row["analysis"]})
    figure, axes = plt.subplots(2, 2, figsize=(9, 6.4), sharex=True, layout="constrained")
    for name, plot in zip(DRAWN, axes.flat):
        for number, analysis in enumerate(analyses):
            pairs = np.array([(row[across] if across else 0.0, row[name]) for row in rows
                              if row["analysis"] == analysis and row[name] is not None], float).reshape(-1, 2)
            if ensemble:
                _seeds(plot, pairs, analysis, f"C{number}")
            else:
                _groups(plot, pairs, analysis, f"C{number}")
        plot.set_ylabel(f"{name.replace('_', ' ')} [{units[name]}]" if units[name] else name.replace("_", " "))
        plot.set_ylim(0, 1.12 * plot.get_ylim()[1])
        plot.grid(alpha=0.3)
        if name == "branches":
            plot.yaxis.set_major_locator(MaxNLocator(integer=True))
    for plot in axes[1]:
        if across:
            plot.set_xlabel(across.replace("_", " "))
        else:
            plot.set_xticks([0.0], [f"{len(rows)} runs"])
            plot.set_xlim(-1, 1)
    axes[0, 0].legend(frameon=False, fontsize=8, loc="lower left")
    with replaced(path) as temporary:
        figure.savefig(temporary, dpi=150, format="png")
    plt.close(figure)


def _groups(plot: Axes, pairs: np.ndarray, analysis: str, colour: str) -> None:
    """Points, and beside those of the same value their mean and standard deviation."""
    values = np.unique(pairs[:, 0])
    width = 0.02 * (np.ptp(values) if len(values) > 1 else 1.0)
    plot.plot(pairs[:, 0] - width / 2, pairs[:, 1], "o", ms=4, mfc="none", color=colour, alpha=0.7)
    groups = [pairs[pairs[:, 0] == value, 1] for value in values]
    if any(len(group) > 1 for group in groups):
        mean = [group.mean() for group in groups]
        spread = [group.std(ddof=1) if len(group) > 1 else 0.0 for group in groups]
        plot.errorbar(values + width / 2, mean, spread, fmt="s", ms=5, capsize=4, color=colour,
                      label=f"{analysis}: mean ± standard deviation")
    else:
        plot.plot([], [], "o", mfc="none", color=colour, label=analysis)


def _seeds(plot: Axes, pairs: np.ndarray, analysis: str, colour: str) -> None:
    """Points against the seed of their mesh, over a band of their mean and standard deviation."""
    plot.plot(*pairs.T, "o", ms=4, mfc="none", color=colour)
    if len(pairs) > 1:
        mean, spread = pairs[:, 1].mean(), pairs[:, 1].std(ddof=1)
        plot.axhline(mean, color=colour, linewidth=1,
                     label=f"{analysis}: mean ± standard deviation of {len(pairs)} meshes")
        plot.axhspan(mean - spread, mean + spread, color=colour, alpha=0.15, linewidth=0)
