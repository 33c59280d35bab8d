"""Tables of a course in time, as CSV files beside a deck."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

from ..errors import ParameterError, first_line, require
from ..units import number_in

__all__ = ["SUFFIX", "read_course"]

SUFFIX = ".csv"


def read_course(path: Path, unit: str, most: int) -> list[list[float]]:
    """Points [time, value] of a file: two columns with commas, times in s and values in `unit`, or with units of their
    own; lines that begin with # say something else.

    Raises
    ------
    ParameterError
        There is no such file, or a line of it is no point; the message is to follow the name of the component.
    """
    points: list[list[float]] = []
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except FileNotFoundError:
        raise ParameterError(f": there is no file {path} of its points; a path in a deck counts from the folder of the "
                             f"deck") from None
    except (OSError, ValueError) as error:
        raise ParameterError(f": cannot read the points of {path}: {first_line(error)}") from None
    for number, row in enumerate(csv.reader(lines), 1):
        entries: list[Any] = [entry.strip() for entry in row]
        if not any(entries) or entries[0].startswith("#"):
            continue
        if len(entries) != 2:
            raise ParameterError(f": line {number} of {path} must be a time and a value with a comma between; got "
                                 f"{', '.join(entries)!r:.80}")
        if len(points) == most:
            raise ParameterError(f": {path} has more than {most} points")
        try:
            points.append([require("", number_in("", _plain(text), of), of) for text, of in zip(entries, ("s", unit))])
        except ParameterError as error:
            raise ParameterError(f": line {number} of {path}{error}") from None
    return points


def _plain(text: str) -> float | str:
    """A number without a unit, or the text as it is."""
    try:
        return float(text)
    except ValueError:
        return text
