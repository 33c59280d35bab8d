"""Forces per mass: what they weigh, with and without damage, and the energy they bring in."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bodies import box, grid, notched
from guarded import Stop, simulation
from plates import deck, invoke_program
from plates import plate as plate_mesh
from test_loads import FINE, TOUGH, scene, side

from skfsink.errors import Interrupted, MeshError, ParameterError
from skfsink.fem.space import Space
from skfsink.fields.body import Body
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.fields.state import State
from skfsink.loads.body_force import BodyForce
from skfsink.loads.curve import Curve
from skfsink.loads.grips import Grip, Ramp, Traction
from skfsink.loads.schedule import Loading
from skfsink.material import AAA, NeoHookean, SinkLaw
from skfsink.meshing.vtu import write_mesh
from skfsink.methods.controls import ExplicitControls, HHTControls, StaticsControls
from skfsink.methods.explicit import Explicit
from skfsink.methods.hht import HHT
from skfsink.methods.statics import Statics
from skfsink.run.display import Display
from skfsink.run.simulate import Simulation
from skfsink.scene.case import StoredScene
from skfsink.scene.deck import read_deck
from skfsink.scene.tables import read_tables

RHO = AAA().rho0
G = 1e9  # mm/s^2: a block of 1 mm bears 1.4 MPa


def weighed(space: Space, rate: tuple[Any, ...], law: SinkLaw = TOUGH, material: Any = None, **controls: Any
            ) -> tuple[Body, Statics, State]:
    """A body held at its top, with a weight."""
    up = "xyz"[space.dim - 1]
    material = material or AAA()
    load = BodyForce(space, material.rho0, rate)
    loading = Loading(space, [(side(space, f"{up}+"), Grip(f"{up}+", (0.0,) * space.dim))], (), [load])
    momentum = Momentum(space, material, dead=loading.dead)
    body = Body(momentum, DensitySolver(space, law), loading)
    return body, Statics(body, StaticsControls(**controls)), State.intact(space)


@pytest.mark.parametrize("kind", ["quad", "hex"])
def test_weight_is_that_of_the_mass_and_falls_with_it(kind: str) -> None:
    """Fails if nodes weigh other than their mass times the acceleration, with damage, without it, or with regions of
    another density; or if what has lost its force still weighs."""
    space = box(kind, 3, 0.2)
    b = tuple(np.arange(1.0, space.dim + 1))
    body, _, state = weighed(space, b)
    momentum, dead = body.momentum, body.momentum.dead
    assert dead is not None
    momentum.set_time(2.0)
    gamma = np.random.default_rng(0).uniform(0.3, 1.0, space.n_nodes)
    deleted = np.arange(space.n_elements) < 2
    for g, gone in ((state.gamma, state.deleted), (gamma, state.deleted), (gamma, deleted)):
        momentum.set_gamma(g, gone)
        np.testing.assert_allclose(dead.values, 2.0 * momentum.lumped_mass(0.0)[:, None] * np.array(b), atol=1e-22)
    one = BodyForce(space, np.full(space.n_elements, 2.0), b, np.arange(4))
    one.at(1.0)
    np.testing.assert_allclose(one.values.sum(axis=0), 2.0 * space.V[:4].sum() * np.array(b))
    with pytest.raises(ParameterError, match=r"^a body force must have \d components, as the mesh; got 1"):
        BodyForce(space, 1.0, (1.0,))


def test_a_column_under_its_weight() -> None:
    """Fails if a column between walls is not drawn by rho g L^2/(2 M), M = k + 4 mu/3, or its top bears no weight."""
    space = Space(grid("quad", (1, 40), (0.1, 1.0)))
    material = NeoHookean(mu=0.2, bulk_modulus=1.0)
    walls = [(side(space, name), Grip(name, (0.0, None))) for name in ("x-", "x+")]
    load = BodyForce(space, material.rho0, (0.0, Ramp((0.0, 1.0), (0.0, -1e5))))
    loading = Loading(space, [(side(space, "y+"), Grip("y+", (0.0, 0.0))), *walls], (), [load])
    momentum = Momentum(space, material, dead=loading.dead)
    statics, state = Statics(Body(momentum, DensitySolver(space, TOUGH), loading)), State.intact(space)
    for _ in statics.load(state):
        pass
    assert state.grip == 1.0 and statics.unfailed == "nothing moves after load time 1 s"
    weight = material.rho0 * 1e5
    drawn = weight / (2 * (1.0 + 4 / 3 * 0.2))
    np.testing.assert_allclose(state.u[side(space, "y-"), 1], -drawn, rtol=1e-3)
    assert momentum.force(state.u)[side(space, "y+"), 1].sum() == pytest.approx(0.1 * weight, rel=1e-4)
    assert state.ledger.loads < 0 and abs(state.ledger.balance) < 1e-2 * state.ledger.elastic


@pytest.mark.parametrize("integrator", ["explicit", "hht", "single"])
def test_ledger_of_a_body_that_fails_under_its_weight(integrator: str) -> None:
    """Fails if the weight that goes with the density is not booked as the work it does then, in loading or event, or if
    a course of it is not followed there."""
    course = Curve(lambda t: -G * (t * (2 - t) if t < 1 else 1.0 + 0.3 * np.sin(3e5 * (min(t, 1.00005) - 1))), 2.0,
                   points=(1.0, 1.00005))
    body, statics, state = weighed(notched(9), (0.2 * G, course), SinkLaw(phi=0.05))
    for _ in statics.load(state):
        pass
    assert state.gamma.min() < 0.99 and state.grip < 1.0
    assert abs(state.ledger.balance) < 1e-3 * state.ledger.elastic
    state.begin_event(0.01, 1.0)
    dead = body.momentum.dead
    assert dead is not None
    scheme: Explicit | HHT = Explicit(body, ExplicitControls()) if integrator == "explicit" else HHT(body, HHTControls(
        dt=2e-7, coupling="single" if integrator == "single" else "iterated", **FINE))
    scheme.begin(state)
    scale, before = state.ledger.elastic, dead.values.sum(axis=0)
    for _ in scheme.run(state, 1e-5):
        assert abs(state.ledger.balance) <= (1e-10 if integrator == "explicit" else 1e-7) * scale
    assert state.gamma.min() < 0.1
    lost = 1.0 - body.momentum.lumped_mass(0.0).sum() / (RHO * body.space.V.sum())
    now = dead.values.sum(axis=0)
    assert lost > 0.01 and now[0] == pytest.approx(before[0] * state.grip * (1 - lost), rel=0.02)


def test_quasistatic_crack_under_weight_and_a_grip() -> None:
    """Fails if passes lose the energy of weight that goes with the density."""
    space = notched(9)
    load = BodyForce(space, RHO, (Ramp((0.0, 1.0), (0.0, 2e7)), 0.0))
    pull = Grip("y+", (0.0, Ramp((1.0, 2.0), (0.0, 0.4))))
    loading = Loading(space, [(side(space, "y+"), pull), (side(space, "y-"), Grip("y-", (0.0, 0.0)))], (), [load])
    momentum = Momentum(space, AAA(), dead=loading.dead)
    statics, state = Statics(Body(momentum, DensitySolver(space, SinkLaw()), loading)), State.intact(space)
    for _ in statics.load(state):
        pass
    scale = momentum.energy
    state.begin_event(0.005, statics.clock.grown(state.grip, 0.005))
    for passes, _ in enumerate(statics.propagate(state)):
        assert abs(state.ledger.balance) < 1e-9 * scale
        if passes == 20:
            break
    assert state.deleted.any() and load.values[:, 0].sum() < 0.999 * RHO * space.V.sum() * 2e7


def test_runs_under_weight_are_resumed(tmp_path: Path) -> None:
    """Fails if a resumed run under weight and a traction does not write the same bytes."""
    weight = partial(BodyForce, rho0=RHO, rate=(0.0, Ramp((0.0, 1.0), (0.0, 1e7))))
    of = replace(scene((Traction("top", (0.0, 0.1)),)), loads=(weight,))
    whole = simulation(of, tmp_path / "whole")
    whole.run()
    with pytest.raises(Interrupted):
        simulation(of, tmp_path / "broken", Stop(40)).run()
    Simulation(of, tmp_path / "broken", Display(True), resume=True).run()
    assert (tmp_path / "whole" / "history.csv").read_bytes() == (tmp_path / "broken" / "history.csv").read_bytes()
    assert len({of.fingerprint, scene((Traction("top", (0.0, 0.1)),)).fingerprint}) == 2


DECK = '''case = "custom"
[parameters]
mesh = "plate.vtu"
length_scale = 0.6
event_time = "3 µs"
density = "1000 kg/m^3"
[[grips]]
boundary = "top"
x = 0
y = 0
[[body_forces]]
y = {}
'''


def test_body_forces_of_decks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a deck with a weight is misread, is not its scene file again, or a mistake in it passes."""
    monkeypatch.chdir(tmp_path)
    write_mesh(tmp_path / "plate.vtu", plate_mesh())
    path = deck(tmp_path, DECK.format('[["0 s", 0], ["1 s", "-1e6 m/s^2"]]'))
    (load,) = [make(read_deck(path).scene().space) for make in read_deck(path).scene().loads]
    load.at(1.0)
    space = read_deck(path).scene().space
    np.testing.assert_allclose(load.values.sum(axis=0), [0.0, -1e-9 * 1e9 * space.V.sum()], atol=1e-12)
    assert invoke_program("run", path, "--out", "first", "--quiet") == (0, "", "")
    assert invoke_program("run", tmp_path / "first" / "scene.toml", "--out", "second", "--quiet")[0] == 0
    first, second = (Path(name, "history.csv").read_bytes() for name in ("first", "second"))
    assert first == second and StoredScene.read(Path("first")).made_in_python == ()
    for table, said in (({"y": "1 m"}, r"body force of the body, y must be a quantity in mm/s\^3"),
                        ({"region": "core", "w": 1}, r"body_forces: unknown key 'w'; the keys are region, x, y, z")):
        with pytest.raises(ParameterError, match=f"^{said}"):
            read_tables("body_forces", [table])
    text = DECK.format('"-1 m/s^3"')
    with pytest.raises(ParameterError, match=r"^body force of the body has a component z, and the mesh is plane"):
        read_deck(deck(tmp_path, text + "z = 1\n")).scene()
    with pytest.raises(MeshError, match=r"no set of elements 'core'"):
        read_deck(deck(tmp_path, text + 'region = "core"\n')).scene()
