"""Runs that are killed or interrupted and go on to the same result; resumes that are refused and touch nothing."""

from __future__ import annotations

import math
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from plates import SMALL, contents, figures, forked, invoke, plate

import skfsink.run.checkpoint
import skfsink.run.compute
from skfsink.meshing.kept_mesh import keep_mesh
from skfsink.meshing.sample import load_sample
from skfsink.meshing.vtu import write_mesh
from skfsink.results.history import HISTORY_COLUMNS, Column, History
from skfsink.run.observers.history import VALUES
from skfsink.scene.deck import read_deck

RUNS = {"explicit": [], "short": ["--event-time", "3e-5"], "quasistatic": ["--analysis", "quasistatic"],
        "consistent": ["--sink", "consistent", "--event-time", "4e-5"],
        "hht": ["--integrator", "hht", "--event-time", "3e-5"], "both": ["--analysis", "both", "--event-time", "2e-5"],
        "contact": ["--contact", "--event-time", "4e-5"],
        "stopped": ["--analysis", "both", "--stop", "crack_length > 1 mm"]}


def histories(folder: Path) -> dict[str, bytes]:
    """The histories below a folder, and the other tables."""
    return {name: content for name, content in contents(folder).items() if name.endswith(".csv")}


def check_readable(folder: Path) -> None:
    """What a killed run has left can be read: whole rows, and no frame is named that is not there."""
    for path in folder.rglob("history.csv"):
        assert History.load(path)
    for path in folder.rglob("run.pvd"):
        for entry in ET.parse(path).iter("DataSet"):
            assert (path.parent / entry.attrib["file"]).is_file()


# --- the same twice, and the same after kills ---
@pytest.mark.slow
@pytest.mark.parametrize("kind, seed", [("short", 0), ("quasistatic", 0), ("both", 0), *((kind, 1) for kind in RUNS)])
def test_killed_runs_end_the_same(kind: str, seed: int, mesh: Path, tmp_path: Path) -> None:
    """Fails if anything a step depends on is not in the checkpoint, or a file is at any moment a part of itself.

    The kills come at the operations on files, in all phases, many times in a row.
    """
    arguments = ["--mesh", mesh, "--checkpoint-every", "0.05", *SMALL, *RUNS[kind]]
    for name in ("one", "two"):
        assert forked([*arguments, "--out", tmp_path / name]) == (0, "")
    assert histories(tmp_path / "one") == histories(tmp_path / "two")
    dice, out, kills = random.Random(f"{kind} {seed}"), tmp_path / "killed", 0
    for attempt in range(13):
        go_on = ["--resume", out, "--quiet"] if (out / "scene.toml").exists() else [*arguments, "--out", out,
                                                                                  "--overwrite"]
        status, text = forked(go_on, stop=dice.randint(1, 40) if attempt < 12 else 0)
        assert (status, text) in ((0, ""), (-9, "")), text
        check_readable(out)
        kills += status == -9
        if status == 0:
            break
    assert kills >= 2 and status == 0
    assert histories(out) == histories(tmp_path / "one") and figures(out) == figures(tmp_path / "one")


@pytest.mark.slow
@pytest.mark.parametrize("kind, number", [
    ("short", signal.SIGINT), ("both", signal.SIGTERM), ("both", signal.SIGINT), ("hht", signal.SIGTERM),
    ("quasistatic", signal.SIGINT)])
def test_interrupted_runs_say_how_to_go_on(kind: str, number: signal.Signals, mesh: Path, tmp_path: Path) -> None:
    """Fails if a signal is lost, ends a run without a checkpoint, or if the line names the wrong folder."""
    out = tmp_path / "my runs" / "out"
    arguments = ["--mesh", mesh, "--checkpoint-every", "0.02", *SMALL, *RUNS[kind]]
    assert forked([*arguments, "--out", tmp_path / "whole"]) == (0, "")
    go_on, stops = [*arguments, "--out", out], 0
    for stop in (27, 8, 8, 40):  # in the loading, soon after a resume, later
        status, text = forked(go_on, stop, number)
        if status == 0:
            break
        assert (status, text) == (130, f"skfsink: interrupted; go on with skfsink resume '{out}'\n")
        check_readable(out)
        go_on, stops = ["--resume", out, "--quiet"], stops + 1
    assert stops >= 2
    assert forked(["--resume", out, "--quiet"]) == (0, "")
    assert histories(out) == histories(tmp_path / "whole") and figures(out) == figures(tmp_path / "whole")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_while_drawing(number: signal.Signals, mesh: Path, tmp_path: Path,
                                   monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a signal outside of the stepping is a traceback, or a kill without a word."""
    out = tmp_path / "out"
    monkeypatch.setattr(skfsink.run.compute, "draw_run", lambda *_: os.kill(os.getpid(), number))
    arguments = ["--mesh", mesh, "--out", out, "--event-time", "1e-6", *SMALL]
    assert forked(arguments) == (130, f"skfsink: interrupted; go on with skfsink resume {out}\n")
    monkeypatch.undo()
    assert forked(["--resume", out, "--quiet"]) == (0, "") and figures(out)["event"]["duration_s"] >= 1e-6


def test_resuming_a_finished_run_draws_it_again(mesh: Path, tmp_path: Path) -> None:
    """Fails if a finished run is stepped on, recorded twice, or refused."""
    out = tmp_path / "out"
    assert invoke("--mesh", mesh, "--out", out, *SMALL, *RUNS["short"])[0] == 0
    before, summary = contents(out), figures(out)
    assert invoke("--resume", out, "--quiet")[:2] == (0, "")
    after = contents(out)
    for files in (before, after):  # they hold wall times
        files.pop("checkpoint.npz"), files.pop("summary.json")
    assert before == after and figures(out) == summary


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["explicit", "both"])
def test_processes_killed_by_the_clock(kind: str, mesh: Path, tmp_path: Path, pictures: None) -> None:
    """Fails as `test_killed_runs_end_the_same` does, but for real: kills at any moment, with pictures."""
    arguments = ["--mesh", mesh, "--checkpoint-every", "0.2", *SMALL, *RUNS[kind]]
    program = [sys.executable, "-m", "skfsink.cases.single_edge_notch"]
    assert invoke(*arguments, "--out", tmp_path / "whole")[0] == 0
    out, dice = tmp_path / "out", random.Random(kind)
    for attempt in range(6):
        go_on = ["--resume", out, "--quiet"] if (out / "scene.toml").exists() else [*arguments, "--out", out,
                                                                                  "--overwrite"]
        process = subprocess.Popen([*program, *map(str, go_on)], stderr=subprocess.PIPE, text=True)
        try:
            process.wait(timeout=None if attempt == 5 else dice.uniform(2.5, 9))
            assert (process.returncode, process.stderr.read() if process.stderr else "") == (0, "")
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        time.sleep(0.05)
        if out.exists():
            check_readable(out)
    assert histories(out) == histories(tmp_path / "whole") and figures(out) == figures(tmp_path / "whole")
    assert {*contents(out)} == {*contents(tmp_path / "whole")}


# --- refusals ---
@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with its own `plate.vtu`, and runs stopped in the event: `run`, `both` (in the second part), `other`."""
    top = tmp_path_factory.mktemp("stopped")
    write_mesh(top / "plate.vtu", plate())
    short = ["--mesh", top / "plate.vtu", *SMALL, "--event-time", "1e-5", "--checkpoint-every", "1e-9"]
    assert forked([*short, "--out", top / "run"], 145)[0] == -9
    assert forked([*short, "--out", top / "other", "--phi", "0.2"], 100)[0] == -9
    assert forked([*short, "--out", top / "both", "--analysis", "both"], 275)[0] == -9
    assert (top / "both" / "quasistatic" / "checkpoint.npz").exists()
    return top


def cut(path: Path, share: float) -> None:
    """Truncate a file."""
    os.truncate(path, int(path.stat().st_size * share))


def edit(path: Path, old: str, new: str) -> None:
    """Replace text that is there."""
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def other_mesh(top: Path) -> None:
    """As many nodes, one elsewhere."""
    mesh = plate()
    mesh.points[30, 0] += 1e-9
    write_mesh(top / "plate.vtu", mesh)
    keep_mesh(load_sample("single_edge_notch", str(top / "plate.vtu")), top / "run/mesh.npz")


def older(top: Path) -> None:
    """A folder as earlier versions left it, which name the mesh file, and keep no mesh."""
    edit(top / "run/scene.toml", 'mesh = "mesh.npz"', f'mesh = "{top / "plate.vtu"}"')
    (top / "run/mesh.npz").unlink()
    (top / "plate.vtu").unlink()


SPOILT: dict[str, tuple[Callable[[Path], object], str]] = {
    "no scene": (lambda top: (top / "run/scene.toml").unlink(), "scene.toml"),
    "no folder": (lambda top: shutil.rmtree(top / "run"), "scene.toml"),
    "no checkpoint": (lambda top: (top / "run/checkpoint.npz").unlink(), "no checkpoint"),
    "cut checkpoint": (lambda top: cut(top / "run/checkpoint.npz", 0.7), "damaged"),
    "empty checkpoint": (lambda top: cut(top / "run/checkpoint.npz", 0), "damaged"),
    "garbage": (lambda top: (top / "run/checkpoint.npz").write_bytes(bytes(range(256)) * 99), "damaged"),
    "foreign npz": (lambda top: np.savez(top / "run/checkpoint.npz", u=np.ones(3)), "damaged"),
    "bare state": (lambda top: shutil.copy(top / "run/onset.npz", top / "run/checkpoint.npz"), "damaged"),
    "other's": (lambda top: shutil.copy(top / "other/checkpoint.npz", top / "run/checkpoint.npz"), "another scene"),
    "edited": (lambda top: edit(top / "run/scene.toml", "phi = 0.1686", "phi = 0.17"), "another scene"),
    "other case": (lambda top: edit(top / "run/scene.toml", '"single_edge_notch"', '"trousers"'), "trousers"),
    "no toml": (lambda top: edit(top / "run/scene.toml", "phi = ", "phi : "), "scene.toml"),
    "bytes": (lambda top: (top / "run/scene.toml").write_bytes(b"\xff\xfe\x00" * 50), "scene.toml"),
    "left out": (lambda top: edit(top / "run/scene.toml", "phi = 0.1686\n", ""), "phi"),
    "too much": (lambda top: edit(top / "run/scene.toml", "phi = ", "psi = 1\nphi = "), "psi"),
    "out of range": (lambda top: edit(top / "run/scene.toml", "phi = 0", "phi = -0"), "(0, inf) MPa"),
    "text": (lambda top: edit(top / "run/scene.toml", "side = 4.0", 'side = "wide"'), "'wide'"),
    "list": (lambda top: edit(top / "run/scene.toml", "phi = 0.1686", "phi = [1, 2]"), "(0, inf) MPa"),
    "other mesh": (other_mesh, "another scene"),
    "no mesh": (lambda top: (top / "run/mesh.npz").unlink(), "no mesh file"),
    "cut mesh": (lambda top: cut(top / "run/mesh.npz", 0.7), "mesh.npz cannot be read"),
    "foreign mesh": (lambda top: np.savez(top / "run/mesh.npz", u=np.ones(3)), "mesh.npz cannot be read"),
    "old mesh file": (older, "no mesh file"),
    "no series": (lambda top: shutil.rmtree(top / "run/series"), "run.pvd"),
    "no frame": (lambda top: (top / "run/series/run_0000.vtu").unlink(), "of the 2 frames"),
    "cut pvd": (lambda top: cut(top / "run/series/run.pvd", 0.5), "run.pvd"),
    "both, no checkpoint": (lambda top: (top / "both/dynamic/checkpoint.npz").unlink(), "no checkpoint"),
    "both, garbage": (lambda top: (top / "both/quasistatic/checkpoint.npz").write_text("!"), "quasistatic"),
    "both, no onset": (lambda top: (top / "both/dynamic/onset.npz").unlink(), "onset.npz"),
}


@pytest.mark.parametrize("name", SPOILT)
def test_spoilt_runs_are_refused(name: str, stopped: Path, tmp_path: Path) -> None:
    """Fails if a resume goes on from what does not belong together, or writes before it has looked."""
    shutil.copytree(stopped, tmp_path, dirs_exist_ok=True)
    for path in tmp_path.rglob("scene.toml"):
        edit(path, str(stopped), str(tmp_path))
    spoil, part = SPOILT[name]
    spoil(tmp_path)
    refused(tmp_path, part, "--resume", tmp_path / ("both" if name.startswith("both") else "run"))


def refused(top: Path, part: str, *arguments: object) -> None:
    """One line with `part` in it, exit status 2, and every file as it was."""
    before = contents(top)
    status, err, out = invoke(*arguments)
    assert (status, out, err.count("\n")) == (2, "", 1) and err.startswith("skfsink: ") and part in err, err
    assert contents(top) == before


@pytest.mark.parametrize("arguments, part", [
    (["--phi", "0.17"], "--phi 0.17"), (["--length-scale", "0.1"], "--length-scale 0.1"), (["--side", "5"], "--side 5"),
    (["--mesh", "M3"], "--mesh M3"), (["--mesh", "plate.vtu"], "--mesh "), (["--threads", "2"], "--threads 2"),
    (["--analysis", "both"], "--analysis both"), (["--out", "elsewhere"], "--out elsewhere"), (["--phi", "-1"], "-1")])
def test_parameters_beside_resume_must_agree(arguments: list[str], part: str, stopped: Path) -> None:
    """Fails if a parameter given beside --resume, even one at its default, is dropped or used without a word."""
    refused(stopped, part, "--resume", stopped / "run", *arguments)


def test_checkpoint_of_another_version(stopped: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a checkpoint whose meaning may have changed is read."""
    monkeypatch.setattr(skfsink.run.checkpoint, "__version__", "0.0.9")
    cure = f"start anew with skfsink run {stopped / 'run' / 'scene.toml'}"
    refused(stopped, "was written by skfsink", "--resume", stopped / "run")
    refused(stopped, cure, "--resume", stopped / "run")


def test_runs_of_before_a_shared_parameter(stopped: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a run of a version without a parameter is refused for that, or its scene.toml makes another scene."""
    before = read_deck(stopped / "run/scene.toml").scene()
    shutil.copytree(stopped, tmp_path, dirs_exist_ok=True)
    for kind in ("run", "both"):
        edit(tmp_path / kind / "scene.toml", 'kernels = "compiled"\n', "")
    again = read_deck(tmp_path / "run/scene.toml").scene()
    assert again.fingerprint == before.fingerprint and again.controls.kernels == "compiled"
    monkeypatch.setattr(skfsink.run.checkpoint, "__version__", "0.3.0")
    for kind in ("run", "both"):
        refused(tmp_path, f"this is 0.3.0, which cannot go on with it: start anew with skfsink run "
                          f"{tmp_path / kind / 'scene.toml'}", "--resume", tmp_path / kind)


def test_a_column_of_the_history_that_is_not_known(stopped: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
                                                   ) -> None:
    """Fails if a run with a column of your own goes on without it, or one that is entered in one place alone runs."""
    refused_before = "the column speed of the history is not in "
    monkeypatch.setitem(VALUES, "speed", lambda view: 1.0)
    refused(stopped, refused_before + "HISTORY_COLUMNS", "--resume", stopped / "run")
    monkeypatch.setitem(HISTORY_COLUMNS, "speed", Column("of a node", "", before=math.nan))
    shutil.copytree(stopped, tmp_path, dirs_exist_ok=True)
    assert forked(["--resume", tmp_path / "run"])[0] == 0
    monkeypatch.delitem(VALUES, "speed")
    refused(stopped, refused_before + "VALUES", "--resume", stopped / "run")
    monkeypatch.delitem(HISTORY_COLUMNS, "speed")
    refused(tmp_path, "has the column speed in its history", "--resume", tmp_path / "run")
    assert np.isfinite(History.load(tmp_path / "run" / "history.csv")["speed"][-1])


def test_equal_parameters_beside_resume_and_any_working_folder(stopped: Path, tmp_path: Path,
                                                               monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if parameters that agree are refused, or if a run finds its mesh only from where it was started."""
    monkeypatch.chdir(tmp_path)
    for kind in ("run", "both"):
        shutil.copytree(stopped / kind, tmp_path / kind)
        status, text = forked(["--resume", kind, "--length-scale", "0.6", "--phi", "0.1686", "--side", "4", "--mesh",
                               stopped / "plate.vtu", "--out", tmp_path / kind])
        assert status == 0 and (tmp_path / kind / "summary.json").exists(), text
