"""Bodies of Abaqus models: parts put together, with one number for each node and element, and their sets."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .abaqus_lines import Block
from .abaqus_named import Entry, Named
from .abaqus_parts import Elements, Part
from .abaqus_types import FACES
from .unreadable import Unreadable

__all__ = ["Body", "Placed", "base_of"]


def base_of(cell: str) -> str:
    """The cell of first order of the same form."""
    return cell.rstrip("0123456789")


class Numbering:
    """Where numbers of the file are in the arrays: `numbers` have their places from `start` on."""

    def __init__(self, numbers: np.ndarray, start: int) -> None:
        self.order = np.argsort(numbers, kind="stable")
        self.sorted, self.start = numbers[self.order], start

    def places(self, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places of numbers, and whether there are such."""
        if not len(self.sorted):
            return np.zeros(numbers.shape, np.int64), np.zeros(numbers.shape, bool)
        at = np.minimum(np.searchsorted(self.sorted, numbers), len(self.sorted) - 1)
        return self.start + self.order[at], self.sorted[at] == numbers

    def range(self, first: int, last: int, step: int) -> tuple[np.ndarray, int | None]:
        """Places of the numbers of a range, and the first of these that there is not."""
        found = self.sorted[np.searchsorted(self.sorted, first):np.searchsorted(self.sorted, last, "right")]
        found = found[(found - first) % step == 0]
        missing = None
        if len(found) != (last - first) // step + 1:
            wrong = np.flatnonzero(found != first + step * np.arange(len(found)))
            missing = first + step * int(wrong[0] if len(wrong) else len(found))
        return self.places(found)[0], missing


class Placed:
    """A part at its place: an instance, or, with the name "", what is in no part.

    Attributes
    ----------
    nodes, elements: where its numbers are among those of the body.
    """

    def __init__(self, name: str, part: Part, nodes: Numbering, elements: Numbering) -> None:
        self.name, self.part, self.nodes, self.elements = name, part, nodes, elements

    @property
    def of(self) -> str:
        """Its name for a message."""
        return f" of {self.name[:60]!r}" if self.name else ""


class Body:
    """All parts where they are placed.

    Memory: what has been given to `place`; `node_set`, `element_set`, `entry`, `faces`, `free` and `nodes_of` look in
    it.

    Attributes
    ----------
    points: (n, 3).
    notes: what the user should know of it.
    blocks: elements of one keyword, the place of their first one, and their nodes by place (ne, k).
    placed: by name in small letters.
    """

    def __init__(self) -> None:
        self.placed: dict[str, Placed] = {}
        self.blocks: list[tuple[Elements, int, np.ndarray]] = []
        self.points = np.zeros((0, 3))
        self.n_elements = 0
        self.notes: list[str] = []
        self._known: dict[tuple[str, str, str], np.ndarray | None] = {}

    def place(self, name: str, part: Part, numbers: np.ndarray, points: np.ndarray) -> None:
        """Add a part, whose nodes have these numbers and stand at these points.

        Raises
        ------
        Unreadable
            An element has a node that does not exist, or two have one number.
        """
        nodes = Numbering(numbers, len(self.points))
        self.points = np.concatenate([self.points, points])
        first = self.n_elements
        for group in part.elements:
            places, there = nodes.places(group.nodes)
            if group.user is None and group.cell in ("", "line"):
                places = np.where(there, places, -1)
            elif not there.all():
                row, column = np.argwhere(~there)[0]
                raise group.block.error(f"element {group.numbers[row]} has the node {group.nodes[row, column]}, which "
                                        "does not exist")
            self.blocks.append((group, self.n_elements, places))
            self.n_elements += len(group.numbers)
        all_numbers = np.concatenate([np.zeros(0, np.int64), *(group.numbers for group in part.elements)])
        elements = Numbering(all_numbers, first)
        if len(again := np.flatnonzero(np.diff(elements.sorted) == 0)):
            late = max(elements.order[again[0]:again[0] + 2])
            ends = np.cumsum([len(group.numbers) for group in part.elements])
            block = part.elements[int(np.searchsorted(ends, late, "right"))].block
            raise block.error(f"element {elements.sorted[again[0]]} is given twice: delete one of its lines, or "
                              "number it anew")
        self.placed[name.lower()] = Placed(name, part, nodes, elements)

    def node_set(self, scope: Placed, name: str) -> np.ndarray:
        """Places of the nodes of a set."""
        return self._members(scope, name, "node")

    def element_set(self, scope: Placed, name: str) -> np.ndarray:
        """Places of the elements of a set."""
        return self._members(scope, name, "element")

    def _members(self, scope: Placed, name: str, kind: str) -> np.ndarray:
        key = (scope.name.lower(), name.lower(), kind)
        if key in self._known:
            known = self._known[key]
            if known is None:
                raise Unreadable(f"the {kind} set {name[:60]!r} is a part of itself")
            return known
        self._known[key] = None
        named = (scope.part.node_sets if kind == "node" else scope.part.element_sets)[name.lower()]
        found = [self.entry(scope, entry, kind, named.name) for entry in named.entries]
        members = self._known[key] = np.unique(np.concatenate([np.zeros(0, np.int64), *found]))
        return members

    def entry(self, scope: Placed, entry: Entry, kind: str, name: str) -> np.ndarray:
        """Places of the nodes or elements that one entry of the set `name` stands for.

        Raises
        ------
        Unreadable
            There is no such node, element, set or instance.
        """
        if entry.instance:
            if entry.instance.lower() not in self.placed:
                raise entry.block.error(f"there is no instance {entry.instance[:60]!r}")
            scope = self.placed[entry.instance.lower()]
        members = entry.members
        if isinstance(members, str):
            if entry.other:
                return self.nodes_of(self._by_name(scope, members, "element", entry, name))
            return self._by_name(scope, members, kind, entry, name)
        numbering = scope.nodes if kind == "node" else scope.elements
        if isinstance(members, tuple):
            places, missing = numbering.range(*members)
        else:
            places, there = numbering.places(members)
            missing = None if there.all() else int(members[there.argmin()])
        if missing is not None:
            raise entry.block.error(f"the set {name[:60]!r} has the {kind} {missing}{scope.of}, which does not exist",
                                    _line_of(entry, missing))
        return places

    def _by_name(self, scope: Placed, word: str, kind: str, entry: Entry, name: str) -> np.ndarray:
        """Members of the set `word`, which may be one of an instance (`INSTANCE.SET`, or `INSTANCE.number`)."""
        low = word.lower()
        for at in (scope, *([self.placed[""]] if scope.name else [])):
            if low in (at.part.node_sets if kind == "node" else at.part.element_sets):
                return self._members(at, word, kind)
        for k in (k for k, letter in enumerate(word) if letter == "."):
            if (inner := self.placed.get(low[:k])) is not None:
                rest = word[k + 1:]
                if rest.lower() in (inner.part.node_sets if kind == "node" else inner.part.element_sets):
                    return self._members(inner, rest, kind)
                if rest.isdecimal():
                    return self.entry(inner, Entry(np.array([int(rest[:18])]), entry.block, entry.line), kind, name)
        raise entry.block.error(f"the {kind} set {word[:60]!r}{scope.of} does not exist", entry.line)

    def nodes_of(self, elements: np.ndarray) -> np.ndarray:
        """Places of the nodes of elements."""
        found = [nodes[elements[(elements >= at) & (elements < at + len(nodes))] - at].ravel()
                 for _, at, nodes in self.blocks]
        nodes = np.unique(np.concatenate([np.zeros(0, np.int64), *found]))
        return nodes[nodes >= 0]

    def faces(self, scope: Placed, surface: Named, faces_are_cells: bool) -> list[np.ndarray]:
        """Corners of the faces of a surface of elements, (n, 2), (n, 3) or (n, 4) each.

        With `faces_are_cells`, in a body of solids, plane elements are faces of it.
        """
        found: list[np.ndarray] = []
        for entry in surface.entries:
            members = self.entry(scope, entry, "element", surface.name)
            found += self._faces(members, entry, surface.name, faces_are_cells)
        return found

    def _faces(self, members: np.ndarray, entry: Entry, name: str, faces_are_cells: bool) -> Iterable[np.ndarray]:
        face, used, inside = entry.face, 0, 0
        for group, at, nodes in self.blocks:
            mine = members[(members >= at) & (members < at + len(nodes))] - at
            base = base_of(group.cell)
            if not len(mine) or base not in FACES:
                continue
            forms = FACES[base]
            if base in ("quad", "triangle") and faces_are_cells:
                if face not in ("", "SPOS", "SNEG"):
                    raise entry.block.error(f"the face {face[:10]!r} of the surface {name[:60]!r} is an edge of a "
                                            "solid", entry.line)
                yield nodes[mine, :len(forms)]
            elif not face:
                free = self.free
                for k, form in enumerate(forms):
                    yield nodes[mine][:, form][free[k][at + mine]]
            elif face[:1] in ("S", "E") and face[1:].isdecimal() and 1 <= int(face[1:3]) <= len(forms) and (
                    face[0] == "S" or len(forms[0]) == 2):
                k = int(face[1:3]) - 1
                inside += int(np.count_nonzero(~self.free[k][at + mine]))
                yield nodes[mine][:, forms[k]]
            else:
                raise entry.block.error(f"elements of type {group.kind} have no face {face[:10]!r}, which the surface "
                                        f"{name[:60]!r} names", entry.line)
            used += len(mine)
        if inside:
            self.notes.append(f"the surface {name[:60]!r} ({entry.block.where}) has {inside} face(s) {face} inside of "
                              "the body, between two elements: look whether another side of them is meant")
        if used < len(members):
            self.notes.append(f"the surface {name[:60]!r} ({entry.block.where}) has {len(members) - used} element(s) "
                              "that are no body, and is without these")

    @property
    def free(self) -> list[np.ndarray]:
        """Whether face k of each element is one of no other element, by k."""
        if not hasattr(self, "_free"):
            solid = any(len(FACES[base_of(group.cell)][0]) > 2 for group, _, _ in self.blocks
                        if base_of(group.cell) in FACES)
            corners, owner, number = [], [], []
            for group, at, nodes in self.blocks:
                for k, form in enumerate(FACES.get(base_of(group.cell), ())):
                    if solid == (len(FACES[base_of(group.cell)][0]) > 2) and len(nodes):
                        own_rows = np.full((len(nodes), 4 if solid else 2), -1)
                        own_rows[:, :len(form)] = np.sort(nodes[:, form], axis=1)
                        corners.append(own_rows)
                        owner.append(at + np.arange(len(nodes)))
                        number.append(np.full(len(nodes), k))
            self._free = [np.zeros(self.n_elements, bool) for _ in range(6)]
            if corners:
                rows = np.concatenate(corners)
                keys = rows if solid else rows[:, 0] * len(self.points) + rows[:, 1]
                _, inverse, count = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
                single, places, faces = count[inverse.ravel()] == 1, np.concatenate(owner), np.concatenate(number)
                for i, free in enumerate(self._free):
                    free[places[single & (faces == i)]] = True
        return self._free


def _line_of(entry: Entry, member: int) -> int | None:
    """The data line in which a number stands."""
    if entry.line is not None:
        return entry.line
    block: Block = entry.block
    if block.keyword not in ("NSET", "ELSET"):
        return None
    return next((i for i, row in block.rows() if any(w.isdecimal() and int(w) == member for w in row)), None)
