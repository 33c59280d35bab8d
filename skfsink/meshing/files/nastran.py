"""Bulk data of Nastran: grid points and elements, in the free, the small and the large format.

Elements of a property become the set `property:1`, ...; nodes held by single-point constraints the boundary
`spc:1`, ... A reader of our own: meshio's (5.3.5) wants BEGIN BULK, which gmsh does not write, reads large fields of
grid points only, and leaves out property numbers where one element has none.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import meshio
import numpy as np

from .numbers import places
from .unreadable import Unreadable

__all__ = ["read_nastran"]

CELLS: dict[str, tuple[tuple[str, int], ...]] = {
    **dict.fromkeys(("CQUAD4", "CQUADR", "CPLSTN4", "CPLSTS4"), (("quad", 4),)),
    **dict.fromkeys(("CQUAD8", "CPLSTN8", "CPLSTS8"), (("quad", 4), ("quad8", 8))),
    "CQUAD": (("quad", 4), ("quad8", 8), ("quad9", 9)),
    "CHEXA": (("hexahedron", 8), ("hexahedron20", 20)),
    **dict.fromkeys(("CTRIA3", "CTRIAR", "CPLSTN3", "CPLSTS3"), (("triangle", 3),)),
    **dict.fromkeys(("CTRIA6", "CPLSTN6", "CPLSTS6"), (("triangle", 3), ("triangle6", 6))),
    "CTETRA": (("tetra", 4), ("tetra10", 10)), "CPENTA": (("wedge", 6), ("wedge15", 15)),
    **dict.fromkeys(("CPYRAM", "CPYRA"), (("pyramid", 5), ("pyramid13", 13))),
    **dict.fromkeys(("CBAR", "CBEAM", "CROD", "CTUBE", "CONROD", "PLOTEL"), (("line", 2),)),
}
NUMBER = {card: max(n for _, n in kinds) for card, kinds in CELLS.items()}
#: middle nodes of the sides of a hexahedron come before those of its top; VTK has them last
ORDER = {"hexahedron20": [*range(12), 16, 17, 18, 19, 12, 13, 14, 15],
         "wedge15": [*range(9), 12, 13, 14, 9, 10, 11], "pyramid13": [*range(13)]}
PLAIN = ("CORD", "CSET", "CYJOIN", "CBARAO", "CEND", "RESVEC")  # cards that begin like elements and are none
ROUND = ("CQUADX", "CTRIAX", "CTRAX")  # elements of bodies of revolution


def read_nastran(path: Path) -> meshio.Mesh:
    """The mesh in a file of bulk data.

    Raises
    ------
    Unreadable
        A card that is not of the format, a grid point in a coordinate system of its own, or no grid points.
    """
    points: dict[int, list[float]] = {}
    cells: dict[str, list[tuple[list[int], int]]] = {}
    held: dict[str, tuple[set[int], list[range]]] = {}  # single grid points, and ranges of them
    left_out: Counter[str] = Counter()
    for number, card, fields in _cards(path.read_bytes().decode(errors="replace").splitlines()):
        try:
            if card == "GRID":
                if (fields[1] or "0") != "0":
                    raise Unreadable(f"line {number}: its grid points are in the coordinate system {fields[1][:16]}; "
                                     "save it with all of them in the basic one")
                if points.setdefault(int(fields[0]), where := [_real(x) for x in fields[2:5]]) is not where:
                    raise Unreadable(f"line {number}: it has the grid point {int(fields[0])} twice")
            elif card == "GRDSET" and (fields[1] or "0") != "0":
                raise Unreadable(f"line {number}: its grid points are in a coordinate system of their own")
            elif card in CELLS:
                name, nodes, group = _element(card, fields)
                cells.setdefault(name, []).append((nodes, group))
            elif card in ("SPC", "SPC1"):
                _hold(card, fields, *held.setdefault(f"spc:{int(fields[0])}", (set(), [])))
            elif card.startswith("INCLUDE"):
                raise Unreadable(f"line {number}: it names another file; put all into one")
            elif card.startswith(ROUND):
                raise Unreadable(f"line {number}: it has elements {card} of a body of revolution, which are not "
                                 "read; write its half plane in x and y as CQUAD4, and take element axisymmetric")
            elif card[0] in "CR" and not card.startswith(PLAIN):
                left_out[card] += 1
        except Unreadable:
            raise
        except (ValueError, IndexError):
            raise Unreadable(f"line {number}: the card {card[:16]} is not complete or has something that is no "
                             "number") from None
    if not points:
        raise Unreadable("it has no grid points")
    tags = np.array(list(points), np.int64)
    notes = [f"{n} card(s) {card} were left out" for card, n in sorted(left_out.items())]
    there = {name: np.array([node for node in points if node in single or any(node in numbers for numbers in ranges)],
                            np.int64) for name, (single, ranges) in held.items()}
    return meshio.Mesh(np.array(list(points.values())),
                       [(name, places(tags, np.array([nodes for nodes, _ in rows], np.int64))
                         [:, ORDER.get(name, slice(None))]) for name, rows in cells.items()],
                       cell_data={"property": [np.array([group for _, group in rows]) for rows in cells.values()]},
                       point_sets={name: np.unique(places(tags, nodes)) for name, nodes in there.items() if len(nodes)},
                       info={"notes": notes})


def _element(card: str, fields: list[str]) -> tuple[str, list[int], int]:
    """Name of the block, nodes and number of the property of an element."""
    if card in ("CONROD", "PLOTEL"):  # which have no property
        return "line", [int(x) for x in fields[1:3]], 0
    group = int(fields[1] or fields[0])  # the number of the element, where it has none of its own
    nodes = [int(x or 0) for x in (fields[2:2 + NUMBER[card]])]
    while nodes and not nodes[-1]:
        nodes.pop()
    kinds = CELLS[card]
    name, n = max(((name, n) for name, n in kinds if n <= len(nodes)), key=lambda kind: kind[1])
    if n > kinds[0][1] and 0 in nodes[:n]:  # some middle nodes are left out
        name, n = kinds[0]
    return name, nodes[:n], group


def _hold(card: str, fields: list[str], single: set[int], ranges: list[range]) -> None:
    """Add the grid points of a constraint, some of which may not exist."""
    words = [x for x in ((fields[1], *fields[4:5]) if card == "SPC" else fields[2:]) if x]
    if card != "SPC" and len(words) == 3 and words[1].upper() == "THRU":
        ranges.append(range(int(words[0]), int(words[2]) + 1))
    else:
        single.update(map(int, words))


def _real(field: str) -> float:
    """A number, in which the `E` of the exponent may be left out or be a `D`; 0 if there is none."""
    try:
        return float(field or 0)
    except ValueError:
        pass
    return float(re.sub(r"(?<=[\d.])([+-]\d+)$", r"E\1", field.upper().replace("D", "E")))


def _cards(lines: list[str]) -> Iterator[tuple[int, str, list[str]]]:
    """Line, name and fields of the cards, with those of the lines that continue them."""
    begin = next((i + 1 for i, line in enumerate(lines) if re.match(r"\s*BEGIN\s+BULK", line, re.I)), 0)
    number, name, fields = 0, "", list[str]()
    for at, line in enumerate(lines[begin:], begin + 1):
        line = line.partition("$")[0].rstrip()
        if not line:
            continue
        if line[:7].upper() == "ENDDATA":
            break
        first, more = _fields(line)
        if first in ("", "+", "*") or first[0] in "+*":
            fields += more
            continue
        if name:
            yield number, name, fields
        number, name, fields = at, first.rstrip("*").strip().upper(), more
    if name:
        yield number, name, fields


def _fields(line: str) -> tuple[str, list[str]]:
    """The first field of a line, and the eight or four that follow it."""
    if "," in line:
        words = [word.strip() for word in line.split(",")]
        n = 4 if words[0].endswith("*") or words[0].startswith("*") else 8
        return words[0], [*words[1:1 + n], *[""] * (n + 1 - len(words))]
    line = line.expandtabs(8) if "\t" in line else line
    first = line[:8].strip()
    width, n = (16, 4) if "*" in first else (8, 8)
    found = [line[i:i + width].strip() for i in range(8, min(len(line), 8 + n * width), width)]
    return first, found + [""] * (n - len(found))
