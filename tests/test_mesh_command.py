"""`skfsink mesh`: triangles, tetrahedra and mixed meshes split, mended and judged."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest
from plates import contents, invoke_program, plate, sample_of

from skfsink.errors import MeshError, ParameterError
from skfsink.meshing.files.convert import converted
from skfsink.meshing.files.quality import Quality
from skfsink.meshing.files.split import split
from skfsink.meshing.files.tidy import drop_empty, notes_of
from skfsink.meshing.outline import scaled_jacobian
from skfsink.meshing.sample import Sample, file_sample, mesh_sample
from skfsink.meshing.vtu import read_mesh, write_mesh

CUBE = np.array([[i, j, k] for k in (0, 1) for j in (0, 1) for i in (0, 1)])


# --- meshes ---
def triangles(mixed: bool = False) -> meshio.Mesh:
    """The small plate with its quadrilaterals cut in two, or every third one left whole, and a region."""
    mesh = plate(5, side=2.0, notch=0.5)
    quads = mesh.cells[0].data
    whole = np.arange(len(quads)) % 3 == 0 if mixed else np.zeros(len(quads), bool)
    cut = quads[~whole]
    flat = np.vstack([cut[:, [0, 1, 2]], cut[:, [0, 2, 3]]])
    blocks = [("triangle", flat), ("quad", quads[whole]), ("line", mesh.cells[1].data)]
    none = np.zeros(0, int)
    sets = {name: [none, none, members[1]] for name, members in mesh.cell_sets.items()}
    region = [np.flatnonzero(mesh.points[c].mean(axis=1)[:, 1] > 1) for _, c in blocks[:2]]
    made = meshio.Mesh(mesh.points, blocks, cell_sets={**sets, "upper": [*region, none]})
    drop_empty(made)
    return made


def shaken(points: np.ndarray, by: float) -> np.ndarray:
    """Points of the unit cube, those inside moved."""
    inside = ((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1)
    return points + inside[:, None] * np.random.default_rng(1).uniform(-by, by, points.shape)


def tetrahedra(n: int = 2) -> meshio.Mesh:
    """The unit cube of 6 n^3 tetrahedra, with triangles on two sides."""
    grid = np.array(list(itertools.product(range(n + 1), repeat=3)))
    number = {tuple(p): i for i, p in enumerate(grid.tolist())}
    cells = []
    for first in itertools.product(range(n), repeat=3):
        for axes in itertools.permutations(range(3)):
            corner, cell = list(first), [number[first]]
            for axis in axes:
                corner[axis] += 1
                cell.append(number[tuple(corner)])
            cells.append(cell)
    tets = np.array(cells)
    points = shaken(grid / n, 0.1 / n)
    side = np.linalg.det(points[tets[:, 1:]] - points[tets[:, :1]]) < 0
    tets[side] = tets[side][:, [0, 2, 1, 3]]
    return with_sides(points, [("tetra", tets)])


def layered(top: str) -> meshio.Mesh:
    """The unit cube: a section of triangles and quadrilaterals, swept to wedges and hexahedra; upper wedges, or
    tetrahedra for triangles alone."""
    x, y = np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 1, 4), indexing="ij")
    first = (np.arange(3)[:, None] * 4 + np.arange(3)).ravel()
    quads = first[:, None] + np.array([0, 4, 5, 1])
    whole = np.arange(9) % 2 == (0 if top == "wedge" else 9)
    flat = np.vstack([quads[~whole][:, [0, 1, 2]], quads[~whole][:, [0, 2, 3]]])
    points = np.vstack([np.column_stack([x.ravel(), y.ravel(), np.full(16, z)]) for z in (0, 0.5, 1)])
    wedges = [np.hstack([flat + 16 * k, flat + 16 * (k + 1)]) for k in range(2)]
    bricks = np.vstack([np.hstack([quads[whole] + 16 * k, quads[whole] + 16 * (k + 1)]) for k in range(2)])
    if top == "wedge":
        return with_sides(shaken(points, 0.05), [("wedge", np.vstack(wedges)), ("hexahedron", bricks)])
    tets = []
    for wedge in wedges[1].tolist():  # cut so that the diagonal of a side begins at its least node
        low = np.argsort(wedge[:3])
        a, b, c = (wedge[i] for i in low)
        tets += [[a, b, c, c + 16], [a, b, b + 16, c + 16], [a, a + 16, b + 16, c + 16]]
    cells = np.array(tets)
    side = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) < 0
    cells[side] = cells[side][:, [0, 2, 1, 3]]
    return with_sides(shaken(points, 0.05), [("wedge", wedges[0]), ("tetra", cells)])


SIDES = {"tetra": [(0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3)],
         "wedge": [(0, 1, 2), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)],
         "hexahedron": [(0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]}


def with_sides(points: np.ndarray, blocks: list[tuple[str, np.ndarray]]) -> meshio.Mesh:
    """A cube with facets on z = 0 and x = 1 as "floor" and "wall", the nodes of z = 0, and a region of x < 0.5."""
    found: dict[int, list[list[int]]] = {3: [], 4: []}
    for kind, cells in blocks:
        for face in SIDES[kind]:
            for facet in cells[:, face].tolist():
                if (points[facet][:, 2] == 0).all() or (points[facet][:, 0] == 1).all():
                    found[len(face)].append(facet)
    facets = [({3: "triangle", 4: "quad"}[n], np.array(f)) for n, f in found.items() if f]
    none = np.zeros(0, int)
    sets = {}
    for name, axis, at in (("floor", 2, 0.0), ("wall", 0, 1.0)):
        sets[name] = [none] * len(blocks) + [np.flatnonzero((points[f][:, :, axis] == at).all(axis=1))
                                             for _, f in facets]
    sets["part"] = [np.flatnonzero(points[c].mean(axis=1)[:, 0] < 0.5) for _, c in blocks] + [none] * len(facets)
    return meshio.Mesh(points, [*blocks, *facets], cell_sets=sets,
                       point_sets={"held": np.flatnonzero(points[:, 2] == 0)})


MESHES: dict[str, Callable[[], meshio.Mesh]] = {
    "triangles": triangles, "triangles and quadrilaterals": lambda: triangles(mixed=True), "tetrahedra": tetrahedra,
    "wedges and hexahedra": lambda: layered("wedge"), "wedges and tetrahedra": lambda: layered("tetra")}


def measures(points: np.ndarray, kind: str, cells: np.ndarray) -> np.ndarray:
    """Area or volume of cells of first order; of cells with warped faces that of tetrahedra, about."""
    x = points[cells]
    if kind in ("triangle", "quad"):
        one, two = x[:, -1] - x[:, 1], x[:, 2] - x[:, 0]
        return np.linalg.norm(np.cross(one, two), axis=1) / 2
    fans = {"tetra": [(0, 1, 2, 3)], "wedge": [(0, 1, 2, 3), (1, 2, 3, 4), (2, 3, 4, 5)]}[kind]
    return sum(np.abs(np.linalg.det(x[:, f[1:]] - x[:, f[:1]])) / 6 for f in fans)


def sides_of(sample: Sample, name: str) -> float:
    """Length or area of the outer facets all of whose nodes are in a boundary."""
    mesh, X = sample.space.mesh, sample.space.X
    facets = mesh.facets[:, mesh.boundary_facets()].T
    facets = facets[np.isin(facets, sample.nodes(name)).all(axis=1)]
    if sample.space.dim == 2:
        return float(np.linalg.norm(X[facets[:, 0]] - X[facets[:, 1]], axis=1).sum())
    middle = X[facets].mean(axis=1)
    total = 0.0
    for facet, m in zip(X[facets], middle):  # about its middle, by angle
        normal = np.linalg.svd(facet - m)[2]
        angle = np.arctan2((facet - m) @ normal[1], (facet - m) @ normal[0])
        ring = facet[np.argsort(angle)]
        total += float(np.linalg.norm(np.cross(ring[2] - ring[0], ring[3] - ring[1]))) / 2
    return total


# --- the split ---
@pytest.mark.parametrize("name", MESHES)
def test_split_keeps_the_body(name: str) -> None:
    """Fails if the split loses a part of the body, its boundary or a region, or turns an element over."""
    whole = MESHES[name]()
    sample = mesh_sample("split", split(MESHES[name]()))
    flat = sample.space.dim == 2
    total = sum(float(measures(whole.points, b.type, b.data).sum()) for b in whole.cells[:-1]) if flat else 1.0
    assert sample.space.V.sum() == pytest.approx(total, rel=1e-13)
    boundaries = {"top": 2, "bottom": 2, "right": 2, "notch": None} if flat else {"floor": 1, "wall": 1, "held": 1}
    for boundary, size in boundaries.items():
        if size is None:
            lines = whole.cells[-1].data[whole.cell_sets[boundary][-1]]
            size = np.linalg.norm(whole.points[lines[:, 0]] - whole.points[lines[:, 1]], axis=1).sum()
        assert sides_of(sample, boundary) == pytest.approx(size, rel=1e-12), boundary
    region = "upper" if flat else "part"
    own = sum(len(members) * {"triangle": 3, "quad": 4, "tetra": 4, "wedge": 6, "hexahedron": 8}.get(block.type, 0)
              for block, members in zip(whole.cells, whole.cell_sets[region]))
    assert len(sample.elements(region)) == own > 0
    centres = sample.space.X[sample.space.conn[sample.elements(region)]].mean(axis=1)
    assert (centres[:, 1] > 0.9).all() if flat else (centres[:, 0] < 0.8).all()


@pytest.mark.parametrize("name", MESHES)
def test_split_meshes_fit_together(name: str) -> None:
    """Fails if neighbours do not share the nodes of an edge or face: a constant stress then has forces inside."""
    sample = mesh_sample("split", split(MESHES[name]()))
    space = sample.space
    mesh = space.mesh
    outer = mesh.facets[:, mesh.boundary_facets()]
    force = np.zeros(space.X.shape)
    np.add.at(force, space.conn, np.einsum("eq,eqaj->eaj", space.w, space.dN))
    inside = np.setdiff1d(np.arange(space.n_nodes), outer)
    assert len(inside) > 10 and np.abs(force[inside]).max() < 1e-13
    u = space.X @ np.arange(space.dim**2).reshape(space.dim, space.dim)
    assert np.abs(space.gradient(u) - np.arange(space.dim**2).reshape(space.dim, space.dim).T).max() < 1e-11
    assert (Quality.of(space).jacobian > 0).all()
    if space.dim == 2:  # the outer length is that of the boundaries, so no facet is free inside
        total = sum(sides_of(sample, side) for side in ("top", "bottom", "left", "right", "notch"))
        X = space.X
        assert np.linalg.norm(X[outer[0]] - X[outer[1]], axis=1).sum() == pytest.approx(total, rel=1e-12)
    else:
        assert all(np.isclose(X, 0).any() or np.isclose(X, 1).any() for X in space.X[outer.T].mean(axis=1))


@pytest.mark.parametrize("name", MESHES)
def test_cells_in_the_other_sense(name: str, tmp_path: Path) -> None:
    """Fails if elements numbered clockwise, or left-handed, are refused or lost."""
    mesh = MESHES[name]()
    turn = {"triangle": [0, 2, 1], "quad": [0, 3, 2, 1], "tetra": [0, 2, 1, 3], "wedge": [3, 4, 5, 0, 1, 2],
            "hexahedron": [4, 5, 6, 7, 0, 1, 2, 3]}
    for block in mesh.cells[:-1] if len(mesh.cells) < 4 else mesh.cells[:2]:
        block.data[::2] = block.data[::2][:, turn[block.type]]
    meshio.write(tmp_path / "mesh.vtk", meshio.Mesh(mesh.points, mesh.cells))
    sample = mesh_sample("turned", converted(tmp_path / "mesh.vtk"))
    assert sample.space.V.sum() == pytest.approx(mesh_sample("split", split(MESHES[name]())).space.V.sum(), rel=1e-13)
    assert any("turned" in note for note in sample.notes)


def test_sets_of_nodes() -> None:
    """Fails if a set of nodes gains a node inside from a boundary, or a part that is held whole is held by every
    second node."""
    mesh = triangles()
    X = mesh.points
    rim, cells = np.unique(mesh.cells[-1].data), mesh.cells[0].data
    mesh.point_sets = {"rim": rim, "bottom nodes": np.flatnonzero(X[:, 1] == 0), "all": np.arange(len(X)),
                       "clamp": np.flatnonzero(X[:, 1] < 0.6), "one": np.array([3])}
    made = mesh_sample("sets", split(mesh))
    Y, facets = made.space.X, made.space.mesh.facets[:, made.space.mesh.boundary_facets()]
    assert np.array_equal(made.nodes("rim"), np.unique(facets))
    assert np.array_equal(made.nodes("bottom nodes"), made.nodes("bottom"))
    assert np.array_equal(made.nodes("all"), np.arange(made.space.n_nodes))
    assert len(made.nodes("one")) == 1
    clamp = made.space.conn[[e for e, nodes in enumerate(cells) if np.isin(nodes, mesh.point_sets["clamp"]).all()
                             for e in range(3 * e, 3 * e + 3)]]
    assert np.array_equal(made.nodes("clamp"), np.unique(clamp)) and (Y[made.nodes("clamp")][:, 1] < 0.6).all()


def test_sets_of_nodes_in_space() -> None:
    """Fails if the nodes of a face, or of a curve, lose what is between them, or gain nodes inside."""
    mesh = tetrahedra()
    X = mesh.points
    mesh.point_sets = {"floor nodes": np.flatnonzero(X[:, 2] == 0), "all": np.arange(len(X)),
                       "outside": np.flatnonzero(((X == 0) | (X == 1)).any(axis=1)),
                       "curve": np.flatnonzero((X[:, 2] == 0) & (X[:, 0] == 0)), "half": np.flatnonzero(X[:, 2] < 0.7)}
    lone = np.flatnonzero((X == [1, 1, 0.5]).all(axis=1))
    mesh.point_sets["spot"] = np.append(np.flatnonzero((X[:, 2] == 0) & (X[:, 1] <= 0.5)), lone)
    made = mesh_sample("sets", split(mesh))
    Y = made.space.X
    slope = (Y == [1, 0.75, 0.25]).all(axis=1)  # the middle of an edge from the spot to the lone node
    assert slope.any() and not slope[made.nodes("spot")].any() and (Y[made.nodes("spot")][:, 2] == 0).sum() == 19
    assert np.array_equal(made.nodes("floor nodes"), made.nodes("floor"))
    facets = made.space.mesh.facets[:, made.space.mesh.boundary_facets()]
    assert np.array_equal(made.nodes("outside"), np.unique(facets))
    assert len(made.nodes("all")) == made.space.n_nodes
    assert np.array_equal(np.sort(Y[made.nodes("curve")][:, 1]), [0, 0.25, 0.5, 0.75, 1])
    assert np.isin(np.flatnonzero(Y[:, 2] < 0.35), made.nodes("half")).all()


def test_middle_nodes_are_the_middles_of_edges() -> None:
    """Fails if a curved edge is made straight, a middle node is lost from its set, or one near a corner is taken."""
    mesh = triangles()
    cells, lines = mesh.cells[0].data, mesh.cells[-1].data
    edges = np.unique(np.sort(np.vstack([cells[:, pair] for pair in ([0, 1], [1, 2], [2, 0])]), axis=1), axis=0)
    number = {tuple(edge): len(mesh.points) + i for i, edge in enumerate(edges.tolist())}
    middle = mesh.points[edges].mean(axis=1)
    top = (mesh.points[edges][:, :, 1] == 2).all(axis=1)
    middle[top, 1] += 0.03  # a bulge
    quarter = np.flatnonzero((mesh.points[edges][:, :, 1] == 0).all(axis=1))[0]
    middle[quarter, 0] += 0.1
    rows = [[*cell, *(number[tuple(sorted((cell[i], cell[(i + 1) % 3])))] for i in range(3))]
            for cell in cells.tolist()]
    points = np.vstack([mesh.points, middle])
    held = np.array([number[tuple(sorted(line))] for line in lines[mesh.cell_sets["top"][-1]].tolist()])
    ends = lines[mesh.cell_sets["top"][-1]].ravel()
    sets = {name: [*members, np.zeros(0, int)] for name, members in mesh.cell_sets.items()}
    sets["spot"] = [np.zeros(0, int), np.zeros(0, int), np.array([0])]
    new = split(meshio.Mesh(points, [("triangle6", np.array(rows)), ("line", lines), ("vertex", held[:1, None])],
                            cell_sets=sets, point_sets={"held": np.append(held, ends), "ends": ends}))
    (spot,) = new.points[new.cells[2].data[0]]
    assert spot[1] == 2.03
    sample = mesh_sample("curved", new)
    X = sample.space.X
    on = X[sample.nodes("top")]
    assert np.isclose(on[:, 1], 2).sum() == 6 and np.isclose(on[:, 1], 2.03).sum() == 5
    assert np.array_equal(sample.nodes("held"), sample.nodes("top")) and len(sample.nodes("ends")) == 6
    assert len(X) == len(mesh.points) + len(edges) + len(cells)
    floor = np.sort(X[sample.nodes("bottom")][:, 0])
    assert np.allclose(np.diff(floor), 0.2)
    assert any("1 middle node(s) were not near the middle" in note for note in sample.notes)


@pytest.mark.parametrize("name", ["tetrahedra", "wedges and hexahedra"])
def test_second_order_in_space(name: str) -> None:
    """Fails if straight elements of second order are split otherwise than those of first order, or a set of nodes of
    one side gains nodes inside."""
    mesh = MESHES[name]()
    mesh.point_sets["outside"] = np.flatnonzero(((mesh.points == 0) | (mesh.points == 1)).any(axis=1))
    pairs = {"tetra": [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)],
             "wedge": [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
             "hexahedron": [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6),
                            (3, 7)], "triangle": [(0, 1), (1, 2), (2, 0)], "quad": [(0, 1), (1, 2), (2, 3), (3, 0)]}
    number: dict[tuple[int, ...], int] = {}
    blocks = []
    for block in mesh.cells:
        rows = [[*cell, *(number.setdefault(tuple(sorted((cell[a], cell[b]))), len(mesh.points) + len(number))
                          for a, b in pairs[block.type])] for cell in block.data.tolist()]
        blocks.append((f"{block.type}{len(rows[0])}", np.array(rows)))
    points = np.vstack([mesh.points, mesh.points[np.array(list(number))].mean(axis=1)])
    sets = {"held": np.flatnonzero(points[:, 2] == 0),
            "outside": np.flatnonzero(((points == 0) | (points == 1)).any(axis=1))}
    second = mesh_sample("second", split(meshio.Mesh(points, blocks, cell_sets=mesh.cell_sets, point_sets=sets)))
    first = mesh_sample("first", split(mesh))
    assert second.space.V.sum() == pytest.approx(1, rel=1e-13)
    assert second.notes[0] == f"{len(number)} middle node(s) of elements of second order are corners now"
    for boundary in ("floor", "wall", "held", "outside"):
        assert sorted(map(tuple, np.round(second.space.X[second.nodes(boundary)], 9))) == sorted(
            map(tuple, np.round(first.space.X[first.nodes(boundary)], 9)))
    assert len(first.nodes("outside")) < first.space.n_nodes


@pytest.mark.parametrize(("blocks", "said"), [
    ([("pyramid", [[0, 1, 3, 2, 4]])], "1 pyramids: pyramids cannot be split"),
    ([("tetra", [[0, 1, 2, 4]]), ("pyramid", [[0, 1, 3, 2, 4]])], "1 tetrahedra and 1 pyramids"),
    ([("triangle", [[0, 1, 2], [0, 1, 3], [1, 0, 3]])], "shared by more than two elements, such as at (0.5, 0)"),
    ([("triangle", [[0, 1, 2], [1, 1, 3]])], "1 of the triangles have a node twice, such as one near (1, 0.333333)")])
def test_what_cannot_be_split(blocks: list[tuple[str, list[list[int]]]], said: str) -> None:
    """Fails if a mesh that has no split, or overlaps itself, is converted."""
    with pytest.raises(MeshError) as error:
        split(meshio.Mesh(CUBE.astype(float), [(kind, np.array(cells)) for kind, cells in blocks]))
    assert said in str(error.value)


def test_facets_that_are_none() -> None:
    """Fails if a line that is no edge of an element names nodes that do not lie on one side, without a word."""
    mesh = triangles()
    mesh.cells[-1].data = np.vstack([mesh.cells[-1].data, [[0, len(mesh.points) - 1]]])
    mesh.cell_sets["across"] = [np.zeros(0, int), np.array([len(mesh.cells[-1].data) - 1])]
    made = split(mesh)
    assert "across" not in made.cell_sets and "1 cell(s) (line) are no edge or face of an element" in notes_of(made)[0]


def test_quality_is_that_of_the_elements() -> None:
    """Fails if a figure is not that of the element: a square, a stretched one, one with an angle of 45 degrees."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [4, 0, 0], [4, 1, 0], [5, 1, 0]], float)
    mesh = meshio.Mesh(points, [("quad", np.array([[0, 1, 2, 3], [1, 4, 5, 2]]))])
    mesh.points = points[:6]
    quality = Quality.of(mesh_sample("quality", mesh).space)
    assert np.allclose(quality.jacobian, 1) and np.allclose(quality.aspect, [1, 3])
    assert np.allclose(quality.h, [1, 3**0.5])
    space = mesh_sample("plate", plate()).space
    assert np.allclose(Quality.of(space).jacobian, scaled_jacobian(plate().points, plate().cells[0].data))
    skew = meshio.Mesh(CUBE + np.outer(CUBE[:, 1], [1.0, 0, 0]), [("hexahedron", np.array([[0, 1, 3, 2, 4, 5, 7, 6]]))])
    assert Quality.of(mesh_sample("skew", skew).space).jacobian == pytest.approx(0.5**0.5)
    assert {row[0]: row[1:] for row in quality.rows(3.0)}["l/h"] == pytest.approx((3**0.5, 2.366, 3), abs=1e-3)


# --- the command ---
def test_a_run_names_the_command(tmp_path: Path) -> None:
    """Fails if triangles are refused without a word of what to do, or what is done then cannot be run."""
    mesh = triangles(mixed=True)
    meshio.write(tmp_path / "plate.vtk", meshio.Mesh(mesh.points, mesh.cells))
    write_mesh(tmp_path / "plate.vtu", mesh)
    with pytest.raises(MeshError) as error:
        file_sample(tmp_path / "plate.vtu")
    assert "has 32 triangles and 8 quadrilaterals" in str(error.value)
    assert f"convert it with skfsink mesh {tmp_path / 'plate.vtu'} OUT.vtu" in str(error.value)


def test_a_run_on_a_converted_mesh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a converted mesh cannot be run, or its boundaries are not those of the file."""
    monkeypatch.chdir(tmp_path)
    write_mesh(tmp_path / "plate.vtu", triangles(mixed=True))
    status, err, out = invoke_program("mesh", "plate.vtu", "ready.vtu", "--length-scale", "0.4")
    assert (status, err) == (0, "") and "128 quadrilaterals" in out and "upper" in out and "notch" in out
    (tmp_path / "deck.toml").write_text(
        'case = "custom"\n[parameters]\nmesh = "ready.vtu"\nlength_scale = 0.4\nevent_time = 1e-7\n'
        '[[grips]]\nboundary = "bottom"\nx = 0\ny = 0\n[[grips]]\nboundary = "top"\nx = 0\ny = 1e-3\n'
        '[[regions]]\nname = "upper"\nphi = 0.5\n')
    assert invoke_program("run", "deck.toml", "--out", "run", "--quiet")[:2] == (0, "")
    rows = contents(tmp_path / "run")["history.csv"].decode().splitlines()
    assert len(rows) > 2


def test_repairs(tmp_path: Path) -> None:
    """Fails if metres, loose nodes, twins, or planes that are to be boundaries do not become what was asked."""
    mesh = plate(5)
    lower = mesh.points[mesh.cells[0].data].mean(axis=1)[:, 1] < 2
    twins = np.unique(mesh.cells[0].data[lower])
    number = np.arange(len(mesh.points))
    number[twins] = len(mesh.points) + np.arange(len(twins))
    cells = np.where(lower[:, None], number[mesh.cells[0].data], mesh.cells[0].data)
    points = np.vstack([mesh.points, mesh.points[twins], [7, 7, 7]]) / 1000
    meshio.write(tmp_path / "metres.vtk", meshio.Mesh(points, [("quad", cells[:, ::-1])]))
    status, err, out = invoke_program("mesh", tmp_path / "metres.vtk", tmp_path / "out.vtu", "--from", "m",
                                      "--merge-nodes", "1e-3 µm", "--boundary", "floor=y:min", "--boundary", "roof=y:4",
                                      "--boundary", "sides=x:min", "--boundary", "sides=x:4mm")
    assert (status, err) == (0, "")
    for part in ("coordinates in m were made mm", "belong to no element", "were merged", "turned", "floor (6 nodes)",
                 "24 quadrilaterals", "4 x 4 mm"):
        assert part in out, part
    sample = file_sample(tmp_path / "out.vtu")
    assert sample.space.V.sum() == pytest.approx(sample_of(tmp_path, plate(5)).space.V.sum())
    assert np.array_equal(sample.nodes("roof"), sample.nodes("top"))
    assert np.array_equal(sample.nodes("sides"), np.union1d(sample.nodes("left"), sample.nodes("right")))


def test_sets_survive_the_file(tmp_path: Path) -> None:
    """Fails if sets of nodes, regions or boundaries are not in the file that is written, or are others."""
    mesh = tetrahedra()
    mesh.point_sets["curve"] = np.flatnonzero((mesh.points[:, 0] == 0) & (mesh.points[:, 1] == 0))
    wanted = mesh_sample("split", split(tetrahedra()))
    file = tmp_path / "cube.inp"
    meshio.write(file, mesh)
    made = converted(file)
    write_mesh(tmp_path / "cube.vtu", made)
    sample = file_sample(tmp_path / "cube.vtu")
    assert sample.space.conn.tobytes() == mesh_sample("made", made).space.conn.tobytes()
    for name in ("floor", "wall", "held"):
        assert np.array_equal(sample.nodes(name), wanted.nodes(name)), name
    assert np.array_equal(sample.elements("part"), wanted.elements("part")) and len(sample.nodes("curve")) == 5


def test_solids_keep_their_faces(tmp_path: Path) -> None:
    """Fails if a boundary by a plane is not the face of a body in space."""
    meshio.write(tmp_path / "cube.vtk", meshio.Mesh(tetrahedra().points, tetrahedra().cells[:1]))
    made = converted(tmp_path / "cube.vtk", boundaries=["lid=z:1", "wall=x:max"])
    sample = mesh_sample("cube", made)
    assert sides_of(sample, "lid") == pytest.approx(1) and sides_of(sample, "wall") == pytest.approx(1)
    assert (sample.space.X[sample.nodes("lid")][:, 2] == 1).all()


@pytest.mark.parametrize("name", MESHES)
def test_collapsed_elements(name: str, tmp_path: Path) -> None:
    """Fails if a triangle written as a quadrilateral, or a wedge or tetrahedron as a hexahedron, is refused, or leaves
    its sets."""
    mesh = MESHES[name]()
    spread = {"triangle": [0, 1, 2, 2], "tetra": [0, 1, 2, 2, 3, 3, 3, 3], "wedge": [0, 1, 2, 2, 3, 4, 5, 5],
              "quad": [0, 1, 2, 3], "hexahedron": list(range(8))}
    for i, block in enumerate(mesh.cells):
        if block.type != "line":
            turn = np.roll(np.arange(4), i)  # begin at any corner
            cells = block.data[:, spread[block.type]]
            mesh.cells[i] = meshio.CellBlock("quad" if block.dim == 2 else "hexahedron",
                                             cells[:, turn if block.dim == 2 else [*turn, *(turn + 4)]])
    write_mesh(tmp_path / "in.vtu", mesh)
    with pytest.raises(MeshError, match=r"it has a node twice, near .*; if that is how"):
        file_sample(tmp_path / "in.vtu")
    sample, wanted = mesh_sample("in", converted(tmp_path / "in.vtu")), mesh_sample("split", split(MESHES[name]()))
    assert sample.space.V.sum() == pytest.approx(wanted.space.V.sum(), rel=1e-13)
    assert sample.space.n_elements == wanted.space.n_elements and sample.space.n_nodes == wanted.space.n_nodes
    for boundary in wanted.boundaries:
        assert len(sample.nodes(boundary)) == len(wanted.nodes(boundary)) > 2, boundary
    for region in wanted.cells:
        assert len(sample.elements(region)) == len(wanted.elements(region))
        assert sample.space.V[sample.elements(region)].sum() == pytest.approx(
            wanted.space.V[wanted.elements(region)].sum(), rel=1e-12)


def test_elements_that_are_pinched(tmp_path: Path) -> None:
    """Fails if an element that is no other one is taken for one."""
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    meshio.write(tmp_path / "a.vtk", meshio.Mesh(square, [("quad", np.array([[0, 1, 0, 2], [0, 1, 2, 3]]))]))
    with pytest.raises(MeshError, match="has a node twice"):
        converted(tmp_path / "a.vtk")


def test_planes_inside_are_no_boundaries(tmp_path: Path) -> None:
    """Fails if a plane between elements becomes a boundary, whose grip would hold the middle of the body."""
    x, y = np.meshgrid([0, 0.5, 1], [0, 0.5, 1.0])
    quads = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
    meshio.write(tmp_path / "grid.vtk", meshio.Mesh(np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()]),
                                                    [("quad", quads)]))
    with pytest.raises(MeshError, match=r"boundary mid: no edge on the outside lies in x = 0\.5 mm"):
        converted(tmp_path / "grid.vtk", boundaries=["mid=x:0.5"])


def test_triangles_beside_hexahedra(tmp_path: Path) -> None:
    """Fails if triangles that are no faces of the body are run over in silence, or stop the conversion."""
    cells = [("hexahedron", np.array([[0, 1, 3, 2, 4, 5, 7, 6]])), ("triangle", np.array([[0, 1, 2]]))]
    write_mesh(tmp_path / "cube.vtu", meshio.Mesh(CUBE.astype(float), cells))
    with pytest.raises(MeshError, match="has triangle cells beside its elements"):
        file_sample(tmp_path / "cube.vtu")
    assert "1 cell(s) (triangle)" in mesh_sample("cube", converted(tmp_path / "cube.vtu")).notes[0]


def test_a_boundary_of_edges_and_nodes(tmp_path: Path) -> None:
    """Fails if the nodes of a set are lost beside the edges of the same name."""
    mesh = plate(5)
    far = int(np.flatnonzero(mesh.points[:, 1] == 0)[0])
    mesh.point_sets = {"top": np.array([far])}
    write_mesh(tmp_path / "plate.vtu", mesh)
    assert len(file_sample(tmp_path / "plate.vtu").nodes("top")) == 7


def test_second_order_without_a_split(tmp_path: Path) -> None:
    """Fails if quadrilaterals of second order are split, or keep their middle nodes."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    points = np.vstack([corners, (corners + np.roll(corners, -1, axis=0)) / 2])
    meshio.write(tmp_path / "one.vtk", meshio.Mesh(points, [("quad8", np.arange(8)[None])]))
    made = converted(tmp_path / "one.vtk")
    assert len(made.points) == 4 and "4 middle node(s) of quad8" in notes_of(made)[0]


def test_names_as_people_write_them(tmp_path: Path) -> None:
    """Fails if names of sets go into the XML of a VTU file as they are, or depend on the encoding of the machine."""
    mesh, names = triangles(), ['right "half"', "A & B", "R<1>", "oben ä", "&amp;", "it's"]
    none = [np.zeros(0, np.int64)] * (len(mesh.cells) - 1)
    mesh.cell_sets = {name: [np.arange(k + 1), *none] for k, name in enumerate(names)}
    write_mesh(tmp_path / "names.vtu", mesh)
    (tmp_path / "names.vtu").read_bytes().decode("ascii")
    assert {name: len(own[0]) for name, own in read_mesh(tmp_path / "names.vtu").cell_sets.items()} == {
        name: k + 1 for k, name in enumerate(names)}


@pytest.mark.parametrize(("arguments", "said"), [
    (["in.vtu", "out.msh"], "OUT must be a VTU file"), (["in.vtu", "in.vtu"], "is the file that is read"),
    (["in.vtu", "in.vtu", "--overwrite"], "is the file that is read"),
    (["in.vtu", "link.vtu", "--overwrite"], "is the file that is read"),
    (["in.vtu", "there.vtu"], "there is a file there.vtu already"),
    (["no.vtu", "out.vtu"], "there is no mesh file no.vtu"),
    (["in.vtu", "out.vtu", "--from", "kg"], "from must be a unit of length, such as m or inch; got 'kg'"),
    (["in.vtu", "out.vtu", "--from", "m", "--merge-nodes", "1 s"], "merge_nodes must be a quantity in mm"),
    (["in.vtu", "out.vtu", "--merge-nodes", "-1"], "merge_nodes must be"),
    (["in.vtu", "out.vtu", "--merge-nodes", "1"], "would collapse element"),
    (["in.vtu", "out.vtu", "--length-scale", "0"], "length_scale must be"),
    (["in.vtu", "out.vtu", "--boundary", "a=w:1"], "boundary must be NAME=x:1.5"),
    (["in.vtu", "out.vtu", "--boundary", "a=x:min mm"], "boundary a must be a quantity in mm"),
    (["in.vtu", "out.vtu", "--boundary", "a=x:3"], "no edge on the outside lies in x = 3 mm; the body is between 0"),
    (["in.vtu", "out.vtu", "--boundary", "a=z:max"], "boundary a: a plane body has no edges in z"),
    (["in.vtu", "out.vtu", "--from", "2"], "from must be a unit of length, such as m or inch; got '2'"),
    (["in.vtu", "out.vtu", "--boundary", "top=x:0"], "has a set 'top' of its own"),
    (["empty.vtu", "out.vtu"], "has no elements: it has line"), (["in.vtu"], "out"), (["in.vtu", "out.vtu", "x"], "x")])
def test_what_the_command_refuses(arguments: list[str], said: str, tmp_path: Path,
                                  monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a mistake is not named on one line, or a file is written or changed all the same."""
    monkeypatch.chdir(tmp_path)
    write_mesh("in.vtu", triangles())
    (tmp_path / "link.vtu").symlink_to("in.vtu")
    (tmp_path / "there.vtu").write_text("mine")
    write_mesh("empty.vtu", meshio.Mesh(plate(5).points, plate(5).cells[1:]))
    before = contents(tmp_path)
    status, err, _ = invoke_program("mesh", *arguments)
    assert status == 2 and said.lower() in err.lower() and len(err.splitlines()) == 1, err
    assert contents(tmp_path) == before


@pytest.mark.parametrize(("value", "said"), [(np.nan, "not finite"), (1e200, "within 1e+09 mm of the origin")])
def test_coordinates_that_cannot_be(value: float, said: str, tmp_path: Path) -> None:
    """Fails if a body without a size is split, or the numbers overflow on the way."""
    mesh = triangles()
    mesh.points[7, 1] = value
    write_mesh(tmp_path / "in.vtu", mesh)
    with pytest.raises(MeshError) as error:
        converted(tmp_path / "in.vtu", merge_nodes=1e-6)
    assert said in str(error.value)


def test_the_page_of_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if the page shows what the command does not print."""
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).resolve().parents[1] / "docs" / "mesh_command.md").read_text(encoding="utf-8")
    found = {kind: re.findall(rf"^```{kind}\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
             for kind in ("python", "bash", "text")}
    exec(compile(found["python"][0], "page", "exec"), {})
    with pytest.raises(MeshError, match=r"convert it with skfsink mesh strips\.vtk OUT"):
        file_sample(Path("strips.vtk"))
    status, err, out = invoke_program(*found["bash"][0].replace("\\\n", "").split()[1:])
    assert (status, err, out) == (0, "", found["text"][0])
    assert len(file_sample(Path("strip.vtu")).nodes("top")) == 21


def test_overwriting(tmp_path: Path) -> None:
    """Fails if a file that may be replaced is not, or a body in pieces is not said to be one."""
    mesh = triangles()
    mesh.cells = [*mesh.cells, meshio.CellBlock("triangle", len(mesh.points) + np.array([[0, 1, 2]]))]
    mesh.points = np.vstack([mesh.points, [[5, 5, 0], [6, 5, 0], [5, 6, 0.0]]])
    mesh.cell_sets = {}
    write_mesh(tmp_path / "in.vtu", mesh)
    (tmp_path / "out.vtu").write_text("old")
    status, err, out = invoke_program("mesh", tmp_path / "in.vtu", tmp_path / "out.vtu", "--overwrite")
    assert (status, err) == (0, "") and "a run refuses this" in out and "in 2 pieces" in out
    with pytest.raises(MeshError, match="in 2 pieces"):
        file_sample(tmp_path / "out.vtu")


@pytest.mark.parametrize(("scale", "said"), [
    (1e-3, "the body is 0.001 mm across"), (1e3, "the smallest element has h = ")])
def test_a_size_that_a_run_refuses(scale: float, said: str, tmp_path: Path) -> None:
    """Fails if the command is silent on coordinates in another unit, on which a run then ends."""
    x, y = np.meshgrid([0.0, 0.5, 1.0], [0.0, 0.5, 1.0])
    points = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()]) * scale
    quads = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
    meshio.Mesh(points, [("quad", quads)]).write(tmp_path / "in.vtu")
    status, err, out = invoke_program("mesh", tmp_path / "in.vtu", tmp_path / "out.vtu")
    assert (status, err) == (0, "") and f"a run refuses this: {said}" in out
    assert ("give --from m, or" if scale < 1 else "give --from um, or") in out
    unit = "m" if scale < 1 else "um"
    status, err, out = invoke_program("mesh", tmp_path / "in.vtu", tmp_path / "right.vtu", "--from", unit)
    assert (status, err) == (0, "") and "a run refuses" not in out


def test_sides_that_a_run_refuses(tmp_path: Path) -> None:
    """Fails if the command is silent on elements that do not match, on which a run then ends."""
    points = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0], [1, 2, 0], [2, 2, 0.0]])
    quads = np.array([[0, 1, 2, 3], [3, 4, 6, 5], [4, 2, 7, 6]])
    meshio.Mesh(points, [("quad", quads)]).write(tmp_path / "in.vtu")
    status, err, out = invoke_program("mesh", tmp_path / "in.vtu", tmp_path / "out.vtu", "--length-scale", "1")
    assert (status, err) == (0, "") and "a run refuses this: mesh in: 1 node(s) lie in sides of elements" in out
    assert "such as (1, 1) mm" in out
    with pytest.raises(MeshError, match=r"1 node.s. lie in sides"):
        file_sample(tmp_path / "out.vtu")


def test_planes_of_names_that_are_taken(tmp_path: Path) -> None:
    """Fails if a form of a boundary that cannot be read is."""
    write_mesh(tmp_path / "in.vtu", plate(5))
    for text in ("=x:1", "a", "a=x", "a=x:", "a\tb\n=x:0"):
        with pytest.raises(ParameterError, match="boundary"):
            converted(tmp_path / "in.vtu", boundaries=[text])


def test_hinges_are_noted(tmp_path: Path) -> None:
    """Fails if the command says nothing of what a run warns of: parts that hang together by a single node."""
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [2, 1], [2, 2], [1, 2]], float)
    write_mesh(tmp_path / "in.vtu", meshio.Mesh(np.column_stack([points, 0 * points[:, 0]]),
                                                [("quad", np.array([[0, 1, 2, 3], [2, 4, 5, 6]]))]))
    said = invoke_program("mesh", tmp_path / "in.vtu", tmp_path / "out.vtu")[2]
    assert "hang together by a single node, at 1 node(s), such as (1, 1) mm" in said
