"""The mesh of a run lies in its folder: it reads as it was, and the folder can be taken elsewhere."""

from __future__ import annotations

import shutil
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bodies import box
from plates import SMALL, contents, figures, forked, invoke, invoke_program, plate

from skfsink.cases.single_edge_notch import single_edge_notch
from skfsink.meshing import sample as samples
from skfsink.meshing.kept_mesh import keep_mesh, mesh_name, origin
from skfsink.meshing.sample import Sample, file_sample, kept_sample
from skfsink.meshing.vtu import write_mesh
from skfsink.report import write_report
from skfsink.results.loader import load
from skfsink.scene.options import Options

QUICK = [*SMALL, "--event-time", "2e-6"]
NAMES = ("left", "gmsh", "region:1", "a/b", 'with "quotes", commas and <tags>', "Größe µ", "x" * 300, "new\tline\n", "")


@pytest.mark.parametrize("kind", ["quad", "hex"])
def test_a_kept_mesh_reads_as_it_was(kind: str, tmp_path: Path) -> None:
    """Fails if a bit of a coordinate, the order of nodes or elements, or a name is lost on the way, or sets overlap."""
    space = box(kind, 4)
    dice = np.random.default_rng(1)
    boundaries = {name: np.unique(dice.integers(0, space.n_nodes, 9)) for name in NAMES}
    cells = {name: np.unique(dice.integers(0, space.n_elements, 5)) for name in NAMES}
    of = Sample("my mesh", space, boundaries, True, cells=cells, source="C:\\somewhere\\my mesh.inp")
    keep_mesh(of, tmp_path / "mesh.npz")
    keep_mesh(of, tmp_path / "again.npz")
    assert (tmp_path / "mesh.npz").read_bytes() == (tmp_path / "again.npz").read_bytes()
    for found in (kept_sample(tmp_path / "mesh.npz"), file_sample(tmp_path / "mesh.npz")):
        assert (found.name, found.made, found.source) == (of.name, of.made, of.source)
        for name in ("X", "conn", "w", "invJ"):
            assert (getattr(found.space, name) == getattr(space, name)).all(), name
        assert (found.space.mesh.t == space.mesh.t).all()
        for name in NAMES:
            assert (found.nodes(name) == boundaries[name]).all() and (found.elements(name) == cells[name]).all()
    assert origin(str(tmp_path / "mesh.npz")) == of.source and mesh_name(str(tmp_path / "mesh.npz")) == "my mesh"
    assert origin("M3") == "M3" and mesh_name("a/b.msh") == "b" and origin("a/none.npz") == "a/none.npz"


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["dynamic", "both"])
def test_a_folder_goes_on_elsewhere_without_its_mesh_file(kind: str, tmp_path: Path,
                                                          monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a killed run needs the original file, or its old place, to be resumed, shown, reported or run again."""
    monkeypatch.chdir(tmp_path)
    write_mesh(tmp_path / "my plate.vtu", plate())
    arguments = ["--mesh", "my plate.vtu", *QUICK, "--checkpoint-every", "1e-9", "--analysis", kind]
    assert forked([*arguments, "--out", "whole"]) == (0, "")
    assert forked([*arguments, "--out", "here"], 60 if kind == "dynamic" else 150)[0] == -9
    (tmp_path / "my plate.vtu").unlink()
    (tmp_path / "far").mkdir()
    shutil.move("here", "far/there")
    monkeypatch.chdir(tmp_path / "far")
    assert forked(["--resume", "there", "--quiet"]) == (0, "")
    there = contents(Path("there"))
    tables = {name: text for name, text in contents(tmp_path / "whole").items() if name.endswith(".csv")}
    assert {name: there[name] for name in tables} == tables
    assert figures(Path("there")) == figures(tmp_path / "whole") and figures(Path("there"))["mesh"] == "my plate"
    stored = tomllib.loads(there["scene.toml"].decode())
    assert stored["parameters"]["mesh"] == "mesh.npz" and stored["source"] == str(tmp_path / "my plate.vtu")
    for run in load("there").runs:
        assert run.scene.sample.name == "my plate" and run.parameters["mesh"] == stored["source"]
        monkeypatch.chdir(run.folder)
        assert invoke_program("run", "scene.toml", "--quiet")[:2] == (0, "")
        ended = Path("results/single_edge_notch") / f"my plate-{run.analysis}"
        for name in ("history.csv", "scene.toml")[run.analysis == "quasistatic":]:  # which takes the other's onset
            assert (ended / name).read_bytes() == there[str(run.folder.relative_to("there") / name)], name
        shutil.rmtree("results")
        monkeypatch.chdir(tmp_path / "far")
    assert "my plate" in write_report([Path("there")], Path("report.html")).read_text()
    shutil.move("there", "again")  # a finished one
    assert invoke("--resume", "again", "--mesh", tmp_path / "my plate.vtu", "--quiet")[:2] == (0, "")
    assert invoke("--resume", "again", "--mesh", "again/mesh.npz", "--quiet")[:2] == (0, "")
    assert "--mesh" in invoke("--resume", "again", "--mesh", "my plate.vtu", "--quiet")[1]  # which is none here


def test_regions_and_sides_of_a_scene_of_ones_own_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a set of elements, or a side that the mesh does not name, is not there without the original file."""
    mesh = plate()
    middle = mesh.points[mesh.cells_dict["quad"]].mean(axis=1)
    mesh.cell_sets = {"stiff, part": [np.flatnonzero(middle[:, 0] > 3), np.zeros(0, int)]}
    write_mesh(tmp_path / "plate.vtu", mesh)
    (tmp_path / "deck.toml").write_text(
        'case = "custom"\n[parameters]\nmesh = "plate.vtu"\nlength_scale = 0.6\nevent_time = "2 µs"\n'
        '[[grips]]\nboundary = "top"\nx = 0\ny = 1e-3\n[[grips]]\nboundary = "bottom"\nx = 0\ny = 0\n'
        '[[regions]]\nname = "stiff, part"\nmaterial = "neo-hookean"\nphi = 1.0\n')
    monkeypatch.chdir(tmp_path)
    assert invoke_program("run", "deck.toml", "--out", "first", "--quiet") == (0, "", "")
    (tmp_path / "plate.vtu").unlink()
    shutil.move("first", "moved")
    assert invoke_program("run", "moved/scene.toml", "--out", "second", "--quiet") == (0, "", "")
    for name in ("history.csv", "scene.toml", "mesh.npz"):
        assert Path("second", name).read_bytes() == Path("moved", name).read_bytes(), name
    assert invoke_program("resume", "moved", "--quiet")[0] == 0


def test_a_mesh_that_gmsh_made_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a folder needs gmsh, or the same version of it, to be resumed or shown elsewhere."""
    made = samples._from_meshio("coarse", plate(), made=True)
    with monkeypatch.context() as patch:
        patch.setattr("skfsink.scene.arrange.shape_sample", lambda *_: made)
        result = single_edge_notch(mesh="coarse", side=4.0, notch=1.0, options=Options(
            length_scale=0.6, event_time=2e-6, out=tmp_path / "run", quiet=True))
    stored = tomllib.loads((tmp_path / "run" / "scene.toml").read_text())
    assert stored["parameters"]["mesh"] == "coarse" and "source" not in stored
    scene = load(tmp_path / "run").scene
    assert scene.sample.made and scene.fingerprint == result.scene.fingerprint
    assert invoke("--resume", tmp_path / "run", "--quiet")[:2] == (0, "")


def test_a_named_mesh_is_not_copied(tmp_path: Path) -> None:
    """Fails if a mesh that comes with the program fills every folder."""
    options = Options(event_time=1e-7, out=tmp_path / "run", quiet=True)
    made = single_edge_notch(mesh="coarse", options=replace(options, length_scale=0.1))
    assert not (made.folder / "mesh.npz").exists()
