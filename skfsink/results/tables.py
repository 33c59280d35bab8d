"""Tables about runs: a row for each figure, a column for each run."""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..units import MMHG
from .energies import ENERGIES
from .history import onset_load

if TYPE_CHECKING:
    from .loader import Run

__all__ = ["EMPTY", "Row", "Table", "cost_table", "energy_tables", "key_table", "number", "row_of", "table_of",
           "version_table"]

EMPTY = "–"


@dataclass(frozen=True)
class Row:
    """A line of a table: what it is, its unit ("" for none), and a cell for each run."""

    name: str
    unit: str
    cells: tuple[str, ...]

    @property
    def empty(self) -> bool:
        """Whether no run has it."""
        return all(cell == EMPTY for cell in self.cells)


@dataclass(frozen=True)
class Table:
    """Rows under the names of their columns."""

    caption: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]

    @property
    def units(self) -> bool:
        """Whether a row has a unit."""
        return any(row.unit for row in self.rows)

    def __str__(self) -> str:
        cells = [["", *(["unit"] if self.units else []), *self.columns],
                 *([row.name, *([row.unit] if self.units else []), *row.cells] for row in self.rows)]
        widths = [max(map(len, column)) for column in zip(*cells)]
        return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip() for line in cells)

    def _repr_html_(self) -> str:
        """For a notebook."""
        def line(kind: str, cells: Sequence[str]) -> str:
            return "<tr>" + "".join(f"<{kind}>{html.escape(cell)}</{kind}>" for cell in cells) + "</tr>"

        head = line("th", ["", *(["unit"] if self.units else []), *self.columns])
        rows = [line("td", [row.name, *([row.unit] if self.units else []), *row.cells]) for row in self.rows]
        return f"<table><thead>{head}</thead><tbody>{''.join(rows)}</tbody></table>"


def number(value: Any) -> str:
    """A value as it is printed: four digits of a float, groups of three of a whole number, a dash for none."""
    if value is None or value == "" or (isinstance(value, float) and not math.isfinite(value)):
        return EMPTY
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, int | np.integer):
        return f"{value:,}"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def row_of(name: str, unit: str | Sequence[str], values: Sequence[Any]) -> Row:
    """A row with a value for each run; where the units of the runs differ they stand in the cells."""
    units = [unit] * len(values) if isinstance(unit, str) else list(unit)
    cells = [number(value) for value in values]
    if len(set(units)) == 1:
        return Row(name, units[0], tuple(cells))
    return Row(name, "", tuple(cell if cell == EMPTY else f"{cell} {cell_unit}"
                               for cell, cell_unit in zip(cells, units)))


def table_of(caption: str, labels: Sequence[str], rows: Sequence[Row]) -> Table:
    """A table of the rows that some run has."""
    return Table(caption, tuple(labels), tuple(row for row in rows if not row.empty))


def _get(run: Run, *keys: str) -> Any:
    value: Any = run.summary
    for key in keys:
        value = value.get(key) if isinstance(value, dict) else None
    return value


def _scaled(factor: float, *keys: str) -> Callable[[Run], Any]:
    def get(run: Run) -> Any:
        value = _get(run, *keys)
        return None if value is None else value * factor
    return get


def _beginning(run: Run) -> str | None:
    place, boundary = _get(run, "onset", "place_mm"), _get(run, "onset", "boundary")
    return None if place is None else f"{boundary}, ({', '.join(f'{x:.3g}' for x in place)}) mm"


def _fastest(run: Run) -> Any:
    speed = run.event["tip_speed_m_per_s"]
    return float(np.nanmax(speed)) if run.analysis == "dynamic" and np.isfinite(speed).any() else None


def _share(wave: tuple[float, float] | None, speed: Any, which: int) -> Any:
    return None if wave is None or speed is None else speed / wave[which]


def key_table(runs: Sequence[Run], labels: Sequence[str], waves: Sequence[tuple[float, float] | None]) -> Table:
    """The figures that a run is made for; `waves` are the wave speeds (c_s, c_R) [m/s] where they are known."""
    units = [run.history.units for run in runs]
    force, energy = [u["reaction_N_per_mm"] for u in units], [u["elastic"] for u in units]
    fastest = [_fastest(run) for run in runs]
    mean = [_get(run, "event", "mean_tip_speed_m_per_s") for run in runs]

    def row(name: str, unit: str | Sequence[str], *keys: str, factor: float = 0.0) -> Row:
        get = _scaled(factor, *keys) if factor else lambda run: _get(run, *keys)
        return row_of(name, unit, [get(run) for run in runs])

    rows = [
        row("greatest load while it was loaded", force, "loading", "greatest_load"),
        row("greatest W/Φ while it was loaded", "", "loading", "greatest_W_over_phi"),
        row("nominal strength", "MPa", "material_point", "nominal_strength_MPa"),
        row("nominal strength by theory, incompressible", "MPa", "material_point", "nominal_strength_theory_MPa"),
        row("displacement of the grips at the onset", "mm", "onset", "displacement_mm"),
        row_of("load at the onset", force, [onset_load(_get(run, "onset") or {}) for run in runs]),
        row("pressure at the onset", "kPa", "onset", "pressure_MPa", factor=1e3),
        row("pressure at the onset", "mmHg", "onset", "pressure_MPa", factor=MMHG),
        row("greatest pressure while it was loaded", "kPa", "loading", "greatest_pressure_MPa", factor=1e3),
        row("elastic energy at the onset", energy, "onset", "elastic_energy"),
        row_of("where it begins to fail", "", [_beginning(run) for run in runs]),
        row("first arrival of the crack at an edge", "µs", "event", "first_arrival_s", factor=1e6),
        row("first arrival of the crack at an edge", "pass", "event", "first_arrival_pass"),
        row_of("mean tip speed until the first arrival or the end", "m/s", mean),
        row_of("mean speed over c_R", "", [_share(w, v, 1) for w, v in zip(waves, mean)]),
        row_of("greatest speed of the tip", "m/s", fastest),
        row_of("greatest speed over c_R", "", [_share(w, v, 1) for w, v in zip(waves, fastest)]),
        row("branches", "", "event", "max_branches"),
        row("came apart", "", "event", "separated"),
        row("pieces at the end", "", "event", "pieces"),
        row("of these debris, smaller than l", "", "event", "debris"),
        row("U at the first arrival", energy, "energy", "U_paper_at_arrival"),
        row("D at the first arrival", energy, "energy", "D_sink_at_arrival"),
        row("U at the end", energy, "energy", "U_paper_final"),
        row("D at the end", energy, "energy", "D_sink_final"),
        row("failed elements", "", "deleted_elements"),
        row("balance error, of the onset energy", "%", "energy", "balance_error_relative", factor=100.0),
    ]
    if any(_get(run, "whole", name) not in (None, 1.0) for run in runs for name in ("energy", "load", "displacement")):
        rows += [row(f"of the whole sample: {name}", unit, "quantities", key) for name, unit, key in (
            ("load at the onset", force, "onset_load"), ("displacement at the onset", "mm", "onset_displacement"),
            ("U at the first arrival", energy, "U"), ("D at the first arrival", energy, "D"))]
    return table_of("Key figures", labels, rows)


def energy_tables(runs: Sequence[Run], labels: Sequence[str]) -> list[Table]:
    """Where the energy of the event is: of one run at its start, at the first arrival and at the end; of several a
    table of each of the latter two."""
    moments = {"start": "at the start", "arrival": "at the first arrival", "end": "at the end"}

    def rows(*keys: str) -> list[Row]:
        units = [run.history.units["elastic"] for run in runs for _ in keys]
        return [row_of(meaning, units, [getattr(run.energies.get(name), key, None) for run in runs for key in keys])
                for name, _, meaning in ENERGIES]  # a run that did not fail has none

    if len(runs) == 1:
        return [table_of("Energies of the event", tuple(moments.values()), rows(*moments) if runs[0].energies else [])]
    return [table_of(f"Energies {moments[key]}", labels, rows(key)) for key in ("arrival", "end")]


def cost_table(runs: Sequence[Run], labels: Sequence[str]) -> Table:
    """What the runs have cost."""
    def row(name: str, unit: str, *keys: str) -> Row:
        return row_of(name, unit, [_get(run, *keys) for run in runs])

    walls = [_get(run, "cost", "wall_s") or {} for run in runs]
    phases = list(dict.fromkeys(phase for wall in walls for phase in wall))
    rows = [row_of(f"wall time, {phase}", "s", [wall.get(phase) for wall in walls]) for phase in phases]
    rows.append(row_of("wall time, in all", "s", [sum(wall.values()) if wall else None for wall in walls]))
    rows += [row("steps or passes", "", "cost", "steps"),
             row("steps rejected", "", "cost", "rejected_steps"), row("solves for γ", "", "cost", "gamma_solves"),
             row("mass added to small elements, of that of the body", "", "event", "added_mass"),
             row("factorisations", "", "cost", "factorisations"), row("peak memory", "MB", "cost", "peak_rss_mb"),
             row("elements", "", "elements"), row("unknowns, displacement", "", "unknowns", "displacement"),
             row("unknowns, density", "", "unknowns", "density"),
             row_of("threads (0: as many as the machine lends)", "", [run.parameters.get("threads") for run in runs])]
    return table_of("Cost", labels, rows)


def version_table(runs: Sequence[Run], labels: Sequence[str]) -> Table:
    """Versions of the libraries, and the machine."""
    found = [_get(run, "versions") or {} for run in runs]
    names = list(dict.fromkeys(name for versions in found for name in versions))
    return table_of("Versions and machine", labels, [row_of(name, "", [v.get(name) for v in found]) for name in names])
