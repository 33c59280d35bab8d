"""Cells of the mesh from the elements of an Abaqus model: the body, edges or faces of it, and what is left out."""

from __future__ import annotations

import meshio
import numpy as np

from .abaqus_lines import listed
from .abaqus_named import Named
from .abaqus_parts import Elements
from .abaqus_sets import Body, Placed, base_of
from .abaqus_types import PLANE_STRESS, REVOLVED, SHELL
from .unreadable import Unreadable

__all__ = ["Cells"]

SOLID = ("hexahedron", "tetra", "wedge", "pyramid")
#: cells that a user element may be: by number of coordinates and of nodes
USER_CELLS = {(2, 4): "quad", (3, 8): "hexahedron", (2, 3): "triangle"}
FACET = {2: "line", 3: "triangle", 4: "quad"}
Names = list[tuple[str, list[tuple[Placed, Named]]]]


class Cells:
    """The elements of a body as cells.

    Memory: the cells so far, from which `mesh` is made.

    Attributes
    ----------
    block, row: of each element, among the cells; block -1 where it has no cell.
    """

    def __init__(self, body: Body, notes: list[str]) -> None:
        self.body, self.notes = body, notes
        self.block, self.row = np.full(body.n_elements, -1), np.zeros(body.n_elements, np.int64)
        self.cells: list[tuple[str, np.ndarray]] = []
        self._users()
        self.solid = any(base_of(group.cell) in SOLID for group, _, nodes in body.blocks if len(nodes))
        self._body()
        self._facets()
        self._notes()

    def _users(self) -> None:
        """User elements: those on the nodes of others are these; the rest are of the form that they must have."""
        body = self.body
        self.same: list[tuple[np.ndarray, np.ndarray]] = []
        known: dict[int, tuple[np.ndarray, np.ndarray]] = {}  # rows of nodes, ascending, and their elements
        users = [k for k, (group, _, nodes) in enumerate(body.blocks) if group.user is not None and len(nodes)]
        if not users:
            return
        others = [(at, nodes) for group, at, nodes in body.blocks
                  if group.user is None and group.cell not in ("", "line")]
        for size in {body.blocks[k][2].shape[1] for k in users}:
            known[size] = _joined([(np.sort(nodes, axis=1), at + np.arange(len(nodes))) for at, nodes in others
                                   if nodes.shape[1] == size], size)
        twins: dict[tuple[str, str], list[int]] = {}
        for k in users:
            group, at, nodes = body.blocks[k]
            size = nodes.shape[1]
            rows, elements = np.sort(nodes, axis=1), at + np.arange(len(nodes))
            found = _match(rows, *known[size])
            single = found < 0
            if not single.all():
                self.same.append((elements[~single], found[~single]))
                entry = twins.setdefault((group.kind, group.block.where), [0, 0])
                entry[0] += int(np.count_nonzero(~single))
            if not single.any():
                continue
            assert group.user is not None
            flat = size in (3, 4) and not np.ptp(body.points[nodes[single]][..., 2])
            dim = 2 if flat else group.user.coordinates or 3
            if (cell := USER_CELLS.get((dim, size), "")) == "":
                raise group.block.error(f"{np.count_nonzero(single)} user elements {group.kind} of {size} nodes have "
                                      "no element of Abaqus on the same nodes, and may be of any form: add a layer of "
                                      "such elements (CPE4, C3D8)")
            self.notes.append(f"{np.count_nonzero(single)} user elements {group.kind} ({group.block.where}) are taken "
                              f"as {'quadrilaterals' if cell == 'quad' else cell + 's'}, by their {size} nodes in "
                              f"{dim} dimensions")
            group = Elements(group.kind, cell, group.numbers, group.nodes, group.block, group.user)
            body.blocks[k] = (group, at, nodes)
            known[size] = _joined([known[size], (rows[single], elements[single])], size)
        for (kind, where), (count, _) in twins.items():
            self.notes.append(f"{count} user elements {kind} ({where}) have the nodes of other elements and count once "
                              "with these, in sets as well")

    def _body(self) -> None:
        """The elements of the body, one block of each cell, in their order."""
        double = np.zeros(self.body.n_elements, bool)
        for elements, _ in self.same:
            double[elements] = True
        found: dict[str, list[np.ndarray]] = {}
        for group, at, nodes in self.body.blocks:
            if not group.cell or group.cell == "line" or (base_of(group.cell) in SOLID) != self.solid or not len(nodes):
                continue
            keep = np.flatnonzero(~double[at:at + len(nodes)])
            if group.cell not in found:
                found[group.cell] = []
                self.cells.append((group.cell, nodes[:0]))
            number = [cell for cell, _ in self.cells].index(group.cell)
            self.block[at + keep] = number
            self.row[at + keep] = sum(map(len, found[group.cell])) + np.arange(len(keep))
            found[group.cell].append(nodes[keep])
        self.cells = [(cell, np.concatenate(found[cell])) for cell, _ in self.cells]
        self.n_body = len(self.cells)
        for elements, others in self.same:
            self.block[elements], self.row[elements] = self.block[others], self.row[others]
        if not self.cells:
            kinds = listed(dict.fromkeys(group.kind for group, _, _ in self.body.blocks))
            raise Unreadable(f"it has no elements of a plane or solid body, only {kinds}")

    def _facets(self) -> None:
        """Elements that are edges or faces of the body: their sets are boundaries."""
        used = np.zeros(len(self.body.points) + 1, bool)  # the last for nodes that there are not
        for _, nodes in self.cells:
            used[nodes] = True
        self.left: dict[str, list[tuple[int, str]]] = {}
        self.facets: dict[str, list[np.ndarray]] = {}
        for group, at, nodes in self.body.blocks:
            body = group.cell not in ("", "line") and (base_of(group.cell) in SOLID) == self.solid
            if body or not len(nodes) or group.user is not None:
                continue
            where = (len(nodes), group.block.where)
            ends = _ends(self.body.points, nodes) if group.cell == "line" else None
            if group.cell == "line" and not self.solid and ends is not None and used[ends].all():
                self._add(ends, at)
                self.left.setdefault(f"edge {group.kind}", []).append(where)
            elif self.solid and base_of(group.cell) in ("quad", "triangle"):
                corners = nodes[:, :4 if base_of(group.cell) == "quad" else 3]
                if not used[corners].all():
                    raise group.block.error(f"elements {group.kind} lie beside the solid body: a mesh is either plane "
                                            "or solid; leave the others out")
                self._add(corners, at)
                self.left.setdefault(f"face {group.kind}", []).append(where)
            else:
                self.left.setdefault(f" {group.kind}", []).append(where)

    def _add(self, corners: np.ndarray, at: int | None = None) -> tuple[int, np.ndarray]:
        """Put cells among the edges or faces; gives their block and their rows."""
        cell = FACET[corners.shape[1]]
        kinds = [c for c, _ in self.cells[self.n_body:]]
        if cell not in kinds:
            self.cells.append((cell, corners[:0]))
            self.facets[cell] = []
            kinds.append(cell)
        number = self.n_body + kinds.index(cell)
        rows = sum(map(len, self.facets[cell])) + np.arange(len(corners))
        self.facets[cell].append(corners)
        if at is not None:
            self.block[at + np.arange(len(corners))], self.row[at + np.arange(len(corners))] = number, rows
        return number, rows

    def _notes(self) -> None:
        for key, found in self.left.items():
            what, _, kind = key.partition(" ")
            count, where = sum(n for n, _ in found), listed(line for _, line in found)
            if what:
                shown = f"are {what}s of the body and are not computed; a set of them is a boundary"
            else:
                shown = "are no body and are left out"
            self.notes.append(f"{count} element(s) of type {kind} ({where}) {shown}")
        kinds = {group.kind: group.block.where for group, _, nodes in self.body.blocks if len(nodes) and not self.solid}
        if stress := [kind for kind in kinds if PLANE_STRESS.match(kind)]:
            self.notes.append(f"the elements are of plane stress ({listed(stress)}): a deck decides, with "
                              'element = "planestress"')
        if around := [kind for kind in kinds if REVOLVED.match(kind)]:
            self.notes.append(f"the elements are of a body of revolution ({listed(around)}): a deck decides, with "
                              'element = "axisymmetric"')
        if shells := [kind for kind in kinds if SHELL.match(kind)]:
            self.notes.append(f"shells and membranes ({listed(shells)}) are taken as plane elements, whose thickness "
                              "and plane stress or strain a deck decides")

    def _element(self) -> str:
        """The `element` of a deck that all plane elements are of, "" if they leave it open."""
        kinds = [group.kind for group, _, nodes in self.body.blocks
                 if len(nodes) and not self.solid and base_of(group.cell) in ("quad", "triangle")]
        return next((element for element, form in (("planestress", PLANE_STRESS), ("axisymmetric", REVOLVED))
                     if kinds and all(map(form.match, kinds))), "")

    def mesh(self, names: dict[str, Names]) -> meshio.Mesh:
        """The mesh with the sets and surfaces of the model."""
        sets = {}
        for name, of in names["element_sets"]:
            elements = np.unique(np.concatenate([self.body.element_set(at, named.name) for at, named in of]))
            if not len(elements):
                self.notes.append(f"the element set {name[:60]!r} is empty, and is left out")
                continue
            sets[name] = self._members(elements)
            if not any(map(len, sets[name].values())):
                del sets[name]
                self.notes.append(f"the element set {name[:60]!r} has only elements that are left out, and so is it")
        points = {}
        for name, of in names["node_sets"]:
            nodes = np.unique(np.concatenate([self.body.node_set(at, named.name) for at, named in of]))
            if len(nodes):
                points[name] = nodes
            else:
                self.notes.append(f"the node set {name[:60]!r} is empty, and is left out")
        for name, of in names["surfaces"]:
            self._surface(name, of, names["surfaces"], sets, points)
        cells = [(cell, np.concatenate(self.facets[cell]) if i >= self.n_body else data)
                 for i, (cell, data) in enumerate(self.cells)]
        none = np.zeros(0, np.int64)
        cell_sets = {name: [members.get(i, none) for i in range(len(cells))] for name, members in sets.items()}
        mesh = meshio.Mesh(self.body.points, cells, cell_sets=cell_sets, point_sets=points)
        found = dict.fromkeys((*self.notes, *self.body.notes))
        mesh.info = {"notes": [note if note.isprintable() else ascii(note)[1:-1] for note in found],
                     "element": self._element()}
        return mesh

    def _members(self, elements: np.ndarray) -> dict[int, np.ndarray]:
        block, row = self.block[elements], self.row[elements]
        return {i: np.unique(row[block == i]) for i in range(len(self.cells))}

    def _surface(self, name: str, of: list[tuple[Placed, Named]], surfaces: Names,
                 sets: dict[str, dict[int, np.ndarray]], points: dict[str, np.ndarray]) -> None:
        """Make the edges or faces of a surface cells, and these a boundary; a surface of nodes is one of nodes."""
        corners: list[np.ndarray] = []
        nodes: list[np.ndarray] = []
        for at, named in of:
            self._collect(at, named, surfaces, corners, nodes, ())
        if not corners and not nodes:
            return
        nodes_of_set = np.unique(np.concatenate([c.ravel() for c in (*corners, *nodes)]))
        taken = next((key for key in points if key.lower() == name.lower()), None)
        if taken is not None and not np.array_equal(points[taken], nodes_of_set):
            self.notes.append(f"the node set and the surface {name[:60]!r} are of other nodes: the surface is called "
                              f"'surface:{name[:60]}'")
            name = f"surface:{name}"
        if nodes:
            points[name] = nodes_of_set
            return
        members = sets.setdefault(name, {})
        for faces in corners:
            number, rows = self._add(faces)
            members[number] = np.concatenate([members.get(number, rows[:0]), rows])

    def _collect(self, at: Placed, named: Named, surfaces: Names, corners: list[np.ndarray], nodes: list[np.ndarray],
                 above: tuple[str, ...]) -> None:
        if named.kind == "ELEMENT":
            corners += self.body.faces(at, named, self.solid)
        elif named.kind == "NODE":
            nodes += [self.body.entry(at, entry, "node", named.name) for entry in named.entries]
        elif named.kind == "UNION":
            for entry in named.entries:
                word = str(entry.members).lower()
                inner = next((of for name, of in surfaces if name.lower() == word), None)
                if inner is None or word in above:
                    raise entry.block.error(f"the surface {word[:60]!r} does not exist", entry.line)
                for placed, other in inner:
                    self._collect(placed, other, surfaces, corners, nodes, (*above, named.name.lower()))
        else:
            where = named.entries[0].block.where if named.entries else "no lines"
            self.notes.append(f"the surface {named.name[:60]!r} ({where}) is of TYPE={named.kind[:20]}, which is not "
                              "read")


def _ends(points: np.ndarray, nodes: np.ndarray) -> np.ndarray | None:
    """The two nodes (n, 2) at the ends of edges of two or three nodes (n, 3), the third being -1 or between."""
    if (nodes[:, :2] < 0).any():
        return None
    pairs = [nodes[:, [i, j]] for i, j in ((0, 1), (1, 2), (0, 2))]
    long = np.array([np.where((pair < 0).any(axis=1), -1.0, np.linalg.norm(points[pair[:, 0]] - points[pair[:, 1]],
                                                                         axis=1)) for pair in pairs])
    ends: np.ndarray = np.stack(pairs)[long.argmax(axis=0), np.arange(len(nodes))]
    return ends


def _joined(rows: list[tuple[np.ndarray, np.ndarray]], size: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows of nodes with their elements, in one."""
    return (np.concatenate([np.zeros((0, size), np.int64), *(r for r, _ in rows)]),
            np.concatenate([np.zeros(0, np.int64), *(e for _, e in rows)]))


def _match(rows: np.ndarray, known: np.ndarray, elements: np.ndarray) -> np.ndarray:
    """The element of each row of nodes among those known, -1 where there is none."""
    _, inverse = np.unique(np.concatenate([known, rows]), axis=0, return_inverse=True)
    inverse = inverse.ravel()
    of = np.full(inverse.max(initial=0) + 1, -1)
    of[inverse[:len(known)][::-1]] = elements[::-1]
    found: np.ndarray = of[inverse[len(known):]]
    return found
