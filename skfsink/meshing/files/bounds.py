"""Bounds of a mesh file: of its size, and of what a short one may stand for."""

from __future__ import annotations

from collections.abc import Callable

from .unreadable import Unreadable

__all__ = ["LARGEST", "MOST", "MOST_SETS", "Copies", "check_unpacked"]

LARGEST = 2 * 10**9         # bytes of a file, or of a keyword file of Abaqus with those that it includes
UNPACKED = (5 * 10**8, 30)  # bytes of its arrays without compression: at least this, or this many times its size
MOST = 5 * 10**6            # points of a grid that is given by its dimensions; nodes and elements that are copies
MOST_SETS = 10**6           # sets of copies


def check_unpacked(unpacked: int, size: int) -> None:
    """Compare the bytes of the arrays of a file with its size, before they are decompressed.

    Raises
    ------
    Unreadable
        They are more than a mesh can need.
    """
    if unpacked > (most := max(UNPACKED[0], UNPACKED[1] * size)):
        raise Unreadable(f"it has {size / 1e6:.3g} MB and unpacks to {unpacked / 1e6:.3g} MB, the most is "
                         f"{most / 1e6:.3g} MB; save it without compression")


class Copies:
    """Nodes, elements and sets that a file does not write out, but asks to be made from others.

    Memory: `add` counts.
    """

    def __init__(self) -> None:
        self.cells = self.sets = 0

    def add(self, cells: int, sets: int = 0, error: Callable[[str], Unreadable] = Unreadable) -> None:
        """Count nodes and elements, and sets with their entries.

        Raises
        ------
        Unreadable
            They have become too many; `error` makes it, with the line of the file for example.
        """
        self.cells += cells
        self.sets += sets
        if self.cells > MOST or self.sets > MOST_SETS:
            raise error(f"it asks for more than {MOST:,} nodes and elements, or {MOST_SETS:,} sets, that are "
                        "copies of others; write a coarser mesh")
