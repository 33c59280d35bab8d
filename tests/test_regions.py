"""Bodies of several materials: loops against the forms, layers in closed form, and runs."""

from __future__ import annotations

import copy
import dataclasses
import logging
import multiprocessing
from collections.abc import Sequence
from pathlib import Path

import meshio
import numpy as np
import pytest
import skfem
from bodies import Fracture, at_onset, box, close, ends, grid, held_body, momentum_of, notched, patchy, wavy
from dissipation import Energies, check_sink
from guarded import NOTCHED, Stop, Watched, scene, simulation
from scipy.optimize import brentq
from test_material_library import TISSUE, Hoops

from skfsink.errors import Interrupted, ParameterError
from skfsink.fem import indicators, kernels
from skfsink.fem.forms import density_forms, momentum_forms, plane_stress_forms
from skfsink.fem.pattern import Pattern
from skfsink.fem.space import Space
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.fields.state import State
from skfsink.fields.stress import cauchy_stress
from skfsink.material import AAA, GeneralMaterial, Material, MooneyRivlin, NeoHookean, SinkLaw
from skfsink.material.regions import Region
from skfsink.methods.controls import ExplicitControls, HHTControls
from skfsink.methods.explicit import Explicit
from skfsink.methods.hht import HHT
from skfsink.methods.statics import Statics
from skfsink.run.display import Display
from skfsink.run.observers.range import check_pressure, check_scene
from skfsink.run.simulate import Simulation
from skfsink.scene.fibres import with_fibres
from skfsink.scene.scene import Scene

STIFF, SOFT = NeoHookean(bulk_modulus=800.0, mu=4.0, density=2500.0), NeoHookean(bulk_modulus=40.0, mu=0.5)
LAW = SinkLaw()


def scattered(space: Space, *materials: Material) -> tuple[Region, ...]:
    """Elements drawn at random for each material; what is left is of another one."""
    part = np.random.default_rng(5).integers(0, len(materials) + 1, space.n_elements)
    return tuple(Region(f"r{i}", np.flatnonzero(part == i + 1), m, LAW) for i, m in enumerate(materials))


def where(space: Space, axis: int, beyond: float) -> np.ndarray:
    """Elements whose middle is beyond a place along an axis."""
    return np.flatnonzero(space.X[space.conn].mean(axis=1)[:, axis] > beyond)


# --- the loops ---
@pytest.mark.parametrize(("kind", "element"), [("quad", "jbar"), ("quad", "plain"), ("quad", "planestress"),
                                               ("hex", "jbar")])
def test_loops_equal_the_forms_of_each_material(kind: str, element: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if an element takes another material's law, constants, density or fibres, in any derivative.

    Of laws of I1' alone, of more invariants and of fibres in one body; tiles are partly filled, pieces several.
    """
    monkeypatch.setattr(kernels.pieces, "PIECE", {2: 7, 3: 7})
    space = box(kind, 16 if kind == "quad" else 3)
    others: list[Material] = [STIFF]
    if element != "planestress":
        others += [MooneyRivlin(bulk_modulus=30.0), Hoops(**TISSUE, bulk_modulus=50.0, density=900.0)]
    regions = scattered(space, *others)
    u, gamma = wavy(space, 0.1), patchy(space)
    momentum = momentum_of(space, AAA(), gamma, element, regions)
    pattern, n = Pattern(space, space.dim), u.size
    force, tangent, mass, W = np.zeros(n), np.zeros((n, n)), np.zeros((n, n)), np.zeros_like(gamma)
    rest = np.setdiff1d(np.arange(space.n_elements), np.concatenate([region.elements for region in regions]))
    for material, part in ((AAA(), rest), *((region.material, region.elements) for region in regions)):
        basis = skfem.Basis(space.mesh, space.u_basis.elem, quadrature=space.rule(), elements=part)
        forms = (plane_stress_forms(material) if element == "planestress"
                 else momentum_forms(material, j_bar=element == "jbar"))
        fields = {"displacement": u.ravel(), "gamma": gamma[part], "dV": basis.dx}
        F = space.deformation_gradient(u)[part]
        J, more = np.linalg.det(F), {}
        if isinstance(material, GeneralMaterial):
            fibres = material.fibres(space.X[space.conn[part]].mean(axis=1))
            more = {"fibres": np.repeat(fibres[:, None], gamma.shape[1], axis=1)}
        if element == "planestress":
            F = material.thin_sheet(F[..., :2, :2])
            J = np.linalg.det(F)
        J_bar = np.broadcast_to(space.element_mean(np.linalg.det(space.deformation_gradient(u)))[part][:, None],
                                J.shape) if element == "jbar" else J
        W[part] = material.energy(F, J_bar, **more)
        force += forms.residual.assemble(basis, **fields, **more)
        tangent += forms.tangent.assemble(basis, **fields, **more).toarray()
        mass += forms.mass.assemble(basis, gamma=gamma[part]).toarray()
    close(momentum.force(u).ravel(), force, 1e-10 if element == "planestress" else 1e-12)
    close(momentum.W, W, 1e-10)
    assert momentum.energy == pytest.approx(float((space.w * gamma * W).sum()), rel=1e-11)
    close(pattern.matrix(momentum.tangent(pattern, u)).toarray(), tangent, 1e-9 if element == "planestress" else 1e-12)
    close(pattern.matrix(momentum.consistent_mass(pattern)).toarray(), mass)
    close(np.repeat(momentum.lumped_mass(0.0), space.dim), mass.sum(axis=1))
    densities = np.full(space.n_elements, AAA().rho0)
    for region in regions:
        densities[region.elements] = region.material.rho0
    intact = momentum_of(space, AAA(), np.ones_like(gamma), element, regions).lumped_mass(0.0)
    assert intact.sum() == pytest.approx(densities @ space.V, rel=1e-13)


@pytest.mark.parametrize("element", ["jbar", "plain"])
def test_force_and_tangent_are_derivatives_of_the_energy(kind: str, element: str) -> None:
    """Fails if the force is not the slope of the energy of all parts, or the tangent that of the force."""
    space = box(kind, 3 if kind == "quad" else 2, 0.15)
    momentum = momentum_of(space, AAA(bulk_modulus=9.0), np.random.default_rng(1).uniform(0.1, 1, space.w.shape),
                           element, scattered(space, SOFT, MooneyRivlin(bulk_modulus=30.0)))
    u, pattern = wavy(space, 0.1), Pattern(space, space.dim)
    force, K = momentum.force(u), pattern.matrix(momentum.tangent(pattern, u))

    def central(h: float, d: np.ndarray) -> tuple[np.ndarray, float]:
        up, e = momentum.force(u + h * d), momentum.energy
        return (up - momentum.force(u - h * d)) / (2 * h), (e - momentum.energy) / (2 * h)

    for seed in range(3):
        d = np.random.default_rng(seed).normal(size=u.shape)
        (f1, e1), (f2, e2) = central(1e-4, d), central(2e-4, d)
        close((K @ d.ravel()).reshape(u.shape), (4 * f1 - f2) / 3, 1e-8)
        assert (4 * e1 - e2) / 3 == pytest.approx(float(np.vdot(force, d)), abs=1e-8 * np.linalg.norm(force))


@pytest.mark.parametrize("element", ["jbar", "planestress"])
def test_a_body_divided_in_name_only_is_the_same(kind: str, element: str) -> None:
    """Fails if dividing a body changes anything but the order of sums: 1e-13."""
    if (kind, element) == ("hex", "planestress"):
        pytest.skip("sheets are plane")
    space = box(kind, 13 if kind == "quad" else 5)
    nodal = np.random.default_rng(0).uniform(0, 1, space.n_nodes)
    deleted = np.arange(space.n_elements) % 5 == 0
    u, pattern, results = wavy(space, 0.2), Pattern(space, space.dim), []
    for regions in ((), scattered(space, AAA(), AAA())):
        momentum = Momentum(space, AAA(), element, regions=regions)
        momentum.force(u)
        taken = momentum.set_gamma(nodal, deleted)
        inverse = np.random.default_rng(4).uniform(0, 2, space.X.shape)
        results.append([momentum.force(u), momentum.W, momentum.gamma, momentum.lumped_mass(0.1),
                        momentum.tangent(pattern, u), momentum.tangent(pattern, u, convex=True),
                        cauchy_stress(momentum, u), momentum.consistent_mass(pattern), np.array([taken]),
                        np.array([momentum.energy]), np.array([momentum.stiffest(u, inverse)]),
                        np.array([momentum.backend.mean_force()])])
        tiles = momentum.backend
        np.testing.assert_array_equal(tiles.untile(tiles.tile(space.w)), space.w)
    for one, two in zip(*results):
        close(two, one, 1e-13)


def test_the_indicator_takes_the_stiffest_part() -> None:
    """Fails if the bulk modulus of another part, or of one part only, decides the indicator of the frequency."""
    space = box("quad", 13)
    regions = scattered(space, STIFF)
    momentum, ones = Momentum(space, AAA(), regions=regions), np.ones_like(space.X)
    parts = [Momentum(space, m) for m in (AAA(), STIFF)]
    elements = (np.setdiff1d(np.arange(space.n_elements), regions[0].elements), regions[0].elements)
    greatest = []
    for part, own in zip(parts, elements):
        gamma = np.zeros_like(space.w)
        gamma[own] = 1.0
        part.backend.set_gamma(gamma)
        greatest.append(part.stiffest(0 * ones, ones))
    assert momentum.stiffest(0 * ones, ones) == pytest.approx(max(greatest), rel=1e-12)
    assert greatest[1] > 1.3 * greatest[0]


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="no forks here")
@pytest.mark.filterwarnings("ignore:.*multi-threaded, use of fork:DeprecationWarning")
def test_a_forked_process_has_threads_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a forked process waits for threads that it has not."""
    monkeypatch.setattr(kernels.Tiles, "WORTH", 0)
    space = box("quad", 13)
    momentum, u = Momentum(space, AAA(), threads=2), wavy(space, 0.1)
    momentum.force(u)
    child = multiprocessing.get_context("fork").Process(target=momentum.force, args=(u,))
    child.start()
    child.join(60)
    hung = child.is_alive()
    child.kill()
    assert not hung
    assert child.exitcode == 0


def test_parts_shared_by_threads(monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    """Fails if results depend on the number of threads."""
    monkeypatch.setattr(kernels.Tiles, "WORTH", 0)
    space = box(kind, 13 if kind == "quad" else 5)
    u, gamma, regions = wavy(space, 0.1), patchy(space), scattered(space, SOFT, MooneyRivlin())
    one, two = (momentum_of(space, AAA(), gamma, regions=regions, threads=threads) for threads in (1, 2))
    np.testing.assert_array_equal(one.force(u), two.force(u))
    ones = np.ones_like(u)
    assert (one.energy, one.least_J, one.stiffest(u, ones)) == (two.energy, two.least_J, two.stiffest(u, ones))


# --- the density ---
def test_density_equals_the_form_and_keeps_its_bounds(kind: str) -> None:
    """Fails if an element takes the limiter of another part, or the lumped solution leaves (0, 1]."""
    space = box(kind, 12 if kind == "quad" else 5, 0.1)
    laws = SinkLaw(length_scale=0.3), SinkLaw(phi=0.05, m=3.5, length_scale=0.3), SinkLaw(phi=1.0, length_scale=0.3)
    regions = tuple(dataclasses.replace(region, sink_law=law)
                    for region, law in zip(scattered(space, AAA(), AAA()), laws[1:]))
    W = np.random.default_rng(2).uniform(0, 0.2, space.w.shape)
    H = laws[0].history(W)
    for region in regions:
        H[region.elements] = region.sink_law.history(W[region.elements])
    solver = DensitySolver(space, laws[0], tolerance=1e-11, regions=regions)
    gamma = solver.solve(W, np.ones(space.n_nodes))
    A = solver.pattern.matrix(solver._laplacian).toarray() + np.diag(space.lump(1 / (H + 1e-15)))
    close(gamma, np.linalg.solve(A, space.lump(np.ones_like(W))), 1e-8)
    assert 0 < gamma.min() < 0.1 and gamma.max() <= 1
    consistent = DensitySolver(space, laws[0], "consistent", regions=regions)
    mild = np.minimum(W, 0.05)
    H = laws[0].history(mild)
    for region in regions:
        H[region.elements] = region.sink_law.history(mild[region.elements])
    np.testing.assert_array_equal(consistent.coefficients(mild), 1 / (H + 1e-15))
    form = density_forms(0.3, 1e-15).matrix.assemble(space.gamma_basis, history=H)
    close(consistent.pattern.matrix(consistent._assemble(consistent.coefficients(mild))), form)
    for e in (*regions[0].elements[:1], *regions[1].elements[:1]):
        law = regions[0].sink_law if e in regions[0].elements else regions[1].sink_law
        assert (solver.phi[e, 0], solver.failure_energy[e]) == (law.phi, law.failure_energy)
    assert DensitySolver(space, laws[0]).phi == laws[0].phi


# --- layers in closed form ---
def equilibrium(space: Space, held: np.ndarray, u: np.ndarray,
                regions: Sequence[Region]) -> tuple[Momentum, np.ndarray]:
    """Equilibrium from `u` with the degrees of freedom `held` (n, dim), and the displacement."""
    momentum = Momentum(space, SOFT, regions=regions)
    statics = Statics(held_body(momentum, DensitySolver(space, LAW), ~held.ravel(), np.zeros_like(u)))
    statics.newton.tolerance = 1e-11
    return momentum, statics.equilibrium(u)[0]


def test_layers_side_by_side_have_the_same_stretch() -> None:
    """Fails if a layer bears another stress than its material alone, free to contract, at the common stretch.

    Plane strain; the load is the sum over the layers, and the Cauchy stress for the files that of each.
    """
    space, stretch = Space(grid("quad", (8, 4))), 1.3
    stiff = where(space, 0, 0.75)
    low, high = ends(space)
    held = np.zeros(space.X.shape, bool)
    held[low | high, 1] = True
    held[np.isclose(space.X[:, 0], 0.0), 0] = True
    u = space.X * [-0.2, stretch - 1]
    momentum, u = equilibrium(space, held, u, [Region("stiff", stiff, STIFF, LAW)])
    load, sigma = 0.0, cauchy_stress(momentum, u)
    for material, width, e in ((SOFT, 0.75, 0), (STIFF, 0.25, stiff[0])):
        across = brentq(lambda a, m=material: m.first_piola(np.diag([a, stretch, 1.0]))[0, 0], 0.5, 1.0, xtol=1e-14)
        F = np.diag([across, stretch, 1.0])
        load += width * material.first_piola(F)[1, 1]
        exact = material.first_piola(F) @ F.T / np.linalg.det(F)
        np.testing.assert_allclose(sigma[e, [1, 2]], exact[[1, 2], [1, 2]], rtol=1e-8)
    assert momentum.force(u)[high, 1].sum() == pytest.approx(load, rel=1e-9)


def test_layers_in_series_have_the_same_stress(kind: str) -> None:
    """Fails if stretches share otherwise than at one nominal stress, in layers that may not contract."""
    dim = 2 if kind == "quad" else 3
    shape = (3, 8) if dim == 2 else (2, 8, 2)
    space, mean = Space(grid(kind, shape)), 1.2
    stiff = where(space, 1, 0.5)
    low, high = ends(space)
    held = np.ones(space.X.shape, bool)
    held[:, 1] = low | high
    u = np.zeros_like(space.X)
    u[:, 1] = (mean - 1) * space.X[:, 1]
    momentum, u = equilibrium(space, held, u, [Region("stiff", stiff, STIFF, LAW)])

    def stress(material: Material, stretch: float) -> float:
        return float(material.first_piola(np.diag([1.0, stretch, 1.0]))[1, 1])

    soft = brentq(lambda s: stress(SOFT, s) - stress(STIFF, 2 * mean - s), mean, 2 * mean - 1, xtol=1e-14)
    assert soft - 1 > 5 * (2 * mean - soft - 1)
    stretches = 1 + space.gradient(u)[:, :, 1, 1]
    np.testing.assert_allclose(stretches[stiff], 2 * mean - soft, rtol=1e-10)
    np.testing.assert_allclose(np.delete(stretches, stiff, axis=0), soft, rtol=1e-10)
    assert momentum.force(u)[high, 1].sum() == pytest.approx(stress(SOFT, soft), rel=1e-9)


# --- where it cracks ---
def test_a_strip_cracks_in_its_weaker_half() -> None:
    """Fails if a half takes the other one's limiter: the onset is the greatest load of the weaker half alone.

    It may not contract, so that all is uniform in a half but for some lengths l around the middle; the passes kill
    elements of that half only, and book each with its own psi_f.
    """
    space = Space(grid("quad", (2, 40), (0.1, 2.0)))
    law, weaker = SinkLaw(phi=0.2, length_scale=0.05), SinkLaw(phi=0.1, m=8.0, length_scale=0.05)
    material = AAA(bulk_modulus=2.0)
    weak = where(space, 1, 1.0)
    regions = [Region("weak", weak, material, weaker)]
    momentum, density = Momentum(space, material, regions=regions), DensitySolver(space, law, regions=regions)
    low, high = ends(space)
    free, velocity = np.zeros(space.X.shape, bool), np.zeros_like(space.X)
    free[:, 1] = ~(low | high)
    velocity[low, 1], velocity[high, 1] = -1e-3, 1e-3
    statics, state = Statics(held_body(momentum, density, free.ravel(), velocity)), State.intact(space)
    for _ in statics.load(state):
        pass
    F = np.zeros((4001, 3, 3))
    F[:] = np.eye(3)
    F[:, 1, 1] = np.linspace(1, 1.5, 4001)
    stress, W = material.first_piola(F)[:, 1, 1], material.energy(F)
    peak = 0.1 * (weaker.history(W) * stress).max()
    assert momentum.force(state.u)[high, 1].sum() == pytest.approx(peak, rel=2e-3)
    assert peak < 0.8 * 0.1 * (law.history(W) * stress).max()
    assert np.argmin(state.gamma) in space.conn[weak]
    state.u *= 1.005
    state.grip *= 1.005
    state.step, state.ledger = 0, type(state.ledger)()
    for _ in statics.propagate(state):
        if state.deleted.any():
            break
    failed = np.flatnonzero(state.deleted)
    assert np.isin(failed, weak).all()
    assert state.ledger.paper == pytest.approx(weaker.failure_energy * space.V[failed].sum(), rel=1e-12)


def test_sweeps_wait_by_the_limiter_of_each_part() -> None:
    """Fails if points wait by their energy, where what counts is how far it is past the limiter of their material."""
    space = box("quad", 2)
    regions = [Region("weak", np.array([0]), AAA(), SinkLaw(phi=0.05))]
    statics = Statics(held_body(Momentum(space, AAA()), DensitySolver(space, SinkLaw(phi=0.5), regions=regions),
                                np.ones(2 * space.n_nodes, bool), np.zeros_like(space.X)))
    state, W = State.intact(space), np.zeros_like(space.w)
    W[0], W[1], W[2], W[3] = 0.15, 0.6, 1.45, 0.4       # 3, 1.2, 2.9 and 0.8 times their limiters
    assert statics._follow(state, W)
    np.testing.assert_array_equal(state.W_max[:, 0], [0.15, 0.0, 1.45, 0.4])


# --- events ---
SPACE = notched(15)
STRONGER = SinkLaw(phi=0.2)


@pytest.fixture(scope="module")
def layered() -> Fracture:
    """The plate just past its onset; its right-hand third is heavier, stiffer and stronger."""
    return at_onset(SPACE, regions=[Region("right", where(SPACE, 0, 0.67), STIFF, STRONGER)])


def booked(space: Space, state: State) -> float:
    """U from the list of failed elements."""
    right = np.isin(np.arange(space.n_elements), where(space, 0, 0.67))
    energy = np.where(right, STRONGER.failure_energy, LAW.failure_energy)
    return float((energy * space.V)[state.deleted].sum())


def test_explicit_energies_in_two_materials(layered: Fracture) -> None:
    """Fails if energy, mass, sink or deletion takes another element's material: D is held against the fields, with the
    energies of each material. Seen to fail with the density of the body in all of it."""
    body, state = layered.body, layered.fresh()
    explicit, energies = Explicit(body, ExplicitControls(courant=0.4)), Energies(body)
    explicit.begin(state)
    moments = [energies.of(state)]
    for _ in explicit.run(state, 4e-5):
        moments.append(energies.of(state))
    ledger = state.ledger
    check_sink(body, ledger, moments)
    assert ledger.elastic == pytest.approx(energies.elastic(moments[-1]), rel=1e-9)
    assert ledger.kinetic == pytest.approx(energies.kinetic(moments[-1]), abs=2e-3 * ledger.initial)
    assert state.deleted.sum() > 5 and abs(ledger.numerical) < 0.01 * ledger.initial
    assert ledger.paper == pytest.approx(booked(body.space, state), rel=1e-12)
    assert state.gamma.min() > 0 and state.gamma.max() <= 1 + 1e-9


@pytest.mark.parametrize(("mass", "end"), [("lumped", 1.2e-5), ("consistent", 8e-6)])
def test_hht_ledger_closes_in_two_materials(layered: Fracture, mass: str, end: float) -> None:
    """Fails as the explicit one does, with the tangent and mass of each material: 1e-8 with converged steps."""
    fresh, momentum, density, free, velocity = layered
    state = fresh()
    hht = HHT(held_body(momentum, density, free, velocity), HHTControls(
        dt=4e-7, mass=mass, force_tolerance=1e-8, correction_tolerance=1e-8, gamma_tolerance=1e-7))
    hht.begin(state)
    for _ in hht.run(state, end):
        assert abs(state.ledger.balance) <= 1e-8 * state.ledger.initial
    assert state.deleted.any() and state.ledger.sink > 0.05 * state.ledger.initial
    assert state.ledger.paper == pytest.approx(booked(momentum.space, state), rel=1e-12)


def test_an_event_does_not_see_a_division_in_name_only(fracture: Fracture) -> None:
    """Fails if regions of one material change a fracture by more than rounding, which an event multiplies."""
    fresh, _, _, free, velocity = fracture
    ends_ = []
    for regions in ((), scattered(SPACE, AAA(), AAA())):
        state = fresh()
        explicit = Explicit(held_body(Momentum(SPACE, AAA(), regions=regions),
                                      DensitySolver(SPACE, LAW, regions=regions), free, velocity))
        explicit.begin(state)
        for _ in explicit.run(state, 2e-5):
            pass
        ends_.append(state)
    one, two = ends_
    assert one.step == two.step and one.deletions and [e for _, e in one.deletions] == [e for _, e in two.deletions]
    close(two.u, one.u, 1e-8)
    close(two.gamma, one.gamma, 1e-8)


# --- runs ---
def two_materials(**controls: object) -> Scene:
    """The small notched block, stronger and stiffer above, for the explicit event."""
    space = NOTCHED.sample.space
    return dataclasses.replace(scene(NOTCHED.sample, event_time=1.5e-5, frame_every=5e-6, **controls), regions=(
        Region("upper", where(space, 1, 0.6), STIFF, STRONGER),))


@pytest.mark.parametrize("integrator", ["explicit", pytest.param("hht", marks=pytest.mark.slow)])
def test_a_resumed_run_ends_with_the_same_bytes(integrator: str, tmp_path: Path) -> None:
    """Fails if a region is not in the fingerprint, or a step depends on what a checkpoint of several parts lacks.

    Frames have the number of the region.
    """
    of = two_materials(integrator=integrator)
    for name in ("whole", "parted"):
        (tmp_path / name).mkdir()
    whole = simulation(of, tmp_path / "whole")
    whole.run()
    parted = simulation(of, tmp_path / "parted", Stop(150 if integrator == "explicit" else 25))
    with pytest.raises(Interrupted):
        parted.run()
    Simulation(of, tmp_path / "parted", Display(True), resume=True).run()
    for name in ("history.csv", "deletions.csv"):
        assert (tmp_path / "whole" / name).read_bytes() == (tmp_path / "parted" / name).read_bytes()
    numbers = meshio.read(tmp_path / "whole" / "series" / "run_0000.vtu").cell_data["region"][0]
    assert np.flatnonzero(numbers).tolist() == of.regions[0].elements.tolist() and numbers.max() == 1
    other = dataclasses.replace(of, regions=(dataclasses.replace(of.regions[0], material=SOFT),))
    assert len({of.fingerprint, other.fingerprint, dataclasses.replace(of, regions=()).fingerprint}) == 3


# --- guards ---
def test_warnings_name_the_region(caplog: pytest.LogCaptureFixture) -> None:
    """Fails if a warning looks at one material only, or does not say which one it means."""
    space = scene().sample.space
    nearly = Region("rubber", np.arange(20), AAA(bulk_modulus=1e5), LAW)
    check_scene(dataclasses.replace(scene(material=SOFT, element="plain"), regions=(nearly,)))
    assert "locks at k/mu = 8.104e+04 (above 50) in region rubber" in caplog.text
    assert "k/mu = 8.1e+04 in region rubber is so large" in caplog.text
    caplog.clear()
    rubber = Region("rubber", np.arange(space.n_elements - 20), SOFT, LAW)
    check_scene(dataclasses.replace(scene(element="plain"), regions=(rubber,)))
    assert "(above 50) outside of the regions" in caplog.text


def test_a_jump_of_pressure_between_materials_is_no_checkerboard(caplog: pytest.LogCaptureFixture) -> None:
    """Fails if the guard takes what materials do at their faces for alternation, or misses it inside one."""
    space = scene().sample.space
    upper = where(space, 1, 0.5)
    of = dataclasses.replace(scene(material=SOFT), regions=(Region("upper", upper, STIFF, LAW),))
    watched = Watched(of)
    watched.state.u = space.X * np.array([0.0, 0.01])
    with caplog.at_level(logging.WARNING):
        check_pressure(of, watched.state)
    assert caplog.text == ""
    pressure = np.where(np.isin(np.arange(space.n_elements), upper), 8.0, 0.4)
    assert indicators.alternation(space, pressure) > 0.5
    assert indicators.alternation(space, pressure, upper) == pytest.approx(0.0, abs=1e-12)
    columns = np.round(space.X[:, 0] * 15).astype(int)
    watched.state.u = space.X * np.array([0.0, 0.0]) + np.stack([0.01 * (columns % 2) / 15, 0 * columns], axis=1)
    with caplog.at_level(logging.WARNING):
        check_pressure(of, watched.state)
    assert "in region upper" in caplog.text


# --- refused ---
@pytest.mark.parametrize(("regions", "message"), [
    ([("a", [], LAW)], "region a has no elements"),
    ([("a", [0.0, 1.0], LAW)], "elements of region a must be a list of whole numbers"),
    ([("a", [3, 225], LAW)], "region a has the element 225; those of the mesh are 0 to 224"),
    ([("a", [-1, 4], LAW)], "region a has the element -1"),
    ([("a", [3, 4, 5], LAW), ("b", [9, 5, 4], LAW)], "regions a and b overlap: 2 element.s. are in both, such as 4"),
    ([("a", [3], SinkLaw(length_scale=0.2))], "region a has the length_scale 0.2 mm, the body 0.1 mm"),
    ([("a", [3], SinkLaw(epsilon=1e-12))], "region a has the epsilon 1e-12, the body 1e-15"),
])
def test_regions_that_are_refused(regions: list[tuple[str, list[int], SinkLaw]], message: str) -> None:
    """Fails if a region without a meaning is taken, or the message is more than one line."""
    with pytest.raises(ParameterError, match=message) as error:
        dataclasses.replace(scene(), regions=tuple(
            Region(name, np.array(elements), AAA(), law) for name, elements, law in regions))
    assert "\n" not in str(error.value)


def test_a_region_given_twice_is_refused() -> None:
    """Fails if one of two tables of a region is taken in silence."""
    twice = [Region("a", np.array([3]), AAA(), LAW), Region("b", np.array([4]), AAA(), LAW),
             Region("a", np.array([3]), SOFT, LAW)]
    with pytest.raises(ParameterError, match="region a is there twice: leave one out"):
        with_fibres((), scene().sample, AAA(), twice, False)
    assert with_fibres((), scene().sample, AAA(), twice[:2], False)[1] == tuple(twice[:2])


def test_a_body_may_be_covered_by_its_regions() -> None:
    """Fails if a body without a rest asks for its material, in loops, masses, wave speeds or the density."""
    space = box("quad", 9)
    half = where(space, 0, 0.5)
    other = np.setdiff1d(np.arange(space.n_elements), half)
    regions = (Region("one", half, SOFT, LAW), Region("two", other, STIFF, LAW))
    covered, left = Momentum(space, AAA(), regions=regions), Momentum(space, STIFF, regions=regions[:1])
    u, W = wavy(space, 0.1), np.random.default_rng(0).uniform(0, 0.2, space.w.shape)
    close(covered.force(u), left.force(u))
    close(covered.lumped_mass(0.0), left.lumped_mass(0.0))
    assert covered.shear_wave_speeds == left.shear_wave_speeds and covered.shear_moduli == (0.5, 4.0)
    state = np.ones(space.n_nodes)
    np.testing.assert_array_equal(DensitySolver(space, LAW, regions=regions).solve(W, state),
                                  DensitySolver(space, LAW).solve(W, copy.copy(state)))
