"""The table of a sweep."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MissingExtra
from ..results.history import History, history_units, onset_load
from ..results.release import RELEASE, load_release
from ..system.files import replaced, write_atomic
from .one import FAILURE, RUN

__all__ = ["FIGURES", "read_rows", "read_units", "write_csv", "write_parquet"]

#: columns of the table: name, unit (of `load` and `energy` in `units` of the summary), and where it has the figure
FIGURES: tuple[tuple[str, str, tuple[str | int, ...]], ...] = (
    ("onset_displacement", "mm", ("onset", "displacement_mm")),
    ("onset_load", "load", ("onset",)),
    ("greatest_load", "load", ("loading", "greatest_load")),
    ("onset_pressure", "MPa", ("onset", "pressure_MPa")),
    ("onset_boundary", "", ("onset", "boundary")),
    ("onset_x", "mm", ("onset", "place_mm", 0)),
    ("onset_y", "mm", ("onset", "place_mm", 1)),
    ("onset_z", "mm", ("onset", "place_mm", 2)),
    ("onset_G", "N/mm", ("onset_G",)),
    ("U", "energy", ("energy", "U_paper_at_arrival")),
    ("D", "energy", ("energy", "D_sink_at_arrival")),
    ("tip_speed", "m/s", ("event", "mean_tip_speed_m_per_s")),
    ("branches", "", ("event", "max_branches")),
    ("arrival_time", "s", ("event", "first_arrival_s")),
    ("tear_angle", "degree", ("event", "tear_angle_degree")),
    ("deleted_elements", "", ("deleted_elements",)),
)


def read_rows(folders: Sequence[Path], varied: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """A row for each run: what varied, the figures of its summary (None where there are none), and its failure.

    A run of both analyses gives a row for each.
    """
    rows = []
    for folder, values in zip(folders, varied):
        path, failure = folder / RUN / "summary.json", folder / FAILURE
        summary = json.loads(path.read_text()) if path.is_file() else {}
        both = summary.get("analysis") == "both"
        for own in ("dynamic", "quasistatic") if both else ("",):
            found = summary[own] if both else summary
            part = {**found, "onset_G": _onset_rate(folder / RUN / own)} if found else found
            row = {**values, "analysis": part.get("analysis"), **{name: _look(part, at) for name, _, at in FIGURES}}
            row["onset_load"] = onset_load(row["onset_load"] or {})
            row["failure"] = failure.read_text().strip() if failure.is_file() else None if part else "not finished"
            row["verdict"] = part.get("verdict")
            row["warnings"] = len(part["warnings"]) if "warnings" in part else None
            row["folder"] = folder.name
            rows.append(row)
    return rows


def _onset_rate(run: Path) -> float | None:
    """Energy release rate at the onset [N/mm], of a run with the probe that follows it."""
    if not (run / RELEASE).is_file():
        return None
    rates = load_release(run / RELEASE)
    at_onset = rates["G_N_per_mm"][rates["phase"] == "onset"]
    return float(at_onset[0]) if at_onset.size and np.isfinite(at_onset[0]) else None


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
