"""Where each method fails, measured as in the study of stability, and that options keep a run on the safe side."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import skfem

from skfsink.cli.program import command
from skfsink.errors import ParameterError
from skfsink.fem.indicators import alternation, inverted, turning
from skfsink.fem.space import Space
from skfsink.methods.controls import ExplicitControls, HHTControls, StaticsControls
from skfsink.scene.controls import Controls
from skfsink.study import stability_elements, stability_onset, stability_strength, stability_time
from skfsink.study.blocks import block
from skfsink.study.stability import stability


@pytest.mark.parametrize("state", stability_time.STATES)
def test_explicit_blow_up_is_as_predicted(state: str):
    """Fails if the limit or the growth beyond it is not that of omega_max of the stretched, damaged body (5 %)."""
    below, above = (stability_time.explicit(state, courant) for courant in (0.995, 1.05))
    assert below["growth"] == 1.0 and below["greatest"] < 6 and below["steps"] == 400
    assert above["growth"] == pytest.approx(above["predicted"], rel=0.05) and above["steps"] < 60
    with pytest.raises(ParameterError, match=r"courant must be .* \(0, 1\]"):
        ExplicitControls(courant=1.001)


@pytest.mark.slow
def test_hht_without_its_guard_kills_the_mesh_in_long_steps():
    """Fails if the guard does nothing, or is not needed any more: 10 us steps against 0.2 us."""
    short, guarded, bare = (stability_time.long_steps(dt, guard) for dt, guard in ((0.2, True), (10.0, True),
                                                                                  (10.0, False)))
    assert guarded["lost_density"] == pytest.approx(short["lost_density"], rel=0.05) and guarded["rejected"] > 0
    assert bare["lost_density"] > 2 * short["lost_density"] and bare["deleted"] > 3 * short["deleted"]


def test_alpha_is_stable_in_its_range_and_not_beyond_twice_it():
    """Fails if the allowed range of alpha holds an unstable one, or the map of the radius is wrong at known points."""
    for alpha in np.linspace(-1 / 3, 0, 9):
        assert stability_time.alpha_scan(float(alpha))["greatest"] <= 1 + 1e-9
        HHTControls(alpha=float(alpha))
    assert stability_time.alpha_scan(0.01)["greatest"] == pytest.approx(1.02, abs=2e-3)
    assert stability_time.alpha_scan(-0.51)["greatest"] > 1.03
    lasts = [stability_time.alpha_scan(a)["last"] for a in (-0.4, -1 / 3, -0.25)]
    assert lasts[1] == min(lasts) == pytest.approx(0.5, abs=5e-3)  # beyond -1/3 long waves lose more than short ones


def test_staggering_stalls_at_the_onset():
    """Fails if the factor of convergence does not tend to one there: it is why the onset is what bisection finds."""
    found = stability_onset.staggering()
    distance, factor = 1 - np.array(found["load"]), np.array(found["factor"])
    assert factor[distance > 0.3].max() < 0.01
    assert factor[(distance > 3e-3) & (distance < 0.1)].max() < 0.8
    assert factor[distance < 1e-5].min() > 0.95
    assert found["least"][-1] > 0.88


def test_consistent_sink_is_negative_and_breaks_the_iteration():
    """Fails if the reason for the default sink is gone: gamma < 0 and no convergence, at l/h = 4."""
    lumped, consistent = (stability_elements.consistent(sink, 4, 1e-15, 0) for sink in ("lumped", "consistent"))
    assert lumped["least"] > 0 and lumped["amg_converged"] and lumped["amg"] < 20
    assert consistent["least"] < -0.02 and not consistent["amg_converged"]
    assert consistent["jacobi"] > 2 * lumped["jacobi"]
    mild = stability_elements.consistent("consistent", 4, 1e-3, 0)
    assert mild["amg_converged"] and mild["least"] < 0


def test_plain_element_locks_and_jbar_does_not():
    """Fails if J-bar stiffens with k/mu, or stops converging within the range that is not warned of."""
    force = {(e, d): stability_elements.locking(e, 10.0**d) for e in ("jbar", "plain") for d in (2, 4)}
    assert force["jbar", 4]["force"] == pytest.approx(force["jbar", 2]["force"], rel=0.02)
    assert force["plain", 2]["force"] > 1.3 * force["jbar", 2]["force"]
    assert force["plain", 4]["force"] > 3 * force["jbar", 4]["force"]
    assert force["jbar", 4]["rounding"] < StaticsControls().tolerance / 10
    beyond = stability_elements.locking("jbar", 1e7)
    assert "no equilibrium" in beyond["refused"]


def test_pressure_alternates_on_even_meshes_only():
    """Fails if the checkerboard is not seen on an even mesh, or stays where the rows are broken up."""
    even, uneven = (stability_elements.checkerboard(1e4, amount) for amount in (0.0, 0.2))
    assert even["amplitude"] > 0.5 and uneven["amplitude"] < 0.1
    assert even["energy"] < 1e-3  # of the energy limiter: the sink hardly sees it
    space = block(12).space
    i, j = np.rint(12 * space.X[space.conn].mean(axis=1) - 0.5).astype(int).T
    assert alternation(space, np.where((i + j) % 2, 3.0, -3.0)) == pytest.approx(3.0, rel=0.1)
    x, y = space.X[space.conn].mean(axis=1).T
    smooth = 100 + 7 * x - 5 * y
    assert alternation(space, smooth) < 0.1 * smooth.std()  # of the outermost elements, which have one side only


def test_pressed_elements_are_refused_before_they_turn_inside_out():
    """Fails if Newton's method returns a body with J <= 0, or cannot press one that is possible in increments."""
    half, flat = (stability_elements.flattened(s) for s in (0.5, 0.05))
    assert half["full"] < 0 and half["single"]       # a full step turns elements inside out, one increment is refused
    assert half["many"] == "" and half["least"] > 0.3 and half["energy"] > 100
    assert "no equilibrium" in flat["many"]
    space = block(4).space
    u = np.zeros_like(space.X)
    u[space.conn[5], 0] = 2.2 * (space.X[space.conn[5], 0].mean() - space.X[space.conn[5], 0])
    count, gamma = inverted(space, u, np.full(space.w.shape, 0.7))
    assert count >= 4 and gamma == 0.7
    assert inverted(space, u, np.zeros(space.w.shape)) == (0, 0.0)


@pytest.mark.slow
def test_energy_deleted_grows_with_the_threshold():
    """Fails if the allowed thresholds delete energy that matters, or the floor does not make it vanish."""
    most, highest, default = (stability_time.deletion(t, f, 15.0) for t, f in ((0.5, 0.0), (1e-2, 0.0), (1e-6, 1e-3)))
    assert most["deletion"] > 0.01 > 2e-3 > highest["deletion"] > 1e-5
    assert default["deletion"] == 0.0
    with pytest.raises(ParameterError, match="deletion must be"):
        Controls(deletion=0.011)


def test_history_of_states_that_are_no_equilibria_fails_the_body():
    """Fails if it is not the equilibrium that keeps a body below its onset intact."""
    moved, once, found = (stability_onset.unconverged(1, steps) for steps in (0, 1, -1))
    assert moved["lost"] > 0.2 and moved["deleted"] > 0.1
    assert once["lost"] > 0.1
    assert found["lost"] < 1e-3 and found["deleted"] == 0
    with pytest.raises(ParameterError, match="static_tolerance must be"):
        StaticsControls(tolerance=0.02)


@pytest.mark.slow
def test_onset_of_a_slit_falls_with_the_mesh_faster_than_that_of_a_round_notch():
    """Fails if a sharp notch is not seen for what it is: its onset is that of the mesh."""
    slit, blunt = ([stability_onset.notch(n, width)["opening_mm"] for n in (20, 40)] for width in (0.0, 0.2))
    assert slit[1] < 0.78 * slit[0]
    assert blunt[1] > 0.88 * blunt[0]
    assert [turning(block(40, notch=0.4, width=w, rounded=w > 0).space)[0] > 60 for w in (0.0, 0.2)] == [True, False]


def test_coarse_elements_delay_the_onset():
    """Fails if h hardly matters below l/h = 1.2, where runs are warned of, or matters as much above it."""
    coarse, middle, fine = (stability_onset.notch(n, 0.2)["opening_mm"] for n in (5, 20, 30))
    assert coarse > 1.2 * middle and middle < 1.1 * fine


def test_study_writes_its_figures_pictures_and_tables(tmp_path: Path):
    """Fails if the command does not leave the file, the picture and the table of what it was asked for."""
    for _ in range(2):  # the second time it has nothing to compute
        with pytest.raises(SystemExit) as end:
            command(stability, ["--only", "alpha", "--quick", "--quiet", "--out", str(tmp_path)], package="study")
        assert end.value.code == 0
    stored = json.loads((tmp_path / "stability.json").read_text())
    assert stored["study"] == "stability" and stored["points"]["alpha/alpha 0"]["greatest"] == pytest.approx(1)
    assert (tmp_path / "stability_alpha.png").stat().st_size > 10_000
    assert "| alpha -0.05 | -0.05 | 1 |" in (tmp_path / "stability.md").read_text()


def test_turning_of_a_surface_in_space():
    """Fails if the angle at an edge of hexahedra is not that of the body around it: a step in a block turns by 90."""
    lines = np.linspace(0, 1, 4)
    whole = skfem.MeshHex.init_tensor(lines, lines, lines)
    assert turning(Space(whole))[0] == pytest.approx(0.0, abs=1e-9)
    x, y, _ = whole.p[:, whole.t].mean(axis=1)
    angle, place = turning(Space(whole.remove_elements(np.flatnonzero((x < 0.3) & (y < 0.3)))))
    assert angle == pytest.approx(90.0)
    np.testing.assert_allclose(place[:2], 1 / 3)


@pytest.mark.parametrize(("ratio", "courant"), [(0.1, 1.0), (138.0, 0.8)])
def test_strong_materials_need_rejected_steps(ratio: float, courant: float):
    """Fails if explicit steps that feed in energy are not rejected: beyond the limit, and where elements turn over."""
    kept, lost = (stability_strength.explicit_event(ratio, courant, rejects) for rejects in (True, False))
    assert kept["why"] == "" and kept["lost"] < 1e-3 and 0 < kept["rejected"] < 0.1 * kept["steps"]
    assert kept["ended_us"] >= 20.0 and kept["gamma_inside_out"] < 0.5
    assert lost["rejected"] == 0 and lost["lost"] > 0.05


def test_hht_steps_that_feed_in_energy_are_halved():
    """Fails if HHT takes a step in which the elements of a strong material turn over, and keeps what it feeds in."""
    kept, lost = (stability_strength.hht_event(138.0, 0.16, rejects) for rejects in (True, False))
    assert kept["why"] == "" and kept["lost"] < 0.03 < 0.1 < lost["lost"]
