"""Numbers on the data lines of Abaqus keyword files, many at once where the lines are alike."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator

import numpy as np

from .abaqus_lines import Block, words

__all__ = ["Numbers", "number"]


class Numbers:
    """Numbers of the data lines of a block: many at once if all lines are alike, else line by line.

    Attributes
    ----------
    table: (lines, entries) if all lines have as many, else None.
    """

    def __init__(self, block: Block, whole: bool) -> None:
        self.block, self.whole = block, whole
        lines = [line.strip() for line in block.data]
        self.at = [i for i, line in enumerate(lines) if line and not line.startswith("*")]
        lines = [lines[i].rstrip(", \t") if lines[i][-1] == "," else lines[i] for i in self.at]
        self.table: np.ndarray | None = None
        if len(counts := {line.count(",") for line in lines}) == 1 and not any("_" in line for line in lines):
            numbers = self.many(",".join(lines).split(","))
            if numbers is not None:
                self.table = numbers.reshape(len(lines), counts.pop() + 1)

    def many(self, entries: list[str]) -> np.ndarray | None:
        """Entries as numbers, or None if one is none (`1_0` is one in Python only)."""
        with contextlib.suppress(ValueError, OverflowError):
            return self._converted(entries)
        if self.whole:
            return None
        with contextlib.suppress(ValueError, OverflowError):  # numbers of Fortran: 1.5D-3
            return self._converted(",".join(entries).lower().replace("d", "e").split(","))
        return None

    def _converted(self, entries: list[str]) -> np.ndarray | None:
        if self.whole:
            return np.fromiter(map(int, entries), np.int64, len(entries))
        numbers = np.fromiter(map(float, entries), float, len(entries))
        return numbers if np.isfinite(numbers).all() else None

    def rows(self) -> Iterator[tuple[int, list[float]]]:
        """The data lines, each with its number and its entries; an empty one is 0 in the middle.

        Raises
        ------
        Unreadable
            An entry is no (whole) number, with its line.
        """
        for i in self.at:
            entries = words(self.block.data[i].strip())
            found = self.many(entries) if "_" not in self.block.data[i] else None
            yield i, found.tolist() if found is not None else [number(self.block, i, word, self.whole)
                                                              for word in entries]


def number(block: Block, i: int, word: str, whole: bool = False) -> float:
    """An entry of data line `i` as a number, a whole one if `whole`; "" is 0."""
    if not word and not whole:
        return 0.0
    try:
        value = int(word) if whole else float(word.lower().replace("d", "e"))
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or "_" in word or abs(value) > 2**62:
        raise block.error(f"{word[:40]!r} is no {'whole' if whole else 'finite'} number", i)
    return value
