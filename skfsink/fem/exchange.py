"""What the parts of a body that is computed in parts tell each other; a body in one piece tells nobody.

Elements are in one part each, nodes between parts in several: all of these have the same values of nodal fields, and
count in one of them. What a part assembles at such a node is its share; :meth:`Exchange.whole` makes the whole of it.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

__all__ = ["ALONE", "Alone", "Exchange", "Unknowns"]


class Unknowns(Protocol):
    """Vectors over some of the unknowns of the nodes, such as those that are free.

    Attributes
    ----------
    numbers: of these unknowns among those of the whole body, (m,).
    counted: mask of those that count in this part, (m,).
    size: their number in the whole body.
    """

    numbers: np.ndarray
    counted: np.ndarray
    size: int

    def whole(self, x: np.ndarray) -> None:
        """Make shares (m,) whole, in place."""

    def total(self, value: float) -> float:
        """Sum of a number of each part."""

    def dot(self, x: np.ndarray, y: np.ndarray) -> float:
        """Product over the whole body of two vectors (m,) that are whole."""


class Exchange(Protocol):
    """Sums, extremes and copies over the parts of a body. Every part has to call the same, in the same order.

    Attributes
    ----------
    counted: the nodes that count in this part.
    number: of this part.
    """

    counted: slice
    number: int

    def counts(self, n: int) -> np.ndarray:
        """Mask of the nodes that count in this part, which has n of them."""

    def whole(self, x: np.ndarray) -> np.ndarray:
        """Make the shares of nodal values (n,) or (n, k) whole, in place; returns `x`."""

    def total(self, value: float) -> float:
        """Sum of a number of each part."""

    def totals(self, values: tuple[float, ...]) -> tuple[float, ...]:
        """Sums of several."""

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Sums of arrays of the same shape in all parts."""

    def greatest(self, value: float) -> float:
        """The greatest of a number of each part; not a number if one of them is none."""

    def maxima(self, values: np.ndarray) -> np.ndarray:
        """The greatest of arrays of the same shape in all parts, entry by entry."""

    def dot(self, x: np.ndarray, y: np.ndarray) -> float:
        """Product over the whole body of two nodal fields (n,) that are whole."""

    def norm(self, x: np.ndarray) -> float:
        """Root of the product with itself."""

    def all(self, values: np.ndarray) -> np.ndarray:
        """Values (m, ...) of this part and all others, in the order of the parts."""

    def over(self, mask: np.ndarray) -> Unknowns:
        """Vectors over the unknowns marked in `mask` (n k,), k of them at a node."""

    def same(self, pieces: np.ndarray, count: int, holds: np.ndarray) -> tuple[np.ndarray, int]:
        """One number in the whole body for each of the `count` pieces of this part, and how many there are in it.

        `pieces` (n,) is the number of the piece of a node, where it `holds` (n,); there, pieces of parts are one.
        """


class _Own:
    """Unknowns of a body in one piece."""

    def __init__(self, mask: np.ndarray) -> None:
        self.size = int(mask.sum())
        self.numbers, self.counted = np.arange(self.size), np.ones(self.size, bool)

    def whole(self, x: np.ndarray) -> None:
        """Nothing to add."""

    def total(self, value: float) -> float:
        """The number itself."""
        return value

    def dot(self, x: np.ndarray, y: np.ndarray) -> float:
        """Product of two vectors."""
        return float(x @ y)


class Alone:
    """A body in one piece."""

    counted, number = slice(None), 0

    def counts(self, n: int) -> np.ndarray:
        """All of them."""
        return np.ones(n, bool)

    def whole(self, x: np.ndarray) -> np.ndarray:
        """Nothing to add."""
        return x

    def total(self, value: float) -> float:
        """The number itself."""
        return value

    def totals(self, values: tuple[float, ...]) -> tuple[float, ...]:
        """The numbers themselves."""
        return values

    def sums(self, values: np.ndarray) -> np.ndarray:
        """The array itself."""
        return values

    def greatest(self, value: float) -> float:
        """The number itself."""
        return value

    def maxima(self, values: np.ndarray) -> np.ndarray:
        """The array itself."""
        return values

    def dot(self, x: np.ndarray, y: np.ndarray) -> float:
        """Product of two vectors."""
        return float(x @ y)

    def norm(self, x: np.ndarray) -> float:
        """Root of the product with itself."""
        return math.sqrt(self.dot(x, x))

    def all(self, values: np.ndarray) -> np.ndarray:
        """The values themselves."""
        return values

    def over(self, mask: np.ndarray) -> Unknowns:
        """Vectors over the unknowns marked in `mask`."""
        return _Own(mask)

    def same(self, pieces: np.ndarray, count: int, holds: np.ndarray) -> tuple[np.ndarray, int]:
        """The numbers they have."""
        return np.arange(count), count


ALONE = Alone()
