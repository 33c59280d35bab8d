"""Parts of Abaqus models: nodes and elements as the data lines give them, by their numbers in the part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .abaqus_lines import Block
from .abaqus_named import Entry, Named, named, read_set, read_surface
from .abaqus_numbers import Numbers, number
from .abaqus_places import System
from .abaqus_types import AXISYMMETRIC, ORDER, REFUSED, SIZE, cell_of
from .bounds import Copies
from .unreadable import Unreadable

__all__ = ["Elements", "Part", "User"]


@dataclass(frozen=True)
class User:
    """A user element: its number of nodes, and of coordinates (0 if the file does not say)."""

    nodes: int
    coordinates: int


@dataclass
class Elements:
    """Elements of one `*ELEMENT`: numbers, and the numbers of their nodes (n, k), k = 0 where they are no body."""

    kind: str
    cell: str
    numbers: np.ndarray
    nodes: np.ndarray
    block: Block
    user: User | None = None


class Part:
    """What stands between `*PART` and `*END PART`, in an assembly, or in a file without parts.

    Memory: what the keywords so far have brought: `read_nodes`, `add_nodes`, `generate_nodes`, `read_elements`,
    `add_elements` and `generate_elements` add to it, `all_nodes` has the nodes so far.

    Attributes
    ----------
    name: as written, "" for what is in no part.
    nodes: numbers and coordinates (n, 3) [as written], by keyword.
    elements: by keyword.
    node_sets, element_sets, surfaces: by name in small letters.
    """

    def __init__(self, name: str, users: dict[str, User], copies: Copies) -> None:
        self.name, self.users, self.copies = name, users, copies
        self.nodes: list[tuple[np.ndarray, np.ndarray]] = []
        self.elements: list[Elements] = []
        self.node_sets: dict[str, Named] = {}
        self.element_sets: dict[str, Named] = {}
        self.surfaces: dict[str, Named] = {}
        self.system = System()

    def read_nodes(self, block: Block) -> None:
        """`*NODE`."""
        read = Numbers(block, whole=False)
        if read.table is not None:
            table = read.table
        else:
            rows = [(i, row[:4]) for i, row in read.rows()]
            table = np.array([row + [0.0] * (4 - len(row)) for _, row in rows]).reshape(-1, 4)
        numbers = table[:, 0]
        if len(wrong := np.flatnonzero((numbers != np.floor(numbers)) | (numbers < 1) | (numbers > 2**53))):
            raise block.error(f"{numbers[wrong[0]]:g} is no number of a node", read.at[wrong[0]])
        points = np.zeros((len(table), 3))
        points[:, :min(3, table.shape[1] - 1)] = table[:, 1:4]
        self.add_nodes(numbers.astype(np.int64), self.system.placed(points, block), block)

    def add_nodes(self, numbers: np.ndarray, points: np.ndarray, block: Block) -> None:
        """Nodes by number, into the set that the keyword names as well."""
        self.nodes.append((numbers, points))
        if name := block.parameters.get("NSET"):
            named(self.node_sets, name).entries.append(Entry(numbers, block))

    def all_nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """Numbers and coordinates of all nodes (a node that is given again at the same place counts once).

        Raises
        ------
        Unreadable
            A node is at two places.
        """
        if not self.nodes:
            return np.zeros(0, np.int64), np.zeros((0, 3))
        numbers, points = np.concatenate([n for n, _ in self.nodes]), np.concatenate([x for _, x in self.nodes])
        if (np.diff(numbers) > 0).all():
            return numbers, points
        kept, first, inverse = np.unique(numbers, return_index=True, return_inverse=True)
        if len(kept) < len(numbers):
            apart = (points[first][inverse] != points).any(axis=1)
            if apart.any():
                raise Unreadable(f"node {numbers[apart.argmax()]} is given twice, at two places{_of(self.name)}")
            first.sort()
            numbers, points = numbers[first], points[first]
        return numbers, points

    def read_system(self, block: Block) -> None:
        """`*SYSTEM`: where the coordinates of the nodes that follow are."""
        self.system = System.of(block)

    def generate_nodes(self, block: Block) -> None:
        """`*NGEN` on a straight line."""
        if block.parameters.get("LINE"):
            raise block.error("*NGEN on curves is not read: write the nodes themselves")
        numbers, points = self.all_nodes()
        order = np.argsort(numbers)
        ordered = numbers[order]
        for i, row in Numbers(block, whole=True).rows():
            first, last, step = int(row[0]), int(row[1]) if len(row) > 1 else 0, int(row[2]) if len(row) > 2 else 1
            at = np.minimum(np.searchsorted(ordered, (first, last)), len(ordered) - 1)
            if not len(ordered) or (ordered[at] != (first, last)).any():
                raise block.error(f"*NGEN is between nodes that exist; got {first} and {last}", i)
            if step == 0 or (last - first) % step or (n := (last - first) // step) < 1 or len(row) > 3:
                raise block.error(f"*NGEN takes first, last and step, a part of their difference; got {row}", i)
            self.copies.add(n, error=block.error)
            ends, share = points[order[at]], np.arange(n + 1) / n
            if name := block.parameters.get("NSET"):
                named(self.node_sets, name).entries.append(Entry(np.array([first, last]), block))
            between = ends[0] + share[1:-1, None] * (ends[1] - ends[0])
            self.add_nodes(first + step * np.arange(1, n), between, block)

    def read_elements(self, block: Block) -> None:
        """`*ELEMENT`, of any type that is known."""
        kind = block.need("TYPE").upper()
        if "OFFSET" in block.parameters:
            raise block.error("*ELEMENT with OFFSET= is not read: write the numbers of the nodes themselves")
        user = self.users.get(kind)
        cell = cell_of(kind) if user is None else ""
        shown = kind[:20] if kind.isprintable() else ascii(kind[:20])
        if cell is None and AXISYMMETRIC.match(kind):
            raise block.error(f"elements {shown} are axisymmetric of a kind that is not computed: make a mesh of solid "
                              "ones (CAX4), or one of hexahedra of the whole body")
        for form, reason in REFUSED if user is None else ():
            if form.match(kind):
                raise block.error(f"elements {shown} are {reason}")
        if cell is None:
            also = ": *USER ELEMENT, TYPE= is missing" if kind[:1] == "U" or kind[:2] == "VU" else ""
            raise block.error(f"elements of type {shown} are not known{also}")
        if user is not None:
            read = self._rows(block, user.nodes, shown)
        elif cell in ("", "line"):
            read = self._loose(block)
        else:
            read = self._rows(block, SIZE[cell], shown)
        numbers, nodes = read[:, 0], read[:, 1:]
        if len(numbers) and numbers.min() < 1:
            raise block.error(f"{numbers.min()} is no number of an element")
        if cell == "wedge15":  # which meshio cannot hold
            cell, nodes = "wedge", nodes[:, :6]
        if cell in ORDER:
            nodes = nodes[:, ORDER[cell]]
        self.add_elements(Elements(shown, cell, numbers, nodes, block, user))

    def add_elements(self, elements: Elements) -> None:
        """Elements by number, into the set that their keyword names as well."""
        self.elements.append(elements)
        if name := elements.block.parameters.get("ELSET"):
            named(self.element_sets, name).entries.append(Entry(elements.numbers, elements.block))

    @staticmethod
    def _rows(block: Block, size: int, kind: str) -> np.ndarray:
        """Numbers of elements and their nodes (n, 1 + size)."""
        read = Numbers(block, whole=True)
        if read.table is not None and read.table.shape[1] == 1 + size:
            return read.table
        found: list[float] = []
        begun = 0  # entries of the element that goes on in the next line
        for i, row in read.rows():
            begun += len(row)
            found += row
            if begun == 1 + size:
                begun = 0
            elif begun > 1 + size or not (size > 15 or block.data[i].rstrip().endswith(",")):
                raise block.error(f"element {int(found[-begun])} has {begun - 1} nodes; one of type {kind} has {size}",
                                  i)
        if begun:
            raise block.error(f"element {int(found[-begun])} has {begun - 1} nodes; one of type {kind} has {size}",
                              read.at[-1])
        return np.array(found, np.int64).reshape(-1, 1 + size)

    @staticmethod
    def _loose(block: Block) -> np.ndarray:
        """Numbers of elements that are no body, and up to three of their nodes; -1 where there are fewer."""
        read = Numbers(block, whole=True)
        if read.table is not None and 2 <= read.table.shape[1] <= 4:
            table = read.table
            return np.column_stack([table, np.full((len(table), 4 - table.shape[1]), -1)])
        found, more = [], False
        for i, line in ((i, block.data[i].strip()) for i in read.at):
            if not more:
                first = [word.strip() for word in line.split(",")][:4]
                row = [int(number(block, i, first[0], whole=True))]
                row += [int(w) if w.isdecimal() and len(w) < 19 else -1 for w in first[1:]]
                found.append(row + [-1] * (4 - len(row)))
            more = line.endswith(",") and line.count(",") > 4
        return np.array(found, np.int64).reshape(-1, 4)

    def generate_elements(self, block: Block) -> None:
        """`*ELGEN`: rows and layers of copies of an element, its nodes counted on."""
        for i, row in Numbers(block, whole=True).rows():
            master = int(row[0])
            source = next((e for e in self.elements if (e.numbers == master).any()), None)
            if source is None:
                raise block.error(f"*ELGEN copies an element that exists; got {master}", i)
            numbers, nodes = np.array([master]), source.nodes[source.numbers == master]
            if not nodes.size:
                raise block.error(f"*ELGEN of elements {source.kind} is not read", i)
            steps = [int(x) for x in row[1:]]
            if len(steps) > 9:
                raise block.error("*ELGEN takes up to 10 numbers", i)
            for k in range(0, len(steps), 3):
                n, by_node, by_element = (*steps[k:k + 3], *(1, 1, 1)[len(steps[k:k + 3]):])
                if n < 1:
                    raise block.error(f"*ELGEN of {n} copies", i)
                self.copies.add(n * len(numbers), error=block.error)
                copies = np.arange(n)
                numbers = (numbers + by_element * copies[:, None]).ravel()
                nodes = (nodes + by_node * copies[:, None, None]).reshape(len(numbers), -1)
            generated = Elements(source.kind, source.cell, numbers[1:], nodes[1:], source.block, source.user)
            self.elements.append(generated)
            for name, known in ((source.block.parameters.get("ELSET"), numbers[1:]),
                                (block.parameters.get("ELSET"), numbers)):
                if name:
                    named(self.element_sets, name).entries.append(Entry(known, block))

    def read_set(self, block: Block) -> None:
        """`*NSET` or `*ELSET`."""
        sets = self.node_sets if block.keyword == "NSET" else self.element_sets
        read_set(block, named(sets, block.need(block.keyword)))

    def read_surface(self, block: Block) -> None:
        """`*SURFACE`."""
        read_surface(block, named(self.surfaces, block.need("NAME")))


def _of(name: str) -> str:
    return f" of part {name[:60]!r}" if name else ""
