"""The table of a report: which rows there are, what they say, and how they get into a document."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

__all__ = ["AGREEMENT", "COLUMNS", "difference", "markdown", "put", "rows"]

AGREEMENT = 1e-6                                 # of the reactions, where the element is the same
REFERENCE = {"jbar": "skfsink:full", "plain": "skfsink:plain"}  # whose reactions those of an element are held against
COLUMNS = ("library", "element", "direct solver", "assembly [ms]", "solve [ms]", "iterations", "five steps [s]",
           "ratio", "first call [s]", "memory [MB]", "reaction")


def difference(figures: dict[str, Any], results: dict[str, Any]) -> float:
    """Greatest relative difference of the reactions from those of skfsink with the same element; NaN without these."""
    reference = results.get(REFERENCE[figures["element"]], {}).get("reactions")
    if reference is None:
        return float("nan")
    return max(abs(a / b - 1) for a, b in zip(figures["reactions"], reference, strict=True))


def rows(results: dict[str, Any], labels: dict[str, str]) -> list[tuple[str, ...]]:
    """Cells of the table of one problem, in the order of `labels`; what is missing is left out."""
    base = results.get("skfsink", {}).get("total_s")
    table = []
    for name, label in labels.items():
        figures = results.get(name)
        if figures is None:
            continue
        if "error" in figures:
            table.append((label, *[""] * (len(COLUMNS) - 2), figures["error"]))
            continue
        off = difference(figures, results)
        if name == REFERENCE[figures["element"]]:
            agreement = "reference"
        elif math.isnan(off):
            agreement = "no reference"
        else:
            agreement = f"{off:.0e}" if off <= AGREEMENT else f"differs by {off:.1e}"
        table.append((label, {"jbar": "Q1, J̄", "plain": "Q1, J"}[figures["element"]], figures["solver"],
                      f"{figures['assembly_ms']:.0f}", f"{figures['solve_ms']:.0f}",
                      " ".join(map(str, figures["iterations"])), f"{figures['total_s']:.2f}",
                      f"{figures['total_s'] / base:.1f}" if base else "",
                      f"{figures['setup_s'] + figures['warm_up_s']:.1f}",
                      f"{figures['peak_mb'] - figures['base_mb']:.0f} + {figures['base_mb']:.0f}", agreement))
    return table


def markdown(table: list[tuple[str, ...]]) -> str:
    """A Markdown table, numbers to the right."""
    right = {3, 4, 6, 7, 8, 9}
    lines = [COLUMNS, tuple("---:" if i in right else "---" for i in range(len(COLUMNS))), *table]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def put(document: Path, marker: str, text: str) -> None:
    """Replace what stands in `document` between `<!-- marker -->` and `<!-- /marker -->`.

    Raises
    ------
    ValueError
        The document does not have both markers, once and in this order.
    """
    begin, end = f"<!-- {marker} -->", f"<!-- /{marker} -->"
    old = document.read_text(encoding="utf-8")
    if old.count(begin) != 1 or old.count(end) != 1 or old.index(begin) > old.index(end):
        raise ValueError(f"{document.name} must have {begin} and {end} once, in this order")
    head, tail = old.split(begin)[0], old.split(end)[1]
    document.write_text(f"{head}{begin}\n{text}\n{end}{tail}", encoding="utf-8")
