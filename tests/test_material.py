"""Materials and the sink law: closed forms, derivatives, invariances, the range checks, and a law of your own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from bodies import patchy, wavy
from numba import njit
from scipy.integrate import quad
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from skfsink.errors import ParameterError
from skfsink.fem.forms import momentum_forms
from skfsink.fem.kernels import Law, Tiles, tangent
from skfsink.fem.pattern import Pattern
from skfsink.fem.space import Space
from skfsink.material import AAA, Material, NeoHookean, SinkLaw
from skfsink.methods.controls import HHTControls

MATERIALS = [AAA(), NeoHookean()]
every_material = pytest.mark.parametrize("material", MATERIALS, ids=["AAA", "NeoHookean"])


def gradients(n: int, seed: int = 0, size: float = 0.3) -> np.ndarray:
    """(n, 3, 3) deformation gradients with J > 0."""
    F = np.eye(3) + np.random.default_rng(seed).uniform(-size, size, (n, 3, 3))
    assert (np.linalg.det(F) > 0).all()
    return F


# --- closed forms of the paper's material ---
def test_constants_of_the_paper_give_its_wave_speeds():
    """Fails if a unit (kg/m^3, mm/s) or a constant is wrong: mu = 2 c1, c_s, c_d and c_R as printed in the design."""
    m = AAA()
    assert m.rho0 == pytest.approx(1.433e-9, rel=1e-15)
    assert m.shear_modulus == pytest.approx(2 * 0.617, rel=1e-15)
    assert round(m.shear_wave_speed, 2) == 29.35
    assert round(m.dilatational_wave_speed) == 592
    assert round(m.rayleigh_wave_speed, 1) == 28.0


def test_rayleigh_speed_is_a_root_and_tends_to_the_incompressible_one():
    """Fails if the Rayleigh function or its bracket is wrong: c_R/c_s = 0.9553 for nu = 1/2, 0.9194 for nu = 1/4."""
    stiff = NeoHookean(bulk_modulus=1e7)
    assert stiff.rayleigh_wave_speed / stiff.shear_wave_speed == pytest.approx(0.95531, abs=1e-5)
    quarter = NeoHookean(bulk_modulus=1.234 * 5 / 3)  # k = 5/3 mu is Poisson's ratio 1/4
    ratio = quarter.rayleigh_wave_speed / quarter.shear_wave_speed
    assert ratio == pytest.approx(np.sqrt(2 - 2 / np.sqrt(3)), rel=1e-9)


def test_failure_energy_is_the_integral_of_the_softened_response():
    """Fails if psi_f is not Phi Gamma(1/m)/m (0.9514 Phi for m = 10), the energy int_0^inf exp(-(W/Phi)^m) dW."""
    for m in (1.0, 2.0, 10.0):
        law = SinkLaw(m=m)
        energy = quad(lambda W, law=law: float(law.history(W)), 0, 40 * law.phi, points=[law.phi], limit=200)[0]
        assert law.failure_energy == pytest.approx(energy, rel=1e-9)
    assert round(SinkLaw().failure_energy / SinkLaw().phi, 4) == 0.9514


def uniaxial(s: float) -> np.ndarray:
    return np.diag([s, s**-0.5, s**-0.5])


def plane_strain(s: float) -> np.ndarray:
    return np.diag([s, 1 / s, 1.0])


def equibiaxial(s: float) -> np.ndarray:
    return np.diag([s, s, s**-2])


def shear(s: float) -> np.ndarray:
    return np.array([[1, s, 0], [0, 1, 0], [0, 0, 1.0]])


@pytest.mark.parametrize(("path", "component", "interval", "at", "peak"), [
    (uniaxial, (0, 0), (1, 1.4), 1.248, 1.413),
    (plane_strain, (0, 0), (1, 1.4), 1.220, 1.525),
    (equibiaxial, (0, 0), (1, 1.25), 1.127, 1.215),
    (shear, (0, 1), (0.05, 0.8), 0.400, 0.748),
])
def test_homogeneous_strength(path: Callable, component: tuple, interval: tuple, at: float, peak: float):
    """Fails if psi, the stress or H is off by 1e-3: peak of the Cauchy stress with gamma = H at J = 1.

    The free stress component of the stretch paths is removed by a pressure: 33, or 22 in plane strain.
    """
    material, law = AAA(), SinkLaw()
    free = 1 if path is plane_strain else 2

    def stress(s: float) -> float:
        F = path(s)
        cauchy = float(law.history(material.energy(F))) * material.first_piola(F) @ F.T
        return cauchy[component] - (0 if path is shear else cauchy[free, free])

    found = minimize_scalar(lambda s: -stress(s), bounds=interval, method="bounded", options={"xatol": 1e-8})
    assert found.x == pytest.approx(at, abs=5e-4)
    assert -found.fun == pytest.approx(peak, abs=5e-4)
    W = float(material.energy(path(found.x)))
    assert law.phi * 0.76 < W < law.phi * 0.78
    assert float(law.history(W)) == pytest.approx(0.93, abs=5e-3)


def test_history_falls_from_one_to_zero_and_never_rises():
    """Fails if the shortcut for small W is not exact, if H is not monotone, or if a huge W gives NaN."""
    law = SinkLaw()
    W = np.concatenate([np.linspace(0, 3, 4000) * law.phi, [1e3, 1e300]])
    H = law.history(W)
    exact = np.exp(-(np.minimum(W, 1.0) / law.phi) ** law.m)
    assert np.array_equal(H[:1], [1.0]) and H[-1] == 0.0
    assert (np.diff(H) <= 0).all()
    np.testing.assert_allclose(H, exact, rtol=1e-13, atol=1e-16)
    assert law.history(W.reshape(2, -1)).shape == (2, W.size // 2)


# --- derivatives and invariances ---
@every_material
def test_stress_is_the_derivative_of_the_energy(material: Material):
    """Fails if any term of P is wrong: central differences of W, extrapolated, agree to 1e-9."""
    F = gradients(6)
    P = material.first_piola(F)
    for i in range(3):
        for j in range(3):
            E = np.zeros((3, 3))
            E[i, j] = 1.0
            d = [(material.energy(F + h * E) - material.energy(F - h * E)) / (2 * h) for h in (2e-3, 1e-3)]
            np.testing.assert_allclose((4 * d[1] - d[0]) / 3, P[:, i, j], atol=1e-9 * np.abs(P).max())


@every_material
def test_modulus_is_the_derivative_of_the_stress(material: Material):
    """Fails if any term of A = dP/dF is wrong, or if A lacks its major symmetry."""
    F = gradients(6)
    A = material.modulus(F)
    np.testing.assert_allclose(A, np.einsum("niJkL->nkLiJ", A), atol=1e-12 * np.abs(A).max())
    for k in range(3):
        for L in range(3):
            E = np.zeros((3, 3))
            E[k, L] = 1.0
            d = [(material.first_piola(F + h * E) - material.first_piola(F - h * E)) / (2 * h) for h in (2e-3, 1e-3)]
            np.testing.assert_allclose((4 * d[1] - d[0]) / 3, A[..., k, L], atol=1e-9 * np.abs(A).max())


@every_material
def test_law_derivatives(material: Material):
    """Fails if a compiled law's psi' or psi'' is not the derivative of its psi or psi'."""
    i1 = np.linspace(3.0, 6.0, 40)
    h = 1e-4
    up, low, here = material.isochoric(i1 + h), material.isochoric(i1 - h), material.isochoric(i1)
    for n in (0, 1):
        np.testing.assert_allclose((up[n] - low[n]) / (2 * h), here[n + 1], rtol=1e-7, atol=1e-9)


@every_material
def test_objectivity_and_symmetry(material: Material):
    """Fails if W or P depends on the observer (W(QF) = W(F), P(QF) = Q P(F)), or if S is not symmetric."""
    F = gradients(8, seed=3)
    Q = Rotation.random(8, random_state=1).as_matrix()
    P, S = material.first_piola(F), np.linalg.solve(F, material.first_piola(F))
    scale = np.abs(P).max()
    np.testing.assert_allclose(material.energy(Q @ F), material.energy(F), rtol=1e-12)
    np.testing.assert_allclose(material.energy(F @ Q), material.energy(F), rtol=1e-12)  # isotropy
    np.testing.assert_allclose(material.first_piola(Q @ F), Q @ P, atol=1e-12 * scale)
    np.testing.assert_allclose(S, np.swapaxes(S, 1, 2), atol=1e-12 * scale)
    np.testing.assert_allclose(F @ S, P, atol=1e-12 * scale)


@every_material
def test_undeformed_solid_is_free_of_stress_with_the_moduli_it_reports(material: Material):
    """Fails if W(1) or P(1) is not zero, or A(1) is not that of the linear solid with moduli k and mu."""
    one = np.eye(3)
    assert material.energy(one) == pytest.approx(0, abs=1e-15)
    np.testing.assert_allclose(material.first_piola(one), 0, atol=1e-13)
    A, mu, k = material.modulus(one), material.shear_modulus, material.bulk_modulus
    assert A[0, 1, 0, 1] == pytest.approx(mu, rel=1e-12)
    assert A[0, 0, 0, 0] == pytest.approx(k + 4 * mu / 3, rel=1e-12)
    assert A[0, 0, 1, 1] == pytest.approx(k - 2 * mu / 3, rel=1e-12)


def test_element_mean_replaces_the_jacobian_in_the_volumetric_part_only():
    """Fails if J_bar leaks into the isochoric part, or is ignored."""
    material, F = AAA(), gradients(4, seed=5)
    J = np.linalg.det(F)
    shift = material.energy(F, J_bar=J + 0.01) - material.energy(F)
    np.testing.assert_allclose(shift, 0.5 * material.bulk_modulus * ((J - 0.99) ** 2 - (J - 1) ** 2), rtol=1e-10)


# --- parameters ---
@pytest.mark.parametrize(("make", "name", "value", "allowed"), [
    (lambda v: AAA(c1=v), "c1", 0.0, "(0, inf) MPa"),
    (lambda v: AAA(c2=v), "c2", -1.0, "[0, inf) MPa"),
    (lambda v: AAA(bulk_modulus=v), "bulk_modulus", -500.0, "(0, inf) MPa"),
    (lambda v: NeoHookean(mu=v), "mu", float("nan"), "(0, inf) MPa"),
    (lambda v: NeoHookean(density=v), "density", float("inf"), "(0, inf) kg/m^3"),
    (lambda v: SinkLaw(phi=v), "phi", 0.0, "(0, inf) MPa"),
    (lambda v: SinkLaw(m=v), "m", 0.5, "[1, inf)"),
    (lambda v: SinkLaw(length_scale=v), "length_scale", -0.1, "(0, inf) mm"),
    (lambda v: SinkLaw(epsilon=v), "epsilon", 0.01, "(0, 0.001]"),
    (lambda v: AAA(c1=v), "c1", "soft", "(0, inf) MPa"),
    (lambda v: HHTControls(alpha=v), "hht_alpha", 0.1, "[-0.333333, 0]"),
])
def test_bad_parameters_name_themselves_the_value_and_the_range(make: Callable, name: str, value: object, allowed: str):
    """Fails if a bad constant is accepted, or if the one-line message lacks the name, the value or the range."""
    with pytest.raises(ParameterError) as caught:
        make(value)
    message = str(caught.value)
    assert message.startswith(f"{name} must be") and allowed in message and repr(value) in message
    assert "\n" not in message


def test_hht_constants_of_the_paper():
    """Fails if beta or gamma of the HHT scheme does not follow from alpha = -0.05 as printed."""
    assert HHTControls().alpha == -0.05
    assert HHTControls().beta == pytest.approx(0.275625, rel=1e-14)
    assert HHTControls().newmark_gamma == pytest.approx(0.55, rel=1e-14)


# --- a material of your own ---
@njit
def _exponential_law(i1, c, psi, dpsi, ddpsi):
    for i in range(i1.size):
        e = np.exp(c[1] * (i1[i] - 3.0))
        psi[i] = c[0] / c[1] * (e - 1.0)
        dpsi[i] = c[0] * e
        ddpsi[i] = c[0] * c[1] * e


@dataclass(frozen=True)
class Demiray(Material):
    """psi = a/b (exp(b (I1' - 3)) - 1), which the program does not know."""

    law = staticmethod(_exponential_law)
    a: float = 0.3
    b: float = 1.5

    @property
    def constants(self) -> np.ndarray:
        return np.array([self.a, self.b])


@pytest.mark.slow
def test_a_third_material_is_one_class(space: Space):
    """Fails if a stored energy defined outside the package cannot go through the compiled loops and the forms alike."""
    material = Demiray()
    assert material.shear_modulus == pytest.approx(0.6, rel=1e-14)
    test_stress_is_the_derivative_of_the_energy(material)
    u, gamma = wavy(space, 0.1), patchy(space)
    tiles = Tiles(space)
    tiles.set_gamma(gamma)
    force = np.empty_like(u)
    tiles.force(space.X + u, [Law(material.compiled_law, material.constants, material.bulk_modulus)], force)
    basis, forms = space.u_basis, momentum_forms(material)
    fields = {"displacement": u.ravel(), "gamma": gamma, "dV": basis.dx}
    expected = forms.residual.assemble(basis, **fields)
    np.testing.assert_allclose(force.ravel(), expected, atol=1e-12 * np.abs(expected).max())
    pattern = Pattern(space, space.dim)
    K = pattern.matrix(tangent(space, pattern, material, u, gamma))
    difference = abs(K - forms.tangent.assemble(basis, **fields))
    assert difference.max() <= 1e-12 * abs(K).max()
