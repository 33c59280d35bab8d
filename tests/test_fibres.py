"""Directions of fibres from tables of a deck: closed forms on a ring, arrays of a mesh file, and their picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from skfsink.errors import ParameterError
from skfsink.fields.body import Body
from skfsink.material import NeoHookean
from skfsink.material.oriented import AroundALine
from skfsink.meshing.kept_mesh import keep_mesh
from skfsink.meshing.sample import file_sample
from skfsink.meshing.vtu import write_mesh
from skfsink.pictures import fibre_picture as module
from skfsink.scene.deck import Deck
from skfsink.scene.described import made_in_python
from skfsink.scene.registry import find_case
from skfsink.scene.scene import Scene

AROUND, LAYERS, INNER, OUTER = 24, 3, 1.0, 2.0
HGO = {"material": "hgo", "constants": "c = 0.1 MPa, k1 = 1 MPa, k2 = 2, kappa = 0, angle = 30 degree", "phi": 1.0}


@pytest.fixture(scope="module")
def ring(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ring with its vectors around it: on the cells (`cells`), and on the points with changing signs (`points`)."""
    turn, radius = np.arange(AROUND) * 2 * np.pi / AROUND, np.linspace(INNER, OUTER, LAYERS + 1)
    points = np.array([[r * np.cos(t), r * np.sin(t), 0.0] for t in turn for r in radius])
    n = LAYERS + 1
    quads = np.array([[i * n + j, i * n + j + 1, (i + 1) % AROUND * n + j + 1, (i + 1) % AROUND * n + j]
                      for i in range(AROUND) for j in range(LAYERS)])
    around = np.cross([0.0, 0.0, 1.0], points)
    right = np.flatnonzero(points[quads][:, :, 0].mean(axis=1) > 0)
    mesh = meshio.Mesh(points, [("quad", quads)], cell_sets={"half": [right]},
                       cell_data={"cells": [np.cross([0.0, 0.0, 1.0], points[quads].mean(axis=1))]},
                       point_data={"points": around * (-1.0) ** np.arange(len(points))[:, None]})
    path = tmp_path_factory.mktemp("ring") / "ring.vtu"
    write_mesh(path, mesh)
    return path


def scene(mesh: Path, *fibres: dict[str, Any], **parameters: Any) -> Scene:
    grips = ({"boundary": "right", "x": 1e-3}, {"boundary": "left", "x": -1e-3, "y": 0.0})
    return Deck("custom", {"mesh": str(mesh), **HGO, "grips": grips, "fibres": fibres, **parameters}).scene()


def radii(of: Scene) -> np.ndarray:
    """Unit vectors from the middle of the ring to its elements, (ne, 3)."""
    centres = of.space.X[of.space.conn].mean(axis=1)
    return np.column_stack([centres / np.linalg.norm(centres, axis=1)[:, None], np.zeros(len(centres))])


@pytest.mark.parametrize(("table", "z"), [
    ({"direction": "circumferential"}, np.sin(np.radians(30))), ({"direction": "axial"}, np.cos(np.radians(30)))])
def test_fibres_around_and_along_a_line_lie_across_the_radius(ring: Path, table: dict[str, Any], z: float) -> None:
    """Fails if families leave the surface of a cylinder, or make another angle with its circumference or axis."""
    found = scene(ring, table)
    fibres = found.fibres
    assert fibres is not None and fibres.shape == (AROUND * LAYERS, 2, 3)
    assert np.abs(np.einsum("efi,ei->ef", fibres, radii(found))).max() < 1e-12
    np.testing.assert_allclose(np.abs(fibres[:, :, 2]), z, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(fibres, axis=2), 1.0, atol=1e-12)
    assert np.abs(np.einsum("ei,ei->e", fibres[:, 0], fibres[:, 1])).max() == pytest.approx(0.5, abs=1e-12)


def test_a_ring_of_circumferential_fibres_is_inflated_evenly(ring: Path) -> None:
    """Fails if the element loops do not take each element's own directions: W must be the same all around."""
    def spread(table: dict[str, Any]) -> float:
        of = scene(ring, table)
        momentum = Body.of(of).momentum
        R = np.linalg.norm(of.space.X, axis=1, keepdims=True)
        momentum.force(of.space.X * (np.sqrt(1.0 + 0.5 / R**2) - 1.0))  # as a tube that keeps its volume is inflated
        W = of.space.element_mean(momentum.W).reshape(AROUND, LAYERS)
        return float((np.ptp(W, axis=0) / W.mean(axis=0)).max())

    assert spread({"direction": "circumferential", "normal": [0, 0, 1]}) < 1e-9
    assert spread({"azimuth": 0}) > 0.5


@pytest.mark.parametrize(("table", "axis", "normal"), [
    ({"azimuth": 30}, (np.sqrt(0.75), 0.5, 0), (0, 0, 1)),
    ({"azimuth": 90, "elevation": 90}, (0, 0, 1), (0, -1, 0)),
    ({"azimuth": "0.5 rad", "normal": [0, 0, 2]}, (np.cos(0.5), np.sin(0.5), 0), (0, 0, 2)),
    ({"direction": [1, 1]}, (1, 1, 0), (0, 0, 1)), ({"direction": [0, 0, 3], "normal": [1, 0]}, (0, 0, 3), (1, 0, 0))])
def test_directions_of_the_whole_body(ring: Path, table: dict[str, Any], axis: Any, normal: Any) -> None:
    """Fails if angles turn otherwise than documented, or a list of two numbers is not a vector in the plane."""
    material = scene(ring, table).material
    np.testing.assert_allclose(material.axis, axis, atol=1e-12)
    np.testing.assert_allclose(material.normal, normal, atol=1e-12)


@pytest.mark.parametrize("name", ["cells", "points"])
def test_arrays_of_the_mesh_file(ring: Path, tmp_path: Path, name: str) -> None:
    """Fails if an element gets another's vector, nodes of opposite sign cancel, or a kept mesh has lost the arrays."""
    for mesh in (ring, tmp_path / "mesh.npz"):
        found = scene(mesh, {"array": name}, constants="angle = 0 degree")
        fibres = found.fibres
        assert fibres is not None and fibres.shape[1] == 1  # both families are one
        around = np.cross([0.0, 0.0, 1.0], radii(found))
        np.testing.assert_allclose(np.abs(np.einsum("efi,ei->ef", fibres, around)), 1.0, atol=1e-12)
        keep_mesh(file_sample(ring), tmp_path / "mesh.npz")


def test_a_region_has_its_own_and_a_deck_describes_them(ring: Path) -> None:
    """Fails if fibres of a region reach the rest, a body without fibres gets some, or they count as made in Python."""
    regions = ({"name": "half", "material": "hgo", "constants": "angle = 0 degree", "phi": 1.0},)
    found = scene(ring, {"region": "half", "direction": "circumferential"}, regions=regions, material="neo-hookean",
                  constants="")
    fibres = found.fibres
    assert fibres is not None and np.array_equal(np.isfinite(fibres[:, 0, 0]), found.region_numbers > 0)
    assert isinstance(found.material, NeoHookean)
    assert scene(ring, material="neo-hookean", constants="").fibres is None
    for table in ({"direction": "axial"}, {"array": "cells"}):
        assert made_in_python(scene(ring, table), find_case("custom")) == ()
    assert scene(ring, {"array": "cells"}).fingerprint != scene(ring, {"array": "points"}).fingerprint


def test_a_region_of_the_same_law_has_the_directions_of_the_body(ring: Path) -> None:
    """Fails if a region that differs in its strength alone loses the directions of the body, or gets one element's of
    another."""
    everywhere = scene(ring, {"direction": "circumferential"}).fibres
    assert everywhere is not None
    for region in ({"name": "half", "phi": 2.0}, {"name": "half", **HGO, "phi": 2.0}):
        found = scene(ring, {"direction": "circumferential"}, regions=(region,)).fibres
        np.testing.assert_array_equal(found, everywhere)


@pytest.mark.parametrize(("fibres", "regions", "said"), [
    ({"direction": "circumferential"}, ({"name": "half", "material": "hgo", "constants": "c = 1 kPa", "phi": 1.0},),
     "fibres of region half have no direction, .* with region = 'half', or an axis in the constants"),
    ({"region": "half", "azimuth": 20}, ({"name": "half", "material": "hgo", "constants": "c = 1 kPa", "phi": 1.0},),
     "fibres of the body have no direction, .* without a region, or an axis")])
def test_a_part_without_a_direction_is_refused(ring: Path, fibres: dict[str, Any], regions: Any, said: str) -> None:
    """Fails if fibres lie along x in silence where the deck directs those of another part, or if an axis of the
    constants does not count as a direction."""
    with pytest.raises(ParameterError, match=said):
        scene(ring, fibres, regions=regions)
    with_axis = tuple({**region, "constants": "c = 1 kPa, axis = [0, 1, 0]"} for region in regions)
    constants = "c = 2 kPa, axis = [1, 1, 0]" if "region" in fibres else "c = 2 kPa"
    assert scene(ring, fibres, regions=with_axis, constants=constants).fibres is not None


def test_circumference_of_a_body_of_revolution(tmp_path: Path) -> None:
    """Fails if the line of a body of revolution is not its axis: fibres around it point out of the half plane."""
    x, y = np.meshgrid(np.linspace(1, 2, 4), np.linspace(0, 1, 4), indexing="ij")
    first = (np.arange(3)[:, None] * 4 + np.arange(3)).ravel()
    write_mesh(tmp_path / "tube.vtu", meshio.Mesh(np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()]),
                                                  [("quad", first[:, None] + np.array([0, 4, 5, 1]))]))
    grips = ({"boundary": "top", "y": 1e-3}, {"boundary": "bottom", "y": 0.0})
    fibres = scene(tmp_path / "tube.vtu", {"direction": "circumferential"}, element="axisymmetric", grips=grips,
                   constants="angle = 0 degree").fibres
    assert fibres is not None
    np.testing.assert_allclose(np.abs(fibres[:, 0]), np.broadcast_to([0, 0, 1], (9, 3)), atol=1e-12)


@pytest.mark.parametrize(("table", "said"), [
    ({}, "fibres of the body must have one of direction, array and azimuth; got none"),
    ({"azimuth": 1, "array": "a"}, "got array and azimuth"),
    ({"direction": "radial"}, "circumferential, axial, or a list"),
    ({"direction": [1, 0], "centre": [0, 0]}, "centre is for the directions circumferential and axial"),
    ({"direction": [1, 0], "elevation": 3}, "elevation goes with azimuth"),
    ({"array": "other"}, "has no array 'other' of vectors; it has points, cells"),
    ({"region": "none", "azimuth": 0}, "none is no region of the deck, which has none"),
    ({"direction": [0, 0, 1]}, "axis must not be parallel to normal"),
    ({"direction": "axial", "normal": [0, 0, 1]}, "parallel to their normal"),
    ({"direction": "axial", "axis": [0, 0, 0]}, "axis must not be the zero vector")])
def test_fibres_that_cannot_be(ring: Path, table: dict[str, Any], said: str) -> None:
    """Fails if a mistake passes, or the line does not say where and what."""
    with pytest.raises(ParameterError) as error:
        scene(ring, table)
    assert said in str(error.value) and "\n" not in str(error.value)


def test_fibres_need_a_law_that_has_them_and_an_axis_beside_the_elements(ring: Path) -> None:
    """Fails if fibres of a law without any are left out silently, or an element on the line gets a direction."""
    with pytest.raises(ParameterError, match="fibres of the body: NeoHookean has none; take the material hgo"):
        scene(ring, {"azimuth": 0}, material="neo-hookean", constants="")
    centre = scene(ring).space.X[scene(ring).space.conn[5]].mean(axis=0).tolist()
    with pytest.raises(ParameterError, match="lies on the line they go around: move centre"):
        scene(ring, {"direction": "circumferential", "centre": centre})
    assert AroundALine().on_line(np.array([[0.0, 0.0, 7.0], [1.0, 0.0, 0.0]])).tolist() == [True, False]


def test_the_picture_shows_the_directions(ring: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a line of the picture is not along its fibre, or one out of the plane is as long as one in it."""
    kept: list[Figure] = []
    monkeypatch.setattr(module, "Figure", lambda *a, **k: kept.append(Figure(*a, **k)) or kept[-1])
    found = scene(ring, {"direction": "circumferential"}, constants="angle = 60 degree")
    assert found.fibres is not None
    module.fibre_picture(found.space, found.fibres, tmp_path / "fibres.png")
    first = [c for c in kept[0].axes[0].collections if isinstance(c, LineCollection)][-2]
    lines = np.array(first.get_segments())
    middle, along = lines.mean(axis=1), lines[:, 1] - lines[:, 0]
    assert len(lines) > 40 and np.abs(np.einsum("li,li->l", middle, along)).max() < 1e-9
    spacing = 0.8 * np.ptp(kept[0].axes[0].get_xlim()) / module.ACROSS
    np.testing.assert_allclose(np.linalg.norm(along, axis=1), spacing * np.cos(np.radians(60)), rtol=1e-6)
    assert (tmp_path / "fibres.png").stat().st_size > 10_000
