"""Thin sheets: the plane-stress quadrilateral against its forms, its own derivatives, closed forms, and solid slabs."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
from bodies import (
    boundary,
    box,
    close,
    distorted,
    ends,
    greatest_square,
    grid,
    grips,
    held_body,
    notched,
    patchy,
    pulled_sheet_and_slab,
    wavy,
)
from plates import plate
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from skfsink.cases.cylindrical_shell import cylindrical_shell
from skfsink.cases.dog_bone import CASE as DOG_BONE
from skfsink.cases.dog_bone import dog_bone
from skfsink.errors import ParameterError
from skfsink.fem import kernels
from skfsink.fem.forms import plane_stress_forms
from skfsink.fem.kernels import plane_stress
from skfsink.fem.pattern import Pattern
from skfsink.fem.space import Space
from skfsink.fields.density import DensitySolver
from skfsink.fields.energy import Ledger
from skfsink.fields.momentum import Momentum
from skfsink.fields.state import State
from skfsink.material import AAA, Material, NeoHookean, SinkLaw
from skfsink.meshing.sample import _from_meshio
from skfsink.methods.explicit import Explicit
from skfsink.methods.frequency import highest_frequency
from skfsink.methods.newton import Newton
from skfsink.methods.statics import Statics
from skfsink.results import reference
from skfsink.run.display import Display
from skfsink.run.simulate import Simulation
from skfsink.scene.options import Options

ROUNDING = 1e-12
both_materials = pytest.mark.parametrize("material", [AAA(), NeoHookean(bulk_modulus=40.0)], ids=["AAA", "NeoHookean"])


def sheet(space: Space, gamma: np.ndarray | float = 1.0, material: Material | None = None) -> Momentum:
    """Momentum balance in plane stress with the densities `gamma` (ne, nq) set directly at the Gauss points."""
    momentum = Momentum(space, material or AAA(), "planestress")
    momentum.gamma = np.broadcast_to(gamma, space.w.shape).copy()
    momentum.backend.set_gamma(momentum.gamma)
    return momentum


# --- the stretch across the sheet ---
@both_materials
@pytest.mark.parametrize(("low", "high", "tolerance"), [(0.3, 3.0, 1e-12), (0.02, 0.3, 1e-6), (3.0, 30.0, 1e-12)])
def test_no_stress_across_the_sheet(material: Material, low: float, high: float, tolerance: float):
    """Fails if the Newton steps end before P33 = 0, in tension or crushed; relative to its two parts."""
    rng = np.random.default_rng(5)
    j, q = np.exp(rng.uniform(np.log(low), np.log(high), 2000)), np.exp(rng.uniform(-0.5, 0.5, 2000))
    t = j * (q**2 + q**-2)
    inv_j, y, p, s, i1, psi, dpsi, ddpsi = (np.empty(2000) for _ in range(8))
    plane_stress._thin(material.compiled_law, material.constants, material.bulk_modulus, t, j, inv_j, y, p, s, i1, psi,
                       dpsi, ddpsi)
    F = np.zeros((2000, 3, 3))
    F[:, 0, 0], F[:, 1, 1], F[:, 2, 2] = np.sqrt(j) * q, np.sqrt(j) / q, y**3 / j
    P = material.first_piola(F)[:, 2, 2]
    parts = (np.abs(4 * s - 2 * p) * dpsi / 3 + material.bulk_modulus * y**6) / F[:, 2, 2]
    assert (np.abs(P) <= tolerance * parts).all()
    np.testing.assert_allclose(material.thin_sheet(F[:, :2, :2])[:, 2, 2], F[:, 2, 2], rtol=tolerance)


# --- equal to the weak forms ---
@both_materials
def test_force_energy_and_tangent_equal_the_forms(material: Material):
    """Fails if a loop and its form differ: stress, stored energy, condensed tangent, dead and soft points, tiles."""
    space = box("quad", 9)  # 81 elements: two tiles, the last partly filled
    u, gamma = wavy(space, 0.25), patchy(space)
    momentum, forms, basis = sheet(space, gamma, material), plane_stress_forms(material), space.u_basis
    fields = {"displacement": u.ravel(), "gamma": gamma}
    close(momentum.force(u).ravel(), forms.residual.assemble(basis, **fields))
    F = np.eye(2) + space.gradient(u)
    W = material.energy(material.thin_sheet(F))
    close(momentum.W, W)
    assert momentum.energy == pytest.approx(float((space.w * gamma * W).sum()), rel=1e-12)
    assert momentum.least_J == pytest.approx(np.linalg.det(F)[gamma > 0].min(), rel=1e-12)
    K = Pattern(space, 2).matrix(momentum.tangent(Pattern(space, 2), u))
    close(K, forms.tangent.assemble(basis, **fields))
    assert abs(K - K.T).max() <= ROUNDING * abs(K).max()


@both_materials
def test_the_forms_are_those_of_a_solid_with_free_faces(material: Material):
    """Fails if the forms, which take W(t, j), have another stress or condensed modulus than F in space with P33 = 0."""
    space = box("quad", 5)
    u, gamma = wavy(space, 0.25), patchy(space)
    F = material.thin_sheet(np.eye(2) + space.gradient(u))
    A = material.modulus(F)
    A = (A[..., :2, :2, :2, :2]
         - np.einsum("...iJ,...kL->...iJkL", A[..., :2, :2, 2, 2], A[..., 2, 2, :2, :2]) / A[..., 2:, 2:, 2:, 2:])
    weight, forms, basis = space.w * gamma, plane_stress_forms(material), space.u_basis
    force = np.einsum("eq,eqiJ,eqaJ->eai", weight, material.first_piola(F)[..., :2, :2], space.dN)
    tangent = np.einsum("eq,eqaJ,eqiJkL,eqbL->eaibk", weight, space.dN, A, space.dN)
    fields = {"displacement": u.ravel(), "gamma": gamma}
    close(forms.residual.assemble(basis, **fields),
          np.bincount(space.element_dofs.ravel(), force.ravel()))
    soft = np.where(gamma < kernels.SOFT_GAMMA, kernels.ERSATZ_STIFFNESS * material.shear_modulus, 0.0)
    tangent += np.einsum("eq,eqaJ,eqbJ,ik->eaibk", space.w * soft, space.dN, space.dN, np.eye(2))
    dofs = space.element_dofs
    K = np.zeros((u.size, u.size))
    np.add.at(K, (dofs[:, :, None], dofs[:, None, :]), tangent.reshape(len(dofs), 8, 8))
    close(forms.tangent.assemble(basis, **fields).toarray(), K)


# --- derivatives ---
def test_force_is_the_derivative_of_the_energy():
    """Fails if the stretch across the sheet is not where the energy is least: differences of the energy, to 1e-8."""
    space = box("quad", 5)
    momentum, u = sheet(space, patchy(space)), wavy(space, 0.2)
    force = momentum.force(u)
    for seed in range(4):
        d = np.random.default_rng(seed).normal(size=u.shape)

        def slope(h: float, d: np.ndarray = d) -> float:
            momentum.force(u + h * d)
            up = momentum.energy
            momentum.force(u - h * d)
            return (up - momentum.energy) / (2 * h)

        rate = (4 * slope(1e-4) - slope(2e-4)) / 3
        assert rate == pytest.approx(float(np.vdot(force, d)), abs=1e-8 * np.linalg.norm(force))


@both_materials
def test_tangent_is_the_derivative_of_the_force(material: Material):
    """Fails if condensing the stretch leaves out a term: differences of the force agree to 1e-8."""
    space = box("quad", 2, 0.25)
    momentum = sheet(space, np.random.default_rng(1).uniform(kernels.SOFT_GAMMA, 1, space.w.shape), material)
    u, pattern = wavy(space, 0.25), Pattern(space, 2)
    K = pattern.matrix(momentum.tangent(pattern, u)).toarray()
    difference = np.empty_like(K)
    for i in range(u.size):
        d = np.zeros(u.size)
        d[i] = 1.0
        d = d.reshape(u.shape)
        slopes = [(momentum.force(u + h * d) - momentum.force(u - h * d)) / (2 * h) for h in (2e-4, 1e-4)]
        difference[:, i] = ((4 * slopes[1] - slopes[0]) / 3).ravel()
    close(difference, K, 1e-8)


def test_convex_tangent():
    """Fails if bounding it changes the tangent of a sheet in tension, or leaves a crushed one indefinite."""
    space = box("quad", 5)
    pattern = Pattern(space, 2, np.repeat(~ends(space)[0], 2), upper=True)
    momentum, rng = sheet(space), np.random.default_rng(0)
    for u in (np.zeros_like(space.X), space.X * [0.3, -0.1], space.X * [-0.08, 0.2] + wavy(space, 0.01)):
        close(momentum.tangent(pattern, u, convex=True), momentum.tangent(pattern, u))
    for size in (0.0, 0.1, 0.3):
        u = space.X * [0.0, -0.3] + wavy(space, size)
        exact, convex = (pattern.symmetric(momentum.tangent(pattern, u, c)).toarray() for c in (False, True))
        assert np.linalg.eigvalsh(exact)[0] < 0 < np.linalg.eigvalsh(convex)[0]
    one = Space(grid("quad", (1, 1)))
    whole = Pattern(one, 2)
    for material in (AAA(), NeoHookean(bulk_modulus=10.0)):
        for j, q in np.exp(rng.uniform([np.log(0.1), -1], [np.log(4), 1], (200, 2))):
            u = one.X * (np.sqrt(j) * np.array([q, 1 / q]) - 1)
            eigenvalues = np.linalg.eigvalsh(whole.matrix(sheet(one, 1.0, material).tangent(whole, u, True)).toarray())
            assert eigenvalues[0] > -1e-12 * eigenvalues[-1]


# --- physics ---
def test_force_turns_with_the_sheet():
    """Fails if the force is not objective, or a rigid motion of the undeformed sheet gives any."""
    space = box("quad", 5)
    momentum, Q = sheet(space, patchy(space)), Rotation.from_rotvec([0, 0, 2.0]).as_matrix()[:2, :2]
    x = space.X + wavy(space, 0.2)
    force, energy = momentum.force(x - space.X), momentum.energy
    close(momentum.force(x @ Q.T + 0.3 - space.X), force @ Q.T)
    assert momentum.energy == pytest.approx(energy, rel=1e-12)
    rigid = momentum.force(space.X @ Q.T - space.X)
    assert abs(rigid).max() <= 1e-12 * momentum.material.shear_modulus * space.h.max()


def test_patch():
    """Fails if a homogeneous finite deformation of a distorted mesh leaves forces inside, or misses W V or P N."""
    space, material = box("quad", 5), AAA()
    momentum = sheet(space, 0.7)
    F = np.array([[1.25, 0.1], [-0.2, 0.9]])
    force = momentum.force(space.X @ (F - np.eye(2)).T)
    thin = material.thin_sheet(F)
    assert abs(force[~boundary(space)]).max() <= ROUNDING * abs(force).max()
    assert momentum.energy == pytest.approx(0.7 * float(material.energy(thin)), rel=1e-12)
    close(np.einsum("ai,aJ->iJ", force, space.X), 0.7 * material.first_piola(thin)[:2, :2])


def uniaxial(material: Material, stretch: float) -> float:
    """Nominal stress [MPa] of a bar with free sides, from one scalar equation."""
    def side(b: float) -> float:
        return float(material.first_piola(np.diag([b, stretch, b]))[0, 0])

    b = brentq(side, 0.5, 1.5, xtol=1e-15)
    return float(material.first_piola(np.diag([b, stretch, b]))[1, 1])


@pytest.mark.parametrize(("bulk_modulus", "peak"), [(5e5, 1.413), (500.0, 1.410)])
def test_strip_in_tension_follows_the_exact_curve_to_its_peak(bulk_modulus: float, peak: float):
    """Fails if the sheet does not thin freely: stress of a bar at every stretch, Cauchy peak at 1.248.

    The bulk modulus of the tissue lowers the peak of 1.413 MPa, that of an incompressible bar, a little.
    """
    material, law = AAA(bulk_modulus), SinkLaw()
    space = Space(distorted(grid("quad", (3, 3)), 0.2))
    momentum = sheet(space, 1.0, material)
    low, high = ends(space)
    free = np.ones(space.X.shape, bool)
    free[low | high, 1] = False
    free[0, 0] = False
    newton, u = Newton(momentum, free.ravel(), 1e-10, 60), np.zeros_like(space.X)
    cauchy, stretches = [], np.linspace(1.2, 1.3, 51)
    for stretch in stretches:
        u[high, 1] = stretch - 1
        u, force = newton.equilibrium(u)
        nominal = float(force[high, 1].sum())
        assert nominal == pytest.approx(uniaxial(material, stretch), rel=1e-8)
        assert np.ptp(momentum.W) < 1e-8
        width = np.ptp((space.X + u)[low, 0])  # and thickness
        cauchy.append(float(law.history(momentum.W).mean()) * nominal / width**2)
    assert stretches[np.argmax(cauchy)] == pytest.approx(1.248, abs=0.003)
    assert max(cauchy) == pytest.approx(peak, abs=0.001)


@pytest.mark.parametrize(("bulk_modulus", "peak"), [(5e5, 1.215), (500.0, 1.208)])
def test_equibiaxial_peak(bulk_modulus: float, peak: float):
    """Fails if both directions do not share the thinning: Cauchy peak at a stretch of 1.127; 1.215: incompressible."""
    space, law, cauchy = box("quad", 3), SinkLaw(), []
    momentum, stretches = sheet(space, 1.0, AAA(bulk_modulus)), np.linspace(1.1, 1.15, 51)
    for stretch in stretches:
        force = momentum.force(space.X * (stretch - 1))
        thickness = float(momentum.material.thin_sheet(np.eye(2) * stretch)[2, 2])
        nominal = float(np.einsum("ai,ai->", force, space.X)) / 2
        cauchy.append(float(law.history(momentum.W).mean()) * nominal / (stretch * thickness))
    assert stretches[np.argmax(cauchy)] == pytest.approx(1.127, abs=0.002)
    assert max(cauchy) == pytest.approx(peak, abs=0.001)


def test_thin_slab_of_solid_elements():
    """Fails if a notched sheet is not what a thin slab with free faces tends to: load, energy and displacements."""
    section, thickness = plate(), 0.1
    (load, energy, u), (load3, energy3, u3) = pulled_sheet_and_slab(section, thickness, AAA())
    assert load3 / thickness == pytest.approx(load, rel=0.01)
    assert energy3 / thickness == pytest.approx(energy, rel=0.01)
    assert abs(u3[1::3, :2] - u).max() < 0.02 * abs(u).max()
    flat = Momentum(_from_meshio("plate", section).space, AAA())
    flat.force(u)
    assert flat.energy > 1.2 * energy  # in plane strain


# --- time steps ---
@pytest.mark.slow
def test_highest_frequency_and_its_indicator():
    """Fails if the indicator is not the greatest quotient of one element, exceeds the frequency, or is far below it.

    Nor may the step be that of plane strain: without bulk modulus in it, it is about nine times as long.
    """
    space = box("quad", 5)
    gamma, u = np.random.default_rng(3).uniform(0.05, 1, space.w.shape), space.X * [-0.08, 0.2] + wavy(space, 0.1)
    momentum = sheet(space, gamma)
    free = np.repeat(~ends(space)[0], 2)
    pattern = Pattern(space, 2, free, upper=True)
    mass = momentum.lumped_mass(1e-3)
    omega2 = greatest_square(momentum, pattern, free, u, mass)
    assert highest_frequency(momentum, pattern, free, u, mass)[0] ** 2 == pytest.approx(omega2, rel=5e-3)
    inverse_mass = np.where(free.reshape(-1, 2), 1 / mass[:, None], 0.0)
    whole, greatest = Pattern(space, 2), 0.0
    F = np.eye(2) + space.gradient(u)
    cofactor = np.linalg.det(F)[..., None, None] * np.swapaxes(np.linalg.inv(F), -1, -2)
    for e in range(space.n_elements):
        b, alone = np.zeros_like(u), np.zeros_like(gamma)
        np.add.at(b, space.conn[e], np.einsum("q,qiJ,qaJ->ai", space.w[e], cofactor[e], space.dN[e]))
        alone[e] = gamma[e]
        element = sheet(space, alone)
        x = (inverse_mass * b).ravel()
        K_e = whole.matrix(element.tangent(whole, u)) - whole.matrix(sheet(space, alone * 0).tangent(whole, u))
        greatest = max(greatest, float(x @ (K_e @ x)) / float(x @ b.ravel()))
    assert momentum.stiffest(u, inverse_mass) == pytest.approx(greatest, rel=1e-4)  # dead ones are a little stiff
    assert 0.4 * omega2 < greatest < omega2
    strain = Momentum(space, AAA())
    flat = highest_frequency(strain, pattern, free, 0 * u, strain.lumped_mass(0))[0]
    assert 8 < flat / highest_frequency(sheet(space), pattern, free, 0 * u, strain.lumped_mass(0))[0] < 12


def test_crack_in_a_sheet_with_a_closed_ledger():
    """Fails if the explicit event of a sheet loses energy, is fed any, or takes steps beyond its density solves."""
    space = notched(15)
    momentum, density = Momentum(space, AAA(), "planestress"), DensitySolver(space, SinkLaw())
    free, velocity = grips(space, 1e-3)
    state = State.intact(space)
    for _ in Statics(held_body(momentum, density, free, velocity)).load(state):
        pass
    state.u *= 1.01
    state.time, state.step, state.ledger = 0.0, 0, Ledger()
    explicit = Explicit(held_body(momentum, density, free, velocity))
    explicit.begin(state)
    for _ in explicit.run(state, 2e-5):
        assert explicit.dt <= explicit.interval.longest
    assert state.deleted.sum() >= 5
    ledger = state.ledger
    assert ledger.error(ledger.initial) < 1e-12
    assert -1e-5 * ledger.initial < ledger.numerical < 0.02 * ledger.initial
    assert explicit.estimates < state.step / 3


# --- samples ---
def test_sheets_have_two_dimensions(tmp_path):
    """Fails if plane stress is taken for solids, or if the refusal comes after files are touched."""
    options = Options(element="planestress", out=tmp_path / "run", quiet=True)
    with pytest.raises(ParameterError, match="planestress is for meshes of quadrilaterals"):
        cylindrical_shell(options=options)
    assert not options.out.exists()
    with pytest.raises(ParameterError, match="planestress is for meshes of quadrilaterals"):
        Momentum(box("hex", 2), AAA(), "planestress")


def test_dog_bone_as_a_sheet_starts_to_crack_where_the_solid_does(tmp_path):
    """Fails if the section is not computed alone, or if onset and load differ from the committed ones of the solid."""
    case = reference.load_coarse("dog_bone")["dynamic"]
    own = {name: p.default for name, p in inspect.signature(dog_bone).parameters.items() if name != "options"}
    scene = DOG_BONE.scene(own, Options(element="planestress"))
    assert scene.sample.space.n_elements * own["layers"] == case["elements"]
    body = Simulation(scene, tmp_path, Display(True))
    for _ in body.statics.load(body.state):
        pass
    onset, load = case["onset"], body.momentum.force(body.state.u)[scene.sample.nodes("top"), 1].sum()
    assert body.state.grip * scene.speed == pytest.approx(onset["displacement_mm"], rel=0.01)
    assert own["thickness"] * load == pytest.approx(onset["reaction_N"], rel=0.02)
    assert own["thickness"] * body.momentum.energy == pytest.approx(onset["elastic_energy"], rel=0.03)
