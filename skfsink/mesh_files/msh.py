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
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .numbers import Binary, Text
from .unreadable import Unreadable

__all__ = ["DIMENSION", "NODES", "Block", "Msh", "read_msh"]

#: number of nodes and dimension of the elements, by gmsh's number of their kind
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


@dataclass(frozen=True)
class _Entity:
    """An entity of the geometry: its physical groups, elementary entity that it is a part of, and partitions."""

    groups: tuple[int, ...]
    tag: int
    parts: frozenset[int] = frozenset()


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

    entities: dict[tuple[int, int], _Entity] = {}
    partitions = 0
    for name in ("Entities", "PartitionedEntities"):
        if name in sections and version >= 4:
            source = numbers(name, sections[name])
            partitions = int(source.sizes(1)[0]) if name != "Entities" else 0
            found = _entities(source, version, name != "Entities")
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
            msh.blocks = _elements_4(source, version, entities) if version >= 4 else _elements_2(source, count)
        else:
            msh.tags, msh.points = (_nodes_4(source, version) if version >= 4 else
                                    _parametric_nodes_2(source, count) if parametric else _nodes_2(source, count))
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


# --- version 4 ---
def _entities(numbers: Any, version: float, parts: bool) -> dict[tuple[int, int], _Entity]:
    """Entities by dimension and number; those of $PartitionedEntities with `parts`."""
    found = {}
    if parts:
        numbers.ints(2 * int(numbers.sizes(1)[0]))  # ghost entities
    for dim, count in enumerate(numbers.sizes(4).tolist()):
        for _ in range(count):
            tag = parent = int(numbers.ints(1)[0])
            members: frozenset[int] = frozenset()
            if parts:
                above, parent = numbers.ints(2).tolist()
                members = frozenset(numbers.ints(int(numbers.sizes(1)[0])).tolist())
                parent = parent if above == dim else 0  # 0: where partitions meet
            numbers.reals(3 if dim == 0 and version > 4 else 6)  # its box
            groups = np.abs(numbers.ints(int(numbers.sizes(1)[0]))).tolist()
            if dim:
                numbers.ints(int(numbers.sizes(1)[0]))  # what bounds it
            found[dim, tag] = _Entity(tuple(dict.fromkeys(groups)), parent, members)
    return found


def _nodes_4(numbers: Any, version: float) -> tuple[np.ndarray, np.ndarray]:
    blocks, total = numbers.sizes(2).tolist()
    if version > 4:
        numbers.sizes(2)  # least and greatest number
    tags, points = [np.zeros(0, np.int64)], [np.zeros((0, 3))]
    for _ in range(blocks):
        first, second, parametric = numbers.ints(3).tolist()
        dim = first if version > 4 else second
        n = int(numbers.sizes(1)[0])
        columns = 3 + (dim if parametric else 0)
        if not 0 <= dim <= 3:
            raise Unreadable(f"{numbers.where} has nodes of an entity of dimension {dim}")
        if version > 4:
            tags.append(numbers.sizes(n))
            points.append(numbers.reals(n * columns).reshape(n, columns)[:, :3])
        else:
            tag, point = numbers.records(n, 1, columns)
            tags.append(tag[:, 0])
            points.append(point[:, :3])
    found = np.concatenate(tags)
    _agree(len(found), total, numbers)
    return found, np.concatenate(points)


def _elements_4(numbers: Any, version: float, entities: dict[tuple[int, int], _Entity]) -> list[Block]:
    count, total = numbers.sizes(2).tolist()
    if version > 4:
        numbers.sizes(2)  # least and greatest number
    blocks = []
    for _ in range(count):
        dim, tag, kind = numbers.ints(3).tolist()
        if version < 4.1:
            dim, tag = tag, dim
        n = int(numbers.sizes(1)[0])
        width = 1 + _nodes_of(kind)
        nodes = (numbers.sizes if version > 4 else numbers.ints)(n * width).reshape(n, width)[:, 1:]
        entity, every = entities.get((dim, tag), _Entity((), tag)), np.arange(n)
        blocks.append(Block(kind, nodes, dict.fromkeys(entity.groups, every),
                            {entity.tag: every} if entity.tag else {}, entity.parts))
    _agree(sum(len(block.nodes) for block in blocks), total, numbers)
    return blocks


# --- version 2 ---
def _nodes_2(numbers: Any, count: int) -> tuple[np.ndarray, np.ndarray]:
    tags, points = numbers.records(count, 1, 3)
    return tags[:, 0], points


def _parametric_nodes_2(numbers: Any, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes that end with dimension and number of their entity, and their place on it if that is a line or surface."""
    tags, points = [], []
    for _ in range(count):
        tag, point = numbers.records(1, 1, 3)
        dim = int(numbers.ints(2)[0])
        numbers.reals(dim if 0 < dim < 3 else 0)
        tags.append(tag[0])
        points.append(point[0])
    return np.concatenate([np.zeros(0, np.int64), *tags]), np.array(points).reshape(-1, 3)


def _elements_2(numbers: Any, count: int) -> list[Block]:
    runs: dict[int, list[tuple[np.ndarray, np.ndarray, np.ndarray]]] = {}
    parts: dict[int, set[int]] = {}
    for kind, tags, nodes in (_runs_of_text if isinstance(numbers, Text) else _runs_of_bytes)(numbers, count):
        there = np.zeros((len(nodes), 2), np.int64)  # physical group, elementary entity
        there[:, :min(2, tags.shape[1])] = np.abs(tags[:, :2])
        runs.setdefault(kind, []).append((nodes, *there.T))
        parts.setdefault(kind, set()).update(np.unique(tags[:, 3:4]).tolist())  # its own one; others are ghosts there
    return [_block_2(kind, np.concatenate([run[0] for run in found]), np.concatenate([run[1] for run in found]),
                     np.concatenate([run[2] for run in found]), frozenset(parts[kind])) for kind, found in runs.items()]


def _runs_of_text(numbers: Text, count: int) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """Kind, tags and nodes of successive elements of one kind and number of tags."""
    while count > 0:
        _, kind, n_tags = (int(number) for number in numbers.ahead(3))
        width = 3 + _number_of_tags(n_tags, numbers) + _nodes_of(kind)
        pieces, most = [], 1
        while count > 0 and (n := min(most, count, numbers.left // width)) > 0:
            rows = numbers.ahead(n * width).reshape(n, width)
            other = (rows[:, 1] != kind) | (rows[:, 2] != n_tags)
            n = int(other.argmax()) if other.any() else n
            pieces.append(numbers.ints(n * width).reshape(n, width))
            count, most = count - n, 2 * most
            if other.any():
                break
        rows = np.concatenate(pieces or [numbers.ints(width)])  # of which there are not enough
        yield kind, rows[:, 3:3 + n_tags], rows[:, 3 + n_tags:]


def _runs_of_bytes(numbers: Binary, count: int) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """The same, as bytes say it themselves."""
    while count > 0:
        kind, n, n_tags = numbers.ints(3).tolist()
        width = 1 + _number_of_tags(n_tags, numbers) + _nodes_of(kind)
        if not 0 < n <= count:
            raise Unreadable(f"{numbers.where} has another number of elements than it says")
        rows = numbers.ints(n * width).reshape(n, width)
        count -= n
        yield kind, rows[:, 1:1 + n_tags], rows[:, 1 + n_tags:]


def _block_2(kind: int, nodes: np.ndarray, groups: np.ndarray, entities: np.ndarray, parts: frozenset[int]) -> Block:
    """The elements of a kind, each once, however many groups it is in.

    An element that is in one group twice is left as it is: there are two.
    """
    place = np.arange(len(nodes))
    (own, entity), (others, group) = (np.unique(tags, return_inverse=True) for tags in (entities, groups))
    if len(np.unique(entity.ravel() * len(others) + group.ravel())) > len(own):  # an entity has several groups
        rows = np.column_stack([np.sort(nodes, axis=1), entities])
        _, first, same = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        if len(first) < len(rows) == len(np.unique(np.column_stack([rows, groups]), axis=0)):
            kept = np.sort(first)
            place = np.searchsorted(kept, first)[same.ravel()]
            nodes = nodes[kept]
    return Block(kind, nodes, _members(groups, place), _members(entities, place), parts)


def _members(tags: np.ndarray, place: np.ndarray) -> dict[int, np.ndarray]:
    """Places of each tag but 0."""
    order = np.argsort(tags, kind="stable")
    found, start = np.unique(tags[order], return_index=True)
    return {tag: np.unique(part) for tag, part in zip(found.tolist(), np.split(place[order], start[1:])) if tag}


# --- what both have ---
def _nodes_of(kind: int) -> int:
    if kind not in NODES:
        raise Unreadable(f"it has elements of gmsh's kind {kind}, which cannot be read; "
                         "save lines, quadrilaterals and hexahedra only")
    return NODES[kind]


def _number_of_tags(n: int, numbers: Any) -> int:
    if not 0 <= n <= 10**6:
        raise Unreadable(f"{numbers.where} has an element with {n} tags")
    return n


def _agree(found: int, said: int, numbers: Any) -> None:
    if found != said:
        raise Unreadable(f"{numbers.where} says that it has {said} entries, and has {found}")


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
