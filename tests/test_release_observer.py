"""The observer of energy release rates: its file and picture, resumed runs, what it refuses, notches and directions."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import meshio
import numpy as np
import pytest
import skfem
from guarded import NOTCHED, Stop, scene, simulation
from plates import drawing, sample_of

import skfsink
from skfsink.errors import Interrupted, OutputError, ParameterError
from skfsink.fem.space import Space
from skfsink.fields.crack import CrackTracker
from skfsink.fields.release_rate import energy_release_rate
from skfsink.loads.grips import Grip
from skfsink.material import AAA
from skfsink.meshing.vtu import write_mesh
from skfsink.results.history import History, history_header, history_units
from skfsink.results.release import load_release, release_header, write_release
from skfsink.run.display import Display
from skfsink.run.observers.notch_tip import notch_tip
from skfsink.run.observers.observer import Observer
from skfsink.run.observers.release import EnergyRelease
from skfsink.run.observers.view import View
from skfsink.run.simulate import Simulation
from skfsink.scene.scene import Scene
from skfsink.sweep.table import read_rows, read_units


def event(**controls: Any) -> Scene:
    """The notched block, whose crack runs."""
    return scene(NOTCHED.sample, **{"event_time": 2.5e-5, "overshoot": 0.01, "checkpoint_every": 1e6,
                                    "frame_every": 1e-5, "record_every": 1e-6, **controls})


@pytest.fixture(autouse=True)
def without_pictures() -> Iterator[None]:
    """Runs draw nothing of their own."""
    with drawing(False):
        yield


def test_rates_of_a_run_are_in_its_folder(tmp_path: Path) -> None:
    """Fails if rows, numbers or units are missing, the notch is not found, or a run differs for being looked at."""
    simulation(event(), tmp_path / "plain").run()
    simulation(event(), tmp_path / "seen", EnergyRelease(1e-6, radius=3.0)).run()
    assert (tmp_path / "plain/deletions.csv").read_bytes() == (tmp_path / "seen/deletions.csv").read_bytes()
    plain, seen = ([line.split(",") for line in (tmp_path / name / "history.csv").read_text().splitlines()]
                   for name in ("plain", "seen"))
    own = [i for i, name in enumerate(seen[0]) if name not in plain[0]]
    assert [seen[0][i] for i in own] == ["G_N_per_mm", "G_tip_speed_m_per_s"]
    assert [[cell for i, cell in enumerate(row) if i not in own] for row in seen] == plain
    columns = load_release(tmp_path / "seen" / "release.csv")
    assert list(columns) == release_header(2, "s") and (tmp_path / "seen" / "release.png").stat().st_size > 10000
    assert columns["phase"].tolist() == ["onset"] + ["event"] * (len(columns["phase"]) - 1) and len(columns["tip"]) > 8
    assert columns["tip"][0] == 0 and set(columns["tip"][1:]) >= {1}
    np.testing.assert_allclose([columns[name][0] for name in ("x_mm", "direction_x", "direction_y")],
                               [0.4, 1.0, 0.0], atol=0.25)
    G, known = columns["G_N_per_mm"], np.isfinite(columns["G_N_per_mm"])
    assert known[0] and known.sum() > 5 and (columns["note"] == "").tolist() == known.tolist()
    assert 0.5 < G[0] / 0.016 < 4 and (G[known] > 0).all()  # of psi_f l
    along = columns["J_x_N_per_mm"] * columns["direction_x"] + columns["J_y_N_per_mm"] * columns["direction_y"]
    np.testing.assert_allclose(along[known], G[known], rtol=1e-12)
    one = np.flatnonzero(columns["tip"] == 1)
    assert columns["G_mean_N_per_mm"][one[-1]] == pytest.approx(np.nanmean(
        G[one][columns["time_s"][one] >= columns["time_s"][one[-1]] - 4 * 0.1 / 29.35e3]))
    assert 10 < np.nanmedian(columns["speed_m_per_s"]) < 60


def test_history_has_the_greatest_rate_and_its_speed(tmp_path: Path) -> None:
    """Fails if a row of the history has not the greatest G of the tips at the look that it falls on, in units of both
    dimensions, or keeps one where no tip advances any more."""
    simulation(event(event_time=4e-5), tmp_path, EnergyRelease(1e-6, radius=3.0)).run()
    table, rates = History.load(tmp_path / "history.csv"), load_release(tmp_path / "release.csv")
    rows = np.flatnonzero(table["phase"] == "event")
    known = 0
    for row in rows:
        there = (rates["phase"] == "event") & (rates["time_s"] == table["time_s"][row])
        there &= np.isfinite(rates["G_N_per_mm"])
        if not there.any():
            assert np.isnan(table["G_N_per_mm"][row]) and np.isnan(table["G_tip_speed_m_per_s"][row])
            continue
        known += 1
        first = np.flatnonzero(there)[np.argmax(rates["G_N_per_mm"][there])]
        assert table["G_N_per_mm"][row] == rates["G_N_per_mm"][first]
        np.testing.assert_equal(table["G_tip_speed_m_per_s"][row], rates["speed_m_per_s"][first])
    assert known > 3 and np.isnan(table["G_N_per_mm"][table["phase"] == "loading"]).all()
    assert np.isnan(table["G_N_per_mm"][rows]).any()
    for dim in (2, 3):
        assert {"G_N_per_mm", "G_tip_speed_m_per_s"} <= set(history_header(dim))
        assert history_units(dim)["G_N_per_mm"] == "N/mm"


def test_greatest_of_the_last_look() -> None:
    """Fails if another tip than that of the greatest G is taken, one without G, or one of an earlier look."""
    observer, header = EnergyRelease(1e9), release_header(2, "s")
    for time, tip, G, speed in ((1.0, 1, 0.9, 3.0), (2.0, 1, 0.3, 5.0), (2.0, 2, 0.5, 7.0), (2.0, 3, np.nan, 9.0)):
        known = {"phase": "event", "time_s": time, "tip": tip, "G_N_per_mm": G, "speed_m_per_s": speed}
        observer.rows.append([known.get(name, 0.0) for name in header])
    view = SimpleNamespace(occasion="step", quasistatic=False, clock="s", crossed_multiple_of=lambda every: False,
                           body=SimpleNamespace(space=SimpleNamespace(dim=2)))
    observer.looked = 2.0
    assert observer.greatest(view) == (0.5, 7.0)  # type: ignore[arg-type]
    observer.looked = 3.0
    assert np.isnan(observer.greatest(view)).all()  # type: ignore[arg-type]


def test_a_deck_asks_for_rates(tmp_path: Path) -> None:
    """Fails if the table of a deck leaves other rates than the observer."""
    simulation(event(), tmp_path / "seen", EnergyRelease(2e-6, radius=3.0)).run()
    table = {"name": "G", "kind": "release_rate", "every": 2e-6, "radius": 3.0}
    simulation(dataclasses.replace(event(), probes=(table,)), tmp_path / "asked").run()
    assert (tmp_path / "asked" / "release.csv").read_bytes() == (tmp_path / "seen" / "release.csv").read_bytes()


def test_resumed_run_has_the_same_rates(tmp_path: Path) -> None:
    """Fails if rows or places of tips are lost at a checkpoint."""
    whole, stopped = tmp_path / "whole", tmp_path / "stopped"
    simulation(event(), whole, EnergyRelease(2e-6)).run()
    with pytest.raises(Interrupted):
        simulation(event(), stopped, EnergyRelease(2e-6), Stop(500)).run()
    assert not (stopped / "release.csv").exists()
    Simulation(event(), stopped, Display(True), resume=True, observers=[EnergyRelease(2e-6), Stop(10**9)]).run()
    for name in ("release.csv", "history.csv"):
        assert (whole / name).read_bytes() == (stopped / name).read_bytes()
    assert len(load_release(whole / "release.csv")["tip"]) > 5


def test_passes_have_rates_and_no_speed(tmp_path: Path) -> None:
    """Fails if a quasi-static crack has no G, or a speed."""
    simulation(event(analysis="quasistatic"), tmp_path, EnergyRelease(1e-6, radius=3.0, every_passes=1)).run()
    columns = load_release(tmp_path / "release.csv")
    assert list(columns) == release_header(2, "pass")
    rates = columns["G_N_per_mm"]
    assert np.isfinite(rates[1:]).sum() > 2 and np.isnan(columns["speed_m_per_s"]).all()
    np.testing.assert_array_equal(rates, columns["G_static_N_per_mm"])


class Half(Observer):
    """G at the onset of the half of the body that is computed."""

    def onset(self, view: View) -> None:
        self.rate = energy_release_rate(view.body, view.state, np.array([0.5, 0.0]), np.array([1.0, 0.0]), 0.3)


def test_on_a_plane_of_symmetry_the_rate_is_that_of_the_whole(tmp_path: Path) -> None:
    """Fails if a crack along a plane of symmetry gets the rate of the half, or its direction leaves the plane."""
    mesh = skfem.MeshQuad.init_tensor(np.linspace(0, 2, 41), np.linspace(0, 0.6, 13))
    lines = mesh.facets[:, mesh.boundary_facets()].T
    x, y = mesh.p[:, lines].mean(axis=-1)
    sets = {"top": y > 0.6 - 1e-9, "plane": (y < 1e-9) & (x > 0.5), "cut": (y < 1e-9) & (x < 0.5),
            "right": x > 2 - 1e-9}
    sample = sample_of(tmp_path, meshio.Mesh(
        np.column_stack([mesh.p.T, np.zeros(mesh.p.shape[1])]), [("quad", mesh.t.T), ("line", lines)],
        cell_sets={name: [np.zeros(0, int), np.flatnonzero(mask)] for name, mask in sets.items()}))
    of = dataclasses.replace(scene(sample, event_time=2e-6),
                             grips=(Grip("top", (None, 1.0)), Grip("plane", (None, 0.0)), Grip("right", (0.0, None))))
    half = Half()
    simulation(of, tmp_path / "run", EnergyRelease(1e-6, radius=3.0), half).run()
    columns = load_release(tmp_path / "run" / "release.csv")
    assert columns["G_N_per_mm"][0] == pytest.approx(2 * half.rate.G, rel=1e-2)
    np.testing.assert_array_equal([columns["direction_y"][0], columns["J_y_N_per_mm"][0]], 0.0)


def test_a_viscous_body_has_no_rates(tmp_path: Path) -> None:
    """Fails if a body with viscosity is looked at as if it were elastic."""
    with pytest.raises(ParameterError, match="EnergyRelease cannot look at a viscous body"):
        simulation(dataclasses.replace(event(), material=AAA(viscosity=1e-7)), tmp_path, EnergyRelease(1e-6))


@pytest.mark.parametrize(("arguments", "message"), [
    ({"every": 0.0}, "every must be a finite number in"), ({"every": 1e-6, "radius": 2.0}, "radius must be a finite"),
    ({"every": 1e-6, "every_passes": 0}, "every_passes must be a whole number")])
def test_observer_refuses_what_cannot_be(arguments: dict[str, Any], message: str) -> None:
    """Fails if an interval or a domain that cannot be is taken."""
    with pytest.raises(ParameterError, match=message):
        EnergyRelease(**arguments)


def test_file_of_rates_is_read_as_it_was_written(tmp_path: Path) -> None:
    """Fails if a number changes, a NaN becomes a word, or another file passes for one of rates."""
    path, header = tmp_path / "release.csv", release_header(3, "s")
    row = ["event", 1e-6, 2, 1.0, 2.0, 0.1 + 0.2, *[1.0] * (len(header) - 8), float("nan"), "a, note"]
    write_release(path, header, [row])
    columns = load_release(path)
    assert [columns[name][0] for name in header[:-2]] == row[:-2] and np.isnan(columns[header[-2]][0])
    assert columns["note"][0] == "a, note" and "nan" not in path.read_text()
    path.write_text("time,G\n1,2\n")
    with pytest.raises(OutputError, match=r"release.csv is not a file of energy release rates of skfsink"):
        load_release(path)


# --- where a crack goes ---
@pytest.mark.parametrize(("crack", "lips", "off"), [
    ({"points": [[0.0, 1.0], [4.0, 1.0]]}, "whole", 5e-3), ({"points": [[0.0, 1.0], [4.0, 1.0]]}, "broken", 2e-2),
    ({"elements": "cut"}, "whole", 2e-2)])
def test_rate_of_an_initial_crack_at_the_onset(crack: dict[str, Any], lips: str, off: float, tmp_path: Path) -> None:
    """Fails if a crack that the mesh has not gives no G at the onset, or another than W h of a strip in pure shear, of
    Rivlin and Thomas: it is cut from one end to its middle line, and clamped along its long sides.

    A neo-Hookean sheet without change of volume has W = mu/2 (s^2 + 1/s^2 - 2) there.
    """
    mesh = skfsink.grid_mesh(np.linspace(0, 12, 97), np.linspace(0, 2, 18))
    middle = mesh.points[mesh.cells[0].data].mean(axis=1)
    cut = np.flatnonzero((np.abs(middle[:, 1] - 1.0) < 0.01) & (middle[:, 0] < 4.0))
    mesh.cell_sets = {"cut": [cut]}
    write_mesh(tmp_path / "strip.vtu", mesh)
    run = skfsink.custom(
        mesh=tmp_path / "strip.vtu", element="planestress", material="neo-hookean", constants="mu = 1 MPa",
        phi="0.5 MPa", length_scale="0.2 mm", out=tmp_path / "run", stop="time > 0.1 us", quiet=True,
        grips=[{"boundary": "top", "x": 0, "y": 1}, {"boundary": "bottom", "x": 0, "y": 0}],
        cracks=[{"name": "slit", "lips": lips, **crack}], probes=[{"name": "tear", "kind": "release_rate", "every": 1}])
    rates = load_release(run.folder / "release.csv")
    s = 1 + run.summary["onset"]["displacement_mm"] / 2
    assert rates["phase"][0] == "onset" and rates["note"][0] == ""
    assert rates["x_mm"][0] == pytest.approx(4.0)
    (row,) = read_rows([tmp_path], [{"phi": 0.5}])  # as a run of a sweep, which lies in the folder `run` of its own
    assert row["onset_G"] == rates["G_N_per_mm"][0] and read_units([tmp_path])["onset_G"] == "N/mm"
    assert rates["G_N_per_mm"][0] == pytest.approx(2 * 0.5 * (s**2 + s**-2 - 2), rel=off)


def test_tip_of_a_notch_is_its_root() -> None:
    """Fails if the direction into the body is wrong at a notch, at a slit without width, or at a plane of symmetry."""
    space = NOTCHED.sample.space
    X, middle = space.X, 0.5 * float(np.ptp(space.X[:, 1])) + space.X[:, 1].min()
    root = int(np.argmin(np.linalg.norm(X - [0.4, middle], axis=1)))
    found = notch_tip(space, root, 0.3)
    assert found is not None
    np.testing.assert_allclose(found[1], [1.0, 0.0], atol=0.25)
    mesh = skfem.MeshQuad.init_tensor(np.linspace(0, 2, 21), np.linspace(-1, 1, 21))
    split = np.flatnonzero((np.abs(mesh.p[1]) < 1e-9) & (mesh.p[0] < 0.95))
    twin = np.arange(mesh.p.shape[1])
    twin[split] = mesh.p.shape[1] + np.arange(split.size)
    above = mesh.p[1, mesh.t].mean(axis=0) > 0
    slit = Space(skfem.MeshQuad(np.hstack([mesh.p, mesh.p[:, split]]), np.where(above, twin[mesh.t], mesh.t)))
    near = int(np.argmin(np.linalg.norm(slit.X - [1.1, 0.0], axis=1)))
    found = notch_tip(slit, near, 0.3)
    assert found is not None
    np.testing.assert_allclose(np.concatenate(found), [1.0, 0.0, 1.0, 0.0], atol=1e-12)
    assert notch_tip(slit, int(np.argmin(np.linalg.norm(slit.X - [1.5, 0.5], axis=1))), 0.3) is None


def test_crack_runs_away_from_what_has_cracked() -> None:
    """Fails if the direction of a tip is not that of the crack behind it, or a point has one."""
    space = Space(skfem.MeshQuad.init_tensor(np.linspace(0, 2, 41), np.linspace(0, 1, 21)))
    tracker, X = CrackTracker(space, 0.1, 30.0, [], np.zeros(0, int)), space.X
    start = int(np.argmin(np.linalg.norm(X - [0.5, 0.2], axis=1)))
    gamma = np.ones(space.n_nodes)
    gamma[start] = 0.0
    tracker.mark(0.0, gamma)
    assert tracker.backwards(start, 0.3) is None
    gamma[(np.abs((X[:, 1] - 0.2) - (X[:, 0] - 0.5)) < 0.01) & (X[:, 0] > 0.5) & (X[:, 0] < 1.01)] = 0.0
    tracker.mark(1e-6, gamma)
    tips = tracker.look(1e-6, gamma)
    back = tracker.backwards(int(tips.nodes[0]), 0.3)
    assert back is not None
    np.testing.assert_allclose(back, -np.sqrt([0.5, 0.5]), atol=1e-6)
    np.testing.assert_array_equal(X[tips.nodes], tips.points)
    assert tracker.advances(2e-6, tips.nodes).all() and not tracker.advances(1.0, tips.nodes).any()
