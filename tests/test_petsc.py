"""Statics with PETSc on several ranks, by the `mpiexec` of its MPI; `test_multigrid.py` has its solvers on one rank."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from plates import SMALL

from skfsink.errors import ParameterError
from skfsink.fem.petsc_matrix import PETSC, check
from skfsink.methods.ranks import integrator
from skfsink.results.history import History

HERE = Path(__file__).resolve().parent
MPIEXEC = shutil.which("mpiexec", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")]))
HAS = {name: importlib.util.find_spec(name) is not None for name in ("petsc4py", "mpi4py", "pymetis")}
ranks = pytest.mark.skipif(MPIEXEC is None or not all(HAS.values()),
                           reason=f"needs petsc4py, mpi4py and mpiexec of one MPI, and pymetis: {HAS}, {MPIEXEC}")
ROOT = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_rmaps_base_oversubscribe": "1", "OMPI_MCA_mpi_yield_when_idle": "1"}


def finished(count: int, *arguments: str | Path, status: int = 0) -> str:
    """What Python on some ranks, which ends with a status, says of errors."""
    words = [*([str(MPIEXEC), "-n", str(count)] if count > 1 else []), sys.executable, *map(str, arguments)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=500, check=False, cwd=HERE.parent,
                          env={**os.environ, **ROOT})
    assert done.returncode == status, done.stdout + done.stderr
    return done.stderr


@pytest.mark.skipif(HAS["petsc4py"], reason="petsc4py is installed")
@pytest.mark.parametrize("name", PETSC)
def test_a_missing_library_is_found_out_first(name: str) -> None:
    """Fails if a body is loaded before somebody asks whether petsc4py is there."""
    with pytest.raises(ParameterError, match=f"linear {name} needs petsc4py .*: install it, or take linear = .multig"):
        check(name)


def test_what_is_said_of_the_ranks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if ranks are said to compute what they wait for, or the other way round."""
    class Ranks:
        size = 3

    monkeypatch.setattr(integrator, "world", Ranks)
    assert integrator.ranks_text("dynamic", "explicit", "direct") == (
        "3 ranks: one loads the body, all of them compute its event")
    assert integrator.ranks_text("dynamic", "explicit", "petsc-gamg") == (
        "3 ranks: all of them load the body, all of them compute its event")
    assert "one computes all of it, the others wait" in integrator.ranks_text("quasistatic", "explicit", "multigrid")
    assert "all of them load the body and compute its equi" in integrator.ranks_text("quasistatic", "hht", PETSC[1])
    assert "one computes its dynamic event" in integrator.ranks_text("dynamic", "hht", PETSC[0])


@ranks
@pytest.mark.parametrize("count", [2, 3])
def test_parts_of_a_tangent_add_up(count: int) -> None:
    """Fails if a part gives a wrong share, unknowns get to a wrong rank, or motions of parts are not of the body."""
    finished(count, HERE / "petsc_on_ranks.py")


@ranks
def test_what_tangents_in_parts_do_not_know(mesh: Path, tmp_path: Path) -> None:
    """Fails if a body is loaded first, or an option is left out without a word."""
    said = finished(2, "-m", "skfsink.cases.single_edge_notch", "--mesh", mesh, *SMALL, "--kernels", "forms",
                    "--analysis", "quasistatic", "--linear", "petsc-gamg", "--out", tmp_path / "run", status=2)
    assert "linear petsc-gamg on several ranks cannot compute kernels forms: start it on one rank, or take " \
        "linear = 'direct', with which the first rank loads the body" in said
    assert not (tmp_path / "run").exists()


@ranks
@pytest.mark.slow
@pytest.mark.parametrize("name, tolerance", [("petsc-mumps", 1e-9), ("petsc-gamg", 5e-6)])
def test_equilibria_on_all_ranks_are_those_on_one(name: str, tolerance: float, mesh: Path, tmp_path: Path) -> None:
    """Fails if the number of ranks decides anything, in the loading or in quasi-static passes; factors are PARDISO's.

    GAMG ends where Newton's method is content; what is left of forces comes back in D.
    """
    found = []
    for linear, count in (("direct", 1), (name, 1), (name, 2), (name, 3)):
        folder = tmp_path / f"{linear}{count}"
        finished(count, "-m", "skfsink.cases.single_edge_notch", "--mesh", mesh, *SMALL, "--analysis", "quasistatic",
                 "--linear", linear, "--out", folder)
        found.append(History.load(folder / "history.csv"))
    for other in found[1:]:
        for key in ("grip_displacement_mm", "elastic", "sink_stored", "crack_length_mm", "tip_x_mm"):
            scale = np.nanmax(np.abs(found[0][key]))
            assert other[key] == pytest.approx(found[0][key], abs=tolerance * scale, nan_ok=True), key
