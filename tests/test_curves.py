"""Grips and tractions that are functions of the load time: their polylines, and what follows them in every phase."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bodies import grid, notched
from guarded import Stop, simulation
from plates import deck, plate
from test_loads import TOUGH, Loaded, rollers, scene, side

import skfsink
from skfsink.errors import CheckpointError, Interrupted, OutputError, ParameterError
from skfsink.fem.space import Space
from skfsink.fields.body import Body
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import BulkViscosity, Momentum
from skfsink.fields.state import State
from skfsink.loads.curve import Curve
from skfsink.loads.grips import Grip, Ramp, Traction
from skfsink.material import NeoHookean, SinkLaw
from skfsink.meshing.vtu import write_mesh
from skfsink.methods.controls import ExplicitControls, HHTControls
from skfsink.methods.explicit import Explicit
from skfsink.methods.hht import HHT
from skfsink.run.display import Display
from skfsink.run.simulate import Simulation
from skfsink.run.unreached import unreached
from skfsink.scene.deck import read_deck
from skfsink.scene.described import made_in_python
from skfsink.scene.registry import find_case
from skfsink.scene.tables import read_tables


def swing(t: float) -> float:
    """Three cycles of growing height, from rest."""
    return 0.03 * t * np.sin(2 * np.pi * t) ** 2


# --- the curve itself ---
def test_the_polyline_is_within_the_tolerance() -> None:
    """Fails if a chord is farther from the function than was asked for, or if far more points are taken than it needs:
    their number grows with the square root of the accuracy."""
    counts = []
    for tolerance in (1e-2, 1e-4):
        curve = Curve(swing, 3.0, tolerance)
        t = np.linspace(0.0, 3.0, 20001)
        exact = np.array([swing(x) for x in t])
        far = np.abs(np.interp(t, curve.times, curve.values) - exact).max() / np.abs(exact).max()
        assert far <= 1.2 * tolerance  # it is looked at in three places of a chord
        counts.append(len(curve.times))
        np.testing.assert_allclose([curve.value(x) for x in t[::50]], exact[::50], rtol=1e-14)
    assert counts[1] < 10 * counts[0] < 2000
    assert curve.value(5.0) == curve.value(3.0) == curve.values[-1] and curve.slope(5.0) == 0.0


def test_velocities_are_the_derivative_of_the_function() -> None:
    """Fails if a grip has the velocity of a chord, also at both ends, where there is one side only."""
    curve = Curve(lambda t: np.sin(t) * np.exp(0.3 * t), 4.0)
    for t in (0.0, 1e-9, 0.3, 1.7, 3.9999999):
        exact = (np.cos(t) + 0.3 * np.sin(t)) * np.exp(0.3 * t)
        assert curve.slope(t) == pytest.approx(exact, abs=2e-6)
    assert curve.slope(4.0) == 0.0  # it stands still from there on
    ramp = Ramp((0.0, 1.0, 2.0), (0.0, 1.0, 0.0))
    assert (ramp.slope(0.5), ramp.slope(1.0)) == (1.0, -1.0)


def test_a_short_pulse_is_seen_where_a_point_is_given() -> None:
    """Fails if given points are left out, or a bend is not found to the tolerance."""
    def pulse(t: float) -> float:
        return 1e-3 * t + max(0.0, 0.1 - 1e5 * abs(t - 51.0))

    assert max(Curve(pulse, 100.0, points=(51.0,)).values) == pytest.approx(0.151)
    bent = Curve(lambda t: min(t, 1.0), 3.0)
    assert np.abs(np.interp(1.0, bent.times, bent.values) - 1.0) < 2e-3


@pytest.mark.parametrize(("function", "message"), [
    (1.0, r"a curve needs a function of the load time; got 1\.0"),
    (lambda t: "far", r"a curve must give a finite number; got 'far' at 0 s"),
    (lambda t: None, r"a curve must give a finite number; got None at 0 s"),
    (lambda t: t > 1, r"a curve must give a finite number; got False at 0 s"),
    (lambda t: np.array([t, t]), r"a curve must give a finite number; got array"),
    (lambda t: 1j * t, r"a curve must give a finite number; got 0j at 0 s"),
    (lambda t: np.nan if t > 1.0 else t, r"a curve must give a finite number; got nan at 1\.125 s"),
    (lambda t: 1.0 / (t - 1.5), r"a curve has no value at 1\.5 s: its function raises ZeroDivisionError \(float"),
    (lambda t: np.cos(t), r"a curve must be 0 at time 0; got 1: let it rise from 0"),
    (lambda t: float(t > 1.0), r"a curve must not jump; this one does at 1 s, from 0 to 1: let it go there in a time"),
    (lambda t: np.sin(1e5 * t), r"a curve takes more than 10,000 points to be within its tolerance of 0\.001")])
def test_what_is_no_curve_is_refused(function: Any, message: str) -> None:
    """Fails if a function that gives no course is followed, or refused by more than a line."""
    with pytest.raises(ParameterError, match=f"^{message}") as caught:
        Curve(function, 2.0)
    assert "\n" not in str(caught.value)


def test_a_curve_that_breaks_down_later_is_refused() -> None:
    """Fails if a value that is no number, at a time that was not looked at before, reaches the body."""
    curve = Curve(lambda t: np.nan if 0.7 < t < 0.70001 else t, 1.0)
    with pytest.raises(ParameterError, match=r"^a curve must give a finite number; got nan at 0\.700005 s"):
        curve.value(0.700005)


# --- loading ---
def cycles(space: Space, course: Ramp, **controls: Any) -> Loaded:
    """A square pulled to and fro at its top."""
    return Loaded(space, (*rollers(2), Grip("y+", (None, course))), **controls)


def test_cycles_bring_an_elastic_body_back() -> None:
    """Fails if a point of a curve is passed, if grips are off it anywhere, or if loading to and fro leaves work."""
    course = Curve(lambda t: 0.1 * np.sin(2 * np.pi * t), 1.0)
    body = cycles(Space(grid("quad", (3, 3))), course, increment=0.02)
    seen = []
    for state in body.statics.load(body.state):
        seen.append(state.grip)
        np.testing.assert_allclose(state.u[side(body.space, "y+"), 1], course.value(state.grip), atol=1e-13)
    assert set(course.times[1:]) <= set(seen)
    assert body.statics.unfailed == "nothing moves after load time 1 s"
    assert np.abs(state.u).max() < 1e-5 and abs(state.ledger.work) < 1e-4 * 0.1 ** 2


def test_onset_is_found_in_the_cycle_that_reaches_it_and_never_in_unloading() -> None:
    """Fails if cycles below the strength fail the body, if it fails while it is unloaded, or elsewhere than a steady
    pull does: the third of three growing cycles breaks it."""
    grips = Grip("y+", (0.0, 1e-3)), Grip("y-", (0.0, 0.0))
    opening = 1e-3 * Loaded(notched(9), grips, law=SinkLaw()).load().grip

    def course(t: float) -> float:
        return 0.4 * opening * np.ceil(t) * np.sin(np.pi * t) ** 2

    body = Loaded(notched(9), (Grip("y+", (0.0, Curve(course, 3.0))), grips[1]), law=SinkLaw())
    state = body.load()
    assert body.statics.unfailed == "" and 2.0 < state.grip < 2.5
    assert state.u[side(body.space, "y+"), 1].max() == pytest.approx(opening, rel=2e-3)


def test_past_the_onset_no_load_goes_beyond_a_turning_point() -> None:
    """Fails if the load time of the event is past a peak at which the onset was, or not in proportion before it."""
    curve = Curve(lambda t: np.sin(t), 3.0, 1e-4)
    body = cycles(Space(grid("quad", (1, 1))), curve)
    near = body.statics.clock.grown(1.56, 0.05)
    assert 1.56 < near < 1.6
    assert np.sin(body.statics.clock.grown(0.8, 0.05)) == pytest.approx(1.05 * np.sin(0.8), rel=1e-3)
    many = cycles(Space(grid("quad", (1, 1))), Ramp(tuple(np.linspace(0, 1, 501)), tuple(np.linspace(0, 1, 501) ** 2)))
    assert many.statics.clock.grown(0.5, 0.1) ** 2 == pytest.approx(1.1 * 0.25, rel=1e-5)


# --- the event ---
def bar(course: float | Ramp | None, n: int = 100, viscosity: float = 0.0, pull: Ramp | None = None) -> Loaded:
    """A bar of length 1 between walls, so that it moves along x alone; its left end is a grip, its right one held."""
    space = Space(grid("quad", (n, 1), (1.0, 1.0 / n)))
    held = Grip("y-", (None, 0.0)), Grip("y+", (None, 0.0)), Grip("x+", (0.0, None))
    grips = held if course is None else (Grip("x-", (course, None)), *held)
    loaded = Loaded(space, grips, () if pull is None else (Traction("x-", (pull, 0.0)),))
    material = NeoHookean(mu=0.2, bulk_modulus=1.0)
    momentum = Momentum(space, material, dead=loaded.loading.dead, bulk_viscosity=BulkViscosity(viscosity, 0.0))
    loaded.momentum, loaded.body = momentum, Body(momentum, DensitySolver(space, TOUGH), loaded.loading)
    return loaded


def speed_of(body: Loaded) -> float:
    """c_d of the undeformed bar [mm/s]."""
    m = body.momentum.material
    return float(np.sqrt((m.bulk_modulus + 4 / 3 * m.shear_modulus) / m.rho0))


def scheme_of(kind: str, body: Loaded, **controls: Any) -> Explicit | HHT:
    if kind == "explicit":
        return Explicit(body.body, ExplicitControls(gamma_every=10 ** 6, raised_mass=0.0, energy_tolerance=0.0))
    return HHT(body.body, HHTControls(alpha=0.0, force_tolerance=1e-6, correction_tolerance=1e-6, **controls))


SHAKE = 2e-6, 0.35  # amplitude [mm] and time, over that in which a wave crosses the bar


@pytest.mark.parametrize("kind", ["explicit", "hht"])
@pytest.mark.parametrize("load", ["grip", "traction"])
def test_a_pulse_of_a_grip_or_a_traction_travels_as_it_was_given(kind: str, load: str) -> None:
    """Fails if the motion of a grip is a polyline in the event, if it lags by a part of a step, or if a traction does:
    u(x, t) = f(t - x/c_d) in a bar that is hardly strained, with second-order accuracy; f' = T/(rho c) of a traction.
    """
    errors = []
    for n in (40, 80):
        c = speed_of(bar(None, n))
        size, time = SHAKE[0], SHAKE[1] / c

        def f(t: float, size: float = size, time: float = time) -> float:
            s = min(max(t / time, 0.0), 1.0)
            return size * float(np.sin(np.pi * s) ** 4 if load == "grip" else s ** 4 * (35 - 84 * s + 70 * s * s
                                                                                        - 20 * s ** 3))

        def pull(t: float, size: float = size, time: float = time, c: float = c) -> float:
            s = min(max(t / time, 0.0), 1.0)
            rho = bar(None, 1).momentum.material.rho0
            return float(rho * c * size * 140 * s ** 3 * (1 - s) ** 3 / time)

        body = (bar(Curve(f, 2 * time), n) if load == "grip"
                else bar(None, n, pull=Curve(pull, 2 * time)))
        scheme = scheme_of(kind, body, dt=0.4 / n / c, dt_least=1e-20)
        state = State.intact(body.space)
        scheme.begin(state)
        assert np.abs(state.v).max() < 1e-6 * size / time
        for _ in scheme.run(state, 0.8 / c):
            assert abs(state.ledger.balance) < 1e-6 * max(state.ledger.elastic, 1e-30) + 1e-25
        exact = np.array([f(state.time - x / c) for x in body.space.X[:, 0]])
        errors.append(float(np.abs(state.u[:, 0] - exact).max()) / size)
        if load == "grip":
            moved = state.u[side(body.space, "x-"), 0]
            np.testing.assert_allclose(moved, f(state.grip), atol=1e-12 * size)
    assert errors[1] < 0.05 and errors[0] / errors[1] > 3.2, errors


@pytest.mark.parametrize("kind", ["explicit", "hht"])
@pytest.mark.parametrize("viscosity", [0.0, 0.3])
def test_ledger_of_a_shaken_bar_closes(kind: str, viscosity: float) -> None:
    """Fails if the work that a grip does as its velocity changes is left out, with viscosity or without."""
    c = speed_of(bar(None, 20))
    course = Curve(lambda t: 2e-3 * np.sin(8.0 * c * t) * np.sin(3.0 * c * t), 4.0 / c)
    body = bar(course, 20, viscosity)
    scheme = scheme_of(kind, body, dt=0.02 / c, dt_least=1e-20)
    state = State.intact(body.space)
    scheme.begin(state)
    most = 0.0
    for _ in scheme.run(state, 3.0 / c):
        most = max(most, state.ledger.elastic + state.ledger.kinetic)
        assert abs(state.ledger.balance) < 1e-9 * most
        moving = course.slope(state.grip)
        np.testing.assert_allclose(state.v[side(body.space, "x-"), 0], moving, atol=1e-6 * c)
    assert state.ledger.work > 0.1 * most and abs(state.ledger.numerical) < 0.05 * most
    assert (state.ledger.viscous > 1e-3 * most) == (viscosity > 0.0)


def test_viscosity_sees_the_mean_velocity_of_a_step_of_grips() -> None:
    """Fails if viscous forces are of the velocity that a grip had before the step, which lags by half of it."""
    c = speed_of(bar(None, 1))
    body = bar(Curve(lambda t: 1e-2 * (c * t) ** 2, 1.0 / c), 1, viscosity=0.3)
    scheme, state = Explicit(body.body, ExplicitControls(gamma_every=10 ** 6)), State.intact(body.space)
    scheme.length.fix(0.1 / c)
    scheme.begin(state)
    for step in range(3):
        scheme.step(state)
        v = np.zeros_like(state.u)
        v[side(body.space, "x-"), 0] = 2e-2 * c * (step + 0.5) * 0.1
        expected = body.momentum.force(state.u) + body.momentum.viscous_force(state.u, v)
        np.testing.assert_allclose(scheme.reaction, expected, rtol=1e-9)


@pytest.mark.parametrize("kind", ["explicit", pytest.param("hht", marks=pytest.mark.slow)])
def test_plate_torn_while_its_grips_go_on_and_back(kind: str) -> None:
    """Fails if grips do not follow their curve while a crack runs, or an entry of the ledger is wrong then."""
    size = 1e-4 if kind == "explicit" else 1e-6

    def push(t: float) -> float:
        return size * np.sin(2e5 * (min(t, 1.0 + 3e-5) - 1.0)) ** 2 if t > 1.0 else 0.0

    grips = *rollers(2), Grip("x+", (Curve(push, 2.0, points=(1.0, 1.0 + 3e-5)), None))
    body = Loaded(notched(9), grips, (Traction("y+", (0.0, Curve(lambda t: 0.25 * t * (2 - t), 2.0))),),
                  law=SinkLaw(phi=0.05))
    state = body.load()
    assert 0.1 < state.grip < 1.0
    body.start(0.01)
    state.grip = 1.0
    start = state.u[side(body.space, "x+"), 0].copy()
    scheme = (Explicit(body.body) if kind == "explicit" else
              HHT(body.body, HHTControls(dt=4e-7, force_tolerance=1e-8, correction_tolerance=1e-8,
                                         gamma_tolerance=1e-7, max_iterations=40)))
    scheme.begin(state)
    scale = state.ledger.elastic
    for _ in scheme.run(state, 2e-5):
        assert abs(state.ledger.balance) <= (1e-10 if kind == "explicit" else 1e-8) * scale
        moved = state.u[side(body.space, "x+"), 0] - start
        np.testing.assert_allclose(moved, push(state.grip), atol=1e-9 * size + 1e-14)
    assert state.deleted.sum() > 3


# --- runs ---
def shaken(**controls: Any) -> Any:
    """The notched block of the guards, pulled by a curve and shaken in the event."""
    def course(t: float) -> float:
        return 0.02 * t * (1.0 + 0.1 * float(np.sin(7.0 * t)))

    return scene((), (Grip("top", (0.0, Curve(course, 100.0))), Grip("bottom", (0.0, 0.0))), event_time=1e-5,
                 **controls)


@pytest.mark.parametrize("integrator", ["explicit", pytest.param("hht", marks=pytest.mark.slow)])
@pytest.mark.parametrize("stop", [3, pytest.param(40, marks=pytest.mark.slow)])
def test_resumed_on_a_curve(integrator: str, stop: int, tmp_path: Path) -> None:
    """Fails if a checkpoint misses the place on a curve: the resumed run writes the same bytes."""
    whole = simulation(shaken(integrator=integrator), tmp_path / "whole")
    whole.run()
    with pytest.raises(Interrupted):
        simulation(shaken(integrator=integrator), tmp_path / "broken", Stop(stop)).run()
    resumed = Simulation(shaken(integrator=integrator), tmp_path / "broken", Display(True), resume=True)
    state = resumed.run()
    assert (tmp_path / "whole" / "history.csv").read_bytes() == (tmp_path / "broken" / "history.csv").read_bytes()
    np.testing.assert_array_equal(state.u, whole.state.u)
    assert state.ledger == whole.state.ledger


def test_quasistatic_grips_go_on_along_the_curve() -> None:
    """Fails if grips of a quasi-static event leave their curve where a crack has arrested, do not unload with it, or if
    that takes energy: a body that holds is taken through all of its cycles."""
    course = Curve(lambda t: 0.1 * float(np.sin(2 * np.pi * t)), 2.0)
    body = cycles(Space(grid("quad", (2, 2))), course, increment=0.02)
    state = body.load(0.2)
    body.start(0.0)
    scale, seen = body.momentum.energy, []
    for _ in body.statics.propagate(state, 0.05, limit=100.0):
        np.testing.assert_allclose(state.u[side(body.space, "y+"), 1], course.value(state.grip), atol=1e-13)
        assert abs(state.ledger.balance) < 0.02 * scale
        seen.append(state.grip)
    assert body.statics.arrested == "nothing moves after load time 2 s" and len(seen) > 50
    assert state.ledger.elastic < 1e-6 * scale


def test_a_scene_with_a_curve_is_known_by_its_function() -> None:
    """Fails if scenes with other curves are taken for the same run, or equal ones for others."""
    def of(function: Callable[[float], float], until: float = 3.0) -> str:
        return replace(scene(), grips=(Grip("bottom", (0.0, Curve(function, until))),)).fingerprint

    def scaled(a: float) -> Callable[[float], float]:
        return lambda t: a * t

    assert of(scaled(1.0)) == of(scaled(1.0))
    assert len({of(scaled(1.0)), of(scaled(2.0)), of(scaled(1.0), 4.0), of(np.sin)}) == 4


# --- decks ---
HEAD = 'case = "custom"\n[parameters]\nmesh = "plate.vtu"\nlength_scale = 0.6\nevent_time = "5 µs"\n'
GRIPS = '[[grips]]\nboundary = "top"\nx = 0\ny = {}\n[[grips]]\nboundary = "bottom"\nx = 0\ny = 0\n'


def written(folder: Path, course: str) -> Path:
    """A deck with a course of its upper grip, beside the mesh of the small plate."""
    write_mesh(folder / "plate.vtu", plate())
    return deck(folder, HEAD + GRIPS.format(course))


def test_cycles_that_an_event_does_not_come_to(tmp_path: Path) -> None:
    """Fails if cycles after the onset are dropped without a word, or a ramp that only goes on, or rests, is one."""
    made = read_deck(written(tmp_path, '"1 um/s"')).scene()
    quasi = replace(made, controls=replace(made.controls, analysis="quasistatic"))

    def said(times: Sequence[float], values: Sequence[float], of: Any = quasi, end: float = 1.5) -> str:
        grip = Grip("top", (0.0, Ramp(tuple(times), tuple(values))))
        return unreached(replace(of, grips=(grip, made.grips[1])), 1.5, end)

    assert unreached(made, 1.5, 1.5) == ""
    text = said((0, 1, 2, 3, 4), (0, 1, 2, 0, 2))
    assert "turns at load time 2 s, which this run does not come to: it begins to fail at 1.5 s, and a quasi-" in text
    assert "turns at load time 3 s" in said((0, 2, 3, 4), (0, 1, 1, 0))
    assert said((0, 1, 2), (0, 1, 3)) == said((0, 1, 2, 3), (0, 1, 2, 5)) == said((0, 1, 2, 3), (0, 1, 2, 2)) == ""
    assert said((0, 2, 3), (0, 1, 0), end=2.5) == ""
    assert "the event lasts 0.1 s" in said((0, 2, 3), (0, 1, 0), made, 1.6)


def test_points_of_a_deck_in_a_file(tmp_path: Path) -> None:
    """Fails if 500 points do not fit, or if those of a file, with units or without, are not those of a table."""
    t = np.linspace(0.0, 10.0, 500)
    points = np.column_stack([t, 0.01 * t ** 2])
    rows = "\n".join(f"{time!r}, {value * 1e3!r} um" for time, value in points.tolist())
    (tmp_path / "pull.CSV").write_text(f"# time, displacement\n\n{rows}\n", encoding="utf-8-sig")
    table, file = (read_deck(written(tmp_path, text)) for text in (str(points.tolist()), '"pull.CSV"'))
    for way in (table, file):
        grip = way.scene().grips[0]
        assert isinstance(grip.velocity[1], Ramp)
        np.testing.assert_allclose(grip.velocity[1].values, points[:, 1], rtol=1e-14)
    assert read_deck(deck(tmp_path, file.toml())).scene().fingerprint == file.scene().fingerprint


@pytest.mark.parametrize(("text", "message"), [
    ("0, 0\n1, 2, 3", r"line 2 of .*pull\.csv must be a time and a value with a comma between; got '1, 2, 3'"),
    ("0, 0\n1, 2 MPa", r"grip top, y: line 2 of .*pull\.csv must be a quantity in mm"),
    ("time, value\n0, 0", r"grip top, y: line 1 of .*pull\.csv must be a quantity in s"),
    ("0, 0\n1, nan", r"grip top, y: line 2 of .*pull\.csv must be a finite number"),
    ("0, 0", r"grip top, y: a ramp must have at least two points"),
    ("0, 0\n" * 1001, r"grip top, y: .*pull\.csv has more than 1000 points"),
    (None, r"grip top, y: there is no file .*pull\.csv of its points; a path in a deck counts from the folder")])
def test_files_that_hold_no_points(text: str | None, message: str, tmp_path: Path) -> None:
    """Fails if a file is misread, or its mistake is not named by its line."""
    if text is not None:
        (tmp_path / "pull.csv").write_text(text)
    with pytest.raises(ParameterError, match=message) as caught:
        read_deck(written(tmp_path, '"pull.csv"'))
    assert "\n" not in str(caught.value)


def test_a_curve_is_made_in_python(tmp_path: Path) -> None:
    """Fails if a curve is turned into points without a word, or a scene with one passes for that of its deck."""
    made = read_deck(written(tmp_path, '"1 um/s"')).scene()
    curve = Curve(lambda t: 1e-3 * t, 1e4)
    other = replace(made, grips=(Grip("top", (0.0, curve)), made.grips[1]))
    assert made_in_python(made, find_case("custom")) == ()
    assert made_in_python(other, find_case("custom")) == ("grips",)
    assert read_tables("grips", other.grips)[0]["y"] is curve
    with pytest.raises(ParameterError, match=r"^pressure top, value takes no function of the time, as x, y and z of"):
        read_tables("pressures", [{"boundary": "top", "value": curve}])


def swung(t: float) -> float:
    """A displacement [mm] that swings once and rises."""
    return float(0.02 * t + 0.01 * np.sin(2 * np.pi * t))


def test_custom_takes_a_curve(tmp_path: Path) -> None:
    """Fails if the function `custom` refuses a curve, moves the grip by its polyline, or goes on with another one."""
    write_mesh(tmp_path / "plate.vtu", plate())
    still = {"boundary": "bottom", "x": 0, "y": 0}
    asked = {"mesh": tmp_path / "plate.vtu", "phi": 10.0, "length_scale": 1.0, "quiet": True}
    curve = Curve(swung, 2.0, tolerance=0.05)
    given = [{"boundary": "top", "x": 0, "y": curve}, still]
    made = skfsink.custom.scene(**{**asked, "grips": given})
    assert made.grips[0].velocity[1] is curve and made_in_python(made, find_case("custom")) == ("grips",)
    points = made.parameters["grips"][0]["y"]
    assert points[-1] == [2.0, swung(2.0)] and len(points) < 100
    folder = tmp_path / "run"
    run = skfsink.custom(**asked, grips=given, out=folder)
    time, way = run.history["time_s"], run.history["grip_displacement_mm"]
    np.testing.assert_allclose(way, [swung(t) for t in time], rtol=1e-12)
    assert time[-1] == 2.0 and skfsink.load(folder).made_in_python == ("grips",)
    with pytest.raises(OutputError, match=re.escape("resume it from there, with grips=…, the same")):
        skfsink.custom(**asked, resume=folder)
    again = skfsink.custom(**asked, grips=given, resume=folder)
    np.testing.assert_array_equal(again.history["reaction_N_per_mm"], run.history["reaction_N_per_mm"])
    with pytest.raises(CheckpointError, match="scene"):
        skfsink.custom(**asked, grips=[{**given[0], "y": Curve(swing, 2.0)}, still], resume=folder)
