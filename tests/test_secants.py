"""Steps by factors of an earlier tangent that secants correct."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import grid, pulled, same_bits

from skfsink.fem.space import Space
from skfsink.fields.state import State
from skfsink.material import SinkLaw
from skfsink.methods.newton import Newton
from skfsink.methods.secants import Secants
from skfsink.methods.statics import Statics

N = 12


def definite(seed: int) -> np.ndarray:
    """A symmetric positive definite matrix."""
    A = np.random.default_rng(seed).normal(size=(N, N))
    return A @ A.T + N * np.eye(N)


def pairs(count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Steps, and what another matrix makes of them."""
    steps = np.random.default_rng(3).normal(size=(count, N))
    return [(s, definite(2) @ s) for s in steps]


def with_pairs(most: int, count: int) -> Secants:
    secants = Secants(most)
    for s, y in pairs(count):
        secants.add(s, y)
    return secants


def inverse(secants: Secants, H: np.ndarray) -> np.ndarray:
    """The matrix of a solve, column by column."""
    return np.column_stack([secants.solve(lambda b: H @ b, e) for e in np.eye(N)])


@pytest.mark.parametrize("count", [0, 1, 5])
def test_solves_are_those_of_bfgs(count: int):
    """Fails if the inverse differs from the update of Broyden, Fletcher, Goldfarb and Shanno, as it stands in books."""
    H = np.linalg.inv(definite(1))
    expected = H
    for s, y in pairs(count):
        left = np.eye(N) - np.outer(s, y) / (s @ y)
        expected = left @ expected @ left.T + np.outer(s, s) / (s @ y)
    got = inverse(with_pairs(8, count), H)
    np.testing.assert_allclose(got, expected, rtol=1e-11, atol=1e-13)
    assert (np.linalg.eigvalsh(0.5 * (got + got.T)) > 0).all()


def test_last_pairs_count_and_none_without_memory():
    """Fails if more pairs are used than are kept, older ones rather than newer, or one without room for any."""
    H = np.linalg.inv(definite(1))
    last = Secants(3)
    for s, y in pairs(5)[-3:]:
        last.add(s, y)
    np.testing.assert_array_equal(inverse(with_pairs(3, 5), H), inverse(last, H))
    np.testing.assert_array_equal(inverse(with_pairs(0, 5), H), inverse(Secants(4), H))


def test_steps_along_which_the_tangent_bends_down_are_not_taken():
    """Fails if a pair is used after which a step could go up in energy."""
    H, secants = np.linalg.inv(definite(1)), Secants(4)
    secants.add(np.ones(N), -np.ones(N))
    secants.add(np.ones(N), np.zeros(N))
    np.testing.assert_array_equal(inverse(secants, H), inverse(Secants(4), H))


# --- in statics ---
def block() -> Space:
    """A block of hexahedra that is wider at its ends than in its middle."""
    mesh = grid("hex", (4, 6, 2), (1.0, 1.5, 0.4))
    x = mesh.p.copy()
    x[0] = (x[0] - 0.5) * (1.0 + 0.8 * (x[1] / 0.75 - 1.0) ** 2)
    return Space(type(mesh)(x, mesh.t))


def statics_of(space: Space) -> Statics:
    return pulled(space, SinkLaw(length_scale=0.4)).statics


def loaded(statics: Statics, steps: int = 1000, with_secants: bool = False) -> State:
    """To the onset, for some increments, or further until there are secants."""
    state = State.intact(statics.space)
    for _ in statics.load(state):
        if state.step >= steps and (not with_secants or "secant_steps" in statics.memory()):
            break
    return state


def test_loading_in_space_takes_less_with_secants(monkeypatch: pytest.MonkeyPatch):
    """Fails if secants change an equilibrium or the onset, or save no tangents and factors."""
    made = []
    monkeypatch.setattr(Newton, "tangent", lambda self, u, convex=False, plain=Newton.tangent:
                        (made.append(self), plain(self, u, convex))[1])
    space, found = block(), []
    for most in (0, 12):
        monkeypatch.setattr(Newton, "SECANTS", (0, most))
        statics = statics_of(space)
        found.append((loaded(statics), made.count(statics.newton), statics.factorisations))
    (plain, tangents, factors), (state, fewer, less) = found
    assert state.grip == plain.grip and state.step == plain.step
    np.testing.assert_allclose(state.u, plain.u, atol=1e-5 * np.abs(plain.u).max())
    np.testing.assert_allclose(state.gamma, plain.gamma, atol=1e-5)
    assert fewer < 0.7 * tangents and less <= factors, (fewer, tangents, less, factors)


def test_plane_bodies_have_none(monkeypatch: pytest.MonkeyPatch):
    """Fails if results of plane bodies hang on secants."""
    monkeypatch.setattr(Secants, "add", lambda *_: pytest.fail("a secant in the plane"))
    space = Space(grid("quad", (4, 6), (1.0, 1.5)))
    assert loaded(statics_of(space), 4).step == 4


def test_checkpoints_hold_the_secants():
    """Fails if loading or passes in space do not resume to the same bits while there are secants."""
    space = block()
    whole, parts = statics_of(space), statics_of(space)
    states = [loaded(whole), loaded(parts, 3, with_secants=True)]
    memory = parts.memory()
    assert memory["secant_steps"].shape == memory["secant_forces"].shape
    assert memory["secant_steps"].shape[1] == parts.free.sum()
    parts = statics_of(space)
    parts.restore(memory)
    for _ in parts.load(states[1]):
        pass
    same_bits(*states)
    for state in states:
        state.begin_event(0.005)
    for _ in whole.propagate(states[0]):
        if states[0].step == 6:
            break
    for stop in (2, 4, 6):
        for _ in parts.propagate(states[1]):
            if states[1].step == stop:
                break
        memory, parts = parts.memory(), statics_of(space)
        parts.restore(memory)
    same_bits(*states)


def test_released_and_new_factors_forget_the_secants():
    """Fails if secants of other factors are used."""
    space = block()
    statics = statics_of(space)
    newton = statics.newton
    loaded(statics, 3, with_secants=True)
    assert "secant_steps" in newton.memory()
    u = 0.1 * space.X * [0.0, 1.0, 0.0]
    newton._factorise(u, newton.tangent(u))
    assert "kept_u" in newton.memory() and "secant_steps" not in newton.memory()
    newton._secants.add(np.ones(3), np.ones(3))
    newton.release()
    newton._factorise(u, newton.tangent(u))
    assert "secant_steps" not in newton.memory()
