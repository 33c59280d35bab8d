"""Conjugate gradients with multigrid in the place of factors: the same steps, in a number that does not grow."""

from __future__ import annotations

import dataclasses
import importlib.util
from pathlib import Path

import numpy as np
import pytest
from bodies import box, pulled
from plates import SMALL, invoke

import skfsink as sk
from skfsink.errors import ConvergenceError, ParameterError
from skfsink.fem import linear as linear_module
from skfsink.fem.direct import BACKENDS, Factorization
from skfsink.fem.linear import LINEAR, linear_for, solver
from skfsink.fem.multigrid import Multigrid, rigid_motions
from skfsink.fem.pattern import Pattern
from skfsink.fem.space import Space
from skfsink.fields.momentum import Momentum
from skfsink.material import AAA, SinkLaw
from skfsink.methods.controls import StaticsControls
from skfsink.methods.newton import Newton
from skfsink.results.history import History
from skfsink.run.memory import linear_of

HAS_PETSC = importlib.util.find_spec("petsc4py") is not None
NAMES = [name for name in LINEAR if name not in ("direct", *BACKENDS) and (HAS_PETSC or "petsc" not in name)]


def held(space: Space) -> np.ndarray:
    """Unknowns that are free: the bottom is held, the left slides, so that some nodes are free in a part of them."""
    free = np.ones(space.X.shape, bool)
    free[space.X[:, 1] == 0] = False
    free[space.X[:, 0] == 0, 0] = False
    return free.ravel()


def system(space: Space) -> tuple[Pattern, np.ndarray, np.ndarray, np.ndarray]:
    """Pattern, free unknowns, tangent of a stretched body and a right-hand side."""
    free = held(space)
    pattern = Pattern(space, space.dim, free, upper=True)
    u = np.zeros_like(space.X)
    u[:, 1] = 0.05 * space.X[:, 1]
    u[:, [i for i in range(space.dim) if i != 1]] = (1.05 ** (-1 / (space.dim - 1)) - 1) * np.delete(space.X, 1, axis=1)
    rhs = np.sin(1.0 + 2.4 * np.arange(pattern.size))
    return pattern, free, Momentum(space, AAA(bulk_modulus=50.0)).tangent(pattern, u), rhs


def test_rigid_motions_strain_nothing(space: Space) -> None:
    """Fails if one of them is missing, or is none: the tangent of the undeformed body is blind to them all."""
    pattern = Pattern(space, space.dim, upper=True)
    K = pattern.symmetric(Momentum(space, AAA()).tangent(pattern, np.zeros_like(space.X)))
    motions = rigid_motions(space.X)
    assert np.linalg.matrix_rank(motions) == motions.shape[1] == {2: 3, 3: 6}[space.dim]
    assert np.abs(K @ motions).max() < 1e-12 * np.abs(K.data).max()


@pytest.mark.parametrize("name", NAMES)
def test_the_solution_is_that_of_factors(name: str, space: Space) -> None:
    """Fails if unknowns of nodes that are held in a part get to a wrong place, or columns are mixed up."""
    pattern, free, data, b = system(space)
    multigrid, factors = solver(name, space, free, pattern, 1), Factorization(pattern)
    assert multigrid.factorize(data) and factors.factorize(data)
    expected = factors.solve(b)
    assert np.abs(multigrid.apply(b) - expected).max() < 1e-7 * np.abs(expected).max()
    B = np.stack([b, np.roll(b, 3)], axis=1)
    assert np.abs(multigrid.apply(B) - factors.apply(B)).max() < 1e-6 * np.abs(expected).max()
    summed = factors.solve_sum(B, b)
    assert np.abs(multigrid.solve_sum(B, b) - summed).max() < 1e-6 * np.abs(summed).max()
    multigrid.release()


@pytest.mark.parametrize("name", [name for name in NAMES if name != "petsc-mumps"])
def test_iterations_do_not_grow_with_the_body(name: str) -> None:
    """Fails if the hierarchy is not given the rigid motions: a body twice as large then takes far more iterations."""
    counts = []
    for n in (9, 18):
        space = box("hex", n, 0.0)
        pattern, free, data, b = system(space)
        multigrid = solver(name, space, free, pattern, 1)
        multigrid.factorize(data)
        _, iterations, met = multigrid.conjugate(data, b, 1e-6, 300)
        assert met
        counts.append(iterations)
    assert counts[0] > 10 and counts[1] < 1.5 * counts[0] < 120, counts


def test_a_matrix_that_curves_down(space: Space) -> None:
    """Fails if a direction in which the energy falls without bound is followed, or taken for a solution."""
    pattern, free, data, b = system(space)
    multigrid = Multigrid(space, free, pattern)
    multigrid.factorize(data)
    bent = -data
    x, iterations, met = multigrid.conjugate(bent, b, 1e-6, 50)
    assert (iterations, met, multigrid.definite) == (0, False, False) and not x.any()
    with pytest.raises(ConvergenceError, match="linear = 'direct'"):
        multigrid.factorize(bent)


@pytest.mark.parametrize("name", NAMES)
def test_equilibrium_is_that_of_factors(name: str, space: Space) -> None:
    """Fails if a step of Newton's method with multigrid leads elsewhere, from a state far from equilibrium."""
    free, found = held(space), []
    top = space.X[:, 1] == space.X[:, 1].max()
    mask = free.reshape(space.X.shape).copy()
    mask[top] = False
    for linear in ("direct", name):
        u = np.zeros_like(space.X)
        u[top, 1], u[top, 0] = 0.4, 0.2
        newton = Newton(Momentum(space, AAA()), mask.ravel(), 1e-10, 60, linear=linear)
        found.append(newton.equilibrium(u)[0])
        assert newton.steps > 3
    assert np.abs(found[1] - found[0]).max() < 1e-8


@pytest.mark.parametrize("name", NAMES)
def test_a_body_is_loaded_to_the_same_onset(name: str, mesh: Path, tmp_path: Path) -> None:
    """Fails if the option does not reach the statics, or another onset is found."""
    rows = []
    for linear in ("direct", name):
        folder = tmp_path / linear
        status, said, _ = invoke("--mesh", mesh, *SMALL, "--event-time", "1e-7", "--linear", linear, "--out", folder)
        assert status == 0, said
        history = History.load(folder / "history.csv")
        rows.append([history[key][history["phase"] == "loading"][-1] for key in ("grip_displacement_mm", "elastic")])
    assert rows[1] == pytest.approx(rows[0], rel=1e-6)


def test_solver_follows_the_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                 capsys: pytest.CaptureFixture[str]) -> None:
    """Fails if a large solid gets factors by default, a small or plane one none, or what is asked for is not taken."""
    block, plate = box("hex", 6, 0.0), box("quad", 6, 0.0)
    assert linear_for("auto", block) == "direct"
    monkeypatch.setattr(linear_module, "SMALL", 0)
    monkeypatch.setattr(linear_module, "LARGE_FACTORS", 7.21e-8 * block.factor_entries)
    assert linear_for("auto", block) == "direct"
    monkeypatch.setattr(linear_module, "LARGE_FACTORS", 7.19e-8 * block.factor_entries)
    large = "petsc-gamg" if HAS_PETSC else "multigrid"
    assert [linear_for(asked, body) for asked, body in (("auto", block), ("direct", block), ("auto", plate))] == [
        large, "direct", "direct"]
    assert Newton.of(pulled(block, SinkLaw()).body, StaticsControls()).solver.exact is False
    monkeypatch.setattr(linear_module, "LARGE_FACTORS", 0.0)
    thick = tmp_path / "thick.vtu"
    sk.write_mesh(thick, sk.grid_mesh(*[np.linspace(0.0, 1.0, 4)] * 3))
    run = sk.custom(mesh=thick, grips=[sk.Grip("top", (0, 1e-3, 0)), sk.Grip("bottom", (0, 0, 0))], event_time=1e-7,
                    out=tmp_path / "run")
    assert f"equilibria by {large}, which suits 192 displacements better than factors do; linear = 'direct' takes " \
        "these" in "".join(capsys.readouterr())
    # an event from the unloaded body does not wait for the size of factors that it has not
    sample = dataclasses.replace(run.scene.sample, space=Space(run.scene.sample.space.mesh))
    assert linear_of(dataclasses.replace(run.scene, sample=sample, event_at=0.0)) == "direct"
    assert "factor_entries" not in vars(sample.space)
    assert linear_of(run.scene) == large


def test_words_that_are_none(tmp_path: Path) -> None:
    """Fails if an unknown solver is taken, or a missing PETSc is found out late."""
    status, said, _ = invoke("--linear", "lu", "--out", tmp_path / "run")
    names = "auto, direct, pardiso, cholmod, superlu, multigrid, petsc-gamg, petsc-mumps"
    assert (status, said) == (2, f"skfsink: linear must be one of {names}; got 'lu'\n")
    if not HAS_PETSC:
        space = box("quad", 3)
        pattern = Pattern(space, 2, held(space), upper=True)
        with pytest.raises(ParameterError, match=r"linear petsc-gamg needs petsc4py .*: install it, or take"):
            solver("petsc-gamg", space, held(space), pattern, 1)
