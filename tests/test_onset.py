"""Loading of bodies without a notch, beyond the peak, back and forth; points that wait; steps that are given up."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
from bodies import at_onset, box, grid, held_body
from plates import invoke_program

import skfsink
from skfsink.cases.symmetric_double_edge_notch import symmetric_double_edge_notch
from skfsink.errors import ParameterError
from skfsink.fem.indicators import greatest_stretch
from skfsink.fem.space import Space
from skfsink.fields.body import Body
from skfsink.fields.density import Density, DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.fields.state import State
from skfsink.loads.grips import Grip, Ramp
from skfsink.material import AAA, SinkLaw
from skfsink.material.homogeneous import peaks
from skfsink.material.library import MATERIALS
from skfsink.material.regions import Region
from skfsink.meshing.sample import Sample
from skfsink.meshing.vtu import write_mesh
from skfsink.methods.controls import HHTControls, StaticsControls
from skfsink.methods.explicit import Explicit
from skfsink.methods.hht import HHT
from skfsink.methods.hht_trial import Trial
from skfsink.methods.statics import Statics
from skfsink.run.material_point import beside_theory, mean_deformation, mean_stress
from skfsink.run.observers.gauge import Gauge
from skfsink.scene.controls import Controls
from skfsink.scene.options import Options
from skfsink.scene.scene import Scene

SPEED = 1e-3


def scene(shape: tuple[int, int], size: tuple[float, float], l: float, material: AAA | None = None,
          regions: tuple[Region, ...] = (), pull: float | Ramp = SPEED) -> Scene:
    """A strip in plane stress on rollers, pulled along x."""
    space = Space(grid("quad", shape, size))
    x, y = space.X.T
    sides = {"left": x == 0, "right": x == x.max(), "bottom": y == 0}
    sample = Sample("strip", space, {name: np.flatnonzero(mask) for name, mask in sides.items()})
    grips = (Grip("right", (pull, None)), Grip("bottom", (None, 0.0)), Grip("left", (0.0, None)))
    return Scene("custom", "strip", {}, sample, material or AAA(), SinkLaw(length_scale=l), grips, regions=regions,
                 controls=Controls(element="planestress"))


class Loaded:
    """A scene loaded to the end of its loading: the last state, the way to it, and what computed it."""

    def __init__(self, scene: Scene, **controls: float) -> None:
        loading, space = scene.loading(), scene.sample.space
        element = scene.controls.element
        self.momentum = Momentum(space, scene.material, element, regions=scene.regions, dead=loading.dead)
        density = DensitySolver(space, scene.sink_law, regions=scene.regions)
        self.statics = Statics(Body(self.momentum, density, loading), StaticsControls(**controls))
        self.state, gauge, self.way, self.strain = State.intact(space), Gauge(scene, loading), [], []
        for _ in self.statics.load(self.state):
            force = self.momentum.force(self.state.u)
            self.way.append((gauge.displacement(self.state), gauge.load(force, self.state.u)))
            self.strain.append((mean_deformation(self.momentum, self.state.u), mean_stress(space, force)))
        self.loads = np.array(self.way)[:, 1]


@pytest.mark.parametrize(("shape", "size", "l"), [((1, 1), (1.0, 1.0), 1.0), ((20, 2), (10.0, 1.0), 1.0)])
def test_greatest_load_of_an_even_body_is_that_of_the_theory(shape: tuple[int, int], size: tuple[float, float],
                                                             l: float) -> None:
    """Fails if the peak is passed over in long increments, or the strength is read where the loading ends."""
    pulled = scene(shape, size, l, AAA(bulk_modulus=5e4))
    body = Loaded(pulled)
    found = beside_theory(pulled, *body.strain[int(np.argmax(body.loads))])
    assert found is not None and found["path"] == "uniaxial tension"
    assert abs(found["difference"]) < 1e-3
    assert abs(found["stretch_at_greatest_load"] / found["stretch_theory"] - 1) < 5e-3


def test_a_long_strip_is_loaded_to_its_last_stable_state(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if loading goes on along the falling branch, which an even strip of many lengths l cannot bear.

    A material point can, and is followed down.
    """
    strip = Loaded(scene((20, 2), (10.0, 1.0), 0.25))
    assert strip.statics.refused == "unstable"
    assert strip.loads[-1] > 0.98 * strip.loads.max()
    point = Loaded(scene((1, 1), (1.0, 1.0), 1.0))
    assert point.loads[-1] < 0.4 * point.loads.max()
    assert 30 < len(point.way) < 200
    monkeypatch.setattr(Statics, "stable", lambda *_: True)
    assert Loaded(scene((20, 2), (10.0, 1.0), 0.25)).loads[-1] < 0.985 * strip.loads[-1]


def test_a_body_that_is_stretched_far_is_followed_over_its_peak() -> None:
    """Fails if the loading ends where increments are too long for a softening body: 7 % below its strength.

    The way to failure is long in Gent's law, and the interval that settles the onset longer than the finest increment.
    """
    law = MATERIALS["gent"](bulk_modulus=5e4)  # type: ignore[call-arg]
    sheet = replace(scene((8, 2), (4.0, 1.0), 0.5), material=law, sink_law=SinkLaw(15.62, m=10, length_scale=0.5))
    body = Loaded(sheet)
    assert body.loads[-1] < body.loads.max()
    found = beside_theory(sheet, *body.strain[int(np.argmax(body.loads))])
    assert found is not None and abs(found["difference"]) < 2e-3


def test_a_body_that_is_pressed_is_not_beside_tension() -> None:
    """Fails if uniaxial compression is compared with equibiaxial tension, whose stretches it has."""
    pressed = scene((4, 1), (4.0, 1.0), 1.0, pull=-SPEED)
    body = Loaded(pressed)
    F, P = body.strain[int(np.argmax(body.loads))]
    assert np.allclose(np.linalg.svd(F)[1], (F[1, 1], F[1, 1], F[1, 1] ** -2), rtol=0.01)
    assert beside_theory(pressed, F, P) is None


def test_the_ledger_of_a_body_that_is_low_along_its_load_closes() -> None:
    """Fails if increments of 1 % of its width, a fifth of its height, are all taken."""
    low = Loaded(scene((2, 20), (1.0, 20.0), 0.5))
    assert low.way[0][0] == pytest.approx(0.1)
    ledger = low.state.ledger
    assert abs(ledger.balance) < 0.05 * ledger.elastic
    assert low.loads.max() / 20 == pytest.approx(1.131, rel=2e-3)


def test_an_increment_that_is_given_up_is_forgotten() -> None:
    """Fails if the density solver remembers the sink of an increment that was given up.

    The first increments of a wide low strip are far too long. What is left of them made the body whole for ever: it was
    loaded to 300 times its energy limiter.
    """
    wide = scene((25, 4), (100.0, 1.0), 0.25)
    X = wide.sample.space.X
    sides = {**wide.sample.boundaries, "top": np.flatnonzero(X[:, 1] == 1.0)}
    pulled = Scene("custom", "wide", {}, Sample("wide", wide.sample.space, sides), wide.material, wide.sink_law,
                   (Grip("top", (None, SPEED)), Grip("left", (0.0, None)), Grip("bottom", (None, 0.0))),
                   controls=wide.controls)
    body = Loaded(pulled)
    stretch = 1 + body.way[int(np.argmax(body.loads))][0]
    assert not body.statics.unfailed
    assert 1.23 < stretch < 1.27
    assert body.loads.max() / 100 == pytest.approx(1.131, rel=2e-3)


def test_a_weak_region_fails_where_it_is() -> None:
    """Fails if a weaker part of a strip stays whole, or the strength is not that of the weak part."""
    strip = scene((40, 4), (10.0, 1.0), 0.5)
    middle = strip.sample.space.X[strip.sample.space.conn].mean(axis=1)
    weak = Region("weak", np.flatnonzero(abs(middle[:, 0] - 7) < 1), AAA(), SinkLaw(0.5 * 0.1686, length_scale=0.5))
    body = Loaded(scene((40, 4), (10.0, 1.0), 0.5, regions=(weak,)))
    X = strip.sample.space.X
    assert abs(X[np.argmin(body.state.gamma), 0] - 7) < 1
    assert body.loads.max() < 0.75 * 1.131


def test_increments_are_refined_only_where_a_body_softens() -> None:
    """Fails if the increments of an elastic body are cut, or an elastic fall of the load is taken for a failure."""
    ramp = Ramp((0.0, 1.0, 2.0), (0.0, 0.5, 0.0))
    body = Loaded(scene((10, 1), (10.0, 1.0), 0.5, pull=ramp))
    assert len(body.way) == 10
    assert body.loads[4] == body.loads.max() > 0
    assert body.statics.unfailed == "nothing moves after load time 2 s"
    again = State.intact(body.momentum.space)
    assert len(list(body.statics.load(again))) == 10  # another body is not ended by what became of this one
    assert abs(body.loads[-1]) < 1e-6


def test_loading_without_failure_has_limits() -> None:
    """Fails if a body that cannot fail is stretched for ever."""
    endless = scene((4, 1), (4.0, 1.0), 1.0, AAA(c2=0.0))
    strong = Scene(**{**endless.__dict__, "sink_law": SinkLaw(phi=1e9, length_scale=1.0)})
    body = Loaded(strong, increment=0.5)
    assert body.statics.unfailed == "the body is stretched by more than 20"
    assert 20 < greatest_stretch(strong.sample.space, body.state.u, np.ones(4, bool)) < 21


def test_a_body_that_should_have_failed_is_not_loaded_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a defect that keeps gamma at 1 lets a body be loaded without end: all points are far past failure."""
    monkeypatch.setattr(DensitySolver, "update", lambda self, W_max, before, tolerance=None: before)
    body = Loaded(scene((4, 1), (4.0, 1.0), 1.0))
    assert body.statics.unfailed.startswith("every point is past its energy limiter, by W/Phi = 2.")


def test_factors_kept_from_an_increment_given_up_do_not_change_the_equilibrium() -> None:
    """Fails if factors made far away lead Newton's method to another equilibrium than none: within its tolerance."""
    ends = at_onset(box("quad", 6))
    state = ends.fresh()
    found, counts = [], []
    for far in (False, True):
        statics = Statics(ends.body, StaticsControls(tolerance=1e-9))
        ends.momentum.set_gamma(state.gamma, state.deleted)
        if far:
            statics.newton.predict(0.98 * state.u, np.zeros_like(state.u))  # as for an increment that is given up
            assert "kept_u" in statics.newton.memory()
        counts.append(statics.factorisations)
        found.append(statics.equilibrium(state.u)[0])
        counts.append(statics.factorisations)
    assert counts == [0, 1, 1, 1]  # the factors of far away have served
    assert 0 < np.abs(found[0] - found[1]).max() < 1e-7 * np.abs(state.u).max()


def test_points_wait_only_for_points_that_fail() -> None:
    """Fails if points wait for one that failed long ago and still bears the greatest energy: passes never end."""
    ends = at_onset(box("quad", 6))
    statics, state = Statics(ends.body, StaticsControls(front=0.95)), ends.fresh()
    phi = ends.density.phi
    ends.momentum.set_gamma(state.gamma, state.deleted)
    state.W_max = np.full_like(state.W_max, 0.5 * phi)
    W = state.W_max.copy()
    W[3, 0], state.W_max[3, 0] = 3.0 * phi, 2.9 * phi  # dead since W was 1.6 phi
    W[20, 1], W[21, 2] = 1.3 * phi, 1.1 * phi
    assert statics._follow(state, W)
    assert state.W_max[20, 1] == 1.3 * phi
    assert state.W_max[21, 2] == 0.5 * phi  # waits for the other one


def test_an_implicit_step_that_is_given_up_leaves_no_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if anything of a step that was halved is left in what computes the next one."""
    results = []
    for first in (4e-6, 2e-6):
        ends = at_onset(box("quad", 6))
        state = ends.fresh()
        scheme = HHT(ends.body, HHTControls(dt=4e-6, dt_first=first))
        scheme.begin(state)
        iterate, calls = Trial.iterate, []

        def refuse(trial: Trial, iterate=iterate, calls=calls) -> bool:  # type: ignore[no-untyped-def]
            calls.append(trial.dt)
            return iterate(trial) and not (trial.dt > 3e-6 and len(calls) == 1)

        monkeypatch.setattr(Trial, "iterate", refuse)
        scheme.step(state)
        monkeypatch.undo()
        assert len(calls) == (2 if first > 3e-6 else 1)
        results.append(state)
    for name in ("u", "v", "a", "gamma", "W_max", "sink"):
        np.testing.assert_array_equal(getattr(results[0], name), getattr(results[1], name), err_msg=name)


def test_a_density_that_has_not_changed_is_kept() -> None:
    """Fails if an unchanged history is solved for again, or a changed one is not."""
    space = box("quad", 5)
    solver = DensitySolver(space, SinkLaw())
    one = solver.update(np.full_like(space.w, 0.15), Density(np.ones(space.n_nodes)))
    assert solver.update(np.full_like(space.w, 0.15), one) is one
    other = solver.update(np.full_like(space.w, 0.16), one)
    assert other.gamma.max() < one.gamma.min()
    np.testing.assert_array_equal(solver.update(np.full_like(space.w, 0.15), Density(np.ones(space.n_nodes))).gamma,
                                  one.gamma)


@pytest.mark.parametrize("kind", ["quad", "hex"])
def test_a_body_held_everywhere_is_loaded(kind: str) -> None:
    """Fails if a body without unknowns, as one element between two grips, is said to have no equilibrium."""
    space = box(kind, 1, 0.0)
    momentum, density = Momentum(space, AAA()), DensitySolver(space, SinkLaw(length_scale=1.0))
    velocity = np.zeros_like(space.X)
    velocity[:, 0] = SPEED * space.X[:, 1]  # simple shear
    free, state = np.zeros(space.X.size, bool), State.intact(space)
    loads = []
    for _ in Statics(held_body(momentum, density, free, velocity)).load(state):
        loads.append(float(np.vdot(momentum.force(state.u), velocity)) / SPEED)
    assert max(loads) == pytest.approx(peaks(AAA(), SinkLaw())["simple shear"].stress, rel=2e-3)
    scheme, start = Explicit(held_body(momentum, density, free, velocity)), state.time
    scheme.begin(state)
    scheme.step(state)
    assert state.time > start and 0.0 < scheme.dt < np.inf
    with pytest.raises(ParameterError, match="every node is held"):
        HHT(held_body(momentum, density, free, velocity))


# --- whole runs ---
HEAD = """case = "custom"
[parameters]
mesh = "strip.vtu"
length_scale = "{l} mm"
element = "planestress"
analysis = "{analysis}"
event_time = "{time}"
[[grips]]
boundary = "left"
x = 0
[[grips]]
boundary = "bottom"
y = 0
[[grips]]
boundary = "right"
x = {pull}
"""


def run(folder: Path, shape: tuple[int, int], size: tuple[float, float], l: float, pull: str,
        analysis: str = "dynamic", head: str = HEAD, event_time: str = "0.2 ms") -> dict:
    """Summary of the run of a deck."""
    mesh = grid("quad", shape, size)
    points = np.column_stack([mesh.p.T, np.zeros(mesh.p.shape[1])])
    quads = mesh.t.T
    a, b, c = (points[quads[:, i], :2] for i in range(3))
    turned = (b - a)[:, 0] * (c - b)[:, 1] - (b - a)[:, 1] * (c - b)[:, 0] < 0
    quads = np.where(turned[:, None], quads[:, ::-1], quads)
    write_mesh(folder / "strip.vtu", meshio.Mesh(points, [("quad", quads)]))
    (folder / "deck.toml").write_text(head.format(l=l, pull=pull, analysis=analysis, time=event_time))
    status, said, _ = invoke_program("run", folder / "deck.toml", "--out", folder / "out", "--quiet")
    assert (status, said) == (0, "")
    found: dict = json.loads((folder / "out" / "summary.json").read_text())
    return found


@pytest.mark.slow
def test_loading_and_unloading_is_a_result(tmp_path: Path, pictures: None) -> None:
    """Fails if a body that does not fail is an error, has no frames, or loads with the wrong sign."""
    summary = run(tmp_path, (10, 2), (5.0, 1.0), 0.5, '[["0 s", 0], ["1 s", "0.3 mm"], ["2 s", 0], ["3 s", "0.4 mm"], '
                                                      '["4 s", 0]]')
    assert summary["verdict"].startswith("nothing failed: the greatest W/Phi was 0.0")
    assert summary["verdict"].endswith("because nothing moves after load time 4 s")
    assert summary["onset"]["displacement_mm"] is None
    assert summary["loading"]["displacement_at_greatest_load_mm"] == pytest.approx(0.4)
    folder = tmp_path / "out"
    results = skfsink.load(folder)
    load, moved = (results.history[name] for name in ("reaction_N_per_mm", "grip_displacement_mm"))
    assert load.min() > -1e-6 and np.corrcoef(load, moved)[0, 1] > 0.99
    assert len(results.frames) > 10 and results.frames.times[-1] == 4.0
    assert results.frames.frame("end").point_data["displacement"].max() < 1e-5
    assert (folder / "loading.png").stat().st_size > 5000
    assert invoke_program("report", folder)[0] == 0
    assert "Nothing failed" in (folder / "report.html").read_text()
    history = (folder / "history.csv").read_bytes()
    assert invoke_program("resume", folder, "--quiet")[0] == 0
    assert json.loads((folder / "summary.json").read_text())["verdict"] == summary["verdict"]
    assert (folder / "history.csv").read_bytes() == history


def test_the_greatest_load_is_that_of_its_amount(tmp_path: Path) -> None:
    """Fails if a push before the pull that breaks the body is its strength, since it has the other sign."""
    summary = run(tmp_path, (5, 1), (2.5, 0.5), 0.5, '[["0 s", 0], ["1 s", "-0.4 mm"], ["2 s", 0], ["3 s", "1 mm"]]',
                  event_time="1 us", head=HEAD.replace("[[grips]]", """[[grips]]
boundary = "left"
x = [["0 s", 0], ["3 s", "0.1 mm"], ["4 s", 0]]
[[grips]]""", 1).replace('boundary = "left"\nx = 0', 'boundary = "bottom"\ny = 0'))
    loading = summary["loading"]
    assert loading["greatest_load"] == pytest.approx(-1.131 * 0.5, rel=2e-3)


@pytest.mark.slow
def test_both_analyses_report_the_same_strength(tmp_path: Path) -> None:
    """Fails if the analysis that starts from the other's onset takes the load there for the greatest of the way."""
    both = run(tmp_path, (10, 2), (5.0, 1.0), 0.5, '"1e-3 mm/s"', "both", event_time="1e-6 s")
    dynamic, quasistatic = (both[name] for name in ("dynamic", "quasistatic"))
    greatest = ("greatest_load", "displacement_at_greatest_load_mm")
    assert [dynamic["loading"][name] for name in greatest] == [quasistatic["loading"][name] for name in greatest]
    assert quasistatic["loading"]["greatest_load"] > 1.005 * quasistatic["onset"]["reaction_N_per_mm"]
    assert quasistatic["material_point"] == dynamic["material_point"]
    assert quasistatic["loading"]["greatest_W_over_phi"] == dynamic["loading"]["greatest_W_over_phi"] < 1


def test_a_body_that_only_softens_is_said_to(tmp_path: Path) -> None:
    """Fails if a ramp that ends past the peak of the load, before failure, leaves no word of it."""
    summary = run(tmp_path, (5, 1), (2.5, 0.5), 0.5, '[["0 s", 0], ["1 s", "0.625 mm"]]')
    assert re.search(r"nothing failed: .* near 1; the body has softened to gamma = 0\.9\d+; the", summary["verdict"])


@pytest.mark.slow
def test_runs_that_did_not_fail_are_compared(tmp_path: Path) -> None:
    """Fails if a report needs the energies of an event of each of its runs."""
    run(tmp_path, (2, 1), (1.0, 0.5), 0.5, '[["0 s", 0], ["1 s", "0.05 mm"]]', "both")
    assert invoke_program("report", tmp_path / "out")[0] == 0
    assert (tmp_path / "out" / "report.html").read_text().count(" nothing failed: ") == 2


def test_a_body_of_which_nothing_is_left_is_a_result(tmp_path: Path, pictures: None) -> None:
    """Fails if frames without an element cannot be drawn: under a dead load an even strip is spent to the last."""
    pull = '[["0 s", 0], ["10 s", "10 MPa"]]'
    summary = run(tmp_path, (4, 1), (2.0, 0.5), 0.5, pull, "quasistatic", head=HEAD.replace(
        '[[grips]]\nboundary = "right"', '[[tractions]]\nboundary = "right"'))
    assert summary["verdict"].startswith("failed everywhere at once")
    assert summary["deleted_elements"] == summary["elements"]
    assert (tmp_path / "out" / "density.png").stat().st_size > 5000
    assert not any("without a first arrival" in text for text in summary["warnings"])


def test_a_material_point_fails_everywhere_at_once(tmp_path: Path, pictures: None) -> None:
    """Fails if the curve of one element ends in an error, or is not beside the theory."""
    summary = run(tmp_path, (1, 1), (1.0, 1.0), 1.0, '"1e-3 mm/s"', "quasistatic")
    assert summary["verdict"].startswith("failed everywhere at once, in pass ")
    assert abs(summary["material_point"]["difference"]) < 3e-3  # k/mu is 400 here, the theory incompressible
    assert summary["loading"]["greatest_load"] == pytest.approx(1.131, rel=1e-3)
    assert (tmp_path / "out" / "energies.png").exists()


@pytest.mark.slow
@pytest.mark.parametrize("front", [0.95, 1.0])
def test_passes_end_whatever_share_of_points_may_fail(front: float, tmp_path: Path) -> None:
    """Fails if points wait for ever: this scene made 41,000 passes without any change."""
    result = symmetric_double_edge_notch(mesh="coarse", options=Options(
        analysis="quasistatic", front=front, out=tmp_path / "out", quiet=True))
    assert result.summary["verdict"].startswith("cracked and separated")
    assert result.state.step < 1000
