"""The two-pass mesh: its corridor, its mesh, what happens without gmsh, and what is said when a crack leaves it."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from references import scene_of

import skfsink.run.compute
import skfsink.run.request
from skfsink.cases.single_edge_notch import single_edge_notch
from skfsink.errors import MeshError, OutputError
from skfsink.fields.state import State
from skfsink.meshing.outline import SizeField
from skfsink.meshing.sample import shape_mesh
from skfsink.meshing.shapes import _even
from skfsink.run import two_pass as corridor
from skfsink.run.display import Display
from skfsink.run.notes import Notes
from skfsink.run.two_pass import Corridor, corridor_report, lay_corridor
from skfsink.scene.options import Options
from skfsink.scene.registry import read_scene

L = 0.1


def straight(y: float = 2.0) -> np.ndarray:
    """Places along a straight crack across the plate."""
    x = np.arange(1.0, 4.0, 0.05)
    return np.column_stack([x, np.full_like(x, y)])


@pytest.mark.parametrize("point", [(0.0, 0.0), (0.3, -0.2), (0.0, 0.7), (-0.9, 0.4), (2.0, 3.0)])
def test_distance_from_a_place(point: tuple[float, float]) -> None:
    """Fails if the map of distances is turned, shifted by more than a cell, or ends at its edge."""
    found = Corridor(np.zeros((1, 2)), L)
    assert found(*point) == pytest.approx(max(0.0, np.hypot(*point) - found.width), abs=1.5 * found.cell)


def test_elements_are_fine_along_the_path_only() -> None:
    """Fails if the corridor is not meshed at h, or the rest is: it has about half of the committed elements."""
    pytest.importorskip("gmsh")
    mesh = shape_mesh("single_edge_notch", scene_of("single_edge_notch").parameters,
                      {"distance": Corridor(straight(), L), "h": 0.0331})
    corners = mesh.points[mesh.cells_dict["quad"]][:, :, :2]
    middle, one, two = corners.mean(axis=1), corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    size = np.sqrt(np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]) / 2)
    away = np.abs(middle[:, 1] - 2)
    assert np.median(size[(away < 0.3) & (middle[:, 0] > 1.5)]) == pytest.approx(0.0331, rel=0.1)
    assert np.median(size[away > 1.2]) > 0.09
    assert len(size) < 0.55 * 11440


def test_a_symmetric_mesh_is_fine_on_the_image_of_the_path() -> None:
    """Fails if the corridor of a sample meshed as a part is laid on one side only."""
    size = _even(SizeField(0.02, 0.11, distance=Corridor(straight(0.7), L)), lambda p: p * (1, -1))
    for x, y in ((2.0, 0.7), (2.0, 0.0), (3.0, 1.5), (0.1, 0.2)):
        assert size(x, y) == size(x, -y) == min(size(x, y), SizeField(0.02, 0.11, distance=Corridor(
            straight(0.7), L))(x, abs(y)))
    assert size(2.0, 0.7) == 0.02 < size(2.0, 0.0) and size(0.0, 3.0) == 0.11


def finished(y: float) -> Any:
    """What is left of a run on the coarse mesh whose crack is straight at the height `y`."""
    scene = scene_of("single_edge_notch")
    space = scene.sample.space
    state = State.intact(space)
    middle = space.X[space.conn].mean(axis=1)
    state.deleted = (np.abs(middle[:, 1] - y) < 0.05) & (middle[:, 0] > 1.05)
    return SimpleNamespace(scene=scene, state=state, notes=Notes(lambda text: None))


def store(folder: Path) -> None:
    np.savez(folder / corridor.PATH, places=straight(), length_scale=L, elements=900, wall_s=1.0, mesh_s=2.0)


def test_a_crack_that_leaves_the_corridor_is_counted_and_warned_of(tmp_path: Path) -> None:
    """Fails if a crack outside of the fine elements passes for one inside."""
    store(tmp_path)
    inside, outside = finished(2.1), finished(2.6)
    report = corridor_report(inside, tmp_path)
    assert report["failed_outside"] == 0 and report["failed"] > 20 and inside.notes.texts == []
    report = corridor_report(outside, tmp_path)
    assert report["failed_outside"] == report["failed"] > 20
    assert "left the corridor" in outside.notes.texts[0]
    with pytest.raises(OutputError, match=r"corridor\.npz is missing or damaged"):
        corridor_report(inside, tmp_path / "none")


def test_without_gmsh_the_committed_mesh_is_taken_and_said_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if the fall-back is silent, or is stored as what it is not."""
    monkeypatch.setattr(skfsink.run.request, "has_gmsh", lambda: False)
    options = Options(mesh_layout="two-pass", event_time=1e-7, out=tmp_path / "run", quiet=True)
    result = single_edge_notch(mesh="coarse", options=options)
    assert any("no gmsh" in text for text in result.summary["warnings"])
    assert result.summary["elements"] == 3431 and "corridor" not in result.summary
    stored = tomllib.loads((tmp_path / "run" / "scene.toml").read_text())
    assert stored["parameters"]["mesh_layout"] == "corridor"
    assert any("no gmsh" in text for text in json.loads((tmp_path / "run" / "summary.json").read_text())["warnings"])


@pytest.mark.slow
def test_a_first_pass_without_a_crack_is_refused(tmp_path: Path) -> None:
    """Fails if a corridor is laid along nothing."""
    pytest.importorskip("gmsh")
    options = Options(mesh_layout="two-pass", event_time=1e-7, out=tmp_path / "run", quiet=True)
    with pytest.raises(MeshError, match="first pass found no crack"):
        single_edge_notch(mesh="coarse", options=options)


@pytest.mark.slow
def test_the_mesh_of_two_passes_comes_from_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a run made again from its scene, or resumed, is not on the mesh that its first pass had laid."""
    pytest.importorskip("gmsh")
    scene = scene_of("single_edge_notch")
    monkeypatch.setattr(corridor, "first_pass", lambda *_: (straight(), {"elements": 900, "wall_s": 1.0}))
    options = lay_corridor(scene, scene.parameters, Options(mesh_layout="two-pass"), tmp_path, Display(quiet=True))
    from skfsink.cases.single_edge_notch import CASE

    own = {k: v for k, v in scene.parameters.items() if k in ("side", "notch", "notch_width", "mesh", "mesh_seed")}
    made = CASE.scene(own, options)
    made.stored().write(tmp_path)
    again = read_scene(tmp_path)
    assert again.fingerprint == made.fingerprint and made.sample.space.n_elements < 0.8 * 3431
    with pytest.raises(MeshError, match="no mesh of a corridor"):
        CASE.scene(own, replace(options, corridor=tmp_path / "gone.vtu"))
