"""Sweeps: what varies, every run once, nothing lost, one table and one picture."""

from __future__ import annotations

import contextlib
import csv
import json
import os
import shutil
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import psutil
import pytest
from matplotlib.figure import Figure
from PIL import Image
from plates import invoke_program, plate

import skfsink.run.compute
import skfsink.sweep.plan
from skfsink.errors import OutputError, ParameterError
from skfsink.meshing.vtu import write_mesh
from skfsink.results.history import History
from skfsink.scene.deck import Deck, read_deck
from skfsink.scene.registry import find_case
from skfsink.sweep.one import run_folder
from skfsink.sweep.plan import run_sweep
from skfsink.sweep.sweep_picture import draw
from skfsink.sweep.table import read_rows, read_units, write_csv, write_parquet
from skfsink.sweep.vary import combinations, read_variation, with_values

CASE = find_case("single_edge_notch")


@pytest.fixture
def deck(tmp_path: Path) -> Path:
    """Deck of a small plate whose event ends after 2 µs."""
    write_mesh(tmp_path / "plate.vtu", plate())
    path = tmp_path / "scene.toml"
    path.write_text('case = "single_edge_notch"\n[parameters]\nmesh = "plate.vtu"\nlength_scale = "0.6 mm"\n'
                    'event_time = "2 µs"\n')
    return path


# --- what varies ---
@pytest.mark.parametrize(("text", "name", "values"), [
    ("notch=1..3:5", "notch", [1, 1.5, 2, 2.5, 3]), ("mesh.seed=1..4", "mesh_seed", [1, 2, 3, 4]),
    ("mesh-seed=0..4:3", "mesh_seed", [0, 2, 4]), ("sink=lumped, consistent", "sink", ["lumped", "consistent"]),
    ("notch=1 mm..0.2 cm:2", "notch", [1, 2]), ("phi=100 kPa,0.2", "phi", [0.1, 0.2]),
    ("half=true,false", "half", [True, False]),
    ("m=5,10", "m", [5, 10]), ("deletion=1e-9,1e-3", "deletion", [1e-9, 1e-3])])
def test_variations(text: str, name: str, values: list[object]) -> None:
    """Fails if a range, a list or a unit is read otherwise than documented, or whole numbers become others."""
    found, read = (variation := read_variation(text, Deck(CASE.name, {}))).name, variation.values
    assert (found, read) == (name, pytest.approx(values) if isinstance(values[0], float) else values)
    assert CASE.parameters[name].kind is not int or all(isinstance(value, int) for value in read)


@pytest.mark.parametrize(("text", "said"), [
    ("notch", "NAME=A..B:N"), ("notches=1..2:3", "no such parameter"), ("notch=1..2:1", "2 to 10000"),
    ("notch=1..2.5", "whole numbers A <= B"), ("mesh.seed=3..1", "whole numbers"), ("sink=a..b", "no range"),
    ("notch=1 s..2:3", "expected [length]"), ("notch=1..2:1e9", "number of values"), ("out=a,b", "no such parameter"),
    ("notch=", "NAME=A..B:N"), ("mesh.seed=1..1000000000", "whole numbers")])
def test_what_cannot_vary(text: str, said: str) -> None:
    """Fails if a mistake passes, or the line does not say what is meant."""
    with pytest.raises(ParameterError) as error:
        read_variation(text, Deck(CASE.name, {}))
    assert said in str(error.value)


LAYERS = Deck("custom", {"mesh": "a.vtu", "material": "hgo", "constants": "angle = 30 degree, axis = [1, 0, 0]",
                         "regions": ({"name": "core.1", "material": "neo-hookean", "constants": "mu = 0.3 MPa"},)})


@pytest.mark.parametrize(("text", "name", "unit", "values", "changed"), [
    ("angle=0..90:4", "angle", "degree", [0, 30, 60, 90],
     {"constants": "axis = [1, 0, 0], angle = 90.0 degree"}),
    ("k2=1..3", "k2", "", [1, 2, 3], {"constants": "angle = 30 degree, axis = [1, 0, 0], k2 = 3.0"}),
    ("core.1.mu=100 kPa..1 MPa:2", "core.1.mu", "MPa", [0.1, 1],
     {"regions": ({"name": "core.1", "material": "neo-hookean", "constants": "mu = 1.0 MPa"},)}),
    ("core.1.phi=0.1,0.2", "core.1.phi", "MPa", [0.1, 0.2],
     {"regions": ({"name": "core.1", "material": "neo-hookean", "constants": "mu = 0.3 MPa", "phi": 0.2},)})])
def test_constants_of_laws_vary(text: str, name: str, unit: str, values: list[float], changed: dict[str, object]
                                ) -> None:
    """Fails if a constant of the body or of a region is not found, or something besides it changes in the deck."""
    found = read_variation(text, LAYERS)
    assert (found.name, found.what.unit, found.values) == (name, unit, pytest.approx(values))
    before = dict(LAYERS.parameters)
    assert with_values([found], {name: found.values[-1]}, LAYERS.parameters) == {**before, **changed}
    assert LAYERS.parameters == before


def test_the_length_of_a_crack_varies() -> None:
    """Fails if a sweep cannot change how long a crack of the deck is, by its name or as the only one."""
    cut = {"name": "cut", "points": [[0.0, 1.0], [2.0, 1.0]], "lips": "whole"}
    deck = Deck("custom", {"mesh": "a.vtu", "cracks": (cut,)})
    for name in "cut.length", "cracks.length":
        found = read_variation(f"{name}=1 mm..3 mm:3", deck)
        assert (found.what.unit, found.values) == ("mm", [1.0, 2.0, 3.0])
        assert with_values([found], {name: 3.0}, deck.parameters)["cracks"] == ({**cut, "length": 3.0},)
    with pytest.raises(ParameterError, match="numbers of cracks are width, length"):
        read_variation("cut.points=1,2", deck)


def test_a_number_of_one_of_several_tables_varies() -> None:
    """Fails if the angle of one layer of fibres changes that of another, or a layer is taken that was not named."""
    layers = {"region": "media", "azimuth": 30.0}, {"region": "adventitia", "azimuth": 60.0}
    deck = Deck("custom", {"mesh": "a.vtu", "fibres": layers})
    found = read_variation("fibres.2.azimuth=0..90:3", deck)
    assert (found.name, found.what.unit, found.values) == ("fibres.2.azimuth", "degree", [0.0, 45.0, 90.0])
    assert with_values([found], {found.name: 45.0}, deck.parameters)["fibres"] == (
        layers[0], {"region": "adventitia", "azimuth": 45.0})
    for name, said in (("fibres.azimuth", "has 2 tables [[fibres]]: say which, fibres.1.azimuth to fibres.2.azimuth"),
                       ("fibres.0.azimuth", "say which"), ("fibres.3.azimuth", "say which"),
                       ("fibres.media.azimuth", "say which"), ("fibres.1.array", "numbers of fibres are azimuth")):
        with pytest.raises(ParameterError) as error:
            read_variation(f"{name}=1,2", deck)
        assert said in str(error.value), error.value
    one = Deck("custom", {"mesh": "a.vtu", "fibres": layers[:1]})
    assert read_variation("fibres.1.azimuth=1,2", one).values == read_variation("fibres.azimuth=1,2", one).values
    with pytest.raises(ParameterError, match=r"has one table \[\[fibres\]\]: it is fibres.azimuth"):
        read_variation("fibres.2.azimuth=1,2", one)


@pytest.mark.parametrize(("text", "said"), [
    ("mu=1,2", "constants of hgo are c, k1, k2, kappa, angle, axis, normal"), ("axis=1,2", "it is a vector"),
    ("core.1.k2=1,2", "numbers of regions are phi, m, bulk_modulus, density, viscosity"),
    ("core.mu=1,2", "no such parameter"), ("grips.x=1,2", "no such parameter"), ("angle=a,b", "angle must be")])
def test_what_is_no_constant_of_the_deck(text: str, said: str) -> None:
    """Fails if a constant of another law passes, or the line does not say which there are."""
    with pytest.raises(ParameterError) as error:
        read_variation(text, LAYERS)
    assert said in str(error.value)


def test_combinations() -> None:
    """Fails if a combination is missing, or a parameter may vary twice, or a million runs are begun."""
    assert list(combinations([("a", [1, 2]), ("b", ["x", "y"])])) == [
        {"a": 1, "b": "x"}, {"a": 1, "b": "y"}, {"a": 2, "b": "x"}, {"a": 2, "b": "y"}]
    with pytest.raises(ParameterError, match="given twice"):
        list(combinations([("a", [1]), ("a", [2])]))
    with pytest.raises(ParameterError, match="at most 10000 runs"):
        list(combinations([("a", list(range(200))), ("b", list(range(200)))]))


# --- runs ---
def starts(out: Path) -> list[str]:
    """What the processes of all runs noted when they began."""
    return sorted(line for path in out.glob("*/starts.log") for line in path.read_text().split())


def table(out: Path) -> list[dict[str, str]]:
    with (out / "sweep.csv").open() as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_every_combination_once_a_table_and_a_picture(deck: Path, tmp_path: Path) -> None:
    """Fails if a run is missing or made twice, if one that fails stops the others, or is not named in the table."""
    out = tmp_path / "sweep"
    arguments = ("sweep", deck, "--vary", "phi=0.15,0.16,0.17", "--vary", "notch_width=0.1", "--out", out, "--quiet")
    (out / "phi=0.17,notch_width=0.1").mkdir(parents=True)
    (out / "phi=0.17,notch_width=0.1" / "run").write_text("in the way")  # the folder of the third cannot be made
    status, err, _ = invoke_program(*arguments, "--jobs", 2)
    assert status == 2 and err.startswith("skfsink: 1 of 3 runs of the sweep failed, first phi=0.17,notch_width=0.1: ")
    rows = table(out)
    assert [(row["phi"], row["folder"]) for row in rows] == [
        (phi, f"phi={phi},notch_width=0.1") for phi in ("0.15", "0.16", "0.17")]
    assert all(float(row["onset_load [N/mm]"]) > 0 for row in rows[:2])
    assert float(rows[0]["onset_displacement [mm]"]) < float(rows[1]["onset_displacement [mm]"])
    assert rows[2]["failure"]
    with Image.open(out / "sweep.png") as picture:
        assert picture.size[0] > 1000
    before = starts(out)
    assert before.count("begun") >= 2
    (out / "phi=0.17,notch_width=0.1" / "run").unlink()
    assert invoke_program(*arguments)[0] == 0  # only the third is left
    assert len(starts(out)) == len(before) + 1
    assert not any(row["failure"] for row in table(out))
    with pytest.raises(OutputError, match="another sweep"):
        deck.write_text(deck.read_text() + 'm = 9\n')
        run_sweep(deck, ["phi=0.15", "notch_width=0.1"], out, quiet=True)


def test_mistakes_are_found_before_anything_is_made(deck: Path, tmp_path: Path) -> None:
    """Fails if a sweep makes folders and only then finds that a value is out of range."""
    status, err, _ = invoke_program("sweep", deck, "--vary", "phi=0.1,-1", "--out", tmp_path / "sweep", "--quiet")
    assert status == 2
    assert "phi must be" in err and err.count("\n") == 1
    assert not (tmp_path / "sweep").exists()


def test_failed_runs_are_warned_of(tmp_path: Path) -> None:
    """Fails if Python gets rows without results in silence, or values by name are others than those of a text."""
    write_mesh(tmp_path / "a.vtu", plate())
    path = tmp_path / "sheet.toml"
    path.write_text('case = "custom"\n[parameters]\nmesh = "a.vtu"\nlength_scale = "0.6 mm"\nphi = "9 MPa"\n'
                    'stop = "displacement > 1e-3 mm"\n[[grips]]\nboundary = "top"\ny = 1\n'
                    '[[grips]]\nboundary = "bottom"\ny = 0\n')
    said = r"^1 of 2 runs of the sweep failed, first m=9,mesh=no.vtu: there is no mesh file .*no.vtu; they are rows"
    with pytest.warns(UserWarning, match=said):
        rows = run_sweep(str(path), {"m": [9], "mesh": ["a.vtu", "no.vtu"]}, str(tmp_path / "out"), quiet=True)
    assert [(row["m"], row["mesh"], bool(row["failure"])) for row in rows] == [
        (9.0, "a.vtu", False), (9.0, "no.vtu", True)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = run_sweep(path, ["m=9", "mesh=a.vtu"], tmp_path / "out", quiet=True)
    assert again == rows[:1]
    status, err, _ = invoke_program("sweep", path, "--vary", "mesh=no.vtu", "--out", tmp_path / "no", "--quiet")
    assert status == 2 and err.startswith("skfsink: 1 of 1 runs of the sweep failed") and err.count("\n") == 1
    assert len(table(tmp_path / "no")) == 1
    with pytest.raises(ParameterError, match="m varies over a list of values; got '9'"):
        run_sweep(path, {"m": "9"}, tmp_path / "never")


def test_picture_of_an_ensemble(tmp_path: Path) -> None:
    """Fails if seeds are not taken together, or a figure that is missing in a run breaks the picture."""
    random = np.random.default_rng(0)
    rows = [{"notch": notch, "mesh_seed": seed, "analysis": "dynamic", "U": random.normal(0.1, 0.01), "D": 0.04,
             "tip_speed": None if seed == 2 else 26.0, "branches": seed} for notch in (1.0, 2.0) for seed in (1, 2, 3)]
    for varied in (["notch", "mesh_seed"], ["mesh_seed"], ["sink"]):
        draw([{**row, "sink": "lumped"} for row in rows], varied, tmp_path / "sweep.png", read_units([]))
        assert (tmp_path / "sweep.png").stat().st_size > 10_000


def drawn(rows: list[dict[str, object]], varied: list[str], units: dict[str, str], path: Path,
          monkeypatch: pytest.MonkeyPatch) -> Figure:
    """The figure that a picture of a sweep was made from."""
    kept: list[Figure] = []
    monkeypatch.setattr("skfsink.sweep.sweep_picture.Figure", lambda *a, **k: kept.append(Figure(*a, **k)) or kept[-1])
    draw(rows, varied, path, {**read_units([]), **units})
    return kept[0]


def test_axes_have_units_and_panels_have_points(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if an axis lacks its unit, a figure that no run has gets a panel, or one below zero is cut off."""
    rows = [{"angle": angle, "analysis": "quasistatic", "U": 0.1, "tip_speed": None, "tear_angle": -angle}
            for angle in (0.0, 45.0)]
    axes = drawn(rows, ["angle"], {"angle": "degree"}, tmp_path / "sweep.png", monkeypatch).axes
    assert [(ax.get_xlabel(), ax.get_ylabel()) for ax in axes] == [
        ("angle [degree]", "U [N mm/mm]"), ("angle [degree]", "tear angle [degree]")]
    assert axes[1].get_ylim()[0] <= -45.0 and axes[0].get_ylim()[0] == 0.0
    still = [{"angle": angle, "analysis": "dynamic", "branches": 0} for angle in (0.0, 45.0)]
    assert drawn(still, ["angle"], {}, tmp_path / "still.png", monkeypatch).axes[0].get_ylim() == (0.0, 1.0)


def test_text_is_drawn_in_categories_and_what_else_varies_in_colours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch
                                                                     ) -> None:
    """Fails if the values of a text parameter are not the ticks, or runs that differ otherwise look alike."""
    rows = [{"sink": sink, "half": half, "analysis": "dynamic", "U": 0.1} for sink in ("nearest", "lumped")
            for half in (True, False)]
    figure = drawn(rows, ["sink", "half"], {}, tmp_path / "sweep.png", monkeypatch)
    assert [text.get_text() for text in figure.axes[0].get_xticklabels()] == ["lumped", "nearest"]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["dynamic, half True", "dynamic, half False"]
    assert [line.get_xdata().tolist() for line in figure.axes[0].lines if len(line.get_xdata())] == [
        [1.0, 0.0]] * 2


def test_parquet_has_the_same_table(tmp_path: Path) -> None:
    """Fails if a column, its unit or a missing figure is lost."""
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed (the sweep extra)")
    rows = [{"phi": 0.1, "U": 0.2, "failure": None}, {"phi": 0.2, "U": None, "failure": "why"}]
    write_parquet(rows, tmp_path / "sweep.parquet", read_units([]))
    assert parquet.read_table(tmp_path / "sweep.parquet").to_pylist() == [
        {"phi": 0.1, "U [N mm/mm]": 0.2, "failure": None}, {"phi": 0.2, "U [N mm/mm]": None, "failure": "why"}]


def test_units_are_those_of_the_bodies(tmp_path: Path) -> None:
    """Fails if the load on a body in space is told in N/mm, by the table or by a summary without units, or a sweep over
    both kinds does not say which unit is whose."""
    folders = []
    for name, dim, schema in (("old", 3, 1), ("new", 3, 2), ("plane", 2, 2)):
        folders.append(tmp_path / name)
        run = folders[-1] / "run"
        run.mkdir(parents=True)
        History(run / "history.csv", dim=dim)
        load, energy = ("N", "N mm") if dim == 3 else ("N/mm", "N mm/mm")
        key = "reaction_N" if (dim, schema) == (3, 2) else "reaction_N_per_mm"
        summary = {"case": "x", "analysis": "dynamic", "onset": {key: 7.0}, "energy": {"U_paper_at_arrival": 1.0}}
        if schema == 2:
            summary["warnings"] = ["one", "another"]
            summary["units"] = {"load": load, "energy": energy}
        (run / "summary.json").write_text(json.dumps(summary))
    for some, load, energy in ((folders[:1], "N", "N mm"), (folders[:2], "N", "N mm"), (folders[2:], "N/mm", "N mm/mm"),
                               (folders, "N/mm, in space N", "N mm/mm, in space N mm")):
        rows, units = read_rows(some, [{"seed": 1}] * len(some)), read_units(some)
        write_csv(rows, tmp_path / "sweep.csv", units)
        assert [row["warnings"] for row in rows] == [None if folder.name == "old" else 2 for folder in some]
        header = (tmp_path / "sweep.csv").read_text().splitlines()[0]
        assert next(csv.reader([header]))[2:5] == ["onset_displacement [mm]", f"onset_load [{load}]",
                                                   f"greatest_load [{load}]"]
        assert next(csv.reader([header]))[10:13] == ["onset_G [N/mm]", f"U [{energy}]", f"D [{energy}]"]
        assert [row["onset_load"] for row in rows] == [7.0] * len(some)


@pytest.mark.slow
def test_two_processes_in_one_folder(deck: Path, tmp_path: Path) -> None:
    """Fails if a run is made twice when two processes are given it at once."""
    folder = tmp_path / "one"
    folder.mkdir()
    (folder / "deck.toml").write_text(deck.read_text().replace("plate.vtu", str(tmp_path / "plate.vtu")))
    program = [sys.executable, "-m", "skfsink.sweep.one", str(folder)]
    both = [subprocess.Popen(program) for _ in range(2)]
    assert [process.wait() for process in both] == [0, 0]
    assert (folder / "starts.log").read_text() == "begun\n"
    run_folder(folder)
    assert (folder / "starts.log").read_text() == "begun\n"


# --- a scheduler whose workers are killed ---
@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[tuple[str, list[psutil.Process]]]:
    """Address of a Dask scheduler in a process of its own, and two more whose children are workers.

    A worker that dies is started again.
    """
    pytest.importorskip("distributed", reason="Dask is not installed (the sweep extra)")
    place = tmp_path / "scheduler.json"
    common = ["--scheduler-file", str(place), "--no-dashboard"]
    environment = {**os.environ, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "10"}

    def begin(kind: str, *arguments: str) -> psutil.Process:
        program = f"from distributed.cli.dask_{kind} import main; main()"
        child = subprocess.Popen([sys.executable, "-c", program, *common, *arguments], env=environment,
                                 stderr=subprocess.DEVNULL)
        return psutil.Process(child.pid)

    processes = [begin("scheduler", "--host", "127.0.0.1", "--port", "0")]
    processes += [begin("worker", "--nthreads", "1", "--local-directory", str(tmp_path / f"worker{i}")) for i in (0, 1)]
    try:
        for _ in range(300):
            if place.is_file() and place.stat().st_size:
                break
            time.sleep(0.1)
        yield json.loads(place.read_text())["address"], processes[1:]
    finally:
        for process in processes:
            for child in [*process.children(recursive=True), process]:
                with contextlib.suppress(psutil.NoSuchProcess):
                    child.kill()
            process.wait()


def running(nurses: list[psutil.Process]) -> list[tuple[psutil.Process, psutil.Process]]:
    """Workers that have a run going on, and that run."""
    found = []
    for nurse in nurses:
        with contextlib.suppress(psutil.NoSuchProcess):
            for worker in nurse.children():
                found += [(worker, child) for child in worker.children() if "skfsink.sweep.one" in child.cmdline()]
    return found


@pytest.mark.slow
def test_a_worker_that_is_killed_loses_nothing_and_repeats_nothing(
        deck: Path, tmp_path: Path, scheduler: tuple[str, list[psutil.Process]]) -> None:
    """Fails if a run is lost with the worker that was given it, or is made a second time."""
    out, (address, nurses) = tmp_path / "sweep", scheduler
    deck.write_text(deck.read_text().replace("2 µs", "120 µs"))
    sweep = subprocess.Popen([sys.executable, "-m", "skfsink", "sweep", str(deck), "--vary", "phi=0.14..0.17:4",
                              "--out", str(out), "--scheduler", address, "--quiet"])
    killed, deadline = 0, time.monotonic() + 400
    while sweep.poll() is None and time.monotonic() < deadline:
        pairs = running(nurses)
        if killed < 2 and pairs and len(list(out.glob("*/run/scene.toml"))) > 2 * killed:  # one that can be resumed
            worker, run = pairs[0]
            worker.kill()
            if killed == 0:
                run.kill()  # the first with its run; the second leaves that alone
            killed += 1
        time.sleep(0.2)
    assert sweep.wait(timeout=10) == 0
    assert killed == 2
    rows = table(out)
    assert len(rows) == 4
    assert all(row["onset_load [N/mm]"] and not row["failure"] for row in rows)
    assert starts(out).count("begun") == 4
    assert starts(out).count("resumed") == 1


def test_a_sweep_goes_on_elsewhere(deck: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a sweep that was moved is taken for another one, needs the mesh of begun runs, or takes another mesh."""
    here, far = tmp_path / "here", tmp_path / "far"
    here.mkdir(), far.mkdir()
    for name in ("plate.vtu", "scene.toml"):
        shutil.move(tmp_path / name, here / name)
    monkeypatch.setattr(skfsink.sweep.plan, "here", lambda folders, jobs: (folder for folder in ()))
    run_sweep(here / "scene.toml", ["phi=0.15,0.16"], here / "sweep", quiet=True)
    run_folder(here / "sweep" / "phi=0.15")
    first = (here / "sweep" / "phi=0.15" / "run" / "history.csv").read_bytes()
    (here / "sweep" / "phi=0.15" / "run" / "summary.json").unlink()  # it has its last pictures to draw
    shutil.copytree(here / "sweep", far / "sweep")
    for name in ("plate.vtu", "scene.toml"):
        shutil.move(here / name, far / name)
    run_sweep(far / "scene.toml", ["phi=0.15,0.16"], far / "sweep", quiet=True)
    for name in ("phi=0.15", "phi=0.16"):
        run_folder(far / "sweep" / name)
        assert not (far / "sweep" / name / "failure.txt").exists()
    assert (far / "sweep" / "phi=0.15" / "run" / "history.csv").read_bytes() == first
    assert starts(far / "sweep") == ["begun", "begun", "resumed"]
    mesh = plate()
    mesh.points[30, 0] += 1e-9
    write_mesh(far / "plate.vtu", mesh)
    shutil.move(far / "plate.vtu", tmp_path / "plate.vtu")
    shutil.move(far / "scene.toml", tmp_path / "scene.toml")
    with pytest.raises(OutputError, match=r"holds a run on another mesh than .*plate\.vtu; choose another --out"):
        run_sweep(tmp_path / "scene.toml", ["phi=0.15,0.16"], far / "sweep", quiet=True)
    (tmp_path / "scene.toml").write_text((tmp_path / "scene.toml").read_text().replace("2 µs", "3 µs"))
    with pytest.raises(OutputError, match="another sweep"):
        run_sweep(tmp_path / "scene.toml", ["phi=0.15,0.16"], far / "sweep", quiet=True)


# --- the ensemble that is shipped ---
ENSEMBLE = Path(__file__).resolve().parents[1] / "cases" / "single_edge_notch" / "ensemble"


def test_the_ensemble_is_what_its_page_says(tmp_path: Path) -> None:
    """Fails if a figure of the page is not that of the table, or the deck is not of fifty meshes of one size."""
    with (ENSEMBLE / "sweep.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["mesh_seed"]) for row in rows] == list(range(1, 51)) and not any(row["failure"] for row in rows)
    assert read_deck(ENSEMBLE / "scene.toml").parameters == {"mesh": "M3"}
    page = (ENSEMBLE / "README.md").read_text(encoding="utf-8")
    lines = [line.strip("| ").split(" | ") for line in page.splitlines() if line.startswith("| ")][1:]
    columns = ("U [N mm/mm]", "D [N mm/mm]", "tip_speed [m/s]", "branches", "onset_displacement [mm]")
    assert len(lines) == len(columns)
    for column, (_, *shown) in zip(columns, lines):
        values = np.array([float(row[column]) for row in rows])
        for text, value in zip(shown, (values.mean(), values.std(ddof=1), values.min(), values.max())):
            assert abs(float(text) - value) <= 0.51 * 10.0 ** -len(text.partition(".")[2]), (column, text, value)


def test_an_ensemble_is_drawn_against_its_seeds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if figures of an ensemble are not drawn over the band of their mean and standard deviation."""
    drawn: list[tuple[float, float]] = []
    monkeypatch.setattr("matplotlib.axes.Axes.axhspan", lambda _, low, high, **__: drawn.append((low, high)))
    rows = [{"mesh_seed": i, "analysis": "dynamic", "U": 1.0 + i, "D": 1.0, "tip_speed": 2.0, "branches": i}
            for i in range(3)]
    draw(rows, ["mesh_seed"], tmp_path / "sweep.png", read_units([]))
    assert drawn[0] == pytest.approx((1.0, 3.0)) and len(drawn) == 4
    assert (tmp_path / "sweep.png").stat().st_size > 10_000


@pytest.mark.parametrize("name", ["run.lock", "starts.log"])
def test_files_of_a_run_that_cannot_be_written_are_one_line(name: str, tmp_path: Path) -> None:
    """Fails if a folder of a sweep that cannot be written to is a traceback in its process."""
    (tmp_path / "deck.toml").write_text('case = "simple_shear"\n')
    (tmp_path / name).mkdir()
    with pytest.raises(OutputError, match=rf"cannot write .*{name}: Is a directory"):
        run_folder(tmp_path)
