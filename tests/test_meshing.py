"""The committed meshes of the single-edge-notched plate, and the generator that made them."""

from __future__ import annotations

import itertools
import math
import sys
from functools import cache
from pathlib import Path

import meshio
import numpy as np
import pytest

from skfsink.errors import MeshError, MissingExtra, ParameterError
from skfsink.meshing import outline as meshing
from skfsink.meshing import shapes
from skfsink.meshing.vtu import read_mesh, write_mesh

FOLDER = Path(__file__).resolve().parents[1] / "cases" / "single_edge_notch" / "meshes"
SIDE, NOTCH, RADIUS = 4.0, 1.0, 0.05
SIZES = {"coarse": 0.1 / 1.5, "M3": 0.1 / 3, "M4": 0.1 / 4, "M5": 0.1 / 5}
TABLE_1 = {"M3": 11140, "M4": 18967, "M5": 28784}
TIP_EDGES = 20  # elements along the tip, of a sixth of its radius

every_mesh = pytest.mark.parametrize("name", SIZES)


@cache
def read(name: str) -> meshio.Mesh:
    return meshio.read(FOLDER / f"{name}.vtu")


def quads(name: str) -> np.ndarray:
    return read(name).cells_dict["quad"]


def boundary(name: str, part: str) -> np.ndarray:
    """Node pairs of a named boundary, as stored in the file."""
    return read(name).cells_dict["line"][read(name).cell_data_dict[f"boundary:{part}"]["line"] == 1]


def area(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Signed areas, by the shoelace formula."""
    x, y = points[cells, 0], points[cells, 1]
    return 0.5 * np.sum(x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1), axis=1)


def corridor(name: str) -> np.ndarray:
    """The quadrilaterals where cracks may run, without those that grow from the tip on."""
    x, y = read(name).points[quads(name)].mean(axis=1).T[:2]
    return quads(name)[(x > NOTCH + 0.4) & (np.abs(y - SIDE / 2) < 1.6)]


def near_tip(name: str, points: np.ndarray) -> np.ndarray:
    """Mask of the points within three radii of the centre of the tip, where the rings are, and what is beside them."""
    return np.asarray(np.hypot(points[..., 0] - NOTCH + RADIUS, points[..., 1] - SIDE / 2) < 3 * RADIUS)


@pytest.mark.parametrize("name", TABLE_1)
def test_number_of_elements_is_that_of_table_1(name):
    assert len(quads(name)) == pytest.approx(TABLE_1[name], rel=0.03)


def test_coarse_mesh_is_small():
    assert 2500 <= len(quads("coarse")) <= 4000


@every_mesh
def test_only_convex_counter_clockwise_quadrilaterals(name):
    mesh = read(name)
    assert set(mesh.cells_dict) == {"quad", "line"}
    assert mesh.points.dtype == np.float64 and np.all(mesh.points[:, 2] == 0)
    assert area(mesh.points, quads(name)).min() > 0
    corners = mesh.points[quads(name)]
    ahead, back = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    jacobian = ahead[..., 0] * back[..., 1] - ahead[..., 1] * back[..., 0]
    quality = (jacobian / np.linalg.norm(ahead, axis=2) / np.linalg.norm(back, axis=2)).min(axis=1)
    assert quality.min() > 0.5 and np.quantile(quality, 0.01) > 0.7
    edges, size = np.linalg.norm(ahead, axis=2), SIZES[name]
    tip = near_tip(name, corners.mean(axis=1))
    assert edges[~tip].min() > 0.3 * min(size, 0.04)  # no element but those at the tip is much smaller than the others
    assert edges[tip].min() > 0.7 * RADIUS / 48  # thickness of a ring of aspect 8 and a sixth of the radius
    assert np.allclose(quality, meshing.scaled_jacobian(mesh.points, quads(name)))


@every_mesh
def test_conforming(name):
    """No unused or double node, and the edges of one element only are the named boundaries, each once."""
    mesh = read(name)
    assert np.array_equal(np.unique(quads(name)), np.arange(len(mesh.points)))
    assert len(np.unique(mesh.points.round(6), axis=0)) == len(mesh.points)
    edges = np.sort(np.stack([quads(name), np.roll(quads(name), -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    lines = np.sort(mesh.cells_dict["line"], axis=1)
    assert set(count) == {1, 2}
    assert np.array_equal(edges[count == 1], np.unique(lines, axis=0)) and (count == 1).sum() == len(lines)
    assert len(mesh.points) - len(edges) + len(quads(name)) == 1  # Euler: one piece without holes


@every_mesh
def test_area(name):
    half = math.pi / TIP_EDGES / 2  # the tip is half a regular polygon
    tip = TIP_EDGES * RADIUS**2 * math.sin(half) * math.cos(half)
    exact = SIDE**2 - 2 * RADIUS * (NOTCH - RADIUS) - tip
    assert area(read(name).points, quads(name)).sum() == pytest.approx(exact, abs=1e-7)


@every_mesh
def test_boundaries(name):
    points = read(name).points
    assert set(read(name).cell_data) == {f"boundary:{p}" for p in ("left", "right", "top", "bottom", "notch")}
    flags = read(name).cell_data_dict
    assert all(not flags[key]["quad"].any() for key in flags)
    assert np.all(sum(flags[key]["line"] for key in flags) == 1)
    tip = 2 * TIP_EDGES * RADIUS * math.sin(math.pi / TIP_EDGES / 2)
    lengths = {"left": SIDE - 2 * RADIUS, "right": SIDE, "top": SIDE, "bottom": SIDE,
               "notch": 2 * (NOTCH - RADIUS) + tip}
    for part, length in lengths.items():
        start, end = points[boundary(name, part)].transpose(1, 0, 2)
        assert np.linalg.norm(end - start, axis=1).sum() == pytest.approx(length, abs=1e-6)
    for part, axis, value in (("left", 0, 0), ("right", 0, SIDE), ("bottom", 1, 0), ("top", 1, SIDE)):
        assert np.all(points[boundary(name, part), axis] == value)


@every_mesh
def test_notch_tip_is_round(name):
    nodes = np.unique(boundary(name, "notch"))
    x, y = read(name).points[nodes].T[:2]
    round_part = x > NOTCH - RADIUS - 1e-6
    assert round_part.sum() == TIP_EDGES + 1
    distance = np.hypot(x - (NOTCH - RADIUS), y - SIDE / 2)
    assert np.allclose(distance[round_part], RADIUS, rtol=0, atol=1e-7)
    assert np.allclose(np.abs(y - SIDE / 2)[~round_part], RADIUS, rtol=0, atol=1e-7)
    assert x.max() == pytest.approx(NOTCH, abs=1e-7)


@every_mesh
def test_element_size_in_the_corridor(name):
    size = np.sqrt(area(read(name).points, corridor(name)))
    assert size.mean() == pytest.approx(SIZES[name], rel=0.05)
    assert np.quantile(size, 0.99) < 1.5 * SIZES[name]


@every_mesh
def test_not_a_structured_grid(name):
    """Many nodes have more or fewer than four elements, everywhere, and the edges point in all directions."""
    points, cells = read(name).points, corridor(name)
    valence = np.bincount(quads(name).ravel())
    x, y = points[:, 0], points[:, 1]
    inside = (x > NOTCH + 0.4) & (x < SIDE - 0.1) & (np.abs(y - SIDE / 2) < 1.6)
    assert 0.08 < (valence[inside] != 4).mean() < 0.2
    for left, bottom in itertools.product(np.arange(NOTCH + 0.4, SIDE - 0.5), np.arange(0.4, 3.6, 0.8)):
        tile = inside & (x >= left) & (x < left + 1) & (y >= bottom) & (y < bottom + 0.8)
        assert (valence[tile] != 4).mean() > 0.02
    edges = np.roll(points[cells], -1, axis=1) - points[cells]
    angle = np.degrees(np.arctan2(edges[..., 1], edges[..., 0])) % 90
    share = np.histogram(angle, bins=9, range=(0, 90))[0] / angle.size
    assert share.min() > 0.05 and share.max() < 0.2


def test_files_are_small():
    assert sum(path.stat().st_size for path in FOLDER.glob("*.vtu")) < 3e6


def test_written_mesh_reads_back(tmp_path):
    mesh = read_mesh(FOLDER / "coarse.vtu")
    assert not mesh.cell_data and set(mesh.cell_sets) == {"left", "right", "top", "bottom", "notch"}
    write_mesh(tmp_path / "again.vtu", mesh)
    assert meshio.read(tmp_path / "again.vtu").points.tolist() == read("coarse").points.tolist()
    assert (tmp_path / "again.vtu").read_bytes() == (FOLDER / "coarse.vtu").read_bytes()


def test_missing_gmsh_is_explained(monkeypatch):
    monkeypatch.setitem(sys.modules, "gmsh", None)
    with pytest.raises(MissingExtra, match="gmsh"):
        shapes.single_edge_notch_mesh(h=0.1)


@pytest.mark.parametrize("wrong", [
    {"side": 0}, {"notch": 4.0}, {"notch": 0.05}, {"notch_width": -1}, {"h": 0}, {"h": 0.2},
    {"half_height": math.nan}, {"seed": -1}])
def test_wrong_parameters_are_named(wrong):
    name = next(iter(wrong))
    with pytest.raises(ParameterError, match="h_coarse" if wrong == {"h": 0.2} else name):
        shapes.single_edge_notch_mesh(**wrong)


@pytest.mark.slow
def test_committed_coarse_mesh_can_be_made_again(tmp_path):
    pytest.importorskip("gmsh")
    shapes.main(["single_edge_notch", "--mesh", "coarse", "--output", str(tmp_path)])
    assert [path.name for path in tmp_path.iterdir()] == ["coarse.vtu"]
    mesh = meshio.read(tmp_path / "coarse.vtu")  # other versions of gmsh may place nodes elsewhere
    assert len(mesh.cells_dict["quad"]) == pytest.approx(len(quads("coarse")), rel=0.02)
    assert set(mesh.cell_data) == set(read("coarse").cell_data)


@pytest.mark.slow
def test_seeds_choose_meshes(monkeypatch):
    pytest.importorskip("gmsh")
    monkeypatch.setattr(meshing, "ATTEMPTS", 2)  # for speed
    settings = {"side": 2.0, "notch": 0.5, "half_height": 0.4, "h": 0.08}
    one, same, other = (shapes.single_edge_notch_mesh(**settings, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(one.points, same.points)
    assert np.array_equal(one.cells_dict["quad"], same.cells_dict["quad"])
    assert one.points.shape != other.points.shape or not np.allclose(one.points, other.points)
    assert len(other.cells_dict["quad"]) == pytest.approx(len(one.cells_dict["quad"]), rel=0.1)
    for mesh in (one, other):
        assert meshing.scaled_jacobian(mesh.points, mesh.cells_dict["quad"]).min() > 0


@pytest.mark.parametrize(("start", "end", "said"), [
    (0.45, 0.55, r"the edge 'mark' around \(0\.5, 1\) mm is 0\.1 mm long, and elements there are 0\.1 mm large, of"
                 r" which an edge takes two .*: make elements there at most 0\.05 mm, or the edge longer"),
    (0.5, 0.5, r"the edge 'mark' from \(0\.5, 1\) to \(0\.5, 1\) mm is no line .*: leave it out, or make it longer")])
def test_a_short_edge_is_refused_in_one_line(start: float, end: float, said: str) -> None:
    """Fails if what gmsh says of an edge of less than two elements, or of none, comes through as it is."""
    pytest.importorskip("gmsh")
    Edge = meshing.Edge
    outline = [Edge("bottom", (1, 0)), Edge("right", (1, 1)), Edge("top", (end, 1)), Edge("mark", (start, 1)),
               Edge("top", (0, 1)), Edge("left", (0, 0))]
    with pytest.raises(MeshError, match=f"^{said}$") as caught:
        meshing.mesh_outline(outline, meshing.SizeField(0.1, 0.1, ()))
    assert "\n" not in str(caught.value)
