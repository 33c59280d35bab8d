"""Nodes and elements of MSH files of version 2."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from .msh_block import Block, nodes_of
from .numbers import Binary, Text
from .unreadable import Unreadable

__all__ = ["elements_2", "nodes_2", "parametric_nodes_2"]


def nodes_2(numbers: Any, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the nodes (n,), and their coordinates (n, 3)."""
    tags, points = numbers.records(count, 1, 3)
    return tags[:, 0], points


def parametric_nodes_2(numbers: Any, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes that end with dimension and number of their entity, and their place on it if that is a line or surface."""
    tags, points = [], []
    for _ in range(count):
        tag, point = numbers.records(1, 1, 3)
        dim = int(numbers.ints(2)[0])
        numbers.reals(dim if 0 < dim < 3 else 0)
        tags.append(tag[0])
        points.append(point[0])
    return np.concatenate([np.zeros(0, np.int64), *tags]), np.array(points).reshape(-1, 3)


def elements_2(numbers: Any, count: int) -> list[Block]:
    """Elements, one block a kind; tags are physical group, entity, number of partitions, and these."""
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
        width = 3 + _number_of_tags(n_tags, numbers) + nodes_of(kind)
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
        width = 1 + _number_of_tags(n_tags, numbers) + nodes_of(kind)
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
    (single, entity), (others, group) = (np.unique(tags, return_inverse=True) for tags in (entities, groups))
    if len(np.unique(entity.ravel() * len(others) + group.ravel())) > len(single):  # an entity has several groups
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


def _number_of_tags(n: int, numbers: Any) -> int:
    if not 0 <= n <= 10**6:
        raise Unreadable(f"{numbers.where} has an element with {n} tags")
    return n
