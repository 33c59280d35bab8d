"""Bodies of revolution: the element against its forms, its own derivatives, closed forms, and wedges of hexahedra."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import skfem
from bodies import (
    FAILED,
    Loadable,
    boundary,
    box,
    close,
    distorted,
    ends,
    gauss_points,
    greatest_square,
    grid,
    momentum_of,
    patchy,
    wavy,
)
from scipy.optimize import brentq
from scipy.special import i0, i1, k0, k1
from test_pressure import INNER, OUTER, TOUGH, check_work, force, thick, tube

from skfsink.errors import MeshError, ParameterError
from skfsink.fem import indicators
from skfsink.fem.backends import BACKENDS
from skfsink.fem.facets import boundary_facets
from skfsink.fem.forms import pressure_forms
from skfsink.fem.pattern import Pattern
from skfsink.fem.places import find_places
from skfsink.fem.space import Space
from skfsink.fem.surface import Surface
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.fields.quantities import QUANTITIES
from skfsink.fields.state import State
from skfsink.fields.stress import cauchy_stress
from skfsink.loads.body_force import BodyForce
from skfsink.loads.follower import FollowerLoads
from skfsink.loads.grips import Grip, Ramp, Traction
from skfsink.loads.pressure import Filling, Pressure
from skfsink.loads.rigid import free_motions
from skfsink.loads.rotation import Rotation
from skfsink.loads.schedule import Loading
from skfsink.material import AAA, HolzapfelGasserOgden, Material, MooneyRivlin, NeoHookean, SinkLaw
from skfsink.methods.frequency import highest_frequency
from skfsink.methods.newton import Newton

#: families at plus and minus 40 degrees to the way around, in the surface of a tube
TISSUE = HolzapfelGasserOgden(c=0.3, k1=0.6, k2=3.0, kappa=0.1, angle=40.0, axis=(0, 0, 1), normal=(1, 0, 0),
                              bulk_modulus=50.0)
MATERIALS = pytest.mark.parametrize("material", [AAA(), MooneyRivlin(bulk_modulus=30.0), TISSUE],
                                    ids=lambda material: type(material).__name__)


def ring(n: int, inner: float = 1.0, size: float = 1.0, amount: float = 0.2) -> Space:
    """Section of a thick ring of n x n distorted elements, a square at the distance `inner` from the axis."""
    return Space(distorted(grid("quad", (n, n), size), amount).translated((inner, 0.0)), axisymmetric=True)


def core(n: int) -> Space:
    """Half plane of a cylinder of radius and height 1 of n x n distorted elements, with the axis."""
    return box("quad", n).revolved()


def held(space: Space, *others: tuple[np.ndarray, Grip]) -> np.ndarray:
    """Mask (n*dim,) of what neither the axis nor grips hold."""
    return Loading(space, others).free


# --- the body ---
def test_volume_mass_and_axis() -> None:
    """Fails if integrals are not those of the whole body, or sizes those of the mesh, or nodes on the axis are free."""
    cylinder, tube_ = core(4), ring(3, 0.5)
    assert cylinder.V.sum() == pytest.approx(np.pi, rel=1e-13)
    assert tube_.V.sum() == pytest.approx(np.pi * (1.5**2 - 0.5**2), rel=1e-13)
    np.testing.assert_allclose(cylinder.h, box("quad", 4).h, rtol=1e-15)
    mass = Momentum(cylinder, AAA(), "axisymmetric").lumped_mass(0.0)
    assert mass.sum() == pytest.approx(AAA().rho0 * np.pi, rel=1e-13) and mass.min() > 0.0
    free = held(cylinder).reshape(-1, 2)
    np.testing.assert_array_equal(free[:, 0], cylinder.X[:, 0] > 0.0)
    assert free[:, 1].all() and held(tube_).all()


def test_what_is_refused() -> None:
    """Fails if a mesh beyond the axis, of hexahedra, or another space than the element's is taken; or torsion."""
    mesh = grid("quad", (2, 2))
    with pytest.raises(MeshError, match=r"at \(-0.1, 0\) mm is beyond the axis: move the mesh by 0.1 mm along x"):
        Space(mesh.translated((-0.1, 0.0)), axisymmetric=True)
    Space(mesh.translated((-1e-12, 0.0)), axisymmetric=True)
    with pytest.raises(MeshError, match="hexahedra: take element jbar"):
        Space(grid("hex", (1, 1, 1)), axisymmetric=True)
    with pytest.raises(ParameterError, match="element axisymmetric is for bodies of revolution, and the space is not"):
        Momentum(Space(mesh), AAA(), "axisymmetric")
    with pytest.raises(ParameterError, match="element jbar is not for bodies of revolution, and the space is that"):
        Momentum(core(2), AAA())
    space = core(2)
    side, bottom = np.flatnonzero(space.X[:, 0] == 1.0), np.flatnonzero(space.X[:, 1] == 0.0)
    with pytest.raises(ParameterError, match=r"grip bottom moves the node at \(0, 0\) mm, on the axis of revolution"):
        Loading(space, [(bottom, Grip("bottom", (1.0, 0.0)))])
    Loading(space, [(bottom, Grip("bottom", (None, 1.0))), (side, Grip("side", (1.0, None)))])
    with pytest.raises(ParameterError, match="grip side turns a body of revolution"):
        Loading(space, [(side, Rotation("side", 1.0, (0.0, 0.0)))])
    with pytest.raises(ParameterError, match="acts along its axis: leave x out"):
        BodyForce(space, 1e-9, (1.0, 0.0))
    with pytest.raises(ParameterError, match="the fibres of HolzapfelGasserOgden would twist a body of revolution"):
        Momentum(space, HolzapfelGasserOgden(axis=(0, 1, 1), normal=(1, 0, 0)), "axisymmetric")


# --- equal to the forms: the other terms are in test_backends.py and test_viscosity.py ---
@pytest.mark.parametrize("aspect", [0.3, 1.0, 4.0])
@pytest.mark.parametrize("gradient", ["monotone", "gauss"])
def test_gradient_term_is_equal_and_monotone(gradient: str, aspect: float) -> None:
    """Fails if the weight 2 pi R is left out of a rule, or the matrix is no M-matrix; linear fields keep their energy.

    Seen to fail with a constant weight in `_stiffness`.
    """
    for space in (core(6), ring(6, 0.3), Space(grid("quad", (6, 6)), axisymmetric=True)):
        space = Space(space.mesh.scaled((1.0, aspect)), axisymmetric=True)
        pattern = Pattern(space)
        found = [BACKENDS[name].density(space, 0.3).laplacian(pattern, monotone=gradient == "monotone")
                 for name in ("compiled", "forms")]
        close(found[1], found[0], 1e-13)
        A = pattern.matrix(found[0]).toarray()
        np.testing.assert_allclose(A.sum(axis=1), 0.0, atol=1e-14 * A.max())
        if gradient == "monotone":
            assert (A - np.diag(np.diag(A))).max() <= 1e-15 * A.max()
    field = space.X @ [0.3, 0.7]  # of the last one, of boxes
    assert field @ A @ field == pytest.approx(0.3**2 * (0.3**2 + 0.7**2) * space.V.sum(), rel=1e-10)


# --- derivatives ---
@MATERIALS
@pytest.mark.parametrize("make", [core, ring])
def test_force_is_the_derivative_of_the_energy(material: Material, make: Any) -> None:
    """Fails if the stress around, or its way to the nodes, does not belong to the energy: differences of it, to 1e-8.

    Seen to fail with the hoop force left out, and without r/R in the cofactor.
    """
    space = make(5)
    momentum, u = momentum_of(space, material, patchy(space), "axisymmetric"), wavy(space, 0.1)
    u[space.on_axis, 0] = 0.0
    force = momentum.force(u)
    for seed in range(3):
        d = np.random.default_rng(seed).normal(size=u.shape)
        d[space.on_axis, 0] = 0.0
        energies = []
        for h in (2e-5, 1e-5, -1e-5, -2e-5):
            momentum.force(u + h * d)
            energies.append(momentum.energy)
        rate = (8 * (energies[1] - energies[2]) - (energies[0] - energies[3])) / 12e-5
        assert rate == pytest.approx(float(np.vdot(force, d)), abs=1e-8 * np.linalg.norm(force))


@MATERIALS
def test_tangent_is_the_derivative_of_the_force(material: Material) -> None:
    """Fails if a term of the tangent is left out: differences of the force agree to 1e-8, and it is symmetric.

    Seen to fail without the hoop part of J'' (the factor `ring`) and without that of the J_bar coupling.
    """
    space = core(3)
    gamma = np.random.default_rng(1).uniform(1e-2, 1, space.w.shape)
    momentum, u = momentum_of(space, material, gamma, "axisymmetric"), wavy(space, 0.1)
    pattern, free = Pattern(space, 2), held(space)
    K = pattern.matrix(momentum.tangent(pattern, u)).toarray()
    close(K, K.T, 1e-13)
    difference = np.zeros_like(K)
    for i in np.flatnonzero(free):
        d = np.zeros(u.size)
        d[i] = 1.0
        d = d.reshape(u.shape)
        slopes = [(momentum.force(u + h * d) - momentum.force(u - h * d)) / (2 * h) for h in (2e-5, 1e-5)]
        difference[:, i] = ((4 * slopes[1] - slopes[0]) / 3).ravel()
    close(difference[:, free], K[:, free], 1e-8)


@MATERIALS
def test_convex_tangent(material: Material) -> None:
    """Fails if bounding it changes the tangent of a stretched body, or does nothing where points are unstable."""
    space = core(4)
    pattern = Pattern(space, 2, held(space, (np.flatnonzero(ends(space)[0]), Grip("low", (0.0, 0.0)))), upper=True)
    momentum = momentum_of(space, material, np.ones_like(space.w), "axisymmetric")
    for u in (np.zeros_like(space.X), space.X * [1.1**-0.5 - 1.0, 0.1]):
        close(momentum.tangent(pattern, u, convex=True), momentum.tangent(pattern, u), 1e-9 if not u.any() else 1e-4)
    u = space.X * [0.0, -0.3] + wavy(space, 0.3)
    u[space.on_axis, 0] = 0.0
    exact, convex = (np.linalg.eigvalsh(pattern.symmetric(momentum.tangent(pattern, u, c)).toarray())[0]
                     for c in (False, True))
    assert exact < convex


# --- closed forms ---
def sideways(material: Material, stretch: float) -> tuple[float, float]:
    """Stretch across a bar with free sides, and its nominal stress [MPa], from one scalar equation."""
    b = brentq(lambda b: float(material.first_piola(np.diag([b, stretch, b]))[0, 0]), 0.5, 1.5, xtol=1e-15)
    return b, float(material.first_piola(np.diag([b, stretch, b]))[1, 1])


@pytest.mark.parametrize("material", [AAA(), NeoHookean(bulk_modulus=20.0), MooneyRivlin(bulk_modulus=30.0)],
                         ids=lambda material: type(material).__name__)
@pytest.mark.parametrize("make", [core, ring])
def test_a_cylinder_and_a_tube_in_tension(material: Material, make: Any) -> None:
    """Fails if an even state is not kept by distorted elements, or load and energy are not those of the whole body."""
    space, stretch = make(4), 1.3
    low, high = (np.flatnonzero(mask) for mask in ends(space))
    loading = Loading(space, [(low, Grip("low", (None, 0.0))), (high, Grip("high", (None, 1.0)))])
    momentum, u = Momentum(space, material, "axisymmetric"), np.zeros_like(space.X)
    newton = Newton(momentum, loading.free, 1e-12, 60)
    for part in (1 / 3, 2 / 3, 1.0):
        u[high, 1] = part * (stretch - 1)
        u, internal = newton.equilibrium(u)
    b, nominal = sideways(material, stretch)
    np.testing.assert_allclose(u, space.X * [b - 1, stretch - 1], atol=1e-10)
    area = space.V.sum()  # of a height of 1
    assert internal[high, 1].sum() == pytest.approx(nominal * area, rel=1e-10)
    assert momentum.energy == pytest.approx(float(material.energy(np.diag([b, stretch, b]))) * area, rel=1e-10)
    stress = cauchy_stress(momentum, u)
    np.testing.assert_allclose(stress[:, 1], nominal / b**2, rtol=1e-9)
    np.testing.assert_allclose(stress[:, [0, 2, 3, 4, 5]], 0.0, atol=1e-9 * nominal)


@MATERIALS
def test_patch(material: Material) -> None:
    """Fails if an even deformation leaves forces inside of distorted elements, or the stress around is another one."""
    space = ring(5, 0.4)
    momentum = momentum_of(space, material, np.full_like(space.w, 0.7), "axisymmetric")
    F = np.diag([1.2, 0.8, 1.2])
    internal = momentum.force(space.X * [0.2, -0.2])
    fibres = {} if material is not TISSUE else {"fibres": TISSUE.fibres(np.zeros((1, 3)))[0]}
    P = 0.7 * np.asarray(material.first_piola(F, **fibres))
    inside = ~boundary(space)
    # a stress that differs along r and around is in equilibrium with (P_rr - P_tt)/R, which TISSUE has
    body = 2 * np.pi * (P[2, 2] - P[0, 0]) * np.einsum("eq,qa->ea", space.dX, space.N)
    expected = np.bincount(space.conn.ravel(), body.ravel(), space.n_nodes)
    np.testing.assert_allclose(internal[inside, 0], expected[inside], atol=1e-12 * np.abs(internal).max())
    np.testing.assert_allclose(internal[inside, 1], 0.0, atol=1e-12 * np.abs(internal).max())
    virial = (internal * space.X).sum(axis=0) / space.V.sum()
    np.testing.assert_allclose(virial, [P[0, 0] + P[2, 2], P[1, 1]], rtol=1e-12)


def test_a_translation_along_the_axis_has_no_force() -> None:
    """Fails if the force depends on the height, or an unloaded body that moves along its axis has any."""
    space = core(5)
    momentum, u = momentum_of(space, AAA(), patchy(space), "axisymmetric"), wavy(space, 0.1)
    internal, energy = momentum.force(u).copy(), momentum.energy
    close(momentum.force(u + np.array([0.0, 3.0])), internal, 1e-10)
    assert momentum.energy == pytest.approx(energy, rel=1e-12)
    assert abs(internal[:, 1].sum()) < 1e-12 * abs(internal).max()
    assert abs(momentum.force(np.full_like(u, 3.0) * [0.0, 1.0])).max() < 1e-12 * abs(internal).max()
    side, low = side_of(space), np.flatnonzero(ends(space)[0])
    for grips, expected in (((), [("move", True)]), ([(side, Grip("side", (0.0, None)))], [("move", True)]),
                            ([(low, Grip("low", (None, 0.0)))], [])):
        assert [(motion.name, motion.unheld) for motion in free_motions(space, held(space, *grips))] == expected
    tube_ = ring(3)
    bottom = np.flatnonzero(ends(tube_)[0])
    assert not [*free_motions(tube_, held(tube_, (bottom, Grip("low", (None, 0.0)))))]  # nothing else holds it


class Pressed(Loadable):
    """A body of revolution under pressures between grips; the material never fails."""

    def __init__(self, space: Space, grips: list[tuple[np.ndarray, Any]], loads: list[tuple[np.ndarray, Any]],
                 material: Material, **controls: Any) -> None:
        super().__init__(space, Loading(space, grips, (), (), loads), material, TOUGH, **controls)
        assert self.loading.followers is not None
        self.followers = self.loading.followers


@pytest.mark.parametrize("dim", [2, 3])
def test_thick_tube_and_ball(dim: int) -> None:
    """Fails if a tube in plane strain or a ball under inner pressure leaves its closed form, or the rate 2 in h.

    Seen to fail with the load's weight r left out.
    """
    material = AAA(bulk_modulus=2e6)
    p, errors = thick(material, 1.3, dim), []
    for n in (2, 4, 8):
        if dim == 2:
            mesh = skfem.MeshQuad.init_tensor(np.linspace(INNER, OUTER, n + 1), np.linspace(0.0, 0.5 / n, 2))
            space = Space(mesh, axisymmetric=True)
            inner, grip = np.flatnonzero(space.X[:, 0] == INNER), np.arange(space.n_nodes)
        else:
            space = tube(n).revolved()
            radius = np.linalg.norm(space.X, axis=1)
            inner, grip = np.flatnonzero(np.isclose(radius, INNER)), np.flatnonzero(np.abs(space.X[:, 1]) < 1e-9)
        body = Pressed(space, [(grip, Grip("held", (None, 0.0)))], [(inner, Pressure("inner", Ramp((0, 1), (0, p))))],
                       material, tolerance=1e-9)
        state = body.load()
        assert body.statics.unfailed == "nothing moves after load time 1 s"
        x = space.X + state.u
        radii = x[inner, 0] if dim == 2 else np.linalg.norm(x[inner], axis=1)
        errors.append(abs(radii.mean() - 1.3))
        assert body.momentum.skew_stiffness(state.u, body.loading.free) is None
        assert abs(state.ledger.balance) < 2e-3 * state.ledger.elastic
    assert errors[-1] < 2e-3
    assert all(3.3 < coarse / fine < 4.8 for coarse, fine in pairwise(errors))


# --- pressures ---
def surface_of(space: Space) -> np.ndarray:
    return np.asarray(space.mesh.boundary_nodes())


def side_of(space: Space) -> np.ndarray:
    return np.flatnonzero(ends(space, 0)[1])


def test_nodal_forces_are_those_of_the_form() -> None:
    """Fails if a ring turned, its weight or a derivative is wrong; or a closed surface is taken for an open one."""
    forms = pressure_forms()
    for space in (core(3), ring(3)):
        u = wavy(space, 0.1)
        u[space.on_axis, 0] = 0.0
        for nodes in (surface_of(space), side_of(space)):
            loads = FollowerLoads(space, [(nodes, Pressure("all", 2.0))])
            loads.at(1.5)
            basis = skfem.FacetBasis(space.mesh, space.u_basis.elem, facets=boundary_facets(space, nodes), intorder=4)
            radius = np.maximum(np.asarray(basis.global_coordinates())[0], 1e-12)
            space.measured(basis)
            fields = {"displacement": basis.interpolate(u.ravel()), "pressure": 3.0, "radius": radius}
            f = force(loads, u)
            np.testing.assert_allclose(f.ravel(), forms.residual.assemble(basis, **fields), atol=1e-12)
            pattern = Pattern(space, 2)
            data = np.zeros(pattern.nnz)
            loads.add_stiffness(pattern, u, data)
            free = held(space)
            K, skew = pattern.matrix(data).toarray()[free][:, free], loads.skew(u, free)
            assert (skew is None) == (nodes.size == surface_of(space).size)
            K = K if skew is None else K + skew.toarray()
            expected = forms.tangent.assemble(basis, **fields).toarray()[free][:, free]
            np.testing.assert_allclose(K, expected, atol=1e-11)
            if nodes.size == surface_of(space).size:
                assert abs(f[:, 1].sum()) < 1e-12 * np.abs(f).max()


@pytest.mark.parametrize("fluid", [False, True])
def test_work_is_that_of_the_forces_on_the_way(fluid: bool) -> None:
    """Fails if the work of a pressure that changes, or of a fluid, is not the integral of force along the motion."""
    space = core(2)
    u, du = wavy(space, 0.1), wavy(space, 0.3, 5)
    u[space.on_axis, 0] = du[space.on_axis, 0] = 0.0
    loads = FollowerLoads(space, [(surface_of(space), Filling("all", 3.0, 0.5)) if fluid else
                                  (side_of(space), Pressure("side", 2.0))])
    check_work(loads, u, du)


def test_volumes_and_areas() -> None:
    """Fails if the volume that a surface sweeps or encloses, its area, or the mean over it are not those of rings."""
    space = core(3)
    loads = FollowerLoads(space, [(surface_of(space), Pressure("all", 1.0))])
    u = space.X * [0.3, -0.2]
    assert loads.swept(u)[0] == pytest.approx(np.pi * (1.0 - 1.3**2 * 0.8), rel=1e-12)
    assert loads.areas[0] == pytest.approx(2 * np.pi + 2 * np.pi, rel=1e-12)
    assert loads.area(u)[0] == pytest.approx(2 * np.pi * 1.3**2 + 2 * np.pi * 1.3 * 0.8, rel=1e-12)
    side = Surface(space, "side", side_of(space))
    assert side.volume(space.X + u) == pytest.approx(np.pi * 1.3**2 * 0.8, rel=1e-12)
    assert side.volume(space.X + u, np.array([0.0, 0.0])) == pytest.approx(2 / 3 * np.pi * 1.3**2 * 0.8, rel=1e-12)
    places, weights = Surface(space, "all", surface_of(space)).places()
    assert weights.sum() == pytest.approx(4 * np.pi, rel=1e-12)
    assert weights @ places.at(space, space.X[:, 0]) == pytest.approx(2 * np.pi + 4 / 3 * np.pi, rel=1e-12)
    with pytest.raises(ParameterError, match="must be on its axis, x = 0"):
        side.volume(space.X, np.array([0.1, 0.0]))


def test_stiffness_of_a_fluid() -> None:
    """Fails if the tangent of a filling, with its column, is not the derivative of its force."""
    space = core(2)
    loads = FollowerLoads(space, [(surface_of(space), Filling("all", 1.0, 0.3))])
    loads.at(0.5)
    u, v, eps = wavy(space, 0.1), wavy(space, 1.0, 5), 1e-6
    u[space.on_axis, 0] = v[space.on_axis, 0] = 0.0
    pattern = Pattern(space, 2)
    data = np.zeros(pattern.nnz)
    loads.add_stiffness(pattern, u, data)
    B = loads.stiffening(u)
    assert B is not None
    product = pattern.matrix(data) @ v.ravel() + B @ (B.T @ v.ravel())
    slope = (force(loads, u + eps * v) - force(loads, u - eps * v)).ravel() / (2 * eps)
    free = held(space)
    np.testing.assert_allclose(product[free], slope[free], atol=1e-7)


def test_dead_loads_and_weight() -> None:
    """Fails if a traction or a weight is not that of the whole body."""
    space = core(4)
    high = np.flatnonzero(ends(space)[1])
    low = np.flatnonzero(ends(space)[0])
    loading = Loading(space, [(low, Grip("low", (0.0, 0.0)))],
                      [(high, Traction("high", (0.0, 2.0))), (side_of(space), Traction("side", (1.0, 0.0)))],
                      [BodyForce(space, 2e-9, (0.0, 5.0))])
    loading.dead.at(1.0)
    assert loading.tractions.resultant(0)[1] == pytest.approx(2.0 * np.pi, rel=1e-12)
    assert loading.tractions.resultant(1)[0] == pytest.approx(2.0 * np.pi, rel=1e-12)
    assert loading.dead.values[:, 1].sum() == pytest.approx((2.0 + 1e-8) * np.pi, rel=1e-12)


# --- time steps ---
def test_highest_frequency_and_its_indicator() -> None:
    """Fails if the indicator exceeds the highest frequency, is far below it, or that is not found, near the axis too.
    """
    for space in (core(5), ring(5)):
        gamma = np.random.default_rng(3).uniform(0.05, 1, space.w.shape)
        u = space.X * [-0.08, 0.2] + wavy(space, 0.02)
        u[space.on_axis, 0] = 0.0
        momentum = momentum_of(space, AAA(), gamma, "axisymmetric")
        free = held(space, (np.flatnonzero(ends(space)[0]), Grip("low", (0.0, 0.0))))
        pattern = Pattern(space, 2, free, upper=True)
        mass = momentum.lumped_mass(1e-3)
        omega2 = greatest_square(momentum, pattern, free, u, mass)
        assert highest_frequency(momentum, pattern, free, u, mass)[0] ** 2 == pytest.approx(omega2, rel=5e-3)
        inverse_mass = np.where(free.reshape(-1, 2), 1 / mass[:, None], 0.0)
        assert 0.5 * omega2 < momentum.stiffest(u, inverse_mass) < omega2


# --- density ---
@pytest.mark.parametrize("sink", ["lumped", "consistent"])
def test_density_around_a_broken_core(sink: str) -> None:
    """Fails if the mass balance is not that of a body of revolution: gamma around a broken core, Bessel functions.

    From l^2 (gamma'' + gamma'/r) = gamma - 1, gamma(a) = 0 and gamma'(b) = 0. Seen to fail (lumped) with the weight
    left out of the gradient term.
    """
    l, a, b, errors = 0.15, 0.25, 1.0, []
    for n in (16, 32, 64):
        space = Space(skfem.MeshQuad.init_tensor(np.linspace(0.0, b, n + 1), np.linspace(0.0, 0.2, 3)),
                      axisymmetric=True)
        law = SinkLaw(length_scale=l)
        W = np.where(gauss_points(space)[..., 0] < a, FAILED, 0.0)
        gamma = DensitySolver(space, law, sink, tolerance=1e-12).solve(W, np.ones(space.n_nodes))
        r = space.X[:, 0]
        A, B = np.linalg.solve([[i0(a / l), k0(a / l)], [i1(b / l), -k1(b / l)]], [1.0, 0.0])
        exact = np.where(r < a, 0.0, 1.0 - A * i0(r / l) - B * k0(np.maximum(r, a) / l))
        errors.append(np.abs(gamma - exact)[r >= a].max())
    assert errors[-1] < 2e-3
    assert all(3.0 < coarse / fine < 5.0 for coarse, fine in pairwise(errors))


# --- quantities ---
def test_stretches_pressure_and_inverted_points() -> None:
    """Fails if the stretch around is left out of quantities at places, of element pressures, or of inverted points."""
    space = ring(3)
    momentum, state = Momentum(space, AAA(), "axisymmetric"), State.intact(space)
    state.u = space.X * [0.3, -0.2]
    places = find_places(space, np.array([[1.5, 0.5]]))
    np.testing.assert_allclose(QUANTITIES["stretches"].values(momentum, state, places), [[1.3, 1.3, 0.8]], rtol=1e-12)
    J = 1.3**2 * 0.8
    np.testing.assert_allclose(indicators.element_pressure(space, state.u, 2.0), 2.0 * (J - 1.0), rtol=1e-12)
    beyond = np.broadcast_to([-2.5, 0.0], space.X.shape)
    assert indicators.inverted(space, beyond, np.ones_like(space.w))[0] == space.w.size
