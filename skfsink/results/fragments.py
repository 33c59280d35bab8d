"""`fragments.csv`: the pieces of a body at each look, and at the end of the run."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import OutputError
from ..system.files import write_atomic
from .rows import append_rows, csv_text, finished_lines

__all__ = ["FRAGMENTS", "append_fragments", "fragment_columns", "read_fragments", "write_fragments"]

FRAGMENTS = "fragments.csv"
_WHOLE = ("step", "piece", "elements")  # columns of whole numbers
_AXES = ("x", "y", "z")


def fragment_columns(dim: int, volume_dim: int) -> list[str]:
    """Names of the columns with their units, after `step` and `time_s`; of a plane body per mm of thickness.

    They are those of the dimensions of mesh and body, :attr:`.Space.dim` and :attr:`.Space.volume_dim`.
    """
    plane = volume_dim == 2
    per, axes, turns = "_per_mm" if plane else "", _AXES[:dim], _AXES[2:] if dim == 2 else _AXES
    return ["piece", "elements", "area_mm2" if plane else "volume_mm3", f"mass_t{per}",
            *(f"centre_{axis}_mm" for axis in axes), *(f"velocity_{axis}_mm_per_s" for axis in axes),
            *(f"momentum_{axis}_N_s{per}" for axis in axes), f"kinetic_N_mm{per}", f"translation_N_mm{per}",
            f"rotation_N_mm{per}", *(f"angular_momentum_{axis}_N_mm_s{per}" for axis in turns),
            *(f"spin_{axis}_rad_per_s" for axis in turns)]


def write_fragments(path: Path, columns: Sequence[str], rows: np.ndarray) -> None:
    """Write the file anew with `rows` (m, 2 + columns): step, time, and the `columns` of :func:`fragment_columns`."""
    header = ["step", "time_s", *columns]
    write_atomic(path, csv_text([header, *_cells(rows, header)]))


def append_fragments(path: Path, columns: Sequence[str], rows: np.ndarray) -> None:
    """Add rows to the file (OutputError)."""
    append_rows(path, _cells(rows, ["step", "time_s", *columns]))


def _cells(rows: np.ndarray, header: Sequence[str]) -> list[list[Any]]:
    return [[int(value) if name in _WHOLE else value for name, value in zip(header, row)] for row in rows.tolist()]


def read_fragments(path: Path) -> dict[str, np.ndarray]:
    """Columns of the file by their names, as arrays (rows,); a last line that was not finished is left out.

    Raises
    ------
    OutputError
        The file cannot be read, or is not a file of fragments.
    """
    text = finished_lines(path)
    try:
        header, *lines = csv.reader(text)
        known = [fragment_columns(*dims) for dims in ((2, 2), (3, 3), (2, 3))]
        if header[2:] not in known or any(len(x) != len(header) for x in lines):
            raise ValueError
        return {name: np.array([line[i] for line in lines], str).astype(int if name in _WHOLE else float)
                for i, name in enumerate(header)}
    except ValueError:
        raise OutputError(f"{path} is no file of fragments, or is damaged") from None
