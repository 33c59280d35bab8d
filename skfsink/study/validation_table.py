"""The one table of the study of validation: what is known, what came out, and whether they agree."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from ..errors import OutputError
from ..system.files import write_atomic

__all__ = ["BEGIN", "END", "Row", "lines", "renew"]

BEGIN, END = "<!-- table: made by the study -->", "<!-- end of the table -->"


class Row(NamedTuple):
    """A line of the table.

    Attributes
    ----------
    quantity: what is compared, with its unit.   known: published value or closed form, and its source.
    here: what came out.   error: how far that is from converged, from the difference of two meshes.
    agrees: None if there is nothing it could be compared with.   reason: why not, or of the difference there is.
    """

    quantity: str
    known: str
    here: str
    error: str
    agrees: bool | None
    reason: str


def lines(rows: Sequence[Row]) -> list[str]:
    """The rows as a table, a line each."""
    said = {True: "yes", False: "**no**", None: "not compared"}
    return ["| quantity | published or closed form | here | error bar | agrees | reason |", "|---|---|---|---|---|---|",
            *(f"| {' | '.join((*row[:4], said[row.agrees], row.reason))} |" for row in rows)]


def renew(page: Path, rows: Sequence[Row]) -> None:
    """Put the table of `rows` between the two marks of a page.

    Raises
    ------
    OutputError
        The page cannot be read, or has no marks.
    """
    try:
        text = page.read_text(encoding="utf-8")
    except OSError as error:
        raise OutputError(f"cannot read the page {page}: {error.strerror}") from error
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise OutputError(f"the page {page} must have the marks {BEGIN} and {END}, between which the table goes")
    write_atomic(page, "\n".join([before + BEGIN, "", *lines(rows), "", END + after]))
