"""Entities, nodes and elements of MSH files of version 4.0 and 4.1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .msh_block import Block, agree, nodes_of
from .unreadable import Unreadable

__all__ = ["Entity", "elements_4", "entities_4", "nodes_4"]


@dataclass(frozen=True)
class Entity:
    """An entity of the geometry: its physical groups, elementary entity that it is a part of, and partitions."""

    groups: tuple[int, ...]
    tag: int
    parts: frozenset[int] = frozenset()


def entities_4(numbers: Any, version: float, parts: bool) -> dict[tuple[int, int], Entity]:
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
            found[dim, tag] = Entity(tuple(dict.fromkeys(groups)), parent, members)
    return found


def nodes_4(numbers: Any, version: float) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the nodes (n,), and their coordinates (n, 3); places on curves and surfaces are passed over."""
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
    agree(len(found), total, numbers)
    return found, np.concatenate(points)


def elements_4(numbers: Any, version: float, entities: dict[tuple[int, int], Entity]) -> list[Block]:
    """Elements, one block an entity and kind, with the groups and partitions of the entity."""
    count, total = numbers.sizes(2).tolist()
    if version > 4:
        numbers.sizes(2)  # least and greatest number
    blocks = []
    for _ in range(count):
        dim, tag, kind = numbers.ints(3).tolist()
        if version < 4.1:
            dim, tag = tag, dim
        n = int(numbers.sizes(1)[0])
        width = 1 + nodes_of(kind)
        nodes = (numbers.sizes if version > 4 else numbers.ints)(n * width).reshape(n, width)[:, 1:]
        entity, every = entities.get((dim, tag), Entity((), tag)), np.arange(n)
        blocks.append(Block(kind, nodes, dict.fromkeys(entity.groups, every),
                            {entity.tag: every} if entity.tag else {}, entity.parts))
    agree(sum(len(block.nodes) for block in blocks), total, numbers)
    return blocks
