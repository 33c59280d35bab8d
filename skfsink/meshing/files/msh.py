"""MSH files of gmsh, versions 2 and 4, as text or as bytes: their nodes, elements and groups as they stand there.

This is a reader of our own. meshio's (5.3.5) was tried on what gmsh 4.15 writes: it refuses partitioned files,
parametric nodes and binary files of version 2 with gaps in the numbers of nodes; knows one physical group an element;
makes no sets of version 2, of groups without a name, and of points; takes the bounding entities of version 4.1 for sets
of elements; and calls version 4.0 by the name that gmsh gives it, "4", 4.1. What is read here is little enough.

The format is described at https://gmsh.info/doc/texinfo/gmsh.html#MSH-file-format; elements of version 2 that are in
several physical groups stand there once for each.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .msh2 import elements_2, nodes_2, parametric_nodes_2
from .msh4 import Entity, elements_4, entities_4, nodes_4
from .msh_block import DIMENSION, Block
from .numbers import Binary, Text
from .unreadable import Unreadable

__all__ = ["Msh", "read_msh"]


@dataclass
class Msh:
    """A file of gmsh.

    Attributes
    ----------
    tags, points: numbers of the nodes (n,) and their coordinates (n, 3).
    blocks: of elements, in the order of the file.
    names: of physical groups, by dimension and number.
    solids: number of volumes that the model has, whether they were saved or not.
    """

    tags: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    points: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    blocks: list[Block] = field(default_factory=list)
    names: dict[tuple[int, int], str] = field(default_factory=dict)
    solids: int = 0


def read_msh(data: bytes) -> Msh:
    """What is in the bytes of a file.

    Raises
    ------
    Unreadable
        Something that is not of the format, an element of a kind that is unknown, or a part of a partitioned mesh.
    """
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        data = data.decode("utf-16").encode()
    if re.match(rb"\s*\$(NOD|NOE)\b", data):
        raise Unreadable("it is in the format MSH 1; save it with gmsh as MSH 4.1 or 2.2")
    version, order, size = _head(data)
    sections = _sections(data)
    msh = Msh(names=_names(sections.get("PhysicalNames", b"")))

    def numbers(name: str, content: bytes) -> Any:
        where = f"its section ${name}"
        return Binary(content, where, order, size) if order else Text(content, where, name != "Elements")

    entities: dict[tuple[int, int], Entity] = {}
    partitions = 0
    for name in ("Entities", "PartitionedEntities"):
        if name in sections and version >= 4:
            source = numbers(name, sections[name])
            partitions = int(source.sizes(1)[0]) if name != "Entities" else 0
            found = entities_4(source, version, name != "Entities")
            source.end()
            msh.solids = max(msh.solids, sum(dim == 3 for dim, _ in found))
            entities.update(found)
    parametric = "ParametricNodes" in sections and "Nodes" not in sections
    for name in ("ParametricNodes" if parametric else "Nodes", "Elements"):
        if name not in sections:
            raise Unreadable(f"it has no section ${name}")
        content, count = sections[name], 0
        if version < 4:  # the number of nodes or elements is a line of text in any case
            line, _, content = content.partition(b"\n")
            count = int(line)
        source = numbers(name, content)
        if name == "Elements":
            msh.blocks = elements_4(source, version, entities) if version >= 4 else elements_2(source, count)
        else:
            msh.tags, msh.points = (nodes_4(source, version) if version >= 4 else
                                    parametric_nodes_2(source, count) if parametric else nodes_2(source, count))
        source.end()
    _see_that_all_is_there(msh, partitions)
    return msh


def _head(data: bytes) -> tuple[float, str, int]:
    """Version (4.0 is called 4), order of the bytes of numbers ("" for text), and bytes of a size_t."""
    found = re.match(rb"(?:\xef\xbb\xbf)?\s*(?:\$Comments\b.*?\$EndComments\s*)?"
                     rb"\$MeshFormat\s+([\d.]+)[ \t]+([01])[ \t]+(\d+)[ \t]*\r?\n", data, re.S)
    if found is None:
        raise Unreadable("it does not begin with $MeshFormat and a line like 4.1 0 8; save it with gmsh as MSH 4.1")
    version, size, one = float(found[1]), int(found[3]), data[found.end():found.end() + 4]
    if version not in (2.0, 2.1, 2.2, 4.0, 4.1):
        raise Unreadable(f"it is in the format MSH {version:g}; save it with gmsh as MSH 4.1 or 2.2")
    if size not in (4, 8) or (found[2] == b"1" and one not in (b"\0\0\0\1", b"\1\0\0\0")):
        raise Unreadable("its numbers are stored in an unknown way; save it with gmsh as MSH 4.1")
    return version, "" if found[2] == b"0" else ">" if one == b"\0\0\0\1" else "<", size


def _sections(data: bytes) -> dict[str, bytes]:
    """Contents of the sections, by name."""
    found: dict[str, bytes] = {}
    at = data.index(b"$")
    while at < len(data):
        title = re.compile(rb"\s*\$(\w{1,40})[ \t]*(?:\r?\n|$)").match(data, at)
        if title is None:
            if data[at:].strip():
                raise Unreadable("it has something between its sections, or is cut off")
            break
        name = title[1].decode()
        end = data.find(b"$End" + title[1], title.end())
        if end < 0:
            raise Unreadable(f"its section ${name} has no end; the file is cut off")
        if name in _READ:
            if name in found:
                raise Unreadable(f"its section ${name} is there twice")
            found[name] = data[title.end():end]
        at = end + 4 + len(name)
    return found


_READ = ("PhysicalNames", "Entities", "PartitionedEntities", "Nodes", "ParametricNodes", "Elements")


def _names(text: bytes) -> dict[tuple[int, int], str]:
    """Names of the physical groups, by dimension and number; lines are `1 11 "bottom"`."""
    names = {}
    for line in text.splitlines()[1:]:
        if line.strip():
            found = re.fullmatch(rb'\s*(\d)\s+(-?\d+)\s+"(.*)"\s*', line)
            if found is None:
                raise Unreadable("its section $PhysicalNames has a line without dimension, number and name")
            try:
                name = found[3].decode()
            except UnicodeDecodeError:
                name = found[3].decode("latin-1")
            names[int(found[1]), abs(int(found[2]))] = name
    return names


def _see_that_all_is_there(msh: Msh, partitions: int) -> None:
    """Raise Unreadable where elements of a partitioned mesh are in another file.

    Version 4 says how many `partitions` there are. In version 2 (0) one is missing for sure where the numbers have a
    gap, or where all elements are in one while nodes are missing.
    """
    body = max((DIMENSION[block.kind] for block in msh.blocks), default=0)
    blocks = [block for block in msh.blocks if DIMENSION[block.kind] == body and len(block.nodes)]
    found = frozenset[int]().union(*(block.parts for block in blocks))
    missing = set(range(1, min(max([partitions, *found]), 10**6) + 1)) - found
    nodes_missing = len(msh.tags) and int(msh.tags.max()) > len(msh.tags)
    if found and (missing or (not partitions and found == {1} and nodes_missing)):
        raise Unreadable(f"it holds part {', '.join(map(str, sorted(found)))} of a partitioned mesh, and other files "
                         "the rest; save it into one file, with Mesh.PartitionSplitMeshFiles = 0")
