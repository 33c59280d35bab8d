"""Runs of numbers in a file, as text or as bytes, taken one after another and never beyond the end."""

from __future__ import annotations

import warnings

import numpy as np

from .unreadable import Unreadable

__all__ = ["Binary", "Text", "places", "whole"]


def places(tags: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """Where the numbers `asked` are in `tags` (n,), each of which is there once.

    Raises
    ------
    Unreadable
        One of `tags` is there twice, or one that is asked for is not there.
    """
    order = np.argsort(tags, kind="stable")
    known = tags[order]
    if (twice := known[1:][known[1:] == known[:-1]]).size:
        raise Unreadable(f"it has the node {twice[0]} twice")
    place = np.searchsorted(known, asked)
    if asked.size and (not len(known) or (known[np.minimum(place, len(known) - 1)] != asked).any()):
        raise Unreadable("it has elements with nodes that do not exist")
    found: np.ndarray = order[place]
    return found


def whole(values: np.ndarray) -> np.ndarray:
    """Numbers as int64.

    Raises
    ------
    Unreadable
        One is not whole, or has more than 53 bits.
    """
    if values.dtype.kind == "f":
        if not (np.abs(values) < 2.0**53).all() or (values != np.floor(values)).any():
            raise Unreadable("a number in it must be whole and is not")
    elif values.dtype.kind == "u" and values.size and values.max() >= 2**63:
        raise Unreadable("a number in it is too large")
    return values.astype(np.int64)


class Text:
    """Numbers in text, parted by blanks and ends of lines.

    Memory: the place in the data: `take`, `reals`, `ints`, `records`, `left`, `ahead` and `end` go on from where the
    last call ended.

    Parameters
    ----------
    text: of nothing but numbers.
    where: what the numbers are part of, for messages.
    real: whether any of them may have a fraction.

    Raises
    ------
    Unreadable
        There is something else between the numbers.
    """

    def __init__(self, text: bytes, where: str, real: bool = True) -> None:
        self.where, self.at = where, 0
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                self.values = np.fromstring(text, float if real else np.int64, sep=" ")  # type: ignore[call-overload]
            except (DeprecationWarning, ValueError):
                raise Unreadable(f"{where} has something between its numbers that is none") from None

    def take(self, n: int) -> np.ndarray:
        """The next `n` numbers."""
        if not 0 <= n <= len(self.values) - self.at:
            raise Unreadable(f"{self.where} has fewer numbers than it says")
        self.at += n
        found: np.ndarray = self.values[self.at - n:self.at]
        return found

    def reals(self, n: int) -> np.ndarray:
        """The next `n` numbers."""
        return self.take(n).astype(float)

    def ints(self, n: int) -> np.ndarray:
        """The next `n` numbers, which are whole."""
        return whole(self.take(n))

    sizes = ints

    def records(self, n: int, ints: int, reals: int) -> tuple[np.ndarray, np.ndarray]:
        """The next `n` rows of numbers of which the first are whole: these (n, ints), and the others (n, reals)."""
        rows = self.take(n * (ints + reals)).reshape(n, ints + reals)
        return whole(rows[:, :ints]), rows[:, ints:].astype(float)

    @property
    def left(self) -> int:
        """How many numbers have not been taken."""
        return len(self.values) - self.at

    def ahead(self, n: int) -> np.ndarray:
        """The next `n` numbers, which stay there to be taken."""
        found = self.take(n)
        self.at -= n
        return found

    def end(self) -> None:
        """See that all was read."""
        if self.at < len(self.values):
            raise Unreadable(f"{self.where} has more numbers than it says")


class Binary:
    """Numbers in bytes.

    Memory: the place in the data: `take`, `reals`, `ints`, `sizes`, `records` and `end` go on from where the last call
    ended.

    Parameters
    ----------
    data: the bytes.
    where: what they are part of, for messages.
    order: of the bytes, "<" or ">".
    size: bytes of a `size_t`, 4 or 8.
    """

    def __init__(self, data: bytes, where: str, order: str = "<", size: int = 8) -> None:
        self.data, self.at, self.where, self.order, self.size = data, 0, where, order, size

    def take(self, n: int, kind: str | np.dtype) -> np.ndarray:
        """The next `n` values of a type."""
        dtype = np.dtype(kind)
        if not 0 <= n <= (len(self.data) - self.at) // dtype.itemsize:
            raise Unreadable(f"{self.where} has fewer numbers than it says")
        found = np.frombuffer(self.data, dtype, n, self.at)
        self.at += n * dtype.itemsize
        return found

    def reals(self, n: int) -> np.ndarray:
        """The next `n` doubles."""
        return self.take(n, self.order + "f8").astype(float)

    def ints(self, n: int) -> np.ndarray:
        """The next `n` ints."""
        return self.take(n, self.order + "i4").astype(np.int64)

    def sizes(self, n: int) -> np.ndarray:
        """The next `n` values of `size_t`."""
        return whole(self.take(n, f"{self.order}u{self.size}"))

    def records(self, n: int, ints: int, reals: int) -> tuple[np.ndarray, np.ndarray]:
        """The next `n` rows of some ints and some doubles: (n, ints), (n, reals)."""
        rows = self.take(n, np.dtype([("i", self.order + "i4", (ints,)), ("x", self.order + "f8", (reals,))]))
        return rows["i"].astype(np.int64), rows["x"].astype(float)

    def end(self) -> None:
        """See that all was read."""
        if self.data[self.at:].strip():
            raise Unreadable(f"{self.where} has more numbers than it says")
