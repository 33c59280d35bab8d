"""Boundaries that grips turn about an axis: their motion, the moment it takes, and its work in every phase."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import skfem
from bodies import grid
from guarded import NOTCHED, Stop, simulation
from test_loads import TOUGH, scene, side

from skfsink.errors import Interrupted, ParameterError
from skfsink.fem.space import Space
from skfsink.fields.body import Body
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.fields.state import State
from skfsink.loads.curve import Curve
from skfsink.loads.grips import Grip, Ramp, Sliding
from skfsink.loads.rigid import moves_as_a_whole, pieces
from skfsink.loads.rotation import Rotation, Turn
from skfsink.loads.schedule import Loading
from skfsink.material import NeoHookean
from skfsink.methods.controls import ExplicitControls, HHTControls, StaticsControls
from skfsink.methods.explicit import Explicit
from skfsink.methods.hht import HHT
from skfsink.methods.statics import Statics
from skfsink.results.history import History
from skfsink.run.display import Display
from skfsink.run.simulate import Simulation
from skfsink.scene.tables import grips_of, read_tables


def ring(n: int) -> tuple[Space, np.ndarray, np.ndarray]:
    """An annulus with radii 1 and 2 mm, n elements wide, with its inner and outer nodes."""
    r, angle = np.meshgrid(np.linspace(1.0, 2.0, n + 1), np.arange(8 * n) * np.pi / (4 * n), indexing="ij")
    points = np.array([(r * np.cos(angle)).ravel(), (r * np.sin(angle)).ravel()])
    number = np.arange(points.shape[1]).reshape(r.shape)
    following = np.roll(number, -1, axis=1)
    quads = np.stack([number[:-1], number[1:], following[1:], following[:-1]]).reshape(4, -1)
    return Space(skfem.MeshQuad(points, quads)), number[0], number[-1]


def body_of(loading: Loading, space: Space, **controls: float) -> tuple[Statics, State]:
    momentum = Momentum(space, NeoHookean(mu=0.2), dead=loading.dead)
    return (Statics(Body(momentum, DensitySolver(space, TOUGH), loading), StaticsControls(**controls)),
            State.intact(space))


@pytest.mark.parametrize(("dim", "axis"), [(2, ()), (3, (1.0, -2.0, 0.5))])
def test_nodes_turn_as_a_rigid_body(dim: int, axis: tuple[float, ...]) -> None:
    """Fails if distances change, the axis moves, the sense is the other one, or velocities are no derivatives."""
    X = np.random.default_rng(1).normal(size=(6, dim))
    centre = tuple(X[0] + 0.3)
    turn = Turn(X, np.arange(6), Rotation("b", Ramp((0.0, 2.0, 4.0), (0.0, 200.0, 20.0)), centre, axis))
    for t in (0.4, 1.9, 2.5, 5.0):
        x = X + turn.displacement(t)
        for one, other in ((X, x), (X - centre, x - centre)):
            np.testing.assert_allclose(np.linalg.norm(one[:, None] - one[None], axis=2) if one is X else
                                       np.linalg.norm(one, axis=1),
                                       np.linalg.norm(other[:, None] - other[None], axis=2) if one is X else
                                       np.linalg.norm(other, axis=1), atol=1e-12)
        if axis:
            np.testing.assert_allclose((x - X) @ axis, 0.0, atol=1e-12)
        slope = (turn.displacement(t + 1e-6) - turn.displacement(t - 1e-6)) / 2e-6
        np.testing.assert_allclose(turn.velocity(t), slope, atol=1e-6)
    quarter = Turn(np.array([[1.0, 0.0, 3.0][:dim]]), np.arange(1),
                   Rotation("b", 90.0, (0.0,) * dim, (0.0, 0.0, 2.0) if dim == 3 else ()))
    np.testing.assert_allclose(quarter.displacement(1.0), [[-1.0, 1.0, 0.0][:dim]], atol=1e-12)
    assert quarter.radius == 1.0


def test_moment_of_a_twisted_ring() -> None:
    """Fails if a ring whose outer edge turns by 60 degrees bears another moment than theta 4 pi mu/(1/a^2 - 1/b^2), the
    azimuthal shear of a neo-Hookean solid: the error falls with the square of the element size."""
    errors, theta = [], 60.0
    for n in (8, 16):
        space, inner, outer = ring(n)
        loading = Loading(space, [(outer, Rotation("outer", Ramp((0.0, 1.0), (0.0, theta)), (0.0, 0.0))),
                                  (inner, Grip("inner", (0.0, 0.0)))])
        statics, state = body_of(loading, space)
        for _ in statics.load(state):
            pass
        moment = loading.turns[0].moment(space.X + state.u, statics.momentum.force(state.u))
        work = state.ledger.work
        exact = np.radians(theta) * 4 * np.pi * 0.2 / (1.0 - 0.25)
        errors.append(abs(moment / exact - 1.0))
        assert state.grip == 1.0 and work == pytest.approx(0.5 * exact * np.radians(theta), rel=0.04)
        assert abs(state.ledger.balance) < 1e-3 * work
    assert errors[1] < 0.01 and errors[0] / errors[1] > 3.0, errors


def test_a_body_turned_at_both_ends_is_not_strained() -> None:
    """Fails if grips that turn together, by more than a full turn, strain what is between them: increments are arcs."""
    space = Space(grid("hex", (2, 3, 2)))
    turn = [(side(space, name), Rotation(name, 360.0, (2.0, 0.0, 0.5), (1.0, 1.0, 0.0))) for name in ("y-", "y+")]
    loading = Loading(space, turn)
    statics, state = body_of(loading, space, increment=0.1)
    for _ in statics.load(state):
        assert statics.momentum.energy < 1e-9
        if state.grip > 1.2:
            break
    whole = Turn(space.X, np.arange(space.n_nodes), turn[0][1])
    np.testing.assert_allclose(state.u, whole.displacement(state.grip), atol=1e-4)


@pytest.mark.parametrize("kind", ["explicit", "hht"])
def test_ledger_of_a_ring_that_is_twisted_to_and_fro(kind: str) -> None:
    """Fails if nodes leave their circle in the event, or the work of the grip is wrong as its velocity turns."""
    space, inner, outer = ring(3)
    angle = Curve(lambda t: 20.0 * np.sin(1e4 * t) * np.sin(3e3 * t), 1e-3)
    loading = Loading(space, [(outer, Rotation("outer", angle, (0.0, 0.0))), (inner, Grip("inner", (0.0, 0.0)))])
    statics, state = body_of(loading, space)
    scheme = (Explicit(statics.body, ExplicitControls(gamma_every=10 ** 6, energy_tolerance=0.0)) if kind == "explicit"
              else HHT(statics.body, HHTControls(alpha=0.0, dt=2e-6, force_tolerance=1e-8, correction_tolerance=1e-8)))
    scheme.begin(state)
    most = 0.0
    for _ in scheme.run(state, 4e-4):
        most = max(most, state.ledger.elastic + state.ledger.kinetic)
        assert abs(state.ledger.balance) < 1e-9 * most
        np.testing.assert_allclose(np.linalg.norm((space.X + state.u)[outer], axis=1), 2.0, rtol=1e-9)
        np.testing.assert_allclose(state.u[outer], loading.turns[0].displacement(state.grip), atol=1e-9)
    assert state.ledger.work > 0.1 * most and abs(state.ledger.numerical) < 0.05 * most


def test_what_cannot_turn_is_refused() -> None:
    """Fails if a grip that turns is held by another one, has no axis, or turns all that is held."""
    plane, cube = Space(grid("quad", (2, 2))), Space(grid("hex", (2, 2, 2)))
    both = [(side(plane, "y+"), Rotation("top", 1.0, (0.0, 0.0))), (side(plane, "x-"), Grip("left", (0.0, None)))]
    with pytest.raises(ParameterError, match=r"^grip top turns the node at \(0, 1\) mm, which another grip holds"):
        Loading(plane, both)
    with pytest.raises(ParameterError, match=r"^the node at .* slides on the plane of diagonal, and a grip moves it"):
        Loading(plane, [both[0], (np.array([0, 4, 8]), Sliding("diagonal"))])
    for space, grip, said in (
            (plane, Rotation("top", 1.0, (0.0, 0.0, 0.0)), "a centre of 2 components and no axis, as the mesh; got 3"),
            (cube, Rotation("top", 1.0, (0.0, 0.0, 0.0)), "a centre of 3 components and an axis of 3, as the mesh")):
        with pytest.raises(ParameterError, match=f"^grip top must have {said}"):
            Loading(space, [(side(space, "y+"), grip)])
    with pytest.raises(ParameterError, match=r"^axis of the grip top must have a direction; got \(0, 0, 0\)"):
        Rotation("top", 1.0, (0.0, 0.0, 0.0), (0, 0, 0))
    with pytest.raises(ParameterError, match=r"^grip pin turns nothing: all nodes of its boundary are on the axis"):
        Loading(plane, [(np.array([0]), Rotation("pin", 1.0, (0.0, 0.0)))])
    alone = Loading(plane, both[:1])
    assert moves_as_a_whole(plane, alone, pieces(plane))
    held = Loading(plane, [both[0], (side(plane, "y-"), Grip("bottom", (0.0, 0.0)))])
    assert not moves_as_a_whole(plane, held, pieces(plane))
    with pytest.raises(ParameterError, match=r"^start rest is for grips .* this scene has a grip that turns"):
        scene((), (Rotation("top", 1.0, (0.0, 0.0)), Grip("bottom", (0.0, 0.0))), start="rest")


def test_grips_of_decks_that_turn() -> None:
    """Fails if angle, centre and axis of a deck are misread, or a part of them passes alone."""
    table = {"boundary": "top", "angle": "0.1 rad/s", "centre": [0, "1 cm", 0], "axis": [0, 0, 1]}
    (grip,) = grips_of([table], 3)
    assert isinstance(grip, Rotation) and grip.centre == (0.0, 10.0, 0.0) and grip.axis == (0.0, 0.0, 1.0)
    assert grip.angle == pytest.approx(np.degrees(0.1))
    assert grips_of(read_tables("grips", [grip]), 3) == (grip,)
    (ramp,) = grips_of([{"boundary": "top", "angle": [[0, 0], [1, "90 degree"]], "centre": [0, 0]}], 2)
    assert isinstance(ramp, Rotation) and ramp.angle == Ramp((0.0, 1.0), (0.0, 90.0))
    for change, said in (({"x": 0}, "has angle and x: a boundary that turns is held in all directions"),
                         ({"normal": 0}, "has normal and angle: a boundary that slides"),
                         ({"centre": 1}, "centre must be a list of a number for each axis; got 1"),
                         ({"centre": [0, "1 s"]}, "centre must be a quantity in mm")):
        with pytest.raises(ParameterError, match=f"^grip top,? {said}"):
            read_tables("grips", [{**table, **change}])
    with pytest.raises(ParameterError, match=r"^grip top must have angle and centre together, and in space an axis"):
        read_tables("grips", [{"boundary": "top", "axis": [0, 0, 1]}])


@pytest.mark.parametrize("integrator", ["explicit", pytest.param("hht", marks=pytest.mark.slow)])
def test_run_of_a_plate_that_is_bent(integrator: str, tmp_path: Path) -> None:
    """Fails if a plate that is bent open at its notch does not crack, load and displacement are not conjugate, the
    ledger opens, or a resumed run writes other bytes."""
    of = replace(NOTCHED.scene, grips=(Rotation("top", 1.0, (1.0, 0.5)), Grip("bottom", (0.0, 0.0))),
                 controls=replace(NOTCHED.scene.controls, event_time=1e-5, integrator=integrator, checkpoint_every=1e6,
                                  frame_every=1e-3, overshoot=0.01))
    whole = simulation(of, tmp_path / "whole")
    state = whole.run()
    with pytest.raises(Interrupted):
        simulation(of, tmp_path / "broken", Stop(30)).run()
    Simulation(of, tmp_path / "broken", Display(True), resume=True).run()
    assert (tmp_path / "whole" / "history.csv").read_bytes() == (tmp_path / "broken" / "history.csv").read_bytes()
    table = History.load(tmp_path / "whole" / "history.csv")
    loading = table["phase"] == "loading"
    work = np.trapezoid(table["reaction_N_per_mm"][loading], table["grip_displacement_mm"][loading])
    assert work == pytest.approx(table["work"][loading][-1], rel=0.02) and work > 0
    assert state.gamma.min() < 0.1
    tolerance = 1e-9 if integrator == "explicit" else 1e-5  # the forces of HHT are in balance to a tolerance
    assert abs(state.ledger.balance) < tolerance * whole.onset.figures["elastic_energy"]
