"""Sets and surfaces of Abaqus models as the data lines give them, by numbers and names in their part."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .abaqus_lines import Block
from .abaqus_numbers import Numbers, number

__all__ = ["Entry", "Named", "named", "read_set", "read_surface"]


@dataclass(frozen=True)
class Entry:
    """Members of a set: numbers, a range (first, last, step), or the name of a set.

    `instance` has them, `face` is the face of elements in a surface, and `other` is whether nodes are those of
    a set of elements.
    """

    members: np.ndarray | tuple[int, int, int] | str
    block: Block
    line: int | None = None
    instance: str = ""
    face: str = ""
    other: bool = False


@dataclass
class Named:
    """A set or surface: its name as first written, and what is put into it; `kind` is the TYPE of a surface."""

    name: str
    entries: list[Entry] = field(default_factory=list)
    kind: str = ""


def named(sets: dict[str, Named], name: str) -> Named:
    """The set of a name in whatever case, which is made where there is none."""
    return sets.setdefault(name.lower(), Named(name))


def read_set(block: Block, target: Named) -> None:
    """Put into a set what `*NSET` or `*ELSET` gives it."""
    entries, instance = target.entries, block.parameters.get("INSTANCE", "")
    if block.keyword == "NSET" and (source := block.parameters.get("ELSET")):
        entries.append(Entry(source, block, None, instance, other=True))
    if "GENERATE" in block.parameters:
        for i, row in Numbers(block, whole=True).rows():
            first, last, step = (*map(int, row), *([1] if len(row) == 2 else []))[:3] if len(row) > 1 else (1, 0, 0)
            if len(row) > 3 or step < 1 or first > last:
                raise block.error("a line of GENERATE is first, last and step, ascending; got "
                                  + ", ".join(str(int(x)) for x in row), i)
            entries.append(Entry((first, last, step), block, i, instance))
        return
    read = Numbers(block, whole=True)
    texts = [block.data[i].strip() for i in read.at]
    joined = ",".join(t[:-1] if t.endswith(",") else t for t in texts)
    numbers = read.many(joined.split(",")) if texts and "_" not in joined else None
    if numbers is not None:
        entries.append(Entry(numbers, block, None, instance))
        return
    for i, row_of_words in block.rows():
        for word in filter(None, row_of_words):
            plain = word.lstrip("+-").replace(".", "").isdecimal() or not word[:1].strip("+-.")
            entries.append(Entry(np.array([int(number(block, i, word, whole=True))]) if plain else word, block, i,
                                 instance))


def read_surface(block: Block, surface: Named) -> None:
    """Put into a surface what `*SURFACE` gives it: faces of elements, nodes, or other surfaces."""
    surface.kind = block.parameters.get("TYPE", "ELEMENT").upper()
    if "COMBINE" in block.parameters:
        how = block.parameters["COMBINE"].upper()
        if how != "UNION":
            raise block.error(f"the surface {surface.name[:60]!r} is made by COMBINE={how[:20]}, which is not "
                              "read: write its faces")
        surface.kind = "UNION"
    if "CROP" in block.parameters:
        raise block.error(f"the surface {surface.name[:60]!r} is made by CROP=, which is not read: write its faces")
    for i, row in block.rows():
        for word in row if surface.kind == "UNION" else row[:1]:
            numeric = word.isdecimal()
            members: np.ndarray | str = np.array([int(number(block, i, word, whole=True))]) if numeric else word
            face = row[1].upper() if surface.kind == "ELEMENT" and len(row) > 1 else ""
            surface.entries.append(Entry(members, block, i, "", face))
