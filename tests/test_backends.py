"""What evaluates the weak forms: compiled loops and scikit-fem forms make the same run, and a changed form another."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from bodies import box, close, grid, grips, held_body, notched, patchy, wavy
from skfem import BilinearForm, Functional, LinearForm
from skfem.helpers import ddot, grad

from skfsink.errors import ParameterError
from skfsink.fem import assembled
from skfsink.fem.assembled import AssembledMomentum
from skfsink.fem.backends import BACKENDS
from skfsink.fem.forms import MomentumForms
from skfsink.fem.pattern import Pattern
from skfsink.fem.space import Space
from skfsink.fields.body import Body
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.fields.state import State
from skfsink.material import AAA, HolzapfelGasserOgden, Material, MooneyRivlin, NeoHookean, Ogden, SinkLaw
from skfsink.material.regions import Region
from skfsink.methods.controls import HHTControls
from skfsink.methods.explicit import Explicit
from skfsink.methods.hht import HHT
from skfsink.methods.statics import Statics
from skfsink.scene.controls import Controls

BOTH = ("compiled", "forms")
TISSUE = HolzapfelGasserOgden(c=0.3, k1=0.6, k2=3.0, kappa=0.1, bulk_modulus=50.0)
OGDEN = Ogden(mu=(0.9, 0.05, -0.1), alpha=(1.3, 4.0, -2.0), bulk_modulus=50.0)
FIELDS = ("u", "v", "a", "gamma", "W_max")


def scattered(space: Space, *materials: Material) -> list[Region]:
    """Regions of some materials, each of a sixth of the elements at random."""
    owner = np.random.default_rng(8).permutation(space.n_elements) % 6
    return [Region(str(i), np.flatnonzero(owner == i), material, SinkLaw()) for i, material in enumerate(materials)]


# --- one evaluation ---
@pytest.mark.parametrize(("kind", "element", "material"), [
    (kind, element, material) for kind, element in (("quad", "jbar"), ("quad", "plain"), ("quad", "planestress"),
                                                    ("quad", "axisymmetric"), ("hex", "jbar"), ("hex", "plain"))
    for material in (AAA(), TISSUE, OGDEN)],
    ids=lambda value: value if isinstance(value, str) else type(value).__name__)
def test_all_that_the_momentum_balance_asks_for_is_equal(kind: str, element: str, material: Material) -> None:
    """Fails if the backends differ in any answer: in dead, soft, crushed or unstable points, parts, or the half stored.

    The tangent is wanted on the upper triangle over some unknowns; the convex one where it differs from the plain one.
    """
    space = box(kind, 9 if kind == "quad" else 2)
    space = space.revolved() if element == "axisymmetric" else space
    regions = scattered(space, NeoHookean(mu=3.0, bulk_modulus=100.0, density=900.0),
                        MooneyRivlin(bulk_modulus=30.0))
    rng = np.random.default_rng(3)
    free, deleted = rng.uniform(size=space.X.size) < 0.9, rng.uniform(size=space.n_elements) < 0.2
    nodal, inverse_mass = rng.uniform(0, 1, space.n_nodes), rng.uniform(0, 2, space.X.shape)
    nodal[:3] = 5e-4
    pattern, u = Pattern(space, space.dim, free, upper=True), wavy(space, 0.25)
    found: dict[str, list[np.ndarray | float]] = {}
    for name in BOTH:
        momentum = Momentum(space, material, element, regions=regions, kernels=name)
        answers = found[name] = [momentum.force(u), momentum.set_gamma(nodal, deleted), momentum.gamma]
        for scale in (0.5, 1.0, 2.5):
            force = momentum.force(scale * u)
            answers += [force, momentum.W, momentum.energy, momentum.least_J, momentum.backend.mean_force(),
                        momentum.tangent(pattern, scale * u), momentum.tangent(pattern, scale * u, convex=True),
                        momentum.stiffest(scale * u, inverse_mass)]
        assert abs(answers[-2] - answers[-3]).max() > 1e-3 * abs(answers[-3]).max()  # of scale 2.5
        assert answers[-5] < 0.0                                                    # elements are inside out
        answers += [momentum.consistent_mass(pattern), momentum.lumped_mass(0.1)]
        gamma = patchy(space)
        momentum.backend.set_gamma(gamma)
        answers += [momentum.backend.untile(momentum.backend.gamma), momentum.force(u)]
    for compiled, forms in zip(*found.values(), strict=True):
        close(np.asarray(forms), np.asarray(compiled), 1e-11)


@pytest.mark.parametrize("aspect", [0.3, 1.0, 4.0])
@pytest.mark.parametrize("gradient", ["monotone", "gauss"])
def test_gradient_term_is_equal(kind: str, gradient: str, aspect: float) -> None:
    """Fails if the matrix of the gradient term differs, on flat, square and tall elements, distorted or not.

    Seen to fail where one of the two moves positive off-diagonals without another rule.
    """
    for amount in (0.0, 0.2):
        mesh = box(kind, 6 if kind == "quad" else 3, amount).mesh
        space = Space(mesh.scaled((*[1.0] * (mesh.dim() - 1), aspect)))
        pattern = Pattern(space)
        found = [BACKENDS[name].density(space, 0.3).laplacian(pattern, monotone=gradient == "monotone")
                 for name in BOTH]
        close(found[1], found[0], 1e-13)


@pytest.mark.parametrize("sink", ["lumped", "consistent", "nearest"])
def test_density_is_equal(kind: str, sink: str) -> None:
    """Fails if a matrix of the mass balance differs."""
    space = box(kind, 6 if kind == "quad" else 3)
    W = np.random.default_rng(1).uniform(0.0, 0.5, space.w.shape)
    law = SinkLaw(phi=0.3, m=2.0, length_scale=0.3)
    found = [DensitySolver(space, law, sink, tolerance=1e-12, kernels=name).solve(W, np.ones(space.n_nodes))
             for name in BOTH]
    assert found[0].min() < 0.9
    close(found[1], found[0], 1e-9)


# --- whole runs ---
def body_of(space: Space, name: str, material: Material | None = None, element: str = "jbar",
            regions: Sequence[Region] = ()) -> Body:
    """A body whose ends are pulled apart."""
    return held_body(Momentum(space, material or AAA(), element, regions=regions, kernels=name),
                     DensitySolver(space, SinkLaw(), regions=regions, kernels=name), *grips(space, 1e-3))


def loaded(body: Body) -> State:
    """The body at its onset."""
    state = State.intact(body.space)
    for _ in Statics(body).load(state):
        pass
    return state


def equal(states: Sequence[State], tolerance: float = 1e-10) -> None:
    """Assert that fields and the ledger agree, relative to their greatest entries."""
    one, two = states
    for name in FIELDS:
        if abs(getattr(one, name)).max() > 0.0:
            close(getattr(two, name), getattr(one, name), tolerance)
    assert two.time == pytest.approx(one.time, rel=tolerance)
    scale = tolerance * max(abs(one.ledger.initial), one.ledger.elastic)
    for name in ("elastic", "kinetic", "work", "sink_stored", "sink_kinetic", "numerical"):
        assert getattr(two.ledger, name) == pytest.approx(getattr(one.ledger, name), abs=scale), name


@pytest.mark.slow
def test_a_loading_and_200_steps_are_the_same() -> None:
    """Fails if any of it differs by more than 1e-10: statics up to the onset, then 200 explicit steps past it.

    gamma falls in both, so that the sink, the masses and the convex tangents take part.
    """
    space, onsets, ends = notched(15, 2.0, 0.6), [], []
    assert 200 <= space.n_elements <= 225
    for name in BOTH:
        body = body_of(space, name)
        state = loaded(body)
        onsets.append(copy.deepcopy(state))
        state.begin_event(0.01)
        body.take(state)
        explicit = Explicit(body)
        explicit.begin(state)
        for _ in range(200):
            explicit.step(state)
        ends.append(state)
    assert ends[0].gamma.min() < 0.9 * onsets[0].gamma.min() and ends[0].ledger.sink_stored > 0.0
    equal(onsets)
    equal(ends)


@pytest.mark.parametrize("name", ["hexahedra", "a sheet", "parts and fibres"])
def test_a_few_steps_are_the_same(name: str) -> None:
    """Fails if hexahedra, a thin sheet, or a body of several materials step otherwise than their forms."""
    space = Space(grid("hex", (3, 4, 2), (1.0, 1.5, 0.3))) if name == "hexahedra" else notched(9, 1.5, 0.5)
    element = "planestress" if name == "a sheet" else "jbar"
    regions = scattered(space, TISSUE, NeoHookean()) if name == "parts and fibres" else []
    states = []
    for backend in BOTH:
        body = body_of(space, backend, element=element, regions=regions)
        state = State.intact(space)
        state.u[:, 0], state.u[:, 1] = (1 / 1.2 - 1) * space.X[:, 0], 0.2 * space.X[:, 1]
        body.take(state)
        explicit = Explicit(body)
        explicit.begin(state)
        for _ in range(12):
            explicit.step(state)
        states.append(state)
    equal(states)


@pytest.mark.slow
def test_implicit_steps_are_the_same() -> None:
    """Fails if the consistent mass or the residual test of HHT depends on the backend."""
    space, states = notched(9, 1.5, 0.5), []
    for name in BOTH:
        body = body_of(space, name)
        state = loaded(body)
        state.begin_event(0.01)
        body.take(state)
        hht = HHT(body, HHTControls(mass="consistent", dt=2e-8))
        hht.begin(state)
        for count, _ in enumerate(hht.run(state, 1.0)):
            if count == 4:
                break
        hht.sync(state)
        states.append(state)
    equal(states)


# --- another form ---
class Stiffened(AssembledMomentum):
    """The body with a neo-Hookean term more, of the shear modulus `more` [MPa]: W + more/2 (F : F - 3 - 2 log J)."""

    more = 0.2

    def forms(self, material: Material) -> MomentumForms:
        forms = super().forms(material)

        def gradient(w):
            return np.eye(2)[:, :, None, None] + w["displacement"].grad

        def inverse(w):
            return np.moveaxis(np.linalg.inv(np.moveaxis(gradient(w), (0, 1), (-2, -1))), (-2, -1), (0, 1))

        @Functional
        def energy(w):
            F = gradient(w)
            J = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
            return forms.energy.form(w) + 0.5 * self.more * (ddot(F, F) - 2 - 2 * np.log(J))

        @LinearForm
        def residual(v, w):
            P = self.more * (gradient(w) - np.swapaxes(inverse(w), 0, 1))
            return forms.residual.form(v, w) + w["gamma"] * ddot(P, grad(v))

        @BilinearForm
        def tangent(du, v, w):
            a, b, G = grad(du), grad(v), inverse(w)
            turned = np.einsum("Ji...,kJ...,Lk...,iL...->...", G, a, G, b)
            return forms.tangent.form(du, v, w) + w["gamma"] * self.more * (ddot(a, b) + turned)

        return replace(forms, energy=energy, residual=residual, tangent=tangent)


@pytest.mark.slow
def test_a_changed_form_changes_the_run_and_no_compiled_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a run does not take a form from the registry, or not its energy, force and tangent.

    The stiffened plate carries more at the same stretch, by what its term says; Newton's method converges on the
    tangent, and the balance of energy of explicit steps closes. The compiled run is the same before and after.
    """
    space = notched(9, 1.5, 0.5)
    before = loaded(body_of(space, "compiled"))
    monkeypatch.setitem(BACKENDS, "stiffened", BACKENDS["forms"]._replace(momentum=Stiffened))
    assert Controls(kernels="stiffened").kernels == "stiffened"
    after, changed = loaded(body_of(space, "compiled")), loaded(body_of(space, "stiffened"))
    np.testing.assert_array_equal(after.u, before.u)
    assert changed.grip != pytest.approx(before.grip, rel=1e-3)
    momentum, plain = (Momentum(space, AAA(), kernels=name) for name in ("stiffened", "forms"))
    u = 0.05 * np.sin(3 * space.X)
    plain.force(u)
    force, F = momentum.force(u), np.eye(2) + space.gradient(u)
    term = 0.1 * (np.einsum("eqiJ,eqiJ->eq", F, F) - 2 - 2 * np.log(np.linalg.det(F)))
    assert momentum.energy - plain.energy == pytest.approx(float((space.w * term).sum()), rel=1e-9)
    d = np.random.default_rng(0).normal(size=u.shape)
    slopes = []
    for h in (1e-5, -1e-5):
        slopes.append((momentum.force(u + h * d), momentum.energy))
    assert (slopes[0][1] - slopes[1][1]) / 2e-5 == pytest.approx(float(np.vdot(force, d)), rel=1e-5)
    pattern = Pattern(space, 2)
    close(pattern.matrix(momentum.tangent(pattern, u)) @ d.ravel(),
          ((slopes[0][0] - slopes[1][0]) / 2e-5).ravel(), 1e-5)
    body = body_of(space, "stiffened")
    changed.begin_event(0.01)
    body.take(changed)
    explicit = Explicit(body)
    explicit.begin(changed)
    for _ in range(50):
        explicit.step(changed)
    assert abs(changed.ledger.numerical) < 1e-4 * changed.ledger.initial


# --- how a run is asked for it ---
def test_names_and_sizes_are_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a backend that does not exist, or a body that would take days, is taken in silence."""
    with pytest.raises(ParameterError, match=r"kernels must be one of compiled, forms.*; got 'gpu'"):
        Controls(kernels="gpu")
    with pytest.raises(ParameterError, match=r"kernels must be one of compiled, forms.*; got 'gpu'"):
        Momentum(box("quad", 2), AAA(), kernels="gpu")
    monkeypatch.setitem(assembled.MOST, 2, 8)
    BACKENDS["compiled"].check(box("quad", 3))
    with pytest.raises(ParameterError, match="kernels forms is for at most 8 quadrilaterals; this body has 9: take "):
        BACKENDS["forms"].check(box("quad", 3))
