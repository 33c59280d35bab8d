"""Studies: the store of points, the Pareto front, rates, and small studies from end to end."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from skfsink.cli.program import command
from skfsink.errors import ConvergenceError, InstabilityError, Interrupted, OutputError
from skfsink.methods.controls import ExplicitControls
from skfsink.run.display import Display
from skfsink.study import integrators, models, solvers, strong_laws, systems, tolerance
from skfsink.study.integrators import TIME
from skfsink.study.meshes import load_plate
from skfsink.study.pareto import pareto_front
from skfsink.study.part import Part, Planned
from skfsink.study.plate import SLAB, Front, Plate, first_passages
from skfsink.study.raised import RAISED
from skfsink.study.rates import extrapolated, observed_rate
from skfsink.study.refinement import plate
from skfsink.study.speed_accuracy import PARTS, run_parts, speed_accuracy
from skfsink.study.store import Store


# --- the store ---
def test_a_stopped_study_goes_on_where_it_was(tmp_path: Path):
    """Fails if a stored point is computed again, or one that was interrupted is stored."""
    path, made = tmp_path / "new" / "study.json", []

    def compute(key: str, stop: bool = False):
        def work():
            made.append(key)
            if stop:
                raise KeyboardInterrupt
            return {"value": np.float64(len(key)), "list": (1, 2)}
        return work

    store = Store(path, "a study")
    first = store.point("one", compute("one"))
    assert first["value"] == 3.0 and first["list"] == [1, 2] and first["wall_s"] >= 0 and first["cpu_s"] >= 0
    with pytest.raises(KeyboardInterrupt):
        store.point("three", compute("three", stop=True))
    again = Store(path, "a study")
    store.points["rows"] = {"x": [1.5, -2e-3, 3], "at": [[1, 2.5], [3, 4]], "words": ["[1,", "2]"], "text": "a [ 1 ] b"}
    store.save()
    text = path.read_text()
    assert '"x": [1.5, -0.002, 3]' in text and '"at": [[1, 2.5], [3, 4]]' in text and "a [ 1 ] b" in text
    assert Store(path, "a study").points["rows"] == store.points.pop("rows")
    store.save()
    assert again.point("one", compute("one")) == first
    again.point("three", compute("three"))
    assert made == ["one", "three", "three"]
    assert list(Store(path, "a study").points) == ["one", "three"]
    assert not list(path.parent.glob(".*")), "a temporary file is left"
    assert not Store(path, "a study", fresh=True).points


def test_the_command_of_a_study_has_no_place_of_a_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a published file tells where somebody wrote it, or leaves out what was asked for."""
    path, study = tmp_path / "study.json", ["python3", "-m", "skfsink.study.stability", "--only", "strength"]
    for place in (["--out", str(tmp_path)], [f"--out={tmp_path}"]):
        monkeypatch.setattr(sys, "orig_argv", [*study, *place, "--quiet"])
        Store(path, "stability", fresh=True).save()
        assert json.loads(path.read_text())["command"] == "python -m skfsink.study.stability --only strength"


@pytest.mark.parametrize("error", [ConvergenceError, InstabilityError])
def test_a_failing_point_is_a_point(tmp_path: Path, error: type[Exception]):
    """Fails if a run that does not converge is dropped, or stops the study, or is run again."""
    def fail():
        raise error("no equilibrium within 3 steps")

    store = Store(tmp_path / "study.json", "a study")
    assert store.point("bad", fail)["failed"] == "no equilibrium within 3 steps"
    assert Store(tmp_path / "study.json", "a study").points["bad"]["failed"]


def test_figures_of_another_machine_are_refused(tmp_path: Path):
    """Fails if points of other versions, machines or studies are mixed with new ones."""
    path = tmp_path / "study.json"
    Store(path, "a study").point("one", lambda: {"value": 1})
    with pytest.raises(OutputError, match="not a file of the study another"):
        Store(path, "another")
    content = json.loads(path.read_text())
    content["machine"]["versions"]["skfsink"] = "0.0.1"
    path.write_text(json.dumps(content))
    with pytest.raises(OutputError, match=r"skfsink 0\.0\.1, and this is .*--fresh"):
        Store(path, "a study")
    path.write_text("{")
    with pytest.raises(OutputError, match="not a file of the study"):
        Store(path, "a study")
    with pytest.raises(OutputError, match="finite numbers only"):
        Store(path, "a study", fresh=True).point("nan", lambda: {"value": float("nan")})


# --- the front ---
def test_pareto_front_of_a_known_set():
    """Fails if a beaten point is on the front, an unbeaten one is not, or their order is wrong."""
    points = [(3, 1), (1, 4), (2, 2), (2, 3), (4, 1), (5, 0.5), (1, 4), (0.5, np.inf), (np.nan, 0.1), (9, 0.6),
              (6, 0.5 * (1 - 1e-9))]
    assert pareto_front(*zip(*points)) == [1, 2, 0, 5]
    assert pareto_front([], []) == []


# --- rates ---
@pytest.mark.parametrize("rate", [0.7, 1.0, 2.0])
def test_extrapolation_recovers_limit_and_rate(rate: float):
    """Fails if the limit of q + C h^p is not q, from three sizes or from five, or an observed rate is not p."""
    h = np.array([0.8, 0.4, 0.25, 0.1, 0.05])
    for some in (h, h[:3]):
        limit, found = extrapolated(some, 3.0 - 0.5 * some**rate)
        assert limit == pytest.approx(3.0, abs=1e-6) and found == pytest.approx(rate, abs=1e-9)
    assert observed_rate(h, 7 * h**rate) == pytest.approx(rate)


def test_passages_are_interpolated_within_the_step():
    """Fails if the time at which a tip passes a mark is that of a step, or of a later passage."""
    way = np.array([0.0, 0.0, 0.4, 0.4, 1.0])
    times = [0.0, 1.0, 2.0, 3.0, 4.0]
    np.testing.assert_allclose(first_passages(times, way, np.array([0.0, 0.1, 0.4, 0.7, 1.0])),
                               [0.0, 1.25, 2.0, 3.5, 4.0])


# --- the plates ---
def test_tip_is_where_gamma_crosses_a_tenth():
    """Fails if the tip jumps from node to node, or is not measured from the tip of the notch."""
    sample = load_plate("plate0")
    x, front = sample.space.X[:, 0], Front(sample)
    for tip in (0.3, 0.3001, 0.77):
        gamma = np.clip(0.1 + (x - 0.5 - tip), 0.0, 1.0)
        assert front.tip(gamma) == pytest.approx(tip, abs=1e-9)
    assert front.tip(np.ones_like(x)) == 0.0


def test_division_keeps_the_plate():
    """Fails if elements are lost or turned over, a boundary loses its nodes, or the rounding stays a polygon."""
    sample = plate("coarse/2^1", "quads")
    coarse = plate("coarse", "quads")
    assert sample.space.n_elements == 4 * coarse.space.n_elements
    assert sample.space.V.sum() == pytest.approx(coarse.space.V.sum(), rel=1e-3)
    for name in ("top", "bottom", "left", "right", "notch"):
        assert len(sample.nodes(name)) == 2 * len(coarse.nodes(name)) - (2 if name == "left" else 1)
    X = sample.space.X[sample.nodes("notch")]
    arc = X[X[:, 0] > 0.95]
    np.testing.assert_allclose(np.hypot(arc[:, 0] - 0.95, arc[:, 1] - 2.0), 0.05, rtol=1e-6)
    assert np.isin(np.unique(sample.space.mesh.facets[:, sample.space.mesh.boundary_facets()]),
                   np.concatenate([*sample.boundaries.values()])).all()


def test_half_plate_and_slab_are_the_plate():
    """Fails if figures of a half, or of a slab held in z, are not those of the whole plate in plane strain."""
    whole = Plate(load_plate("half0", mirrored=True)).held_at(0.05)
    half = Plate(load_plate("half0"), models.HALF, 2).held_at(0.05)
    slab = Plate(load_plate("half0", mirrored=True, slab=(0.05, 1)), SLAB).held_at(0.05)
    for other in (half, slab):
        assert other == pytest.approx(whole, rel=1e-6)


def test_an_event_that_does_not_arrive_is_an_error():
    """Fails if a crack that has not gone the way is given an arrival time, or the onset is changed by an event."""
    body = Plate(load_plate("plate0"))
    before = body.onset
    with pytest.raises(ConvergenceError, match=r"mm of 1 mm in 2 µs"):
        body.event(lambda b: b.explicit(ExplicitControls()), limit=2e-6)
    found = body.event(lambda b: b.explicit(ExplicitControls()), run=0.1)
    assert 3 < found["arrival_us"] < 15 and found["passed_us"][-1] == found["arrival_us"] and found["D"] > 0
    assert (np.diff(found["passed_us"]) >= 0).all()
    np.testing.assert_array_equal(body.onset.u, before.u)
    assert body.onset.time == before.time


# --- linear systems ---
@pytest.mark.parametrize("field", ["density", "tangent"])
@pytest.mark.parametrize("dim", [2, 3])
def test_all_solvers_solve_the_same_system(field: str, dim: int):
    """Fails if a method leaves a residual, or figures of another system come out."""
    system = systems.density_system(systems.body(dim, 500, 1)) if field == "density" else \
        systems.tangent_system(systems.body(dim, 500, dim))
    reference, _ = systems.direct(system)()()
    for method in systems.METHODS[field]:
        x, iterations = systems.SOLVERS[method](system)()()
        np.testing.assert_allclose(x, reference, atol=1e-6 * abs(reference).max())
        assert (iterations == 0) == (method == "direct")
    if field == "density":
        assert reference.min() < 1e-12 and reference.max() <= 1 + 1e-12


def test_a_solution_over_the_cap_is_a_point(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """Fails if a solution that was ended is dropped, or a larger one is tried after it."""
    calls = []

    def ended(arguments, **_):
        calls.append(arguments[-1])
        return subprocess.CompletedProcess(arguments, systems.OVER_TIME, "", "")

    monkeypatch.setattr(solvers.subprocess, "run", ended)
    planned = [p for p in solvers.plan(False) if p.key.startswith("tangent/3D/jacobi/")][-2:]
    store = Store(tmp_path / "study.json", "a study")
    points = {p.key: store.point(p.key, p.compute) for p in planned}
    assert calls == ["300000"]
    assert [p["failed"] for p in points.values()] == [
        "over the cap: 120 s", "over the cap: 120 s at a smaller size already"]
    assert solvers.exponents(solvers.family(points, "tangent", 3, "jacobi")) is None


# --- studies ---
def test_an_interrupted_part_goes_on(tmp_path: Path):
    """Fails if Ctrl-C in the middle loses the points before it, or they are computed again."""
    made: list[str] = []

    def planned(stop: str) -> Part:
        def compute(key: str) -> dict[str, Any]:
            if key == stop:
                raise KeyboardInterrupt
            made.append(key)
            if key == "b":
                raise InstabilityError("blew up")
            return {"value": key}
        return Part("toy", lambda quick: [Planned(k, partial(compute, k)) for k in "abcd"],
                    lambda points, path: path.write_text(",".join(points)), lambda points: [*points])

    path = tmp_path / "toy.json"
    with pytest.raises(Interrupted, match=r"2 points are in .*toy\.json"):
        run_parts(Store(path, "toy"), [planned("c")], False, Display(quiet=True))
    assert not (tmp_path / "toy_toy.png").exists()
    run_parts(Store(path, "toy"), [planned("")], False, Display(quiet=True))
    assert made == ["a", "b", "c", "d"]
    assert (tmp_path / "toy_toy.png").read_text() == "a,b,c,d"
    assert json.loads(path.read_text())["points"]["toy/b"]["failed"] == "blew up"


def test_methods_that_fail_are_rows():
    """Fails if a method that failed on a plate is given errors, or a good one is not measured by the reference."""
    def run(shift: float) -> dict[str, Any]:
        passed = 10.0 + shift + np.linspace(0, 1, 20)
        return {"arrival_us": passed[-1], "passed_us": passed.tolist(), "D": 1.0 + shift, "cpu_s": 2.0}

    explicit, hht = "explicit, default but no rejection", "HHT, default but no rejection"
    points = {"onset/plate0": {}, "reference 0.2/plate0": run(0.1), "reference 0.1/plate0": run(0.0),
              f"{explicit}/plate0": run(0.11), f"{hht}/plate0": {"failed": "stalled", "cpu_s": 1.0}}
    rows = {row["name"]: row for row in integrators.summary(points)}
    assert rows[hht]["failed"] == "stalled" and "D" not in rows[hht]
    assert rows[explicit]["D"] == pytest.approx(0.11)
    assert rows[explicit]["history"] == pytest.approx(0.01)
    assert rows["reference 0.2"]["arrival"] == pytest.approx(0.1 / 11)


def test_errors_of_tolerances_are_against_the_reference_of_the_same_mesh():
    """Fails if a run is measured by another mesh or one reference run, or a method that fails somewhere has errors.

    The reference arrives at 9 and 11 us on one mesh and at 20 on the other; a method at 12 and 18, so 20 % late and
    10 % early.
    """
    def run(arrival: float) -> dict[str, Any]:
        return {"arrival_us": arrival, "D": 1.0, "U": 2.0, "steps": 10, "rejected": 1, "cpu_s": 2.0}

    points = {"gent/reference/0.099/0": run(9.0), "gent/reference/0.1/0": run(11.0), "gent/reference/0.1/1": run(20.0),
              "gent/2e-05/0.8/0": run(12.0), "gent/2e-05/0.8/1": run(18.0),
              "gent/off/0.8/0": run(10.0), "gent/off/0.8/1": {"failed": "blew up", "cpu_s": 1.0}}
    reference, default, off = tolerance.summary(points)
    assert default["arrival_us"] == pytest.approx((0.05, np.sqrt((0.2**2 + 0.1**2) / 2))) and default["D"] == (0.0, 0.0)
    assert reference["arrival_us"] == pytest.approx((0.0, np.sqrt(0.02 / 3)))
    assert off["failed"] == "1 of 2 runs fail" and "D" not in off
    lines = tolerance.table(points)
    assert "+5.0 % (15.8 %)" in lines[3] and "default" in lines[3] and "1 of 2 runs fail" in lines[4]


def test_parts_measured_without_rejection_plan_it():
    """Fails if a run of a part whose points were measured without rejected steps would reject some."""
    controls = [p.compute.method.controls for p in TIME.plan(False) if p.compute.method is not None]
    controls += [variant.controls for variant in models.variants(False)]
    assert len(controls) > 100
    for c in controls:
        assert (c.energy_tolerance == 0.0 if isinstance(c, ExplicitControls) else c.gain_tolerance == 1.0)


def test_changes_are_against_the_base_on_the_same_mesh():
    """Fails if a variant is compared with another mesh, or one that fails on some mesh loses that."""
    def run(opening: float, D: float) -> dict[str, Any]:
        return {"onset": {"opening_mm": opening, "reaction_N_per_mm": 1.0, "loading_cpu_s": 1.0}, "arrival_us": 40.0,
                "D": D, "U": 1.0, "cpu_s": 1.0}

    points = {f"default/{s}": run(o, 1.0) for s, o in zip("012", (0.1, 0.2, 0.4))}
    points |= {f"k = 50 MPa/{s}": run(1.1 * o, 2.0) for s, o in zip("012", (0.1, 0.2, 0.4))}
    points["k = 50 MPa/1"] = {"failed": "arrested", "cpu_s": 1.0}
    row, = models.changes(points)
    assert row["onset opening"] == pytest.approx((0.1, 0.1, 0.1)) and row["D"] == pytest.approx((1.0, 1.0, 1.0))
    assert row["cost"][0] == pytest.approx(1.0) and row["failed"] == "arrested (1 of 3 meshes)"


@pytest.mark.slow
def test_quick_study(tmp_path: Path):
    """Fails if the quick study takes more than three minutes of one core, or a part leaves no picture.

    A second call computes nothing, and one that would mix in figures of another version is refused.
    """
    command = [sys.executable, "-m", "skfsink.study.speed_accuracy", "--quick", "--quiet", "--out", str(tmp_path)]
    before = os.times()
    subprocess.run(command, check=True)
    after = os.times()
    assert sum(after[2:4]) - sum(before[2:4]) < 180
    assert {p.name for p in tmp_path.glob("*.png")} == {
        "speed_accuracy.png", *(f"speed_accuracy_{part}.png" for part in PARTS)}
    content = (tmp_path / "speed_accuracy.json").read_bytes()
    subprocess.run(command, check=True, timeout=60)
    assert (tmp_path / "speed_accuracy.json").read_bytes() == content
    (tmp_path / "speed_accuracy.json").write_bytes(content.replace(b'"numpy": "', b'"numpy": "0.'))
    refused = subprocess.run(command, capture_output=True, text=True)
    assert refused.returncode == 2 and "--fresh" in refused.stderr


def test_command_line_refuses_an_unknown_part(capsys: pytest.CaptureFixture[str]):
    """Fails if a slip on the command line starts a study, or is more than one line."""
    with pytest.raises(SystemExit) as end:
        command(speed_accuracy, ["--only", "space-time"], package="study")
    assert end.value.code == 2
    assert capsys.readouterr().err.startswith("skfsink: ")


def test_documented_figures_are_those_of_the_file(tmp_path: Path):
    """Fails if a table of the documentation is not what its JSON file gives, or that file cannot be drawn."""
    docs = Path(__file__).parents[1] / "docs"
    text = (docs / "speed_accuracy.md").read_text(encoding="utf-8").splitlines()
    for name, part in PARTS.items():
        file = {"time": "", "model": "", "space": "_solvers"}.get(name, f"_{name}")
        file = f"speed_accuracy{file}.json"
        stored = json.loads((docs / "images" / file).read_text(encoding="utf-8"))
        assert stored["study"] == "speed_accuracy" and stored["machine"]["processor"]
        start = f"{name}/"
        points = {k.removeprefix(start): p for k, p in stored["points"].items() if k.startswith(start)}
        assert points and not [line for line in part.table(points) if line not in text]
        assert {p.key for p in part.plan(False)} == points.keys()
        if name in ("space", "tolerance", "raised"):  # the others take long
            part.draw(points, tmp_path / f"{name}.png")
            assert (tmp_path / f"{name}.png").stat().st_size > 1e5


def test_runs_with_and_without_raised_mass_solve_for_gamma_as_often() -> None:
    """Fails if the reference, whose steps are a tenth as long, solves ten times as often: that alone moves a crack."""
    stored = json.loads((Path(__file__).parents[1] / "docs" / "images" / "speed_accuracy_raised.json").read_text())
    apart = {key: p["gamma_every"] * (p["start"] + p["transit"]) / p["steps"] for key, p in stored["points"].items()}
    ringed = [value for key, value in apart.items() if "no rings" not in key and "later" not in key]  # of two intervals
    assert 0.05 < min(ringed) < max(ringed) < 0.13  # microseconds
    (planned,) = (p for p in RAISED.plan(True) if p.key.startswith("0.001/"))
    found = planned.compute()
    assert 0.09 < found["gamma_every"] * (found["start"] + found["transit"]) / found["steps"] < 0.13


def test_strong_laws_stand_beside_their_reference() -> None:
    """Fails if an event of the study does not run to its end, or its table compares with another run or mesh.

    The way of `other` is 10 % short of that of its reference, on its second mesh it is the same; runs without a
    reference, those of another element and on a third mesh, are not compared.
    """
    found = strong_laws.event("neo-hookean", "jbar", strong_laws.SMALL, 0, "explicit")
    assert found["why"] == "" and found["ended_us"] >= 60.0 and found["way_mm"] > 1.0 and found["worst"] < 3e-3
    reference = {**found, "scheme": strong_laws.REFERENCE}
    other = {**found, "way_mm": 0.9 * found["way_mm"]}
    lines = strong_laws.table({"a": other, "b": {**found, "seed": 1}, "c": {**found, "seed": 2, "way_mm": 5.0},
                               "d": reference, "e": {**reference, "seed": 1}, "f": {**other, "element": "planestress"}})
    assert len(lines) == 4 and "(-5.0%, a mesh -10%)" in lines[2] and "(+0.0%, a mesh +0%)" in lines[2]
    assert not any("a mesh" in line for line in lines[3:])


def test_scatter_is_that_of_runs_of_the_same_mesh() -> None:
    """Fails if a deviation mixes meshes or Courant numbers, an error is not that of the mean mesh, or a run of the plan
    is not at the Courant number of its key."""
    def run(seed: int, D: float) -> dict[str, Any]:
        return {"seed": seed, "D": D, "passed_1mm_us": 30.0}

    points = {f"{c}, mesh {s}": run(s, D) for s, Ds in enumerate(((9.0, 11.0), (20.0, 20.0), (29.0, 31.0)))
              for c, D in zip((0.8, 0.81), Ds)}
    points |= {f"0.1, mesh {s}": run(s, 50.0) for s in range(3)}
    lines = strong_laws.table_scatter(points)
    # deviations sqrt(2), 0, sqrt(2); the error of a mesh of two runs is 1, that of the mean of three sqrt(2) / 3
    assert lines[2] == "| 0.8 to 0.81 | 6 | 10.0 ± 1.4 | 20.0 ± 0.0 | 30.0 ± 1.4 | 20.00 ± 0.47 | 30.0 ± 0.0 |"
    assert lines[3].startswith("| 0.1 to 0.1 | 3 | 50.0 ± 0.0 |")
    for planned in strong_laws.plan_scatter(False):
        assert planned.compute.keywords["courant"] == float(planned.key.split(",")[0])
