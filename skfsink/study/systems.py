"""One linear system of a given size, solved in one way: `python -m skfsink.study.systems density 2 direct 10000`.

It prints its figures as JSON. The study runs it as a process of its own, so that what it takes in memory can be
measured and what takes too long can be ended.
"""

from __future__ import annotations

import ctypes
import json
import os
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
import psutil
import pyamg
import scipy.sparse.linalg as sla
import skfem
from scipy.sparse import bsr_array, csr_array, diags_array

from ..errors import ConvergenceError
from ..fem import kernels
from ..fem.amg import AmgCG, same_random_vectors
from ..fem.direct import Factorization
from ..fem.multigrid import rigid_motions
from ..fem.pattern import Pattern
from ..fem.space import Space
from ..fields.momentum import Momentum
from ..material import AAA, SinkLaw

__all__ = ["METHODS", "OVER_TIME", "SECONDS", "System", "solve_system"]

#: methods by field, with what they are called; the program's own are "intact" for gamma, "factors" for the tangent
METHODS = {
    "density": {"direct": "direct", "amg": "AMG-CG", "lagged": "AMG-CG, lagged", "intact": "AMG-CG, intact, masked",
                "jacobi": "Jacobi-CG"},
    "tangent": {"direct": "direct", "amg": "AMG-CG", "lagged": "AMG-CG, lagged", "factors": "CG, lagged factors",
                "jacobi": "Jacobi-CG"},
}
TOLERANCE, MOST = 1e-8, 100_000   # relative residual, iterations
H = 0.025                         # size of the elements, l/4 [mm]: a larger system is a larger body
SECONDS, GIGABYTES = 120.0, 12.0  # processor time and memory a solution may take, beyond the system itself
OVER_TIME, OVER_MEMORY = 3, 4     # exit statuses
REPEAT = 0.2                      # shorter solutions are repeated to measure their time [s]


class System(NamedTuple):
    """A x = b on a pattern (upper triangle), with the matrix of an earlier state to lag behind."""

    pattern: Pattern
    data: np.ndarray
    b: np.ndarray
    earlier: np.ndarray
    intact: np.ndarray
    candidates: np.ndarray  # near null space, (n, modes)
    block: int

    def matrix(self, data: np.ndarray) -> csr_array:
        """The whole matrix over `data`."""
        whole = self.pattern.symmetric(data)
        return csr_array((whole.data, whole.indices.astype(np.int32), whole.indptr.astype(np.int32)), whole.shape)


def body(dim: int, unknowns: int, block: int) -> Space:
    """Square or cube of about that many unknowns, its elements l/4."""
    n = max(4, round((unknowns / block) ** (1 / dim)))
    line = np.arange(n) * H
    return Space((skfem.MeshQuad if dim == 2 else skfem.MeshHex).init_tensor(*[line] * dim))


def crack(X: np.ndarray, share: float) -> np.ndarray:
    """Distance [mm] of points (..., dim) from a crack at mid-height over a `share` of the width."""
    size = X.reshape(-1, X.shape[-1]).max(axis=0)
    return np.hypot(np.maximum(X[..., 0] - share * size[0], 0.0), X[..., 1] - size[1] / 2)


def density_system(space: Space) -> System:
    """The lumped mass balance with a crack through half of the body; earlier it went through 0.4."""
    law, pattern = SinkLaw(), Pattern(space, upper=True)
    laplacian = kernels.laplacian(space, pattern, law.length_scale**2)
    middle = space.X[space.conn].mean(axis=1)

    def data(share: float) -> np.ndarray:
        failed = crack(middle, share) < 0.6 * H
        sink = 1.0 / (law.history(np.where(failed, 1.0, 0.0)[:, None] * np.ones_like(space.w)) + law.epsilon)
        values = laplacian.copy()
        values[pattern.diagonal] += space.lump(sink)
        return values

    return System(pattern, data(0.5), space.lump(np.ones_like(space.w)), data(0.4), data(-1.0),
                  np.ones((space.n_nodes, 1)), 1)


def tangent_system(space: Space) -> System:
    """The tangent of the body stretched by 10 %, cracked through half of it; earlier by 5 %, through 0.4.

    gamma is 1 - exp(-d/l) at the distance d of the crack, which solves the mass balance beside a straight one.
    """
    dim, X, material = space.dim, space.X, AAA()
    momentum = Momentum(space, material)
    ends = (X[:, 1] < 1e-9) | (X[:, 1] > X[:, 1].max() - 1e-9)
    free = np.repeat(~ends, dim)
    pattern = Pattern(space, dim, free, upper=True)
    none = np.zeros(space.n_elements, bool)

    def stretched(stretch: float, share: float) -> tuple[np.ndarray, np.ndarray]:
        u = np.zeros_like(X)
        u[:, 1] = (stretch - 1) * X[:, 1]
        u[:, 0] = (1 / stretch - 1) * X[:, 0]
        momentum.set_gamma(np.maximum(1 - np.exp(-crack(X, share) / SinkLaw().length_scale), 1e-15), none)
        return u, momentum.tangent(pattern, u)

    intact = stretched(1.0, -10.0)[1]
    earlier = stretched(1.05, 0.4)[1]
    u, data = stretched(1.1, 0.5)
    return System(pattern, data, -momentum.force(u).ravel()[free], earlier, intact, rigid_motions(X)[free], dim)


# --- the methods ---
Solve = Callable[[], tuple[np.ndarray, int]]  # solution and iterations
Renew = Callable[[], Solve]                   # what is to be done when the matrix has changed


def direct(system: System) -> Renew:
    """Factorisation of the matrix scaled to a unit diagonal; the analysis is kept."""
    scale = 1 / np.sqrt(system.data[system.pattern.diagonal])
    rows = np.repeat(np.arange(system.pattern.size), np.diff(system.pattern.indptr))
    data = system.data * scale[rows] * scale[system.pattern.indices]
    solver = Factorization(system.pattern)
    solver.factorize(data)

    def renew() -> Solve:
        solver.factorize(data)
        return lambda: (scale * solver.solve(scale * system.b, TOLERANCE), 0)
    return renew


def hierarchy(system: System, data: np.ndarray) -> sla.LinearOperator:
    """Cycle of smoothed aggregation, with the rigid modes, for the matrix of `data` scaled to a unit diagonal."""
    A = system.matrix(data)
    scale = 1 / np.sqrt(A.diagonal())
    A = diags_array(scale) @ A @ diags_array(scale)
    if system.block > 1:
        A = bsr_array(A, blocksize=(system.block, system.block))
    with same_random_vectors():
        return pyamg.smoothed_aggregation_solver(A, B=system.candidates / scale[:, None], improve_candidates=None,
                                                 max_coarse=200).aspreconditioner()


def amg(system: System) -> Renew:
    """CG with a hierarchy of its own for every matrix."""
    A = system.matrix(system.data)
    return lambda: conjugate(A, system.b, hierarchy(system, system.data))


def lagged(system: System) -> Renew:
    """CG with the hierarchy of an earlier state."""
    A, M = system.matrix(system.data), hierarchy(system, system.earlier)
    return lambda: conjugate(A, system.b, M)


def jacobi(system: System) -> Renew:
    """CG preconditioned by the diagonal."""
    A = system.matrix(system.data)
    return lambda: conjugate(A, system.b, None)


def conjugate(A: csr_array, b: np.ndarray, M: Any) -> Solve:
    """CG on the matrix scaled to a unit diagonal. A sweep of Jacobi's puts values at huge diagonals in their place."""
    D = A.diagonal()
    scale = 1 / np.sqrt(D)
    scaled = csr_array(diags_array(scale) @ A @ diags_array(scale))
    huge = np.flatnonzero(D / np.median(D) > 1e3)

    def solve() -> tuple[np.ndarray, int]:
        count = 0

        def counted(_: np.ndarray) -> None:
            nonlocal count
            count += 1

        x, status = sla.cg(scaled, scale * b, rtol=TOLERANCE, atol=0.0, maxiter=MOST, M=M, callback=counted)
        if status:
            raise ConvergenceError(f"no convergence in {MOST} iterations")
        x *= scale
        if huge.size:
            x[huge] += ((b - A @ x) / D)[huge]
        return x, count
    return solve


def intact(system: System) -> Renew:
    """The program's solver of gamma: the hierarchy of the intact matrix, masked."""
    solver = AmgCG(system.matrix(system.intact), TOLERANCE)
    A = system.matrix(system.data)
    D, start = A.diagonal(), np.ones_like(system.b)

    def solve() -> tuple[np.ndarray, int]:
        x = solver.solve(A, D, system.b, start)
        if x is None:
            raise ConvergenceError(f"no convergence in {solver.max_iterations} iterations")
        return x, solver.iterations
    return lambda: solve


def factors(system: System) -> Renew:
    """The program's solver of a Newton step: CG with the factors of an earlier tangent."""
    solver = Factorization(system.pattern)
    solver.factorize(system.earlier)

    def solve() -> tuple[np.ndarray, int]:
        x, iterations, met = solver.conjugate(system.data, system.b, TOLERANCE, 1000)
        if not met:
            raise ConvergenceError(f"no convergence in {iterations} iterations")
        return x, iterations
    return lambda: solve


SOLVERS: dict[str, Callable[[System], Renew]] = {f.__name__: f for f in (direct, amg, lagged, intact, factors, jacobi)}


def solve_system(field: str, dim: int, method: str, unknowns: int) -> dict[str, Any]:
    """Solve a system; processor times [s], iterations, true relative residual, memory beyond the system itself [MB].

    `once_s` is what is done once for many matrices (analysis, a hierarchy or factors that are kept), `setup_s` what is
    done for every new one, `solve_s` the solution.
    """
    space = body(dim, unknowns, dim if field == "tangent" else 1)
    system = density_system(space) if field == "density" else tangent_system(space)
    del space
    with _Watch() as watch:
        start = time.thread_time()
        renew = SOLVERS[method](system)
        once = time.thread_time() - start
        setup, solve = _timed(renew)
        seconds, (x, iterations) = _timed(solve)
    residual = system.matrix(system.data) @ x - system.b
    return {"unknowns": system.pattern.size, "once_s": once, "setup_s": setup, "solve_s": seconds,
            "iterations": iterations, "residual": float(np.linalg.norm(residual) / np.linalg.norm(system.b)),
            "memory_mb": watch.rise / 1e6}


def _timed(function: Callable[[], Any]) -> tuple[float, Any]:
    """Least processor time of a call [s], of several if it is short, and what it returned."""
    times: list[float] = []
    while not times or (sum(times) < REPEAT and len(times) < 20):
        start = time.thread_time()
        found = function()
        times.append(time.thread_time() - start)
    return min(times), found


class _Watch:
    """Follows the memory of this process; ends it when it works too long or takes too much."""

    def __init__(self) -> None:
        self._process = psutil.Process()
        self._done = threading.Event()
        self.rise = 0.0  #: greatest rise of the resident memory [bytes]

    def __enter__(self) -> _Watch:
        with suppress(OSError, AttributeError):  # what the system's assembly left behind would be used again unseen
            ctypes.CDLL("libc.so.6").malloc_trim(0)
        self._first, self._start = self._process.memory_info().rss, time.process_time()
        self._thread = threading.Thread(target=self._follow, daemon=True)
        self._thread.start()
        return self

    def _look(self) -> None:
        self.rise = max(self.rise, float(self._process.memory_info().rss - self._first))
        if self.rise > GIGABYTES * 1e9:
            os._exit(OVER_MEMORY)
        if time.process_time() - self._start > SECONDS:
            os._exit(OVER_TIME)

    def _follow(self) -> None:
        while not self._done.wait(0.01):
            self._look()

    def __exit__(self, *_: object) -> None:
        self._done.set()
        self._thread.join()
        self._look()


if __name__ == "__main__":
    field_, dim_, method_, unknowns_ = sys.argv[1:]
    try:
        print(json.dumps(solve_system(field_, int(dim_), method_, int(unknowns_))))
    except ConvergenceError as error:
        print(json.dumps({"failed": str(error)}))
