"""What every mesh file goes through: nodes of no element, middle nodes, merging, pieces."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest
from plates import contents, invoke_program, plate, same, sample_of

from skfsink.errors import MeshError
from skfsink.meshing.files.pieces import hinges, merged
from skfsink.meshing.files.tidy import base_of, tidied
from skfsink.meshing.mesh_file import read_mesh_file
from skfsink.meshing.sample import Sample, file_sample, load_sample
from skfsink.meshing.vtu import write_mesh


def inserted(mesh: meshio.Mesh, at: list[int]) -> meshio.Mesh:
    """The mesh with a node of no element before each of the nodes `at`, and one at the end."""
    number = np.arange(len(mesh.points)) + np.searchsorted(at, np.arange(len(mesh.points)), side="right")
    points = np.insert(mesh.points, at, [50.0, 7.0, 3.0], axis=0)
    cells = [(block.type, number[block.data]) for block in mesh.cells]
    return meshio.Mesh(np.vstack([points, [0.1, np.inf, 0.0]]), cells, cell_sets=mesh.cell_sets,
                       point_sets={k: number[v] for k, v in mesh.point_sets.items()})


def second_order(mesh: meshio.Mesh, centre: bool) -> meshio.Mesh:
    """A plate of quad8 or quad9, with line3 as boundaries; nodes in the middle are mixed among the others."""
    quads, lines = (block.data for block in mesh.cells)
    edges = np.unique(np.sort(np.vstack([quads[:, [i, (i + 1) % 4]] for i in range(4)]), axis=1), axis=0)
    number = {tuple(edge): len(mesh.points) + i for i, edge in enumerate(edges.tolist())}
    points = np.vstack([mesh.points, mesh.points[edges].mean(axis=1), mesh.points[quads].mean(axis=1)])
    middle = [[number[tuple(sorted((q[i], q[(i + 1) % 4])))] for i in range(4)] for q in quads.tolist()]
    cells = np.hstack([quads, middle, len(mesh.points) + len(edges) + np.arange(len(quads))[:, None]])
    curves = np.hstack([lines, [[number[tuple(sorted(line))]] for line in lines.tolist()]])
    kinds = [("quad9", cells) if centre else ("quad8", cells[:, :8]), ("line3", curves)]
    return meshio.Mesh(points if centre else points[:len(mesh.points) + len(edges)], kinds, cell_sets=mesh.cell_sets,
                       point_sets={"held": np.unique(curves[mesh.cell_sets["top"][1]])})


def test_nodes_of_no_element_change_nothing(tmp_path: Path) -> None:
    """Fails if a left-over node, wherever it stands in the file, is refused, or moves what is kept."""
    (tmp_path / "a").mkdir()
    clean = sample_of(tmp_path / "a", plate(5))
    loose = sample_of(tmp_path, inserted(plate(5), [0, 0, 7]))
    assert same(clean, loose) and clean.notes == ()
    assert loose.notes == ("4 node(s) belong to no element and were dropped, such as one at (50, 7, 3)",)


def test_a_reference_point_is_no_boundary(tmp_path: Path) -> None:
    """Fails if a set of loose nodes stays a boundary, takes other nodes, or if a scene that names it is not told."""
    mesh = plate(5)
    mesh.point_sets = {"held": np.array([2, 3])}
    mesh = inserted(mesh, [0, 3])
    mesh.point_sets |= {"RP-1": np.array([0]), "held": np.append(mesh.point_sets["held"], 4)}
    assert len(mesh.points) == len(plate(5).points) + 3
    tidied(mesh)
    assert mesh.point_sets.keys() == {"held"} and mesh.point_sets["held"].tolist() == [2, 3]
    assert mesh.info["notes"][-1] == ("the boundary 'RP-1' has only nodes that belong to no element, such as a "
                                      "reference point, and is left out")
    write_mesh(tmp_path / "plate.vtu", plate(5))
    sample = file_sample(tmp_path / "plate.vtu")
    told = Sample(sample.name, sample.space, sample.boundaries, notes=tuple(mesh.info["notes"]))
    with pytest.raises(MeshError, match=r"no boundary 'RP-1' \(the boundary 'RP-1' has only nodes that belong to no"):
        told.nodes("RP-1")


def test_lines_that_are_no_part_of_the_body(tmp_path: Path) -> None:
    """Fails if a line of construction keeps its nodes alive, or shifts the boundaries after it."""
    mesh, n = plate(5), len(plate(5).points)
    mesh.points = np.vstack([mesh.points, [[9.0, 9.0, 0], [9.0, 8.0, 0]]])
    mesh.cells[1].data = np.vstack([[[n, n + 1], [0, n]], mesh.cells[1].data])
    sets = {name: [members[0], members[1] + 2] for name, members in mesh.cell_sets.items()}
    mesh.cell_sets = {**sets, "axis": [np.zeros(0, int), np.array([0])]}
    (tmp_path / "a").mkdir()
    sample = sample_of(tmp_path, mesh)
    assert same(sample, sample_of(tmp_path / "a", plate(5))) and "axis" not in sample.boundaries
    assert len(sample.notes) == 3 and sample.notes[0].startswith("2 cell(s) (line) are no part of the body")


@pytest.mark.parametrize("centre", [False, True])
def test_middle_nodes_are_dropped(centre: bool, tmp_path: Path) -> None:
    """Fails if elements of second order are refused, or their middle nodes stay in the mesh or in a boundary."""
    meshio.write(tmp_path / "plate.vtu", second_order(plate(5), centre))
    mesh = tidied(second_order(plate(5), centre))
    assert [block.type for block in mesh.cells] == ["quad", "line"]
    assert all(np.array_equal(a.data, b.data) for a, b in zip(mesh.cells, plate(5).cells))
    assert np.array_equal(mesh.points, plate(5).points)
    assert np.array_equal(mesh.point_sets["held"], np.unique(plate(5).cells[1].data[plate(5).cell_sets["top"][1]]))
    sample = file_sample(tmp_path / "plate.vtu")
    assert sample.space.n_nodes == len(plate(5).points)
    (note,) = sample.notes
    assert f"middle node(s) of quad{8 + centre} were dropped" in note


@pytest.mark.parametrize(("kind", "rows"), [("hexahedron20", 20), ("hexahedron27", 27)])
def test_middle_nodes_of_hexahedra(kind: str, rows: int) -> None:
    """Fails if a brick of second order keeps other nodes than its corners."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1.0]])
    points = np.vstack([np.full((rows - 8, 3), 0.5), corners])
    cell = np.append(np.arange(rows - 8, rows), np.arange(rows - 8))[None]
    mesh = tidied(meshio.Mesh(points, [(kind, cell), ("quad8", cell[:, [0, 1, 2, 3, 8, 9, 10, 11]])]))
    assert [block.type for block in mesh.cells] == ["hexahedron", "quad"]
    assert np.array_equal(mesh.points, corners) and mesh.cells[0].data.tolist() == [list(range(8))]
    assert mesh.cells[1].data.tolist() == [[0, 1, 2, 3]]


def test_names_of_cells() -> None:
    """Fails if a cell of higher order is taken for another form."""
    assert [base_of(kind) for kind in ("quad", "quad16", "line3", "VTK_LAGRANGE_HEXAHEDRON", "wedge15", "polygon")] == [
        "quad", "quad", "line", "hexahedron", "wedge", "polygon"]


def _orphans_far_away(mesh: meshio.Mesh) -> None:
    mesh.points = np.vstack([mesh.points, [1e12, 0, 0]])


def _orphans_out_of_the_plane(mesh: meshio.Mesh) -> None:
    mesh.points = np.vstack([mesh.points, [0, 0, 5.0]])


@pytest.mark.parametrize("change", [_orphans_far_away, _orphans_out_of_the_plane])
def test_what_is_dropped_is_not_checked(change: Callable[[meshio.Mesh], None], tmp_path: Path) -> None:
    """Fails if a node that belongs to nothing makes a body too large, or curved."""
    mesh = plate(5)
    change(mesh)
    write_mesh(tmp_path / "plate.vtu", mesh)
    assert len(read_mesh_file(tmp_path / "plate.vtu").points) == len(plate(5).points)


# --- pieces ---
def grid(nx: int, ny: int, at: tuple[float, float] = (0.0, 0.0), h: float = 0.5) -> meshio.Mesh:
    """A rectangle of nx x ny squares with the corner `at`, whose left and right sides are named by lines."""
    x, y = np.meshgrid(np.arange(nx + 1) * h, np.arange(ny + 1) * h)
    first = (np.arange(ny)[:, None] * (nx + 1) + np.arange(nx)).ravel()
    side = np.arange(ny) * (nx + 1)
    lines = np.vstack([np.column_stack([side + k, side + k + nx + 1]) for k in (0, nx)])
    return meshio.Mesh(np.column_stack([x.ravel() + at[0], y.ravel() + at[1], np.zeros(x.size)]),
                       [("quad", first[:, None] + np.array([0, 1, nx + 2, nx + 1])), ("line", lines)],
                       cell_sets={"left": [np.zeros(0, int), np.arange(ny)],
                                  "right": [np.zeros(0, int), np.arange(ny) + ny]})


def beside(*parts: meshio.Mesh) -> meshio.Mesh:
    """Meshes in one, whose sets have the number of the part behind their names; no nodes are joined."""
    points = np.vstack([part.points for part in parts])
    start = np.cumsum([0, *(len(part.points) for part in parts)])
    cells = [(block.type, block.data + at) for part, at in zip(parts, start) for block in part.cells]
    sets = {}
    for i, part in enumerate(parts):
        for name, (_, lines) in part.cell_sets.items():
            sets[f"{name}{i}"] = [np.zeros(0, int)] * (2 * i + 1) + [lines] + [np.zeros(0, int)] * 2 * (
                len(parts) - i - 1)
    return meshio.Mesh(points, cells, cell_sets=sets)


@pytest.mark.parametrize(("parts", "said"), [
    ([(2, 3, (0, 0)), (2, 3, (1, 0))], ["in 2 pieces", "(6 and 6 elements", "4 pairs of nodes coincide within 1e-6 mm",
                                        'merge_nodes = "1e-6 mm"', "skfsink mesh ", " --merge-nodes 1e-6mm"]),
    ([(2, 3, (0, 0)), (2, 3, (1 + 3e-5, 0))], ["4 pairs of nodes coincide within 1e-4 mm"]),
    ([(2, 3, (0, 0)), (1, 3, (5, 0))], ["(6 and 3 elements, the smallest near (5.25, 0.25)", "no nodes of theirs",
                                        "is 4 mm from the next", "leave the others out"]),
    ([(2, 3, (0, 0)), (2, 3, (1, 0)), (1, 1, (9, 0))], ["in 3 pieces", "(6, 6, 1 elements", "4 pairs",
                                                        "(2 pieces would be left)"])])
def test_pieces_are_refused(parts: list[tuple[int, int, tuple[float, float]]], said: list[str],
                            tmp_path: Path) -> None:
    """Fails if a body in pieces is computed on, or the line hides how many nodes coincide and what to do."""
    write_mesh(tmp_path / "parts.vtu", beside(*(grid(*part) for part in parts)))
    with pytest.raises(MeshError) as error:
        file_sample(tmp_path / "parts.vtu")
    assert [part for part in said if part not in str(error.value)] == []


def test_pieces_in_a_case_of_the_paper(tmp_path: Path) -> None:
    """Fails if the line names an option that the case has not."""
    write_mesh(tmp_path / "parts.vtu", beside(grid(2, 3), grid(2, 3, (1, 0))))
    with pytest.raises(MeshError, match="within 1e-6 mm: mend the file with skfsink mesh "):
        load_sample("single_edge_notch", str(tmp_path / "parts.vtu"))


def test_merged_pieces_are_the_whole(tmp_path: Path) -> None:
    """Fails if merging leaves a node twice, loses one of a boundary, or does not say where."""
    sample = sample_of(tmp_path, grid(4, 3))
    write_mesh(tmp_path / "parts.vtu", beside(grid(2, 3), grid(2, 3, (1, 0))))
    joined = file_sample(tmp_path / "parts.vtu", 1e-6)
    assert joined.space.n_nodes == sample.space.n_nodes
    assert sorted(map(tuple, joined.space.X)) == sorted(map(tuple, sample.space.X))
    assert np.array_equal(joined.nodes("right0"), joined.nodes("left1")) and len(joined.nodes("left1")) == 4
    assert joined.notes == ("4 node(s) were merged with others within 1e-06 mm, between (1, 0) and (1, 1.5) mm",)
    assert file_sample(tmp_path / "plate.vtu", 1e-6).notes[0].startswith("no two nodes are within 1e-06 mm")


def test_merge_nodes_in_a_deck(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if the option of a deck does not reach the mesh, is not kept by the run, or takes another unit."""
    monkeypatch.chdir(tmp_path)
    write_mesh(tmp_path / "parts.vtu", beside(grid(2, 3), grid(2, 3, (1, 0))))
    text = ('case = "custom"\n[parameters]\nmesh = "parts.vtu"\nlength_scale = 1\nevent_time = 1e-7\n{}\n[[grips]]\n'
            'boundary = "left"\nx = 0\ny = 0\n[[grips]]\nboundary = "right"\nx = 1e-3\ny = 0\n')
    (tmp_path / "a.toml").write_text(text.format(""))
    status, err, _ = invoke_program("run", "a.toml", "--out", "a", "--quiet")
    assert status == 2 and "merge_nodes" in err and not (tmp_path / "a").exists()
    (tmp_path / "b.toml").write_text(text.format('merge_nodes = "1e-3 µm"'))
    assert invoke_program("run", "b.toml", "--out", "b", "--quiet")[:2] == (0, "")
    assert "merge_nodes = 1e-06" in (tmp_path / "b" / "scene.toml").read_text()
    before = contents(tmp_path / "b")["history.csv"]
    assert invoke_program("run", "b/scene.toml", "--out", "c", "--quiet")[0] == 0
    assert contents(tmp_path / "c")["history.csv"] == before
    (tmp_path / "d.toml").write_text(text.format('merge_nodes = "-1 mm"'))
    assert "merge_nodes must be a finite number" in invoke_program("run", "d.toml", "--out", "d", "--quiet")[1]


@pytest.mark.parametrize("tolerance", [0.5, 0.6, 1e3])
def test_merging_collapses_no_element(tolerance: float, tmp_path: Path) -> None:
    """Fails if a tolerance as large as an edge eats elements."""
    write_mesh(tmp_path / "parts.vtu", beside(grid(2, 3), grid(2, 3, (1, 0))))
    with pytest.raises(MeshError, match=r"would collapse element 0 near \(0.25, 0.25\), which has nodes 0.5 mm apart"):
        file_sample(tmp_path / "parts.vtu", tolerance)


def test_merging_along_a_chain(tmp_path: Path) -> None:
    """Fails if nodes of an element become one by way of nodes of another."""
    mesh = beside(grid(1, 1), grid(1, 1, (0.3, 0)))
    with pytest.raises(MeshError, match="a chain of them"):
        merged("chain", mesh, 0.4)


def slit() -> meshio.Mesh:
    """A square of 4 x 4 elements, with the coinciding faces of a slit at y = 1 for x up to 1."""
    mesh = beside(grid(4, 2), grid(4, 2, (0, 1)))
    nodes = np.flatnonzero(np.isclose(mesh.points[:, 1], 1) & (mesh.points[:, 0] > 1))
    one, two = nodes[:len(nodes) // 2], nodes[len(nodes) // 2:]
    for block in mesh.cells:  # grown together for x > 1
        block.data = np.where(np.isin(block.data, two), one[np.searchsorted(two, block.data).clip(max=len(one) - 1)],
                              block.data)
    return tidied(mesh)


def test_a_slit_is_not_closed_in_silence() -> None:
    """Fails if the faces of a slit are merged without a word of it."""
    notes = merged("slit", slit(), 1e-6).info["notes"]
    assert notes[-1].startswith("3 of the merged node(s) joined a piece to itself, between (0, 1) and (1, 1) mm")


def test_the_faces_of_a_slit_join_no_pieces(tmp_path: Path) -> None:
    """Fails if nodes that coincide within a piece are counted as a cure."""
    parts = slit(), grid(1, 1, (7, 7))
    for part in parts:
        part.cell_sets = {}
    write_mesh(tmp_path / "slit.vtu", beside(*parts))
    with pytest.raises(MeshError, match="and no nodes of theirs coincide"):
        file_sample(tmp_path / "slit.vtu")
    mesh = slit()
    mesh.info = None
    write_mesh(tmp_path / "slit.vtu", mesh)
    sample = file_sample(tmp_path / "slit.vtu")  # and a slit is no piece, and no hinge
    assert [note[:53] for note in sample.notes] == ["3 pair(s) of nodes coincide, between (0, 1) and (1, 1)"[:53]]
    assert sample.space.n_nodes == 28


def test_hinges(tmp_path: Path) -> None:
    """Fails if parts that hang together by a single node are taken for one body without a word."""
    write_mesh(tmp_path / "hinge.vtu", merged("hinge", beside(grid(2, 2), grid(2, 2, (1, 1))), 1e-6))
    sample = file_sample(tmp_path / "hinge.vtu")
    assert sample.space.X[hinges(sample.space)].tolist() == [[1, 1]]
    assert "hang together by a single node, at 1 node(s), such as (1, 1) mm" in sample.notes[-1]
    assert not len(hinges(sample_of(tmp_path, plate(5)).space))
