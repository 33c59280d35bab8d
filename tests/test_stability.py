"""The stability limit of the explicit scheme, and the amplification of the implicit one."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
from bodies import boundary, box, crack, ends, held_body

from skfsink.fem.pattern import Pattern
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.fields.state import State
from skfsink.material import AAA, SinkLaw
from skfsink.methods.controls import ExplicitControls, HHTControls
from skfsink.methods.explicit import Explicit
from skfsink.methods.frequency import highest_frequency
from skfsink.methods.hht import HHT
from skfsink.methods.statics import Statics

CASES = ["intact", "stretched", "cracked", "scattered", "stretched cracked", "stretched scattered"]


def body(kind: str, case: str) -> tuple[Momentum, DensitySolver, np.ndarray, State]:
    """A body held all around, in equilibrium: intact or damaged (a crack, or random gamma over four decades)."""
    space = box(kind, 12 if kind == "quad" else 5, 0.2)
    momentum, density = Momentum(space, AAA()), DensitySolver(space, SinkLaw())
    free = np.repeat(~boundary(space), space.dim)
    state = State.intact(space)
    if "cracked" in case:
        state.gamma = density.solve(crack(space, 0.12), state.gamma)
        assert state.gamma.min() < 1e-14
    if "scattered" in case:
        state.gamma = 10 ** np.random.default_rng(0).uniform(-4, 0, space.n_nodes)
    if "stretched" in case:
        state.u = space.X * (np.array([1.3, 1 / 1.3, 1.0])[:space.dim] - 1)
    momentum.set_gamma(state.gamma, state.deleted)
    if case.startswith("stretched "):
        state.u, _ = Statics(held_body(momentum, density, free, np.zeros_like(space.X))).equilibrium(state.u)
    return momentum, density, free, state


@pytest.mark.parametrize("case", CASES)
def test_estimate_of_the_highest_frequency(kind: str, case: str):
    """Fails if Lanczos, the mass floor or the tangent of the damaged body is off: within 1 % below the dense result.

    The cheap indicator, the Rayleigh quotient of one element's volumetric mode, must not exceed it either.
    """
    momentum, density, free, state = body(kind, case)
    mass = momentum.lumped_mass(1e-3)
    pattern = Pattern(momentum.space, momentum.space.dim, free, upper=True)
    omega, mode = highest_frequency(momentum, pattern, free, state.u, mass)
    scale = 1 / np.sqrt(np.repeat(mass, momentum.space.dim)[free])
    K = pattern.symmetric(momentum.tangent(pattern, state.u)).toarray()
    exact = np.sqrt(la.eigvalsh(scale[:, None] * K * scale)[-1])
    assert 0.99 * exact < omega < exact * (1 + 1e-9)
    again, _ = highest_frequency(momentum, pattern, free, state.u, mass, mode)
    assert 0.99 * exact < again < exact * (1 + 1e-9)  # started from that mode, zero almost everywhere
    explicit = Explicit(held_body(momentum, density, free, np.zeros_like(state.u)))
    explicit.begin(state)
    assert 0.3 * exact < np.sqrt(momentum.stiffest(state.u, explicit._inverse)) < exact


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("courant", [0.98, 1.03])
def test_explicit_scheme_is_stable_just_below_the_limit_and_not_above(kind: str, case: str, courant: float):
    """Fails if the step is not 2/omega_max of the state it is taken in: a perturbation of 1e-8 mm stays or explodes.

    Above the limit the fastest mode grows 1.63-fold a step, so sixty steps are plenty; below, it may swell fivefold.
    """
    momentum, density, free, state = body(kind, case)
    explicit = Explicit(held_body(momentum, density, free, np.zeros_like(state.u)),
                        ExplicitControls(courant=0.98, gamma_every=10**6))
    explicit.begin(state)
    explicit.length.look(0, state.u, explicit.mass, explicit._inverse)
    explicit.length.fix(explicit.dt * courant / 0.98)
    rest = state.u.copy()
    noise = np.random.default_rng(0).normal(size=rest.shape) * 1e-8
    noise.reshape(-1)[~free] = 0.0
    state.u += noise
    explicit.begin(state)
    growth = 1.0
    for _ in range(400 if courant < 1 else 60):
        explicit.step(state)
        growth = max(growth, float(np.abs(state.u - rest).max() / np.abs(noise).max()))
        if growth > 1e4:
            break
    assert growth > 1e4 if courant > 1 else growth < 6, growth


def amplification(alpha: float, z: float) -> np.ndarray:
    """Matrix that takes (u, dt v, dt^2 a) of a linear oscillator with omega dt = z over one HHT step."""
    beta, gamma = (1 - alpha) ** 2 / 4, 0.5 - alpha
    new = np.array([[z * z * (1 + alpha), 0, 1], [1, 0, -beta], [0, 1, -gamma]])
    old = np.array([[z * z * alpha, 0, 0], [1, 1, 0.5 - beta], [0, 1, 1 - gamma]])
    return np.linalg.solve(new, old)


def test_amplification_matrix_has_the_known_properties():
    """Fails if the reference of the next test is wrong: rho = 1 for alpha = 0, and known limits otherwise."""
    for z in (0.3, 1.0, 3.0, 30.0):
        assert np.abs(np.linalg.eigvals(amplification(0.0, z))).max() == pytest.approx(1.0, abs=1e-12)
    assert np.abs(np.linalg.eigvals(amplification(-1 / 3, 1e4))).max() == pytest.approx(0.5, abs=1e-2)
    assert np.abs(np.linalg.eigvals(amplification(-0.05, 1e4))).max() == pytest.approx(0.95 / 1.05, abs=1e-2)


@pytest.mark.parametrize("mass", ["lumped", "consistent"])
@pytest.mark.parametrize("alpha", [0.0, -0.05, -1 / 3])
@pytest.mark.parametrize("z", [0.3, 1.0, 3.0])
def test_hht_damps_one_mode_as_predicted(alpha: float, z: float, mass: str):
    """Fails if the scheme is not HHT with the beta and gamma it claims: one mode of small amplitude, step by step.

    The spectral radius is also measured from the sequence alone, by the linear recurrence it obeys.
    """
    space = box("quad", 4, 0.2)
    momentum, density = Momentum(space, AAA()), DensitySolver(space, SinkLaw())
    free = np.repeat(~ends(space)[0], 2)
    pattern = Pattern(space, 2, free, upper=True)
    K = pattern.symmetric(momentum.tangent(pattern, np.zeros_like(space.X))).toarray()
    M = pattern.symmetric(momentum.consistent_mass(pattern)).toarray() if mass == "consistent" else \
        np.diag(np.repeat(momentum.lumped_mass(0.0), 2)[free])
    squares, modes = la.eigh(K, M)
    omega, mode = np.sqrt(squares[3]), modes[:, 3] / np.abs(modes[:, 3]).max()
    size = 1e-4
    state = State.intact(space)
    state.u.reshape(-1)[free] = size * mode
    hht = HHT(held_body(momentum, density, free, np.zeros_like(space.X)),
              HHTControls(alpha=alpha, dt=z / omega, mass=mass, force_tolerance=1e-5, correction_tolerance=1e-5,
                          gain_tolerance=1.0))
    hht.begin(state)
    A, predicted = amplification(alpha, z), [np.array([1.0, 0.0, -z * z])]
    measured = [1.0]
    for _ in range(30):
        hht.step(state)
        measured.append(float(mode @ M @ state.u.ravel()[free] / (mode @ M @ mode)) / size)
        predicted.append(A @ predicted[-1])
    assert hht.rejected == 0 and hht.dt == z / omega
    q = np.array(measured)
    np.testing.assert_allclose(q, np.array(predicted)[:, 0], atol=1e-3)
    rho = np.abs(np.linalg.eigvals(A)).max()
    history = np.column_stack([q[2:-1], q[1:-2], q[:-3]])
    c, *_ = np.linalg.lstsq(history, q[3:], rcond=1e-4)
    assert np.abs(np.roots([1.0, *-c])).max() == pytest.approx(rho, abs=2e-3)
    energy = (state.ledger.elastic + state.ledger.kinetic) / state.ledger.initial
    if alpha == 0.0:
        assert energy == pytest.approx(1, abs=1e-3)
    else:
        assert energy < 1 and state.ledger.numerical == pytest.approx(state.ledger.initial * (1 - energy), rel=1e-6)


def test_points_below_the_floor_are_gone(kind: str):
    """Fails if Gauss points below the force floor, or in deleted elements, still bear force, energy or mass.

    Stiffness without mass would bring the stable step down; mass keeps its own floor.
    """
    space = box(kind, 4, 0.2)
    momentum = Momentum(space, AAA(), force_floor=1e-2)
    gamma, deleted = np.full(space.n_nodes, 0.5), np.zeros(space.n_elements, bool)
    gamma[space.conn[0]] = 0.009
    deleted[-1] = True
    momentum.set_gamma(gamma, deleted)
    seen = momentum.gamma
    raw = space.at_gauss(gamma)
    assert (seen[0] == 0).all() and (seen[-1] == 0).all()
    live = (raw >= 1e-2) & ~deleted[:, None]
    np.testing.assert_array_equal(seen[live], raw[live])
    assert not seen[~live].any() and ((raw > 0) & ~live).any()
    momentum.force(space.X * 0.1)
    assert momentum.energy == pytest.approx(float((space.w * seen * momentum.W).sum()), rel=1e-12)
    np.testing.assert_allclose(momentum.lumped_mass(0.0), momentum.material.rho0 * space.lump(seen), rtol=1e-14)
