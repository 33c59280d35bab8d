"""Probes: places, surfaces and quantities against closed forms; files of runs, resumed ones and those of decks."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import skfem
from bodies import box, distorted, grid
from guarded import NOTCHED, PLAIN, Stop, scene, simulation
from matplotlib.figure import Figure
from plates import contents, deck, drawing, invoke_program, plate

import skfsink
from skfsink.errors import Interrupted, MeshError, OutputError, ParameterError, SkfsinkError
from skfsink.fem.places import find_places
from skfsink.fem.space import Space
from skfsink.fem.surface import Surface
from skfsink.fields.momentum import Momentum
from skfsink.fields.quantities import QUANTITIES, quantities_of
from skfsink.fields.state import State
from skfsink.fields.stress import cauchy_stress
from skfsink.loads.grips import Grip
from skfsink.material import AAA, Material, NeoHookean
from skfsink.material.regions import Region
from skfsink.meshing.sample import Sample
from skfsink.meshing.vtu import write_mesh
from skfsink.pictures import line_curves
from skfsink.results.loader import load
from skfsink.results.probes import ProbeTable, read_probes
from skfsink.run.compute import run
from skfsink.run.display import Display
from skfsink.run.observers.probe import LineProbe, MeanProbe, PointProbe
from skfsink.run.observers.probe_surfaces import OpeningProbe, ReactionProbe, VolumeProbe, probe_of
from skfsink.run.simulate import Simulation
from skfsink.scene.scene import Scene

HEAD = 'case = "custom"\n[parameters]\nmesh = "plate.vtu"\nlength_scale = 0.6\nevent_time = "3 µs"\n'
GRIPS = '[[grips]]\nboundary = "top"\nx = 0\ny = "1 µm/s"\n[[grips]]\nboundary = "bottom"\nx = 0\ny = -1e-3\n'
PROBES = '''[[probes]]
name = "ahead"
kind = "point"
position = ["1.5 mm", 2]
every = "1 us"
[[probes]]
name = "ligament"
kind = "line"
position = [1.0, 2.0]
to = [4.0, 2.0]
points = 7
quantity = "stress, gamma"
[[probes]]
name = "forces"
kind = "reaction"
[[probes]]
name = "mouth"
kind = "opening"
position = [0.0, 1.846]
to = [0.0, "2.154 mm"]
[[probes]]
name = "side"
kind = "mean"
boundary = "right"
quantity = "displacement"
[[probes]]
name = "body"
kind = "volume"
boundary = "notch"
'''


@pytest.fixture(autouse=True)
def without_pictures() -> Iterator[None]:
    """Runs draw nothing."""
    with drawing(False):
        yield


def test_a_column_that_is_not_there_is_told_beside_those_that_are() -> None:
    """Fails if a wrong name of a column ends in an error of Python, or the names there are are not told."""
    with pytest.raises(OutputError, match=r"no column .displacement_x_mm.; it has s_mm, u_x_mm$"):
        ProbeTable({"s_mm": np.zeros(1), "u_x_mm": np.zeros(1)}).look("displacement_x_mm")


# --- places ---
def test_points_are_found_in_their_elements(kind: str) -> None:
    """Fails if a point is given to another element, or the shape functions there are not those of the point.

    A linear field and the map itself are interpolated exactly wherever the point is.
    """
    space = box(kind, 5)
    points = np.random.default_rng(1).uniform(0.0, 1.0, (40, space.dim))
    points = np.concatenate([points, space.X[:6], space.X[space.conn[7]].mean(axis=0)[None]])
    places = find_places(space, points)
    np.testing.assert_allclose(places.at(space, space.X), points, atol=1e-12)
    corners = space.X[space.conn[places.elements]]
    assert (points >= corners.min(axis=1) - 1e-6).all() and (points <= corners.max(axis=1) + 1e-6).all()
    assert places.elements[-1] == 7
    with pytest.raises(ParameterError, match=r"^\(1.1, .* is outside of the body, whose nearest node is at \(1, "):
        find_places(space, np.full((1, space.dim), 1.1))


def test_a_point_in_a_notch_is_outside() -> None:
    """Fails if an element is taken that is only near to the point."""
    with pytest.raises(ParameterError, match="is outside of the body"):
        find_places(NOTCHED.sample.space, np.array([[0.1, 0.5]]))


# --- surfaces ---
def test_a_mean_over_a_surface_is_that_of_its_points(kind: str) -> None:
    """Fails if weights are not the area, or the points are not on the facets: a linear field has its middle's value."""
    space = box(kind, 4)
    nodes = np.flatnonzero(np.isclose(space.X[:, 0], 1.0))
    places, weights = Surface(space, "right", nodes).places()
    assert weights.sum() == pytest.approx(1.0, rel=1e-13)
    X = places.at(space, space.X)
    np.testing.assert_allclose(X[:, 0], 1.0, atol=1e-13)
    np.testing.assert_allclose(weights @ X, [1.0, *[0.5] * (space.dim - 1)], atol=1e-13)
    np.testing.assert_allclose(weights @ X[:, 1] ** 2, 1 / 3, atol=1e-13)  # the rule of Gauss has quadratic fields
    with pytest.raises(MeshError, match="boundary 'one' is no surface"):
        Surface(space, "one", nodes[:1])


def hollow(kind: str) -> tuple[Space, np.ndarray]:
    """A block of 5 elements an edge without its middle one, inner nodes moved, and the nodes of the cavity."""
    mesh = grid(kind, (5,) * (2 if kind == "quad" else 3))
    middle = np.linalg.norm(mesh.p[:, mesh.t].mean(axis=1) - 0.5, axis=0) < 0.01
    mesh = mesh.remove_elements(np.flatnonzero(middle))
    space = Space(distorted(mesh, 0.1))
    inside = (np.abs(space.X - 0.5) < 0.4).all(axis=1)
    return space, np.intersect1d(space.mesh.boundary_nodes(), np.flatnonzero(inside))


def test_enclosed_volumes(kind: str) -> None:
    """Fails if normals point inwards, or facets are not integrated exactly: the box, and the cavity in it.

    Under F the volumes grow by det F; a translation changes nothing.
    """
    space, cavity = hollow(kind)
    dim = space.dim
    outside = np.setdiff1d(space.mesh.boundary_nodes(), cavity)
    assert cavity.size == 2**dim
    F = np.eye(dim) + np.random.default_rng(3).uniform(-0.3, 0.3, (dim, dim))
    x = space.X @ F.T + 7.0
    outer, inner = (Surface(space, name, nodes) for name, nodes in (("outside", outside), ("cavity", cavity)))
    assert outer.volume(space.X) == pytest.approx(1.0, rel=1e-13) and not outer.rims() and not inner.rims()
    assert -inner.volume(space.X) == pytest.approx(0.2**dim, rel=1e-12)
    for surface in (outer, inner):
        assert surface.volume(x) == pytest.approx(np.linalg.det(F) * surface.volume(space.X), rel=1e-12)
    assert outer.volume(x) + inner.volume(x) == pytest.approx(np.linalg.det(F) * space.V.sum(), rel=1e-12)


def test_open_boundaries_are_capped() -> None:
    """Fails if flat caps, or lines to a point, do not close what they should: a channel, a tube, and parts of them.

    Four facets a quarter: the polygon has the area 8 sin(pi/8) R^2/2 a quarter of which is 2 sin(pi/8) R^2.
    """
    r, t = np.linspace(1.0, 2.0, 3), np.linspace(0.0, np.pi / 2, 5)
    plane = skfem.MeshQuad.init_tensor(r, t)
    ring = Space(skfem.MeshQuad(np.array([plane.p[0] * np.cos(plane.p[1]), plane.p[0] * np.sin(plane.p[1])]), plane.t))
    arc = np.flatnonzero(np.isclose(np.linalg.norm(ring.X, axis=1), 1.0))
    quarter = 2 * np.sin(np.pi / 8)
    surface = Surface(ring, "arc", arc)
    surface.check_caps()
    assert -surface.volume(ring.X) == pytest.approx(quarter - 0.5, rel=1e-12)        # to the chord
    assert -surface.volume(ring.X, np.zeros(2)) == pytest.approx(quarter, rel=1e-12)  # to the middle
    both = np.flatnonzero(np.abs(ring.X[:, 1]) < 1e-9)
    with pytest.raises(ParameterError, match="is 2 open lines"):
        Surface(ring, "ends", np.union1d(both, np.flatnonzero(np.abs(ring.X[:, 0]) < 1e-9))).check_caps()

    block = grid("hex", (3, 3, 4), (3.0, 3.0, 2.0))
    x, y, _ = block.p[:, block.t].mean(axis=1)
    tube = Space(block.remove_elements(np.flatnonzero((np.abs(x - 1.5) < 0.1) & (np.abs(y - 1.5) < 0.1))))
    bore = np.flatnonzero((np.abs(tube.X[:, :2] - 1.5) < 0.6).all(axis=1))
    surface = Surface(tube, "bore", bore)
    surface.check_caps()
    assert len(surface.rims()) == 2
    assert -surface.volume(tube.X + np.array([1.0, 2.0, 3.0])) == pytest.approx(2.0, rel=1e-12)
    assert -surface.volume(tube.X * [1.1, 1.2, 1.3]) == pytest.approx(2.0 * 1.1 * 1.2 * 1.3, rel=1e-12)
    slanting = bore[~((tube.X[bore, 2] > 1.9) & (tube.X[bore, 0] > 1.5) & (tube.X[bore, 1] > 1.5))]
    with pytest.raises(ParameterError, match=r"the rim of the boundary 'bore' around .* is not in a plane"):
        Surface(tube, "bore", slanting).check_caps()


# --- quantities ---
def values_at(momentum: Momentum, u: np.ndarray, quantity: str, points: np.ndarray) -> np.ndarray:
    """Values of a quantity at points of an intact body."""
    state = State.intact(momentum.space)
    state.u, state.v = u, 2.0 * u
    momentum.set_gamma(state.gamma, state.deleted)
    momentum.force(u)
    return QUANTITIES[quantity].values(momentum, state, find_places(momentum.space, points))


@pytest.mark.parametrize("element", ["jbar", "planestress"])
@pytest.mark.parametrize("material", [AAA(), NeoHookean(mu=0.4)])
def test_quantities_of_a_homogeneous_stretch(element: str, material: Material) -> None:
    """Fails if stress, stretches, energy or displacement are not those of the law at F, wherever they are looked at."""
    space = box("quad", 4)
    F = np.eye(3)
    F[:2, :2] = [[1.3, 0.2], [-0.1, 0.9]]
    if element == "planestress":
        F = material.thin_sheet(F[:2, :2])
    u, points = space.X @ (F[:2, :2] - np.eye(2)).T, np.array([[0.31, 0.77], [0.5, 0.02]])
    momentum = Momentum(space, material, element)
    sigma = material.first_piola(F) @ F.T / np.linalg.det(F)
    of = {name: values_at(momentum, u, name, points) for name in QUANTITIES}
    assert all(len(one.names(2)) == of[name].shape[1] for name, one in QUANTITIES.items())
    for row in range(2):
        np.testing.assert_allclose(of["stress"][row], [sigma[0, 0], sigma[1, 1], sigma[2, 2], sigma[0, 1]], atol=1e-9)
        np.testing.assert_allclose(of["principal_stresses"][row], np.linalg.eigvalsh(sigma)[::-1], atol=1e-9)
        np.testing.assert_allclose(of["stretches"][row], np.linalg.svd(F)[1], rtol=1e-10)
        np.testing.assert_allclose(of["displacement"][row], (F[:2, :2] - np.eye(2)) @ points[row], atol=1e-14)
        np.testing.assert_allclose(of["velocity"][row], 2 * of["displacement"][row], atol=1e-14)
        np.testing.assert_allclose(of["W"][row], material.energy(F), rtol=1e-9)
        assert of["pressure"][row, 0] == pytest.approx(-np.trace(sigma) / 3)
        assert of["gamma"][row, 0] == pytest.approx(1.0)


def test_a_rotation_strains_nothing(kind: str) -> None:
    """Fails if a rigid motion is seen as a strain or a stress."""
    space = box(kind, 3)
    dim, angle = space.dim, 1.1
    Q = np.eye(dim)
    Q[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    momentum, points = Momentum(space, AAA()), np.full((1, dim), 0.4)
    u = space.X @ (Q - np.eye(dim)).T + 3.0
    np.testing.assert_allclose(values_at(momentum, u, "stretches", points), 1.0, atol=1e-12)
    np.testing.assert_allclose(values_at(momentum, u, "stress", points), 0.0, atol=1e-9)
    assert values_at(momentum, u, "stress", points).shape == (1, 6 if dim == 3 else 4)


def test_the_stress_of_some_elements_is_that_of_all(kind: str) -> None:
    """Fails if elements, parts or fibres are mixed up where the stress of some elements is asked for."""
    space = box(kind, 4)
    regions = [Region("soft", np.arange(5, space.n_elements, 2), NeoHookean(mu=0.1), skfsink.SinkLaw())]
    momentum = Momentum(space, AAA(), regions=regions)
    u = np.random.default_rng(0).uniform(-0.02, 0.02, space.X.shape) + 0.1 * space.X
    some = np.random.default_rng(1).permutation(space.n_elements)[:12]
    np.testing.assert_allclose(cauchy_stress(momentum, u, some), cauchy_stress(momentum, u)[some], rtol=1e-12)


def test_unknown_quantities_are_refused() -> None:
    """Fails if a misprint passes."""
    assert [one.unit for one in quantities_of("stress, gamma")] == ["MPa", "1"]
    with pytest.raises(ParameterError, match=r"one or more of displacement, .* got 'strain'"):
        quantities_of("gamma, strain")
    with pytest.raises(ParameterError, match="gamma twice"):
        quantities_of("gamma, gamma")


# --- runs ---
def sliding() -> Scene:
    """A block in plane strain that is pulled and free to contract: its deformation is homogeneous."""
    space = PLAIN.space
    X = space.X
    sides = {name: np.flatnonzero(np.isclose(X[:, axis], end)) for name, axis, end in (
        ("left", 0, 0.0), ("right", 0, 1.0), ("bottom", 1, 0.0), ("top", 1, 1.0))}
    sides["surface"] = space.mesh.boundary_nodes()
    base = scene(Sample("block", space, sides), event_time=2e-7, record_every=1e-7)
    return Scene(base.case, base.title, {}, base.sample, base.material, base.sink_law,
                 (Grip("top", (None, 1e-3)), Grip("bottom", (None, 0.0)), Grip("left", (0.0, None))),
                 controls=base.controls)


def test_probes_of_a_homogeneous_run_agree_with_the_law(tmp_path: Path) -> None:
    """Fails if reaction, stress, stretch, area or opening are not those of one homogeneous deformation.

    Until the density of the body is uneven: while gamma is above 0.99 in all of the loading. Reaction = stress times
    deformed width, power of the grip = change of the energy, and the area is the product of the stretches.
    """
    s = sliding()
    of = [PointProbe("point", (0.31, 0.62)), ReactionProbe("all"), ReactionProbe("top", "top, right"),
          MeanProbe("mean", "right", "displacement, stress"), VolumeProbe("area", "surface"),
          OpeningProbe("height", "bottom", "top"), OpeningProbe("width", (0.0, 0.5), (1.0, 0.5)),
          LineProbe("line", (0.0, 0.5), (1.0, 0.5), 5, "displacement, stress")]
    run(s, tmp_path / "run", of, quiet=True)
    found = load(tmp_path / "run")
    history, probes = found.history, found.probes
    assert set(probes) == {probe.label for probe in of}
    loading = (history["phase"] == "loading") & (history["gamma_min"] > 0.99)
    assert loading.sum() > 2
    rows = {name: {key: table.look(key)[loading] for key in table} for name, table in probes.items()}
    for name, table in probes.items():
        np.testing.assert_array_equal(table.look("step")[:, 0], history["step"], err_msg=name)
        np.testing.assert_array_equal(table.look("time_s")[:, 0], history["time_s"])
        np.testing.assert_array_equal(table.look("grip_displacement_mm")[:, 0], history["grip_displacement_mm"])
    point, width = rows["point"], rows["width"]["distance_mm"]
    across, along = width, rows["height"]["distance_mm"]
    assert along[-1] > 1.1
    np.testing.assert_allclose(point["stretch_1"], along, rtol=1e-6)
    np.testing.assert_allclose(point["stretch_3"], across, rtol=1e-6)
    np.testing.assert_allclose(point["stretch_2"], 1.0)
    np.testing.assert_allclose(rows["area"]["area_mm2"], along * across, rtol=1e-6)
    np.testing.assert_allclose(rows["height"]["opening_mm"], along - 1.0, atol=1e-12)
    law = []
    for a, b, gamma in zip(across[:, 0], along[:, 0], point["gamma"][:, 0]):
        F = np.diag([a, b, 1.0])
        law.append(gamma * np.diag(s.material.first_piola(F) @ F.T / np.linalg.det(F)))
    stress = np.column_stack([point[f"stress_{c}_MPa"] for c in ("xx", "yy", "zz")])
    np.testing.assert_allclose(stress, law, rtol=1e-4, atol=2e-5)
    np.testing.assert_allclose(stress[:, 0], 0.0, atol=1e-5)                # free sides
    force = rows["all"]["top_y_N_per_mm"]
    np.testing.assert_allclose(force, point["stress_yy_MPa"] * width, rtol=1e-5)
    np.testing.assert_allclose(rows["all"]["bottom_y_N_per_mm"], -force, rtol=1e-5)
    np.testing.assert_array_equal(rows["top"]["top_y_N_per_mm"], force)
    np.testing.assert_allclose(force[:, 0], history["reaction_N_per_mm"][loading], rtol=1e-12)
    assert np.abs(rows["top"]["right_x_N_per_mm"]).max() < 1e-5
    np.testing.assert_allclose(rows["mean"]["u_x_mm"], across - 1.0, atol=1e-6)
    np.testing.assert_allclose(rows["mean"]["stress_yy_MPa"], point["stress_yy_MPa"], rtol=1e-4)
    line = probes["line"]
    assert line.points == 5 and line.units["stress_yy_MPa"] == "MPa" and line.units["s_mm"] == "mm"
    np.testing.assert_allclose(rows["line"]["s_mm"][0], [0, 0.25, 0.5, 0.75, 1.0])
    np.testing.assert_allclose(rows["line"]["u_x_mm"], (across - 1.0) * rows["line"]["x_mm"], atol=1e-6)


@pytest.mark.parametrize("stop", [3, 40])
def test_a_resumed_run_has_the_same_files_of_probes(stop: int, tmp_path: Path) -> None:
    """Fails if rows are lost, doubled or altered where a run goes on, in the loading or in the event."""
    def probes() -> list[Any]:
        return [PointProbe("p", (0.6, 0.5)), LineProbe("l", (0.5, 0.5), (1.0, 0.5), 4, "velocity", every=2e-6),
                ReactionProbe("r"), OpeningProbe("o", (0.0, 0.4), "top")]
    s = scene(NOTCHED.sample, event_time=6e-6, overshoot=0.01, checkpoint_every=1e6, frame_every=1e-4)
    simulation(s, tmp_path / "whole", *probes()).run()
    broken = simulation(s, tmp_path / "broken", *probes(), Stop(stop))
    with pytest.raises(Interrupted):
        broken.run()
    for path in (tmp_path / "broken" / "probes").iterdir():  # what was written after the checkpoint goes
        path.write_text(path.read_text() + "event,1")
    Simulation(s, tmp_path / "broken", Display(True), resume=True, observers=probes()).run()
    whole, again = (contents(tmp_path / name / "probes") for name in ("whole", "broken"))
    assert whole == again and len(whole) == 4
    line = read_probes(tmp_path / "whole")["l"]
    times = line.look("time_s")[line.look("phase")[:, 0] == "event", 0]
    np.testing.assert_array_equal((times / 2e-6).astype(int), [0, 1, 2, 3, 3])  # begin, every 2 us, end


def test_probes_of_a_deck(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if probes of a deck are lost, change the run, are not in `scene.toml`, or keep it from being resumed."""
    write_mesh(tmp_path / "plate.vtu", plate())
    monkeypatch.chdir(tmp_path)
    assert invoke_program("run", deck(tmp_path, HEAD + GRIPS), "--out", "without", "--quiet") == (0, "", "")
    assert invoke_program("run", deck(tmp_path, HEAD + GRIPS + PROBES), "--out", "with", "--quiet") == (0, "", "")
    assert invoke_program("run", "with/scene.toml", "--out", "again", "--quiet") == (0, "", "")
    one, two, again = (contents(tmp_path / name) for name in ("without", "with", "again"))
    for name in ("history.csv", "deletions.csv", "series/run.pvd", "series/run_0000.vtu"):
        assert one[name] == two[name] == again[name]
    files = {name: text for name, text in two.items() if name.startswith("probes/")}
    assert len(files) == 6 and files == {name: text for name, text in again.items() if name.startswith("probes/")}
    assert "[[probes]]" in two["scene.toml"].decode() and "[[probes]]" not in one["scene.toml"].decode()
    assert invoke_program("resume", "with", "--quiet") == (0, "", "")
    probes = load(tmp_path / "with").probes
    np.testing.assert_allclose(probes["mouth"]["distance_mm"][0] - probes["mouth"]["opening_mm"][0], 0.308)
    assert probes["body"]["area_mm2"][0] > 0.25 and probes["ligament"].points == 7
    assert load(tmp_path / "without").probes == {}
    np.testing.assert_allclose(probes["forces"]["top_y_N_per_mm"], load(tmp_path / "with").history["reaction_N_per_mm"])
    assert invoke_program("run", deck(tmp_path, HEAD + GRIPS), "--out", "with", "--overwrite", "--quiet") == (0, "", "")
    assert load(tmp_path / "with").probes == {}  # those of the run before are gone


def test_the_picture_of_probes(tmp_path: Path, pictures: None) -> None:
    """Fails if a run with probes leaves no picture of them, or one of the other kind."""
    s = scene(NOTCHED.sample, event_time=4e-7, record_every=1e-7)
    for name, probe in (("line", LineProbe("l", (0.6, 0.5), (1.0, 0.5), 3)), ("point", PointProbe("p", (0.6, 0.5)))):
        run(s, tmp_path / name, [probe], quiet=True)
    assert (tmp_path / "point" / "probes.png").stat().st_size > 2e4 and not (tmp_path / "line" / "probes.png").exists()
    assert (tmp_path / "line" / "lines.png").stat().st_size > 2e4 and not (tmp_path / "point" / "lines.png").exists()
    assert (tmp_path / "line" / "density.png").exists()


def test_lines_are_drawn_as_the_loading_and_the_event_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if another look than the last of its phase is drawn, over another distance, or means as if interpolated."""
    kept: list[Figure] = []
    monkeypatch.setattr(line_curves, "Figure", lambda *a, **k: kept.append(Figure(*a, **k)) or kept[-1])
    s, looks = np.array([0.0, 0.5, 2.0]), 4
    stress = np.arange(12.0)
    table = ProbeTable({"phase": np.repeat(["loading", "loading", "event", "event"], 3),
                        "step": np.repeat([1, 2, 0, 1], 3), "time_s": np.zeros(12),
                        "grip_displacement_mm": np.zeros(12), "s_mm": np.tile(s, looks),
                        "x_mm": np.tile(s, looks), "u_x_mm": -stress, "stress_xx_MPa": stress})
    line_curves.line_picture({"wall": table}, tmp_path / "lines.png")
    ways, means = kept[0].axes
    assert (ways.get_ylabel(), means.get_ylabel()) == ("wall (mm)", "wall (MPa)")
    for ax, sign, steps in ((ways, -1, "default"), (means, 1, "steps-mid")):
        assert [line.get_ydata().tolist() for line in ax.lines] == [[sign * x for x in (3, 4, 5)],
                                                                    [sign * x for x in (9, 10, 11)]]
        assert all(line.get_xdata().tolist() == s.tolist() and line.get_drawstyle() == steps for line in ax.lines)
    line_curves.line_picture({}, tmp_path / "none.png")
    assert not (tmp_path / "none.png").exists()


def test_quasistatic_runs_and_both(tmp_path: Path) -> None:
    """Fails if a clock of passes is taken for seconds, or the two runs share the rows of a probe."""
    s = scene(NOTCHED.sample, event_time=4e-7, record_every=1e-7, analysis="both")
    result = run(s, tmp_path / "both", [PointProbe("p", (0.6, 0.5), "gamma", every_passes=3)], quiet=True)
    parts = {name: load(part.folder).probes["p"] for name, part in result.parts.items()}
    quasistatic = parts["quasistatic"]
    event = quasistatic["phase"] == "event"
    assert (quasistatic["time_s"][event] == 0).all() and (parts["dynamic"]["time_s"][-1] > 0)
    moments = [step for step in quasistatic["step"][event][:-1] if step % 3]  # where it branches or arrives
    assert quasistatic["step"][event].max() > 6 and len(moments) <= 2
    assert (parts["dynamic"]["phase"] == "loading").sum() > 2


# --- what is refused ---
@pytest.mark.parametrize(("probe", "said"), [
    (PointProbe("p", (5.0, 0.5)), "probe p: (5, 0.5) mm is outside of the body, whose nearest node is at"),
    (PointProbe("p", (0.5, 0.5, 0.5)), "probe p: position must be 2 coordinates [mm], as the mesh; got (0.5, 0.5"),
    (PointProbe("p", (0.5, float("nan"))), "probe p: position [1] must be a finite number"),
    (PointProbe("p", (0.5, 0.8), "strain"), "probe p: quantity must be one or more of"),
    (LineProbe("l", (0.0, 0.2), (0.0, 0.8), 3), "probe l: (0, 0.5) mm is outside of the body"),
    (LineProbe("l", (0.6, 0.2), (0.6, 0.2), 5), "probe l: position and to are one point"),
    (LineProbe("l", (0.6, 0.2), (0.6, 0.8), 1), "probe l: points must be a whole number in [2, "),
    (ReactionProbe("r", "top, roof"), "probe r: mesh block15 has no boundary 'roof'; it has "),
    (MeanProbe("m", "pin"), "probe m: boundary 'pin' is no surface"),
    (VolumeProbe("v", "top"), "probe v: the boundary 'top' is flat, and encloses nothing"),
    (OpeningProbe("o", "top", "top"), "probe o: the ends are one boundary, 'top'")])
def test_what_cannot_be_followed_is_refused(probe: Any, said: str, tmp_path: Path) -> None:
    """Fails if a probe that cannot be is found late, or what is wrong is not said."""
    with pytest.raises(SkfsinkError, match="^" + re.escape(said)):
        run(scene(NOTCHED.sample), tmp_path / "out", [probe], quiet=True)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["", "a/b", "../x", ".x", 3, "a b", "x" * 61])
def test_names_of_probes_are_those_of_files(name: Any) -> None:
    """Fails if a name could be another path."""
    with pytest.raises(ParameterError, match="the name of a probe must be"):
        ReactionProbe(name)


@pytest.mark.parametrize(("table", "said"), [
    ({}, "probe p: kind is missing; it must be one of point, line, mean, reaction, volume, opening, release_rate"),
    ({"kind": "dot"}, "probe p: kind must be one of point, line,"),
    ({"kind": "release_rate"}, "probe p: a release_rate needs every"),
    ({"kind": "release_rate", "every": 1e-6, "to": [0, 0]}, "probe p: to is no key of a release_rate"),
    ({"kind": "point"}, "probe p: a point needs position"),
    ({"kind": "line", "position": [0, 0], "to": [1, 1]}, "probe p: a line needs points"),
    ({"kind": "point", "position": [0, 0], "to": [1, 1]}, "probe p: to is no key of a point, which takes position, "),
    ({"kind": "opening", "position": [0, 0]}, "probe p: an opening needs to or to_boundary"),
    ({"kind": "opening", "position": [0, 0], "boundary": "x", "to": [1, 1]},
     "probe p: an opening needs position or boundary, not both")])
def test_tables_that_are_no_probes(table: dict[str, Any], said: str) -> None:
    """Fails if a table of a deck is read otherwise than it is meant."""
    with pytest.raises(ParameterError, match="^" + re.escape(said)):
        probe_of({"name": "p", **table})


@pytest.mark.parametrize(("text", "said"), [
    ('[[probes]]\nkind = "point"\n', "probes: name must be a name"),
    ('[[probes]]\nname = "p"\nkind = "point"\nposition = [1]\n', "probe p, position must be 2 or 3 coordinates"),
    ('[[probes]]\nname = "p"\nkind = "point"\nposition = ["1 s", 1]\n', "probe p, position must be a quantity in mm"),
    ('[[probes]]\nname = "p"\nkind = "point"\nat = [1, 2]\n', "probes: unknown key 'at'; the keys are name, kind"),
    ('[[probes]]\nname = "p"\nkind = "reaction"\nevery = 0\n', "every of the observer probe p must be a finite number"),
    ('[[probes]]\nname = "p"\nkind = "reaction"\n' * 2, "two observers are called probe p"),
    ('[[probes]]\nname = "p"\nkind = "point"\nposition = [9, 9]\n', "probe p: (9, 9) mm is outside")])
def test_decks_with_wrong_probes(text: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a mistake in a deck is found late, or is not named."""
    write_mesh(tmp_path / "plate.vtu", plate())
    monkeypatch.chdir(tmp_path)
    status, stderr, _ = invoke_program("run", deck(tmp_path, HEAD + GRIPS + text), "--out", "out", "--quiet")
    assert status == 2 and said in stderr and stderr.count("\n") == 1 and not (tmp_path / "out").exists()
