"""The history of a run: `history.csv`, a row at each recorded time, with the unit of each column in its header."""

from __future__ import annotations

import csv
import math
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import OutputError
from ..system.files import write_atomic
from .rows import append_rows, csv_text, finished_lines

__all__ = ["HISTORY_COLUMNS", "OF_PRESSURES", "OF_RELEASE", "Column", "History", "Table", "deletions_header",
           "history_header", "history_units", "load_name", "onset_load"]


class Column(NamedTuple):
    """A column of a history.

    Attributes
    ----------
    meaning: in words.
    unit: for a plane body: "1" for plain numbers, "" for words. N/mm and N mm/mm are N and N mm for one in space.
    kind: of its values.
    before: its value in files without the column, as those of before there was one; None if there are no such files.
    per_length: whether it is a force or an energy by a length of the body in space too, and keeps its unit.
    """

    meaning: str
    unit: str = "1"
    kind: type = float
    before: Any = None
    per_length: bool = False


_FORCE, _ENERGY, _VOLUME = "N/mm", "N mm/mm", "mm^2"  # of a plane body
#: Columns of a history, in order. Energies are those of :class:`.energy.Ledger`; what each column says of a run is in
#: :data:`skfsink.run.observers.history.VALUES`.
HISTORY_COLUMNS: dict[str, Column] = {
    "phase": Column("phase of the run", "", str),
    "step": Column("load increments, passes or time steps taken in the phase", kind=int),
    "time_s": Column("time since the start of the phase; 0 in passes, which have none", "s"),
    "grip_displacement_mm": Column("displacement of a grip", "mm"),
    "reaction_N_per_mm": Column("force on a grip along its motion", _FORCE),
    "elastic": Column("gamma-weighted stored energy", _ENERGY),
    "loads": Column("potential of the dead loads", _ENERGY, before=0.0),
    "contact": Column("energy of the lips of cracks that bear on each other; only in runs with contact", _ENERGY,
                      before=0.0),
    "kinetic": Column("gamma-weighted kinetic energy", _ENERGY),
    "work": Column("work of the grips, of pressures, and of dead loads that change", _ENERGY),
    "pressure_work": Column("of that, work of pressures; only in runs with pressures", _ENERGY, before=0.0),
    "pressure_MPa": Column("the first pressure; only in runs with pressures", "MPa", before=0.0),
    "swept_volume": Column("volume by which the boundary of the first pressure has opened; only in runs with pressures",
                           _VOLUME, before=0.0),
    "sink_stored": Column("stored energy taken by the sink, the first part of D", _ENERGY),
    "sink_kinetic": Column("kinetic energy taken by the sink, the second part of D", _ENERGY),
    "deletion": Column("energy left in elements when they were deleted", _ENERGY),
    "numerical": Column("dissipation of the time integration", _ENERGY),
    "released": Column("energy given up in relaxing to equilibrium", _ENERGY),
    "viscous": Column("work done against viscosity; only in dynamic runs with a viscosity", _ENERGY, before=0.0),
    "U_paper": Column("U of the paper (Eq. 30, 32)", _ENERGY),
    "balance": Column("what the energies fail to add up to", _ENERGY),
    "tip_x_mm": Column("position of the leading tip, undeformed", "mm"),
    "tip_y_mm": Column("position of the leading tip, undeformed", "mm"),
    "tip_z_mm": Column("position of the leading tip, undeformed", "mm"),
    "crack_length_mm": Column("length of the crack, undeformed", "mm"),
    "tip_speed_m_per_s": Column("speed of the leading tip", "m/s"),
    "G_N_per_mm": Column("greatest energy release rate of a tip at the last look; only in runs that follow it", _FORCE,
                         before=math.nan, per_length=True),
    "G_tip_speed_m_per_s": Column("speed of that tip", "m/s", before=math.nan),
    "tips": Column("tips that advance", kind=int),
    "branches": Column("branches, advancing or arrested", kind=int),
    "deleted_elements": Column("failed elements, and those of debris that was removed", kind=int),
    "gamma_min": Column("least relative density of a node, with initial cracks as a share of that at the start"),
    "dt_s": Column("time step", "s"),
}
#: Columns that only runs with pressures have.
OF_PRESSURES = ("pressure_work", "pressure_MPa", "swept_volume")
#: Columns that only runs with an :class:`.EnergyRelease` have.
OF_RELEASE = ("G_N_per_mm", "G_tip_speed_m_per_s")
_IN_SPACE = {_FORCE: "N", _ENERGY: "N mm", _VOLUME: "mm^3"}
_SUFFIX = {"s": "_s", "mm": "_mm", "m/s": "_m_per_s", "N/mm": "_N_per_mm", "N": "_N", "N mm/mm": "_N_mm_per_mm",
           "N mm": "_N_mm", "MPa": "_MPa", "mm^2": "_mm2", "mm^3": "_mm3", "1": "", "": ""}
_MISSING: dict[type, Any] = {str: "", int: 0, float: math.nan}


def history_units(dim: int) -> dict[str, str]:
    """Unit of each column for a body of 2 or 3 dimensions: "1" for plain numbers, "" for words."""
    in_space = _IN_SPACE if dim == 3 else {}
    return {name: column.unit if column.per_length else in_space.get(column.unit, column.unit)
            for name, column in HISTORY_COLUMNS.items()}


def history_header(dim: int) -> list[str]:
    """Names of the columns in the file: each says its unit, as `elastic_N_mm_per_mm` in 2D and `elastic_N_mm` in 3D."""
    plane = history_units(2)
    return [name.removesuffix(_SUFFIX[plane[name]]) + _SUFFIX[unit] for name, unit in history_units(dim).items()]


def load_name(dim: int) -> str:
    """Name of the load in files: it says N/mm of a plane body and N of one in space."""
    return "reaction_N_per_mm" if dim == 2 else "reaction_N"


def onset_load(onset: Mapping[str, Any]) -> Any:
    """The load in the `onset` of a summary, under either name; None if it is not there.

    Summaries of schema 1 have `reaction_N_per_mm` for bodies in space too, with a value in N.
    """
    return onset.get("reaction_N", onset.get("reaction_N_per_mm"))


def deletions_header(clock: str) -> list[str]:
    """Columns of `deletions.csv` of an event whose clock counts "s" or "pass"."""
    return ["time_s" if clock == "s" else "pass", "element"]


class Table(dict[str, np.ndarray]):
    """Columns of a history by name: of `HISTORY_COLUMNS`, or as they stand in the header of the file.

    Attributes
    ----------
    dim: dimensions of the body, 2 or 3; 3 of one of revolution.
    units: of the columns, by name of `HISTORY_COLUMNS`; "" for a column of a file that this does not have.
    without: columns that the file does not have; they have a value for files of before, :attr:`Column.before`.
    """

    def __init__(self, columns: Mapping[str, np.ndarray], dim: int, without: Collection[str] = ()) -> None:
        super().__init__(columns)
        self.without = frozenset(without)
        self.dim, self.units = dim, {**history_units(dim), **dict.fromkeys(columns.keys() - HISTORY_COLUMNS.keys(), "")}

    def __missing__(self, name: str) -> np.ndarray:
        names = dict(zip(history_header(self.dim), HISTORY_COLUMNS))
        if name not in names:
            raise KeyError(name)
        return self[names[name]]


class History:
    """The table of a run, a row at each recorded time, in memory and in a file that grows with it.

    Memory: the `rows`; `append` adds to them, `columns` has all so far.

    Parameters
    ----------
    path: of the CSV file, written anew here.
    rows: to start with, from a checkpoint.
    dim: dimensions of the body, :attr:`.Space.volume_dim`, on which the units of forces and energies depend.
    without: columns that the file does not have; they have a value for files of before, :attr:`Column.before`.

    Attributes
    ----------
    rows: a dictionary with a value for each of `HISTORY_COLUMNS` for every row.
    without: as given.
    """

    def __init__(self, path: str | Path, rows: Sequence[Mapping[str, Any]] = (), dim: int = 2,
                 without: Collection[str] = ()) -> None:
        self.path, self.dim, self.without = Path(path), dim, frozenset(without)
        self.rows = [_row(row) for row in rows]
        self._written = [name for name in HISTORY_COLUMNS if name not in without]
        header = [name for name, column in zip(history_header(dim), HISTORY_COLUMNS) if column in self._written]
        write_atomic(self.path, csv_text([header, *map(self._cells, self.rows)]))

    def _cells(self, row: Mapping[str, Any]) -> list[Any]:
        return [row[name] for name in self._written]

    def append(self, row: Mapping[str, Any]) -> None:
        """Add a row. Columns that it leaves out are as :attr:`Column.before` says, else NaN, and counts 0; an unknown
        column is a KeyError."""
        self.rows.append(_row(row))
        append_rows(self.path, [self._cells(self.rows[-1])])

    def columns(self) -> Table:
        """The columns as arrays (rows,): `phase` of str, counts of int64, all others of float64."""
        return Table(_columns({name: [row[name] for row in self.rows] for name in HISTORY_COLUMNS}), self.dim,
                     self.without)

    @staticmethod
    def load(path: str | Path) -> Table:
        """Columns of a history file, as in :meth:`columns`; a last line that was not finished is left out.

        A file of version 0.1, whose header does not tell units, is taken to be of a body in space if it has a z. A
        column of the file that is not in `HISTORY_COLUMNS` keeps its name: numbers, or else text, without a unit.

        Raises
        ------
        OutputError
            The file cannot be read, is not a history, or has not all columns.
        """
        text = finished_lines(path, "the history ")
        try:
            header, *lines = csv.reader(text)
            known, dim = _known(header)
            values = {name: [line[i] for line in lines] for name, i in known.items()}
            columns = _columns({name: values.get(name, [column.before] * len(lines))
                                for name, column in HISTORY_COLUMNS.items()})
            unknown = {name: _unknown(values[name]) for name in known if name not in HISTORY_COLUMNS}
        except OutputError as error:
            raise OutputError(f"{path} is not a history file of this version, or is damaged: {error}") from None
        except (IndexError, ValueError) as error:
            raise OutputError(f"{path} is not a history file of skfsink, or is damaged") from error
        return Table({**columns, **unknown}, dim or (3 if np.isfinite(columns["tip_z_mm"]).any() else 2),
                     HISTORY_COLUMNS.keys() - known.keys())


def _known(header: list[str]) -> tuple[dict[str, int], int]:
    """Place of each column in a file by its header, and the dimensions of its body, 0 if it does not tell.

    ValueError: it is no header, or a column is there twice. OutputError: one is missing that has no value for files of
    before.
    """
    found = []
    for dim in (2, 3, 0):
        names = dict(zip(history_header(dim) if dim else HISTORY_COLUMNS, HISTORY_COLUMNS))
        known = {names.get(column, "" if column in HISTORY_COLUMNS else column): i for i, column in enumerate(header)}
        missing = [name for name, column in HISTORY_COLUMNS.items() if name not in known and column.before is None]
        found.append((missing, known, dim))
    missing, known, dim = min(found, key=lambda one: len(one[0]))
    if len(known) < len(header) or len(missing) > len(HISTORY_COLUMNS) / 2:
        raise ValueError
    if missing:
        raise OutputError(f"it has no column {missing[0]}; one that files of before lack needs a value `before` in "
                          f"HISTORY_COLUMNS")
    return known, dim


def _unknown(values: Sequence[str]) -> np.ndarray:
    """Values of a column of which only the name is known: numbers, or else text."""
    try:
        return np.array(values, float)
    except ValueError:
        return np.array(values, str)


def _row(values: Mapping[str, Any]) -> dict[str, Any]:
    if unknown := values.keys() - HISTORY_COLUMNS.keys():
        raise KeyError(f"the history has no column {', '.join(sorted(unknown))}")
    return {name: column.kind(values.get(name, _MISSING[column.kind] if column.before is None else column.before))
            for name, column in HISTORY_COLUMNS.items()}


def _columns(values: Mapping[str, Sequence[Any]]) -> dict[str, np.ndarray]:
    return {name: np.array([column.kind(value) for value in values[name]], column.kind)
            for name, column in HISTORY_COLUMNS.items()}
