"""Motion of the pieces of a body: sums are those of the body, rigid pieces are known, and runs write them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bodies import box, wavy
from guarded import NOTCHED, Stop, scene, simulation

from skfsink.errors import Interrupted, OutputError, ParameterError
from skfsink.fem.space import Space
from skfsink.fields.momentum import Momentum
from skfsink.fields.pieces import Pieces, pieces_of
from skfsink.fields.state import State
from skfsink.material import AAA, NeoHookean, SinkLaw
from skfsink.material.regions import Region
from skfsink.results.fragments import read_fragments
from skfsink.results.loader import load
from skfsink.run.compute import run
from skfsink.run.display import Display
from skfsink.run.observers.fragments import Fragments
from skfsink.run.simulate import Simulation
from skfsink.scene.scene import Scene


def found(momentum: Momentum, state: State) -> Pieces:
    """The pieces of a state."""
    momentum.set_gamma(state.gamma, state.deleted)
    return pieces_of(momentum, state)


def cut(space: Space, at: float = 0.5) -> np.ndarray:
    """Mask of the elements of the layer around x = `at`, (ne,)."""
    middle = space.X[space.conn][:, :, 0].mean(axis=1)
    return np.asarray(np.abs(middle - at) < 0.1)


def test_sums_over_the_pieces_are_those_of_the_body(kind: str) -> None:
    """Fails if mass, momentum or energy is lost or counted twice, whatever the density, materials and motion.

    Element masses and nodal ones are summed in two ways; elements of no piece bear no force here, and have no mass.
    Angular momentum: of the pieces about their centres, and of these about the origin, is that of the body.
    """
    space, rng = box(kind, 6), np.random.default_rng(4)
    regions = [Region("light", np.arange(0, space.n_elements, 3), NeoHookean(density=500.0), SinkLaw())]
    momentum, state = Momentum(space, AAA(), regions=regions), State.intact(space)
    state.gamma = rng.uniform(0.05, 1.0, space.n_nodes)
    state.gamma[np.abs(space.X[:, 0] - 1 / 3) < 0.12] = 0.0
    state.gamma[(space.X[:, 0] > 0.6) & (np.abs(space.X[:, 1] - 0.5) < 0.13)] = 0.0
    state.deleted[rng.integers(0, space.n_elements, 3)] = True
    state.u, state.v = wavy(space, 0.1), rng.uniform(-1e3, 1e3, space.X.shape)
    pieces = found(momentum, state)
    mass, x = momentum.lumped_mass(0.0), space.X + state.u
    assert len(pieces.mass) >= 2 and (np.diff(pieces.mass) <= 0).all()
    assert pieces.mass.sum() == pytest.approx(mass.sum(), rel=1e-12)
    np.testing.assert_allclose(pieces.momentum.sum(axis=0), mass @ state.v, rtol=1e-10)
    np.testing.assert_allclose(pieces.mass @ pieces.centre, mass @ x, rtol=1e-12)
    assert pieces.kinetic.sum() == pytest.approx(0.5 * mass @ (state.v**2).sum(axis=1), rel=1e-12)
    assert (pieces.translation + pieces.rotation <= pieces.kinetic * (1 + 1e-12)).all() and (pieces.rotation >= 0).all()

    def moment(r: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.cross(r, p) if space.dim == 3 else (r[:, :1] * p[:, 1:] - r[:, 1:] * p[:, :1])

    about_origin = (pieces.angular_momentum + moment(pieces.centre, pieces.momentum)).sum(axis=0)
    np.testing.assert_allclose(about_origin, moment(x, mass[:, None] * state.v).sum(axis=0), rtol=1e-9)


def test_two_blocks_fly_apart(kind: str) -> None:
    """Fails if mass, centre, velocity, spin or energy of a rigid piece are not those that it was given.

    The body is 1 mm wide, and a layer from 0.4 to 0.6 has failed: blocks of 0.4 mm, of which the right one is
    moved away. Spin is that of the motion exactly, and the energies of translation and rotation are all there is.
    """
    space = box(kind, 5, 0.0)
    dim, momentum, state = space.dim, Momentum(space, AAA()), State.intact(space)
    state.deleted[cut(space)] = True
    right = space.X[:, 0] > 0.5
    state.u[right] = 0.3
    x = space.X + state.u
    middle = {0: np.array([0.2, *[0.5] * (dim - 1)]), 1: np.array([1.1, *[0.8] * (dim - 1)])}
    velocity = {0: np.array([-2e3, 1e3, 0.0][:dim]), 1: np.array([3e3, 0.0, -1e3][:dim])}
    spin = {0: np.array([1e4, -2e4, 3e4]), 1: np.array([0.0, 5e3, -4e4])}
    for k, nodes in enumerate((~right, right)):
        arm = np.pad(x[nodes] - middle[k], ((0, 0), (0, 3 - dim)))
        turning = np.cross(spin[k] * ([0, 0, 1] if dim == 2 else 1), arm)
        state.v[nodes] = velocity[k] + turning[:, :dim]
    pieces = found(momentum, state)
    assert len(pieces.mass) == 2 and pieces.elements.tolist() == [2 * 5 ** (dim - 1)] * 2
    first = 0 if pieces.centre[0, 0] < 0.5 else 1  # of equal masses either is the heaviest
    for k, row in ((0, first), (1, 1 - first)):
        mass = AAA().rho0 * 0.4
        assert pieces.mass[row] == pytest.approx(mass) and pieces.volume[row] == pytest.approx(0.4)
        np.testing.assert_allclose(pieces.centre[row], middle[k], rtol=1e-12)
        np.testing.assert_allclose(pieces.velocity[row], velocity[k], atol=1e-9)
        np.testing.assert_allclose(pieces.momentum[row], mass * velocity[k], atol=1e-18)
        np.testing.assert_allclose(pieces.spin[row], spin[k][2:] if dim == 2 else spin[k], rtol=1e-9, atol=1e-6)
        assert pieces.translation[row] == pytest.approx(0.5 * mass * velocity[k] @ velocity[k])
        assert pieces.kinetic[row] == pytest.approx(pieces.translation[row] + pieces.rotation[row], rel=1e-12)


def test_nothing_is_left_of_a_body() -> None:
    """Fails if a body of no pieces is none."""
    space = box("quad", 3)
    state = State.intact(space)
    state.deleted[:] = True
    assert all(len(part) == 0 for part in found(Momentum(space, AAA()), state))


def apart(**controls: Any) -> Scene:
    """The notched block, whose crack runs through."""
    return scene(NOTCHED.sample, **{"event_time": 6e-5, "overshoot": 0.01, "checkpoint_every": 1e6, "frame_every": 1e-4,
                                    **controls})


def test_a_run_writes_its_pieces(tmp_path: Path, pictures: None) -> None:
    """Fails if the pieces at the end are not in file, summary and picture, or an observer misses a look.

    The heaviest are first, and a run looks once more at its end.
    """
    one = run(apart(), tmp_path / "one", quiet=True)
    many = run(apart(), tmp_path / "many", [Fragments(every=1e-5)], quiet=True)
    assert one.summary["event"]["separated"] and one.summary["event"]["pieces"] >= 2
    end, rows = load(tmp_path / "one").fragments, load(tmp_path / "many").fragments
    assert (end["step"] == one.state.step).all() and len(end["piece"]) == one.summary["event"]["pieces"]
    last = rows["step"] == many.state.step
    for name in end:
        np.testing.assert_array_equal(rows[name][last][-len(end[name]):], end[name])
    times = np.unique(rows["time_s"])
    np.testing.assert_array_equal((times[:-1] / 1e-5).astype(int), np.arange(len(times) - 1))
    assert rows["piece"][0] == 1 and rows["piece"][1] == 1  # whole at first
    summary = json.loads((tmp_path / "one" / "summary.json").read_text())["fragments"]
    for i, piece in enumerate(summary["pieces"]):
        assert all(end[name][i] == value for name, value in piece.items())
    assert summary["all"]["kinetic_N_mm_per_mm"] == pytest.approx(end["kinetic_N_mm_per_mm"].sum())
    assert len(summary["pieces"]) + one.summary["event"]["debris"] == len(end["piece"])
    assert summary["all"]["kinetic_N_mm_per_mm"] == pytest.approx(one.state.ledger.kinetic, rel=0.02)  # raised mass
    assert (tmp_path / "one" / "fragments.png").stat().st_size > 1e4


@pytest.mark.parametrize("stop", [3, 60])
def test_a_resumed_run_has_the_same_pieces(stop: int, tmp_path: Path) -> None:
    """Fails if rows are lost or doubled where a run goes on."""
    simulation(apart(event_time=1e-5), tmp_path / "whole", Fragments(every=1e-6)).run()
    with pytest.raises(Interrupted):
        simulation(apart(event_time=1e-5), tmp_path / "broken", Fragments(every=1e-6), Stop(stop)).run()
    Simulation(apart(event_time=1e-5), tmp_path / "broken", Display(True), resume=True,
               observers=[Fragments(every=1e-6)]).run()
    whole, broken = ((tmp_path / name / "fragments.csv").read_bytes() for name in ("whole", "broken"))
    assert whole == broken and whole.count(b"\n") == 13  # header, beginning, ten, end


def test_passes_and_runs_without_a_failure(tmp_path: Path) -> None:
    """Fails if passes are seconds, a quasi-static event moves, or a body that did not fail is not one piece."""
    quasistatic = run(apart(analysis="quasistatic"), tmp_path / "passes", [Fragments(every_passes=5)], quiet=True)
    rows = load(tmp_path / "passes").fragments
    assert (rows["time_s"] == 0).all() and (rows["kinetic_N_mm_per_mm"] == 0).all()
    assert set(rows["step"] % 5) <= {0, quasistatic.state.step % 5} and rows["step"].max() == quasistatic.state.step


def test_what_cannot_be_asked_for(tmp_path: Path) -> None:
    """Fails if a schedule that cannot be passes, or a file that is none is read."""
    with pytest.raises(ParameterError, match="every of the observer Fragments must be a finite number"):
        run(apart(), tmp_path / "out", [Fragments(every=0.0)], quiet=True)
    (tmp_path / "fragments.csv").write_text("a,b\n1,2\n")
    with pytest.raises(OutputError, match=r"fragments.csv is no file of fragments, or is damaged"):
        read_fragments(tmp_path / "fragments.csv")
