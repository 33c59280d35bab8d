"""Tables of a run as CSV files that grow by rows; a last line that a kill has left unfinished is not read."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..system.files import reported

__all__ = ["append_rows", "csv_text", "finished_lines"]


def csv_text(rows: Sequence[Sequence[Any]]) -> str:
    """Rows as lines of a CSV file."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)  # floats are written by repr, which loses no bit
    return text.getvalue()


def append_rows(path: Path, rows: Sequence[Sequence[Any]]) -> None:
    """Add rows to a file (OutputError)."""
    with reported(f"cannot write {path}"), open(path, "a", encoding="utf-8", newline="") as file:
        file.write(csv_text(rows))


def finished_lines(path: str | Path, what: str = "") -> list[str]:
    """The lines of a file that are whole; an OutputError says of `what` it is."""
    with reported(f"cannot read {what}{path}"):
        text = Path(path).read_text(encoding="utf-8", errors="replace")
    return text[:text.rfind("\n") + 1].splitlines()
