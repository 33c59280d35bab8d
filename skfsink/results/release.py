"""Energy release rates of a run: `release.csv`, a row for each tip at each look, units in the header."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import OutputError
from ..system.files import write_atomic
from .rows import csv_text, finished_lines

__all__ = ["RELEASE", "load_release", "release_header", "write_release"]

RELEASE = "release.csv"
_WORDS = ("phase", "note")


def release_header(dim: int, clock: str) -> list[str]:
    """Columns of a body of 2 or 3 dimensions, in an event whose clock counts "s" or "pass".

    `phase` is onset or event, `tip` the number of the tip, 0 that of the notch; then where it is, where it goes, how
    fast; G, its mean over the last 4 l/c_s, G without kinetic terms and the vector J; `note` says why there is no G.
    """
    axes = "xyz"[:dim]
    return ["phase", "time_s" if clock == "s" else "pass", "tip", *(f"{x}_mm" for x in axes),
            *(f"direction_{x}" for x in axes), "speed_m_per_s", "G_N_per_mm", "G_mean_N_per_mm",
            "G_static_N_per_mm", *(f"J_{x}_N_per_mm" for x in axes), "note"]


def write_release(path: str | Path, header: Sequence[str], rows: Sequence[Sequence[Any]]) -> None:
    """Write the rows; numbers that are none stay empty."""
    cells = [["" if isinstance(value, float) and math.isnan(value) else value for value in row] for row in rows]
    write_atomic(path, csv_text([header, *cells]))


def load_release(path: str | Path) -> dict[str, np.ndarray]:
    """Columns by name (rows,) of such a file: `phase` and `note` of str, `tip` of int, others of float, NaN if empty.

    Raises
    ------
    OutputError
        The file cannot be read, or is not a file of energy release rates.
    """
    text = finished_lines(path, "the energy release rates ")
    try:
        header, *lines = csv.reader(text)
        if header not in [release_header(dim, clock) for dim in (2, 3) for clock in ("s", "pass")]:
            raise ValueError(header)
        columns = {name: [line[i] for line in lines] for i, name in enumerate(header)}
        return {name: np.array(values, str) if name in _WORDS else np.array([int(value) for value in values], int)
                if name == "tip" else np.array([float(value or "nan") for value in values])
                for name, values in columns.items()}
    except (IndexError, ValueError) as error:
        raise OutputError(f"{path} is not a file of energy release rates of skfsink, or is damaged") from error
