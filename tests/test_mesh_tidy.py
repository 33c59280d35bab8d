"""What every mesh file goes through: nodes of no element, middle nodes, merging, pieces."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest
from plates import plate

from skfsink.errors import MeshError
from skfsink.mesh_file import read_mesh_file
from skfsink.mesh_files.tidy import base_of, tidied
from skfsink.meshing import write_mesh
from skfsink.sample import Sample, file_sample


def sample_of(folder: Path, mesh: meshio.Mesh) -> Sample:
    """The sample of a mesh written to a VTU file."""
    write_mesh(folder / "plate.vtu", mesh)
    return file_sample(folder / "plate.vtu")


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


def same(one: Sample, other: Sample) -> bool:
    """Whether two samples have the same arrays, to the last bit."""
    return (one.space.X.tobytes() == other.space.X.tobytes() and one.space.conn.tobytes() == other.space.conn.tobytes()
            and one.boundaries.keys() == other.boundaries.keys()
            and all(np.array_equal(one.nodes(name), other.nodes(name)) for name in one.boundaries))


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
