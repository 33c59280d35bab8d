"""Thin sheets of laws of several invariants: forms, derivatives, closed forms, solid slabs, and events."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import (
    box,
    close,
    distorted,
    ends,
    greatest_square,
    grid,
    grips,
    held_body,
    momentum_of,
    notched,
    patchy,
    pulled_sheet_and_slab,
    wavy,
)
from plates import plate
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from skfsink.errors import ParameterError
from skfsink.fem import kernels
from skfsink.fem.forms import plane_stress_forms
from skfsink.fem.kernels import general_sheet
from skfsink.fem.pattern import Pattern
from skfsink.fem.space import Space
from skfsink.fields import stress
from skfsink.fields.configurational import point_stress
from skfsink.fields.density import DensitySolver
from skfsink.fields.energy import Ledger
from skfsink.fields.momentum import Momentum
from skfsink.fields.quantities import principal_stretches
from skfsink.fields.state import State
from skfsink.fields.stress import cauchy_stress
from skfsink.material import (
    AAA,
    GeneralMaterial,
    HolzapfelGasserOgden,
    Material,
    MooneyRivlin,
    NeoHookean,
    Ogden,
    SinkLaw,
)
from skfsink.material.oriented import AroundALine, oriented
from skfsink.material.regions import Region
from skfsink.material.sheet import SheetInvariants
from skfsink.methods.controls import HHTControls
from skfsink.methods.explicit import Explicit
from skfsink.methods.hht import HHT
from skfsink.methods.newton import Newton
from skfsink.methods.statics import Statics

MOONEY = MooneyRivlin(c1=0.4, c2=0.3, bulk_modulus=40.0)
TISSUE = HolzapfelGasserOgden(c=0.3, k1=0.6, k2=2.0, kappa=0.1, angle=30.0, axis=(1.0, 0.5, 0.0), bulk_modulus=50.0)
OGDEN = Ogden(mu=(0.9, 0.05, -0.1), alpha=(1.3, 4.0, -2.0), bulk_modulus=50.0)
all_laws = pytest.mark.parametrize("material", [MOONEY, OGDEN, TISSUE], ids=["MooneyRivlin", "Ogden", "Tissue"])


def sheet(space: Space, material: Material, gamma: np.ndarray | float = 1.0, **settings) -> Momentum:
    return momentum_of(space, material, np.broadcast_to(gamma, space.w.shape).copy(), "planestress", **settings)


def at_points(momentum: Momentum) -> np.ndarray:
    """Directions of the fibres at the Gauss points, (ne, nq, families, 3)."""
    return np.repeat(momentum.parts[0].fibres[:, None], momentum.space.w.shape[1], axis=1)


# --- the invariants, and the stretch across the sheet ---
def test_invariants_of_a_sheet_and_their_derivatives():
    """Fails if an invariant is not that of F in space, or a derivative with t, j, q or log J^(1/3) is wrong: 1e-9."""
    rng = np.random.default_rng(2)
    F = np.eye(3) + rng.uniform(-0.3, 0.3, (20, 3, 3))
    F[:, 2, :2] = F[:, :2, 2] = 0.0
    t, j, J = (F[:, :2, :2] ** 2).sum(axis=(1, 2)), np.linalg.det(F[:, :2, :2]), np.linalg.det(F)
    along = TISSUE.along(F[:, :2, :2], None)

    def values(v: np.ndarray, z: np.ndarray) -> SheetInvariants:
        return SheetInvariants(v[0], v[1], np.exp(3 * z), v[2:])

    v, z, h = np.stack([t, j, *along]), np.log(J) / 3, 1e-4
    found = values(v, z)
    np.testing.assert_allclose(found.values, TISSUE._invariants(F, None, 0.0).values, rtol=1e-12)

    def slope(function, d: np.ndarray, dz: float) -> np.ndarray:
        def central(s: float) -> np.ndarray:
            up, down = values(v + s * d[:, None], z + s * dz), values(v - s * d[:, None], z - s * dz)
            return (function(up) - function(down)) / (2 * s)

        return (4 * central(h / 2) - central(h)) / 3

    none = np.zeros(len(v))
    np.testing.assert_allclose(slope(lambda x: x.values, none, 1.0), found.across, atol=1e-9)
    np.testing.assert_allclose(slope(lambda x: x.across, none, 1.0), found.curved, atol=1e-9)
    np.testing.assert_allclose(slope(lambda x: x.plane, none, 1.0), found.mixed(), atol=1e-9)
    for b, d in enumerate(np.eye(len(v))):
        np.testing.assert_allclose(slope(lambda x: x.values, d, 0.0), found.plane[:, b], atol=1e-9)
        np.testing.assert_allclose(slope(lambda x: x.plane, d, 0.0), found.second()[:, :, b], atol=1e-9)


@all_laws
@pytest.mark.parametrize(("low", "high", "tolerance"), [(0.3, 3.0, 1e-12), (0.02, 0.3, 1e-6), (3.0, 30.0, 1e-12)])
def test_no_stress_across_the_sheet(material: GeneralMaterial, low: float, high: float, tolerance: float):
    """Fails if the Newton steps end before P33 = 0, in tension or crushed; relative to its parts."""
    rng = np.random.default_rng(5)
    n = 2000
    j, q = np.exp(rng.uniform(np.log(low), np.log(high), n)), np.exp(rng.uniform(-0.5, 0.5, n))
    F = np.zeros((n, 3, 3))
    F[:, 0, 0], F[:, 1, 1] = np.sqrt(j) * q, np.sqrt(j) / q
    t, along = j * (q**2 + q**-2), material.along(F[:, :2, :2], None)
    m = 2 + len(along)
    inv_j, y, p, s, o, psi = (np.empty(n) for _ in range(6))
    I, d, dd, z, work = np.empty((m, n)), np.zeros((m, n)), np.zeros((m, m, n)), np.empty((m, n)), np.empty((2, n))
    general_sheet.thin(material.compiled_law, material.constants, material.bulk_modulus, t, j, along, inv_j, y, p, s, o,
                       I, psi, d, dd, z, work)
    parts = np.abs(d * z).sum(axis=0) / 3 + material.bulk_modulus * y**3 * (y**3 + 1)
    found = SheetInvariants(t, j, y**3, along)
    rest = (d * found.across).sum(axis=0) / 3 + material.bulk_modulus * y**3 * (y**3 - 1)
    assert (abs(rest) <= tolerance * parts).all()
    np.testing.assert_allclose(material.thin_sheet(F[:, :2, :2])[:, 2, 2], y**3 / j, rtol=tolerance)


# --- equal to the weak forms, and to a solid ---
@all_laws
def test_force_energy_and_tangent_equal_the_forms(material: GeneralMaterial):
    """Fails if a loop and its form differ: stress, energy, condensed tangent, dead and soft points, tiles, fibres."""
    space = box("quad", 9)
    u, gamma = wavy(space, 0.25), patchy(space)
    momentum, forms, basis = sheet(space, material, gamma), plane_stress_forms(material), space.u_basis
    fields = {"displacement": u.ravel(), "gamma": gamma, "fibres": at_points(momentum)}
    close(momentum.force(u).ravel(), forms.residual.assemble(basis, **fields))
    F = np.eye(2) + space.gradient(u)
    W = material.energy(material.thin_sheet(F))
    close(momentum.W, W)
    assert momentum.energy == pytest.approx(float((space.w * gamma * W).sum()), rel=1e-12)
    pattern = Pattern(space, 2)
    for convex, form in ((False, forms.tangent), (True, forms.convex)):
        K = pattern.matrix(momentum.tangent(pattern, u, convex=convex))
        close(K, form.assemble(basis, **fields))
        close(K.T, K)


@all_laws
def test_the_forms_are_those_of_a_solid_with_free_faces(material: GeneralMaterial):
    """Fails if the sheet has another stress or condensed modulus than F in space with P33 = 0."""
    space = box("quad", 5)
    u, gamma = wavy(space, 0.25), patchy(space)
    momentum = sheet(space, material, gamma)
    F = material.thin_sheet(np.eye(2) + space.gradient(u))
    assert abs(material.first_piola(F)[..., 2, 2]).max() < 1e-9
    A = material.modulus(F)
    A = (A[..., :2, :2, :2, :2]
         - np.einsum("...iJ,...kL->...iJkL", A[..., :2, :2, 2, 2], A[..., 2, 2, :2, :2]) / A[..., 2:, 2:, 2:, 2:])
    weight = space.w * gamma
    P = material.first_piola(F)[..., :2, :2]
    force = np.zeros_like(u)
    np.add.at(force, space.conn, np.einsum("eq,eqiJ,eqaJ->eai", weight, P, space.dN))
    close(momentum.force(u), force, 1e-10)
    tangent = np.einsum("eq,eqaJ,eqiJkL,eqbL->eaibk", weight, space.dN, A, space.dN)
    soft = np.where(gamma < kernels.SOFT_GAMMA, kernels.ERSATZ_STIFFNESS * material.shear_modulus, 0.0)
    tangent += np.einsum("eq,eqaJ,eqbJ,ik->eaibk", space.w * soft, space.dN, space.dN, np.eye(2))
    dofs, K = space.element_dofs, np.zeros((u.size, u.size))
    np.add.at(K, (dofs[:, :, None], dofs[:, None, :]), tangent.reshape(len(dofs), 8, 8))
    pattern = Pattern(space, 2)
    close(pattern.matrix(momentum.tangent(pattern, u)).toarray(), K, 1e-10)


def test_without_the_second_invariant_it_is_the_neo_hookean_sheet():
    """Fails if the loops for several invariants differ from those for I1' where both describe one material."""
    space = box("quad", 9)
    u, gamma, inverse = wavy(space, 0.25), patchy(space), np.random.default_rng(1).uniform(0, 2, space.X.shape)
    same = HolzapfelGasserOgden(c=1.234, k1=0.0)
    one, *others = (sheet(space, m, gamma) for m in (NeoHookean(), MooneyRivlin(c1=0.617, c2=0.0), same))
    pattern = Pattern(space, 2)
    for other in others:
        close(other.force(u), one.force(u), 1e-13)
        close(other.W, one.W, 1e-13)
        close(other.tangent(pattern, u), one.tangent(pattern, u), 1e-12)
        assert other.stiffest(u, inverse) == pytest.approx(one.stiffest(u, inverse), rel=1e-12)


@all_laws
def test_the_indicator_of_the_highest_frequency(material: GeneralMaterial):
    """Fails if it is not the greatest quotient of an element, by the forms, or exceeds the highest frequency."""
    space = box("quad", 5)
    gamma = np.random.default_rng(3).uniform(0.05, 1, space.w.shape)
    free = np.repeat(~ends(space)[0], 2)
    pattern = Pattern(space, 2, free, upper=True)
    for u in (space.X * 0.01, space.X * [-0.08, 0.2] + wavy(space, 0.1)):
        momentum = sheet(space, material, gamma)
        mass = momentum.lumped_mass(1e-3)
        inverse = np.where(free.reshape(-1, 2), 1 / mass[:, None], 0.0)
        found = momentum.stiffest(u, inverse)
        forms = Momentum(space, material, "planestress", kernels="forms")
        forms.backend.set_gamma(gamma)
        assert found == pytest.approx(forms.stiffest(u, inverse), rel=1e-11)
        assert 0.2 * greatest_square(momentum, pattern, free, u, mass) < found
        assert found < greatest_square(momentum, pattern, free, u, mass)


# --- derivatives ---
@all_laws
def test_tangent_is_the_derivative_of_the_force_and_that_of_the_energy(material: GeneralMaterial):
    """Fails if condensing the stretch leaves out a term: differences agree to 1e-8."""
    space = box("quad", 2, 0.25)
    momentum = sheet(space, material, np.random.default_rng(1).uniform(kernels.SOFT_GAMMA, 1, space.w.shape))
    u, pattern = space.X * [0.3, 0.25] + wavy(space, 0.1), Pattern(space, 2)  # all fibres pulled: no jump of modulus
    K, force = pattern.matrix(momentum.tangent(pattern, u)).toarray(), momentum.force(u)
    difference, slope = np.empty_like(K), np.empty(u.size)
    for i in range(u.size):
        d = np.zeros(u.size)
        d[i] = 1.0
        d = d.reshape(u.shape)
        steps = []
        for h in (2e-4, 1e-4):
            up, e = momentum.force(u + h * d), momentum.energy
            steps.append(((up - momentum.force(u - h * d)) / (2 * h), (e - momentum.energy) / (2 * h)))
        difference[:, i] = ((4 * steps[1][0] - steps[0][0]) / 3).ravel()
        slope[i] = (4 * steps[1][1] - steps[0][1]) / 3
    close(difference, K, 1e-8)
    close(slope, force.ravel(), 1e-8)


@all_laws
def test_convex_tangent(material: GeneralMaterial):
    """Fails if it is another one than the tangent of a sheet in tension, or leaves a crushed one indefinite."""
    space = box("quad", 5)
    pattern = Pattern(space, 2, np.repeat(~ends(space)[0], 2), upper=True)
    momentum = sheet(space, material)
    for u in (space.X * [0.3, 0.1], space.X * [0.02, 0.2] + wavy(space, 0.01)):
        close(momentum.tangent(pattern, u, convex=True), momentum.tangent(pattern, u), 1e-11)
    for size in (0.0, 0.1, 0.3):
        u = space.X * [0.0, -0.3] + wavy(space, size)
        exact, convex = (pattern.symmetric(momentum.tangent(pattern, u, c)).toarray() for c in (False, True))
        assert np.linalg.eigvalsh(exact)[0] < 0 < np.linalg.eigvalsh(convex)[0]


# --- physics ---
def test_force_turns_with_the_sheet():
    """Fails if the force is not objective, or a rigid motion of the undeformed sheet gives any."""
    space = box("quad", 5)
    momentum, Q = sheet(space, MOONEY, patchy(space)), Rotation.from_rotvec([0, 0, 2.0]).as_matrix()[:2, :2]
    x = space.X + wavy(space, 0.2)
    force, energy = momentum.force(x - space.X), momentum.energy
    close(momentum.force(x @ Q.T + 0.3 - space.X), force @ Q.T)
    assert momentum.energy == pytest.approx(energy, rel=1e-12)
    rigid = momentum.force(space.X @ Q.T - space.X)
    assert abs(rigid).max() <= 1e-12 * momentum.material.shear_modulus * space.h.max()


def nominal(material: Material, along: float, across: float | None) -> np.ndarray:
    """Nominal stresses P_11, P_22 [MPa] of a sheet with these stretches, or a free side (None), by a scalar solve."""
    def stress(b: float, c: float) -> np.ndarray:
        return np.diag(material.first_piola(np.diag([along, b, c])))

    def thin(b: float) -> float:
        return brentq(lambda c: stress(b, c)[2], 0.02, 4.0, xtol=1e-15)

    if across is None:  # isotropic: the free side is as wide as the sheet is thick
        c = brentq(lambda c: stress(c, c)[2], 0.02, 4.0, xtol=1e-15)
        return stress(c, c)[:2]
    return stress(across, thin(across))[:2]


#: nominal stresses of an incompressible sheet of Mooney and Rivlin: s_1 and s_2 from a stretch
CLOSED = {
    "uniaxial": (lambda s, c1, c2: (2 * (s - s**-2) * (c1 + c2 / s), 0.0), lambda s: None),
    "equibiaxial": (lambda s, c1, c2: 2 * (2 * (s - s**-5) * (c1 + c2 * s**2),), lambda s: s),
    "pure shear": (lambda s, c1, c2: (2 * (s - s**-3) * (c1 + c2), 2 * (1 - s**-2) * (c1 + c2 * s**2)), lambda s: 1.0)}


@pytest.mark.parametrize("path", CLOSED)
@pytest.mark.parametrize("bulk_modulus", [40.0, 4000.0])
def test_mooney_rivlin_in_closed_form(path: str, bulk_modulus: float):
    """Fails if the stress of a sheet is not that of a scalar solve (1e-10), or, by more than (mu + sigma)/k, Rivlin's.

    A distorted mesh, whose free side finds its width. The difference has to be of that order, and not absent.
    """
    material = MooneyRivlin(c1=0.4, c2=0.3, bulk_modulus=bulk_modulus)
    closed, side = CLOSED[path]
    space = Space(distorted(grid("quad", (3, 3)), 0.2))
    momentum = sheet(space, material)
    low, high = ends(space)
    left, right = (np.isclose(space.X[:, 0], x) for x in (space.X[:, 0].min(), space.X[:, 0].max()))
    free = np.ones(space.X.shape, bool)
    free[low | high, 1] = False
    free[left if side(1.0) is None else left | right, 0] = False
    newton, u = Newton(momentum, free.ravel(), 1e-12, 60), np.zeros_like(space.X)
    for stretch in (1.1, 1.5, 2.2):
        u[:, 1] = space.X[:, 1] * (stretch - 1)
        if side(stretch) is not None:
            u[:, 0] = space.X[:, 0] * (side(stretch) - 1)
        u, force = newton.equilibrium(u)
        found = force[high, 1].sum(), force[right, 0].sum()
        scalar = nominal(material, stretch, side(stretch))
        assert found == pytest.approx(scalar, abs=1e-10)
        assert np.ptp(momentum.W) < 1e-9
        exact = np.array(closed(stretch, 0.4, 0.3))
        error, order = abs(np.array(found) - exact).max() / exact.max(), (1.4 + stretch * exact.max()) / bulk_modulus
        assert 0.1 * order < error < 1.5 * order


def test_thin_slab_of_solid_elements():
    """Fails if a notched sheet is not what a thin slab with free faces is: load and energy to 1e-3, motion to 1e-2.

    What is left is that of the elements: a quarter of it on elements of half the size.
    """
    thickness = 0.1
    (load, energy, u), (load3, energy3, u3) = pulled_sheet_and_slab(plate(37), thickness, MooneyRivlin(c1=0.4, c2=0.3))
    assert load3 / thickness == pytest.approx(load, rel=1e-3)
    assert energy3 / thickness == pytest.approx(energy, rel=1e-3)
    assert abs(u3[1::3, :2] - u).max() < 1e-2 * abs(u).max()


# --- stress, stretches and configurational forces of fields ---
@all_laws
def test_stress_of_the_fields_gives_the_nodal_forces(material: GeneralMaterial):
    """Fails if the stress that is written or the one of configurational forces has no free faces, or another force."""
    space = box("quad", 5)
    momentum, u = sheet(space, material, patchy(space)), wavy(space, 0.15)
    force = momentum.force(u)
    sigma = cauchy_stress(momentum, u)
    assert abs(sigma[:, 2]).max() < 1e-12 * material.bulk_modulus and abs(sigma[:, 0]).max() > 0.1
    every = np.arange(space.n_elements)
    found = point_stress(momentum, u, every, momentum.gamma)
    close(found.energy, momentum.gamma * momentum.W, 1e-11)
    local = np.zeros_like(u)
    np.add.at(local, space.conn, np.einsum("eq,eqiJ,eqaJ->eai", space.w, found.P, space.dN))
    close(local, force, 1e-11)
    homogeneous = space.X @ np.array([[0.2, 0.1], [0.0, 0.1]])
    F = material.thin_sheet(np.eye(2) + np.array([[0.2, 0.0], [0.1, 0.1]]))
    exact = np.linalg.svd(F)[1]
    np.testing.assert_allclose(principal_stretches(momentum, homogeneous, every[:3]), [exact] * 3, rtol=1e-12)
    C = cauchy_stress(sheet(space, material), homogeneous)[0]
    sigma = material.first_piola(F) @ F.T / np.linalg.det(F)
    np.testing.assert_allclose(C, [sigma[0, 0], sigma[1, 1], 0.0, sigma[0, 1], 0.0, 0.0], atol=1e-12)


def test_fibres_of_each_element():
    """Fails if stress, stretches or configurational forces take the fibres of another element than the loops do."""
    space = box("quad", 5)
    around = oriented(TISSUE, AroundALine(centre=(-0.5, -0.4, 0.0)), (0.0, 0.0, 1.0))
    momentum, u = sheet(space, around, patchy(space)), wavy(space, 0.15)
    fibres = momentum.parts[0].fibres
    assert np.ptp(fibres[:, 0, 1]) > 0.5 and not fibres[..., 2].any()
    force, every = momentum.force(u), np.arange(space.n_elements)
    s = stress._at_points(momentum, u, momentum.parts[0], slice(None), momentum.gamma)
    assert abs(s[..., 2]).max() < 1e-12 * TISSUE.bulk_modulus
    F = around.thin_sheet(np.eye(2) + space.gradient(u), fibres[:, None])
    P = np.linalg.det(F)[..., None, None] * s[..., [[0, 3, 5], [3, 1, 4], [5, 4, 2]]] @ np.swapaxes(
        np.linalg.inv(F), -1, -2)
    for found in (P[..., :2, :2], point_stress(momentum, u, every, momentum.gamma).P):
        local = np.zeros_like(u)
        np.add.at(local, space.conn, np.einsum("eq,eqiJ,eqaJ->eai", space.w, found, space.dN))
        close(local, force, 1e-11)
    mean = np.eye(2) + np.einsum("eq,eqiJ->eiJ", space.w / space.V[:, None], space.gradient(u))
    exact = np.linalg.svd(around.thin_sheet(mean, fibres))[1]
    np.testing.assert_allclose(principal_stretches(momentum, u, every[::-2]), exact[::-2], rtol=1e-12)


# --- bodies of several materials, threads, refusals ---
def test_regions_that_mix_laws(monkeypatch: pytest.MonkeyPatch):
    """Fails if a part of a sheet takes the loops or fibres of another, or results depend on threads."""
    monkeypatch.setattr(kernels.Tiles, "WORTH", 0)
    space = box("quad", 13)
    owner = np.random.default_rng(8).permutation(space.n_elements) % 4
    laws = (AAA(), MOONEY, TISSUE, NeoHookean())
    regions = [Region(str(i), np.flatnonzero(owner == i), laws[i], SinkLaw()) for i in (1, 2, 3)]
    u, inverse, pattern = wavy(space, 0.15), np.ones_like(space.X), Pattern(space, 2)
    mixed = Momentum(space, laws[0], "planestress", regions=regions)
    shared = Momentum(space, laws[0], "planestress", regions=regions, threads=2)
    total, K, W, stiffest = np.zeros_like(u), np.zeros(pattern.nnz), np.empty_like(space.w), 0.0
    for i, law in enumerate(laws):
        alone = sheet(space, law, (owner == i)[:, None] * 1.0)
        total += alone.force(u)
        W[owner == i] = alone.W[owner == i]
        own = sheet(space, law)
        K += own.backend._tangent(own.parts[0]._replace(
            elements=np.flatnonzero(owner == i), fibres=None if own.parts[0].fibres is None else
            own.parts[0].fibres[owner == i]), pattern, u, own.gamma, False)
        stiffest = max(stiffest, alone.stiffest(u, inverse))
    close(mixed.force(u), total, 1e-12)
    np.testing.assert_array_equal(shared.force(u), mixed.force(u))
    close(mixed.W, W, 1e-12)
    close(mixed.tangent(pattern, u), K, 1e-12)
    assert mixed.stiffest(u, inverse) == pytest.approx(stiffest, rel=1e-12)


def test_fibres_that_leave_the_plane_are_refused():
    """Fails if fibres that shear the free faces are taken, or those in the plane are refused."""
    space = box("quad", 2)
    Momentum(space, HolzapfelGasserOgden(axis=(0.0, 1.0, 0.0)), "planestress")
    said = r"isotropic laws, and for fibres in the plane of the sheet; those of HolzapfelGasserOgden rise .* 50 degrees"
    with pytest.raises(ParameterError, match=said):
        Momentum(space, HolzapfelGasserOgden(normal=(0.0, 1.0, 0.0)), "planestress")


# --- events ---
@pytest.mark.parametrize(("scheme", "material"), [
    ("explicit", MooneyRivlin(c1=0.4, c2=0.217)), ("hht", MooneyRivlin(c1=0.4, c2=0.217, viscosity=2e-8)),
    ("explicit", Ogden(mu=(1.8, 0.01, -0.03), alpha=(1.3, 5.0, -2.0)))], ids=["explicit", "hht", "Ogden"])
def test_crack_in_a_sheet_with_a_closed_ledger(scheme: str, material: GeneralMaterial):
    """Fails if the event of a sheet that is loaded statically to the onset loses energy or is fed any, in both schemes.

    Its viscosity takes some, which the ledger has.
    """
    space, law = notched(15), SinkLaw()
    momentum, density = Momentum(space, material, "planestress"), DensitySolver(space, law)
    free, velocity = grips(space, 1e-3)
    state = State.intact(space)
    for _ in Statics(held_body(momentum, density, free, velocity)).load(state):
        pass
    assert state.gamma.min() < 0.95
    state.u *= 1.01
    state.time, state.step, state.ledger = 0.0, 0, Ledger()
    body = held_body(momentum, density, free, velocity)
    scheme_ = Explicit(body) if scheme == "explicit" else HHT(body, HHTControls())
    scheme_.begin(state)
    for _ in scheme_.run(state, 2e-5):
        pass
    ledger = state.ledger
    assert state.deleted.sum() >= 5
    assert ledger.error(ledger.initial) < (1e-12 if scheme == "explicit" else 1e-4)  # what Newton's method leaves
    assert abs(ledger.numerical) < 0.03 * ledger.initial
    assert (ledger.viscous > 0.0) == (scheme == "hht")
