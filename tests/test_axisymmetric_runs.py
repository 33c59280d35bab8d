"""Bodies of revolution as they are run: beside wedges of hexahedra, by both integrators, and by decks."""

from __future__ import annotations

import copy
from dataclasses import replace
from functools import cache
from pathlib import Path

import meshio
import numpy as np
import pytest
import skfem
from bodies import Loadable, box, ends, held_body, notched
from guarded import Stop
from plates import deck, invoke_program
from test_pressure import INNER, tube

from skfsink.cases.cylindrical_shell import cylindrical_shell
from skfsink.cases.symmetric_double_edge_notch import symmetric_double_edge_notch
from skfsink.errors import Interrupted, ParameterError
from skfsink.fem.space import Space
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.fields.pieces import pieces_of
from skfsink.fields.state import State
from skfsink.loads.grips import Grip, Sliding
from skfsink.loads.schedule import Loading
from skfsink.material import AAA, SinkLaw
from skfsink.meshing.vtu import write_mesh
from skfsink.methods.controls import ExplicitControls, HHTControls
from skfsink.methods.explicit import Explicit
from skfsink.methods.hht import HHT
from skfsink.results.loader import load
from skfsink.run.observers.places import rim_of
from skfsink.scene.deck import read_deck
from skfsink.scene.options import Options

ANGLE = 0.08  # of the wedge [rad]


def wedge(section: skfem.MeshQuad) -> Space:
    """One layer of hexahedra around the axis y, between the half planes at the angles 0 and `ANGLE`."""
    r, y = section.p
    points = np.concatenate([[r * np.cos(a), y, r * np.sin(a)] for a in (0.0, ANGLE)], axis=1)
    corners = section.t[[0, 1, 3, 2]]
    cells = [corners[i + 2 * j] + r.size * k for i, j, k in skfem.MeshHex.elem.refdom.p.T.astype(int)]
    return Space(skfem.MeshHex(points, np.array(cells)))


def pulled(space: Space) -> Loadable:
    """A body whose ends part along y at 2 µm/s, and slide; a wedge slides on its sides as well."""
    low, high = (np.flatnonzero(mask) for mask in ends(space))
    free = (None,) * (space.dim - 2)
    held: list[tuple[np.ndarray, Grip]] = [(high, Grip("high", (None, 1e-3, *free))),
                                           (low, Grip("low", (None, -1e-3, *free)))]
    if space.dim == 3:
        angle = np.arctan2(space.X[:, 2], space.X[:, 0])
        held += [(np.flatnonzero(np.isclose(angle, a, atol=1e-9)), Sliding(f"at {a}")) for a in (0.0, ANGLE)]
    return Loadable(space, Loading(space, held), AAA(), SinkLaw(), onset_tolerance=1e-4)


@cache
def at_onset() -> tuple[Loadable, Loadable]:
    """A ring with a notch from its inner side, by its half plane and by a wedge of it, at the onset."""
    section = notched(15).mesh.translated((1.0, 0.0))
    ring, part = pulled(Space(section, axisymmetric=True)), pulled(wedge(section))
    ring.load(), part.load()
    return ring, part


def whole(body: Loadable) -> float:
    """How many such bodies make the ring."""
    return 1.0 if body.space.axisymmetric else 2 * np.pi / np.sin(ANGLE)  # the sides of wedges are chords


def test_onset_of_a_wedge() -> None:
    """Fails if onset, load or energy of a notched ring are not those of a wedge of hexahedra, within 0.2 %."""
    ring, part = at_onset()
    assert part.space.V.sum() * whole(part) == pytest.approx(ring.space.V.sum(), rel=1e-9)
    assert ring.state.grip == pytest.approx(part.state.grip, rel=0.002)
    at = {}
    for body in (ring, part):  # at the same displacement
        scale = ring.state.grip / body.state.grip
        u = body.state.u * scale
        body.momentum.set_gamma(np.ones(body.space.n_nodes), np.zeros(body.space.n_elements, bool))
        internal = body.momentum.force(u)
        at[body] = whole(body) * internal[ends(body.space)[1], 1].sum(), whole(body) * body.momentum.energy
    np.testing.assert_allclose(at[ring], at[part], rtol=0.002)
    assert np.abs(part.space.X[np.argmin(part.state.gamma), 1] - ring.space.X[np.argmin(ring.state.gamma), 1]) < 0.07


def test_event_of_a_wedge() -> None:
    """Fails if the explicit event of a notched ring is not that of a wedge: energies, what has failed, and momenta."""
    found = []
    for body in at_onset():
        state = copy.deepcopy(body.state)
        state.begin_event(0.01, body.statics.clock.grown(state.grip, 0.01))
        explicit = Explicit(body.body)
        explicit.begin(state)
        for _ in explicit.run(state, 2e-5):
            pass
        ledger = state.ledger
        assert ledger.error(ledger.initial) < 1e-10
        found.append((state.deleted.sum(), whole(body) * np.array([ledger.elastic, ledger.kinetic, ledger.sink])))
    (failed, energies), (others, expected) = found
    assert failed >= 20 and abs(int(failed) - int(others)) <= 1
    np.testing.assert_allclose(energies, expected, rtol=0.01)


# --- integrators ---
def test_explicit_beside_hht() -> None:
    """Fails if the two integrators part before the body fails, with the axis in it: displacements within 0.1 %."""
    space = box("quad", 6, 0.1).revolved()
    ends_ = []
    for make in ("explicit", "hht"):
        body = pulled(space)
        state, y = body.state, space.X[:, 1]
        state.phase = "event"
        state.v[:] = 2e3 * np.column_stack([-0.5 * np.pi * space.X[:, 0] * np.cos(np.pi * y), np.sin(np.pi * y)])
        state.v[~body.loading.free.reshape(-1, 2)] = 0.0
        integrator = (Explicit(body.body, ExplicitControls(raised_mass=0.0)) if make == "explicit" else
                      HHT(body.body, HHTControls(dt=5e-8, alpha=0.0)))
        integrator.begin(state)
        for _ in integrator.run(state, 1e-5):
            pass
        assert state.ledger.error(state.ledger.initial) < 1e-10
        assert not state.u[space.on_axis, 0].any()
        ends_.append(state.u + (1e-5 - state.time) * state.v)
    assert np.abs(ends_[0] - ends_[1]).max() < 1e-3 * np.abs(ends_[1]).max()


@pytest.mark.parametrize("hht", [False, True])
def test_a_free_body_keeps_its_momentum_along_the_axis(hht: bool) -> None:
    """Fails if what goes around pulls along the axis, or a body in free flight is held by anything but its axis."""
    space = box("quad", 5).revolved()
    momentum, density = Momentum(space, AAA(), "axisymmetric"), DensitySolver(space, SinkLaw(phi=1e3))  # none is lost
    body = held_body(momentum, density, np.ones(space.X.size, bool), np.zeros_like(space.X))
    state = State.intact(space)
    state.phase = "event"
    state.v[:] = [0.0, 3e3] + 2e3 * np.column_stack([space.X[:, 0] * np.cos(3 * space.X[:, 1]), space.X[:, 0] ** 2])
    mass = momentum.lumped_mass(0.0)
    before = float(mass @ state.v[:, 1])
    integrator = HHT(body, HHTControls(dt=2e-7)) if hht else Explicit(body, ExplicitControls(raised_mass=0.0))
    integrator.begin(state)
    for _ in integrator.run(state, 1e-5):
        pass
    pieces = pieces_of(momentum, state)
    assert pieces.momentum[0, 1] == pytest.approx(before, rel=1e-6 if hht else 1e-9)
    assert pieces.momentum[0, 0] == pieces.centre[0, 0] == pieces.angular_momentum[0, 0] == 0.0
    assert pieces.mass[0] == pytest.approx(AAA().rho0 * np.pi, rel=1e-12)
    assert pieces.volume[0] == pytest.approx(np.pi, rel=1e-12) and pieces.extent[0] == pytest.approx(1.0, rel=1e-12)
    assert pieces.translation[0] == pytest.approx(0.5 * before**2 / pieces.mass[0], rel=1e-5)
    assert pieces.kinetic[0] > 1.001 * pieces.translation[0] and not state.u[space.on_axis, 0].any()


# --- decks ---
#: a hollow ball, half of it, with a cut at its outer surface in the plane of symmetry
BALL = '''case = "custom"
[parameters]
mesh = "ball.vtu"
element = "axisymmetric"
length_scale = "0.12 mm"
event_time = "15 µs"
[[grips]]
boundary = "bottom"
y = 0
[[pressures]]
boundary = "inner"
rate = "10 kPa/s"
in_crack = true
[[cracks]]
name = "cut"
points = [["1.2 mm", "0.01 mm"], ["1.5 mm", "0.01 mm"]]
lips = "whole"
[[probes]]
name = "cavity"
kind = "volume"
boundary = "inner"
every = "1 µs"
[[probes]]
name = "wall"
kind = "point"
position = ["0.6 mm", "1.1 mm"]
quantity = "stress, stretches"
every = "1 µs"
'''


def write_ball(path: Path) -> None:
    """Mesh file of a quarter of a ring, which makes half of a hollow ball."""
    space = tube(5)
    inner = np.flatnonzero(np.isclose(np.linalg.norm(space.X, axis=1), INNER))
    points = np.column_stack([space.X, np.zeros(space.n_nodes)])
    write_mesh(path, meshio.Mesh(points, [("quad", space.mesh.t.T)], point_sets={"inner": inner}))


def test_a_deck_of_a_ball(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if files do not speak of the whole body, the axis is an edge, or a resumed run has other bits."""
    monkeypatch.chdir(tmp_path)
    write_ball(tmp_path / "ball.vtu")
    read_deck(deck(tmp_path, BALL)).run(out=tmp_path / "whole", quiet=True)
    run = load(tmp_path / "whole")
    units = run.history.units
    assert run.history.dim == 3 and (units["elastic"], units["swept_volume"]) == ("N mm", "mm^3")
    assert "a body of revolution: its 6 node(s) on the axis, x = 0, are held along x" in run.summary["notes"]
    assert "reaction_N" in run.summary["onset"] and run.summary["units"] == {"load": "N", "energy": "N mm"}
    assert run.summary["onset"]["boundary"] == "cut" and run.summary["energy"]["balance_error_relative"] < 1e-6
    header, first, *_ = (tmp_path / "whole" / "probes" / "cavity.csv").read_text().splitlines()
    volume = float(first.split(",")[header.split(",").index("volume_mm3")])
    n = 5  # chords of the arc: 2n cones
    a = np.linspace(0.0, np.pi / 2, 2 * n + 1)
    r, z = INNER * np.cos(a), INNER * np.sin(a)
    undeformed = np.pi / 3 * ((r[1:]**2 + r[1:] * r[:-1] + r[:-1]**2) * np.diff(z)).sum()
    assert undeformed == pytest.approx(2 / 3 * np.pi, rel=0.02) and 1.01 * undeformed < volume < 1.6 * undeformed
    frame = meshio.read(tmp_path / "whole" / "series" / "run_0000.vtu")
    stress = frame.cell_data["stress"][0]
    far = frame.points[frame.cells_dict["quad"]].mean(axis=1)[:, 1] > 0.9
    hoop, shear = stress[far, 2], stress[far, 3]
    assert (hoop > 0.1).all() and np.abs(shear).max() < hoop.max()
    (rim, planes), on_axis = rim_of(run.scene), run.scene.space.on_axis
    assert on_axis[rim].sum() == 2 and any(on_axis[plane.nodes].all() for plane in planes)
    pieces = (tmp_path / "whole" / "fragments.csv").read_text().splitlines()[0]
    assert "volume_mm3" in pieces and "mass_t," in pieces and "centre_x_mm" in pieces
    broken = read_deck(deck(tmp_path, BALL))
    with pytest.raises(Interrupted):
        broken.run(out=tmp_path / "broken", quiet=True, observers=(Stop(30),))
    broken.run(resume=tmp_path / "broken", quiet=True)
    for name in ("history.csv", "deletions.csv", "fragments.csv"):
        assert (tmp_path / "broken" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name


@pytest.mark.parametrize(("change", "message"), [
    (('event_time', 'contact = true\nevent_time'), "contact is for elements jbar and plain; got axisymmetric"),
    (("[[pressures]]", '[[grips]]\nboundary = "left"\nx = 1e-3\n[[pressures]]'), "of revolution, along x: leave x out"),
    (("[[cracks]]", '[[body_forces]]\nx = "1 m/s^3"\n[[cracks]]'), "a body force on a body of revolution acts along"),
    (('"axisymmetric"', '"axisymmetrical"'), "axisymmetric"),
])
def test_one_line_says_what_cannot_be(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: tuple[str, str],
                                      message: str) -> None:
    """Fails if what a body of revolution cannot have is taken, or refused in more than a line."""
    monkeypatch.chdir(tmp_path)
    write_ball(tmp_path / "ball.vtu")
    status, err, _ = invoke_program("run", deck(tmp_path, BALL.replace(*change, 1)), "--out", "run", "--quiet")
    assert status != 0 and message in err and err.count("\n") == 1


def test_a_solid_is_no_half_plane(tmp_path: Path) -> None:
    """Fails if a case in space, or a half cut along the radius, is taken for a body of revolution."""
    options = Options(element="axisymmetric", out=tmp_path / "run", quiet=True)
    with pytest.raises(ParameterError, match="axisymmetric is for meshes of quadrilaterals"):
        cylindrical_shell(options=options)
    with pytest.raises(ParameterError, match="which is not cut along x: leave half out"):
        symmetric_double_edge_notch(options=replace(options, half=True))
    assert not options.out.exists()
