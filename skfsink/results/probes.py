"""Files of probes: `probes/NAME.csv`, rows at each look, with the unit of each column in its header."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import OutputError
from ..system.files import write_atomic
from .rows import append_rows, csv_text, finished_lines

__all__ = ["PROBES", "ProbeFile", "ProbeTable", "column_name", "read_probes"]

PROBES = "probes"  # folder
PHASES = ("loading", "event")
#: columns that every file begins with
FIRST = ("phase", "step", "time_s", "grip_displacement_mm")
#: what the name of a column with that unit ends with
ENDINGS: Mapping[str, str] = {"N/mm": "_N_per_mm", "mm/s": "_mm_per_s", "mm^3": "_mm3", "mm^2": "_mm2", "MPa": "_MPa",
                              "mm": "_mm", "N": "_N", "s": "_s"}


def column_name(name: str, unit: str) -> str:
    """Name of a column in the file, with its unit; that of a pure number, "1", is not said."""
    return name + ENDINGS.get(unit, "")


class ProbeFile:
    """A file that grows by rows.

    Memory: the rows are in the file; `append` adds to them.

    Parameters
    ----------
    path: of the file, written anew here.
    columns: names after those that every file begins with.
    rows: to begin with, (m, columns); see :meth:`append`.
    """

    def __init__(self, path: Path, columns: Sequence[str], rows: np.ndarray) -> None:
        self.path = path
        write_atomic(path, csv_text([[*FIRST, *columns], *_cells(rows)]))

    def append(self, rows: np.ndarray) -> None:
        """Add rows (m, columns): number of the phase in `PHASES`, step, time [s], displacement [mm], and the values."""
        append_rows(self.path, _cells(rows))


def _cells(rows: np.ndarray) -> list[list[Any]]:
    return [[PHASES[int(row[0])], int(row[1]), *row[2:]] for row in rows.tolist()]


class ProbeTable(dict[str, np.ndarray]):
    """Columns of the file of a probe, by their names in it, as arrays (rows,).

    Attributes
    ----------
    units: of the columns, "1" for pure numbers, "" for words.
    points: of a line, their number, else 1: so many rows belong to one look.
    """

    def __init__(self, columns: Mapping[str, np.ndarray]) -> None:
        super().__init__(columns)
        self.units = {name: _unit(name) for name in self}
        s = self.get("s_mm", np.zeros(0))
        back = np.flatnonzero(np.diff(s) <= 0.0)
        self.points = 1 if "s_mm" not in self else int(back[0]) + 1 if back.size else max(1, s.size)

    def look(self, name: str) -> np.ndarray:
        """A column with a row for each look, (looks, points); of what is not a line (looks, 1).

        Raises
        ------
        OutputError
            There is no such column.
        """
        if name not in self:
            raise OutputError(f"the probe has no column {name!r}; it has {', '.join(self)}")
        return self[name].reshape(-1, self.points)


def _unit(name: str) -> str:
    if name == "phase":
        return ""
    return next((unit for unit, ending in ENDINGS.items() if name.endswith(ending)), "1")


def read_probes(folder: Path) -> dict[str, ProbeTable]:
    """The probes of the run in a folder, by name; a last line that was not finished is left out.

    Raises
    ------
    OutputError
        A file cannot be read, or is not a file of a probe.
    """
    return {path.stem: _read(path) for path in sorted((folder / PROBES).glob("*.csv"))}


def _read(path: Path) -> ProbeTable:
    text = finished_lines(path)
    try:
        header, *lines = csv.reader(text)
        if tuple(header[:len(FIRST)]) != FIRST or any(len(line) != len(header) for line in lines):
            raise ValueError
        kinds: dict[str, Any] = {"phase": str, "step": int}
        columns = {name: np.array([line[i] for line in lines], str).astype(kinds.get(name, float))
                   for i, name in enumerate(header)}
    except ValueError:
        raise OutputError(f"{path} is not the file of a probe, or is damaged") from None
    return ProbeTable(columns)
