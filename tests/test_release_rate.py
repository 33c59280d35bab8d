"""Energy release rate: closed forms, handbook, independence of the domain, configurational forces, running cracks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
import skfem
from bodies import box, distorted, grid, grips, held_body, momentum_of, patchy, wavy

from skfsink.errors import ParameterError
from skfsink.fem.space import Space
from skfsink.fields.body import Body
from skfsink.fields.configurational import configurational_forces
from skfsink.fields.crack import CrackTracker
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.fields.release_rate import energy_release_rate, stress_intensity
from skfsink.fields.state import State
from skfsink.loads.grips import Grip, Traction
from skfsink.loads.schedule import Loading
from skfsink.material import AAA, Material, NeoHookean, SinkLaw
from skfsink.material.fibres import HolzapfelGasserOgden
from skfsink.material.general import MooneyRivlin
from skfsink.material.regions import Region
from skfsink.methods.explicit import Explicit
from skfsink.methods.newton import Newton
from skfsink.methods.statics import Statics

TOUGH = SinkLaw(phi=1e3)  # never reached: gamma stays 1
AHEAD = np.array([1.0, 0.0])


class Cracked(NamedTuple):
    """A body with a slit from x = 0 to its tip, in equilibrium."""

    body: Body
    state: State
    tip: np.ndarray


def slit(x: np.ndarray, y: np.ndarray, tip: float, amount: float = 0.0, layers: np.ndarray | None = None) -> Space:
    """Grid over x and y (and, in space, `layers`) with a slit along y = 0 up to x = `tip`, distorted elsewhere."""
    axes = (x, y) if layers is None else (x, y, layers)
    mesh = (skfem.MeshQuad if layers is None else skfem.MeshHex).init_tensor(*axes)
    p, t = distorted(mesh, amount).p if amount else mesh.p.copy(), mesh.t.copy()
    on = np.abs(mesh.p[1]) < 1e-12
    p[:, on] = mesh.p[:, on]
    split = np.flatnonzero(on & (mesh.p[0] < tip - 1e-12))
    twin = np.arange(p.shape[1])
    twin[split] = p.shape[1] + np.arange(split.size)
    above = mesh.p[1, t].mean(axis=0) > 0
    t[:, above] = twin[t[:, above]]
    return Space(type(mesh)(np.hstack([p, p[:, split]]), t))


def rows(space: Space, axis: int, top: bool) -> np.ndarray:
    """Nodes at one end along an axis."""
    x = space.X[:, axis]
    return np.flatnonzero(np.isclose(x, x.max() if top else x.min()))


def loaded(space: Space, material: Material, held: list[tuple[np.ndarray, Grip]], tip: tuple[float, ...],
           tractions: list[tuple[np.ndarray, Traction]] | None = None, element: str = "jbar",
           steps: int = 4) -> Cracked:
    """A body in equilibrium at the load time 1 s, to which it is loaded in some steps."""
    loading = Loading(space, held, tractions or [])
    momentum = Momentum(space, material, element, dead=loading.dead)
    body, state = Body(momentum, DensitySolver(space, TOUGH), loading), State.intact(space)
    newton = Newton(momentum, body.free, 1e-8, 60)
    for k in range(steps):
        momentum.set_time(k / steps)
        state.u = newton.predict(state.u, loading.velocity(0.0) / steps)
        state.grip = (k + 1) / steps
        momentum.set_time(state.grip)
        state.u = newton.equilibrium(state.u)[0]
    return Cracked(body, state, np.array(tip))


def strip(material: Material, stretch: float, element: str = "jbar", amount: float = 0.15,
          h: float = 1 / 10) -> Cracked:
    """A strip of 8 x 1 mm, cut to the middle of its length, stretched between its long edges."""
    space = slit(np.linspace(0, 8, round(8 / h) + 1), np.linspace(-0.5, 0.5, round(1 / h) + 1), 4.0, amount)
    pull = 0.5 * (stretch - 1)
    return loaded(space, material, [(rows(space, 1, True), Grip("top", (0.0, pull))),
                                    (rows(space, 1, False), Grip("bottom", (0.0, -pull))),
                                    (rows(space, 0, True), Grip("right", (0.0, None)))], (4.0, 0.0), element=element)


def released(cracked: Cracked, radius: float) -> float:
    """G for an advance along x [N/mm]."""
    return energy_release_rate(*cracked[:2], cracked.tip, AHEAD, radius).G


def far(material: Material, stretch: float, element: str = "jbar") -> float:
    """W H of the strip, H = 1 mm [N/mm]; plane strain at fixed width is F = diag(1, stretch) with its own J."""
    F = np.diag([1.0, stretch, 1.0])
    if element == "planestress":
        F = material.thin_sheet(F[:2, :2])
    return float(material.energy(F))


SOFT = {"bulk_modulus": 2.0}  # MPa; a strip held at its width can be stretched in plane strain


@pytest.mark.parametrize(("material", "element", "stretch"), [
    (NeoHookean(**SOFT), "jbar", 1.3), (AAA(**SOFT), "plain", 1.2), (MooneyRivlin(bulk_modulus=0.5), "jbar", 1.3),
    (NeoHookean(), "planestress", 1.5), (AAA(), "planestress", 1.3),
    (MooneyRivlin(c1=0.3, c2=0.1), "planestress", 1.4)])
def test_strip_in_pure_shear_releases_its_energy_ahead(material: Material, element: str, stretch: float) -> None:
    """Fails if G is not W H: with another stress, another weight, or without a part of the energy."""
    cracked = strip(material, stretch, element)
    expected = far(material, stretch, element)
    for radius in (0.4, 0.48):
        assert released(cracked, radius) == pytest.approx(expected, rel=0.01)


def test_grips_that_do_not_deform_may_be_in_the_domain() -> None:
    """Fails if a domain from grip to grip is refused, or has another G than a small one: 0.1 % of W H."""
    material = NeoHookean()
    cracked = strip(material, 1.3, "planestress")
    assert released(cracked, 3.0) == pytest.approx(far(material, 1.3, "planestress"), rel=1e-3)


# --- a plate with an edge crack ---
WIDTH, CRACK, HALF = 1.0, 0.4, 1.5  # mm


def edge_crack(stress: float, material: Material, element: str = "jbar", turn: float = 0.0) -> Cracked:
    """A plate with an edge crack under remote tension [MPa]; elements of 0.002 mm at the tip."""
    def graded(to: float, n: int) -> np.ndarray:
        return np.linspace(0, 1, n + 1) ** 2 * (to - 0.2) + 0.2
    fine = 0.2 * np.linspace(0, 1, 11) ** 2
    x = np.concatenate([CRACK - graded(CRACK, 5)[::-1], CRACK - fine[-2::-1], CRACK + fine[1:],
                        CRACK + graded(WIDTH - CRACK, 6)[1:]])
    y = np.concatenate([fine[:-1], graded(HALF, 14)])
    space = slit(np.unique(x.round(12)), np.unique(np.concatenate([-y, y]).round(12)), CRACK)
    ligament = np.flatnonzero((np.abs(space.X[:, 1]) < 1e-9) & (space.X[:, 0] > 0.75 * WIDTH))[[0, -1]]
    return loaded(space, material, [(ligament[1:], Grip("end", (0.0, 0.0))), (ligament[:1], Grip("in", (None, 0.0)))],
                  (CRACK, 0.0), [(rows(space, 1, True), Traction("top", (0.0, stress))),
                                 (rows(space, 1, False), Traction("bottom", (0.0, -stress)))], element, steps=1)


@pytest.mark.parametrize("element", ["jbar", "planestress"])
def test_edge_crack_has_the_stress_intensity_of_the_handbook(element: str) -> None:
    """Fails if K is off by more than 1 %: a wrong modulus, or volumetric locking at nu = 0.4988.

    Tada, Paris and Irwin, The Stress Analysis of Cracks Handbook, single edge notch under tension (accurate to 0.5 %).
    """
    stress, material = 1e-4, AAA()
    a = CRACK / WIDTH
    angle = np.pi * a / 2
    factor = np.sqrt(np.tan(angle) / angle) * (0.752 + 2.02 * a + 0.37 * (1 - np.sin(angle)) ** 3) / np.cos(angle)
    expected = stress * np.sqrt(np.pi * CRACK) * factor
    cracked = edge_crack(stress, material, element)
    found = []
    for radius in (0.1, 0.15, 0.2, 0.3, 0.38):
        rate = energy_release_rate(*cracked[:2], cracked.tip, AHEAD, radius)
        found.append(stress_intensity(rate, material, plane_stress=element == "planestress"))
    assert found == pytest.approx([expected] * len(found), rel=0.01)
    assert np.ptp(found) < 0.01 * expected


def test_stress_intensity_is_of_small_strains_only() -> None:
    """Fails if the K of a linear body is made of a G at large strains."""
    cracked = strip(NeoHookean(), 1.3, "planestress")
    rate = energy_release_rate(*cracked[:2], cracked.tip, AHEAD, 0.4)
    with pytest.raises(ParameterError, match=r"a stress intensity factor needs strains up to 0.02"):
        stress_intensity(rate, NeoHookean(), plane_stress=True)


# --- independence of the domain, objectivity ---
def test_static_rate_does_not_depend_on_the_domain() -> None:
    """Fails if G changes by 2 % from three elements around the tip to the whole height, or with the mesh's shape."""
    cracked = strip(AAA(), 1.4, "planestress", amount=0.3, h=1 / 12)
    found = [energy_release_rate(*cracked[:2], cracked.tip, AHEAD, radius).G for radius in (0.3, 0.35, 0.4, 0.45, 0.49)]
    assert np.ptp(found) < 0.02 * found[-1]


def turned(angle: float) -> np.ndarray:
    """Rotation in the plane."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@pytest.mark.parametrize(("material", "element"), [
    (AAA(**SOFT), "jbar"), (NeoHookean(), "planestress"), (MooneyRivlin(bulk_modulus=0.5), "jbar")])
def test_rotated_body_has_the_same_rate(material: Material, element: str) -> None:
    """Fails if G depends on a rotation of the deformed body, or does not turn with the undeformed one."""
    cracked = strip(material, 1.2, element)
    body, state = cracked.body, cracked.state.copy()
    state.v, state.a = wavy(body.space, 3e3, 1), wavy(body.space, 3e8, 2)
    rate = energy_release_rate(body, state, cracked.tip, AHEAD, 0.4)
    assert abs(rate.G - rate.static) > 0.01 * rate.G
    Q, X = turned(0.7), body.space.X
    moved = state.copy()
    moved.u, moved.v, moved.a = (X + state.u) @ Q.T - X, np.zeros_like(X), np.zeros_like(X)
    assert released(cracked._replace(state=moved), 0.4) == pytest.approx(rate.static, rel=1e-6)
    space = Space(type(body.space.mesh)(Q @ body.space.mesh.p, body.space.mesh.t))
    other = Body(Momentum(space, material, element), DensitySolver(space, TOUGH), Loading.steady(
        space, np.ones(X.size, bool), np.zeros_like(X)))
    moved.u, moved.v, moved.a = state.u @ Q.T, state.v @ Q.T, state.a @ Q.T
    again = energy_release_rate(other, moved, Q @ cracked.tip, Q @ AHEAD, 0.4)
    assert abs(again.G - rate.G) < 1e-12 * rate.G
    np.testing.assert_allclose(again.vector, Q @ rate.vector, rtol=1e-10, atol=1e-10 * rate.G)


# --- configurational forces ---
def with_nodes_at(space: Space, X: np.ndarray) -> Space:
    """The same elements on other nodes."""
    return Space(type(space.mesh)(X.T.copy(), space.mesh.t), axisymmetric=space.axisymmetric)


@pytest.mark.parametrize(("kind", "element", "material"), [
    ("quad", "jbar", AAA()), ("quad", "plain", NeoHookean(bulk_modulus=20.0)), ("quad", "planestress", AAA()),
    ("quad", "planestress", MooneyRivlin()), ("quad", "planestress", HolzapfelGasserOgden(bulk_modulus=50.0)),
    ("quad", "jbar", HolzapfelGasserOgden()), ("hex", "jbar", AAA(bulk_modulus=50.0)), ("hex", "jbar", MooneyRivlin()),
    ("quad", "axisymmetric", AAA(bulk_modulus=50.0)), ("quad", "axisymmetric", MooneyRivlin())])
def test_configurational_forces_are_the_derivative_with_the_places_of_nodes(kind: str, element: str,
                                                                            material: Material) -> None:
    """Fails if the energy-momentum tensor is not that of the element, as without the term of J - J_bar."""
    space = box(kind, 4 if kind == "quad" else 2, 0.2)
    if element == "axisymmetric":
        space = Space(space.mesh.translated((0.5, 0.0)), axisymmetric=True)
    u, gamma = wavy(space, 0.15), patchy(space)
    forces = configurational_forces(momentum_of(space, material, gamma, element), u)
    rng, step = np.random.default_rng(3), 1e-6
    for _ in range(4):
        way = rng.uniform(-1, 1, space.X.shape)
        energies = []
        for sign in (1, -1):
            momentum = momentum_of(with_nodes_at(space, space.X + sign * step * way), material, gamma, element)
            momentum.force(u)
            energies.append(momentum.energy)
        slope = (energies[0] - energies[1]) / (2 * step)
        assert float(np.vdot(forces, way)) == pytest.approx(slope, rel=1e-6)


def test_rate_is_the_sum_of_configurational_forces() -> None:
    """Fails if the domain integral is not the energy that moving the nodes of the domain takes out of the body."""
    cracked = strip(NeoHookean(), 1.3, "planestress")
    forces = configurational_forces(cracked.body.momentum, cracked.state.u)
    q = np.clip(2 * (1 - np.linalg.norm(cracked.body.space.X - cracked.tip, axis=1) / 0.4), 0, 1)
    rate = energy_release_rate(*cracked[:2], cracked.tip, AHEAD, 0.4)
    np.testing.assert_allclose(rate.vector, -q @ forces, rtol=1e-10, atol=1e-12)


# --- bodies of revolution ---
def penny(h: float, *, ring: bool = False) -> Cracked:
    """Half of a cylinder of radius and height 8 mm with a penny-shaped crack of radius 1 mm, strained by 1e-3.

    Elements are h large at the crack. A `ring` is that crack from outside, up to the radius of 1 mm.
    """
    fine = np.arange(round(2 / h) + 1) * h
    steps = [h * 1.1]
    while sum(steps) < 6.0:
        steps.append(steps[-1] * 1.1)
    line = np.append(fine, 2.0 + np.cumsum(steps) * 6.0 / sum(steps))
    space = Space(skfem.MeshQuad.init_tensor(line, line), axisymmetric=True)
    r, y = space.X.T
    middle = (y < 1e-9) & ((r < 1 + 1e-9) if ring else (r > 1 - 1e-9))
    held = [(np.flatnonzero(middle), Grip("middle", (None, 0.0))), (rows(space, 1, True), Grip("top", (None, 8e-3)))]
    return loaded(space, NeoHookean(bulk_modulus=2.0), held, (1.0, 0.0), element="axisymmetric", steps=1)


def test_penny_shaped_crack() -> None:
    """Fails if G is not that of Sneddon, 4 (1 - nu^2) s^2 a/(pi E), or depends on the domain; half of it is in a half.

    Seen to fail by 18 to 50 % without the part of S around the axis. The cylinder has (a/b = 1/8) 0.2 % more; the error
    of the mesh is of first order in h, 1.1 % for 1/32.
    """
    material, ratios = NeoHookean(bulk_modulus=2.0), []
    k, mu = material.bulk_modulus, material.shear_modulus
    young, nu = 9 * k * mu / (3 * k + mu), (3 * k - 2 * mu) / (2 * (3 * k + mu))
    for h in (1 / 16, 1 / 32):
        cracked = penny(h)
        body, state = cracked.body, cracked.state
        stress = float(body.momentum.force(state.u)[rows(body.space, 1, True), 1].sum()) / (np.pi * 64)
        found = [2 * energy_release_rate(body, state, cracked.tip, AHEAD, radius).G for radius in (0.4, 0.6, 0.8)]
        assert np.ptp(found) < 1e-4 * found[0]
        ratios.append(found[1] / (4 * (1 - nu**2) * stress**2 / (np.pi * young)))
    assert 2 * ratios[1] - ratios[0] == pytest.approx(1.0023, abs=2e-3)
    assert abs(ratios[1] - 1.0023) < 0.013
    with pytest.raises(ParameterError, match="reaches the axis of revolution: give a smaller radius"):
        energy_release_rate(body, state, cracked.tip, AHEAD, 1.1)


def test_rate_of_a_ring_is_what_its_energies_say() -> None:
    """Fails if the length of the front is not that of the tip, or an advance towards the axis is another one."""
    cracked, inwards = penny(1 / 16, ring=True), np.array([-1.0, 0.0])
    rate = energy_release_rate(*cracked[:2], cracked.tip, inwards, 0.5)
    forces = configurational_forces(cracked.body.momentum, cracked.state.u)
    q = np.clip(2 * (1 - np.linalg.norm(cracked.body.space.X - cracked.tip, axis=1) / 0.5), 0, 1)
    np.testing.assert_allclose(rate.vector * 2 * np.pi, -q @ forces, rtol=1e-9, atol=1e-12 * rate.G)
    assert rate.thickness == pytest.approx(2 * np.pi) and rate.G > 0.0 and rate.strain < 0.02


# --- bodies in space, halves, refusals ---
def test_sheet_in_space_has_the_rate_of_plane_strain() -> None:
    """Fails if the total is not divided by the length of the front, or the domain leaves out part of the thickness."""
    x, y, z = np.linspace(0, 3, 31), np.linspace(-0.5, 0.5, 11), np.array([0.0, 0.1, 0.3])
    material, found = NeoHookean(**SOFT), []
    for layers in (None, z):
        space = slit(x, y, 1.5, layers=layers)
        more: tuple[float, ...] = () if layers is None else (0.0,)
        held = [(rows(space, 1, top), Grip("grip", (0.0, 0.1 if top else -0.1, *more))) for top in (True, False)]
        if layers is not None:
            held += [(rows(space, 2, top), Grip("face", (None, None, 0.0))) for top in (True, False)]
        cracked = loaded(space, material, held, (1.5, 0.0, *([] if layers is None else [0.1])))
        front = None if layers is None else np.array([0.0, 0.0, 2.0])
        found.append(energy_release_rate(*cracked[:2], cracked.tip, np.array([1.0, 0.0, *more]), 0.45, front=front))
    assert abs(found[1].G - found[0].G) < 1e-4 * found[0].G
    assert found[1].thickness == pytest.approx(0.3)
    with pytest.raises(ParameterError, match="front, the direction of the crack's front, must be given of a body in"):
        energy_release_rate(*cracked[:2], cracked.tip, np.array([1.0, 0.0, 0.0]), 0.45)
    with pytest.raises(ParameterError, match="direction must be at right angles to front; the cosine between them is"):
        energy_release_rate(*cracked[:2], cracked.tip, np.array([1.0, 0.0, 1.0]), 0.45, front=front)


def test_half_of_a_body_has_half_of_the_rate() -> None:
    """Fails if what is held in a plane of symmetry counts as a grip that deforms, or its energy is wrong."""
    material, pull = NeoHookean(), 0.1
    whole = strip(material, 1 + 2 * pull, "planestress", amount=0.0)
    mesh = skfem.MeshQuad.init_tensor(np.linspace(0, 8, 81), np.linspace(0, 0.5, 6))
    space = Space(mesh)
    ligament = np.flatnonzero((space.X[:, 1] < 1e-9) & (space.X[:, 0] > 4 - 1e-9))
    half = loaded(space, material, [(rows(space, 1, True), Grip("top", (0.0, pull))),
                                    (rows(space, 0, True), Grip("right", (0.0, None))),
                                    (ligament, Grip("plane", (None, 0.0)))], (4.0, 0.0), element="planestress")
    found = [energy_release_rate(*one[:2], one.tip, AHEAD, 0.45).G for one in (half, whole)]
    assert 2 * found[0] == pytest.approx(found[1], rel=1e-6)


@pytest.mark.parametrize(("tip", "direction", "radius", "message"), [
    ((4.0, 0.0), (1.0, 0.0), 0.0, r"radius must be a finite number in \(0, inf\) mm; got 0"),
    ((4.0, 0.0), (0.0, 0.0), 0.4, "direction must not be zero"),
    ((4.0, np.nan), (1.0, 0.0), 0.4, "tip must be 2 finite numbers"),
    ((4.0, 0.0), (1.0, 0.0, 0.0), 0.4, "direction must be 2 finite numbers"),
    ((4.0, 0.0), (1.0, 0.0), 0.1, r"has 0 elements within half of the radius, and needs 4: give a greater radius"),
    ((9.5, 0.0), (1.0, 0.0), 0.4, r"around the tip at \(9.5, 0\) mm has 0 elements"),
    ((7.8, 0.0), (1.0, 0.0), 0.4, r"has surfaces of the body across the way of the crack, which change its energy rel"),
    ((4.0, 0.0), (1.0, 0.5), 3.0, r"has surfaces of the body across the way")])
def test_no_rate_of_what_is_no_domain(tip: tuple[float, ...], direction: tuple[float, ...], radius: float,
                                      message: str) -> None:
    """Fails if a domain that cannot be is taken, or one that gets energy from elsewhere than around it."""
    cracked = strip(NeoHookean(), 1.3, "planestress")
    with pytest.raises(ParameterError, match=message):
        energy_release_rate(*cracked[:2], np.array(tip), np.array(direction), radius)


def test_no_rate_with_forces_that_are_not_elastic() -> None:
    """Fails if dead loads, grips that deform, viscosity, fibres that turn or another material go unnoticed."""
    cracked = edge_crack(1e-4, AAA())
    with pytest.raises(ParameterError, match="has a dead load in it"):
        energy_release_rate(*cracked[:2], cracked.tip, AHEAD, 1.7)
    space = slit(np.linspace(0, 8, 81), np.linspace(-0.5, 0.5, 11), 4.0)
    viscous = strip(NeoHookean(viscosity=1e-6), 1.3, "planestress")
    assert energy_release_rate(*viscous[:2], viscous.tip, AHEAD, 0.4).G > 0
    viscous.state.v[:] = 1.0
    with pytest.raises(ParameterError, match="a viscous body that moves has no energy release rate"):
        energy_release_rate(*viscous[:2], viscous.tip, AHEAD, 0.4)
    deformed = strip(NeoHookean(), 1.3, "planestress")
    deformed.state.u[rows(space, 1, True), 0] = 0.01 * space.X[rows(space, 1, True), 0]
    with pytest.raises(ParameterError, match="has a grip in it that is deformed along the crack"):
        energy_release_rate(*deformed[:2], deformed.tip, AHEAD, 0.6)
    middles = space.X[space.conn].mean(axis=1)
    for where, taken in ((middles[:, 0] > 4.2, False), (middles[:, 1] > 0, True)):
        region = Region("stiff", np.flatnonzero(where), NeoHookean(mu=2.0), TOUGH)
        momentum = Momentum(space, NeoHookean(), "planestress", regions=(region,))
        state = State.intact(space)
        body = Body(momentum, DensitySolver(space, TOUGH, regions=(region,)), Loading.steady(
            space, np.ones(space.X.size, bool), np.zeros_like(space.X)))
        state.u = strip(NeoHookean(), 1.3, "planestress", amount=0.0).state.u
        if taken:
            assert energy_release_rate(body, state, np.array([4.0, 0.0]), AHEAD, 0.45).G > 0
        else:
            with pytest.raises(ParameterError, match="has faces between materials across the way"):
                energy_release_rate(body, state, np.array([4.0, 0.0]), AHEAD, 0.45)


class Winding(HolzapfelGasserOgden):
    """Fibres that turn along the body."""

    def fibres(self, centres: np.ndarray) -> np.ndarray:
        angle = 0.1 * centres[:, 0]
        return np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)[:, None]


def test_no_rate_where_fibres_turn() -> None:
    """Fails if a body that is not homogeneous along the crack passes for one that is."""
    space = slit(np.linspace(0, 8, 81), np.linspace(-0.5, 0.5, 11), 4.0)
    for material, message in ((HolzapfelGasserOgden(), ""), (Winding(), "has fibres that turn")):
        momentum = Momentum(space, material)
        body = Body(momentum, DensitySolver(space, TOUGH), Loading.steady(space, np.ones(space.X.size, bool),
                                                                          np.zeros_like(space.X)))
        state = State.intact(space)
        state.u = np.sign(space.X[:, 1:]) * [0.0, 1e-3]
        if message:
            with pytest.raises(ParameterError, match=message):
                energy_release_rate(body, state, np.array([4.0, 0.0]), AHEAD, 0.4)
        else:
            energy_release_rate(body, state, np.array([4.0, 0.0]), AHEAD, 0.4)


# --- a running crack ---
@pytest.mark.slow
def test_running_crack_is_fed_what_the_sink_takes() -> None:
    """Fails if the flux of energy into the domain of a running crack is not what the sink takes there, per length.

    A long strip between rigid grips, of which only a layer along the middle can fail, so that the crack keeps to it.
    Inertia takes 0.4 of the static flux away: a kinetic term with another sign or factor is off by more than 5 %. The
    strip gives W H per length, of which the rest is left as motion behind the crack.
    """
    length, height, cut, l = 10.0, 2.4, 2.0, 0.3
    space = Space(grid("quad", (167, 41), (length, height)).remove_elements(_row(167, 41, length, height, cut)))
    middle = space.X[space.conn].mean(axis=1)
    material, law = AAA(), SinkLaw(length_scale=l)
    tough = (Region("tough", np.flatnonzero(np.abs(middle[:, 1] - height / 2) > 0.4 * l), material,
                    SinkLaw(length_scale=l, phi=1.0)),)
    momentum = Momentum(space, material, "planestress", regions=tough)
    body = held_body(momentum, DensitySolver(space, law, regions=tough), *grips(space, 1.0))
    state = State.intact(space)
    for _ in Statics(body).load(state):
        pass
    state.begin_event(0.02)
    far_away = far(material, 1 + 2 * state.grip / height, "planestress") * height
    integrator = Explicit(held_body(momentum, body.density, body.free, np.zeros_like(space.X)))
    integrator.begin(state)
    tracker = CrackTracker(space, l, material.shear_wave_speed, [], np.zeros(0, int))
    rows = []
    for _ in integrator.run(state, 1e-3):
        tracker.mark(state.time, state.gamma)
        if state.step % 7 == 0 and (tips := tracker.look(state.time, state.gamma)).branches:
            if tips.position[0] > cut + 1.5:
                rates = [energy_release_rate(body, state, tips.position, AHEAD, radius * l) for radius in (6, 8)]
                rows.append([tips.position[0], state.ledger.sink + state.ledger.deletion,
                             *(value for rate in rates for value in (rate.G, rate.static))])
            if tips.position[0] > length - 2.5:
                break
    x, taken, flux, static, wide, _ = np.array(rows).T
    per_length = (taken[-1] - taken[0]) / (x[-1] - x[0])
    assert flux.mean() == pytest.approx(per_length, rel=0.05)
    assert wide.mean() == pytest.approx(flux.mean(), rel=0.02)
    assert static.mean() > 1.3 * per_length
    assert 1.2 * per_length < far_away


def _row(nx: int, ny: int, length: float, height: float, cut: float) -> np.ndarray:
    """Elements of the middle row of a grid up to x = `cut`."""
    mesh = grid("quad", (nx, ny), (length, height))
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    return np.flatnonzero((x < cut) & (np.abs(y - height / 2) < 0.51 * height / ny))
