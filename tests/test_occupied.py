"""One run in a folder at a time."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import filelock
import pytest
from plates import SMALL, contents, forked, invoke

import skfsink.run.compute
from skfsink.errors import OutputError
from skfsink.run.occupied import HOLDER, LOCK, occupied

QUICK = [*SMALL, "--event-time", "1e-6"]
#: filelock uses marker files elsewhere, which are of another kind than the lock of a process that has these
system_locks = pytest.mark.skipif(os.name != "nt" and not filelock.has_fcntl, reason="the system locks no files")


@pytest.mark.slow
@system_locks
def test_a_second_run_is_refused_while_the_first_one_goes_on(mesh: Path, tmp_path: Path) -> None:
    """Fails if two runs write to one folder, if the line does not say whose it is, or a killed run keeps its folder."""
    out = tmp_path / "out"
    arguments = ["--mesh", mesh, "--out", out, *SMALL, "--checkpoint-every", "0.01"]
    first = subprocess.Popen([sys.executable, "-m", "skfsink.cases.single_edge_notch", *map(str, arguments)])
    try:
        while not (out / "scene.toml").exists():
            assert first.poll() is None
            time.sleep(0.02)
        first.send_signal(signal.SIGSTOP)
        before = contents(out)
        for second in (["--resume", out], [*arguments, "--overwrite"], arguments):
            status, err, _ = invoke(*second)
            assert status == 2 and err.count("\n") == 1, err
            assert re.search(rf"out is in use by another run \(process {first.pid} on \S+, since 2\d.*\): wait", err)
        assert contents(out) == before
    finally:
        first.kill()
        first.wait()
    assert forked(["--resume", out, "--quiet"]) == (0, "")
    assert not {LOCK, HOLDER} & {path.name for path in out.rglob("*")}


def test_a_part_of_two_runs_is_in_use(mesh: Path, tmp_path: Path) -> None:
    """Fails if one of two runs can be resumed alone while both are under way, or both while one is."""
    out = tmp_path / "out"
    arguments = ["--mesh", mesh, "--out", out, "--analysis", "both", *QUICK]
    assert forked(arguments)[0] == 0
    with occupied(out / "dynamic"):
        for second in (["--resume", out], [*arguments, "--overwrite"]):
            before = contents(out)
            status, err, _ = invoke(*second)
            assert status == 2 and f"out/dynamic is in use by another run (process {os.getpid()} " in err
            assert contents(out) == before
    assert invoke("--resume", out, "--quiet")[0] == 0
    assert not {LOCK, HOLDER} & {path.name for path in out.rglob("*")}


@system_locks
def test_a_lock_leaves_nothing_and_disturbs_nothing(tmp_path: Path) -> None:
    """Fails if a folder looks used for its lock, or a refused run changes what a killed one has left."""
    with occupied(tmp_path / "a"):
        assert {path.name for path in (tmp_path / "a").iterdir()} == {LOCK, HOLDER}
        with pytest.raises(OutputError, match="in use"), occupied(tmp_path / "a"):
            pass
    assert not [*(tmp_path / "a").iterdir()]
    (tmp_path / "a" / LOCK).touch(), (tmp_path / "a" / HOLDER).write_text("of a killed run")
    before = contents(tmp_path)
    with pytest.raises(ValueError), occupied(tmp_path / "a"):
        raise ValueError
    assert contents(tmp_path) == before
    with occupied(tmp_path / "a") as warning:
        assert warning == ""
        skfsink.run.compute._begin(tmp_path / "a", overwrite=False)
    assert contents(tmp_path) == {}


def test_a_folder_that_cannot_be_locked(mesh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a file system without locks ends a run, or goes without a word."""
    def fails(*_: object, **__: object) -> None:
        raise OSError(38, "Function not implemented")

    monkeypatch.setattr(filelock.FileLock, "acquire", fails)
    assert invoke("--mesh", mesh, "--out", tmp_path / "out", *QUICK)[0] == 0
    assert "cannot be locked (Function not implemented)" in (tmp_path / "out" / "summary.json").read_text()
    assert HOLDER not in contents(tmp_path / "out")
