"""What skfsink costs on this machine: `python tests/benchmarks/benchmark.py` writes one JSON file a machine.

Each figure stands beside its target. Run it alone: nothing else heavy on the machine, BLAS on one thread.

    python tests/benchmarks/benchmark.py                 # everything, about ten minutes
    python tests/benchmarks/benchmark.py tangent step    # some of it
"""

# ruff: noqa: E402

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import skfem

from skfsink import kernels
from skfsink.density import DensitySolver
from skfsink.explicit import Explicit
from skfsink.forms import momentum_forms
from skfsink.material import AAA, SinkLaw
from skfsink.momentum import Momentum
from skfsink.pattern import Pattern
from skfsink.sample import Sample, load_sample
from skfsink.space import Space
from skfsink.state import State
from skfsink.study.machine import machine

HERE = Path(__file__).resolve().parent


def timed(function: Callable[[], Any], repeat: int) -> dict[str, float]:
    """Median, least and greatest wall time of `repeat` calls after one that is not counted [ms]."""
    function()
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        function()
        times.append((time.perf_counter() - start) * 1e3)
    return {"median_ms": statistics.median(times), "min_ms": min(times), "max_ms": max(times)}


def tangent() -> dict[str, Any]:
    """Hex tangent by the compiled loop and by the scikit-fem form, at 10,648 hexes."""
    line = np.linspace(0, 1, 23)
    space = Space(skfem.MeshHex.init_tensor(line, line, line))
    material, u = AAA(), 0.02 * np.sin(3 * space.X)
    gamma = np.ones_like(space.w)
    pattern = Pattern(space, 3, upper=True)
    loop = timed(lambda: kernels.tangent(space, pattern, material, u, gamma), 5)
    form, basis = momentum_forms(material).tangent, space.u_basis
    start = time.perf_counter()
    form.assemble(basis, displacement=u.ravel(), gamma=gamma, dV=basis.dx)
    by_form = (time.perf_counter() - start) * 1e3
    return {"hexes": space.n_elements, "loop": loop, "form_ms": by_form, "ratio": by_form / loop["median_ms"],
            "target": "ratio >= 15"}


def _cracked(sample: Sample) -> tuple[Momentum, DensitySolver, State, np.ndarray, np.ndarray]:
    """The M4 plate, stretched, with a crack of 1 mm ahead of its notch."""
    space = sample.space
    momentum, density = Momentum(space, AAA()), DensitySolver(space, SinkLaw())
    state = State.intact(space)
    middle = space.X[space.conn].mean(axis=1)
    state.W_max[(abs(middle[:, 1] - 2) < 0.03) & (middle[:, 0] > 1) & (middle[:, 0] < 2)] = 1.0
    state.gamma = density.solve(state.W_max, state.gamma)
    state.u[:, 1] = 0.03 * (space.X[:, 1] - 2)
    free = np.ones(space.X.shape, bool)
    free[np.concatenate([sample.nodes("top"), sample.nodes("bottom")])] = False
    return momentum, density, state, free.ravel(), np.zeros(space.X.shape)


def step() -> dict[str, Any]:
    """Explicit steps on M4 with gamma held, in Gauss point updates a second; and with everything included."""
    sample = load_sample("single_edge_notch", "M4")
    momentum, density, state, free, velocity = _cracked(sample)
    integrator = Explicit(momentum, density, free, velocity)
    integrator.begin(state)
    points = sample.space.w.size

    def several(count: int = 20) -> None:
        for _ in range(count):
            integrator.step(state)

    everything = timed(several, 7)
    integrator.update_density = lambda state: None  # type: ignore[method-assign]
    integrator._set_step = lambda state: None  # type: ignore[method-assign]
    mechanics = timed(several, 7)
    return {"gauss_points": points, "step_ms": mechanics["median_ms"] / 20,
            "step_with_gamma_ms": everything["median_ms"] / 20,
            "gauss_point_updates_per_second": points * 20 / mechanics["median_ms"] * 1e3,
            "best_gauss_point_updates_per_second": points * 20 / mechanics["min_ms"] * 1e3,
            "target": "gauss_point_updates_per_second >= 25e6"}


def gamma() -> dict[str, Any]:
    """Lumped gamma solves on M4: the hierarchy alone, from gamma = 1, and as the crack runs on by 3 % of l."""
    sample = load_sample("single_edge_notch", "M4")
    space = sample.space
    middle, ones = space.X[space.conn].mean(axis=1), np.ones(space.n_nodes)

    def history(length: float) -> np.ndarray:
        ahead = middle[:, 0] - (1 + length)
        profile = np.clip(-ahead / 0.05, 0, 1)[:, None] * (abs(middle[:, 1:2] - 2) < 0.03)
        return 0.3 * profile * np.ones_like(space.w)

    start = time.perf_counter()
    solver = DensitySolver(space, SinkLaw())
    setup = (time.perf_counter() - start) * 1e3

    def cold() -> None:
        solver.last_sink = None
        solver.solve(history(1.0), ones)

    first = timed(cold, 9)
    cold_iterations = solver._amg.iterations
    field, length, times, iterations = solver.solve(history(1.0), ones), 1.0, [], []
    for _ in range(30):
        length += 0.003
        W = history(length)
        start = time.perf_counter()
        field = solver.solve(W, field, Explicit.GAMMA_TOLERANCE)
        times.append((time.perf_counter() - start) * 1e3)
        iterations.append(solver._amg.iterations)
    return {"nodes": space.n_nodes, "setup_ms": setup, "cold_ms": first["median_ms"],
            "cold_iterations": cold_iterations, "warm_ms": statistics.median(times),
            "warm_iterations": statistics.median(iterations), "residual": solver.residual,
            "target": "cold_ms <= 25, warm_ms <= 10"}


def _run(mesh: str) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        start = time.perf_counter()
        subprocess.run([sys.executable, "-m", "skfsink.cases.single_edge_notch", "--mesh", mesh, "--out", str(out),
                        "--quiet"], check=True)
        wall = time.perf_counter() - start
        summary = json.loads((out / "summary.json").read_text())
    return {"wall_s": wall, "event": summary["event"], "energy": summary["energy"], "cost": summary["cost"]}


def event_M4() -> dict[str, Any]:
    """The dynamic run on M4, compiled code in the cache."""
    return {**_run("M4"), "target": "cost.wall_s.event <= 60"}


def run_M3() -> dict[str, Any]:
    """The default run, compiled code in the cache."""
    return {**_run("M3"), "target": "wall_s <= 120"}


def memory_M5() -> dict[str, Any]:
    """The dynamic run on M5 and the memory it takes."""
    return {**_run("M5"), "target": "cost.peak_rss_mb < 1500"}


ALL = {f.__name__: f for f in (tangent, step, gamma, run_M3, event_M4, memory_M5)}


def main(names: list[str]) -> None:
    """Measure what is named, or everything, and write it to `results/<processor>.json` beside this file."""
    stamp = machine()
    slug = "".join(c if c.isalnum() else "-" for c in f"{stamp['processor']}-{stamp['cores']}-cores").strip("-").lower()
    path = HERE / "results" / f"{slug}.json"
    path.parent.mkdir(exist_ok=True)
    report: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}
    report["machine"] = stamp
    for name in names or list(ALL):
        report[name] = ALL[name]()
        print(name, json.dumps(report[name], indent=1))
        path.write_text(json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
