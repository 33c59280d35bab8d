"""Memory that is not there, full disks, vanished folders, signals at bad moments: one line, and nothing lost."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import skfem
from plates import SMALL, contents, invoke, plate

import skfsink.memory
from skfsink.memory import LIMIT, available, estimate, factor_entries
from skfsink.meshing import write_mesh
from skfsink.run import read_scene
from skfsink.space import Space

REFERENCES = sorted((Path(__file__).resolve().parents[1] / "cases").glob("*/reference/*/summary.json"))


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    """File of the small plate."""
    write_mesh(tmp_path / "plate.vtu", plate())
    return tmp_path / "plate.vtu"


# --- memory ---
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
        return factor_entries(Space(skfem.MeshHex.init_tensor(*[np.linspace(0, c, c + 1) for c in counts])))

    assert 1.25 < np.log2(entries(16, 16, 16) / entries(8, 8, 8)) / 3 < 1.6
    assert 1.0 < np.log2(entries(32, 32, 2) / entries(16, 16, 2)) / 2 < 1.3
    measured = 186e6 / 8 / 9  # PARDISO's factor of the elastic matrix on 22 x 22 x 22 elements, for 3 x 3 blocks
    assert entries(22, 22, 22) == pytest.approx(measured, rel=0.25)


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
    monkeypatch.setattr(skfsink.memory, "_groups", lambda: [tmp_path])
    (tmp_path / "memory.current").write_text("1000000\n")
    (tmp_path / "memory.max").write_text("max\n")
    assert available() == pytest.approx(free, rel=0.5)
    (tmp_path / "memory.max").write_text("1000001\n")
    assert available() < 5.0  # what this process has already


def test_a_large_run_says_what_it_needs(mesh: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if the estimate is not shown before a run that needs much."""
    monkeypatch.setattr(skfsink.memory, "WORTH_SAYING", 0.1)
    status, err, _ = invoke("--mesh", mesh, "--out", tmp_path / "out", "--event-time", "1e-9", *SMALL[:-1])
    assert status == 0 and "the run will need about 0.4 GB of memory; there are" in err
