"""Pressures that follow the surface, and fluids in cavities: forces, stiffness, work, closed forms, events, decks."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import meshio
import numpy as np
import pytest
import skfem
from bodies import Loadable, box, ends, wavy
from guarded import Stop, simulation
from matplotlib.figure import Figure
from plates import deck, invoke_program
from scipy.integrate import quad

from skfsink.cases.custom import custom
from skfsink.errors import Interrupted, MeshError, ParameterError
from skfsink.fem.facets import boundary_facets
from skfsink.fem.forms import pressure_forms
from skfsink.fem.pattern import Pattern
from skfsink.fem.space import Space
from skfsink.fields.body import Body
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.loads.curve import Curve
from skfsink.loads.follower import FollowerLoads
from skfsink.loads.grips import Grip, Ramp, Sliding
from skfsink.loads.pressure import Filling, Pressure
from skfsink.loads.schedule import Loading
from skfsink.material import AAA, Material, NeoHookean, SinkLaw
from skfsink.meshing.vtu import write_mesh
from skfsink.methods.controls import ExplicitControls, HHTControls
from skfsink.methods.explicit import Explicit
from skfsink.methods.hht import HHT
from skfsink.methods.newton import Newton
from skfsink.pictures import plot
from skfsink.results.history import Table
from skfsink.results.loader import load
from skfsink.run.display import Display
from skfsink.run.observers.probe_surfaces import VolumeProbe
from skfsink.run.simulate import Simulation
from skfsink.scene.deck import read_deck
from skfsink.scene.options import Options
from skfsink.scene.tables import pressures_of, read_tables
from skfsink.study.validation_cavitation import octant

TOUGH = SinkLaw(phi=1e3)  # never reached: gamma stays 1
INNER, OUTER = 1.0, 1.5   # radii of tube and ball [mm]
KINDS = pytest.mark.parametrize("kind", ["quad", "hex"])


def everywhere(space: Space) -> np.ndarray:
    """Nodes of the whole surface."""
    return np.asarray(space.mesh.boundary_nodes())


def side(space: Space) -> np.ndarray:
    """Nodes of the side of greatest x."""
    return np.flatnonzero(ends(space, 0)[1])


def force(loads: FollowerLoads, u: np.ndarray) -> np.ndarray:
    """What the loads add to the internal force, (n, dim)."""
    out = np.zeros_like(u)
    loads.add_force(u, out)
    return out


def check_work(loads: FollowerLoads, u: np.ndarray, du: np.ndarray) -> None:
    """The work of loads that change, on the straight way from `u` by `du`, is the integral of their force along it."""
    loads.at(0.4)
    before = loads.values
    loads.at(0.9)
    after, total, parts = loads.values, 0.0, 400
    for i in range(parts):
        s = (i + 0.5) / parts
        loads.values = before + s * (after - before)
        total -= float(np.vdot(force(loads, u + s * du), du)) / parts
    loads.values = after
    assert loads.work(before, u, u + du) == pytest.approx(total, rel=1e-5)
    assert abs(total) > 0.01


# --- forces, stiffness and work ---
@KINDS
def test_nodal_forces_are_those_of_the_form(kind: str) -> None:
    """Fails if a loop over facets leaves its form: an edge or face turned, a weight or a derivative wrong."""
    space = box(kind, 3)
    forms, u = pressure_forms(), wavy(space, 0.1)
    for nodes in (everywhere(space), side(space)):
        loads = FollowerLoads(space, [(nodes, Pressure("all", 2.0))])
        loads.at(1.5)
        basis = skfem.FacetBasis(space.mesh, space.u_basis.elem, facets=boundary_facets(space, nodes), intorder=4)
        fields = {"displacement": basis.interpolate(u.ravel()), "pressure": 3.0}
        np.testing.assert_allclose(force(loads, u).ravel(), forms.residual.assemble(basis, **fields), atol=1e-14)
        pattern = Pattern(space, space.dim)
        data = np.zeros(pattern.nnz)
        loads.add_stiffness(pattern, u, data)
        K, skew = pattern.matrix(data), loads.skew(u, np.ones(u.size, bool))
        assert (skew is None) == (nodes.size == everywhere(space).size)  # a closed surface has a potential
        K = K if skew is None else K + skew
        np.testing.assert_allclose(K.toarray(), forms.tangent.assemble(basis, **fields).toarray(), atol=1e-13)


@KINDS
def test_a_closed_surface_has_no_resultant_and_no_moment(kind: str) -> None:
    """Fails if a pressure all around carries the body away, or turns it."""
    space = box(kind, 3)
    u = wavy(space, 0.2)
    loads = FollowerLoads(space, [(everywhere(space), Pressure("all", 1.0))])
    loads.at(1.0)
    f, x = force(loads, u), space.X + u
    np.testing.assert_allclose(f.sum(axis=0), 0.0, atol=1e-14)
    moment = x.T @ f
    np.testing.assert_allclose(moment, moment.T, atol=1e-14)
    assert np.abs(f).max() > 0.01


@KINDS
@pytest.mark.parametrize("fluid", [False, True])
def test_work_is_that_of_the_forces_on_the_way(kind: str, fluid: bool) -> None:
    """Fails if the work of a pressure that changes, or of a fluid, is not the integral of force along the motion."""
    space = box(kind, 2)
    u, du = wavy(space, 0.1), wavy(space, 0.3, 5)
    loads = FollowerLoads(space, [(everywhere(space), Filling("all", 3.0, 0.5)) if fluid else
                                  (side(space), Pressure("side", 2.0))])
    check_work(loads, u, du)


@KINDS
def test_volume_swept(kind: str) -> None:
    """Fails if the volume that a boundary sweeps, or its area, is not that of a stretched and turned body."""
    space = box(kind, 3)
    dim = space.dim
    F = np.array([[0.2, -1.1, 0.0], [1.3, 0.3, 0.1], [0.0, 0.2, 0.9]])[:dim, :dim]
    u = space.X @ (F - np.eye(dim)).T
    loads = FollowerLoads(space, [(everywhere(space), Pressure("all", 1.0))])
    assert loads.swept(u)[0] == pytest.approx(1.0 - np.linalg.det(F), rel=1e-12)  # of what is outside of the body
    assert loads.areas[0] == pytest.approx(2.0 * dim, rel=1e-12)


@KINDS
def test_stiffness_of_a_fluid(kind: str) -> None:
    """Fails if the tangent of a filling, with its column, is not the derivative of its force."""
    space = box(kind, 2)
    loads = FollowerLoads(space, [(everywhere(space), Filling("all", 1.0, 0.3))])
    loads.at(0.5)
    u, v, eps = wavy(space, 0.1), wavy(space, 1.0, 5), 1e-6
    pattern = Pattern(space, space.dim)
    data = np.zeros(pattern.nnz)
    loads.add_stiffness(pattern, u, data)
    B = loads.stiffening(u)
    assert B is not None
    product = pattern.matrix(data) @ v.ravel() + B @ (B.T @ v.ravel())
    slope = (force(loads, u + eps * v) - force(loads, u - eps * v)).ravel() / (2 * eps)
    np.testing.assert_allclose(product, slope, atol=1e-8)
    mass = np.linspace(1.0, 2.0, u.size)
    top = float(np.linalg.eigvalsh(B.T @ (B / mass[:, None]))[-1])
    assert loads.stiffest(u, (1 / mass).reshape(u.shape)) == pytest.approx(top, rel=1e-12)


# --- bodies ---
class Held(Loadable):
    """A body between grips under pressures, with the two fields; the material never fails unless a law is given."""

    def __init__(self, space: Space, grips: list[tuple[np.ndarray, Any]], loads: list[tuple[np.ndarray, Any]],
                 material: Material | None = None, law: SinkLaw = TOUGH, **controls: Any) -> None:
        super().__init__(space, Loading(space, grips, (), (), loads), material or AAA(), law, **controls)
        assert self.loading.followers is not None
        self.followers = self.loading.followers


def symmetric(space: Space) -> list[tuple[np.ndarray, Grip]]:
    """The sides at 0 of each axis, held against it."""
    dim = space.dim
    return [(np.flatnonzero(np.abs(space.X[:, i]) < 1e-9),
             Grip("xyz"[i], tuple(0.0 if j == i else None for j in range(dim)))) for i in range(dim)]


def at_radius(space: Space, radius: float) -> np.ndarray:
    """Nodes at a distance from the origin."""
    return np.flatnonzero(np.isclose(np.linalg.norm(space.X, axis=1), radius))


def tube(n: int, thinner: float = 0.0, angles: tuple[float, float] = (0.0, np.pi / 2)) -> Space:
    """Part of the section of a thick tube, a quarter of it if `angles` does not say another one.

    n elements go through its wall and 2 n along it; it is by the share `thinner` thinner near the axis x.
    """
    mesh = skfem.MeshQuad.init_tensor(np.linspace(INNER, OUTER, n + 1), np.linspace(*angles, 2 * n + 1))
    r, angle = mesh.p
    r = INNER + (r - INNER) * (1 - thinner * np.cos(angle) ** 8)
    return Space(skfem.MeshQuad(np.array([r * np.cos(angle), r * np.sin(angle)]), mesh.t))


def ball(n: int, layers: int) -> Space:
    """Octant of a hollow ball: three patches of n x n faces, and `layers` through its wall."""
    return octant(n, np.linspace(INNER, OUTER, layers + 1))


def thick(material: Material, a: float, dim: int) -> float:
    """Pressure of an incompressible tube in plane strain, or ball, whose inner radius has grown to `a`.

    p = int (sigma_tt - sigma_rr) n/r dr, n = 1 for the tube and 2 for the ball; lambda = r/R, with r^dim - R^dim
    constant.
    """
    def stress(R: float) -> float:
        r = (R**dim + a**dim - INNER**dim) ** (1 / dim)
        hoop, radial = r / R, (r / R) ** (1 - dim)
        I1 = (dim - 1) * hoop**2 + radial**2 + (1.0 if dim == 2 else 0.0)
        slope = float(material.isochoric(np.array([I1]))[1][0])
        return (dim - 1) * 2 * slope * (hoop**2 - radial**2) * (R / r) ** (dim - 1) / r

    return float(quad(stress, INNER, OUTER)[0])


@pytest.mark.parametrize("material", [AAA, NeoHookean])
def test_thick_tube(material: Callable[..., Material]) -> None:
    """Fails if a tube under pressure leaves its closed form, or does not converge to it with the square of h."""
    stiff = material(bulk_modulus=2e6)
    p, errors = thick(stiff, 1.3, 2), []
    for n in (2, 4, 8):
        space = tube(n)
        held = Held(space, symmetric(space), [(at_radius(space, INNER), Pressure("inner", Ramp((0, 1), (0, p))))],
                    stiff, tolerance=1e-9)
        state = held.load()
        assert held.statics.unfailed == "nothing moves after load time 1 s"
        radii = np.linalg.norm((space.X + state.u)[at_radius(space, INNER)], axis=1)
        errors.append(abs(radii.mean() - 1.3))
        assert np.ptp(radii) < 1e-7
        grown = n * np.sin(np.pi / 4 / n) * (radii.mean()**2 - INNER**2)  # of 2n triangles
        assert held.followers.swept(state.u)[0] == pytest.approx(grown, rel=1e-7)
        assert abs(state.ledger.balance) < 2e-3 * state.ledger.elastic
        assert state.ledger.work == state.ledger.pressure_work > 0.0
    assert errors[-1] < 1e-3 * 1.3 / 2
    assert all(3.4 < coarse / fine < 4.8 for coarse, fine in pairwise(errors))


def test_a_wedge_between_sliding_planes_is_a_tube() -> None:
    """Fails if pressure on a rim that slides on oblique planes is taken for one without a potential."""
    grown = []
    for angles in ((0.0, np.pi / 2), (np.pi / 9, np.pi / 4)):
        space = tube(4, angles=angles)
        at, inner = np.arctan2(space.X[:, 1], space.X[:, 0]), at_radius(space, INNER)
        sides = [(np.flatnonzero(np.isclose(at, a, atol=1e-6)), Sliding(str(a))) for a in angles]
        held = Held(space, sides, [(inner, Pressure("inner", Ramp((0.0, 1.0), (0.0, 0.3))))], tolerance=1e-8)
        state = held.load()
        assert held.momentum.skew_stiffness(state.u, held.loading.free) is None
        grown.append(np.linalg.norm((space.X + state.u)[inner], axis=1).mean() - INNER)
        assert abs(state.ledger.balance) < 1e-3 * state.ledger.elastic
        Held(space, sides, [(inner, Filling("inner", 0.1, 1e-6))])  # is not refused
    assert held.loading.sliding is not None
    assert grown[1] == pytest.approx(grown[0], rel=0.01) and grown[0] > 0.1  # the wedge has smaller elements along it


def test_a_pressure_is_a_function_of_time() -> None:
    """Fails if a curve gives another pressure than its function, or load increments pass its turns."""
    space = tube(3)
    curve = Curve(lambda t: 0.1 * np.sin(t) ** 2, until=4.0)
    held = Held(space, symmetric(space), [(at_radius(space, INNER), Pressure("inner", curve))])
    seen = []
    for state in held.statics.load(held.state):
        assert held.followers.values[0] == pytest.approx(0.1 * np.sin(state.grip) ** 2, abs=1e-12)
        seen.append(held.followers.swept(state.u)[0])
    assert max(seen) > 20 * min(seen[len(seen) // 2:]) and state.grip == pytest.approx(4.0)
    assert abs(state.ledger.balance) < 1e-3 * max(state.ledger.work, 1e-3)


def test_ball_past_its_greatest_pressure() -> None:
    """Fails if a filling does not lead through the limit of a balloon, or a pressure does not end there."""
    material, space = NeoHookean(bulk_modulus=1e3), ball(4, 3)
    inner = at_radius(space, INNER)
    held = Held(space, symmetric(space), [(inner, Filling("inner", 1.0, 1e-3))], material, increment=0.1)
    radii, pressures = [], []
    for state in held.statics.load(held.state):
        radii.append(np.linalg.norm((space.X + state.u)[inner], axis=1).mean())
        pressures.append(held.followers.pressures(state.u)[0])
        if radii[-1] > 2.0:
            break
    exact = [thick(material, a, 3) for a in radii]
    np.testing.assert_allclose(pressures, exact, rtol=0.011)
    assert 2 < np.argmax(pressures) < len(pressures) - 5 and pressures[-1] < 0.97 * max(pressures)
    volume = np.pi / 6 * (radii[-1]**3 - INNER**3)
    assert held.followers.swept(state.u)[0] == pytest.approx(volume, rel=0.02)
    assert abs(state.ledger.balance) < 0.01 * state.ledger.elastic
    given = Held(space, symmetric(space), [(inner, Pressure("inner", 1.0))], material, onset_tolerance=1e-3)
    end = given.load()
    assert given.statics.refused == "no equilibrium"
    assert end.grip == pytest.approx(max(pressures), rel=2e-3)


def test_an_open_surface_converges_as_newton_does() -> None:
    """Fails if the part of the load stiffness that is not symmetric is left out: the last steps are slow then."""
    space = box("quad", 8, 0.1)
    held = Held(space, [(np.flatnonzero(ends(space, 1)[0]), Grip("bottom", (0.0, 0.0)))],
                [(side(space), Pressure("side", 1.0))], NeoHookean())
    held.momentum.set_time(0.15)
    newton = Newton(held.momentum, held.loading.free, 1e-11, 30)
    u, _ = newton.equilibrium(np.zeros_like(space.X))
    assert held.followers.skew(u, held.loading.free) is not None and np.abs(u).max() > 0.1
    assert newton.steps < 11


# --- events ---
def burst(in_crack: bool, n: int = 8) -> Held:
    """The quarter of a tube with a thin place, loaded by a pressure until it fails."""
    space = tube(n, 0.2)
    return Held(space, symmetric(space), [(at_radius(space, INNER), Pressure("inner", 1e-3, in_crack))],
                law=SinkLaw(phi=0.05, length_scale=0.1))


@pytest.mark.parametrize("make", ["explicit", "hht"])
def test_energy_of_an_event_under_pressure(make: str) -> None:
    """Fails if the work of a pressure on a body in motion is not what the ledger has of it."""
    space = tube(4)
    inner = at_radius(space, INNER)
    held = Held(space, symmetric(space), [(inner, Pressure("inner", Ramp((0.0, 1e-5, 1.0), (0.0, 0.1, 0.1))))])
    state = held.state
    state.phase = "event"
    integrator = (Explicit(held.body, ExplicitControls()) if make == "explicit" else
                  HHT(held.body, HHTControls(dt=2e-7, force_tolerance=1e-6)))
    integrator.begin(state)
    for _ in integrator.run(state, 6e-5):
        pass
    ledger = state.ledger
    assert ledger.pressure_work == ledger.work > 0.0 and ledger.kinetic > 0.02 * ledger.work
    assert abs(ledger.balance) < 2e-4 * ledger.work
    assert abs(ledger.numerical) < (1e-3 if make == "explicit" else 2e-2) * ledger.work


def test_pressure_goes_with_the_surface() -> None:
    """Fails if a pressure acts on elements without force, or one in the crack not on its lips, or on closed holes."""
    space = box("quad", 6, 0.0)
    x, y = space.X[space.conn].mean(axis=1).T
    top = np.flatnonzero(ends(space, 1)[1])
    deleted = (np.abs(x - 0.42) < 0.05) & (y > 0.6)            # a crack from the top, two elements deep
    deleted |= (np.abs(x - 0.75) < 0.05) & (np.abs(y - 0.25) < 0.05)  # a hole inside
    assert deleted.sum() == 3 + 1 - (np.count_nonzero((np.abs(x - 0.42) < 0.05) & (y > 0.6)) == 2)
    deep = np.count_nonzero((np.abs(x - 0.42) < 0.05) & (y > 0.6))
    h, gamma = 1 / 6, np.ones(space.n_nodes)
    plain, filled = (FollowerLoads(space, [(top, Pressure("top", 1.0, in_crack=c))]) for c in (False, True))
    for loads in (plain, filled):
        loads.at(1.0)
        whole = force(loads, np.zeros_like(space.X))
        np.testing.assert_allclose(whole.sum(axis=0), (0.0, 1.0), atol=1e-14)
        loads.keep(gamma, deleted, 1e-3)
    f = force(plain, np.zeros_like(space.X))
    np.testing.assert_allclose(f.sum(axis=0), (0.0, 1.0 - h), atol=1e-14)
    assert plain.area(np.zeros_like(space.X))[0] == pytest.approx(1.0 - h)
    f = force(filled, np.zeros_like(space.X))
    np.testing.assert_allclose(f.sum(axis=0), (0.0, 1.0), atol=1e-14)  # the end of the crack bears what the mouth did
    assert filled.area(np.zeros_like(space.X))[0] == pytest.approx(1.0 + 2 * deep * h)
    inside = (space.X[:, 1] < 0.5)
    assert (f[inside] == 0).all()
    low = gamma.copy()
    low[np.unique(space.conn[deleted])] = 0.0  # elements without a point above the floor, as deleted ones
    plain.keep(low, np.zeros_like(deleted), 1e-3)
    assert plain.area(np.zeros_like(space.X))[0] == pytest.approx(1.0 - h)


@pytest.mark.parametrize("in_crack", [False, True])
def test_a_tube_bursts(in_crack: bool) -> None:
    """Fails if the energies of a crack under pressure do not add up, or the pressure in it does no work."""
    held = burst(in_crack)
    state = held.load()
    assert not held.statics.unfailed
    state.begin_event(0.005, held.statics.clock.grown(state.grip, 0.005))
    integrator = Explicit(held.body, ExplicitControls())
    integrator.begin(state)
    start = state.ledger.elastic
    for _ in integrator.run(state, 1.5e-4):
        if state.deleted.sum() > 10:
            break
    assert state.gamma.min() < 1e-3 and state.deleted.any()
    assert abs(state.ledger.balance) < 2e-3 * (start + state.ledger.work)
    assert (state.ledger.pressure_work > 0.0) == in_crack  # without, the wall springs back where the load has gone


# --- decks, and what is refused ---
RING = '''case = "custom"
[parameters]
mesh = "ring.vtu"
length_scale = "0.12 mm"
event_time = "20 µs"
[[grips]]
boundary = "left"
x = 0
[[grips]]
boundary = "bottom"
y = 0
[[pressures]]
boundary = "inner"
rate = "10 kPa/s"
in_crack = true
'''


def write_ring(path: Path) -> None:
    """Mesh file of a quarter of a ring with a thin place; "inside" are nodes within its wall."""
    space = tube(6, 0.2)
    nodes = {"inner": at_radius(space, INNER), "inside": np.flatnonzero(np.abs(space.X.sum(axis=1) - 1.7) < 0.1)}
    points = np.column_stack([space.X, np.zeros(space.n_nodes)])
    write_mesh(path, meshio.Mesh(points, [("quad", space.mesh.t.T)], point_sets=nodes))


@pytest.fixture
def ring(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working folder, with the mesh of a quarter of a ring."""
    write_ring(tmp_path / "ring.vtu")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_deck_bursts_a_ring(ring: Path) -> None:
    """Fails if a deck, its scene file and Python differ, or the columns are wrong."""
    assert invoke_program("run", deck(ring, RING), "--out", "first", "--quiet")[0] == 0
    grips = [Grip("left", (0.0, None)), Grip("bottom", (None, 0.0))]
    options = Options(length_scale=0.12, event_time=2e-5, out=Path("second"), quiet=True)
    custom(mesh="ring.vtu", grips=grips, pressures=[Pressure("inner", 0.01, in_crack=True)], options=options)
    assert (ring / "first" / "history.csv").read_bytes() == (ring / "second" / "history.csv").read_bytes()
    assert (ring / "first" / "scene.toml").read_bytes() == (ring / "second" / "scene.toml").read_bytes()
    run = load("first")
    history = run.history
    loading = history["phase"] == "loading"
    p = history["pressure_MPa"]
    np.testing.assert_allclose(p[loading], 0.01 * history["time_s"][loading], rtol=1e-12)
    assert (np.diff(history["swept_volume"][loading]) > 0).all()
    np.testing.assert_allclose(history["grip_displacement_mm"], history["swept_volume"] / (np.pi / 2), rtol=3e-3)
    assert (history["reaction_N_per_mm"][loading] > p[loading] * np.pi / 2).all()
    assert run.summary["energy"]["pressure_work"] > 0


@pytest.mark.parametrize("load_text", [
    '[[pressures]]\nboundary = "inner"\nrate = "75 mmHg/s"\n',
    '[[fillings]]\nboundary = "inner"\ninflow = "0.01 mm^3/s"\ncompliance = "0.1 mm^3/kPa"\n'])
def test_pressure_at_the_onset_is_told(ring: Path, load_text: str) -> None:
    """Fails if summary, table or the line of the onset lack the pressure, have another than the history, or the wrong
    factor to mmHg: 1 kPa is 7.50062 of them."""
    text = RING.partition("[[pressures]]")[0] + load_text
    code, out, err = invoke_program("run", deck(ring, text.replace("20 µs", "1 ns")), "--out", "run")
    assert code == 0, err
    run = load("run")
    rows = run.history["phase"] == "loading"
    p = run.history["pressure_MPa"][rows]
    assert run.summary["onset"]["pressure_MPa"] == pytest.approx(p[-1], rel=1e-9)
    assert run.summary["loading"]["greatest_pressure_MPa"] == pytest.approx(p.max(), rel=1e-9) and p.max() > 0.01
    cells = {(row.name, row.unit): row.cells[0] for row in run.table().rows}
    assert float(cells["pressure at the onset", "kPa"]) == pytest.approx(1e3 * p[-1], rel=1e-3)
    assert float(cells["pressure at the onset", "mmHg"]) == pytest.approx(7500.62 * p[-1], rel=1e-3)
    assert f"under {1e3 * p[-1]:.4g} kPa ({7500.61576 * p[-1]:.4g} mmHg)" in out + err


def test_loading_of_a_vessel_is_drawn_as_pressure_over_volume(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if the picture of a body under pressure shows no pressure, or that of one whose grips move no load."""
    kept: list[Figure] = []
    monkeypatch.setattr(plot, "Figure", lambda *a, **k: kept.append(Figure(*a, **k)) or kept[-1])
    swept, p = np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.02, 0.03])
    table = {"phase": np.array(["loading"] * 3), "gamma_min": np.ones(3), "reaction_N_per_mm": 9 * p,
             "swept_volume": swept, "pressure_MPa": p}
    for displacement, labels in ((swept / 5, ["pressure (kPa)"]),
                                 (np.array([0.0, 1.0, 1.0]), ["load (N)", "pressure (kPa)"])):
        plot.loading_picture(Table({**table, "grip_displacement_mm": displacement}, 3), tmp_path / "a.png")
        above = kept[-1].axes[:len(labels)]
        assert [ax.get_ylabel() for ax in above] == labels
        np.testing.assert_allclose(above[-1].lines[0].get_xydata()[1:], np.column_stack([swept, 1e3 * p]))
        (beside,) = above[-1].child_axes
        assert beside.get_ylabel() == "mmHg"
    still = Table({**table, "grip_displacement_mm": swept, "pressure_MPa": 0 * p}, 3)
    plot.loading_picture(still, tmp_path / "a.png")
    assert kept[-1].axes[0].get_ylabel() == "load (N)" and len(kept[-1].axes) == 2


@pytest.mark.parametrize(("text", "integrator"), [
    ('[[pressures]]\nboundary = "inner"\nrate = "10 kPa/s"\nin_crack = true\n', "explicit"),
    ('[[fillings]]\nboundary = "inner"\ninflow = "0.01 mm^3/s"\ncompliance = "0.01 mm^3/kPa"\n', "explicit"),
    pytest.param('[[fillings]]\nboundary = "inner"\ninflow = "0.01 mm^3/s"\ncompliance = "0.01 mm^3/kPa"\n', "hht",
                 marks=pytest.mark.slow)])
def test_a_resumed_run_leaves_the_same_bytes(ring: Path, text: str, integrator: str) -> None:
    """Fails if a checkpoint loses facets that have failed, volumes below them, or what was added to a fluid."""
    head = RING.partition("[[pressures]]")[0].replace(
        'event_time = "20 µs"', f'integrator = "{integrator}"\nevent_time = "50 µs"\novershoot = 0.05')
    of = read_deck(deck(ring, head + text)).scene()
    state = simulation(of, ring / "whole").run()
    assert state.deleted.any() and abs(state.ledger.balance) < 1e-4 * state.ledger.turnover
    with pytest.raises(Interrupted):
        simulation(of, ring / "broken", Stop(state.step * 2 // 3)).run()
    Simulation(of, ring / "broken", Display(True), resume=True).run()
    assert (ring / "whole" / "history.csv").read_bytes() == (ring / "broken" / "history.csv").read_bytes()


@pytest.mark.parametrize(("text", "said"), [
    ('boundary = "none"\nvalue = "1 kPa"', "none"),
    ('boundary = "inner"\nvalue = "1 kPa"\nrate = "1 kPa/s"', "must have a value .* or a rate; got both"),
    ('boundary = "inner"', "got neither"),
    ('boundary = "inner"\nvalue = "1 mm"', "pressure inner, value must be a quantity in MPa"),
    ('boundary = "inner"\nvalue = "1 kPa"\nin_crack = 1', "pressure inner, in_crack must be true or false"),
    ('boundary = "inner"\nvalue = "1 kPa"\npush = 1', "pressures: unknown key 'push'; the keys are boundary"),
    ('boundary = "inside"\nvalue = "1 kPa"', "no pressure can act on boundary 'inside': no facet of the surface"),
])
def test_pressures_that_are_none(ring: Path, text: str, said: str) -> None:
    """Fails if a mistake in a pressure is no line that names it."""
    status, *printed = invoke_program("run", deck(ring, RING.partition("[[pressures]]")[0] + "[[pressures]]\n" + text),
                                      "--out", "run", "--quiet")
    error = "".join(printed)
    assert status and len(error.strip().splitlines()) == 1 and re.search(said, error), error


def test_tables_of_pressures_are_read_and_written() -> None:
    """Fails if a pressure or a filling is lost between a deck, its table and the object."""
    assert read_tables("pressures", [{"boundary": "a", "value": "16 kPa"}]) == (
        {"boundary": "a", "value": [[0.0, 0.0], [1.0, 0.016]]},)
    loads = (Pressure("a", 0.1), Pressure("b", Ramp((0, 2), (0, 3)), in_crack=True), Filling("c", 2.0, 0.5))
    tables = read_tables("pressures", loads[:2]), read_tables("fillings", loads[2:])
    assert pressures_of(*tables) == loads and pressures_of(*map(list, tables)) == loads
    assert read_tables("fillings", [{"boundary": "c", "inflow": "1 mm^3/s", "compliance": "0.1 mm^3/kPa"}]) == (
        {"boundary": "c", "inflow": 1.0, "compliance": pytest.approx(100.0)},)
    with pytest.raises(ParameterError, match="compliance of the filling of c must be above 0"):
        Filling("c", 1.0, 0.0)


def test_pressures_that_cannot_act() -> None:
    """Fails if two pressures act on one side, or one on a thin sheet or on a body that is not held."""
    space = box("quad", 3, 0.0)
    with pytest.raises(ParameterError, match="two pressures act on one side of an element, of boundaries 'a' and 'b'"):
        FollowerLoads(space, [(side(space), Pressure("a", 1.0)), (everywhere(space), Pressure("b", 1.0))])
    with pytest.raises(MeshError, match="no pressure can act on boundary 'a'"):
        FollowerLoads(space, [(np.array([0, 5]), Pressure("a", 1.0))])
    with pytest.raises(ParameterError, match="no grip holds the body in x, and a load would carry it away"):
        Loading(space, (), (), (), [(side(space), Pressure("a", 1.0))])
    with pytest.raises(ParameterError, match="the boundary 'a' of a filling encloses no volume: hold its rim"):
        Loading(space, [(np.flatnonzero(ends(space, 1)[0]), Grip("bottom", (0.0, 0.0)))], (), (),
                [(side(space), Filling("a", 1.0, 1.0))])
    loads = FollowerLoads(space, [(side(space), Pressure("a", 1.0))])
    with pytest.raises(ParameterError, match="planestress has no thickness for a pressure"):
        Momentum(space, AAA(), "planestress", followers=loads)
    with pytest.raises(ParameterError, match="other pressures than the loading"):
        Body(Momentum(space, AAA(), followers=loads), DensitySolver(space, TOUGH), Loading(space, ()))


def test_an_event_begins_at_the_pressure_of_its_onset() -> None:
    """Fails if a stiff fluid bursts a body that is scaled past its onset, or a resumed run loses what was added to it.
    """
    space = tube(4)
    inner = at_radius(space, INNER)
    held = Held(space, symmetric(space), [(inner, Filling("inner", 0.1, 1e-5))])
    state = held.load(0.5)
    p = held.followers.pressures(state.u)[0]
    state.begin_event(0.005, held.statics.clock.grown(state.grip, 0.005))
    held.followers.at(state.grip)
    assert abs(held.followers.pressures(state.u)[0] / p - 1) > 0.2
    held.followers.hold(state.u, np.array([1.005 * p]))
    assert held.followers.pressures(state.u)[0] == pytest.approx(1.005 * p, rel=1e-9)
    again = Held(space, symmetric(space), [(inner, Filling("inner", 0.1, 1e-5))]).followers
    again.at(state.grip)
    again.restore(held.followers.memory())
    assert again.pressures(state.u)[0] == held.followers.pressures(state.u)[0]


def test_probe_of_a_filled_cavity_follows_its_volume_past_failure() -> None:
    """Fails if the volume of a filling is another one than that of the probe of its boundary, before elements at it
    have failed or after, when the volume below them stays as it was; without a filling there is none then."""
    space = tube(4)
    inner = at_radius(space, INNER)
    held = Held(space, symmetric(space), [(inner, Filling("inner", 0.1, 1e-5))])
    probes = [VolumeProbe("lumen", "inner", (0.0, 0.0)) for _ in range(2)]
    for probe, pressures in zip(probes, (held.followers.loads, ())):
        probe._prepared(SimpleNamespace(space=space, sample=SimpleNamespace(nodes=lambda _: inner),
                                        pressures=pressures))  # type: ignore[arg-type]
    held.load(0.5)
    state, view = held.state, SimpleNamespace(state=held.state, body=held.body)
    filled, plain = (float(probe._values(view)[0]) for probe in probes)  # type: ignore[arg-type]
    p = held.followers.pressures(state.u)[0]
    assert filled == pytest.approx(plain, rel=1e-12) and p > 0.0
    whole = probes[0]._before
    assert filled == pytest.approx(-whole + 0.1 * state.grip - 1e-5 * p, rel=1e-9)
    failed = np.flatnonzero(np.isin(space.conn, inner).any(axis=1))[:2]
    state.deleted[failed] = True
    held.followers.keep(state.gamma, state.deleted, 1e-3)
    state.u[np.unique(space.conn[failed])] += 0.5 * INNER * np.random.default_rng(0).random((1, space.dim))
    after, none = (float(probe._values(view)[0]) for probe in probes)  # type: ignore[arg-type]
    assert np.isnan(none) and after != filled
    assert after == pytest.approx(-whole + held.followers.swept(state.u)[0], rel=1e-12)
