"""Validation against what is known: pulses, tearing, cavitation, branching, peeling, and the table that says so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from skfsink.errors import OutputError
from skfsink.material import AAA, NeoHookean, SinkLaw, Yeoh, limiter_of
from skfsink.scene.deck import read_deck
from skfsink.study import validation_glass
from skfsink.study.validation import KNOWN, rows_of
from skfsink.study.validation_branching import CUT, LENGTH, forked, rows_branching, start_expected
from skfsink.study.validation_cavitation import RATIO, Void
from skfsink.study.validation_glass import GLASS, TOUGHNESS, Strip, event_of, limiter
from skfsink.study.validation_peeling import STRENGTH, Peel, radial_limiter, rows_peeling, strength_across
from skfsink.study.validation_pulses import KINDS, STRETCH, Pulse, acoustic_speeds, delay, free_sides
from skfsink.study.validation_table import BEGIN, END, Row, lines, renew
from skfsink.study.validation_tearing import Piece
from skfsink.study.validation_voids import cavitation_pressure, critical_membrane, membrane_stress
from skfsink.system.shipped import data_folder, shipped_decks

RUBBER, LIMITER = Yeoh(), SinkLaw(phi=limiter_of("yeoh").phi)


# --- pulses ---
def test_acoustic_speeds() -> None:
    """Fails if the speeds of an undeformed solid are not c_d and c_s, or a stretch does not carry its waves along."""
    material = AAA()
    assert acoustic_speeds(material, (1.0, 1.0)) == pytest.approx(
        (material.dilatational_wave_speed, material.shear_wave_speed), rel=1e-12)
    rubber = NeoHookean()  # rho c^2 = mu lambda^2 of a transverse wave, whatever the pressure
    for stretches in ((1.5, 1 / 1.5), (0.8, 1.25)):
        assert acoustic_speeds(rubber, stretches)[1] == pytest.approx(stretches[0] * rubber.shear_wave_speed, rel=1e-12)
    F = np.diag([*free_sides(material, 1.4, 2), 1.0])
    assert abs(material.first_piola(F)[1, 1]) < 1e-9


def test_delay_of_a_pulse() -> None:
    """Fails if the delay between two pulses is off by more than a thousandth of their length, with uneven times."""
    t = np.sort(np.random.default_rng(0).uniform(0, 1, 600))
    first, second = (np.exp(-((t - at) / 0.05) ** 2) for at in (0.2, 0.6437))
    assert delay(t, first, second) == pytest.approx(0.4437, abs=1e-4)


@pytest.mark.parametrize("wave", KINDS)
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize(("scheme", "stretched"), [("explicit", False), ("explicit", True), ("hht", True)])
def test_pulse_in_a_bar(scheme: str, dim: int, wave: str, stretched: bool) -> None:
    """Fails if a pulse is off by 0.5 %: a mass, a tangent at a stretch, or a scheme wrong. Dispersion is 0.1 to 0.4 %.

    Speeds of the stretched bars are 1.3 to 1.6 times those of the undeformed ones.
    """
    found = Pulse(dim, scheme, wave, STRETCH[dim] if stretched else 1.0, 100)()
    assert found[f"{wave}_m_per_s"] == pytest.approx(found[f"{wave}_expected_m_per_s"], rel=5e-3)


@pytest.mark.parametrize("stretch", [1.0, 1.3])
def test_pulses_in_a_block(stretch: float) -> None:
    """Fails if one of two pulses that leave an edge together is off by 1 %: dispersion is 0.2 and 0.6 %."""
    found = Pulse(2, "explicit", "both", stretch, 100)()
    for wave in KINDS:
        assert found[f"{wave}_m_per_s"] == pytest.approx(found[f"{wave}_expected_m_per_s"], rel=0.01)


# --- tearing ---
def test_one_tearing_energy() -> None:
    """Fails if G at the onset is not W H in pure shear, or 5 % another in a sheet with an edge crack."""
    pytest.importorskip("gmsh")
    strip = Piece("pure shear", 8.0, 1.5, 2.0, 0)()
    assert strip["G_over_band"] == pytest.approx(strip["closed_WH_over_band"], rel=0.01)
    sheet = Piece("edge crack", 3.0, 4.0, 1.0, 0)()
    assert sheet["stretch"] < 0.985 * strip["stretch"]
    assert sheet["G_over_band"] == pytest.approx(strip["G_over_band"], rel=0.05)


# --- cavitation ---
def test_closed_forms_of_cavitation() -> None:
    """Fails if a neo-Hookean ball is not unstable at 5/2 mu, or a membrane is not so far away."""
    rubber = NeoHookean()
    assert cavitation_pressure(rubber, None, "ball", most=400.0)[0] == pytest.approx(2.5 * rubber.mu, rel=3e-3)
    finite = [cavitation_pressure(rubber, None, "ball", ratio, most=100.0)[0] for ratio in (10.0, 20.0, 40.0)]
    assert finite[0] < finite[1] < finite[2] < 2.5 * rubber.mu
    stress, stretch = membrane_stress(rubber, None, 2.0)
    assert stress == pytest.approx(rubber.mu * (stretch**2 - stretch**-4), rel=1e-3)


def test_rubber_of_the_library_cavitates_where_it_was_published() -> None:
    """Fails if `yeoh` with Phi = 82 MPa is not the rubber of Volokh (2011): 2 to 3 MPa in bulk, 50 to 60 in a sheet."""
    assert 2.0 < cavitation_pressure(RUBBER, LIMITER, "ball")[0] < 3.0
    assert 50.0 < critical_membrane(RUBBER, LIMITER)[0] < 60.0


@pytest.mark.parametrize("kind", ["ball", "cylinder"])
def test_void_of_elements(kind: str) -> None:
    """Fails if a ball or a cylinder with a hole bears 3 % more or less than its closed form."""
    found = Void(kind, RUBBER, SinkLaw(phi=LIMITER.phi, length_scale=0.1), 0)()
    assert found["tension_MPa"] == pytest.approx(cavitation_pressure(RUBBER, LIMITER, kind, RATIO)[0], rel=0.03)


# --- branching ---
def test_start_of_the_branching_plate() -> None:
    """Fails if the plate does not start when two waves of 1 MPa have raised K to that of G_c (c_d = 3810 m/s).

    K^2 = 16 s^2 c_d t (1 - 2 nu)/(pi (1 - nu)^2), from when the waves meet, has to be E G_c/(1 - nu^2).
    """
    assert GLASS.rayleigh_wave_speed == pytest.approx(2125, abs=1)
    t = start_expected() - 20.0 / 3.8095e6
    assert 16 * 3.8095e6 * t * 0.6 / (np.pi * 0.64) == pytest.approx(32000 * TOUGHNESS / 0.96, rel=1e-3)
    assert start_expected() < 60.0 / 3.8095e6  # before the next waves


def test_fork_of_what_has_cracked() -> None:
    """Fails if a fork is seen where there is none, or one at x = 70 is off by 3 mm, or the length of all by 5 %."""
    x, more = np.arange(50, 70, 0.1), np.arange(70, 100, 0.1)
    trunk, branch = np.column_stack([x, 20 + 0 * x]), np.column_stack([more, 20 + 0.5 * (more - 70)])
    place, length = forked(np.concatenate([trunk, branch, branch * (1, -1) + (0, 40)]), 1.0, 2.0)
    assert place == pytest.approx(70, abs=3) and length == pytest.approx(20 + 60 * np.hypot(1, 0.5), rel=0.05)
    assert forked(trunk, 1.0, 2.0) == (None, pytest.approx(20))


def test_limiter_of_glass(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if the limiter does not give psi_f l times what the strip took as G_c."""
    monkeypatch.setattr(validation_glass, "strip_of", lambda *_: {"G_over_band": 0.6})
    for l in (1.0, 0.5):
        assert 0.6 * SinkLaw(phi=limiter(l)).failure_energy * l == pytest.approx(TOUGHNESS, rel=1e-12)


def test_deck_of_the_branching_plate_starts_in_time(tmp_path: Path) -> None:
    """Fails if the crack of the deck has gone l before 10 us or not by 13 us; the closed form has it start at 10.7."""
    text = shipped_decks()["branching_plate"].read_text(encoding="utf-8")
    text = text.replace("meshes/", f"{data_folder('branching_plate') / 'meshes'}/").replace('"80 µs"', '"13 µs"')
    (tmp_path / "deck.toml").write_text(text, encoding="utf-8")
    result = read_deck(tmp_path / "deck.toml").run(out=tmp_path / "run", quiet=True)
    event = event_of(result.history)
    gone = np.nan_to_num(event["x"] - CUT)
    assert event["time"][np.argmax(gone > 1.0)] > 10e-6 and gone.max() > 1.0
    assert abs(result.history["balance_N_mm_per_mm"][result.history["phase"] == "event"]).max() < 1e-9


@pytest.mark.slow
def test_strip_of_glass() -> None:
    """Fails if a crack in a strip runs at less than a third of psi_f l or more than all of it, or D is more than G."""
    pytest.importorskip("gmsh")
    found = Strip(3)()
    assert 1 / 3 < found["G_over_band"] < 1 and 0 < found["D_over_band"] < found["G_over_band"]
    assert 0.7 < found["speed_over_rayleigh"] < 1


# --- peeling ---
def test_strength_across_the_layers() -> None:
    """Fails if the limiter does not give the strength that was measured, or the fibres do not lie in the layers."""
    assert strength_across(radial_limiter()).stress == pytest.approx(STRENGTH, rel=1e-4)
    assert strength_across(radial_limiter()).at > 1.5  # 1.25 along the fibres' axis, where they stretch at once


def test_peel_takes_twice_its_force() -> None:
    """Fails if the energy that a T-peel takes is not twice its force by width: 1 for arms that do not stretch.

    The arms are thick and short here, and steps of the crack an element long: 15 %.
    """
    found = Peel(0.6)()
    assert found["energy_N_per_mm"] == pytest.approx(2e-3 * found["force_mN_per_mm"], rel=0.15)
    assert 0 < found["D_N_per_mm"] < found["energy_N_per_mm"]


def test_rows_say_what_disagrees() -> None:
    """Fails if a plate that branches late, or a peel that takes too little, is said to agree."""
    plate = {"start_s": 11e-6, "branch_s": 36e-6, "arrival_s": 79e-6, "arrival_mm": LENGTH,
             "speed_over_rayleigh": [0.5, 0.6], "D_per_length_over_G_c": 1.0}
    assert [row.agrees for row in rows_branching({"plate/1": plate})] == [True] * 4 + [None]
    late = {**plate, "start_s": 15e-6, "branch_s": None, "arrival_s": 60e-6, "speed_over_rayleigh": [0.7, 0.8]}
    assert [row.agrees for row in rows_branching({"plate/1": late})] == [False] * 4 + [None]
    early = {**plate, "branch_s": 20e-6}
    assert [row.agrees for row in rows_branching({"plate/1": early, "plate/0.5": plate})][1] is None
    peel = {"length_scale_mm": 0.3, "per_length": 4, "phi_MPa": 0.007, "energy_over_band": 0.3,
            "force_mN_per_mm": 23.0, "energy_N_per_mm": 0.05}
    assert [row.agrees for row in rows_peeling({"l/0.3/4": peel, "fit": {**peel, "strength_MPa": 10.0}})] == [
        True, True, False]
    assert not rows_peeling({"l/0.3/4": {**peel, "energy_N_per_mm": 0.005}})[0].agrees


# --- the table ---
def test_table_goes_between_the_marks_of_a_page(tmp_path: Path) -> None:
    """Fails if the table does not replace the one before, or what is around it changes, or a page has no marks."""
    page = tmp_path / "page.md"
    page.write_text(f"before\n\n{BEGIN}\nold\n{END}\n\nafter\n")
    rows = [Row("speed", "1", "1.1", "0.1", True, ""), Row("time", "2", "3", "0.1", False, "late"),
            Row("weight", "4", "–", "–", None, "no scales")]
    for _ in range(2):
        renew(page, rows)
        text = page.read_text()
        assert text.startswith("before\n\n<!--") and text.endswith("-->\n\nafter\n") and "old" not in text
        assert text.count("| time | 2 | 3 | 0.1 | **no** | late |") == 1
    assert len(lines(rows)) == 5 and lines(rows)[-1].split(" | ")[-2] == "not compared"
    page.write_text("no marks")
    with pytest.raises(OutputError, match="must have the marks"):
        renew(page, rows)
    with pytest.raises(OutputError, match="cannot read the page"):
        renew(tmp_path / "none.md", rows)


def test_rows_of_the_points_there_are(tmp_path: Path) -> None:
    """Fails if a part that was not computed breaks the table, or a speed is said to agree that is off by 2 %."""
    assert rows_of({}) == []
    point = {"stretch": 1.0, "transverse_m_per_s": 29.2, "transverse_expected_m_per_s": 29.3}
    points = {"pulses/bar 2D/explicit/transverse/undeformed/100": point,
              "pulses/bar 3D/explicit/transverse/undeformed/100": {**point, "transverse_m_per_s": 28.7}}
    assert [row.agrees for row in rows_of(points)] == [True, False]
    for name, known in KNOWN.items():
        known.draw({}, tmp_path / f"{name}.png")
        assert (tmp_path / f"{name}.png").exists()
