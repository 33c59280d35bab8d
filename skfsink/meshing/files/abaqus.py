"""Mesh files of Abaqus (keyword files, `.inp`): parts placed together, elements of a body, sets and surfaces.

What changes the body or its sets is read, or refused, or named in a note with its line; materials, sections, steps and
boundary conditions are for a deck to say. Sets and surfaces of an instance are `INSTANCE.SET`, and `SET` as well where
only one part has it.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import meshio

from .abaqus_cells import Cells
from .abaqus_lines import Block, is_keyword_file, listed, read_blocks
from .abaqus_named import Named
from .abaqus_parts import Part, User
from .abaqus_places import turned
from .abaqus_sets import Body, Placed
from .bounds import Copies
from .unreadable import Unreadable

__all__ = ["is_keyword_file", "read_abaqus"]

#: keywords that make nodes and elements in ways that are not read
GENERATORS = {"NCOPY", "NFILL", "NMAP", "ELCOPY", "IMPORT", "SYMMETRICMODELGENERATION", "MANIFEST"}
#: keywords that join, move or take away parts of a body
NOTED = re.compile(r"(TIE|MPC|EQUATION|COUPLING|KINEMATICCOUPLING|DISTRIBUTINGCOUPLING|RIGIDBODY|EMBEDDEDELEMENT|"
                   r"SHELLTOSOLIDCOUPLING|CONTACT|CONTACTPAIR|FASTENER|ENRICHMENT|MODELCHANGE|IMPERFECTION|ADJUST|"
                   r"CLEARANCE|CYCLICSYMMETRYMODEL|CRACK|DEBOND|FRACTURECRITERION|PRETENSIONSECTION|SUBSTRUCTURE|"
                   r"ELEMENTPROGENY|DISPLAYBODY|ORIGIN)")
#: those that a deck has other words for
FOR_A_DECK = re.compile(r"(MATERIAL|STEP|BOUNDARY|AMPLITUDE|SOLIDSECTION|INITIALCONDITIONS|CLOAD|DLOAD|DSLOAD)")


def read_abaqus(path: Path) -> meshio.Mesh:
    """The mesh in a keyword file, with its sets and surfaces, and notes in `info["notes"]`.

    Raises
    ------
    Unreadable
        What is wrong, with the line.
    """
    if not is_keyword_file(path):
        raise Unreadable("it is no keyword file of Abaqus, whose first line begins with *, and no UCD file")
    model = Model(read_blocks(path))
    return Cells(model.body, model.notes).mesh(model.names)


class Model:
    """The blocks of a file, put together.

    Attributes
    ----------
    body: all parts where they are placed.
    notes: what the user should know.
    names: what sets and surfaces are called: the name, the scope and the set, by kind.
    """

    def __init__(self, blocks: list[Block]) -> None:
        self.notes: list[str] = []
        self.body = Body()
        self.users = _users(blocks)
        if any("written by meshio" in line for block in blocks[:1] for line in block.data[:3]):
            self._by_meshio(blocks)
        self.copies = Copies()
        self.root = Part("", self.users, self.copies)
        self.parts: dict[str, Part] = {}
        self.instances: dict[str, tuple[str, Part, Part, Block]] = {}
        self._noted: dict[str, list[Block]] = {}
        self._sort(blocks)
        self._place()
        self.names = {kind: self._names(kind) for kind in ("node_sets", "element_sets", "surfaces")}

    def _by_meshio(self, blocks: list[Block]) -> None:
        """Files of meshio (5.3) have the last type of its table: CAX4P for all quadrilaterals, R3D3 for triangles."""
        for block in blocks:
            if block.keyword == "ELEMENT" and block.parameters.get("TYPE") in ("R3D3", "R3D4"):
                block.parameters["TYPE"] = block.parameters["TYPE"].replace("R3D", "S")
        wrong = [block for block in blocks if block.keyword == "ELEMENT" and block.parameters.get("TYPE") == "CAX4P"]
        for block in wrong:
            block.parameters["TYPE"] = "CPE4"
        if wrong:
            self.notes.append("meshio wrote the file, and writes all quadrilaterals as axisymmetric (CAX4P): they are "
                              "taken as plane")

    def _sort(self, blocks: list[Block]) -> None:
        """Read each block into the part that it stands in."""
        now, part, instance = self.root, self.root, None
        for block in blocks:
            keyword = block.keyword
            if keyword == "PART":
                name = block.need("NAME")
                if name.lower() in self.parts:
                    raise block.error(f"part {name[:60]!r} is given twice")
                now = part = self.parts[name.lower()] = Part(name, self.users, self.copies)
            elif keyword in ("ENDPART", "ASSEMBLY", "ENDASSEMBLY", "STEP"):
                now = part = self.root
            elif keyword == "INSTANCE":
                now, instance = self._instance(block), block
            elif keyword == "ENDINSTANCE":
                now, instance = self.root, None
            elif keyword in GENERATORS:
                raise block.error(f"*{keyword} is not read: write the nodes and elements themselves")
            elif (read := self._reader(now, keyword)) is not None:
                read(block)
            elif NOTED.fullmatch(keyword):
                self._noted.setdefault(keyword, []).append(block)
            elif FOR_A_DECK.fullmatch(keyword):
                self._noted.setdefault("", []).append(block)
            elif keyword == "PARAMETER":
                raise block.error("*PARAMETER is not read: write the numbers themselves")
        if part is not self.root:
            raise Unreadable(f"part {part.name[:60]!r} has no *END PART: the file is not complete")
        if instance is not None:
            raise instance.error("the instance has no *END INSTANCE: the file is not complete")
        for keyword, found in self._noted.items():
            if keyword:
                self.notes.append(f"*{keyword} is not read ({listed(block.where for block in found)}): nothing joins, "
                                  "moves or removes parts of the body but shared nodes")
            else:
                self.notes.append("materials, sections, steps, loads and boundary conditions of the file are not read: "
                                  "a deck says them")

    @staticmethod
    def _reader(part: Part, keyword: str) -> Callable[[Block], None] | None:
        return {"NODE": part.read_nodes, "ELEMENT": part.read_elements, "NSET": part.read_set, "ELSET": part.read_set,
                "SURFACE": part.read_surface, "NGEN": part.generate_nodes, "ELGEN": part.generate_elements,
                "SYSTEM": part.read_system}.get(keyword)

    def _instance(self, block: Block) -> Part:
        """The part of an instance; what it has itself is read into a copy of it."""
        if "LIBRARY" in block.parameters or "INSTANCE" in block.parameters:
            raise block.error("an instance of an earlier analysis is not read: write its mesh as a part")
        name, of = block.need("NAME"), block.need("PART")
        if name.lower() in self.instances:
            raise block.error(f"instance {name[:60]!r} is given twice")
        if (part := self.parts.get(of.lower())) is None:
            raise block.error(f"there is no part {of[:60]!r}")
        instance = Part(part.name, self.users, self.copies)
        instance.nodes, instance.elements = [*part.nodes], [*part.elements]
        for kind in ("node_sets", "element_sets", "surfaces"):
            self.copies.add(0, sum(1 + len(named.entries) for named in getattr(part, kind).values()), block.error)
            setattr(instance, kind, {key: Named(named.name, [*named.entries], named.kind)
                                for key, named in getattr(part, kind).items()})
        self.instances[name.lower()] = (name, part, instance, block)
        return instance

    def _place(self) -> None:
        if not self.instances and self.parts:
            if len(self.parts) > 1:
                raise Unreadable(f"it has the parts {listed(p.name for p in self.parts.values())}, and no *INSTANCE "
                                 "that places them")
            part = next(iter(self.parts.values()))
            self.notes.append(f"part {part.name[:60]!r} has no *INSTANCE and is taken as it stands")
            self.body.place(part.name, part, *part.all_nodes())
            self.instances[part.name.lower()] = (part.name, part, part, Block("PART", {}, "", 1, 1))
        else:
            seen = set()
            for name, part, instance, block in self.instances.values():
                numbers, points = instance.all_nodes()
                if part.name in seen:
                    self.copies.add(len(numbers) + sum(len(elements.numbers) for elements in instance.elements),
                                    error=block.error)
                seen.add(part.name)
                self.body.place(name, instance, numbers, turned(points, block))
        self.body.place("", self.root, *self.root.all_nodes())
        used = {part.name for _, part, _, _ in self.instances.values()}
        if left := [part.name for part in self.parts.values() if part.name not in used]:
            self.notes.append(f"the part(s) {listed(left)} have no instance and are left out")
        if not len(self.body.points):
            raise Unreadable("it has no *NODE with nodes")
        if not self.body.n_elements:
            raise Unreadable("it has no *ELEMENT with elements")

    def _names(self, kind: str) -> list[tuple[str, list[tuple[Placed, Named]]]]:
        """Names of the sets of a kind, each with what it is of: those of the assembly, and of the instances."""
        root = self.body.placed[""]
        found = [(named.name, [(root, named)]) for named in getattr(self.root, kind).values()]
        inner: dict[str, list[tuple[Placed, Named]]] = {}
        for key in self.instances:
            placed = self.body.placed[key]
            for low, named in getattr(placed.part, kind).items():
                found.append((f"{placed.name}.{named.name}", [(placed, named)]))
                inner.setdefault(low, []).append((placed, named))
        used, what = {name.lower() for name, _ in found}, kind.replace("_", " ")[:-1]
        for low, sets in inner.items():
            name = sets[0][1].name
            if low in used:
                continue
            if len(parts := list(dict.fromkeys(placed.part.name for placed, _ in sets))) > 1:
                self.notes.append(f"the {what} {name[:60]!r} is in the parts {listed(parts)}: it is called "
                                  f"{listed(f'{placed.name}.{named.name}' for placed, named in sets)}")
                continue
            if len(sets) > 1:
                self.notes.append(f"the {what} {name[:60]!r} is that of the instances "
                                  f"{listed(placed.name for placed, _ in sets)} together")
            found.append((name, sets))
        return found


def _users(blocks: list[Block]) -> dict[str, User]:
    """User elements of the file, by type in capitals."""
    users = {}
    for block in blocks:
        if block.keyword == "USERELEMENT":
            counts = [block.need("NODES"), block.parameters.get("COORDINATES", "0")]
            if not all(word.isascii() and word.isdecimal() and len(word) < 4 for word in counts) or counts[0] == "0":
                raise block.error(f"a user element has a number of NODES and COORDINATES; got {listed(counts)}")
            users[block.need("TYPE").upper()] = User(int(counts[0]), int(counts[1]))
    return users
