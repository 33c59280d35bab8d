"""Memory that is not there, full disks, vanished folders, signals at bad moments: one line, and nothing lost."""

from __future__ import annotations

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import skfem
from plates import SMALL, contents, forked, invoke

import skfsink as sk
import skfsink.run.compute
import skfsink.run.memory
from skfsink.errors import ParameterError
from skfsink.fem.multigrid import Multigrid
from skfsink.fem.pattern import Pattern
from skfsink.fem.space import Space
from skfsink.fields.momentum import Momentum
from skfsink.material import AAA
from skfsink.run.checkpoint import load_checkpoint
from skfsink.run.display import Interrupt
from skfsink.run.memory import LIMIT, available, estimate
from skfsink.run.observers.observer import Observers
from skfsink.scene.registry import read_scene

REFERENCES = sorted((Path(__file__).resolve().parents[1] / "cases").glob("*/reference/*/summary.json"))


# --- memory ---
@pytest.mark.slow
def test_estimate_meets_the_peaks_of_the_references() -> None:
    """Fails if the estimate is off by more than a factor of 1.5 from what a committed run took."""
    estimates: dict[tuple[str, int], float] = {}
    for path in REFERENCES:
        summary = json.loads(path.read_text())
        key = summary["case"], summary["elements"]
        if key not in estimates:
            estimates[key] = estimate(read_scene(path.parent).sample.space)
        assert 1 / 1.5 < estimates[key] / (summary["cost"]["peak_rss_mb"] / 1e3) < 1.5, path
    assert len(estimates) >= 8


def test_factor_of_a_cube_grows_as_nested_dissection_does() -> None:
    """Fails if the fill of a thick body is taken for that of a sheet: n^(4/3) for n nodes, n log n there."""
    def entries(*counts: int) -> float:
        return Space(skfem.MeshHex.init_tensor(*[np.linspace(0, c, c + 1) for c in counts])).factor_entries

    assert 1.25 < np.log2(entries(16, 16, 16) / entries(8, 8, 8)) / 3 < 1.6
    assert 1.0 < np.log2(entries(32, 32, 2) / entries(16, 16, 2)) / 2 < 1.3
    measured = 186e6 / 8 / 9  # PARDISO's factor of the elastic matrix on 22 x 22 x 22 elements, for 3 x 3 blocks
    assert entries(22, 22, 22) == pytest.approx(measured, rel=0.25)


def test_memory_without_factors() -> None:
    """Fails if the estimate of multigrid is off by half, or is not below that of factors on a thick body."""
    space = Space(skfem.MeshHex.init_tensor(*[np.linspace(0.0, 1.0, 21)] * 3))
    free = np.repeat(space.X[:, 1] > 0.0, 3)
    momentum = Momentum(space, AAA())
    tracemalloc.start()
    try:
        pattern = Pattern(space, 3, free, upper=True)
        data = momentum.tangent(pattern, np.zeros_like(space.X))
        multigrid = Multigrid(space, free, pattern)
        multigrid.factorize(data)
        multigrid.conjugate(data, np.ones(pattern.size), 1e-2, 5)
        peak = tracemalloc.get_traced_memory()[1] / 1e9
    finally:
        tracemalloc.stop()
    assert 1 / 1.5 < (estimate(space, linear="multigrid") - estimate(space, statics=False)) / peak < 1.5
    assert estimate(space, statics=False) < estimate(space, linear="petsc-gamg")
    thick = Space(skfem.MeshHex.init_tensor(*[np.linspace(0.0, 1.0, 49)] * 3))
    assert estimate(thick, linear="multigrid") < 0.8 * estimate(thick)


def test_memory_of_large_bodies() -> None:
    """Fails if the estimate of a million hexahedra, or of the tangent of a million unknowns, is off by 1.5."""
    space = Space(skfem.MeshHex.init_tensor(*[np.linspace(0.0, 1.0, 71)] * 3))
    estimates = {"explicit": estimate(space, statics=False), "viscous": estimate(space, statics=False, viscous=True),
                 **{linear: estimate(space, linear=linear) for linear in ("multigrid", "petsc-gamg")}}
    peaks = {"explicit": 5.24e-6, "viscous": 7.54e-6, "multigrid": 8.83e-6 * 3.03, "petsc-gamg": 5.12e-6 * 3.03}
    for name, found in estimates.items():  # measured: a run of 989,016 hexahedra, of 1,000,000, and `study.tangent`
        assert 1 / 1.5 < found / (peaks[name] * space.n_elements) < 1.5, name


def test_multigrid_is_the_cure_where_factors_do_not_fit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a body that fits without factors is not told so, or a plane one, which does not, is."""
    def told(*counts: int, limit: float) -> str:
        path = tmp_path / f"{len(counts)}.vtu"
        sk.write_mesh(path, sk.grid_mesh(*[np.linspace(0.0, 1.0, n + 1) for n in counts]))
        monkeypatch.setenv(LIMIT, str(limit))
        with pytest.raises(ParameterError) as caught:
            sk.custom(mesh=path, grips=[sk.Grip("top", (0, 1e-3)), sk.Grip("bottom", (0, 0))], quiet=True,
                      out=tmp_path / path.stem)
        return str(caught.value)

    assert "take linear = 'multigrid', which needs 2.7 GB, or a coarser" in told(40, 40, 40, limit=3.0)
    assert "multigrid" not in told(30, 30, limit=0.36)


def test_more_memory_than_there_is_is_refused(mesh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a run too large is begun, or refused without the figures and the cure."""
    before = contents(tmp_path)
    for value, part in (("0.2", "there are 0.2 GB"), ("-1", "(0, inf) GB"), ("all", "(0, inf) GB")):
        monkeypatch.setenv(LIMIT, value)
        status, err, out = invoke("--mesh", mesh, "--out", tmp_path / "out", *SMALL)
        assert (status, out, err.count("\n")) == (2, "", 1) and part in err and LIMIT in err, err
    assert contents(tmp_path) == before
    monkeypatch.setenv(LIMIT, "0.5")
    assert invoke("--mesh", mesh, "--out", tmp_path / "out", "--event-time", "1e-9", *SMALL)[0] == 0


def test_memory_of_a_control_group(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if the limit of a container is not seen, or one without a limit is taken for one."""
    monkeypatch.delenv(LIMIT, raising=False)
    free = available()
    assert 0.1 < free < 1e5
    monkeypatch.setattr(skfsink.run.memory, "_groups", lambda: [tmp_path])
    (tmp_path / "memory.current").write_text("1000000\n")
    (tmp_path / "memory.max").write_text("max\n")
    assert available() == pytest.approx(free, rel=0.5)
    (tmp_path / "memory.max").write_text("1000001\n")
    assert available() < 5.0  # what this process has already


def test_a_large_run_says_what_it_needs(mesh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if the estimate is not shown before a run that needs much."""
    monkeypatch.setattr(skfsink.run.memory, "WORTH_SAYING", 0.1)
    status, err, _ = invoke("--mesh", mesh, "--out", tmp_path / "out", "--event-time", "1e-9", *SMALL[:-1])
    assert status == 0 and "the run will need about 0.4 GB of memory; there are" in err


# --- signals ---
@pytest.mark.slow
def test_a_long_step_is_not_waited_for(mesh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a signal in a step that goes on for long ends the run late, with a traceback, or with nothing to resume.

    The step stands still in the loading (a factorisation of a large body), from its sixth force on.
    """
    monkeypatch.setattr(Interrupt, "PATIENCE", 0.3)
    out, force, calls = tmp_path / "out", Momentum.force, 0

    def slow(self: Momentum, *arguments: Any, **named: Any) -> np.ndarray:
        nonlocal calls
        calls += 1
        if calls == 6:
            os.kill(os.getpid(), signal.SIGTERM)
            for _ in range(200):
                time.sleep(0.05)
        return force(self, *arguments, **named)

    monkeypatch.setattr(Momentum, "force", slow)
    begun = time.monotonic()
    status, text = forked(["--mesh", mesh, "--out", out, "--event-time", "1e-6", *SMALL])
    assert (status, text) == (130, f"skfsink: interrupted; go on with skfsink resume {out}\n")
    assert time.monotonic() - begun < 8
    monkeypatch.setattr(Momentum, "force", force)
    assert forked(["--resume", out, "--quiet"]) == (0, "")
    assert forked(["--mesh", mesh, "--out", tmp_path / "whole", "--event-time", "1e-6", *SMALL]) == (0, "")
    assert (out / "history.csv").read_bytes() == (tmp_path / "whole/history.csv").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("place", ["lay_out", "between"])
def test_signals_outside_of_the_steps(place: str, mesh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a signal while a run is set up, or between two analyses, is a traceback or loses the first of them."""
    out = tmp_path / "out"
    owner, name = (skfsink.run.compute, "prepare_folder") if place == "lay_out" else (skfsink.run.compute, "load_state")
    call = getattr(owner, name)

    def hit(*arguments: object) -> object:
        os.kill(os.getpid(), signal.SIGTERM)
        return call(*arguments)

    arguments = ["--mesh", mesh, "--out", out, "--analysis", "both", "--event-time", "1e-6", *SMALL]
    monkeypatch.setattr(owner, name, hit)
    status, text = forked(arguments)
    monkeypatch.setattr(owner, name, call)
    if place == "lay_out":
        assert (status, text) == (130, "skfsink: interrupted; nothing was computed yet\n")
        assert forked(arguments)[0] == 0
    else:
        assert (status, text) == (130, f"skfsink: interrupted; go on with skfsink resume {out}\n")
        done = (out / "dynamic/history.csv").read_bytes()
        assert forked(["--resume", out, "--quiet"])[0] == 0
        assert (out / "dynamic/history.csv").read_bytes() == done
    assert (out / "quasistatic/summary.json").is_file()


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_programs_that_are_stopped(number: signal.Signals, mesh: Path, tmp_path: Path) -> None:
    """Fails if `skfsink run` or `skfsink sweep` do not end within seconds of a signal, with what goes on with them."""
    deck = tmp_path / "deck.toml"
    deck.write_text('case = "single_edge_notch"\n[parameters]\nmesh = "plate.vtu"\nlength_scale = 0.6\n'
                    'checkpoint_every = 1000\nevent_time = 1\nintegrator = "hht"\nhht_dt = 1e-9\n')
    run, sweep = tmp_path / "run", tmp_path / "sweep"
    for arguments, sign, said in (
            (["run", deck, "--out", run, "--quiet"], run / "series/run_0000.vtu", f"go on with skfsink resume {run}"),
            (["sweep", deck, "--vary", "phi=0.16,0.17", "--jobs", "1", "--out", sweep, "--quiet"],
             sweep / "phi=0.16/run/series/run_0000.vtu", "0 of 2 runs done; the same command goes on")):
        # a shell may have SIGINT ignored
        heeded = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
        program = f"{heeded}; from skfsink.__main__ import main; main()"
        child = subprocess.Popen([sys.executable, "-c", program, *map(str, arguments)], stderr=subprocess.PIPE,
                                 text=True)
        try:
            for _ in range(600):
                if sign.exists() or child.poll() is not None:
                    break
                time.sleep(0.1)
            child.send_signal(number)
            begun = time.monotonic()
            err = child.communicate(timeout=30)[1]
        finally:
            child.kill()
        assert (child.returncode, err) == (130, f"skfsink: interrupted{' with' if arguments[0] == 'sweep' else ';'} "
                                                f"{said}\n")
        assert time.monotonic() - begun < 15
        folder = sign.parents[1]
        scene = read_scene(folder)
        assert load_checkpoint(folder / "checkpoint.npz", scene.fingerprint).state.phase == "event"


# --- disks ---
def tight(operation: Any, after: int, number: int) -> Any:
    """`operation`, failing as the system does from its call number `after` on."""
    calls = 0

    def wrapper(*arguments: Any, **named: Any) -> Any:
        nonlocal calls
        calls += 1
        if calls > after:
            raise OSError(number, os.strerror(number))
        return operation(*arguments, **named)
    return wrapper


@pytest.mark.slow
@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS])
@pytest.mark.parametrize("after", [9, 25])
def test_writing_fails(number: int, after: int, mesh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a file that cannot be written is a traceback, or costs the checkpoint that was there."""
    out = tmp_path / "out"
    arguments = ["--mesh", mesh, "--event-time", "5e-6", "--checkpoint-every", "1e-9", *SMALL]
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", tight(os.fsync, after, number))
        status, err, _ = invoke(*arguments, "--out", out)
    assert status == 2 and err.startswith("skfsink: cannot write ") and os.strerror(number) in err
    assert err.count("\n") == 1 and not [path for path in out.rglob(".*") if path.is_file()]
    assert forked(["--resume", out, "--quiet"]) == (0, "")
    assert forked([*arguments, "--out", tmp_path / "whole"]) == (0, "")
    assert (out / "history.csv").read_bytes() == (tmp_path / "whole/history.csv").read_bytes()


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 1 MB."""
    path = tmp_path / "disk"
    path.mkdir()
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(path)], capture_output=True)
    if done.returncode:
        pytest.skip("only root can mount a small disk")
    try:
        yield path
    finally:
        subprocess.run(["umount", "-l", str(path)], check=True)


@pytest.mark.slow
def test_a_disk_that_is_full(small_disk: Path, mesh: Path, tmp_path: Path) -> None:
    """Fails if a real disk without room is a traceback, or costs the last checkpoint."""
    out = small_disk / "out"
    arguments = ["--mesh", mesh, "--event-time", "2e-5", "--frame-every", "1e-7", "--record-every", "1e-7",
                 "--checkpoint-every", "0.01", *SMALL]
    status, err = forked([*arguments, "--out", out])
    assert status == 2 and err.startswith("skfsink: cannot write ") and "No space left" in err, err
    shutil.copytree(out, tmp_path / "larger")
    assert forked(["--resume", tmp_path / "larger", "--quiet"]) == (0, "")
    assert forked([*arguments, "--out", tmp_path / "whole"]) == (0, "")
    assert (tmp_path / "larger/history.csv").read_bytes() == (tmp_path / "whole/history.csv").read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("away", ["series", "."])
def test_folders_that_vanish(away: str, mesh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a folder that is moved away in a run is a traceback, is made again, or what was in it is lost."""
    out, calls, mark = tmp_path / "out", 0, Observers.step

    def moved(self: Observers, *arguments: Any) -> None:
        nonlocal calls
        calls += 1
        if calls == 20:
            shutil.move(out / away, tmp_path / "elsewhere")
        mark(self, *arguments)

    monkeypatch.setattr(Observers, "step", moved)
    status, err = forked(["--mesh", mesh, "--out", out, "--event-time", "2e-5", "--frame-every", "1e-6",
                          "--checkpoint-every", "0.01", *SMALL])
    assert status == 2 and err.startswith("skfsink: cannot write ") and "No such file" in err, err
    monkeypatch.setattr(Observers, "step", mark)
    shutil.move(tmp_path / "elsewhere", out / away)
    assert forked(["--resume", out, "--quiet"]) == (0, "")
