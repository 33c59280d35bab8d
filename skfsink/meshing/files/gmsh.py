"""Meshes of gmsh: groups become sets of elements and boundaries, whatever kind of MSH file they come from.

A physical group of the dimension of the body is a set of elements; one of edges, faces, curves or points is a boundary.
A group without a name is called `point:5`, `curve:5`, `surface:5` or `volume:5`, by its number. In a file without
physical groups these are the elementary entities.
"""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np

from .msh import Msh, read_msh
from .msh_block import DIMENSION, NODES, SHAPE, Block
from .numbers import places
from .sets import join_boundaries
from .unreadable import Unreadable

__all__ = ["read_gmsh"]

WORDS = ("point", "curve", "surface", "volume")
CORNERS = {"point": 1, "line": 2, "triangle": 3, "quad": 4, "tetra": 4, "hexahedron": 8, "wedge": 6, "pyramid": 5}
#: meshio's names; elements of higher order lose their middle nodes
NAMES = {15: "vertex", 1: "line", 8: "line3", 2: "triangle", 9: "triangle6", 3: "quad", 16: "quad8", 10: "quad9",
         4: "tetra", 11: "tetra10", 5: "hexahedron", 17: "hexahedron20", 12: "hexahedron27", 6: "wedge", 18: "wedge15",
         13: "wedge18", 7: "pyramid", 19: "pyramid13", 14: "pyramid14"}
#: middle nodes in the order of VTK, where gmsh has another one
ORDER = {11: [*range(8), 9, 8],
         17: [*range(9), 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15],
         12: [*range(9), 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15, 22, 23, 21, 24, 20, 25, 26],
         18: [*range(6), 6, 9, 7, 12, 14, 13, 8, 10, 11],
         19: [*range(6), 8, 10, 6, 7, 9, 11, 12]}


def read_gmsh(path: Path) -> meshio.Mesh:
    """The mesh in an MSH file: blocks of elements by kind, with sets of elements and of nodes.

    Notes for the user are in `info["notes"]`.

    Raises
    ------
    Unreadable
        As of :func:`.msh.read_msh`; or there is nothing that could be a body.
    """
    msh, notes = read_msh(path.read_bytes()), list[str]()
    blocks = _by_kind(msh, notes)
    body = max((DIMENSION[block.kind] for block in blocks), default=0)
    if body < 2:
        raise Unreadable("it has no elements but lines and points: where there are physical groups, gmsh saves "
                         "nothing else; make one of the surface or volume as well, or set Mesh.SaveAll = 1")
    if body < 3 and msh.solids:
        notes.append("the model has a volume of which no element was saved: the surfaces are taken for a plane body; "
                     "make a physical group of the volume as well")
    physical = any(block.groups for block in blocks)
    groups = _groups(msh, blocks, physical, notes)
    used = np.unique(np.concatenate([block.nodes.ravel() for block in blocks if DIMENSION[block.kind] == body]))
    cell_sets: dict[str, list[np.ndarray]] = {}
    point_sets: dict[str, list[np.ndarray]] = {}
    for (dim, name), members in groups.items():
        if dim < body - 1:
            nodes = np.concatenate([block.nodes[index, :CORNERS[SHAPE[block.kind]]].ravel()
                                    for block, index in zip(blocks, members)])
            if physical or np.isin(nodes, used).any():  # of points that only help to draw there is nothing to say
                point_sets.setdefault(name, []).append(nodes)
        else:
            found = cell_sets.setdefault(name, [np.zeros(0, np.int64) for _ in blocks])
            found[:] = [np.union1d(one, two) for one, two in zip(found, members)]
    cells = [(NAMES[block.kind], block.nodes[:, ORDER.get(block.kind, slice(None))]) for block in blocks]
    return join_boundaries(meshio.Mesh(
        msh.points, cells, cell_sets=cell_sets, info={"notes": notes},
        point_sets={name: np.unique(np.concatenate(nodes)) for name, nodes in point_sets.items()}))


def _by_kind(msh: Msh, notes: list[str]) -> list[Block]:
    """One block a kind, in the order of the file, with nodes by their place in `msh.points`."""
    kinds: dict[int, list[Block]] = {}
    reduced = 0
    for block in msh.blocks:
        kind, nodes = block.kind, block.nodes
        if kind not in NAMES:
            kind = next(k for k in NAMES if SHAPE[k] == SHAPE[block.kind])
            nodes, reduced = nodes[:, :NODES[kind]], reduced + len(nodes)
        kinds.setdefault(kind, []).append(Block(kind, nodes, block.groups, block.entities))
    if reduced:
        notes.append(f"{reduced} elements of order 3 or more are taken by their corners")
    joined = [_joined(blocks) for blocks in kinds.values()]
    for block in joined:
        block.nodes = places(msh.tags, block.nodes)
    return joined


def _joined(blocks: list[Block]) -> Block:
    """Blocks of one kind in one."""
    at = np.cumsum([0, *(len(block.nodes) for block in blocks)])

    def shifted(members: list[dict[int, np.ndarray]]) -> dict[int, np.ndarray]:
        found: dict[int, list[np.ndarray]] = {}
        for first, sets in zip(at, members):
            for tag, index in sets.items():
                found.setdefault(tag, []).append(first + index)
        return {tag: np.concatenate(pieces) for tag, pieces in found.items()}

    return Block(blocks[0].kind, np.concatenate([block.nodes for block in blocks]),
                 shifted([block.groups for block in blocks]), shifted([block.entities for block in blocks]))


def _groups(msh: Msh, blocks: list[Block], physical: bool,
            notes: list[str]) -> dict[tuple[int, str], list[np.ndarray]]:
    """Elements of each block in each group, `physical` or elementary, by the dimension and the name of the group."""
    if msh.names and not physical:
        notes.append("no element is in a physical group, though there are names of some, as gmsh writes files of "
                     "version 2 with Mesh.SaveAll: save it as MSH 4.1, or without Mesh.SaveAll")
    found: dict[tuple[int, str], list[np.ndarray]] = {}
    for i, block in enumerate(blocks):
        dim = DIMENSION[block.kind]
        for tag, index in (block.groups if physical else block.entities).items():
            name = (msh.names.get((dim, tag), "") if physical else "") or f"{WORDS[dim]}:{tag}"
            members = found.setdefault((dim, name), [np.zeros(0, np.int64) for _ in blocks])
            members[i] = np.union1d(members[i], index)
    return found
