"""What is made some elements at a time: the same as of all at once, and how much memory a body takes."""

from __future__ import annotations

import tracemalloc
from typing import Any

import numpy as np
import pytest
import skfem
from bodies import box, patchy, wavy
from scipy.sparse import coo_array

import skfsink.fem.kernels.pieces
import skfsink.fem.pattern
import skfsink.fem.space
import skfsink.fields.pieces
from skfsink.fem import kernels
from skfsink.fem.pattern import Pattern
from skfsink.fem.space import Space
from skfsink.fields.body import Body
from skfsink.fields.density import DensitySolver
from skfsink.fields.fragments import joined
from skfsink.fields.momentum import Momentum
from skfsink.fields.pieces import pieces_of
from skfsink.fields.state import State
from skfsink.loads.schedule import Loading
from skfsink.material import AAA, MooneyRivlin, SinkLaw
from skfsink.methods.controls import ExplicitControls
from skfsink.methods.explicit import Explicit


@pytest.mark.parametrize("kind", ["quad", "hex"])
def test_geometry_by_pieces(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a piece takes the geometry of other elements, or a gradient is not that of a linear field."""
    whole = box(kind, 4)
    monkeypatch.setattr(skfsink.fem.space, "CHUNK", 7)
    again = Space(whole.mesh)
    A = np.arange(1.0, 1 + whole.dim**2).reshape(whole.dim, whole.dim)
    assert np.allclose(again.gradient(again.X @ A.T), A, rtol=1e-11)
    for name in ("w", "invJ", "dN"):
        assert np.array_equal(getattr(again, name), getattr(whole, name))
    assert np.array_equal(again.mean_slopes(), whole.mean_slopes())
    some = np.array([9, 2, 11])
    for made in (Space(whole.mesh), again):  # one that has its inverses, one that makes them
        assert np.array_equal(made.inverse(some), whole.invJ[some])
        assert np.array_equal(made.slopes(some), whole.dN[some])


@pytest.mark.parametrize("kind", ["quad", "hex"])
@pytest.mark.parametrize("upper", [False, True])
@pytest.mark.parametrize("kept_too", [False, True])
def test_slots_of_some_elements(kind: str, upper: bool, kept_too: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if the structure is not that of a matrix assembled by scipy, an entry goes to another place, or places are
    kept of a body that is too large, or found again of a small one."""
    if not kept_too:
        monkeypatch.setattr(skfsink.fem.pattern, "KEPT", 1000)
    space, rng = box(kind, 4), np.random.default_rng(3)
    free, absent = rng.uniform(size=space.X.size) < 0.8, np.array([3, 8])
    pattern = Pattern(space, space.dim, free, upper=upper)
    dofs, number = space.element_dofs, np.cumsum(free) - 1
    rows, cols = (np.broadcast_to(a, (*dofs.shape, dofs.shape[1])).ravel() for a in (dofs[:, :, None], dofs[:, None]))
    kept = free[rows] & free[cols] & (~np.array(upper) | (cols >= rows))
    values = rng.normal(size=rows.size)
    expected = coo_array((values[kept], (number[rows[kept]], number[cols[kept]])), shape=(free.sum(),) * 2).tocsr()
    expected.sum_duplicates()
    assert np.array_equal(pattern.indptr, expected.indptr) and np.array_equal(pattern.indices, expected.indices)
    assert np.array_equal(pattern.indices[pattern.diagonal], np.arange(pattern.size))
    some, data = np.array([5, 1, 14]), np.zeros(pattern.nnz)
    found = pattern.slots(some)
    assert ("slot" in vars(pattern)) == kept_too
    assert np.array_equal(found, pattern.slot[some])
    np.add.at(data, pattern.slot.ravel()[kept], values[kept])
    assert np.allclose(data, expected.data)
    without = Pattern(space, space.dim, free, upper=upper, absent=absent)
    assert (without.slots(absent) == -1).all() and np.array_equal(without.slots(some), found)


@pytest.mark.parametrize("kind", ["quad", "hex"])
def test_sums_by_pieces(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if tangents or the motion of pieces depend on how many elements are taken at a time, by a bit."""
    def found() -> list[np.ndarray]:
        space = box(kind, 4)
        momentum, u = Momentum(space, AAA()), wavy(space, 0.1)
        state = State.intact(space)
        state.u, state.v = u, np.cos(7.0 * u)
        state.gamma[np.abs(space.X[:, 0] - 0.5 * space.X[:, 0].max()) < 0.1] = 0.0
        momentum.set_gamma(state.gamma, state.deleted)
        pattern = Pattern(space, space.dim)
        return [momentum.tangent(pattern, u), momentum.consistent_mass(pattern), *pieces_of(momentum, state)]

    whole = found()
    monkeypatch.setattr(skfsink.fem.kernels.pieces, "PIECE", {2: 5, 3: 5})
    monkeypatch.setattr(skfsink.fem.space, "CHUNK", 5)
    monkeypatch.setattr(skfsink.fields.pieces, "SOME", 5)
    for one, other in zip(found(), whole):
        assert np.array_equal(one, other)


@pytest.mark.parametrize("kind", ["quad", "around", "hex"])
@pytest.mark.parametrize("upper", [False, True])
def test_second_derivatives_do_not_depend_on_threads(kind: str, upper: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if threads change a bit of a tangent, take a piece twice or leave one out: all laws, some elements."""
    monkeypatch.setattr(kernels.pieces, "PIECE", {2: 5, 3: 5})
    space = box("quad", 7).revolved() if kind == "around" else box(kind, 3 if kind == "hex" else 7)
    pattern = Pattern(space, space.dim, np.arange(space.X.size) % 7 > 0, upper=upper)
    u, gamma, some = wavy(space, 0.1), patchy(space), np.arange(space.n_elements)[3::2]
    fibres, viscous = np.zeros((some.size, 0, 3)), kernels.Viscous(1e-5, False, 1e6, 1e-3, 0.1, 0.2)

    def found(threads: int) -> list[np.ndarray]:
        taken: dict[str, Any] = {"elements": some, "threads": threads}
        both = [kernels.tangent(space, pattern, AAA(), u, gamma, threads=threads),
                kernels.tangent(space, pattern, AAA(), u, gamma, convex=True, **taken),
                kernels.tangent_general(space, pattern, MooneyRivlin(), u, gamma, fibres, **taken),
                kernels.viscous_tangent(space, pattern, viscous, (u, 1e5 * u), gamma, **taken)]
        if kind == "quad":
            both.append(kernels.tangent_plane_stress(space, pattern, AAA(), u, gamma, **taken))
        return both

    for one, shared in zip(found(1), found(3), strict=True):
        assert one.any() and np.array_equal(one, shared)


def test_pieces_are_numbered_by_their_first_elements() -> None:
    """Fails if elements of one piece have two numbers, or an element without a node that holds has that of another."""
    conn = np.array([[0, 1], [5, 6], [1, 2], [7, 8], [6, 9], [2, 3]])
    holds = np.array([[1, 1], [1, 1], [1, 1], [0, 0], [1, 0], [0, 1]], bool)
    assert joined(conn, holds).tolist() == [0, 1, 0, 2, 1, 3]
    assert joined(conn[:0], holds[:0]).size == 0


def test_matrices_are_made_again() -> None:
    """Fails if a density that was released is solved for otherwise than before, or nothing is freed."""
    space, law = box("quad", 6), SinkLaw(length_scale=0.3)
    W_max = np.zeros_like(space.w)
    W_max[:3] = [[1e3 * law.phi], [1.2 * law.phi], [law.phi]]
    one, density = np.ones(space.n_nodes), DensitySolver(space, law)
    expected = density.solve(W_max, one)
    density.release()
    assert not hasattr(density, "pattern")
    assert np.array_equal(density.solve(W_max, one), expected) and density.solves == 2


def test_memory_of_an_explicit_event() -> None:
    """Fails if a body takes more than 11 kB a hexahedron at its peak, while it is made or stepped: 9 now, 17.5 before.

    1.7 of them are vectors of Lanczos's method, which count before they are written.
    """
    def event(n: int) -> int:
        space = Space(skfem.MeshHex.init_tensor(*(np.linspace(0.0, 1.0, n + 1),) * 3))
        body = Body(Momentum(space, AAA()), DensitySolver(space, SinkLaw(), solver="jacobi"),
                    Loading.steady(space, np.ones(space.X.size, bool), np.zeros_like(space.X)))
        explicit, state = Explicit(body, ExplicitControls()), body.begin()
        state.v[:, 0] = 1e3 * space.X[:, 0]
        explicit.begin(state)
        for _ in range(3):
            explicit.step(state)
        return space.n_elements

    event(2)  # what is compiled is not counted
    tracemalloc.start()
    try:
        count = event(18)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 11_000 * count, peak / count
