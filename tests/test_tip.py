"""The guard of notches that a mesh does not resolve: what it measures, when it speaks, and what it is based on."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import meshio
import numpy as np
import pytest
import skfem
from guarded import NOTCHED, Watched, scene, simulation

from skfsink.fem.indicators import corner_near, turning
from skfsink.fem.space import Space
from skfsink.meshing.cracks import crack_along
from skfsink.meshing.sample import Sample, mesh_sample
from skfsink.meshing.sweeping import swept
from skfsink.run.observers import tip
from skfsink.run.simulate import Loaded
from skfsink.run.summarize import summarize
from skfsink.scene.controls import Controls
from skfsink.study import notch
from skfsink.study.blocks import block
from skfsink.study.meshes import load_plate

RADIUS = 0.2


def holed(along: int, across: int, reach: float = 2.5) -> Space:
    """A quarter of a ring of radius 0.2 mm, so many elements along and across, out to so many radii."""
    mesh = skfem.MeshQuad.init_tensor(np.linspace(0, 1, across + 1), np.linspace(0, 1, along + 1))
    away, angle = RADIUS * (1 + (reach - 1) * mesh.p[0]), math.pi / 2 * mesh.p[1]
    return Space(skfem.MeshQuad(np.array([away * np.cos(angle), away * np.sin(angle)]), mesh.t))


def at(space: Space, *place: float) -> int:
    """The element that is nearest to a place."""
    return int(np.argmin(np.linalg.norm(space.X[space.conn].mean(axis=1) - place, axis=1)))


@pytest.mark.parametrize("along, across", [(4, 6), (10, 6), (10, 20)])
@pytest.mark.parametrize("layers", [0, 2])
def test_radius_and_thickness_are_those_of_the_tip(along: int, across: int, layers: int) -> None:
    """Fails if the radius, the angle or the thickness of a round notch is wrong, in the plane or through a sheet."""
    space = holed(along, across)
    if layers:
        p, t = space.mesh.p, space.mesh.t
        section = meshio.Mesh(np.column_stack([p.T, np.zeros(p.shape[1])]), [("quad", t.T)])
        space = mesh_sample("sheet", swept(section, 0.1, layers)).space
    middle = RADIUS / math.sqrt(2)
    corner = corner_near(space, at(space, *([middle, middle] if not layers else [middle, middle, 0.03])))
    assert corner is not None
    assert corner.angle == pytest.approx(90 / along)
    assert corner.radius == pytest.approx(RADIUS, rel=0.02)
    assert corner.thickness == pytest.approx(1.5 * RADIUS / across, rel=0.2)
    assert np.hypot(*corner.place[:2]) == pytest.approx(RADIUS)


def test_surfaces_that_do_not_turn_inwards_have_no_corner() -> None:
    """Fails if a plane side, a convex corner, the outside of a ring or the inside of a body is taken for a notch."""
    plain, ring = block(15).space, holed(10, 6)
    for space, place in ((plain, (0, 0.5)), (plain, (0, 0)), (plain, (0.5, 0.5)), (ring, (0.35, 0.35))):
        assert corner_near(space, at(space, *place)) is None


def failing(sample: Sample, *place: float) -> Watched:
    """A guard that has looked at an onset in the element at a place."""
    watched = Watched(scene(sample))
    watched.state.W_max[at(sample.space, *place)] = 1.0
    watched.guard.check_onset(watched.state)
    return watched


def ring_sample(along: int, across: int, reach: float = 2.5) -> Sample:
    space = holed(along, across, reach)
    return Sample("ring", space, {"top": np.flatnonzero(space.X[:, 0] < 1e-9),
                                  "bottom": np.flatnonzero(space.X[:, 1] < 1e-9)})


def test_notch_that_is_not_resolved_is_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    """Fails if the delay of an onset is not told, is told of a fine mesh, or the message lacks place, delay or cure."""
    middle = RADIUS / math.sqrt(2)
    fine = failing(ring_sample(12, 60), middle, middle)
    assert not caplog.messages and 0 < fine.guard.notch["late"] < tip.LATE
    coarse = failing(ring_sample(4, 6), middle, middle)
    (text,) = caplog.messages
    figures = coarse.guard.notch
    assert "notch of radius 0.2 mm, with 2.5 elements in a radius, at (0." in text
    assert f"late by {100 * figures['late']:.0f} % of the opening (above 3)" in text
    assert "rings of 0.033 mm around the tip (h_tip" in text
    assert figures["radius_mm"] == pytest.approx(RADIUS, rel=0.02)
    assert figures["elements_per_radius"] == pytest.approx(8 / math.pi)
    assert figures["late"] == pytest.approx(tip.late(figures["thickness_mm"] / figures["radius_mm"]))


@pytest.mark.parametrize("layers", [0, 3])
@pytest.mark.parametrize(("reach", "warned"), [(1.2, False), (2.5, True)])
def test_the_inner_surface_of_a_thin_wall_is_no_notch(reach: float, warned: bool, layers: int,
                                                      caplog: pytest.LogCaptureFixture) -> None:
    """Fails if the wall of a sac, through which strains fall as 1/r^2, is taken for a notch, or a hole is not."""
    sample, middle = ring_sample(4, 2 if reach < 2 else 6, reach), RADIUS / math.sqrt(2)
    if layers:
        p, t = sample.space.mesh.p, sample.space.mesh.t
        section = meshio.Mesh(np.column_stack([p.T, np.zeros(p.shape[1])]), [("quad", t.T)])
        sample = mesh_sample("sheet", swept(section, 0.1, layers))
        sample = dataclasses.replace(sample, boundaries={"top": np.flatnonzero(sample.space.X[:, 0] < 1e-9),
                                                         "bottom": np.flatnonzero(sample.space.X[:, 1] < 1e-9)})
    x = sample.space.X[sample.space.conn].mean(axis=1)[:, :2]
    loaded = np.hypot(*x.T) ** -4.0
    element = at(sample.space, *([middle, middle] if not layers else [middle, middle, 0.05]))
    found = tip.check_tip(sample.space, element, loaded / loaded.max())
    assert bool(found) == warned == any("the onset may be late" in text for text in caplog.messages)


def test_elements_that_are_named_as_a_cure_are_one(caplog: pytest.LogCaptureFixture) -> None:
    """Fails if a mesh with the elements that the warning asks for is warned of again."""
    share, middle = tip.thickness_for(tip.LATE), RADIUS / math.sqrt(2)
    assert tip.late(share) == pytest.approx(tip.LATE)
    across = math.ceil(0.5 / (0.9 * share))
    failing(ring_sample(math.ceil(math.pi / 2 / share), across, 1.5), middle, middle)
    assert not caplog.messages


def test_sharp_corner_is_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    """Fails if an onset at a corner without a radius is given a delay, or passes for resolved."""
    watched = failing(block(15, notch=0.4, width=0.06), 0.42, 0.5)
    assert [t for t in caplog.messages if "begins to fail at a sharp corner, which turns by 90 degrees" in t]
    assert watched.guard.notch["late"] is None and watched.guard.notch["radius_mm"] is None


def upper_half(sample: Sample) -> tuple[Space, np.ndarray]:
    """The half of a block above mid-height, and its nodes on that line ahead of the notch."""
    space = sample.space
    kept = np.flatnonzero(space.X[space.conn].mean(axis=1)[:, 1] > 0.5)
    half = Space(space.mesh.restrict(kept))
    tip_x = space.X[sample.nodes("notch"), 0].max()
    return half, np.flatnonzero((abs(half.X[:, 1] - 0.5) < 1e-9) & (half.X[:, 0] > tip_x - 1e-9))


@pytest.mark.parametrize(("width", "rounded", "angle"), [(0.0, False, 180.0), (0.3, True, 0.0)])
def test_notch_that_a_plane_of_symmetry_halves_is_that_of_the_whole(width: float, rounded: bool, angle: float) -> None:
    """Fails if a slit that ends at a plane of symmetry passes for no notch, or a round tip there for a sharper one."""
    sample = block(20, notch=0.4, width=width, rounded=rounded)
    half, plane = upper_half(sample)
    of_half, place = turning(half, [plane])
    assert of_half == pytest.approx(turning(sample.space)[0]) and (angle == 0.0 or of_half == pytest.approx(angle))
    corners = [corner_near(space, at(space, place[0] + 0.01, 0.51), planes)
               for space, planes in ((sample.space, []), (half, [plane]))]
    whole, halved = corners
    assert whole is not None and halved is not None
    assert halved.angle == pytest.approx(whole.angle) and halved.radius == pytest.approx(whole.radius)
    assert halved.thickness == pytest.approx(whole.thickness)
    np.testing.assert_allclose(halved.place, whole.place, atol=1e-9)
    np.testing.assert_allclose(halved.into, whole.into, atol=1e-9)
    if not width:
        np.testing.assert_allclose(whole.into, [1.0, 0.0], atol=1e-9)
        assert turning(half)[0] < 1.0


def test_flat_side_of_which_a_plane_of_symmetry_is_a_part_is_no_notch() -> None:
    """Fails if the nodes on a plane of symmetry, or its end at a free side, count as turning inwards."""
    space = block(10).space
    assert turning(space, [np.flatnonzero(space.X[:, 1] < 1e-9)])[0] < 1e-6


@pytest.mark.parametrize("lips", ["whole", "broken"])
def test_end_of_an_initial_crack_is_warned_of(lips: str, caplog: pytest.LogCaptureFixture) -> None:
    """Fails if an onset at the end of a crack that is a band of elements passes for one that the mesh resolves."""
    sample = block(15)
    crack = crack_along(sample.space, "cut", [(0.0, 0.5), (0.4, 0.5)], lips)
    watched = Watched(dataclasses.replace(scene(sample), cracks=(crack,)))
    watched.state.W_max[at(sample.space, 0.43, 0.5)] = 1.0
    watched.guard.check_onset(watched.state)
    (text,) = [t for t in caplog.messages if "begins to fail at" in t]
    assert "at the crack cut, at (0.4, 0." in text and "h = 0.0667 mm" in text and "equal elements" in text
    assert watched.guard.notch["late"] is None and watched.guard.notch["thickness_mm"] == pytest.approx(1 / 15)


def test_onset_away_from_an_initial_crack_is_not_its_end(caplog: pytest.LogCaptureFixture) -> None:
    """Fails if a body that fails elsewhere is said to begin at its crack."""
    sample = block(15)
    crack = crack_along(sample.space, "cut", [(0.0, 0.5), (0.4, 0.5)], "whole")
    watched = Watched(dataclasses.replace(scene(sample), cracks=(crack,)))
    watched.state.W_max[at(sample.space, 0.8, 0.2)] = 1.0
    watched.guard.check_onset(watched.state)
    assert not [t for t in caplog.messages if "at the crack" in t] and watched.guard.notch == {}


def test_evenly_loaded_body_without_a_notch_is_not_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    """Fails if a body without a notch is said to have one."""
    assert failing(block(15), 0.0, 0.5).guard.notch == {} and not caplog.messages


def test_notch_is_in_the_summary_and_in_a_checkpoint(tmp_path: Path) -> None:
    """Fails if summary.json does not say how the notch is resolved, or a resumed run has forgotten it."""
    of = dataclasses.replace(NOTCHED.scene, controls=Controls(event_time=1e-7, overshoot=0.01, checkpoint_every=1e6))
    sim = simulation(of, tmp_path)
    sim.run(Loaded(NOTCHED.onset))
    found = summarize(sim.scene, sim)["onset"]["notch"]
    assert found["late"] is None and found["elements_per_radius"] == pytest.approx(2 / math.pi)
    memory = sim.guard.memory()
    assert memory["notch"] == found


@pytest.mark.parametrize("name, late", [("plate0", (0.3, 0.7))])
def test_committed_plate_is_late(name: str, late: tuple[float, float]) -> None:
    """Fails if the delay of the study's plate, l/2, is not the tens of per cent that were measured."""
    space = load_plate(name).space
    corner = corner_near(space, at(space, 0.5, 1.0))
    assert corner is not None and late[0] < tip.late(corner.thickness / corner.radius) < late[1]


# --- the study ---
def test_curve_is_that_of_the_study(tmp_path: Path) -> None:
    """Fails if the guard uses another curve than the stored points give, or the page shows other figures."""
    docs = Path(__file__).parents[1] / "docs"
    stored = json.loads((docs / "images" / "notch.json").read_text(encoding="utf-8"))
    points = {key.removeprefix("onset/"): point for key, point in stored["points"].items()}
    assert {p.key for p in notch.plan(False)} == points.keys()
    assert notch.curve(points)[0] == pytest.approx(tip.SLOPE, rel=0.02)
    text = (docs / "notches.md").read_text(encoding="utf-8")
    assert not [line for line in notch.table(points) if line not in text]
    notch.draw(points, tmp_path / "notch.png")
    assert (tmp_path / "notch.png").stat().st_size > 5e4


def test_reference_is_where_the_line_through_fine_rings_begins() -> None:
    """Fails if unstructured or coarse meshes move the reference, or delays are not those over it."""
    def point(thickness: float, late: float) -> dict[str, float]:
        return {"thickness": thickness, "opening_mm": 0.2 * (1 + late), "per_radius": 1 / thickness}

    points = {f"aaa/0.05/rings 4/{1 / t:g}/0": point(t, 0.5 * t) for t in (0.02, 0.04, 0.08)}
    points |= {"aaa/0.05/rings 4/2/0": point(0.5, 0.9), "aaa/0.05/unstructured/20/0": point(0.05, 0.9),
               "gent/0.05/rings 4/9/0": point(0.05, 0.4), "gent/0.05/rings 4/10/0": point(0.04, 0.32)}
    found = notch.delays(points)
    assert notch.reference(found["aaa", "0.05"]) == pytest.approx(0.2)
    assert [p["late"] for p in found["aaa", "0.05"]] == pytest.approx([0.01, 0.02, 0.04, 0.9, 0.9])
    assert notch.reference(found["gent", "0.05"]) == pytest.approx(0.2)


@pytest.mark.slow
def test_a_point_of_the_study() -> None:
    """Fails if a mesh of the study does not have the elements at the tip that it asks for."""
    pytest.importorskip("gmsh")
    found = notch.Tip(6, 4.0)()
    assert found["per_radius"] == pytest.approx(10 / math.pi, rel=0.03)
    assert found["thickness"] == pytest.approx(math.pi / 10 / 4, rel=0.3)
    assert found["weakest"] == pytest.approx(found["thickness"], rel=0.05) and abs(found["direction"]) < 45
    assert found["opening_mm"] == pytest.approx(0.0896, rel=0.03)
