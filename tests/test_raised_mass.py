"""More mass for the smallest elements: which, how much, and what it leaves as it is."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
from bodies import Fracture, boundary, box, grid, held_body

from skfsink.fem.pattern import Pattern
from skfsink.fem.space import Space
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.material import AAA, SinkLaw
from skfsink.material.regions import Region
from skfsink.methods import explicit as module
from skfsink.methods.explicit import Explicit
from skfsink.methods.raised_mass import raised_mass


def graded(kind: str = "quad") -> Space:
    """A body of 1 mm, some layers of which are four times as thin as the others."""
    mesh = grid(kind, (6, 10) if kind == "quad" else (4, 4, 8))
    axis = mesh.p.shape[0] - 1
    heights = np.linspace(0, 1, 11 if kind == "quad" else 9)
    thin = np.where(np.arange(heights.size - 1) < 3, 0.25, 1.0)
    mapped = np.concatenate([[0.0], np.cumsum(thin)]) / thin.sum()
    p = mesh.p.copy()
    p[axis] = np.interp(p[axis], heights, mapped)
    return Space(type(mesh)(p, mesh.t))


def highest(momentum: Momentum, mass: np.ndarray) -> float:
    """Highest frequency of the undeformed body, held at its boundary [1/s]."""
    space, free = momentum.space, np.repeat(~boundary(momentum.space), momentum.space.dim)
    pattern = Pattern(space, space.dim, free, upper=True)
    scale = 1 / np.sqrt(np.repeat(mass, space.dim)[free])
    K = pattern.symmetric(momentum.tangent(pattern, np.zeros_like(space.X))).toarray()
    return float(np.sqrt(la.eigvalsh(scale[:, None] * K * scale)[-1]))


@pytest.mark.parametrize("kind", ["quad", "hex"])
def test_small_elements_swing_like_the_others(kind: str) -> None:
    """Fails if the thin layers still set the step, or others are heavier, or more than the share of the volume is.

    Seen to fail with the factors' root in place of the factors, and with the share of the number of elements.
    """
    space = graded(kind)
    momentum = Momentum(space, AAA())
    thin = 0.5 * space.V.max() > space.V
    share = 1.001 * space.V[thin].sum() / space.V.sum()
    factors, added = raised_mass(momentum, share)
    assert factors is not None and (factors[~thin] == 1).all() and (factors[thin] > 4).all()
    coarse = Momentum(Space(grid(kind, (6, 8) if kind == "quad" else (4, 4, 6))), AAA())
    before, after = (highest(momentum, momentum.lumped_mass(0.0, f)) for f in (None, factors))
    others = highest(coarse, coarse.lumped_mass(0.0))
    assert after < 1.3 * others and before > 2 * others
    mass = momentum.lumped_mass(0.0, factors).sum() / momentum.lumped_mass(0.0).sum()
    assert added == pytest.approx(mass - 1, rel=1e-12)
    assert raised_mass(momentum, 0.5 * share) == (None, 0.0)  # the others of them set the step anyway


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_equal_elements_keep_their_mass(share: float) -> None:
    """Fails if mass is added where no element is smaller than the others."""
    space = Space(grid("quad", (5, 5)))
    assert raised_mass(Momentum(space, AAA()), share) == (None, 0.0)
    assert raised_mass(Momentum(box("quad", 5), AAA()), 0.0) == (None, 0.0)


def test_elements_at_an_axis_of_revolution_are_no_small_ones() -> None:
    """Fails if a small radius makes a small element, or one that is thin in the half plane is not seen."""
    space = Space(grid("quad", (20, 20))).revolved()
    assert raised_mass(Momentum(space, AAA(), "axisymmetric"), 0.05) == (None, 0.0)
    flat, round_ = graded(), graded().revolved()
    thin = 0.5 * flat.V.max() > flat.V
    plane, factors = (raised_mass(Momentum(of, AAA(), element), 0.2)[0]
                      for of, element in ((flat, "jbar"), (round_, "axisymmetric")))
    assert plane is not None and factors is not None and (factors[thin] > 4).all()
    np.testing.assert_allclose(factors, plane, rtol=1e-12)


def test_fast_materials_count_as_small_elements() -> None:
    """Fails if the speed of waves in the material of an element is not looked at.

    Seen to fail with one speed for all.
    """
    space = Space(grid("quad", (6, 6)))
    stiff = np.arange(3)
    momentum = Momentum(space, AAA(), regions=(Region("stiff", stiff, AAA(bulk_modulus=2000.0), SinkLaw()),))
    factors, _ = raised_mass(momentum, 0.1)
    assert factors is not None and (np.flatnonzero(factors[:, 0] > 1) == stiff).all()
    slow, fast = (m.dilatational_wave_speed for m in (AAA(), AAA(bulk_modulus=2000.0)))
    np.testing.assert_allclose(factors[stiff, 0], (fast / slow) ** 2, rtol=1e-12)


def test_energies_of_a_heavier_body(fracture: Fracture, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if kinetic energy or ledger do not know of the added mass.

    Seen to fail with the intact mass in the kinetic energy after a solve for gamma.
    """
    fresh, momentum, _, free, velocity = fracture
    body = held_body(Momentum(momentum.space, momentum.material), DensitySolver(momentum.space, SinkLaw()), free,
                     velocity)
    factors = 1 + np.random.default_rng(0).random((momentum.space.n_elements, 1))
    monkeypatch.setattr(module, "raised_mass", lambda *_: (factors, 0.5))
    explicit, state = Explicit(body), fresh()
    explicit.begin(state)
    for _ in range(150):
        explicit.step(state)
        assert abs(state.ledger.balance) < 1e-10 * state.ledger.initial
    kinetic = 0.5 * float(explicit.mass @ (state.v**2).sum(axis=1))
    assert state.ledger.kinetic == pytest.approx(kinetic, rel=1e-12) and state.ledger.kinetic > 0
    assert state.gamma.min() < 0.5
