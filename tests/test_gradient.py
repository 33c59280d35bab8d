"""The gradient term of the mass balance without positive off-diagonals: its matrix, and the bounds it keeps."""

from __future__ import annotations

import inspect
from contextlib import suppress
from functools import cache
from typing import Any

import numpy as np
import pytest
import skfem
from bodies import FAILED, box, distorted, grid
from scipy.linalg import eigvalsh
from skfem.helpers import dot, grad

from skfsink.cases.single_edge_notch import CASE
from skfsink.errors import ConvergenceError, ParameterError
from skfsink.fem.backends import BACKENDS
from skfsink.fem.kernels.gradient import _blend
from skfsink.fem.pattern import Pattern
from skfsink.fem.space import Space
from skfsink.fields.body import Body
from skfsink.fields.density import DensitySolver
from skfsink.material import SinkLaw
from skfsink.scene.options import Options

LAW = SinkLaw()
ASPECTS = (0.2, 0.37, 1.0, 1.5, 3.0, 5.0, 8.0)


@cache
def stretched(kind: str, aspect: float, amount: float, across: int = 6, layers: int = 2) -> Space:
    """Elements l/2 wide and `aspect` times as tall, in layers; nodes inside moved by up to `amount` of each edge."""
    shape = (across,) * (1 if kind == "quad" else 2) + (layers,)
    h = LAW.length_scale / 2
    mesh = distorted(grid(kind, shape, tuple(h * n for n in shape)), amount)
    return Space(mesh.scaled((*[1.0] * (len(shape) - 1), aspect)))


def gradient(space: Space, monotone: bool = True, kernel: str = "compiled") -> np.ndarray:
    """The matrix (n, n) of int Grad N_a . Grad N_b."""
    pattern = Pattern(space)
    data = BACKENDS[kernel].density(space, 1.0).laplacian(pattern, monotone=monotone)
    found: np.ndarray = pattern.matrix(data).toarray()
    return found


def off_diagonals(A: np.ndarray) -> np.ndarray:
    """A without its diagonal."""
    return A - np.diag(np.diag(A))


def dented(kind: str) -> Space:
    """One element with a corner pushed in so far that it is not convex; its Jacobian is positive at Gauss points."""
    mesh = grid(kind, (1,) * (2 if kind == "quad" else 3))
    p = mesh.p.copy()
    corner = np.flatnonzero((p == 1.0).all(axis=0))
    p[:, corner] -= 0.55 if kind == "quad" else 0.45
    return Space(type(mesh)(p, mesh.t))


# --- the matrix ---
@pytest.mark.parametrize("amount", [0.0, 0.15, 0.2])
@pytest.mark.parametrize("aspect", ASPECTS)
def test_matrix_is_symmetric_and_has_no_positive_off_diagonal(kind: str, aspect: float, amount: float):
    """Fails if the assembled matrix is no M-matrix, feels a constant, or has another null space or a negative energy.

    Seen to fail without the move to the diagonal (0.15, 0.2), and where the Gauss matrix is kept (aspect 0.37 and 3).
    """
    space = stretched(kind, aspect, amount)
    A = gradient(space)
    size = np.diag(A).max()
    assert off_diagonals(A).max() <= 0.0
    np.testing.assert_allclose(A, A.T, atol=1e-15 * size)
    np.testing.assert_allclose(A.sum(axis=1), 0.0, atol=1e-14 * size)
    values = eigvalsh(A)
    assert values[0] > -1e-14 * values[-1] and values[1] > 1e-4 * np.diag(A).min()


def test_elements_that_need_nothing_keep_their_matrix(kind: str):
    """Fails if a bit changes in a mesh whose Gauss matrices have no positive off-diagonals: squares, lightly distorted.

    Cubes have zeros along their edges, positive or negative by rounding, which must not decide anything.
    """
    space = box(kind, 4, 0.1 if kind == "quad" else 0.0)
    gauss = gradient(space, monotone=False)
    assert off_diagonals(gauss).max() <= 1e-16
    np.testing.assert_allclose(gradient(space), gauss, rtol=0.0, atol=0.0 if kind == "quad" else 1e-15)


@pytest.mark.parametrize("aspect", [3.0, 5.0])
def test_boxes_keep_linear_fields(kind: str, aspect: float):
    """Fails if diffusion is added on boxes: the energy of a linear field is that of its gradient, in any direction.

    Seen to fail where positive off-diagonals of the Gauss matrix are moved to the diagonal without another rule.
    """
    space = stretched(kind, aspect, 0.0)
    slope = np.random.default_rng(0).uniform(-1, 1, space.dim)
    field = space.X @ slope
    gauss = gradient(space, monotone=False)
    assert abs(gradient(space) - gauss).max() > 0.05 * gauss.max()
    assert field @ gradient(space) @ field == pytest.approx(slope @ slope * space.V.sum(), rel=1e-12)


@pytest.mark.parametrize("aspect", [0.37, 1.5, 3.0])
def test_no_other_blend_has_less_to_be_moved(kind: str, aspect: float):
    """Fails if another rule or share has a smaller sum of positive off-diagonals: 201 shares of each rule are tried.

    Seen to fail with the ends of the element along all axes as the only rule (3D), and with the share 1 only.
    """
    space = stretched(kind, aspect, 0.2)

    @skfem.BilinearForm
    def form(u: Any, v: Any, _: Any) -> np.ndarray:
        return dot(grad(u), grad(v))

    rules = [form.elemental(skfem.Basis(space.mesh, space.gamma_basis.elem, quadrature=space.rule(ends))).tolocal()
             for ends in range(2**space.dim)]

    def positive(K: np.ndarray) -> np.ndarray:
        return np.where(np.eye(K.shape[-1], dtype=bool), 0.0, np.maximum(K, 0.0)).sum(axis=(-1, -2))

    best = np.min([positive((1 - t) * rules[0] + t * V) for V in rules[1:] for t in np.linspace(0, 1, 201)], axis=0)
    assert positive(rules[0]).max() > 0.0
    for e, matrices in enumerate(np.stack(rules, axis=1)):
        K = np.empty_like(matrices[0])
        _blend(matrices, np.ones(len(rules), bool), K)
        assert positive(K) <= best[e] + 1e-12 * np.trace(K)


def test_elements_that_are_not_convex_are_taken(kind: str):
    """Fails if a rule is used whose Jacobian is not positive at its points: the matrix would have a negative energy."""
    space = dented(kind)
    xi, _ = space.rule(2**space.dim - 1)
    jacobians = space.gamma_basis.mapping.detDF(xi)
    assert jacobians.min() < 0.0 < jacobians.max()
    compiled, forms = (gradient(space, kernel=name) for name in ("compiled", "forms"))
    np.testing.assert_allclose(forms, compiled, rtol=1e-12, atol=1e-14)
    assert off_diagonals(compiled).max() <= 0.0 and eigvalsh(compiled)[0] > -1e-14 * np.trace(compiled)


# --- the bounds of gamma ---
def middle(space: Space) -> int:
    """The element in the middle of the lowest layer."""
    centres = space.X[space.conn].mean(axis=1)
    lowest = np.flatnonzero(centres[:, -1] < np.ptp(space.X[:, -1]) / 2)
    return int(lowest[np.argmin(abs(centres[lowest, :-1] - np.ptp(space.X[:, :-1], axis=0) / 2).sum(axis=1))])


@pytest.mark.parametrize("amount", [0.0, 0.15, 0.2])
@pytest.mark.parametrize("aspect", ASPECTS)
def test_density_beside_a_dead_element_stays_between_zero_and_one(kind: str, aspect: float, amount: float):
    """Fails if a run on tall, flat or distorted elements would stop: one dead element in one of two layers.

    With the Gauss gradient the greatest gamma of hexahedra is 1.04 at aspect 3, 1.18 at 5 and 1.25 at 8, and the least
    of flat quadrilaterals -0.01. Conjugate gradients take at most a quarter more iterations than with that.
    """
    space = stretched(kind, aspect, amount, 12)
    for sink in ("lumped", "nearest"):
        solver, gauss = (DensitySolver(space, LAW, sink, gradient=name) for name in ("monotone", "gauss"))
        for dead in (middle(space), 0):
            W = np.zeros_like(space.w)
            W[dead] = FAILED
            gamma = solver.solve(W, np.ones(space.n_nodes))
            assert gamma[space.conn[dead]].max() < 1e-12
            assert gamma.min() > 0.0 and gamma.max() < 1.0
            with suppress(ConvergenceError):
                gauss.solve(W, np.ones(space.n_nodes))
        assert solver.fallbacks == 0 and solver.iterations <= 1.25 * gauss.iterations + 2


@pytest.mark.parametrize(("kind", "aspect", "amount"), [("hex", 3.0, 0.15), ("hex", 8.0, 0.0), ("quad", 0.2, 0.15)])
def test_gauss_gradient_leaves_the_bounds_and_says_what_to_do(kind: str, aspect: float, amount: float):
    """Fails if the option does nothing, or gamma outside of (0, 1] passes without a word."""
    space = stretched(kind, aspect, amount, 12)
    W = np.zeros_like(space.w)
    W[middle(space)] = FAILED
    with pytest.raises(ConvergenceError, match=r"left \(0, 1\]: .*distorted .*: take gradient monotone"):
        DensitySolver(space, LAW, gradient="gauss").solve(W, np.ones(space.n_nodes))
    DensitySolver(space, LAW).solve(W, np.ones(space.n_nodes))


def test_consistent_sink_keeps_the_gauss_gradient():
    """Fails if the paper's form is changed by an option that is not for it, or a misspelt word passes."""
    space = stretched("quad", 3.0, 0.15)
    both = [DensitySolver(space, LAW, "consistent", gradient=name)._laplacian for name in ("monotone", "gauss")]
    np.testing.assert_array_equal(*both)
    np.testing.assert_array_equal(both[0], DensitySolver(space, LAW, gradient="gauss")._laplacian)
    assert (both[0] != DensitySolver(space, LAW)._laplacian).any()
    with pytest.raises(ParameterError, match="gradient must be one of monotone, gauss; got 'm-matrix'"):
        DensitySolver(space, LAW, gradient="m-matrix")


def test_option_reaches_the_density_solver():
    """Fails if a scene computes with another matrix than its `gradient` says."""
    own = {name: p.default for name, p in inspect.signature(CASE.function).parameters.items() if name != "options"}
    for name in ("monotone", "gauss"):
        scene = CASE.scene({**own, "mesh": "coarse"}, Options(gradient=name))
        expected = DensitySolver(scene.space, LAW, gradient=name)._laplacian
        np.testing.assert_array_equal(Body.of(scene).density._laplacian, expected)
