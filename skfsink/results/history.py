"""The history of a run: `history.csv`, a row at each recorded time, with the unit of each column in its header."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import OutputError
from ..system.files import reported, write_atomic

__all__ = ["HISTORY_COLUMNS", "History", "Table", "deletions_header", "history_header", "history_units",
           "load_name", "onset_load"]

#: Columns of a history, in order, with their meaning. Energies are those of :class:`.energy.Ledger`.
HISTORY_COLUMNS: dict[str, str] = {
    "phase": "phase of the run",
    "step": "load increments, passes or time steps taken in the phase",
    "time_s": "time since the start of the phase; 0 in passes, which have none",
    "grip_displacement_mm": "displacement of a grip",
    "reaction_N_per_mm": "force on a grip along its motion",
    "elastic": "gamma-weighted stored energy",
    "loads": "potential of the dead loads",
    "kinetic": "gamma-weighted kinetic energy",
    "work": "work of the grips, and of dead loads that change",
    "sink_stored": "stored energy taken by the sink, the first part of D",
    "sink_kinetic": "kinetic energy taken by the sink, the second part of D",
    "deletion": "energy left in elements when they were deleted",
    "numerical": "dissipation of the time integration",
    "released": "energy given up in relaxing to equilibrium",
    "U_paper": "U of the paper (Eq. 30, 32)",
    "balance": "what the energies fail to add up to",
    "tip_x_mm": "position of the leading tip, undeformed",
    "tip_y_mm": "position of the leading tip, undeformed",
    "tip_z_mm": "position of the leading tip, undeformed",
    "crack_length_mm": "length of the crack, undeformed",
    "tip_speed_m_per_s": "speed of the leading tip",
    "tips": "tips that advance",
    "branches": "branches, advancing or arrested",
    "deleted_elements": "failed elements",
    "gamma_min": "least relative density of a node",
    "dt_s": "time step",
}
_LATER = ("loads",)  # columns that files of before have not; they are 0 there
_ENERGIES = ("elastic", "loads", "kinetic", "work", "sink_stored", "sink_kinetic", "deletion", "numerical",
             "released", "U_paper", "balance")
_SUFFIX = {"s": "_s", "mm": "_mm", "m/s": "_m_per_s", "N/mm": "_N_per_mm", "N": "_N", "N mm/mm": "_N_mm_per_mm",
           "N mm": "_N_mm", "1": "", "": ""}
_COUNTS = ("step", "tips", "branches", "deleted_elements")
_KIND: dict[str, type] = {**dict.fromkeys(HISTORY_COLUMNS, float), "phase": str, **dict.fromkeys(_COUNTS, int)}
_MISSING: dict[type, Any] = {str: "", int: 0, float: math.nan}


def history_units(dim: int) -> dict[str, str]:
    """Unit of each column for a body of 2 or 3 dimensions: "1" for plain numbers, "" for words."""
    force, energy = ("N/mm", "N mm/mm") if dim == 2 else ("N", "N mm")
    own = {name: next((unit for unit in ("m/s", "mm", "s") if name.endswith(_SUFFIX[unit])), "1")
           for name in HISTORY_COLUMNS}
    return {**own, "phase": "", "reaction_N_per_mm": force, **dict.fromkeys(_ENERGIES, energy)}


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
    dim: dimensions of the body, 2 or 3.   units: of the columns, by name of `HISTORY_COLUMNS`.
    """

    def __init__(self, columns: Mapping[str, np.ndarray], dim: int) -> None:
        super().__init__(columns)
        self.dim, self.units = dim, history_units(dim)

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
    dim: dimensions of the body, on which the units of forces and energies depend.

    Attributes
    ----------
    rows: a dictionary with a value for each of `HISTORY_COLUMNS` for every row.
    """

    def __init__(self, path: str | Path, rows: Sequence[Mapping[str, Any]] = (), dim: int = 2) -> None:
        self.path, self.dim = Path(path), dim
        self.rows = [_row(row) for row in rows]
        write_atomic(self.path, _csv([history_header(dim), *(row.values() for row in self.rows)]))

    def append(self, row: Mapping[str, Any]) -> None:
        """Add a row. Columns that it leaves out are NaN, counts and loads are 0; an unknown column is a KeyError."""
        self.rows.append(_row(row))
        with reported(f"cannot write {self.path}"), open(self.path, "a", encoding="utf-8", newline="") as file:
            file.write(_csv([self.rows[-1].values()]))

    def columns(self) -> Table:
        """The columns as arrays (rows,): `phase` of str, counts of int64, all others of float64."""
        return Table(_columns({name: [row[name] for row in self.rows] for name in HISTORY_COLUMNS}), self.dim)

    @staticmethod
    def load(path: str | Path) -> Table:
        """Columns of a history file, as in :meth:`columns`; a last line that was not finished is left out.

        A file of version 0.1, whose header does not tell units, is taken to be of a body in space if it has a z.

        Raises
        ------
        OutputError
            The file cannot be read, or is not a history.
        """
        with reported(f"cannot read the history {path}"):
            text = Path(path).read_text(encoding="utf-8", errors="replace")
        try:
            header, *lines = csv.reader(text[:text.rfind("\n") + 1].splitlines())
            known, dim = _known(header)
            values = {name: [line[i] for line in lines] for i, name in enumerate(known)}
            columns = _columns({name: values.get(name, ["0"] * len(lines)) for name in HISTORY_COLUMNS})
        except (IndexError, ValueError) as error:
            raise OutputError(f"{path} is not a history file of skfsink, or is damaged") from error
        return Table(columns, dim or (3 if np.isfinite(columns["tip_z_mm"]).any() else 2))


def _known(header: list[str]) -> tuple[list[str], int]:
    """Columns of a file by its header, and the dimensions of its body, 0 if it does not tell; ValueError else."""
    for left_out in ((), _LATER):
        known = [name for name in HISTORY_COLUMNS if name not in left_out]
        for dim in (2, 3):
            if header == [column for name, column in zip(HISTORY_COLUMNS, history_header(dim)) if name in known]:
                return known, dim
        if header == known:
            return known, 0
    raise ValueError


def _row(values: Mapping[str, Any]) -> dict[str, Any]:
    if unknown := values.keys() - HISTORY_COLUMNS.keys():
        raise KeyError(f"the history has no column {', '.join(sorted(unknown))}")
    return {name: kind(values.get(name, 0.0 if name in _LATER else _MISSING[kind])) for name, kind in _KIND.items()}


def _csv(rows: Sequence[Any]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)  # floats are written by repr, which loses no bit
    return text.getvalue()


def _columns(values: Mapping[str, Sequence[Any]]) -> dict[str, np.ndarray]:
    return {name: np.array([kind(value) for value in values[name]], kind) for name, kind in _KIND.items()}
