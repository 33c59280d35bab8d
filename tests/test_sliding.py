"""Boundaries that slide on planes of any direction: what they hold, and that a turned body does what the body does."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import skfem
from bodies import box, distorted, grid, notched, patchy, same_bits, wavy
from guarded import NOTCHED, Stop, simulation
from test_loads import TOUGH, side

from skfsink.errors import Interrupted, MeshError, ParameterError
from skfsink.fem.pattern import Pattern
from skfsink.fem.space import Space
from skfsink.fields.body import Body
from skfsink.fields.contact import Contact
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import BulkViscosity, Momentum
from skfsink.fields.state import State
from skfsink.loads.grips import Grip, Ramp, Sliding, Traction
from skfsink.loads.nodal import NodalLoads
from skfsink.loads.rigid import free_motions, moves_as_a_whole, pieces
from skfsink.loads.schedule import Loading
from skfsink.loads.sliding import SlidingPlanes, normal_of
from skfsink.material import AAA, SinkLaw
from skfsink.methods.controls import ExplicitControls, HHTControls, StaticsControls
from skfsink.methods.explicit import Explicit
from skfsink.methods.hht import HHT
from skfsink.methods.statics import Statics
from skfsink.run.display import Display
from skfsink.run.observers.places import rim_of, symmetry_planes
from skfsink.run.simulate import Simulation
from skfsink.scene.controls import Controls
from skfsink.scene.scene import Scene
from skfsink.scene.tables import grips_of, read_tables

ATOL = 1e-9


def rotation(dim: int) -> np.ndarray:
    """By 0.4 in a plane; about a general axis in space."""
    if dim == 2:
        return np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    q, r = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


def turned(space: Space, R: np.ndarray) -> Space:
    """The body turned about the origin."""
    return Space(type(space.mesh)(R @ space.mesh.p, space.mesh.t))


class Guided:
    """A body on planes through the origin at its sides x-, y- (and z-), pulled at y+; it may be a turned one."""

    def __init__(self, space: Space, R: np.ndarray | None = None, rate: float | Ramp = 0.1, law: SinkLaw = TOUGH,
                 b1: float = 0.0, **controls: Any) -> None:
        sides = {f"{axis}-": side(space, f"{axis}-") for axis in "xyz"[:space.dim]}
        top = side(space, "y+")
        R = np.eye(space.dim) if R is None else R
        self.space = turned(space, R)
        factor = rate.values[-1] if isinstance(rate, Ramp) else rate
        pull = tuple(Ramp(rate.times, tuple(float(x) * np.array(rate.values))) if isinstance(rate, Ramp) else
                     float(x) * factor for x in R[:, 1])
        self.loading = Loading(self.space, [(nodes, Sliding(name)) for name, nodes in sides.items()],
                               [(top, Traction("y+", pull))])
        self.momentum = Momentum(self.space, AAA(), dead=self.loading.dead, bulk_viscosity=BulkViscosity(b1, 0.0))
        self.body = Body(self.momentum, DensitySolver(self.space, law), self.loading)
        self.statics = Statics(self.body, StaticsControls(**controls))
        self.state = State.intact(self.space)

    def load(self, until: float = np.inf) -> State:
        for state in self.statics.load(self.state):
            if state.grip >= until:
                break
        return self.state


BODIES = {"quad": (lambda: box("quad", 4), rotation(2)), "hex": (lambda: box("hex", 2), rotation(3))}


# --- what is held ---
@pytest.mark.parametrize("kind", BODIES)
def test_planes_hold_their_normals_and_nothing_else(kind: str) -> None:
    """Fails if a node of one plane, or of two or three, is held in more or less than their normals."""
    make, R = BODIES[kind]
    space = make()
    guided = Guided(space, R)
    planes = guided.loading.sliding
    assert planes is not None
    held = dict.fromkeys(range(space.n_nodes), 0)
    for axis in "xyz"[:space.dim]:
        for node in side(space, f"{axis}-"):
            held[node] += 1
    fixed = ~guided.loading.free.reshape(space.X.shape)
    for node, number in held.items():
        there = np.flatnonzero(planes.nodes == node)
        rows = planes.normals[there[0]] if there.size else np.zeros((0, space.dim))
        assert int(np.any(rows != 0.0, axis=1).sum()) + int(fixed[node].sum()) == number
        for row in rows[np.any(rows != 0.0, axis=1)]:
            normals = [R[:, i] for i in range(space.dim) if node in side(space, "xyz"[i] + "-")]
            assert np.linalg.norm(np.array(normals) @ row) == pytest.approx(1.0)
    x = np.random.default_rng(0).normal(size=space.X.shape)
    along = planes.along(x)
    assert np.abs(planes.across(along)).max() < 1e-14
    np.testing.assert_allclose(planes.along(along), along, atol=1e-15)


@pytest.mark.parametrize("kind", BODIES)
@pytest.mark.parametrize("upper", [True, False])
def test_constrained_matrices_are_projections(kind: str, upper: bool) -> None:
    """Fails if the data of a matrix are not those of P A P + s N^T N, or that has greater eigenvalues than A."""
    make, R = BODIES[kind]
    guided = Guided(make(), R)
    momentum, free, planes = guided.momentum, guided.loading.free, guided.loading.sliding
    assert planes is not None
    pattern = Pattern(guided.space, guided.space.dim, free, upper=upper)
    momentum.gamma = patchy(guided.space)
    u = wavy(guided.space, 0.05)
    momentum.sliding = None
    A = pattern.symmetric(momentum.tangent(pattern, u)).toarray()
    momentum.sliding = planes
    found = pattern.symmetric(momentum.tangent(pattern, u)).toarray()
    n, dim = guided.space.X.shape
    P, N = np.eye(n * dim), np.zeros((n * dim, n * dim))
    diagonal = np.zeros(n * dim)
    diagonal[free] = np.diag(A)
    for node, rows in zip(planes.nodes, planes.normals):
        block = slice(node * dim, (node + 1) * dim)
        P[block, block] -= rows.T @ rows
        N[block, block] = np.abs(diagonal[block][free[block]]).min() * rows.T @ rows
    P, N = P[np.ix_(free, free)], N[np.ix_(free, free)]
    np.testing.assert_allclose(found, P @ A @ P + N, atol=1e-12 * np.abs(A).max())
    assert np.linalg.eigvalsh(found)[-1] <= np.linalg.eigvalsh(A)[-1] * (1 + 1e-12)


# --- a turned body ---
@pytest.mark.parametrize("kind", BODIES)
def test_turned_body_is_loaded_as_the_body(kind: str) -> None:
    """Fails if statics on oblique planes leave them, or find other equilibria than on planes along the axes."""
    make, R = BODIES[kind]
    one, other = Guided(make()), Guided(make(), R)
    assert one.loading.sliding is None
    for guided in (one, other):
        guided.load(8.0)
        guided.state.u, _ = guided.statics.newton.equilibrium(guided.state.u, 1e-11)
    assert np.abs(one.state.u).max() > 0.1 and one.state.grip == pytest.approx(other.state.grip, rel=1e-12)
    np.testing.assert_allclose(other.state.u @ R, one.state.u, atol=1e-8)
    assert other.state.ledger.work == pytest.approx(one.state.ledger.work, rel=1e-9)
    planes = other.loading.sliding
    assert planes is not None
    assert np.abs(planes.across(other.state.u)).max() < 1e-15
    force, expected = other.momentum.force(other.state.u) @ R, one.momentum.force(one.state.u)
    np.testing.assert_allclose(force, expected, atol=1e-8 * np.abs(expected).max())  # reactions of the planes in it


def test_turned_plate_fails_at_the_same_load() -> None:
    """Fails if the onset of a turned plate with a notch is another one, or its quasi-static crack goes elsewhere."""
    R, found = rotation(2), []
    for turn in (None, R):
        guided = Guided(notched(9), turn, law=SinkLaw())
        state = guided.load()
        found.append((state.grip, state.gamma, state.u if turn is None else state.u @ R))
    assert found[0][0] == pytest.approx(found[1][0], rel=1e-6)
    np.testing.assert_allclose(found[1][1], found[0][1], atol=1e-6)
    np.testing.assert_allclose(found[1][2], found[0][2], atol=1e-6)


@pytest.mark.parametrize("kind", BODIES)
@pytest.mark.parametrize("integrator", ["explicit", "hht", "consistent"])
def test_turned_body_swings_as_the_body(kind: str, integrator: str) -> None:
    """Fails if a step of either scheme leaves oblique planes, or if force, mass, viscosity or an energy on them are
    others than on planes along the axes: the load is dropped, and fails a part of the body."""
    make, R = BODIES[kind]
    results = []
    for turn in (None, R):
        guided = Guided(make(), turn, Ramp((0.0, 8.0, 8.0 + 1e-4), (0.0, 0.8, 0.2)), b1=0.1,
                        law=SinkLaw(phi=0.5))
        state = guided.load(8.0)
        state.begin_event(0.0)
        if integrator != "consistent":  # with which nodes without mass leap
            state.W_max[0] = 10.0  # of which nothing is left at the next density solve
        scheme: Explicit | HHT
        if integrator == "explicit":
            scheme = Explicit(guided.body, ExplicitControls(gamma_every=5, energy_tolerance=0.0, raised_mass=0.0))
            scheme.length.fix(2e-7)
        else:
            mass = "lumped" if integrator == "hht" else integrator
            scheme = HHT(guided.body, HHTControls(dt=1e-6, dt_first=1e-6, mass=mass, force_tolerance=1e-9,
                                                  correction_tolerance=1e-9, gamma_tolerance=1e-9, max_iterations=60))
        scheme.begin(state)
        scale = state.ledger.elastic
        for _ in range(40):
            scheme.step(state)
            assert abs(state.ledger.balance) < 1e-9 * scale
        if turn is not None:
            planes = guided.loading.sliding
            assert planes is not None
            for x in (state.u, state.v, state.a):
                assert np.abs(planes.across(x)).max() <= 1e-12 * np.abs(x).max()
        back = np.eye(guided.space.dim) if turn is None else turn
        results.append((state.u @ back, state.v @ back, scheme.reaction @ back, state.gamma, state.ledger, state.time))
    (u, v, force, gamma, ledger, time), (u2, v2, force2, gamma2, ledger2, time2) = results
    assert time == pytest.approx(time2, rel=1e-12) and ledger.viscous > 0.0
    assert gamma.min() < 1e-5 or integrator == "consistent"
    np.testing.assert_allclose(u2, u, atol=1e-7 * np.abs(u).max())
    np.testing.assert_allclose(v2, v, atol=1e-5 * np.abs(v).max())
    np.testing.assert_allclose(gamma2, gamma, atol=1e-6)
    np.testing.assert_allclose(force2, force, atol=1e-5 * np.abs(force).max())
    for name in ("elastic", "kinetic", "work", "sink_stored", "sink_kinetic", "deletion", "numerical", "viscous"):
        assert getattr(ledger2, name) == pytest.approx(getattr(ledger, name), rel=1e-5, abs=1e-6 * ledger.elastic), name
    if integrator == "explicit":
        assert ledger2.viscous == pytest.approx(ledger.viscous, rel=1e-8)


# --- a wedge ---
class Radial(NodalLoads):
    """A dead load on the inner boundary of a tube, outwards, that grows at `rate` [MPa/s]."""

    def __init__(self, space: Space, rate: float) -> None:
        self.space, self._rate = space, rate
        r = np.linalg.norm(space.X, axis=1)
        self._inner = r < 1.0 + 1e-9
        facets = space.mesh.facets_satisfying(lambda x: np.hypot(x[0], x[1]) < 1.0 + 1e-9, boundaries_only=True)
        basis = skfem.FacetBasis(space.mesh, space.gamma_basis.elem, facets=facets, intorder=2)
        self._area = skfem.LinearForm(lambda v, w: v).assemble(basis)
        self._outwards = space.X / r[:, None]
        self.nodes, self.elements = np.flatnonzero(self._inner), basis.tind
        self.at(0.0)

    def at(self, t: float) -> None:
        self.values = (self._rate * t * self._area[:, None] * self._outwards)[self.nodes]

    def rate(self, t: float) -> float:
        return self._rate

    def keep(self, alive: np.ndarray) -> None:
        assert alive.all()


def tube(begin: float, end: float, n: int) -> tuple[Statics, State, np.ndarray]:
    """A sector of a thick tube in plane strain between two angles [degrees], n elements; with the polar angles."""
    mesh = grid("quad", (6, n))
    r, angle = 1.0 + mesh.p[0], np.radians(begin + (end - begin) * mesh.p[1])
    space = Space(skfem.MeshQuad(np.array([r * np.cos(angle), r * np.sin(angle)]), mesh.t))
    cuts = [np.flatnonzero(np.isclose(mesh.p[1], place)) for place in (0.0, 1.0)]
    load = Radial(space, 0.1)
    loading = Loading(space, [(nodes, Sliding(f"cut {i}")) for i, nodes in enumerate(cuts)], (), [load])
    momentum = Momentum(space, AAA(), dead=loading.dead)
    statics = Statics(Body(momentum, DensitySolver(space, TOUGH), loading))
    state = State.intact(space)
    for _ in statics.load(state):
        if state.grip >= 0.5:
            break
    return statics, state, np.column_stack([r, angle])


def test_wedge_of_a_tube_is_the_quarter_of_it() -> None:
    """Fails if sectors of 30 degrees, with one plane along an axis or none, open otherwise than a quarter between the
    axes does, in statics or in an event: every radius moves alike."""
    opened = []
    for begin, end, n in ((0.0, 90.0, 9), (0.0, 30.0, 3), (20.0, 50.0, 3)):
        statics, state, polar = tube(begin, end, n)
        t = state.grip = 0.5
        statics.momentum.set_time(t)
        state.u, _ = statics.newton.equilibrium(state.u, 1e-11)
        scheme = Explicit(statics.body, ExplicitControls(gamma_every=10 ** 6, energy_tolerance=0.0))
        scheme.length.fix(2e-7)
        state.grip = 0.6  # the load jumps
        fields = [state.u.copy()]
        scheme.begin(state)
        for _ in range(100):
            scheme.step(state)
        fields += [state.u - fields[0], state.v]
        outwards = np.column_stack([np.cos(polar[:, 1]), np.sin(polar[:, 1])])
        radial = [np.einsum("ni,ni->n", field, outwards) for field in fields]
        for field, r in zip(fields, radial):
            np.testing.assert_allclose(field, r[:, None] * outwards, atol=1e-7 * np.abs(r).max())
        order = np.lexsort((polar[:, 1], np.round(polar[:, 0], 9)))
        opened.append([r[order].reshape(7, -1).mean(axis=1) for r in radial])
        spread = [np.ptp(r[order].reshape(7, -1), axis=1).max() / np.abs(r).max() for r in radial]
        assert max(spread) < 1e-7
    for other in opened[1:]:
        for one, two in zip(opened[0], other):
            np.testing.assert_allclose(two, one, rtol=1e-6)
    assert opened[0][0][0] > 0.02


# --- what is refused ---
def loading(space: Space, *grips: Grip, **nodes: np.ndarray) -> Loading:
    return Loading(space, [(nodes.get(grip.boundary, side(space, grip.boundary) if grip.boundary[1:] in ("-", "+")
                                      else np.zeros(0, int)), grip) for grip in grips])


def test_boundaries_that_are_no_plane_are_refused() -> None:
    """Fails if a curved boundary, or one that fixes no plane, slides on one that was fitted to it."""
    plate, cube = turned(Space(grid("quad", (4, 4))), rotation(2)), turned(Space(grid("hex", (2, 2, 2))), rotation(3))
    with pytest.raises(MeshError, match=r"^boundary 'corner' cannot slide: its node at \(.*\) mm is .* off the plane"):
        normal_of(plate, plate.mesh.boundary_nodes(), "corner")
    with pytest.raises(MeshError, match=r"^boundary 'pin' cannot slide: its nodes \(1\) lie in many planes, on a p"):
        normal_of(plate, np.array([3]), "pin")
    edge = side(Space(grid("hex", (2, 2, 2))), "x-")[[0, 1]]
    with pytest.raises(MeshError, match=r"^boundary 'edge' cannot slide: its nodes \(2\) lie in many planes, on a l"):
        normal_of(cube, edge, "edge")
    bent = Space(distorted(grid("quad", (4, 4)), 0.0))
    np.testing.assert_array_equal(normal_of(bent, side(bent, "x-"), "x-"), [1.0, 0.0])


def test_planes_that_contradict_other_grips_are_refused() -> None:
    """Fails if a node is moved through its plane, or planes that nearly coincide are held to rounding."""
    space, R = Space(grid("hex", (2, 2, 2))), rotation(3)
    R[:] = np.eye(3)
    R[:2, :2] = rotation(2)
    body = turned(space, R)
    sides = {name: side(space, name) for name in ("x-", "z+")}
    moved = Grip("z+", (None, None, 1.0))
    assert loading(body, Sliding("x-"), moved, **sides).sliding is not None  # along the plane
    with pytest.raises(ParameterError, match=r"^the node at .* slides on the plane of x-, and a grip moves it along x"):
        loading(body, Sliding("x-"), Grip("z+", (1.0, None, 0.0)), **sides)
    assert loading(body, Sliding("x-"), Grip("z+", (0.0, None, 0.0)), **sides).sliding is not None
    free = np.ones(space.X.shape, bool)
    for angle in (1e-6, 5e-3):
        planes = [(np.arange(3), np.array([np.cos(x), np.sin(x), 0.0]), f"plane {x:g}") for x in (0.3, 0.3 + angle)]
        if angle < 1e-4:  # one plane
            assert np.any(SlidingPlanes(space, planes, free, ~free).normals != 0.0, axis=2).sum(axis=1).max() == 1
            continue
        with pytest.raises(ParameterError, match=r"^the node at \(0, 0, 0\) mm slides on the plane of plane 0\.305 and "
                                                 r"is held by another that is parallel to it within 0\.29 degrees"):
            SlidingPlanes(space, planes, free, ~free)


def test_contact_on_oblique_planes_is_refused() -> None:
    """Fails if lips, whose medium moves nodes along axes, are computed on planes that are oblique to these."""
    guided = Guided(notched(9), rotation(2))
    guided.momentum.contact = Contact(guided.space, guided.momentum.parts, guided.loading.free)
    with pytest.raises(ParameterError, match=r"^contact is for boundaries that slide along axes"):
        Body(guided.momentum, guided.body.density, guided.loading)


def test_motions_that_planes_leave_free() -> None:
    """Fails if a body on planes counts as held by nothing, or one that they hold as free to move."""
    for kind, (make, R) in BODIES.items():
        space = make()
        body = turned(space, R)
        dim = space.dim
        sides = [(side(space, f"{axis}-"), Sliding(f"{axis}-")) for axis in "xyz"[:dim]]
        whole, less = Loading(body, sides), Loading(body, sides[:1])
        assert list(free_motions(body, whole.free, sliding=whole.sliding)) == []
        left = list(free_motions(body, less.free, sliding=less.sliding))
        assert len(left) == (1 if kind == "quad" else 3) and not any(motion.unheld for motion in left)
        with pytest.raises(ParameterError, match=r"^the grips let the body move or turn, and a load would"):
            Loading(body, sides[:1], [(side(space, "y+"), Traction("y+", (1.0,) * dim))])


def test_bodies_that_slide_as_a_whole_are_known() -> None:
    """Fails if a body that a grip pulls along its planes is loaded, or one that it presses on a plane is not."""
    R = np.eye(3)
    R[:2, :2] = rotation(2)
    space = Space(grid("hex", (2, 2, 2)))
    body = turned(space, R)
    guide = [(side(space, name), Sliding(name)) for name in ("x-", "y-")]
    label = pieces(body)
    along = Loading(body, [(side(space, "z+"), Grip("z+", (None, None, 1.0))), *guide])
    assert moves_as_a_whole(body, along, label)
    across = Loading(body, [(side(space, "x+"), Grip("x+", (1.0, None, None))), guide[0]])
    assert not moves_as_a_whole(body, across, label)


# --- runs ---
def plate(R: np.ndarray, **controls: Any) -> Scene:
    """The notched block of the guards, turned, on the plane of its bottom, which a traction pulls it from."""
    sample = NOTCHED.sample
    space = sample.space
    left, top = side(space, "x-"), sample.boundaries["top"]
    notch = np.abs(space.X[left, 1] - 0.5) < 0.05
    body = turned(space, R)
    new = replace(sample, space=body, boundaries={**sample.boundaries, "top": top, "left": left[~notch],
                                                  "right": side(space, "x+")})
    controls = {"event_time": 2e-5, "overshoot": 0.01, "checkpoint_every": 1e6, "frame_every": 1e-3, **controls}
    pull = (Traction("top", tuple(float(x) for x in 0.1 * R[:, 1])),)
    return Scene("block", "Block", {"mesh": ""}, new, AAA(), SinkLaw(), (Sliding("bottom"), Sliding("right")), pull,
                 controls=Controls(**controls))


def test_run_of_a_turned_plate(tmp_path: Path) -> None:
    """Fails if a run on oblique planes is none, its ledger opens, it begins to fail elsewhere, or planes of symmetry
    become edges that a crack arrives at."""
    sims = [simulation(plate(R), tmp_path / name) for name, R in (("one", np.eye(2)), ("other", rotation(2)))]
    states = [sim.run() for sim in sims]
    one, other = (sim.onset.figures for sim in sims)
    assert other["displacement_mm"] == pytest.approx(one["displacement_mm"], rel=1e-4)
    assert other["elastic_energy"] == pytest.approx(one["elastic_energy"], rel=1e-4)
    np.testing.assert_allclose(rotation(2).T @ other["place_mm"], one["place_mm"], atol=1e-9)
    for sim, state in zip(sims, states):
        assert abs(state.ledger.balance) < 1e-9 * sim.onset.figures["elastic_energy"] and state.deleted.any()
    scenes = [sim.scene for sim in sims]
    assert [[name for name, _ in symmetry_planes(scene)] for scene in scenes] == [["bottom", "right"]] * 2
    np.testing.assert_array_equal(*(rim_of(scene)[0] for scene in scenes))
    x = scenes[0].space.X
    heights = [[plane.height(scene.space.X, scene.space.X[plane.nodes[0]]) for _, plane in symmetry_planes(scene)]
               for scene in scenes]
    np.testing.assert_allclose(heights[1], heights[0], atol=1e-12)
    np.testing.assert_allclose(heights[0], [x[:, 1] - x[:, 1].min(), x[:, 0].max() - x[:, 0]], atol=1e-12)


@pytest.mark.parametrize("integrator", ["explicit", "hht"])
def test_resumed_on_oblique_planes(integrator: str, tmp_path: Path) -> None:
    """Fails if a resumed run does not write the same bytes."""
    of = plate(rotation(2), integrator=integrator, event_time=5e-6)
    whole = simulation(of, tmp_path / "whole")
    whole.run()
    with pytest.raises(Interrupted):
        simulation(of, tmp_path / "broken", Stop(30)).run()
    resumed = Simulation(of, tmp_path / "broken", Display(True), resume=True)
    same_bits(resumed.run(), whole.state)
    assert (tmp_path / "whole" / "history.csv").read_bytes() == (tmp_path / "broken" / "history.csv").read_bytes()


# --- decks ---
def test_sliding_boundaries_of_decks() -> None:
    """Fails if `normal = 0` is no sliding boundary, other numbers pass, or components beside it are dropped."""
    table = {"boundary": "cut", "normal": 0}
    assert grips_of([table], 2) == (Sliding("cut"),) == grips_of(read_tables("grips", [Sliding("cut")]), 3)
    assert read_tables("grips", [table]) == ({"boundary": "cut", "normal": 0.0},)
    for wrong, said in (({"normal": 1}, r"grip cut, normal must be 0: the boundary slides on its plane, .*; got 1"),
                        ({"normal": 0, "x": 0}, r"grip cut has normal and x: .*; hold other components by a"),
                        ({"normal": "0 MPa"}, r"grip cut, normal must be a quantity in mm/s")):
        with pytest.raises(ParameterError, match=f"^{said}"):
            read_tables("grips", [{**table, **wrong}])
    with pytest.raises(ParameterError, match=r"^tractions: unknown key 'normal'; the keys are boundary, x, y, z"):
        read_tables("tractions", [table])


def test_a_plane_normal_to_an_axis_is_the_component_held() -> None:
    """Fails if a symmetry plane along an axis is computed otherwise than the component that it holds."""
    space = box("hex", 2)
    one = Loading(space, [(side(space, "y-"), Sliding("y-"))])
    other = Loading(space, [(side(space, "y-"), Grip("y-", (None, 0.0, None)))])
    np.testing.assert_array_equal(one.free, other.free)
    assert one.sliding is None and other.sliding is None
