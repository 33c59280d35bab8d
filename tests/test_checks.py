"""Checks before a run: what cannot be meant is refused, what may be is warned of, what is right passes in silence."""

from __future__ import annotations

import dataclasses
import logging
import re
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
import skfem
from bodies import grid
from guarded import PLAIN, scene
from plates import invoke_program, plate

from skfsink.errors import ParameterError
from skfsink.fem.space import Space
from skfsink.loads.grips import Grip, Ramp, Traction
from skfsink.loads.pressure import Pressure
from skfsink.loads.rigid import free_motions
from skfsink.material import AAA, SinkLaw
from skfsink.material.library import material_from
from skfsink.material.regions import Region
from skfsink.meshing.sample import Sample
from skfsink.meshing.vtu import write_mesh
from skfsink.run import checks
from skfsink.scene.controls import Controls
from skfsink.scene.scene import Scene

SIDES = (("left", 0, 0), ("right", 0, 1), ("bottom", 1, 0), ("top", 1, 1), ("back", 2, 0), ("front", 2, 1))


def sample_of(space: Space) -> Sample:
    """A box with its sides."""
    X = space.X
    ends = X.min(axis=0), X.max(axis=0)
    return Sample("box", space, {name: np.flatnonzero(np.isclose(X[:, i], ends[end][i]))
                                 for name, i, end in SIDES[:2 * space.dim]})


def scaled(factor: float) -> Sample:
    """The plain block, its coordinates times a factor."""
    mesh = PLAIN.space.mesh
    return sample_of(Space(type(mesh)(mesh.p * factor, mesh.t)))


def said(caplog: pytest.LogCaptureFixture, of: Scene) -> list[str]:
    """What the checks warn of, and nothing that they refuse."""
    caplog.clear()
    checks.refuse(of)
    with caplog.at_level(logging.WARNING):
        checks.warn(of, Path("somewhere/that/is/not"))
    return [record.getMessage() for record in caplog.records]


# --- scales ---
def test_a_sound_scene_passes_in_silence(caplog: pytest.LogCaptureFixture):
    """Fails if the checks speak of a block of 1 mm of soft tissue between slow grips."""
    assert said(caplog, scene()) == []


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "metres": ({"sample": scaled(1e-3)}, r"the body is 0.001 mm across, 0.01 of the length l = 0.1 mm .* by 1000"),
    "micrometres": ({"sample": scaled(1e3)}, r"h = 66.7 mm, 667 times the length l = 0.1 mm .* µm by 1000"),
    "l in metres": ({"law": SinkLaw(length_scale=1e-4)}, r"h = 0.0667 mm, 667 times .* raise length_scale"),
    "t/mm^3": ({"material": AAA(density=1.433e-9)}, r"density 1.433e-09 kg/m\^3 .*t/mm\^3, give 1433 kg/m\^3"),
    "kg/mm^3": ({"material": AAA(density=1.433e-6)}, r"kg/mm\^3, give 1433 kg/m\^3"),
    "modulus in Pa": ({"material": AAA(c1=0.617e6)}, r"shear waves would run at 2.\d+e\+04 m/s .*divided by 1e6"),
    "limiter in Pa": ({"law": SinkLaw(phi=0.1686e7)}, r"phi = 1.69e\+06 MPa is 1.4e\+06 of the shear modulus"),
    "steps": ({"event_time": 100.0}, r"an event_time of 100 s may take \d.\d+e\+09 steps .*lower it"),
    "frames": ({"event_time": 1.0, "frame_every": 1e-7}, r"may make 1e\+07 frames .*raise frame_every"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_figures_that_cannot_be_meant_are_refused(name: str):
    """Fails if a mesh, a density, a modulus or an event-time in another unit is computed with."""
    changes, message = REFUSED[name]
    with pytest.raises(ParameterError, match=message):
        checks.refuse(scene(**changes))


WARNED: dict[str, tuple[dict[str, Any], str]] = {
    "small body": ({"law": SinkLaw(length_scale=0.5)}, r"1 mm across, 2 times the length l = 0.5 mm .*\(mm\)"),
    "g/cm^3": ({"material": AAA(density=1.433)}, r"density 1.433 kg/m\^3 is unusual .*in g/cm\^3, give 1433"),
    "heavy": ({"material": AAA(density=1e5)}, r"density 1e\+05 kg/m\^3 is unusual"),
    "fast waves": ({"material": AAA(c1=0.617e5, bulk_modulus=5e5), "law": SinkLaw(phi=1e4)},
                   r"shear waves run at 9.\d+e\+03 m/s \(outside of 0.1 to 6000\)"),
    "brittle": ({"law": SinkLaw(phi=1e-6)}, r"phi = 1e-06 MPa is 8.\d+e-07 of the shear modulus .*\(MPa\)"),
    "bulk modulus": ({"material": AAA(bulk_modulus=0.5)}, r"k/mu = 0.405 is so small .*bulk_modulus"),
    "steps": ({"event_time": 1.0}, r"the event may take \d.\d+e\+07 steps of about .* lower event_time"),
    "files": ({"event_time": 0.1, "frame_every": 5e-6, "record_every": 1e-8},
              r"2e\+04 frames and 1e\+07 rows .* lower event_time, or raise frame_every"),
}


@pytest.mark.parametrize("name", WARNED)
def test_figures_that_may_be_meant_are_warned_of(name: str, caplog: pytest.LogCaptureFixture):
    """Fails if unusual figures pass without a word, or are refused."""
    changes, message = WARNED[name]
    texts = said(caplog, scene(**changes))
    assert any(re.search(message, text) for text in texts), texts


def test_a_quasi_static_analysis_has_no_waves_and_no_steps(caplog: pytest.LogCaptureFixture):
    """Fails if density, rates or the length of an event are looked at where they do not matter."""
    fast = (Grip("top", (0.0, 1e6)), Grip("bottom", (0.0, 0.0)))
    of = scene(material=AAA(density=1e-9), analysis="quasistatic", event_time=1e6)
    assert said(caplog, dataclasses.replace(of, grips=fast)) == []


def test_a_region_is_named(caplog: pytest.LogCaptureFixture):
    """Fails if the message of a region does not say which one it is of."""
    lid = Region("lid", np.arange(30), material_from("neo-hookean", {"mu": 1.0}), SinkLaw(phi=1e7))
    with pytest.raises(ParameterError, match=r"phi = 1e\+07 MPa of region lid is 1e\+07 of the shear modulus 1 MPa"):
        checks.refuse(dataclasses.replace(scene(), regions=(lid,)))


# --- rates ---
@pytest.mark.parametrize("grips", [
    (Grip("top", (0.0, 5000.0)), Grip("bottom", (0.0, 0.0))),
    (Grip("top", (0.0, Ramp((0.0, 1.0, 1.0001), (0.0, 0.1, 0.6)))), Grip("bottom", (0.0, 0.0)))],
    ids=["velocity", "ramp"])
def test_fast_grips_are_warned_of(grips: tuple[Grip, ...], caplog: pytest.LogCaptureFixture):
    """Fails if grips at 5 m/s, at first or later in a ramp, are loaded statically without a word."""
    of = dataclasses.replace(scene(), grips=grips)
    assert re.match(r"grips part at 5 m/s, 0.17 of c_s = 29.3 m/s \(above 0.01\): .*leaves inertia out; take "
                    r"start = .rest.", said(caplog, of)[0])
    assert said(caplog, dataclasses.replace(of, controls=Controls(analysis="quasistatic"))) == []


def test_grips_that_go_the_same_way_do_not_part(caplog: pytest.LogCaptureFixture):
    """Fails if the speed is not that of the grips relative to each other."""
    of = dataclasses.replace(scene(), grips=(Grip("top", (0.0, 5000.0)), Grip("bottom", (0.0, 4999.0))))
    assert said(caplog, of) == []


def test_grips_faster_than_waves_need_a_start_from_rest():
    """Fails if a body is loaded statically by grips that no wave keeps up with."""
    of = dataclasses.replace(scene(), grips=(Grip("top", (0.0, 5e4)), Grip("bottom", (0.0, 0.0))))
    with pytest.raises(ParameterError, match=r"grips part at 50 m/s, faster than waves .*take start = 'rest'"):
        checks.refuse(of)
    checks.refuse(dataclasses.replace(of, controls=Controls(start="rest")))


def test_fast_tractions_are_warned_of(caplog: pytest.LogCaptureFixture):
    """Fails if a traction that rises within a few transits of a wave is taken as a static load."""
    of = dataclasses.replace(scene(), grips=(Grip("bottom", (0.0, 0.0)),), tractions=(Traction("top", (0.0, 1e4)),))
    assert "tractions strain the body" in said(caplog, of)[0]


# --- rigid motions ---
def motions(space: Space, **held: str) -> list[tuple[str, str]]:
    """Names of the free motions where sides hold components."""
    sample, free = sample_of(space), np.ones(space.X.shape, bool)
    for side, axes in held.items():
        for axis in axes:
            free[sample.nodes(side), "xyz".index(axis)] = False
    return [(motion.piece, motion.name) for motion in free_motions(space, free.ravel())]


PLANE, BODY = Space(grid("quad", (6, 4), (3.0, 2.0))), Space(grid("hex", (3, 2, 2), (3.0, 2.0, 1.0)))


def test_free_motions_in_a_plane():
    """Fails if a rigid motion that nothing resists is missed or misnamed, or one is found that is held.

    Rollers on two sides hold a half or quarter model, though no node is held in both components.
    """
    assert motions(PLANE, bottom="y", top="y") == [("the body", "move along x")]
    assert motions(PLANE, bottom="y", left="x") == motions(PLANE, bottom="xy") == []
    assert motions(PLANE, left="x", right="x") == [("the body", "move along y")]
    corner = np.ones(PLANE.X.shape, bool)
    corner[np.flatnonzero((PLANE.X == [3.0, 2.0]).all(axis=1))] = False
    assert [m.name for m in free_motions(PLANE, corner.ravel())] == ["turn about (3, 2) mm"]


def test_free_motions_in_space():
    """Fails if a translation or a turn in space is missed or misnamed."""
    assert motions(BODY, bottom="y", left="x", back="z") == []
    assert motions(BODY, bottom="xy", top="xy") == [("the body", "move along z")]
    assert motions(BODY, bottom="y", top="y") == [
        ("the body", "move along x"), ("the body", "move along z"),
        ("the body", "turn about the axis (0, 1, 0) through (1.5, 1, 0.5) mm")]


def test_pieces_that_share_a_node_turn_about_it():
    """Fails if elements joined at one node count as held by each other."""
    p = np.array([[0, 1, 1, 0, 2, 2, 1], [0, 0, 1, 1, 1, 2, 2]], float)
    hinge = Space(skfem.MeshQuad(p, np.array([[0, 2], [1, 4], [2, 5], [3, 6]])))
    assert motions(hinge, bottom="xy") == [("the piece of 1 elements around (1.5, 1.5) mm", "turn about (1, 1) mm")]
    assert motions(hinge, bottom="xy", top="x") == []


def test_a_limiter_of_other_constants_is_warned_of(caplog: pytest.LogCaptureFixture):
    """Fails if constants are changed and the limiter of the old ones is taken in silence, or a limiter that was given,
    or one of nearly the same constants, is complained of."""
    stiff, law = AAA(c1=3.0), SinkLaw()
    (text,) = said(caplog, scene(material=stiff))
    assert text.startswith("phi = 0.1686 MPa belongs to aaa with its default constants, of shear modulus 1.23 MPa, and "
                           "here that is 6 MPa: give the phi")
    assert said(caplog, scene(material=stiff, law=SinkLaw(phi=0.8))) == []
    assert said(caplog, scene(material=AAA(c1=0.7))) == []
    fibres = material_from("hgo", {"angle": 20.0})  # of which a shear modulus says little
    assert not any("belongs to" in text for text in said(caplog, scene(material=fibres, law=SinkLaw(phi=0.027))))
    upper = np.flatnonzero(PLAIN.space.X[PLAIN.space.conn].mean(axis=1)[:, 1] > 0.5)
    lid = Region("lid", upper, material_from("gent", {"mu": 1.0}), dataclasses.replace(law, phi=15.62))
    (text,) = said(caplog, dataclasses.replace(scene(), regions=(lid,)))
    assert "gent" in text and "1 MPa of region lid" in text
    known = {"regions": ({"name": "lid", "material": "gent", "constants": "mu = 1 MPa", "phi": 15.62},)}
    assert said(caplog, dataclasses.replace(scene(), regions=(lid,), parameters=known)) == []


def test_elements_of_another_kind_than_the_file_says_are_warned_of(caplog: pytest.LogCaptureFixture):
    """Fails if a sheet of Abaqus is computed in plane strain without a warning, or one as it is meant is warned of."""
    thin = dataclasses.replace(PLAIN, element="planestress")
    (text,) = said(caplog, scene(thin))
    assert text.startswith("the mesh file has elements of plane stress, and the run takes element = 'jbar', in plane "
                           "strain: take element = 'planestress'")
    assert said(caplog, scene(thin, element="planestress")) == []


def test_loads_on_a_part_of_their_boundary_are_warned_of(caplog: pytest.LogCaptureFixture):
    """Fails if nodes inside of the body are named as loaded, and bear nothing, without a word; or if a whole side is
    complained of."""
    space = Space(grid("quad", (6, 6), 1.0))
    row = np.flatnonzero(np.isclose(space.X[:, 1], 0.5) | np.isclose(space.X[:, 0], 1.0))
    sample = dataclasses.replace(of := sample_of(space), boundaries={**of.boundaries, "row": row})
    held = (Grip("bottom", (0.0, 0.0)),)
    for kind, loads in (("traction", {"tractions": (Traction("row", (1e-3, 0.0)),)}),
                        ("pressure", {"pressures": (Pressure("row", 1e-3),)})):
        (text,) = said(caplog, Scene("block", "Block", {}, sample, AAA(), SinkLaw(), held, **loads))
        assert text.startswith(f"the {kind} on row acts on a part of it: 6 of its 13 nodes are on no side of the ")
    whole = (Traction("right", (1e-3, 0.0)),)
    assert said(caplog, Scene("block", "Block", {}, sample, AAA(), SinkLaw(), held, whole)) == []


def test_grips_that_leave_a_motion_are_warned_of(caplog: pytest.LogCaptureFixture):
    """Fails if a plate pulled at both ends, free sideways, drifts without a word."""
    of = dataclasses.replace(scene(), grips=(Grip("top", (None, 1e-3)), Grip("bottom", (None, -1e-3))))
    (text,) = said(caplog, of)
    assert text.startswith("the grips leave the body free to move along x: ") and "hold x at one boundary" in text
    half = dataclasses.replace(of, sample=sample_of(PLAIN.space), grips=(
        Grip("top", (None, 1e-3)), Grip("bottom", (None, 0.0)), Grip("left", (0.0, None))))
    assert said(caplog, half) == []


def test_grips_that_only_carry_the_body_along_are_refused():
    """Fails if a body that one grip moves and nothing else holds is loaded for ever."""
    for grips in ((Grip("top", (0.0, 1e-3)),), (Grip("top", (0.0, 1e-3)), Grip("bottom", (0.0, None)))):
        with pytest.raises(ParameterError, match="the grips move the body as a whole and strain nothing"):
            checks.refuse(dataclasses.replace(scene(), grips=grips))


@pytest.mark.parametrize("kind", ["quad", "hexahedron"])
def test_loads_that_grips_take_up_are_refused(kind: str):
    """Fails if a traction or pressure on a held boundary strains nothing without a word, or one that does something is
    refused: beside the grip, along a free component, on a side that is held in part, or in cracks to come."""
    dim = 2 if kind == "quad" else 3
    sample = sample_of(Space(grid(kind, (6, 6, 2)[:dim], 0.5)))
    held, none = (0.0,) * dim, (None,) * dim
    bottom, roller, x, y = Grip("bottom", held), Grip("left", (0.0, *none[1:])), np.eye(dim)[0], np.eye(dim)[1]

    def loaded(grips: tuple[Grip, ...], *loads: Traction | Pressure) -> None:
        checks.refuse(Scene("block", "Block", {}, sample, AAA(), SinkLaw(), (bottom, *grips),
                            tuple(load for load in loads if isinstance(load, Traction)),
                            tuple(load for load in loads if isinstance(load, Pressure))))

    for grips, load, message in (
            ((Grip("top", (0.0, 1e-3, *held[2:])),), Traction("top", tuple(1e-3 * y)),
             "the traction on top acts along y, which grips hold at all of its nodes, and strains nothing"),
            ((roller,), Traction("left", (1e-3, 1e-3, *held[2:])), "the traction on left acts along x, which"),
            ((Grip("top", (0.0, 1e-3, *held[2:])),), Pressure("top", 1e-3), "the pressure on top acts where grips"),
            ((roller,), Pressure("left", Ramp((0.0, 1.0), (0.0, 1e-2))), "the pressure on left acts where grips")):
        with pytest.raises(ParameterError, match=message):
            loaded(grips, load)
    loaded((roller,), Traction("right", tuple(1e-3 * x)), Pressure("top", 1e-3))
    loaded((roller,), Traction("left", tuple(1e-3 * y)))
    loaded((Grip("top", (0.0, 1e-3, *held[2:])),), Pressure("left", 1e-3), Traction("left", tuple(1e-3 * y)))
    loaded((Grip("top", (0.0, 1e-3, *held[2:])),), Pressure("top", 1e-3, in_crack=True))


def test_a_piece_that_nothing_holds_is_refused():
    """Fails if a piece that floats is given to the solver."""
    mesh = grid("quad", (15, 15), 1.0)
    x = mesh.p[0, mesh.t].mean(axis=0)
    space = Space(mesh.remove_elements(np.flatnonzero(np.abs(x - 0.5) < 0.04)))
    grips = np.flatnonzero(np.isclose(space.X[:, 1], 0) & (space.X[:, 0] < 0.5)), np.flatnonzero(
        np.isclose(space.X[:, 1], 1) & (space.X[:, 0] < 0.5))
    split = Sample("split", space, {"bottom": grips[0], "top": grips[1]})
    with pytest.raises(ParameterError, match=r"nothing holds the piece of 105 elements around \(0.767, 0.5\) mm"):
        checks.refuse(scene(split))
    apart = Space(skfem.MeshQuad(mesh.p[:, mesh.t].reshape(2, -1, order="C"), np.arange(4 * 225).reshape(4, 225)))
    with pytest.raises(ParameterError, match="225 pieces that share no side"):
        checks.refuse(scene(sample_of(apart)))


# --- by the command line ---
def test_a_deck_in_metres_is_refused_before_a_file_is_touched(tmp_path: Path):
    """Fails if the program computes a plate of 4 µm, or leaves a folder of a run that it refused."""
    mesh = plate()
    write_mesh(tmp_path / "plate.vtu", meshio.Mesh(1e-3 * mesh.points, mesh.cells, cell_sets=mesh.cell_sets))
    (tmp_path / "deck.toml").write_text('case = "custom"\n[parameters]\nmesh = "plate.vtu"\n[[grips]]\n'
                                        'boundary = "top"\nx = 0\ny = "1e-3 mm/s"\n[[grips]]\nboundary = "bottom"\n'
                                        'x = 0\ny = 0\n')
    status, err, _ = invoke_program("run", tmp_path / "deck.toml", "--out", tmp_path / "run", "--quiet")
    assert status == 2 and "the body is 0.004 mm across" in err and err.count("\n") == 1
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("still", [0.0, Ramp((0.0, 1.0), (0.0, 0.0))])
def test_a_body_that_nothing_loads_is_refused(still: float | Ramp):
    """Fails if a deck in which everything is held is a result: a body that did not fail at W/Phi = 0."""
    held = dataclasses.replace(scene(), grips=(Grip("bottom", (0.0, 0.0)), Grip("top", (None, still))))
    with pytest.raises(ParameterError, match="nothing loads the body"):
        checks.refuse(held)
    checks.refuse(dataclasses.replace(held, tractions=(Traction("top", (1e-3, 0.0)),)))
