"""The committed meshes of the samples, and what becomes of a section: sweeping and rolling."""

from __future__ import annotations

import math
from functools import cache

import meshio
import numpy as np
import pytest
from scipy.spatial import cKDTree

from skfsink.errors import MeshError, ParameterError
from skfsink.meshing import shapes
from skfsink.meshing.outline import completed, scaled_jacobian
from skfsink.meshing.sample import load_sample, shape_sample
from skfsink.meshing.sweeping import rolled, swept
from skfsink.meshing.vtu import read_mesh
from skfsink.system.shipped import data_folder

MESHES = [(case, name) for case, shape in shapes.SHAPES.items() for name in shape.meshes]
EDGE = {"left", "right", "top", "bottom", "notch"}
BOUNDARIES = {"dog_bone": {"top", "bottom", "side"}, "cylindrical_shell": {"top", "bottom", "edge", "notch"}}
#: elements in the paper (Secs. 5.2, 5.4 to 5.6); of the three-dimensional samples in two layers
COUNTS = {"simple_shear": 50847, "asymmetric_double_edge_notch": 28531, "dog_bone": 82382 / 2,
          "cylindrical_shell": 53122 / 2}
ARC = math.pi * 1.95
RADIUS = 0.05  # of the tips of all notches
#: symmetries of the sections
IMAGES = {"asymmetric_double_edge_notch": [lambda p: 5.0 - p], "symmetric_double_edge_notch": [lambda p: 3.0 - p],
          "dog_bone": [lambda p: p * (-1, 1), lambda p: p * (1, -1)],
          "cylindrical_shell": [lambda p: p * (-1, 1) + (ARC, 0)]}


@cache
def read(case: str, name: str) -> meshio.Mesh:
    return read_mesh(data_folder(case) / "meshes" / f"{name}.vtu")


def areas(mesh: meshio.Mesh) -> np.ndarray:
    """Signed areas of the quadrilaterals, by the shoelace formula."""
    x, y, _ = mesh.points[mesh.cells_dict["quad"]].transpose(2, 0, 1)
    return 0.5 * np.sum(x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1), axis=1)


def distance_to_arcs(mesh: meshio.Mesh, edges: np.ndarray) -> np.ndarray:
    """Distances of the edges from the shortest lines of the notches (the round tips, in rings), far off without."""
    if "notch" not in mesh.cell_sets:
        return np.full(len(edges), np.inf)
    lines = mesh.points[mesh.cells_dict["line"][np.asarray(mesh.cell_sets["notch"][1])]]
    size = np.linalg.norm(np.diff(lines, axis=1)[:, 0], axis=1)
    tips = lines[size < 1.05 * RADIUS * math.pi / 20].mean(axis=1)
    distance: np.ndarray = cKDTree(tips[:, :2]).query(mesh.points[edges].mean(axis=1)[:, :2])[0]
    return distance


@pytest.mark.parametrize("case", COUNTS)
def test_number_of_elements_is_the_papers(case: str) -> None:
    """Fails if a mesh was made with other sizes than those that meet the paper's count within 3 %."""
    assert len(read(case, "paper").cells_dict["quad"]) == pytest.approx(COUNTS[case], rel=0.03)


@pytest.mark.parametrize("case, name", MESHES)
def test_mesh_is_conforming_and_well_shaped(case: str, name: str) -> None:
    """Fails on inverted, flat or tiny elements, loose or double nodes, and edges that belong to no boundary."""
    mesh = read(case, name)
    quads, lines = mesh.cells_dict["quad"], np.sort(mesh.cells_dict["line"], axis=1)
    assert areas(mesh).min() > 0 and scaled_jacobian(mesh.points, quads).min() > 0.5
    assert np.array_equal(np.unique(quads), np.arange(len(mesh.points)))
    assert len(np.unique(mesh.points.round(6), axis=0)) == len(mesh.points)
    edges = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    assert set(count) == {1, 2}
    assert np.array_equal(edges[count == 1], np.unique(lines, axis=0)) and (count == 1).sum() == len(lines)
    assert len(mesh.points) - len(edges) + len(quads) == (0 if case == "cylindrical_shell" else 1)  # one hole in it
    members = [np.asarray(sets[1]) for sets in mesh.cell_sets.values()]
    assert np.array_equal(np.sort(np.concatenate(members)), np.arange(len(lines)))
    assert set(mesh.cell_sets) == BOUNDARIES.get(case, EDGE)
    lengths = np.linalg.norm(np.diff(mesh.points[edges], axis=1)[:, 0], axis=1)
    away = distance_to_arcs(mesh, edges) > 0.15
    assert lengths[away].min() > 0.3 * min(0.04, shapes.SHAPES[case].meshes[name]["h"])
    assert lengths.min() > (0.3 * shapes.SHAPES[case].meshes[name]["h"] if away.all() else 0.7 * RADIUS / 48)


@pytest.mark.parametrize("case, area, circle", [
    ("simple_shear", 25 - 0.1 * 2.45, 0.5), ("symmetric_double_edge_notch", 9 - 0.2 * 0.4, 1),
    ("asymmetric_double_edge_notch", 25 - 0.2 * 0.45, 1), ("cylindrical_shell", 5 * ARC - 0.1 * 0.9, 1),
    ("dog_bone", 10 * 1.5 + 1.5 * 6 - 4 * 1.5, None)])
def test_area(case: str, area: float, circle: float | None) -> None:
    """Fails if a dimension is wrong; round tips are polygons, which the tolerance allows for."""
    if circle is None:  # fillets: outside of the gauge's strip, a square less a quarter circle each
        exact = 10 * 1.5 + 2 * (3 - 1.5) * (3 - 0.75) + 4 * 0.75**2 * (1 - math.pi / 4)
    else:
        exact = area - circle * math.pi * 0.05**2
    assert areas(read(case, "paper")).sum() == pytest.approx(exact, abs=2e-3 if circle is None else 1.5e-3)


@pytest.mark.parametrize("case", IMAGES)
def test_symmetric_mesh(case: str) -> None:
    """Fails if the two notches, or the four corners of the dog-bone, have different meshes around them."""
    mesh = read(case, "paper")
    for image in IMAGES[case]:
        points = mesh.points[:, :2]
        distance, other = cKDTree(points).query(image(points))
        assert distance.max() < 1e-9
        quads = np.sort(mesh.cells_dict["quad"], axis=1)
        turned = np.sort(other[quads], axis=1)
        assert np.array_equal(np.unique(quads, axis=0), np.unique(turned, axis=0))


def test_mirror_symmetric_mesh_to_the_last_bit() -> None:
    """Fails if coordinates of mirror images differ by rounding, which a running crack would amplify."""
    points = read("symmetric_double_edge_notch", "mirror").points[:, :2]
    image = points * (-1, 1) + (3.0, 0)
    assert {tuple(p) for p in points} == {tuple(p) for p in image}


def test_seam_that_does_not_match_is_refused() -> None:
    """Fails if a part is joined to an image whose nodes lie elsewhere on the seam."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 0.3, 0], [1, 1, 0], [0, 1, 0], [0, 0.5, 0]], float)
    part = meshio.Mesh(points, [("quad", np.array([[0, 1, 2, 5], [5, 2, 3, 4]])), ("line", np.array([[1, 2], [2, 3]]))],
                       cell_sets={"seam": [np.zeros(0, int), np.array([0, 1])],
                                  "side": [np.zeros(0, int), np.zeros(0, int)]})
    with pytest.raises(MeshError, match=r"seam.*0\.4 mm"):
        completed(part, "seam", lambda p: np.array([2.0, 1.0]) - p)


def test_sections_without_names() -> None:
    """Fails if a section without lines cannot be swept, or one without quadrilaterals ends in a traceback."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    body = swept(meshio.Mesh(points, [("quad", [[0, 1, 2, 3]])]), 0.1, 2)
    assert len(body.cells_dict["hexahedron"]) == 2 and set(body.cell_sets) == {"back", "front"}
    with pytest.raises(MeshError, match="must have quadrilaterals; it has triangle"):
        swept(meshio.Mesh(points, [("triangle", [[0, 1, 2]])]), 0.1, 2)


# --- hexahedra ---
@pytest.mark.parametrize("layers", [1, 2])
def test_swept_section(layers: int) -> None:
    """Fails if hexahedra are inverted or numbered otherwise than meshio wants, or a surface loses a facet."""
    section = read("dog_bone", "coarse")
    body = swept(section, 0.2, layers)
    P = body.points[body.cells_dict["hexahedron"]]
    volume = np.einsum("ei,ei->e", np.cross(P[:, 1] - P[:, 0], P[:, 3] - P[:, 0]), P[:, 4] - P[:, 0])
    assert volume.min() > 0 and len(P) == layers * len(areas(section))
    facets = body.cells_dict["quad"]
    assert sum(len(members[1]) for members in body.cell_sets.values()) == len(facets)
    corner = body.points[facets]
    outward = np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]) / 2
    assert np.allclose(outward.sum(axis=0), 0, atol=1e-12)  # closed, every facet seen from outside
    flux = np.einsum("fi,fi->", outward, corner.mean(axis=1)) / 3
    assert flux == pytest.approx(0.2 * areas(section).sum())
    assert np.all(body.points[facets[body.cell_sets["front"][1]], 2] == 0.2)


def test_rolled_shell() -> None:
    """Fails if the half cylinder has another radius, another thickness, or lies elsewhere."""
    sample = shape_sample("cylindrical_shell", {"mesh": "coarse", "mesh_seed": 0},
                          lambda section: swept(section, 0.1, 1, rolled(1.9, 0.1)))
    X, space = sample.space.X, sample.space
    for name, radius in (("back", 1.9), ("front", 2.0)):
        assert np.allclose(np.hypot(*X[sample.nodes(name), :2].T), radius)
    assert X[:, 1].min() > -1e-9 and X[:, 1].max() == pytest.approx(2.0, abs=1e-3)
    assert set(X[sample.nodes("bottom"), 2]) == {0.0} and set(X[sample.nodes("top"), 2]) == {5.0}
    assert np.allclose(X[sample.nodes("edge"), 1], 0, atol=1e-9)
    slit = 0.1 * 0.9 + math.pi * 0.05**2
    assert space.V.sum() == pytest.approx((ARC * 5 - slit) * 0.1, rel=2e-3)


def test_rim_of_a_sheet_is_its_edge() -> None:
    """Fails if the faces of a sheet count as edges: a crack through it would arrive as soon as it starts."""
    sample = shape_sample("dog_bone", {"mesh": "coarse", "mesh_seed": 0}, lambda section: swept(section, 0.2, 2))
    named = np.unique(np.concatenate([sample.nodes(name) for name in ("top", "bottom", "side")]))
    assert np.array_equal(sample.rim("back", "front"), named)
    assert len(sample.rim()) > 2 * len(sample.space.X) / 3


# --- the arguments of a case ---
def test_dimension_with_a_mesh_file_is_refused(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """Fails if a dimension is silently ignored because the mesh is a file."""
    own = {"side": 4.0, "notch": 1.5, "notch_width": 0.1, "mesh": str(tmp_path / "x.vtu"), "mesh_seed": 0}
    with pytest.raises(ParameterError, match=r"side, notch, notch_width and mesh_seed are for the meshes coarse"):
        shape_sample("single_edge_notch", own)


def test_unknown_mesh_names_the_known_ones() -> None:
    """Fails if the message offers meshes of another case."""
    with pytest.raises(MeshError, match="coarse, paper, or the path"):
        load_sample("dog_bone", "M3")


@pytest.mark.slow
def test_changed_dimension_makes_a_mesh() -> None:
    """Fails if a changed dimension is ignored: the dog-bone's gauge is then 2 mm wide."""
    pytest.importorskip("gmsh")
    own = {"length": 10.0, "gauge_length": 4.0, "gauge_width": 2.0, "grip_width": 4.0, "fillet": 0.75,
           "mesh": "coarse", "mesh_seed": 3}
    sample = shape_sample("dog_bone", own, lambda section: swept(section, 0.2, 1))
    X = sample.space.X
    waist = X[np.abs(X[:, 1]) < 1.0]
    assert np.ptp(waist[:, 0]) == pytest.approx(2.0) and np.ptp(X[:, 0]) == pytest.approx(4.0)
