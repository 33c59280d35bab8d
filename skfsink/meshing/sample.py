"""A meshed sample with named boundaries, from a committed mesh, a mesh file, or gmsh."""

from __future__ import annotations

import inspect
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import skfem
from skfem.io.meshio import INV_HEX_MAPPING

from ..errors import MeshError, ParameterError, require
from ..fem.space import Space
from ..system.files import path_of
from ..system.shipped import data_folder
from .files.pieces import check_one_piece, hinge_note, merged
from .files.split import counted, needs_split
from .files.tidy import notes_of
from .files.unmatched import check_sides, slit_note
from .kept_mesh import SUFFIX
from .mesh_file import check_mesh, one_line, quietly, read_mesh_file
from .reused import reusable
from .shapes import SHAPES
from .vtu import read_mesh

__all__ = ["Sample", "file_sample", "kept_sample", "load_sample", "mesh_sample",
           "shape_mesh", "shape_sample"]

SIDE = 1e-6  # distance from the end of a body, over its size, within which a node is on that side
_CELLS = {"quad": (skfem.MeshQuad, "line"), "hexahedron": (skfem.MeshHex, "quad")}


@dataclass(frozen=True, eq=False)
class Sample:
    """A mesh ready to compute on.

    Attributes
    ----------
    name: of the mesh.
    space: spaces on it.
    boundaries: nodes of each named boundary, ascending.
    cells: numbers of the elements of each named set, ascending.
    notes: what was done to the mesh of a file while it was read, one line each.
    made: whether the mesh was made by gmsh, and is not a file of the user's or a committed one.
    source: path of the file of the user's that it was read from first; "" for other meshes.
    element: what the elements of a file of Abaqus are by their type, "planestress" or "axisymmetric"; "" if open.
    vectors: arrays of vectors of the file by name, at the elements (ne, 3): those of points are averaged, whatever
        their sign.
    """

    name: str
    space: Space
    boundaries: Mapping[str, np.ndarray]
    made: bool = False
    cells: Mapping[str, np.ndarray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    source: str = ""
    element: str = ""
    vectors: Mapping[str, np.ndarray] = field(default_factory=dict)

    def revolved(self) -> Sample:
        """The sample as the half plane of a body of revolution (MeshError: it has nodes at x < 0)."""
        if self.space.axisymmetric:
            return self
        space = self.space.revolved()
        count = int(space.on_axis.sum())
        note = f"a body of revolution: its {count} node(s) on the axis, x = 0, are held along x"
        return replace(self, space=space, notes=(*self.notes, *([note] if count else [])))

    def nodes(self, boundary: str) -> np.ndarray:
        """Nodes of a named boundary.

        Raises
        ------
        MeshError
            The mesh has no such boundary.
        """
        why = "".join(f" ({note})" for note in self.notes if note.startswith(f"the boundary {boundary!r} "))
        return _named(self.boundaries, boundary, f"mesh {self.name} has no boundary {boundary!r}{why}")

    def elements(self, name: str) -> np.ndarray:
        """Elements of a named set.

        Raises
        ------
        MeshError
            The mesh has no such set.
        """
        return _named(self.cells, name, f"mesh {self.name} has no set of elements {name!r}")

    def rim(self, *faces: str) -> np.ndarray:
        """Nodes of the outer boundary without the named `faces`, but with the edges of these.

        The axis of a body of revolution is no part of it.

        Raises
        ------
        MeshError
            The mesh has no such boundary.
        """
        facets = self.space.mesh.facets[:, self.space.mesh.boundary_facets()]
        facets = facets[:, ~self.space.on_axis[facets].all(axis=0)]
        for name in faces:
            facets = facets[:, ~np.isin(facets, self.nodes(name)).all(axis=0)]
        return np.unique(facets)


def _named(sets: Mapping[str, np.ndarray], name: str, failure: str) -> np.ndarray:
    if name not in sets:
        raise MeshError(f"{failure}; it has {one_line(', '.join(sorted(sets))) or 'none'}")
    return sets[name]


@reusable
def load_sample(case: str, mesh: str, make: Callable[[], meshio.Mesh] | None = None,
                lift: Callable[[meshio.Mesh], meshio.Mesh] | None = None) -> Sample:
    """The sample of `case` on the mesh of that name, or in the mesh file of that path.

    `make` builds the mesh when the committed ones do not apply, because a dimension was changed; it needs gmsh.
    `lift` turns a named mesh, which is a section, into the body; a mesh file is taken as it is.

    Raises
    ------
    MeshError
        Unknown name, missing or unreadable file, or elements that cannot be used.
    MissingExtra
        `make` was given and gmsh is not installed.
    """
    lift = lift or _as_it_is
    if make is not None:
        return _from_meshio(mesh, lift(quietly(make, f"the mesh {mesh} cannot be made")), made=True)
    folder = data_folder(case) / "meshes"
    known = sorted(p.stem for p in folder.glob("*.vtu"))
    path = folder / f"{mesh}.vtu"
    if mesh in known:
        return _from_meshio(mesh, lift(quietly(lambda: read_mesh(path), f"the mesh file {path} cannot be read")))
    if not Path(mesh).suffix:
        raise MeshError(f"mesh must be one of {', '.join(known)}, or the path of a mesh file; got {mesh!r}")
    return _from_file(path_of("mesh", mesh))


@reusable
def kept_sample(path: Path) -> Sample:
    """The sample that a run has left in its folder.

    Raises
    ------
    MeshError
        As of :func:`load_sample`.
    """
    return _from_meshio(str(path), read_mesh_file(path))


@reusable
def file_sample(path: Path, merge_nodes: float = 0.0) -> Sample:
    """The sample in a mesh file, whose sides have names; nodes within `merge_nodes` [mm] of each other become one.

    A boundary that the mesh does not name itself may be called `left` or `right` (nodes of least and greatest x),
    `bottom` or `top` (y), `back` or `front` (z).

    Raises
    ------
    MeshError
        As of :func:`load_sample`.
    """
    sample = _from_file(path, merge_nodes, option=True)
    X = sample.space.X
    near = SIDE * float(np.ptp(X, axis=0).max())
    sides = {}
    for x, names in zip(X.T, (("left", "right"), ("bottom", "top"), ("back", "front"))):
        for name, end in zip(names, (x.min(), x.max())):
            sides[name] = np.flatnonzero(np.abs(x - end) <= near)
    return replace(sample, boundaries={**sides, **sample.boundaries})


def mesh_sample(name: str, mesh: meshio.Mesh) -> Sample:
    """The sample of a mesh, whose boundaries and elements are those that it names (MeshError)."""
    return _from_meshio(name, mesh)


@reusable
def shape_sample(case: str, arguments: Mapping[str, Any], lift: Callable[[meshio.Mesh], meshio.Mesh] | None = None,
                 settings: Mapping[str, Any] | None = None) -> Sample:
    """The sample of a case whose shape is one of :data:`.shapes.SHAPES`.

    `arguments` are those of the case function: `mesh`, `mesh_seed`, and the dimensions, named as in the function of the
    shape; `settings` are arguments of that function which are not those of the named mesh. The committed mesh
    is read where nothing has changed; gmsh makes another one else.

    Raises
    ------
    ParameterError
        A dimension or a seed was given together with a mesh file.
    MeshError, MissingExtra
        As of :func:`load_sample`.
    """
    shape, name = SHAPES[case], str(arguments["mesh"])
    changed = _changed(case, arguments, settings or {})
    if not changed:
        return load_sample(case, name, lift=lift)
    if Path(name).suffix:
        names = (*inspect.signature(shape.make).parameters, "mesh_seed")
        words = [k for k in names if k in arguments]
        raise ParameterError(f"{', '.join(words[:-1])} and {words[-1]} are for the meshes {', '.join(shape.meshes)}; "
                             f"the mesh file {name} is taken unchanged")
    if name not in shape.meshes:
        return load_sample(case, name)  # which says what there is
    return load_sample(case, name, lambda: shape_mesh(case, arguments, settings), lift)


def shape_mesh(case: str, arguments: Mapping[str, Any], settings: Mapping[str, Any] | None = None) -> meshio.Mesh:
    """The section of a named mesh with the dimensions, the seed and the settings of :func:`shape_sample`, by gmsh."""
    shape = SHAPES[case]
    mesh: meshio.Mesh = shape.make(**{**shape.meshes[arguments["mesh"]], **_changed(case, arguments, settings or {})})
    return mesh


def _changed(case: str, arguments: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments of the shape's function that are not those of the committed mesh."""
    seed = int(require("mesh_seed", arguments["mesh_seed"], low=0, whole=True))
    dimensions = {k: arguments[k] for k, p in inspect.signature(SHAPES[case].make).parameters.items()
                  if k in arguments and arguments[k] != p.default}
    return {**dimensions, **settings, **({"seed": seed} if seed else {})}


def _as_it_is(mesh: meshio.Mesh) -> meshio.Mesh:
    return mesh


def _from_file(path: Path, merge_nodes: float = 0.0, option: bool = False) -> Sample:
    """The sample in a mesh file, in one piece; `option` says that the scene has the parameter `merge_nodes`."""
    name = one_line(str(path))
    data = read_mesh_file(path)
    if merge_nodes and path.suffix.lower() != SUFFIX:  # that of a run has been merged already
        check_mesh(name, merged(name, data, merge_nodes))
    sample = _from_meshio(str(path), data, source=str(path))
    check_one_piece(sample.name, shlex.quote(name), sample.space, option)
    check_sides(sample.name, sample.space)
    notes = filter(None, (slit_note(sample.space), hinge_note(sample.space)))
    return replace(sample, notes=(*sample.notes, *notes))


def _from_meshio(name: str, data: meshio.Mesh, made: bool = False, source: str = "") -> Sample:
    shown, info = one_line(name), data.info or {}
    types = {block.type for block in data.cells if len(block.data)}
    present = [kind for kind in _CELLS if kind in types]
    others = sorted(types - {"quad", "hexahedron", "line", "vertex"})
    if needs_split(data):
        raise MeshError(f"mesh {shown} has {counted(data)}, and a run takes quadrilaterals or hexahedra alone: "
                        f"convert it with skfsink mesh {shlex.quote(shown)} OUT.vtu")
    if others and present:
        raise MeshError(f"mesh {shown} has {' and '.join(others)} cells beside its elements: leave them out, or let "
                        f"skfsink mesh {shlex.quote(shown)} OUT.vtu do so")
    if not present:
        raise MeshError(f"mesh {shown} must consist of quadrilaterals or hexahedra; it has "
                        f"{', '.join(sorted({b.type for b in data.cells})) or 'no cells'}")
    kind = "hexahedron" if "hexahedron" in present else "quad"
    mesh_class, facet = _CELLS[kind]
    cells = data.cells_dict[kind]
    if cells.min() < 0 or cells.max() >= len(data.points):
        raise MeshError(f"mesh {shown} has elements with nodes that do not exist")
    dim = 2 if kind == "quad" else 3
    points = np.asarray(data.points, float)[:, :dim]
    connectivity = cells.T if kind == "quad" else cells[:, INV_HEX_MAPPING[:8]].T
    try:
        space = Space(mesh_class(np.ascontiguousarray(points.T), np.ascontiguousarray(connectivity.astype(np.int64))))
    except MeshError as error:
        raise MeshError(f"mesh {shown}: {error}") from None
    return Sample(info.get("name") or Path(name).stem, space, _boundaries(data, facet), info.get("made", made),
                  cells=_elements(data, kind), notes=notes_of(data), source=info.get("source", source),
                  element=info.get("element", ""),
                  vectors=_vectors(data, kind, space.conn))


def _vectors(data: meshio.Mesh, kind: str, conn: np.ndarray) -> dict[str, np.ndarray]:
    """Arrays of three components at the elements."""
    found = {}
    for name, values in data.point_data.items():
        if np.shape(values) == (len(data.points), 3):
            at = np.asarray(values, float)[conn]
            _, turned = np.linalg.eigh(np.einsum("eai,eaj->eij", at, at))  # of a direction and its opposite the same
            found[name] = turned[:, :, -1]
    for name, blocks in data.cell_data.items():
        own = [np.asarray(values, float) for values, block in zip(blocks, data.cells) if block.type == kind]
        if own and all(values.ndim == 2 and values.shape[1] == 3 for values in own):
            found[name] = np.concatenate(own)
    return found


def _elements(data: meshio.Mesh, kind: str) -> dict[str, np.ndarray]:
    """Sets of elements, by the number of the element in the mesh."""
    sets, first = {}, np.cumsum([0, *(len(block.data) * (block.type == kind) for block in data.cells)])
    for name, members in data.cell_sets.items():
        found = [at + np.asarray(index, int) for block, at, index in zip(data.cells, first, members)
                 if block.type == kind and index is not None and len(index)]
        if found and not name.startswith("gmsh:"):
            sets[name] = np.unique(np.concatenate(found))
    return sets


def _boundaries(data: meshio.Mesh, facet: str) -> dict[str, np.ndarray]:
    sets: dict[str, Any] = {name: np.unique(np.asarray(nodes, np.int64)) for name, nodes in data.point_sets.items()
                            if len(nodes)}
    for name, members in data.cell_sets.items():
        if name.startswith("gmsh:"):
            continue
        nodes = [block.data[index].ravel() for block, index in zip(data.cells, members)
                 if block.type == facet and index is not None and len(index)]
        if nodes:
            sets[name] = np.unique(np.concatenate([sets.get(name, nodes[0][:0]), *nodes]))
    return sets
