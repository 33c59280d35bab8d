"""Elements of one kind in an MSH file, and the kinds that there are."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .unreadable import Unreadable

__all__ = ["DIMENSION", "NODES", "SHAPE", "Block", "agree", "nodes_of"]

#: dimension of the elements, and their number of nodes by gmsh's number of the kind
_SHAPES = {"point": 0, "line": 1, "triangle": 2, "quad": 2, "tetra": 3, "hexahedron": 3, "wedge": 3, "pyramid": 3}
_COUNTS = {
    "point": {15: 1},
    "line": {1: 2, 8: 3, 26: 4, 27: 5, 28: 6, 62: 7, 63: 8, 64: 9, 65: 10, 66: 11},
    "triangle": {2: 3, 9: 6, 20: 9, 21: 10, 22: 12, 23: 15, 24: 15, 25: 21, 42: 28, 43: 36, 44: 45, 45: 55, 46: 66,
                 52: 18, 53: 21, 54: 24, 55: 27, 56: 30},
    "quad": {3: 4, 10: 9, 16: 8, 36: 16, 37: 25, 38: 36, 39: 12, 40: 16, 41: 20, 47: 49, 48: 64, 49: 81, 50: 100,
             51: 121, 57: 24, 58: 28, 59: 32, 60: 36, 61: 40},
    "tetra": {4: 4, 11: 10, 29: 20, 30: 35, 31: 56, 71: 84, 72: 120, 73: 165, 74: 220, 75: 286},
    "hexahedron": {5: 8, 12: 27, 17: 20, 92: 64, 93: 125, 94: 216, 95: 343, 96: 512, 97: 729, 98: 1000, 99: 32,
                   100: 44, 101: 56, 102: 68, 103: 80, 104: 92, 105: 104},
    "wedge": {6: 6, 13: 18, 18: 15},
    "pyramid": {7: 5, 14: 14, 19: 13},
}
NODES = {kind: n for counts in _COUNTS.values() for kind, n in counts.items()}
DIMENSION = {kind: _SHAPES[shape] for shape, counts in _COUNTS.items() for kind in counts}
SHAPE = {kind: shape for shape, counts in _COUNTS.items() for kind in counts}


@dataclass
class Block:
    """Elements of one kind.

    Attributes
    ----------
    kind: gmsh's number of it.
    nodes: numbers of their nodes as in the file, (m, nodes of the kind).
    groups: physical group and elements in it, by their place in the block, ascending; an element may be in several.
    entities: the same of the elementary entities.
    parts: partitions that they are in.
    """

    kind: int
    nodes: np.ndarray
    groups: dict[int, np.ndarray] = field(default_factory=dict)
    entities: dict[int, np.ndarray] = field(default_factory=dict)
    parts: frozenset[int] = frozenset()


def nodes_of(kind: int) -> int:
    """Number of nodes of an element of a kind; Unreadable if it is unknown."""
    if kind not in NODES:
        raise Unreadable(f"it has elements of gmsh's kind {kind}, which cannot be read; "
                         "save lines, quadrilaterals and hexahedra only")
    return NODES[kind]


def agree(found: int, claimed: int, numbers: Any) -> None:
    """Raise Unreadable if a section has not as many entries as it says."""
    if found != claimed:
        raise Unreadable(f"{numbers.where} says that it has {claimed} entries, and has {found}")
