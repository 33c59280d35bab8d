"""The models of a scene: halves and slabs are the whole, a start from rest is one, the choice is by figures."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bodies import held_body
from guarded import Stop
from plates import invoke, plate
from references import scene_of

from skfsink.cases.single_edge_notch import CASE
from skfsink.errors import Interrupted, MeshError, OutputError, ParameterError
from skfsink.fields.crack import CRACKED
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.loads.grips import Grip
from skfsink.material import AAA
from skfsink.meshing.sample import _from_meshio
from skfsink.meshing.sweeping import swept
from skfsink.meshing.symmetry import Mirror, Whole, cut
from skfsink.meshing.vtu import write_mesh
from skfsink.methods.controls import HHTControls
from skfsink.methods.rest import LoadingFromRest
from skfsink.run import model as models
from skfsink.run.display import Display
from skfsink.run.model import LADDERS, REFERENCE, Ladder, choose_model, level
from skfsink.run.quantities import measured, relative_error
from skfsink.run.simulate import Simulation
from skfsink.scene.options import QUANTITIES, Options
from skfsink.scene.registry import find_case, read_scene
from skfsink.scene.scene import Scene
from skfsink.system.shipped import data_folder

HALVES = ("single_edge_notch", "symmetric_double_edge_notch", "dog_bone", "cylindrical_shell")
OWN = CASE.default_arguments


def with_options(case: str, mesh: str = "coarse", **options: Any) -> Any:
    """The scene of a case with other options."""
    found = find_case(case)
    return found.scene({**found.default_arguments, "mesh": mesh}, Options(**options))


# --- halves ---
@pytest.mark.parametrize("case", HALVES)
def test_a_half_is_the_part_that_symmetry_leaves(case: str) -> None:
    """Fails if elements are lost or kept twice, a roller is not on its plane, or the body is not held."""
    half = with_options(case, half=True)
    full = scene_of(case, mesh="coarse-mirror" if case == "single_edge_notch" else "coarse")
    copies = half.whole.energy
    assert copies == (4 if case == "dog_bone" else 2)
    assert half.sample.space.V.sum() * copies == pytest.approx(full.sample.space.V.sum(), rel=1e-9)
    assert half.sample.space.n_elements * copies == full.sample.space.n_elements
    free, velocity = half.constraints()
    free = free.reshape(velocity.shape)
    for mirror in half.whole.mirrors:
        nodes, X = half.sample.nodes(mirror.name), half.sample.space.X
        assert np.ptp(X[nodes, mirror.axis]) < 1e-12 and len(nodes) > 5
        assert not free[nodes, mirror.axis].any() and (velocity[nodes, mirror.axis] == 0).all()
    assert half.speed * half.whole.displacement == pytest.approx(full.speed)


@pytest.mark.slow
def test_a_half_has_the_onset_of_the_whole(tmp_path: Path) -> None:
    """Fails if the rollers hold what symmetry does not, or the factors to the whole are wrong."""
    found = {}
    for half in (True, False):
        scene = with_options("single_edge_notch", "coarse-mirror", half=half, event_time=1e-9)
        simulation = Simulation(scene, tmp_path, Display(quiet=True))
        simulation.run()
        found[half] = measured(scene, simulation), \
            simulation.state.ledger.initial * scene.whole.energy
    for name in ("onset_load", "onset_displacement"):
        assert found[True][0][name] == pytest.approx(found[False][0][name], rel=1e-3)
    assert found[True][1] == pytest.approx(found[False][1], rel=1e-3)


def test_there_is_no_half_through_elements_or_without_symmetry() -> None:
    """Fails if a mesh is torn along a line that has no nodes, or a body that has no mirror gets one."""
    with pytest.raises(MeshError, match="lie across y = 2 mm"):
        cut(plate(), Mirror(1, 2.0, along=True))
    for case, why in (("simple_shear", "stretched and compressed"), ("asymmetric_double_edge_notch", "half a turn")):
        with pytest.raises(ParameterError, match=why):
            with_options(case, half=True)


def test_mesh_files_are_computed_as_they_are(tmp_path: Path) -> None:
    """Fails if an option that changes a named mesh is ignored for a file."""
    write_mesh(tmp_path / "plate.vtu", plate())
    for options in ({"half": True}, {"dimensions": 3}, {"mesh_layout": "uniform"}, {"mesh_layout": "two-pass"}):
        with pytest.raises(ParameterError, match=f"--{next(iter(options)).replace('_', '-')} is for the meshes coarse"):
            with_options("single_edge_notch", str(tmp_path / "plate.vtu"), **options)


def test_images_of_the_places() -> None:
    """Fails if the crack of a half is not that of the whole."""
    whole = Whole.of((Mirror(0, 1.0), Mirror(1, 2.0)))
    places = whole.places(np.array([[0.2, 2.5]]))
    assert sorted(map(tuple, np.round(places, 12).tolist())) == [(0.2, 1.5), (0.2, 2.5), (1.8, 1.5), (1.8, 2.5)]
    assert (whole.energy, whole.load, whole.displacement) == (4, 2, 2)


def test_a_slab_is_plane_strain() -> None:
    """Fails if energy or force of one layer of hexahedra between fixed planes is not that of the quadrilaterals."""
    depth, u = 0.3, np.random.default_rng(1).normal(size=(len(plate().points), 2)) * 0.01
    flat, slab = (_from_meshio("x", mesh) for mesh in (plate(), swept(plate(), depth, 1)))
    energies, forces = [], []
    for sample in (flat, slab):
        momentum = Momentum(sample.space, AAA())
        momentum.set_gamma(np.ones(sample.space.n_nodes), np.zeros(sample.space.n_elements, bool))
        field = u if sample is flat else np.column_stack([np.repeat(u, 2, axis=0), np.zeros(2 * len(u))])
        forces.append(momentum.force(field).copy())
        energies.append(momentum.energy)
    assert energies[1] == pytest.approx(depth * energies[0], rel=1e-10)
    np.testing.assert_allclose(forces[1].reshape(-1, 2, 3).sum(axis=1)[:, :2], depth * forces[0], rtol=0,
                               atol=1e-10 * np.abs(forces[0]).max())


def test_dimensions_that_a_sample_does_not_have() -> None:
    with pytest.raises(ParameterError, match=r"must be 3 for dog_bone; got 2 .*planestress"):
        with_options("dog_bone", dimensions=2)
    with pytest.raises(ParameterError, match="dimensions must be 2, 3, or 0"):
        Options(dimensions=4)
    scene = with_options("single_edge_notch", dimensions=3)
    assert scene.sample.space.dim == 3 and scene.whole.energy == pytest.approx(15.0)
    free, _ = scene.constraints()
    assert not free.reshape(-1, 3)[:, 2].any()


# --- from rest ---
def small(folder: Path, start: str) -> Scene:
    """The small plate, with elements of l/2."""
    write_mesh(folder / "plate.vtu", plate())
    return CASE.scene({**OWN, "mesh": str(folder / "plate.vtu")}, Options(
        length_scale=0.6, start=start, event_time=2e-5, overshoot=1e-3))


def test_a_start_from_rest_goes_on_where_it_was_stopped(tmp_path: Path) -> None:
    """Fails if the loading from rest forgets its step, its rates or its inertia in a checkpoint."""
    scene, files = small(tmp_path, "rest"), []
    for name, stops in (("straight", (14,)), ("stopped", (8, 6))):
        folder = tmp_path / name
        folder.mkdir()
        for number, after in enumerate(stops):
            run = Simulation(scene, folder, Display(quiet=True), resume=number > 0, observers=[Stop(after)])
            with pytest.raises(Interrupted):
                run.run()
        assert run.state.phase == "loading" and run.state.step == 14
        files.append((folder / "history.csv").read_bytes())
    assert files[0] == files[1]


def test_small_elements_are_not_shaken_at_a_start_from_rest(tmp_path: Path) -> None:
    """Fails if rounding of the first forces, over the small masses at a resolved notch, sets the body in motion.

    The nodes then moved at 700 times the speed of the grips after one step, and the event began far below the onset.
    """
    scene = with_options("symmetric_double_edge_notch", start="rest")
    run = Simulation(scene, tmp_path, Display(quiet=True), observers=[Stop(4)])
    with pytest.raises(Interrupted):
        run.run()
    assert run.state.phase == "loading" and run.state.step == 4
    assert float(np.abs(run.state.v).max()) < 5 * scene.loading().speed(0.0)


@pytest.mark.slow
def test_a_start_from_rest_comes_to_the_static_onset_in_motion(tmp_path: Path) -> None:
    """Fails if the loading from rest stops early, lets the body crack on its way, or hands over a body at rest.

    At 1e-3 mm/s inertia has no part in the loading: the onset is that of statics. The ledger of the event closes.
    """
    found = {}
    for start in ("onset", "rest"):
        scene, folder = small(tmp_path, start), tmp_path / start
        folder.mkdir()
        simulation = Simulation(scene, folder, Display(quiet=True))
        state = simulation.run()
        found[start] = simulation.onset.figures["displacement_mm"]
        assert abs(state.ledger.balance) < 1e-9 * state.ledger.initial
        first = simulation.history.rows[len([r for r in simulation.history.rows
                                                      if r["phase"] == "loading"])]
        if start == "rest":
            assert simulation.onset.figures["gamma_min"] > 0.8
            assert first["kinetic"] > 0 and first["time_s"] == 0.0
            assert simulation.costs.factorisations > 20
    assert found["rest"] == pytest.approx(found["onset"], rel=2e-3)
    with pytest.raises(ParameterError, match="start rest is for analysis dynamic"):
        Options(start="rest", analysis="both")


def test_a_fast_start_from_rest_ends_when_the_sample_has_come_apart(tmp_path: Path) -> None:
    """Fails if the loading by fast grips goes on past the first crack, for ever: it tore the sample long before."""
    scene = small(tmp_path, "rest")
    scene = replace(scene, grips=(Grip("top", (0.0, 5000.0)), Grip("bottom", (0.0, 0.0))),
                    controls=replace(scene.controls, event_time=2e-4))
    simulation = Simulation(scene, tmp_path, Display(quiet=True))
    state = simulation.run()
    loading = [row for row in simulation.history.rows if row["phase"] == "loading"]
    assert min(row["gamma_min"] for row in loading[:-1]) > CRACKED
    assert simulation.crack.tracker.separated and state.phase == "done"
    assert simulation.view.gauge.displacement(state) < 3.0


def test_a_start_from_rest_needs_a_grip_that_moves(tmp_path: Path) -> None:
    """Fails if still grips end in a division by zero."""
    scene = small(tmp_path, "rest")
    with pytest.raises(ParameterError, match="start rest needs a grip that moves; all of them are still"):
        replace(scene, grips=(Grip("top", (0.0, 0.0)), Grip("bottom", (0.0, 0.0))))
    space = scene.sample.space
    with pytest.raises(ParameterError, match="start rest needs a grip that moves"):
        LoadingFromRest(held_body(Momentum(space, AAA()), DensitySolver(space, scene.sink_law),
                                  scene.constraints()[0], np.zeros_like(space.X)), HHTControls())


# --- the ladder ---
@pytest.mark.parametrize("case", LADDERS)
def test_every_rung_is_a_set_of_options(case: str) -> None:
    """Fails if two levels are the same, or a name has a word that means nothing."""
    made = []
    for name in LADDERS[case]:
        model = level(case, name)
        words = {word for word in models.VARIANTS if f"-{word}-" in f"-{name}-"}
        assert len(model.title.split("; ")) == 1 + len(words)
        assert name == "-".join([name.split("-")[0], *(word for word in models.VARIANTS if word in words)])
        made.append(model.apply(Options()))
        assert made[-1].model == name
    assert len({tuple(options.parameters().items()) for options in made}) == len(made)
    with pytest.raises(ParameterError, match=r"model must be auto or one of onset, .*; got 'magic'"):
        level(case, "magic")


def test_options_against_the_model_are_refused() -> None:
    """Fails if an option that was asked for is silently replaced by the model's."""
    model = level("single_edge_notch", "statics-half")
    assert model.apply(Options(analysis="quasistatic", phi=0.2)).half
    with pytest.raises(ParameterError, match="analysis = both is not that of the model statics-half"):
        model.apply(Options(analysis="both"))
    with pytest.raises(ParameterError, match="active_zone = True"):
        level("single_edge_notch", "dynamics-everywhere").apply(Options(given_names=frozenset({"active_zone"})))


def point(price: float, u: float | None, speed: float | None, made: bool = False, **more: Any) -> dict[str, Any]:
    return {"mesh": "M3", "made": made, "elements": 10, "price_s": price, "crack": [[0, 0], [1, 0], [2, 0]],
            "quantities": {"U": u, "tip_speed": speed}, **more}


@pytest.fixture
def ladder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A made-up ladder: statics is off, the half cheap, two passes cheaper but of gmsh."""
    path = tmp_path / "ladder.json"
    path.write_text(json.dumps({"machine": {"processor": "abacus"}, "points": {
        "full": point(100.0, 1.0, 20.0), "dynamics": point(20.0, 0.98, 20.5), "statics": point(5.0, 0.4, None),
        "dynamics-half": point(10.0, 1.03, 19.0), "dynamics-two-pass": point(8.0, 1.0, 18.0, made=True),
        "dynamics-uniform": {"failed": "it blew up"}, "dynamics, another mesh": point(20.0, 1.08, 20.5)}}))
    monkeypatch.setattr(models, "ladder_path", lambda case: path)
    return path


@pytest.mark.parametrize("quantity, tolerance, gmsh, expected", [
    ("U", 0.05, True, ("dynamics-two-pass", "statics", "off by 60.0%")),
    ("U", 0.05, False, ("dynamics-half", "dynamics-two-pass", "its mesh is made by gmsh, which is not installed")),
    ("U", 0.61, True, ("statics", "", "")),
    ("tip_speed", 0.05, True, ("dynamics-half", "dynamics-two-pass", "off by 10.0%")),
    ("tip_speed", 0.01, True, ("full", "dynamics", "off by 2.5%")),
    ("crack_path", 1e-9, True, ("statics", "", ""))])
def test_the_cheapest_within_the_tolerance_is_taken(ladder: Path, quantity: str, tolerance: float, gmsh: bool,
                                                    expected: tuple[str, str, str]) -> None:
    """Fails if a model whose error is larger, unknown, or that failed is taken, or a cheaper one is passed over."""
    found = Ladder("single_edge_notch")
    assert found.cheapest(quantity, tolerance, gmsh) == expected
    assert found.scatter("U") == pytest.approx(0.1 / 0.98)
    with pytest.raises(ParameterError, match="no model of single_edge_notch was measured to give D within"):
        found.cheapest("D", 0.05, True)


def test_the_choice_says_what_it_is_from(ladder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if price, error, the refused model, or parameters that were not measured are left out of the message."""
    monkeypatch.setattr(models, "has_gmsh", lambda: False)
    options, choice = choose_model(CASE, {**OWN, "side": 5.0}, Options(model="auto", phi=0.2))
    assert (options.model, options.half, choice["model"], choice["asked"]) == (
        "dynamics-half", True, "dynamics-half", "auto")
    assert choice["error"] == pytest.approx(0.03) and choice["price_s"] == 10.0 and choice["processor"] == "abacus"
    assert choice["cheaper"] == {"model": "dynamics-two-pass", "price_s": 8.0,
                                 "refused": "its mesh is made by gmsh, which is not installed"}
    for part in ("model dynamics-half", "U off by 3.0% (tolerance 5.0%)", "10.0 s", "mesh M3", "next cheaper",
                 "measured at default parameters; here side, phi differ"):
        assert part in choice["text"]
    _, choice = choose_model(CASE, OWN, Options(model="statics"))
    assert "tolerance" not in choice and "changed" not in choice and choice["error"] == pytest.approx(0.6)


def test_ladders_that_cannot_be_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a missing or damaged ladder is anything but one line, or stops a model that was named."""
    path = tmp_path / "ladder.json"
    monkeypatch.setattr(models, "ladder_path", lambda case: path)
    with pytest.raises(OutputError, match="were not measured"):
        choose_model(CASE, OWN, Options(model="auto"))
    assert choose_model(CASE, OWN, Options(model="statics"))[1]["model"] == "statics"
    for text in ("", "{}", '{"points": {}, "machine": {}}', '{"points": 3}'):
        path.write_text(text)
        with pytest.raises(OutputError, match="is no measured ladder"):
            Ladder("single_edge_notch")


def test_errors_of_paths() -> None:
    """Fails if a branch that only one crack has does not count, or the order of the two matters."""
    one = [[i, 0] for i in range(20)]
    branch = [*one, *([10 + i, 3 + i] for i in range(10))]
    assert relative_error("crack_path", one, one) == 0.0
    assert relative_error("crack_path", [[i, 1] for i in range(20)], one) == 0.0
    for pair in ((branch, one), (one, branch)):
        assert relative_error("crack_path", *pair) == pytest.approx(1 / 3)
    assert relative_error("crack_path", [], one) is None and relative_error("U", None, 1.0) is None
    assert relative_error("U", 0.9, 1.0) == pytest.approx(0.1)


def test_the_choice_is_printed_and_stored(ladder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a run does not say which model it took, forgets it in a file, or takes another one when resumed."""
    monkeypatch.chdir(tmp_path)
    flags = ["--mesh", "coarse", "--model", "onset"]
    status, err, _ = invoke(*flags)
    assert status == 0 and "model onset (statics up to the onset)" in err
    folder = tmp_path / "results" / "single_edge_notch" / "coarse-onset"
    summary, stored = (json.loads((folder / "summary.json").read_text()),
                       tomllib.loads((folder / "scene.toml").read_text()))
    assert summary["model"]["model"] == stored["choice"]["model"] == "onset"
    assert summary["verdict"].startswith("only the onset was computed, as by the model onset: ")
    assert summary["quantities"]["onset_load"] > 0.5 and summary["quantities"]["U"] is None
    assert "model" not in stored["parameters"] and read_scene(folder).parameters["event_time"] == 1e-9
    assert invoke("--resume", folder, "--model", "statics")[0] == 2
    assert invoke("--resume", folder, "--quiet")[0] == 0
    assert json.loads((folder / "summary.json").read_text())["model"] == summary["model"]


@pytest.mark.parametrize("case", LADDERS)
def test_the_committed_ladder_answers_every_question(case: str) -> None:
    """Fails if a level was not measured, or `--model auto` finds nothing for a quantity."""
    found = Ladder(case)
    assert set(found.points) == set(LADDERS[case])
    for quantity in QUANTITIES:
        assert found.error(REFERENCE, quantity) == 0.0
        for gmsh in (True, False):
            name, _, _ = found.cheapest(quantity, 0.05, gmsh)
            error = found.error(name, quantity)
            assert error is not None and error <= 0.05
            cheaper = found.by_price()[:found.by_price().index(name)]
            assert gmsh is False or all((found.error(k, quantity) or 1.0) > 0.05 for k in cheaper)
    assert data_folder(case).joinpath("ladder.json").stat().st_size < 200_000
