"""Reference results: what is stored comes back within its rounding, in few bytes; what is damaged is refused."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from references import STEP, cracked, scene_of, write_run

from skfsink.errors import OutputError
from skfsink.results import reference
from skfsink.results.frame import SPENT, read_frame
from skfsink.results.history import History
from skfsink.results.packing import DISPLACEMENT_STEP, GAMMA_STEP, VELOCITY_STEPS, Packer
from skfsink.scene.registry import read_scene
from skfsink.system.shipped import data_folder

ROOT = Path(__file__).resolve().parents[1]
FRAMES = ("growing", "branching", "arrival", "arrival + 5e-6", "end")


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Made-up runs of the notched plate in both analyses, and of the shell."""
    folder = tmp_path_factory.mktemp("runs")
    write_run(folder / "plate", scene_of("single_edge_notch"))
    write_run(folder / "slow", scene_of("single_edge_notch", "quasistatic"))
    write_run(folder / "shell", scene_of("cylindrical_shell"))
    return folder


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where references are looked for in a test."""
    monkeypatch.setattr(reference, "reference_folder", lambda case, key="": tmp_path / case / key)
    return tmp_path


@pytest.fixture
def stored(runs: Path, home: Path) -> Path:
    return reference.store(runs / "plate", home / "single_edge_notch" / "key", FRAMES, ("arrival",))


# --- round trip ---
@pytest.mark.parametrize("case, run", [("single_edge_notch", "plate"), ("cylindrical_shell", "shell")])
def test_what_is_stored_comes_back(runs: Path, home: Path, case: str, run: str) -> None:
    """Fails if a field is rounded more than announced, put at another node, or if frames or times change places."""
    target = reference.store(runs / run, home / case / "key", FRAMES, ("arrival",))
    found = reference.load(case, "key")
    numbers = {"growing": 2, "branching": 2, "arrival": 3, "arrival + 5e-6": 4, "end": 5}
    assert list(found.frames) == list(FRAMES)
    for phrase, frame in found.frames.items():
        true = read_frame(runs / run / "series" / f"run_{numbers[phrase]:04d}.vtu", 0.0, "", found.space.dim)
        assert frame.time == pytest.approx(numbers[phrase] * STEP)
        np.testing.assert_array_equal(frame.deleted, true.deleted)
        np.testing.assert_allclose(frame.gamma, true.gamma, atol=0.51 * GAMMA_STEP, rtol=0)
        live = true.gamma >= SPENT
        np.testing.assert_allclose(frame.u[live], true.u[live], atol=0.51 * DISPLACEMENT_STEP, rtol=0)
        assert np.abs(frame.u).max() < 1.1 * np.abs(true.u[live]).max()  # spent nodes move with their neighbours
        if phrase == "arrival":
            step = np.abs(true.v).max() / VELOCITY_STEPS
            np.testing.assert_allclose(frame.v[live], true.v[live], atol=0.51 * step, rtol=0)
        else:
            assert frame.v is None
    assert found.frame("absent", "end") is found.frames["end"]
    assert found.summary == json.loads((runs / run / "summary.json").read_text())
    assert found.scene.stored().toml() == read_scene(runs / run).stored().toml() == (target / "scene.toml").read_text()
    history = History.load(runs / run / "history.csv")
    for name, values in history.items():
        if values.dtype.kind == "f":
            np.testing.assert_allclose(found.history[name], values, rtol=1e-6)
        else:
            np.testing.assert_array_equal(found.history[name], values)


def test_quasi_static_frames_have_no_time(runs: Path, home: Path) -> None:
    reference.store(runs / "slow", home / "single_edge_notch" / "key", ("growing", "branching", "arrival"))
    found = reference.load("single_edge_notch", "key")
    assert list(found.frames) == ["growing", "arrival"]  # no branching
    assert all(np.isnan(frame.time) for frame in found.frames.values())


def test_few_bytes(runs: Path, home: Path, stored: Path) -> None:
    """Fails if the fields of a smooth frame take more than 2 bytes a node: 20 MB must hold all runs of the figures."""
    space = scene_of("single_edge_notch").sample.space
    assert (stored / "fields.npz").stat().st_size < 4 * 2 * space.n_nodes
    assert (stored / "history.csv").stat().st_size < (runs / "plate" / "history.csv").stat().st_size


def test_equal_runs_give_equal_bytes(runs: Path, stored: Path, tmp_path: Path) -> None:
    again = reference.store(runs / "plate", tmp_path / "again", FRAMES, ("arrival",))
    for file in stored.iterdir():
        assert (again / file.name).read_bytes() == file.read_bytes()


def test_large_displacements_take_larger_steps() -> None:
    scene = scene_of("single_edge_notch")
    packer, frame = Packer(scene.sample.space), cracked(scene, 1.0, opening=40.0)
    back = packer.unpack(packer.pack(frame, "", False), "", None)
    live = frame.gamma >= SPENT
    np.testing.assert_allclose(back.u[live], frame.u[live], atol=np.abs(frame.u[live]).max() / 30000, rtol=0)


# --- which frames ---
@pytest.mark.parametrize("phrase, number", [
    ("onset", 0), ("branching", 2), ("arrival", 3), ("arrival+5e-6", 4), ("end", 5), ("growing", 2),
    ("growing * 0.3", 1), ("growing * 0.9", 3), ("arrival + 1", 5)])
def test_frames_are_picked_by_phrases(phrase: str, number: int) -> None:
    times = [i * STEP for i in range(6)]
    event = {"time_s": np.array(times), "step": np.arange(6), "crack_length_mm": 3 * np.array([0, .4, .6, 1, 1, 1])}
    moments = {"onset": 0, "branching": 2, "arrival": 3, "end": 5}
    assert reference.pick_frame(phrase, moments, times, event) == number
    assert reference.pick_frame("branching", {"end": 5}, times, event) is None


@pytest.mark.parametrize("phrase", ["", "middle", "arrival * 2", "growing + 1", "arrival + x", "arrival + 1e", "end 3"])
def test_phrases_without_meaning_are_refused(phrase: str) -> None:
    event = {"time_s": np.arange(2.0), "step": np.arange(2), "crack_length_mm": np.arange(2.0)}
    with pytest.raises(OutputError, match="names no frame"):
        reference.pick_frame(phrase, {"arrival": 1, "end": 1}, [0.0, 1.0], event)


# --- what cannot be used ---
def test_missing_references_are_named(home: Path, stored: Path) -> None:
    with pytest.raises(OutputError, match="case single_edge_notch has no reference result other"):
        reference.load("single_edge_notch", "other")
    with pytest.raises(OutputError, match="has no frame 'middle'; it has growing, branching"):
        reference.load("single_edge_notch", "key").frame("middle")
    with pytest.raises(OutputError, match=r"no finished run: there is no coarse.json"):
        reference.load_coarse("single_edge_notch")


@pytest.mark.parametrize("name", ["fields.npz", "summary.json", "history.csv", "scene.toml"])
@pytest.mark.parametrize("damage", ["empty", "short", "noise", "absent"])
def test_damaged_references_are_refused_in_one_line(home: Path, stored: Path, name: str, damage: str) -> None:
    """Fails if a damaged file raises anything but an OutputError, or passes."""
    path, content = stored / name, (stored / name).read_bytes()
    if damage == "absent":
        path.unlink()
    else:
        noise = bytes(np.random.default_rng(0).integers(0, 256, 40, np.uint8))
        half = len(content) // 2
        path.write_bytes({"empty": b"", "short": content[:half] if name != "history.csv" else content[:30],
                          "noise": content[:half] + noise + content[half + 40:]}[damage])
    if name == "scene.toml" and damage == "short":
        path.write_bytes(content.replace(b"[parameters]", b"[parameters"))
    with pytest.raises(OutputError) as refused:
        reference.load("single_edge_notch", "key")
    assert "\n" not in str(refused.value)


def test_a_reference_of_another_mesh_is_refused(runs: Path, home: Path, stored: Path) -> None:
    text = (stored / "scene.toml").read_text()
    (stored / "scene.toml").write_text(text.replace('mesh = "coarse"', 'mesh = "M3"'))
    with pytest.raises(OutputError, match=r"computed on another mesh than M3 .*; compute it again"):
        reference.load("single_edge_notch", "key")


def test_a_run_of_another_mesh_is_not_stored(runs: Path, tmp_path: Path) -> None:
    shutil.copytree(runs / "plate", tmp_path / "run")
    text = (tmp_path / "run" / "scene.toml").read_text()
    (tmp_path / "run" / "scene.toml").write_text(text.replace('mesh = "coarse"', 'mesh = "M3"'))
    with pytest.raises(OutputError, match="computed on another mesh"):
        reference.store(tmp_path / "run", tmp_path / "target", FRAMES)
    assert not (tmp_path / "target").exists()


def test_runs_that_are_not_finished_are_not_stored(runs: Path, tmp_path: Path) -> None:
    shutil.copytree(runs / "plate", tmp_path / "run")
    (tmp_path / "run" / "series" / "run_0003.vtu").write_bytes(b"")
    with pytest.raises(OutputError, match="lacks frame 3"):
        reference.store(tmp_path / "run", tmp_path / "target", FRAMES)
    (tmp_path / "run" / "summary.json").unlink()
    with pytest.raises(OutputError, match="no finished run"):
        reference.store(tmp_path / "run", tmp_path / "target", FRAMES)


def test_the_coarse_summary_of_both_analyses(runs: Path, home: Path) -> None:
    with pytest.raises(OutputError, match="not a run of both analyses"):
        reference.store_coarse(runs / "plate", "single_edge_notch")
    both = home / "both"
    both.mkdir()
    part = json.loads((runs / "plate" / "summary.json").read_text())
    (both / "summary.json").write_text(json.dumps({"case": "single_edge_notch", "analysis": "both", "dynamic": part}))
    assert reference.store_coarse(both, "single_edge_notch").name == "coarse.json"
    assert reference.load_coarse("single_edge_notch")["dynamic"] == part
    with pytest.raises(OutputError, match="holds two runs"):
        reference.store(both, home / "target", FRAMES)


@pytest.mark.parametrize("old, new", [
    ('case = "single_edge_notch"', 'case = "no_such_case"'), ('case = "single_edge_notch"', "case = 3"),
    ("notch = 1.0\n", ""), ("phi =", "psi ="), ("phi = 0.1686", 'phi = "x"')])
def test_scenes_that_cannot_be_read(runs: Path, tmp_path: Path, old: str, new: str) -> None:
    text = (runs / "plate" / "scene.toml").read_text()
    assert old in text
    (tmp_path / "scene.toml").write_text(text.replace(old, new))
    with pytest.raises(Exception) as refused:
        read_scene(tmp_path)
    assert type(refused.value).__module__ == "skfsink.errors" and "\n" not in str(refused.value)


def test_a_scene_without_a_newer_option_has_its_default(runs: Path, tmp_path: Path) -> None:
    text = (runs / "plate" / "scene.toml").read_text()
    (tmp_path / "scene.toml").write_text("".join(line for line in text.splitlines(True) if "courant" not in line))
    assert read_scene(tmp_path).parameters["courant"] == 0.8


# --- what is committed ---
COMMITTED = sorted((ROOT / "cases").glob("*/reference/*/fields.npz"))


def test_the_committed_references_are_small() -> None:
    files = [path for path in (ROOT / "cases").glob("*/reference/**/*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) < 20e6


@pytest.mark.slow
@pytest.mark.parametrize("path", COMMITTED, ids=lambda path: f"{path.parts[-4]}-{path.parts[-2]}")
def test_the_committed_references_can_be_read(path: Path) -> None:
    """Fails if a mesh or the parameters of a case have changed since its reference was computed."""
    case, key = path.parts[-4], path.parts[-2]
    assert data_folder(case) == path.parents[2]
    found = reference.load(case, key)
    assert found.summary["elements"] == found.space.n_elements
    for frame in found.frames.values():
        assert frame.gamma.min() >= -1e-12 and frame.gamma.max() <= 1.0 and np.isfinite(frame.u).all()
