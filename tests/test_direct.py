"""Factorisations, and conjugate gradients with one that was made for another matrix."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import boundary, box, patchy, wavy

from skfsink.direct import Factorization
from skfsink.errors import ConvergenceError
from skfsink.material import AAA
from skfsink.momentum import Momentum
from skfsink.pattern import Pattern
from skfsink.space import Space

BACKENDS = pytest.mark.parametrize("backend", ["pardiso", "superlu"])


def body(space: Space, seed: int = 2) -> tuple[Momentum, Pattern]:
    """A damaged body held all around."""
    momentum = Momentum(space, AAA())
    momentum.gamma = patchy(space, seed, dead=0.0)
    return momentum, Pattern(space, space.dim, np.repeat(~boundary(space), space.dim), upper=True)


@BACKENDS
def test_solutions_of_definite_and_indefinite_matrices(space: Space, backend: str):
    """Fails if a backend returns garbage, or does not tell whether the matrix is positive definite."""
    pytest.importorskip("pypardiso" if backend == "pardiso" else "scipy")
    momentum, pattern = body(space)
    solver = Factorization(pattern, backend)
    data = momentum.tangent(pattern, np.zeros_like(space.X))
    for shift, definite in ((0.0, True), (-0.5, False), (0.0, True)):
        shifted = data.copy()
        shifted[pattern.diagonal] *= 1 + shift
        whole = pattern.symmetric(shifted)
        assert (np.linalg.eigvalsh(whole.toarray())[0] > 0) == definite
        assert solver.factorize(shifted) == solver.definite == definite
        b = np.random.default_rng(0).normal(size=pattern.size)
        np.testing.assert_allclose(whole @ solver.solve(b, 1e-10), b, atol=1e-8)
        assert solver.factorize(shifted, indefinite=False) == definite
    assert solver.count == 6


@BACKENDS
def test_singular_matrix_is_an_error(backend: str):
    """Fails if a matrix that is singular gives a solution without a word."""
    pytest.importorskip("pypardiso" if backend == "pardiso" else "scipy")
    space = box("quad", 3)
    pattern = Pattern(space, 2, upper=True)
    data = Momentum(space, AAA()).tangent(pattern, np.zeros_like(space.X))  # nothing holds the body
    solver = Factorization(pattern, backend)
    with pytest.raises((ConvergenceError, RuntimeError)):
        solver.factorize(data)
        solver.solve(np.random.default_rng(0).normal(size=pattern.size))


def test_conjugate_gradients_with_factors_of_another_matrix(space: Space):
    """Fails if they need many iterations for a matrix near the factorised one, or miss the tolerance.

    Where the matrix curves down they must stop with a direction of descent.
    """
    momentum, pattern = body(space)
    solver = Factorization(pattern)
    b = np.random.default_rng(1).normal(size=pattern.size)
    solver.factorize(momentum.tangent(pattern, np.zeros_like(space.X)))
    momentum.gamma[:space.n_elements // 10] *= 0.1
    data = momentum.tangent(pattern, wavy(space, 0.003))
    A = pattern.symmetric(data)
    x, iterations, met = solver.conjugate(data, b, 1e-6, 60)
    assert met and iterations <= 40
    assert np.linalg.norm(A @ x - b) <= 1.01e-6 * np.linalg.norm(b)
    x, iterations, met = solver.conjugate(data, b, 1e-6, 3)
    assert not met and iterations == 3 and 0.5 * x @ (A @ x) - b @ x < 0
    data[pattern.diagonal] *= 0.5
    x, iterations, met = solver.conjugate(data, b, 1e-6, 60)
    assert not met and b @ x >= 0


def test_released_factors_are_made_again():
    """Fails if a solver cannot be used after its memory was freed."""
    momentum, pattern = body(box("quad", 5))
    solver = Factorization(pattern)
    data = momentum.tangent(pattern, np.zeros_like(momentum.space.X))
    b = np.ones(pattern.size)
    solver.factorize(data)
    x = solver.solve(b)
    solver.release()
    solver.factorize(data)
    np.testing.assert_array_equal(solver.solve(b), x)
