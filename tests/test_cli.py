"""The command line: bad input is one line and touches nothing; help, version, and the files a run leaves."""

from __future__ import annotations

import json
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
import pytest
from PIL import Image
from plates import SMALL, contents, invoke, plate
from rich.cells import cell_len

from skfsink import __version__
from skfsink.meshing.vtu import write_mesh
from skfsink.results.history import History
from skfsink.scene.options import Options

PROGRAM = [sys.executable, "-m", "skfsink.cases.single_edge_notch"]
POSITIVE = ["side", "notch", "notch-width", "c1", "bulk-modulus", "m", "length-scale", "density", "speed",
            "hht-dt", "courant", "overshoot", "deletion", "event-time", "record-every", "frame-every",
            "balance-tolerance", "checkpoint-every"]
OR_ZERO = ["c2", "phi", "gamma-every", "force-floor", "mass-floor", "aftermath", "mesh-seed", "threads"]


def refused(tmp_path: Path, *arguments: object) -> str:
    """The line that refuses these arguments: the only one, with exit status 2, and no file was touched."""
    before = contents(tmp_path)
    status, err, out = invoke(*arguments)
    assert (status, out, err.count("\n")) == (2, "", 1) and err.startswith("skfsink: "), (status, out, err)
    assert contents(tmp_path) == before
    return err


@pytest.mark.parametrize("name", [*POSITIVE, *OR_ZERO, "hht-alpha"])
def test_numbers_out_of_range(name: str, tmp_path: Path) -> None:
    """Fails if a number is used unchecked, or the line does not say which one, what it was, and what is allowed."""
    bad = {"-1": "-1", "nan": "nan", "inf": "inf", "abc": "'abc'"}
    if name not in OR_ZERO and name != "hht-alpha":
        bad["0"] = "0"
    for text, shown in bad.items():
        line = refused(tmp_path, "--out", tmp_path / "out", f"--{name}", text)
        assert line.startswith(f"skfsink: {name.replace('-', '_')} must be a ") and " number in " in line
        assert shown in line.partition("; got ")[2]


@pytest.mark.parametrize("arguments, parts", [
    (["--hht-alpha", "-0.34"], ["hht_alpha", "[-0.333333, 0]", "-0.34"]),
    (["--hht-alpha", "0.01"], ["hht_alpha", "[-0.333333, 0]", "0.01"]),
    (["--courant", "1.01"], ["courant", "(0, 1]", "1.01"]),
    (["--m", "0.99"], ["m must", "[1, inf)", "0.99"]),
    (["--mass-floor", "1"], ["mass_floor", "[0, 1)", "got 1"]),
    (["--overshoot", "0.2"], ["overshoot", "(0, 0.1]", "0.2"]),
    (["--threads", "1.5"], ["threads", "whole", "[0, 256]", "1.5"]),
    (["--notch", "4"], ["notch", "(0.05, 4) mm", "got 4"]),
    (["--side", "0.5"], ["notch", "0.5", "got 1"]),
    (["--analysis", "static"], ["analysis", "dynamic, quasistatic, both", "'static'"]),
    (["--integrator", "euler"], ["integrator", "explicit, hht", "'euler'"]),
    (["--gradient", "vertex"], ["gradient", "monotone, gauss", "'vertex'"]),
    (["--sink", "heavy"], ["sink", "lumped, consistent, nearest", "'heavy'"]),
    (["--element", "q8"], ["element", "jbar, plain", "'q8'"]),
    (["--coupling", "none"], ["coupling", "iterated, single", "'none'"]),
    (["--mass", "none"], ["mass", "lumped, consistent", "'none'"]),
    (["--mesh", "M9"], ["mesh", "M3, M3-mirror, M4, M5, coarse", "'M9'"]),
    (["--mesh", "nowhere.vtu"], ["no mesh file", "nowhere.vtu"]),
    (["--mesh", "a.vtu", "--side", "5"], ["side", "M3", "a.vtu"]),
    (["--colour", "red"], ["--colour"]), (["stray"], ["stray"]), (["--c1"], ["--c1"]),
    (["--c1", "1", "--c1", "2"], ["--c1", "multiple"]), (["--quiet", "2"], ["2"]),
])
def test_words_flags_and_limits(arguments: list[str], parts: list[str], tmp_path: Path) -> None:
    """Fails if a wrong word or flag passes, is a traceback, or if the line hides what would be right."""
    line = refused(tmp_path, "--out", tmp_path / "out", *arguments)
    assert all(part in line for part in parts), line


def _broken(change: Callable[[meshio.Mesh], None]) -> meshio.Mesh:
    mesh = plate()
    change(mesh)
    return mesh


def _triangles(mesh: meshio.Mesh) -> None:
    mesh.cells[0] = meshio.CellBlock("triangle", mesh.cells[0].data[:, :3])


def _bow_tie(mesh: meshio.Mesh) -> None:
    mesh.cells[0].data[3] = mesh.cells[0].data[3, [0, 2, 1, 3]]


def _nan(mesh: meshio.Mesh) -> None:
    mesh.points[7, 1] = np.nan


def _empty(mesh: meshio.Mesh) -> None:
    mesh.cells, mesh.cell_sets = mesh.cells[1:], {}


def _beyond(mesh: meshio.Mesh) -> None:
    mesh.cells[0].data[0, 0] = 10**6


@pytest.mark.parametrize("change, part", [
    (_triangles, "triangle"), (_bow_tie, "element 3 is inverted"),
    (_nan, "not finite"), (_empty, "quadrilaterals"),
    (_beyond, "nodes that do not exist"), *((lambda mesh, name=name: mesh.cell_sets.pop(name), f"no boundary '{name}'")
                                            for name in ("top", "bottom"))])
def test_meshes_that_cannot_be_used(change: Callable[[meshio.Mesh], None], part: str, tmp_path: Path) -> None:
    """Fails if a bad mesh is computed on, ends in a traceback, or is noticed after the old results are gone."""
    write_mesh(tmp_path / "bad.vtu", _broken(change))
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "checkpoint.npz").write_text("results of last year")
    for analysis in ("dynamic", "both"):
        line = refused(tmp_path, "--mesh", tmp_path / "bad.vtu", "--out", tmp_path / "out", "--overwrite", "--analysis",
                       analysis)
        assert part in line and "bad" in line


@pytest.mark.parametrize("name", ["half.vtu", "garbage.vtu", "nothing.vtu", "garbage.msh", "garbage.inp", "plate.abc"])
def test_mesh_files_that_cannot_be_read(name: str, mesh: Path, tmp_path: Path) -> None:
    """Fails if what meshio raises or prints gets out."""
    whole = mesh.read_bytes()
    content = {"half": whole[:len(whole) // 2], "nothing": b"", "plate": whole}.get(name[:-4], bytes(range(256)) * 40)
    (tmp_path / name).write_bytes(content)
    line = refused(tmp_path, "--mesh", tmp_path / name, "--out", tmp_path / "out")
    assert name in line and "cannot be read" in line


def test_output_folders_that_cannot_be_used(mesh: Path, tmp_path: Path) -> None:
    """Fails if results would be written where they cannot be, or over what is there."""
    (tmp_path / "file").write_text("mine")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").write_text("mine")
    for out, part in (("file", "is a file"), ("file/below", "Not a directory"), ("full", "not empty"),
                      ("long" * 99, "name too long"), ("/proc/none", "/proc/none")):
        for analysis in ("dynamic", "both"):
            assert part in refused(tmp_path, "--mesh", mesh, "--out", tmp_path / out, "--analysis", analysis, *SMALL)


@pytest.mark.parametrize("columns", ["80", "120"])
def test_help_shows_every_flag_with_unit_and_range(columns: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if an option is not shown, loses its unit or range, or a line does not fit the terminal."""
    monkeypatch.setenv("COLUMNS", columns)
    status, err, out = invoke("--help")
    assert (status, err) == (0, "") and max(map(cell_len, out.splitlines())) <= int(columns)
    text = " ".join(out.replace("│", " ").split())
    inner = {"given-names", "corridor", "kept-mesh", "observers"}
    flags = {name.replace("_", "-") for name in Options.__dataclass_fields__} - inner
    flags |= {"side", "notch", "notch-width", "mesh", "mesh-seed", "help", "version"}
    after = {flag: text.partition(f"--{flag} ")[2].partition(" --")[0] for flag in flags}
    assert all(after.values()), [flag for flag, found in after.items() if not found]
    for flag in (*POSITIVE, *OR_ZERO, "hht-alpha"):
        assert any(sign in after[flag] for sign in ("> ", ">= ", "in (", "in [", "other than 0")), after[flag]
        assert "default:" in after[flag]
    units = {"side": "[mm]", "speed": "[mm/s]", "phi": "[MPa]", "density": "[kg/m^3]", "hht-dt": "[s]"}
    assert all(unit in after[flag] for flag, unit in units.items())
    groups = ["Sample", "Model", "Material", "Sink", "Loading", "Analysis", "Explicit", "HHT", "Controls", "Output"]
    places = [out.index(f"─ {group}") for group in groups]
    assert places == sorted(places)


def test_as_a_program(tmp_path: Path) -> None:
    """Fails if `python -m` differs from what the other tests call: status, streams, no traceback."""
    done = subprocess.run([*PROGRAM, "--phi", "-1"], capture_output=True, text=True, cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (
        2, "", "skfsink: phi must be a finite number in (0, inf) MPa; got -1.0\n")
    assert not list(tmp_path.iterdir())
    assert invoke("--version") == (0, "", f"skfsink {__version__}\n")


def test_mesh_of_other_dimensions_needs_gmsh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if an optional package that is not there is a traceback."""
    monkeypatch.setitem(sys.modules, "gmsh", None)
    for arguments in (["--side", "3"], ["--mesh-seed", "1"]):
        assert "needs gmsh" in refused(tmp_path, "--mesh", "coarse", "--out", tmp_path / "out", *arguments)


def test_what_should_not_happen_is_one_line_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a mistake in the program, or an absurd parameter that overflows, prints a traceback unasked."""
    monkeypatch.delenv("SKFSINK_DEBUG")
    monkeypatch.setattr(Options, "sink_law", lambda _: 1e200**2)
    status, err, _ = invoke("--mesh", "coarse", "--out", tmp_path / "out")
    assert status == 1 and err.startswith("skfsink: OverflowError: ") and err.count("\n") == 1


def check_files(folder: Path, summary: dict[str, object]) -> None:
    """Every file of one finished run is there, can be read, and agrees with the summary."""
    assert json.loads((folder / "summary.json").read_text()) == summary
    names = {"animation.gif", "checkpoint.npz", "density.png", "energies.png", "history.csv", "onset.npz", "scene.toml",
             "summary.json", "tip.png"}
    assert names - {"onset.npz"} <= {p.name for p in folder.iterdir()}
    for name in ("density.png", "energies.png", "tip.png", "animation.gif"):
        with Image.open(folder / name) as picture:
            picture.load()
            assert min(picture.size) > 100
    frames = [entry.attrib["file"] for name in ("run", "loading")
              for entry in ET.parse(folder / "series" / f"{name}.pvd").iter("DataSet")]
    assert sorted(p.name for p in folder.glob("series/*")) == sorted(["run.pvd", "loading.pvd", *frames])
    for frame in frames:
        assert set(meshio.read(folder / "series" / frame).point_data) == {"displacement", "velocity", "gamma"}
    assert History.load(folder / "history.csv")["deleted_elements"][-1] == summary["deleted_elements"]
    assert not list(folder.rglob(".*"))


@pytest.mark.slow
def test_files_of_both_analyses(mesh: Path, tmp_path: Path, pictures: None) -> None:
    """Fails if a file is missing, a key of schema 3 is, or a separated plate is not reported as such."""
    out = tmp_path / "a [b] c"  # a name that is markup to rich
    status, err, _ = invoke("--mesh", mesh, "--out", out, "--analysis", "both", "--frame-every", "2e-5", *SMALL)
    assert (status, err) == (0, "")
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["schema"], summary["case"], summary["mesh"]) == (3, "single_edge_notch", "plate")
    assert (out / "comparison.png").is_file() and (out / "scene.toml").is_file()
    for analysis in ("dynamic", "quasistatic"):
        part = summary[analysis]
        check_files(out / analysis, part)
        assert set(part) >= {"schema", "case", "mesh", "analysis", "integrator", "elements", "dofs", "units", "onset",
                             "event", "energy", "deleted_elements", "cost", "versions", "assumed"}
        assert set(part["onset"]) >= {"displacement_mm", "reaction_N_per_mm", "elastic_energy"}
        assert set(part["event"]) >= {"first_arrival_s", "mean_tip_speed_m_per_s", "max_branches", "separated"}
        assert set(part["energy"]) >= {
            "U_paper_at_arrival", "U_paper_final", "D_sink_final", "elastic_final", "kinetic_final", "external_work",
            "numerical", "released", "balance_error_relative"}
        assert set(part["cost"]) >= {"wall_s", "steps", "gamma_solves", "factorisations", "peak_rss_mb"}
        assert set(part["cost"]["wall_s"]) == {"loading", "event", "output"}
        assert part["event"]["separated"] and part["event"]["max_branches"] == 1 and part["assumed"]
        assert part["onset"] == summary["dynamic"]["onset"]
    assert summary["dynamic"]["event"]["first_arrival_s"] > 1e-5


def test_event_too_short_for_a_crack(mesh: Path, tmp_path: Path, pictures: None) -> None:
    """Fails if pictures or summary need a crack: none has started when the event ends."""
    out = tmp_path / "out"
    status, err, _ = invoke("--mesh", mesh, "--out", out, "--event-time", "1e-9", *SMALL)
    assert (status, err) == (0, "")
    summary = json.loads((out / "summary.json").read_text())
    check_files(out, summary)
    assert summary["event"]["first_arrival_s"] is None and summary["event"]["mean_tip_speed_m_per_s"] is None
    assert summary["energy"]["U_paper_at_arrival"] is None and summary["event"]["max_branches"] == 0
    assert not summary["event"]["separated"] and summary["deleted_elements"] == 0
