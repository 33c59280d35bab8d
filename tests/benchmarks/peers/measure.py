"""One library on one problem, in a process of its own: `python measure.py PEER PROBLEM.npz OUT.json`.

A peer is a class with three methods; the same Newton loop drives all of them, so that they differ only in what they
are compared by. One that has a Newton method made for the problem may bring it along (`step`).
"""

from __future__ import annotations

import importlib
import json
import os
import resource
import sys
import time
from collections import defaultdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from problem import Problem

__all__ = ["Clock", "Peer", "measure"]

MOST = 25  # Newton iterations in a step


class Clock:
    """Processor times of what happens often, by name [s].

    On one thread that is the wall time of a machine with nothing else to do, whatever else this one does.
    """

    def __init__(self) -> None:
        self.times: dict[str, list[float]] = defaultdict(list)

    def timed(self, name: str, function: Any) -> Any:
        """`function`, each call of which is timed under `name`."""
        def wrapper(*args: Any, **kwargs: Any) -> Any:
            start = time.process_time()
            result = function(*args, **kwargs)
            self.times[name].append(time.process_time() - start)
            return result
        return wrapper

    def median(self, name: str) -> float:
        """Median of the calls [ms]."""
        return float(np.median(self.times[name])) * 1e3 if self.times[name] else 0.0


class Peer:
    """What a library has to do. Made from the problem; spaces, quadrature and sparsity are made here.

    Attributes
    ----------
    element: "jbar" (element-constant J_bar, or Q1/P0, which is the same) or "plain" (J at each Gauss point).
    solver: the sparse direct solver used.
    packages: distributions whose versions are reported.
    """

    element = "jbar"
    solver = ""
    packages: tuple[str, ...] = ()

    def __init__(self, problem: Problem) -> None:
        self.problem = problem

    def assemble(self, u: np.ndarray) -> np.ndarray:
        """Internal force (n, dim) at the displacement (n, dim); makes and keeps the tangent there too."""
        raise NotImplementedError

    def solve(self, force: np.ndarray, move: np.ndarray) -> np.ndarray:
        """Newton correction (n, dim) with the tangent kept; equal to `move` (n, dim) at the grips."""
        raise NotImplementedError

    def constraint(self) -> float:
        """Relative norm of the equations beside those of momentum (of the pressure, say) at the last assembly."""
        return 0.0

    def forget(self) -> None:
        """Drop what :meth:`solve` has prepared for the next :meth:`assemble`."""


def _high_water() -> float:
    """Greatest resident memory of this process so far [MB]."""
    status = Path("/proc/self/status")
    if status.exists():  # ru_maxrss counts the parent too
        return next(int(line.split()[1]) for line in status.read_text().splitlines() if "VmHWM" in line) / 1024
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (2**20 if sys.platform == "darwin" else 2**10)


def _newton(peer: Peer, u: np.ndarray, grips: np.ndarray, clock: Clock) -> tuple[np.ndarray, np.ndarray, int, float]:
    """Equilibrium at new grips, from one at old grips: displacement, force, corrections made, last residual."""
    problem, held = peer.problem, peer.problem.held
    assemble, solve = clock.timed("assembly", peer.assemble), clock.timed("solve", peer.solve)
    force = assemble(u)
    for iteration in range(1, MOST + 1):
        u = u + solve(force, np.where(held, grips - u, 0.0))
        force = assemble(u)
        residual = float(np.linalg.norm(force[~held]) / np.linalg.norm(force))
        if max(residual, peer.constraint()) <= problem.tolerance:
            return u, force, iteration, residual
    raise RuntimeError(f"no equilibrium in {MOST} iterations; the residual is {residual:.1e}")


def measure(kind: type[Peer], problem: Problem) -> dict[str, Any]:
    """All figures of one peer on one problem."""
    base, start = _high_water(), time.process_time()
    peer = kind(problem)
    setup = time.process_time() - start
    clock = Clock()
    start = time.process_time()
    if hasattr(peer, "step"):
        step = peer.step
        peer.warm_up(clock)  # type: ignore[attr-defined]
    else:
        step = _newton
        zero = np.zeros(problem.X.shape)
        for _ in range(2):  # the second time nothing is compiled any more
            peer.solve(peer.assemble(zero), problem.grips(problem.elongation[0]))
            peer.forget()
    warm = time.process_time() - start
    clock.times.clear()
    u = np.zeros(problem.X.shape)
    iterations, reactions, residuals, steps = [], [], [], []
    wall = time.perf_counter()
    for elongation in problem.elongation:
        start = time.process_time()
        args = (peer, u, problem.grips(elongation), clock)
        u, force, count, residual = step(*args) if step is _newton else step(*args[1:])
        steps.append(time.process_time() - start)
        iterations.append(count)
        residuals.append(residual)
        reactions.append(problem.reaction(force))
    wall = time.perf_counter() - wall
    return {"element": peer.element, "solver": peer.solver, "versions": {p: version(p) for p in peer.packages},
            "unknowns": int((~problem.held).sum()), "elements": len(problem.cells),
            "setup_s": setup, "warm_up_s": warm, "assembly_ms": clock.median("assembly"),
            "solve_ms": clock.median("solve"), "iterations": iterations, "total_s": sum(steps), "steps_s": steps,
            "wall_s": wall, "base_mb": base, "peak_mb": _high_water(), "reactions": reactions, "residuals": residuals,
            **getattr(peer, "extra", dict)()}


def main(name: str, source: str, out: str) -> None:
    """`name` is `module` or `module:variant`; the module's `PEERS` holds the class of each variant."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    module, _, variant = name.partition(":")
    kind = importlib.import_module(f"peer_{module}").PEERS[variant]
    Path(out).write_text(json.dumps(measure(kind, Problem.load(Path(source)))))


if __name__ == "__main__":
    main(*sys.argv[1:])
