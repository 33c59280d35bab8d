"""Factorisations, and conjugate gradients with one that was made for another matrix."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest
from bodies import boundary, box, grips, patchy, wavy

from skfsink.errors import ConvergenceError, ParameterError
from skfsink.fem import direct
from skfsink.fem.direct import BACKENDS, Factorization
from skfsink.fem.pattern import Pattern
from skfsink.fem.space import Space
from skfsink.fields.momentum import Momentum
from skfsink.material import AAA

BACKENDS_THERE = pytest.mark.parametrize("backend", BACKENDS)


def body(space: Space, seed: int = 2) -> tuple[Momentum, Pattern]:
    """A damaged body held all around."""
    momentum = Momentum(space, AAA())
    momentum.gamma = patchy(space, seed, dead=0.0)
    return momentum, Pattern(space, space.dim, np.repeat(~boundary(space), space.dim), upper=True)


@BACKENDS_THERE
def test_solutions_of_definite_and_indefinite_matrices(space: Space, backend: str):
    """Fails if a backend returns garbage, or does not tell whether the matrix is positive definite."""
    pytest.importorskip(BACKENDS[backend])
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


@BACKENDS_THERE
def test_entries_that_were_zero_in_the_first_matrix(kind: str, backend: str):
    """Fails if a backend takes the entries that the tangent of an undeformed regular body lacks for zero for good."""
    pytest.importorskip(BACKENDS[backend])
    space = box(kind, {"quad": 8, "hex": 4}[kind], amount=0.0)
    momentum, pattern = Momentum(space, AAA()), Pattern(space, space.dim, grips(space, 1.0)[0], upper=True)
    solver, b, zeros = Factorization(pattern, backend), np.ones(pattern.size), []
    for u in (np.zeros_like(space.X), wavy(space, 1e-4)):
        data = momentum.tangent(pattern, u)
        zeros.append(np.count_nonzero(data == 0.0))
        assert solver.factorize(data)
        np.testing.assert_allclose(pattern.symmetric(data) @ solver.apply(b), b, atol=1e-8)
    assert zeros[0] > zeros[1]


@BACKENDS_THERE
def test_singular_matrix_is_an_error(backend: str):
    """Fails if a matrix that is singular gives a solution without a word."""
    pytest.importorskip(BACKENDS[backend])
    space = box("quad", 3)
    pattern = Pattern(space, 2, upper=True)
    data = Momentum(space, AAA()).tangent(pattern, np.zeros_like(space.X))  # nothing holds the body
    solver = Factorization(pattern, backend)
    with pytest.raises((ConvergenceError, RuntimeError)):
        solver.factorize(data)
        solver.solve(np.random.default_rng(0).normal(size=pattern.size))


def test_a_backend_that_is_not_installed_is_refused(monkeypatch: pytest.MonkeyPatch):
    """Fails if another one is taken in its place in silence, or "direct" does not take the next."""
    pattern = body(box("quad", 3))[1]
    monkeypatch.setattr(direct, "pypardiso", None)
    monkeypatch.setitem(sys.modules, "sksparse.cholmod", None)  # as if it were not there
    for name, module in (("pardiso", "pypardiso"), ("cholmod", "sksparse")):
        with pytest.raises(ParameterError, match=f"linear {name} needs {module}, which is not installed: install it, "
                                                 "or take linear = 'direct'"):
            Factorization(pattern, name)
    assert Factorization(pattern).backend == "superlu"


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


def test_factors_of_a_solver_that_is_gone_are_freed(monkeypatch: pytest.MonkeyPatch):
    """Fails if each of many small solvers leaves its factors in memory."""
    pytest.importorskip("pypardiso")
    phases: list[int] = []
    monkeypatch.setattr(direct._Pardiso, "_call", lambda self, phase, *others, plain=direct._Pardiso._call:
                        (phases.append(phase), plain(self, phase, *others))[1])
    momentum, pattern = body(box("hex", 3))
    solver = Factorization(pattern)
    solver.factorize(momentum.tangent(pattern, np.zeros_like(momentum.space.X)))
    assert direct._Pardiso.RELEASE not in phases
    del solver
    assert phases[-1] == direct._Pardiso.RELEASE


def test_factorisations_do_not_share_anything_but_the_library(monkeypatch: pytest.MonkeyPatch):
    """Fails if one solver uses the factors of another, or if each of them looks for MKL again, for a third of a second.
    """
    pypardiso = pytest.importorskip("pypardiso")
    made: list[Any] = []
    original = pypardiso.PyPardisoSolver

    def wrapper() -> Any:
        made.append(original())
        return made[-1]

    monkeypatch.setattr(pypardiso, "PyPardisoSolver", wrapper)
    direct._library.cache_clear()
    solvers, alone = [], []
    for n in (4, 5, 6):
        momentum, pattern = body(box("quad", n))
        solvers.append(Factorization(pattern))
        solvers[-1].factorize(momentum.tangent(pattern, np.zeros_like(momentum.space.X)))
        alone.append(solvers[-1].apply(np.ones(pattern.size)))
    for solver, expected in zip(reversed(solvers), reversed(alone)):
        np.testing.assert_array_equal(solver.apply(np.ones(solver.pattern.size)), expected)
    assert len(made) == 1


def test_each_factorisation_has_its_own_number_of_threads(space: Space):
    """Fails if the number of threads is that of the solver made last, which is one for the whole process in MKL."""
    pypardiso = pytest.importorskip("pypardiso")
    library = pypardiso.PyPardisoSolver(mtype=2).libmkl
    momentum, pattern = body(space)
    data = momentum.tangent(pattern, np.zeros_like(space.X))
    solvers = {threads: Factorization(pattern, threads=threads) for threads in (2, 1)}
    seen: dict[int, set[int]] = {1: set(), 2: set()}
    for threads, solver in solvers.items():
        solver.factorize(data)
        handle = solver._handle(2)._handle
        inner = handle._mkl_pardiso

        def watched(*arguments: object, threads: int = threads, inner: Any = inner) -> None:
            seen[threads].add(library.MKL_Get_Max_Threads())
            inner(*arguments)

        handle._mkl_pardiso = watched
    before = library.MKL_Get_Max_Threads()
    for threads in (1, 2, 1):
        solvers[threads].factorize(data)
        solvers[threads].apply(np.ones(pattern.size))
    assert seen == {1: {1}, 2: {2}}
    assert library.MKL_Get_Max_Threads() == before
