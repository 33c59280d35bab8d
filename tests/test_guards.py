"""Every guard of a run: it speaks just past its threshold, is silent before it, and its message names the cure."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import skfem
from guarded import NOTCHED, SHARP, Watched, scene

from skfsink.errors import InstabilityError
from skfsink.fem.space import Space
from skfsink.fields.energy import Ledger
from skfsink.material import AAA, SinkLaw
from skfsink.meshing.sample import Sample
from skfsink.methods.controls import ExplicitControls, HHTControls
from skfsink.run.notes import Notes
from skfsink.run.observers.range import check_scene, check_volume
from skfsink.scene.scene import Scene
from skfsink.study.blocks import block

MU = AAA().shear_modulus


# --- warnings ---
def test_a_warning_is_shown_once_and_kept(caplog: pytest.LogCaptureFixture):
    """Fails if a warning is repeated with other numbers, lost on resuming, or taken from a run that is over."""
    shown: list[str] = []
    log = logging.getLogger("skfsink.some.module")
    with Notes(shown.append) as notes:
        for h in (1, 2):
            log.warning("h is %d", h)
        log.warning("another")
        log.info("no warning")
    log.warning("too late")
    assert notes.texts == ["h is 1", "another"] and shown == ["warning: h is 1", "warning: another"]
    with Notes(shown.append, notes.kept) as resumed:
        log.warning("h is %d", 3)
        log.warning("a third")
    assert resumed.texts == ["h is 1", "another", "a third"] and shown[2:] == ["warning: a third"]
    assert logging.getLogger("skfsink").handlers == []


GRADED = np.concatenate([np.linspace(0, 0.5, 11), np.linspace(0.5, 1, 4)[1:]])


def coarse_right() -> Sample:
    """Elements of 0.05 mm on the left, of 0.17 mm on the right."""
    space = Space(skfem.MeshQuad.init_tensor(GRADED, np.linspace(0, 1, 11)))
    y = space.X[:, 1]
    return Sample("graded", space, {"top": np.flatnonzero(y > 1 - 1e-9), "bottom": np.flatnonzero(y < 1e-9)})


def squeezed(share: float) -> Sample:
    """Fifteen by fifteen elements, one column of which has only that share of the width of the others."""
    x = np.cumsum(np.r_[0.0, np.where(np.arange(15) == 7, share, 1.0)])
    space = Space(skfem.MeshQuad.init_tensor(x / 15, np.linspace(0, 1, 16)))
    y = space.X[:, 1]
    return Sample("squeezed", space, {"top": np.flatnonzero(y > 1 - 1e-9), "bottom": np.flatnonzero(y < 1e-9)})


@pytest.mark.parametrize(("of", "message"), [
    (lambda: scene(), None),
    (lambda: scene(element="plain"), r"plain element locks at k/mu = 405.* take element = 'jbar'"),
    (lambda: scene(material=AAA(bulk_modulus=49 * MU), element="plain"), None),
    (lambda: scene(material=AAA(bulk_modulus=1.9e4 * MU)), None),
    (lambda: scene(material=AAA(bulk_modulus=1e5 * MU)), r"k/mu = 1e\+05 is so large .* bulk_modulus 1.23e\+03"),
    (lambda: scene(material=AAA(bulk_modulus=1e5 * MU), law=SinkLaw(phi=100.0)), r"is so large .* phi asks for a bulk"),
    (lambda: scene(block(12)), None),
    (lambda: scene(block(11)), r"no element is finer than h = 0.0909 mm, l/h = 1.10 .* refine it to h <= l/3"),
    (lambda: scene(block(16, notch=0.4, width=0.0)), r"a notch turns by 180 degrees at one node, at \(0.375, 0.5\)"),
    (lambda: scene(block(15, notch=0.4, width=0.06)), SHARP + r".* round it with at least 4 elements"),
    (lambda: scene(squeezed(0.11)), None),
    (lambda: scene(squeezed(0.09)), None),
    (lambda: scene(squeezed(0.09), explicit=ExplicitControls(raised_mass=0)),
     r"an element near \(0.47, 0\.\d+\) mm is 0.006 mm narrow, most are 0.067 mm .*mend the mesh there"),
    (lambda: scene(squeezed(0.09), analysis="quasistatic"), None),
    (lambda: scene(squeezed(0.09), explicit=ExplicitControls(raised_mass=0.005)),
     r"they fill 0.006 of the volume: raised_mass 0\.00\d+\)"),
])
def test_scene_beyond_the_methods_is_warned_of(of: Callable[[], Scene], message: str | None,
                                               caplog: pytest.LogCaptureFixture):
    """Fails if a guard before the run is gone, speaks within the range of the methods, or names no cure."""
    check_scene(of())
    assert len(caplog.messages) == (message is not None)
    if message:
        assert re.search(message, caplog.messages[0]), caplog.messages


def test_onset_in_coarse_elements_is_warned_of(caplog: pytest.LogCaptureFixture):
    """Fails if the size of elements is not looked at where failure begins."""
    watched = Watched(scene(coarse_right()))
    left, right = (np.flatnonzero(np.isclose(watched.scene.sample.space.X[:, 0], x))[5] for x in (0.0, 1.0))
    watched.state.gamma[left] = 0.9
    watched.guard.check_onset(watched.state)
    assert not caplog.messages
    watched.state.gamma[right] = 0.8
    watched.guard.check_onset(watched.state)
    assert "where it begins to fail, at (1, 0.5) mm" in caplog.text and "refine it there to h <= l/3" in caplog.text


@pytest.mark.parametrize(("k", "swelling", "element", "told"), [
    (100 * MU, 0.012, "jbar", True), (100 * MU, 0.008, "jbar", False), (40 * MU, 0.012, "jbar", False),
    (100 * MU, 0.012, "planestress", False)])
def test_a_change_of_volume_is_warned_of(k: float, swelling: float, element: str, told: bool,
                                         caplog: pytest.LogCaptureFixture) -> None:
    """Fails if a body that is to be incompressible swells in silence, or one that is compressible, or a sheet, is told;
    or if the bulk modulus that it names leaves more than 0.2 % of such a pressure."""
    watched = Watched(scene(material=AAA(bulk_modulus=k), element=element))
    watched.state.u = watched.scene.sample.space.X * (np.sqrt(1 + swelling) - 1)
    check_volume(watched.scene, watched.state)
    assert len(caplog.messages) == told
    if told:
        assert "the volume has changed by 1.2 % on average (above 1), though k/mu = 100" in caplog.text
        assert f"raise it to {k * swelling / 0.002:.2g} MPa" in caplog.text


def test_alternating_pressures_are_warned_of(caplog: pytest.LogCaptureFixture):
    """Fails if a checkerboard in the pressures of an onset is not seen, or a smooth pressure is taken for one."""
    watched = Watched()
    X = watched.scene.sample.space.X
    watched.state.u += 1e-3 * np.column_stack([np.sin(2 * X[:, 0]), X[:, 1] ** 2])  # pressures up to 1 MPa, smooth
    watched.guard.check_onset(watched.state)
    assert not caplog.messages
    i, j = np.rint(X * 15).astype(int).T
    watched.state.u[:, 0] += 2e-4 * np.where((i // 1 + j // 2) % 2, 1, -1)
    watched.guard.check_onset(watched.state)
    assert "a checkerboard" in caplog.text and "break up the rows of the mesh" in caplog.text


def pressed_shut(by: float) -> Watched:
    """A plate with a notch, whose upper half is moved down by `by` [mm]."""
    watched = Watched(NOTCHED.scene)
    X = watched.scene.sample.space.X
    watched.state.u = np.zeros_like(X)
    watched.state.u[X[:, 1] > 0.5, 1] = -by * np.clip((1 - X[X[:, 1] > 0.5, 0]) / 0.6, 0, 1)
    return watched


def test_faces_that_pass_each_other_are_warned_of(caplog: pytest.LogCaptureFixture):
    """Fails if a notch pressed shut is not warned of with depth and time, or one that stays open is; or if the end
    does not say that it went further, or says so where it did not."""
    X = NOTCHED.scene.sample.space.X
    notch = X[(X[:, 0] < 0.3) & (np.abs(X[:, 1] - 0.5) < 0.1)]
    width = float(np.ptp(notch[np.abs(notch[:, 1] - 0.5) < 0.07, 1]))
    watched = pressed_shut(0.9 * width)
    watched.guard.check_overlap(watched.state)
    watched.guard.check_end()
    assert not caplog.messages
    for extra in (0.02, 0.025):
        watched.state.u = pressed_shut(width + extra).state.u
        watched.guard.check_overlap(watched.state)
    watched.guard.check_end()
    assert len(caplog.messages) == 2
    assert re.match(r"faces pass through each other by 0.02 mm at t = 0 s, near \(\d", caplog.messages[0])
    assert "there is no contact" in caplog.messages[0]
    watched.state.u = pressed_shut(width + 0.05).state.u
    watched.guard.check_overlap(watched.state)
    watched.guard.check_end()
    assert caplog.messages[-1].startswith("faces have passed through each other by up to 0.05 mm")


def test_crushed_elements_are_told(caplog: pytest.LogCaptureFixture):
    """Fails if elements without a stress are not counted."""
    watched = Watched()
    crushed = np.zeros(watched.guard.space.n_elements, bool)
    watched.guard.check_stress(watched.state, crushed)
    assert not caplog.messages
    crushed[[3, 7]] = True
    watched.guard.check_stress(watched.state, crushed)
    assert caplog.messages[0].startswith("the stress of 2 element(s) is not known")


def set_ledger(**entries: float) -> Callable[[Watched], None]:
    """Changes entries of the ledger."""
    return lambda watched: [setattr(watched.state.ledger, name, value) for name, value in entries.items()] and None


def shares(numerical: float = 0.0, deletion: float = 0.0) -> Callable[[Watched], None]:
    """Moves energy into `numerical` or `deletion`; the ledger stays closed."""
    return set_ledger(elastic=1 - numerical - deletion, numerical=numerical, deletion=deletion)


def mirrored(gamma: float) -> Callable[[Watched], None]:
    """Turns one element of that relative density inside out."""
    def change(watched: Watched) -> None:
        space, state = watched.scene.sample.space, watched.state
        nodes = space.conn[112]
        state.gamma[nodes] = gamma
        state.u[nodes, 0] = (space.X[nodes, 0].mean() - space.X[nodes, 0]) * 2.5
        watched.update()
    return change


def fields(value: float, share: float = 1.0) -> Callable[[Watched], None]:
    """Sets gamma to a value in a part of the body."""
    def change(watched: Watched) -> None:
        watched.state.gamma[: int(share * len(watched.state.gamma))] = value
        watched.update()
    return change


def pressed(watched: Watched) -> None:
    """Presses the body to a tenth of its volume."""
    watched.state.u = watched.scene.sample.space.X * (-0.75, -0.5)
    watched.update()


def broken_number(watched: Watched) -> None:
    """A displacement that is no number."""
    watched.state.u[3, 1] = np.nan


def failed(count: int) -> Callable[[Watched], None]:
    """Deletes that many elements."""
    def change(watched: Watched) -> None:
        watched.state.deletions = [(0.0, e) for e in range(count)]
    return change


@pytest.mark.parametrize(("change", "message"), [
    (set_ledger(numerical=-0.049), None),
    (set_ledger(numerical=-0.051), r"energy fed in by the integrator 5.10% .* lower courant \(now 0.8\)"),
    (set_ledger(numerical=np.nan), r"energy fed in by the integrator nan%"),
    (set_ledger(kinetic=np.inf), r"energy fed in by the integrator"),
    (failed(20), None),
    (failed(21), r"21 of 225 elements failed in one step at t = 0 s, allowed 20: .* lower courant"),
    (mirrored(0.3), None),
    (mirrored(0.6), r"Gauss point\(s\) with a relative density of up to 0.6. are inside out .* refine the mesh there"),
])
def test_steps_are_watched(change: Callable[[Watched], None], message: str | None):
    """Fails if a guard of every step is gone, or stops a run below its tolerance."""
    watched = Watched()
    watched.guard.check_step(watched.state)
    change(watched)
    if message is None:
        watched.guard.check_step(watched.state)
    else:
        with pytest.raises(InstabilityError, match=message):
            watched.guard.check_step(watched.state)


@pytest.mark.parametrize(("change", "message"), [
    (set_ledger(elastic=1.049), None),
    (set_ledger(elastic=1.051), r"energy balance error 5.10% .* allowed 5.00%: lower courant .* balance_tolerance"),
    (set_ledger(elastic=0.949), r"energy balance error"),
    (set_ledger(elastic=np.nan), r"energy balance error nan%"),
    (shares(deletion=0.049), None),
    (shares(deletion=0.051), r"energy lost in deleted elements 5.10% .* lower deletion .* raise force_floor"),
    (broken_number, r"a field is not finite at t = 0 s: lower courant"),
    (fields(1e-15, 0.7), None),
    (fields(1e-15, 0.9), r"less than 20% of the body is left .* all over the mesh"),
    (mirrored(0.6), r"inside out \(J <= 0\)"),
])
def test_records_are_watched(change: Callable[[Watched], None], message: str | None):
    """Fails if a guard of the records is gone, or stops a run below its tolerance."""
    watched = Watched()
    change(watched)
    if message is None:
        watched.guard.check_record(watched.state)
    else:
        with pytest.raises(InstabilityError, match=message):
            watched.guard.check_record(watched.state)


@pytest.mark.parametrize(("change", "message"), [
    (lambda watched: None, ""),
    (shares(deletion=0.009), ""),
    (shares(deletion=0.011), r"elements were deleted with 0.011 of the onset energy still in them"),
    (shares(numerical=0.049), ""),
    (shares(numerical=0.051), r"the time integration itself has dissipated 0.051"),
    (fields(-1e-7, 0.01), ""),
    (fields(-0.04, 0.01), r"falls to -0.04: the lumped sink has no maximum principle.* sink = 'lumped'"),
    (mirrored(0.3), r"damaged Gauss point\(s\) are inside out .* raise force_floor"),
    (pressed, r"compressed to J = 0.12 .* refine the mesh"),
])
def test_records_are_warned_of(change: Callable[[Watched], None], message: str, caplog: pytest.LogCaptureFixture):
    """Fails if a warning of the records is gone, or speaks below its threshold."""
    watched = Watched()
    change(watched)
    watched.guard.check_record(watched.state)
    assert len(caplog.messages) == bool(message), caplog.messages
    assert re.search(message, caplog.text)


def test_crack_in_coarse_elements_is_warned_of(caplog: pytest.LogCaptureFixture):
    """Fails if a crack that leaves the fine part of the mesh is not noticed."""
    watched = Watched(scene(coarse_right()))
    space = watched.scene.sample.space
    x = space.X[space.conn].mean(axis=1)[:, 0]
    watched.state.deleted[np.flatnonzero(x < 0.5)[:20]] = True
    watched.guard.check_record(watched.state)
    assert not caplog.messages
    watched.state.deleted[np.flatnonzero(x > 0.5)[:6]] = True
    watched.guard.check_record(watched.state)
    assert "the crack runs through elements of h = 0.129 mm, l/h = 0.77" in caplog.text


def test_open_ledger_of_the_loading_stops_the_run():
    """Fails if dynamics starts from a loading whose work and energies do not add up."""
    watched = Watched()
    watched.state.phase = "loading"
    watched.state.ledger.initial = 0.0
    watched.state.ledger.work = 1.04
    watched.guard.check_onset(watched.state)
    watched.state.ledger.work = 1.06
    with pytest.raises(InstabilityError, match=r"ledger of the loading is open by 6.00% .* hold it sideways"):
        watched.guard.check_onset(watched.state)


@pytest.mark.parametrize(("controls", "cure"), [
    ({"explicit": ExplicitControls(courant=0.7)}, r"at t = 0 s, .*lower courant \(now 0.7\)"),
    ({"integrator": "hht", "hht": HHTControls(dt=3e-7)}, r"at t = 0 s, .*lower hht_dt \(now 3e-07 s\)"),
    ({"analysis": "quasistatic"}, r"at pass 0, .*raise front \(now 0.95\), or compute with analysis = 'dynamic'"),
])
def test_cure_is_that_of_the_method(controls: dict[str, Any], cure: str):
    """Fails if an error tells to change an option of another method."""
    watched = Watched(scene(**controls))
    watched.guard.check_step(watched.state)
    failed(30)(watched)
    with pytest.raises(InstabilityError, match=cure):
        watched.guard.check_step(watched.state)


def test_a_ledger_without_an_onset_energy_is_held_against_what_it_is_about():
    """Fails if the error of a ledger is none as long as there is no onset energy, whatever does not close."""
    ledger = Ledger(elastic=2.0, work=3.0)
    assert ledger.error(4.0) == 0.25 and ledger.error(0.0) == pytest.approx(1 / 3) and ledger.scale(0.0) == 3.0
    assert ledger.error(np.nan) == ledger.error(0.0)
    assert Ledger().error(0.0) == 0.0 and Ledger(paper=1.0).error(0.0) == 0.0
    assert not Ledger(elastic=np.nan).error(0.0) <= 0.05
