"""The figures: each is drawn from references alone, runs are made once and resumed, and what is missing is said."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import matplotlib
import numpy as np
import pytest
from cyclopts import App
from PIL import Image
from references import FIGURES, fill, scene_of

import skfsink
from skfsink.errors import OutputError, ParameterError
from skfsink.pictures import plot
from skfsink.results import reference

for name in ("compute", "everything", "layout", "redraw", "runs", "sketch", "spread"):
    importlib.import_module(name)
compute, everything, layout, redraw, runs, sketch, spread = (sys.modules[name] for name in (
    "compute", "everything", "layout", "redraw", "runs", "sketch", "spread"))
DPI = 60
WITH_TABLE = ("table1", "energies", "spread", "front")
SOLID = ("fig08_dog_bone", "fig10_cylindrical_shell", "fig11_quasistatic")


@pytest.fixture(scope="session")
def references(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Made-up references of all runs, and tables of all scans."""
    folder = tmp_path_factory.mktemp("cases")
    fill(folder, tmp_path_factory.mktemp("runs"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reference, "reference_folder", lambda case, key="": folder / case / "reference" / key)
        for i, scan in enumerate((*runs.SCANS, *runs.TRIED, *runs.FRONTS, runs.OVERDAMPED)):
            for j, point in enumerate(scan.points):
                spread.append(scan, point, dict.fromkeys(spread.RESULTS, 0.03 + 0.001 * (i + j)))
    return folder


@pytest.fixture
def home(references: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(reference, "reference_folder", lambda case, key="": references / case / "reference" / key)
    return references


@pytest.fixture
def nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """No reference at all, and runs below a temporary folder."""
    monkeypatch.setattr(reference, "reference_folder", lambda case, key="": tmp_path / case / "reference" / key)
    monkeypatch.setattr(compute, "ROOT", tmp_path)
    monkeypatch.setattr(spread, "ROOT", tmp_path)
    return tmp_path


# --- drawing ---
@pytest.mark.slow
@pytest.mark.parametrize("name", [*runs.FIGURES, "spread", "front"])
def test_every_figure_is_drawn_from_references(name: str, home: Path, tmp_path: Path,
                                               monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a script asks for a run, a frame or a number that is not stored, or writes something else."""
    if name in SOLID:
        pytest.importorskip("pyvista")
    module = importlib.import_module(name)
    monkeypatch.setattr(layout, "DPI", DPI)
    if "solids" in sys.modules:
        monkeypatch.setattr(sys.modules["solids"], "DPI", DPI)
    with matplotlib.rc_context(plot.STYLE):
        module.draw(tmp_path / f"{name}.png")
    written = {path.name for path in tmp_path.iterdir()}
    tables = {f"{name}.md"} if name in WITH_TABLE else set()
    assert written == {f"{name}.png"} | tables | ({"dimensions.md"} if name == "spread" else set())
    picture = np.asarray(Image.open(tmp_path / f"{name}.png").convert("RGB")).astype(int)
    assert picture.shape[1] in (round(layout.WIDTH * DPI), round(3.4 * DPI))
    assert 0.02 < (picture.sum(axis=2) < 740).mean() < 0.9
    if name.startswith("fig"):  # a crack, and what is intact beside it
        assert (picture.sum(axis=2) < 250).mean() > 0.002
    # nothing reaches over the rim
    assert (picture[[0, -1]].sum(axis=2) > 600).all() and (picture[:, [0, -1]].sum(axis=2) > 600).all()


def test_the_list_of_figures_is_that_of_the_scripts() -> None:
    scripts = {path.stem for path in FIGURES.glob("*.py") if path.stem.startswith("fig") or "def draw(" in
               path.read_text(encoding="utf-8")}
    assert scripts == {*runs.FIGURES, "spread", "front"}
    known = {run.name for run in runs.RUNS}
    assert len(known) == len(runs.RUNS)
    assert all(need in known for needs in runs.FIGURES.values() for need in needs)


@pytest.mark.parametrize("run", runs.RUNS, ids=lambda run: run.name)
def test_the_command_lines_of_the_runs_are_understood(run: Any) -> None:
    """Fails if a run has an option or a mesh that its case does not have, or keeps a frame that means nothing."""
    case = getattr(importlib.import_module(f"skfsink.cases.{run.case}"), run.case)
    app = App()
    app.default(case)
    _, bound, _ = app.parse_args(list(run.arguments), exit_on_error=False, print_error=False)
    mesh = bound.arguments["mesh"]
    assert (Path(skfsink.__file__).parents[1] / "cases" / run.case / "meshes" / f"{mesh}.vtu").is_file()
    assert set(run.velocity) <= set(run.frames)
    for phrase in run.frames:
        event = {"time_s": np.arange(2.0), "step": np.arange(2), "crack_length_mm": np.arange(2.0)}
        reference.pick_frame(phrase, {}, [0.0, 1.0], event)


def test_outlines_of_the_samples_are_closed() -> None:
    """Fails if an outline is torn, or misses a hole: its area is that of the mesh."""
    for case in ("single_edge_notch", "asymmetric_double_edge_notch", "dog_bone"):
        scene = scene_of(case)
        space = scene.sample.space
        outline = sketch.loops(space)
        assert len(outline) == 1 and all(np.array_equal(loop[0], loop[-1]) for loop in outline)
        x, y = outline[0].T
        area = abs(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])) / 2
        assert area * scene.parameters.get("thickness", 1.0) == pytest.approx(space.V.sum())


def test_a_figure_that_is_too_large_gets_coarser_colours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    figure = matplotlib.figure.Figure((2, 2))
    figure.add_axes((0.2, 0, 0.8, 1)).imshow(np.random.default_rng(0).uniform(size=(300, 300, 3)))
    layout.save(figure, tmp_path / "a.png")
    monkeypatch.setattr(layout, "LARGEST", (tmp_path / "a.png").stat().st_size * 3 // 4)
    layout.save(figure, tmp_path / "b.png")
    assert (tmp_path / "b.png").stat().st_size < layout.LARGEST
    fine, coarse = (np.asarray(Image.open(tmp_path / f"{name}.png")).astype(int) for name in "ab")
    assert 0 < np.abs(fine - coarse).max() <= 4 and (coarse[:, 0] == 255).all()


# --- the commands ---
def test_redraw_leaves_out_what_has_no_reference(nowhere: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert redraw.main(only=("fig05", "dog_bone"), out=nowhere) == 1
    said = capsys.readouterr()
    assert not said.out and not list(nowhere.glob("*.png"))
    assert "fig05_simple_shear is left out: case simple_shear has no reference result paper-dynamic" in said.err
    assert len(said.err.splitlines()) == 4  # figures 5, 8, 11 and the energies
    with pytest.raises(ParameterError, match="--only must be one of"):
        redraw.select(("fig99",))


@pytest.mark.slow
def test_redraw_draws_what_there_is(home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(layout, "DPI", DPI)
    assert redraw.main(only=("table1",), out=tmp_path) == 0
    assert (tmp_path / "table1.png").is_file()
    assert redraw.select(()) == list(runs.FIGURES)
    assert redraw.select(("simple_shear",)) == ["fig05_simple_shear", "fig11_quasistatic", "energies"]


@pytest.mark.slow
def test_a_script_by_itself_says_what_it_does() -> None:
    for script in ("redraw.py", "spread.py", "table1.py"):
        done = subprocess.run([sys.executable, str(FIGURES / script), "--help"], capture_output=True, text=True,
                              check=False)
        assert done.returncode == 0 and "--out" in done.stdout


class Runner:
    """Stands for `subprocess.run`: notes the commands, and leaves what a run would."""

    def __init__(self, status: int = 0) -> None:
        self.status, self.commands = status, []

    def __call__(self, command: list[str], stdout: Any, **_: Any) -> SimpleNamespace:
        self.commands.append(command)
        folder = Path(command[command.index("--resume" if "--resume" in command else "--out") + 1])
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "scene.toml").write_text("")
        if self.status:
            stdout.write("skfsink: some reason\n")
        else:
            part = {"elements": 7, "event": {"max_branches": 2, "first_arrival_s": 1e-4, "first_arrival_pass": None,
                                             "mean_tip_speed_m_per_s": 25.0}, "cost": {"steps": 100},
                    "onset": {"displacement_mm": 0.12, "elastic_energy": 0.05}, "energy": {
                "external_work": 0.04, **{f"{name}_{when}": 0.03 for name in ("U_paper", "D_sink")
                                          for when in ("at_arrival", "final")}}}
            (folder / "summary.json").write_text(json.dumps({"case": "x", "analysis": "both", "dynamic": part,
                                                             "quasistatic": part}))
        return SimpleNamespace(returncode=self.status)


def test_a_run_is_made_once_and_resumed(nowhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if an interrupted run begins anew, a finished one runs again, or one with other arguments is taken."""
    folder = nowhere / "results" / "key"
    broken = Runner(2)
    monkeypatch.setattr(compute.subprocess, "run", broken)
    with pytest.raises(OutputError, match=r"simple_shear --mesh coarse ended with status 2: skfsink: some reason"):
        compute.finish("simple_shear", ["--mesh", "coarse"], folder)
    assert broken.commands[0][1:] == ["-m", "skfsink.cases.simple_shear", "--mesh", "coarse", "--out", str(folder),
                                      "--overwrite", "--quiet"]
    good = Runner()
    monkeypatch.setattr(compute.subprocess, "run", good)
    for _ in range(3):
        compute.finish("simple_shear", ["--mesh", "coarse"], folder)
    assert len(good.commands) == 1 and good.commands[0][5:] == ["--resume", str(folder), "--quiet"]
    with pytest.raises(OutputError, match="holds a run of simple_shear --mesh coarse, and not of"):
        compute.finish("simple_shear", ["--mesh", "M4"], folder)


def test_compute_stores_what_it_has_run(nowhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compute.subprocess, "run", Runner())
    kept: list[tuple[Any, ...]] = []
    monkeypatch.setattr(reference, "store", lambda *arguments: kept.append(arguments))
    chosen = [run for run in runs.RUNS if run.case == "dog_bone"]
    assert compute.compute(chosen, 2) == []
    assert {(target.name, frames, velocity) for _, target, frames, velocity in kept} == {
        (run.key, run.frames, run.velocity) for run in chosen if run.key != runs.COARSE}
    assert reference.load_coarse("dog_bone")["analysis"] == "both"
    monkeypatch.setattr(compute.subprocess, "run", Runner(1))
    assert len(compute.compute([run for run in runs.RUNS if run.case == "simple_shear"], 1)) == 3


# --- everything ---
def test_everything_runs_its_steps_and_copies_what_they_leave(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a step is left out, goes on after one that failed, or its files are not where the pages have them."""
    done: list[tuple[str, ...]] = []
    monkeypatch.setattr(everything, "ROOT", tmp_path)

    def fake(command: list[str], **_: Any) -> SimpleNamespace:
        done.append(tuple(command[1:]))
        for step in everything.STEPS.values():
            if step.arguments == tuple(command[1:][:len(step.arguments)]):
                for name, place in step.copies.items():
                    (tmp_path / step.folder / name).parent.mkdir(parents=True, exist_ok=True)
                    (tmp_path / step.folder / name).write_text(f"{step.name}/{name}")
                    (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
        return SimpleNamespace(returncode=3 if "figures/front.py" in command else 0)

    monkeypatch.setattr(everything.subprocess, "run", fake)
    with pytest.raises(OutputError, match=r"step front ended with status 3: python figures/front.py"):
        everything.main(jobs=2)
    assert done == [("figures/redraw.py", "--compute", "--jobs", "2"),
                    ("figures/spread.py", "--compute", "--jobs", "2"), ("figures/front.py",)]
    done.clear()
    everything.main(only=("notch", "ladder"))
    assert [words[1] for words in done] == ["skfsink.study.notch", "skfsink.study.ladder"]
    assert (tmp_path / "docs/images/notch.png").read_text() == "notch/notch.png"
    assert (tmp_path / "cases/dog_bone/ladder.json").read_text() == "ladder/dog_bone/ladder.json"
    done.clear()
    everything.main(plan=True)
    assert not done
    with pytest.raises(ParameterError, match="--only must be one of scenes, spread"):
        everything.main(only=("figures",))
    monkeypatch.setattr(everything.subprocess, "run", lambda *_, **__: SimpleNamespace(returncode=0))
    (tmp_path / "results/study/notch/notch.png").unlink()
    with pytest.raises(OutputError, match=r"step notch has not made .*notch\.png"):
        everything.main(only=("notch",))


@pytest.mark.parametrize("step", everything.STEPS.values(), ids=lambda step: step.name)
def test_the_steps_of_everything_are_there(step: Any) -> None:
    """Fails if a script or module of a step is gone, or a page does not have what it copies."""
    if step.arguments[0] == "-m":
        assert importlib.util.find_spec(step.arguments[1]) is not None
    else:
        assert (FIGURES.parent / step.arguments[0]).is_file()
    assert all((FIGURES.parent / place).parent.is_dir() for place in step.copies.values())


# --- the spread ---
def test_the_tables_of_the_scans_grow_by_what_is_missing(nowhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a row is made twice, or is taken for one of another scan."""
    monkeypatch.setattr(spread, "SCANS", (runs.Scan("simple_shear", ("mesh", "mesh_seed"), (("M4", 1), ("M4", 2))),
                                          runs.Scan("simple_shear", ("mesh", "notch"), (("M4", 1.5),))))
    runner = Runner()
    monkeypatch.setattr(compute.subprocess, "run", runner)
    spread.append(spread.SCANS[0], ("M4", 2), dict.fromkeys(spread.RESULTS, 1.0))
    assert spread.run_scans(spread.SCANS, 1) == [] and len(runner.commands) == 2
    assert runner.commands[0][3:9] == ["--mesh", "M4", "--mesh-seed", "1", "--analysis", "both"]
    assert spread.run_scans(spread.SCANS, 1) == [] and len(runner.commands) == 2
    assert [row["mesh_seed"] for row in spread.rows_of(spread.SCANS[0])] == ["1", "2"]
    (row,) = spread.rows_of(spread.SCANS[1])
    assert (row["notch"], row["mesh_seed"], row["U_dynamic_at_arrival"], row["elements"]) == ("1.5", "", "0.03", "7")
    lines = (nowhere / "simple_shear" / "reference" / "spread.csv").read_text().splitlines()
    assert len(lines) == 4 and lines[0].startswith("mesh,mesh_seed,notch,elements,onset_mm")


@pytest.mark.parametrize("text", ["a,b\n1,2\n", "mesh\nM4,3,4\n"])
def test_damaged_tables_are_refused(nowhere: Path, text: str) -> None:
    folder = nowhere / "simple_shear" / "reference"
    folder.mkdir(parents=True)
    (folder / "spread.csv").write_text(text)
    with pytest.raises(OutputError, match="is not a table of runs"):
        spread.read("simple_shear")


def test_a_spread_without_rows_is_left_out(nowhere: Path) -> None:
    with pytest.raises(OutputError, match=r"has no rows over mesh_seed in its spread.csv"):
        spread.draw(nowhere / "spread.png")
