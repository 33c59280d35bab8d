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

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bodies import held_body
from limits import FORCE_BYTES, STEP_BYTES, limits, reached

from skfsink.cases.single_edge_notch import single_edge_notch
from skfsink.fem import kernels
from skfsink.fem.forms import momentum_forms
from skfsink.fem.pattern import Pattern
from skfsink.fem.space import Space
from skfsink.fields.density import Density, DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.fields.state import State
from skfsink.loads.follower import FollowerLoads
from skfsink.material import AAA, SinkLaw
from skfsink.meshing.sample import Sample, load_sample
from skfsink.methods.explicit import Explicit
from skfsink.run.observers.release import EnergyRelease
from skfsink.scene.deck import read_deck
from skfsink.scene.options import Options
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


def _cracked(sample: Sample, threads: int = 1) -> tuple[Momentum, DensitySolver, State, np.ndarray, np.ndarray]:
    """The M4 plate, stretched, with a crack of 1 mm ahead of its notch."""
    space = sample.space
    momentum, density = Momentum(space, AAA(), threads=threads), DensitySolver(space, SinkLaw())
    state = State.intact(space)
    middle = space.X[space.conn].mean(axis=1)
    state.W_max[(abs(middle[:, 1] - 2) < 0.03) & (middle[:, 0] > 1) & (middle[:, 0] < 2)] = 1.0
    state.gamma = density.solve(state.W_max, state.gamma)
    state.u[:, 1] = 0.03 * (space.X[:, 1] - 2)
    free = np.ones(space.X.shape, bool)
    free[np.concatenate([sample.nodes("top"), sample.nodes("bottom")])] = False
    return momentum, density, state, free.ravel(), np.zeros(space.X.shape)


def machine_limits() -> dict[str, Any]:
    """Bandwidth and peak of this machine, and the share of them that the force loops and a step reach."""
    report: dict[str, Any] = {}
    sections = {2: load_sample("single_edge_notch", "M4").space, 3: Space(_slab())}
    for threads in (1, os.cpu_count() or 1):
        most = limits(threads)
        report[f"{threads} threads"] = row = {"most": most}
        for dim, space in sections.items():
            momentum = Momentum(space, AAA(), threads=threads)
            u, out = 0.02 * np.sin(3 * space.X), np.empty_like(space.X)
            force = timed(lambda m=momentum, u=u, out=out: m.force(u, out), 60)["min_ms"]
            row[f"force {dim}D"] = {"elements": space.n_elements, "ms": force,
                                    **reached(dim, space.n_elements, force, most, FORCE_BYTES[dim])}
    return report


def _slab() -> skfem.MeshHex:
    """20,000 hexahedra, two layers."""
    line = np.linspace(0, 1, 101)
    return skfem.MeshHex.init_tensor(line, line, np.linspace(0, 0.02, 3))


def step() -> dict[str, Any]:
    """Explicit steps on M4 with gamma held, in Gauss point updates a second; and with everything included."""
    return {**_steps(1), "all cores": _steps(os.cpu_count() or 1),
            "target": "gauss_point_updates_per_second >= 25e6"}


def _steps(threads: int) -> dict[str, Any]:
    sample = load_sample("single_edge_notch", "M4")
    momentum, density, state, free, velocity = _cracked(sample, threads)
    integrator = Explicit(held_body(momentum, density, free, velocity))
    integrator.begin(state)
    points = sample.space.w.size

    def several(count: int = 20) -> None:
        for _ in range(count):
            integrator.step(state)

    everything = timed(several, 7)
    integrator.update_density = lambda state: None  # type: ignore[method-assign]
    integrator.length.fix(integrator.dt)
    mechanics = timed(several, 7)
    ms = mechanics["median_ms"] / 20
    return {"gauss_points": points, "step_ms": ms, "step_with_gamma_ms": everything["median_ms"] / 20,
            "gauss_point_updates_per_second": points / ms * 1e3,
            "best_gauss_point_updates_per_second": points * 20 / mechanics["min_ms"] * 1e3,
            "share": reached(2, sample.space.n_elements, ms, limits(threads), STEP_BYTES[2])}


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
        solver.solve(history(1.0), ones)

    first = timed(cold, 9)
    cold_iterations = solver._iterative.iterations
    density, length, times, iterations = solver.update(history(1.0), Density(ones)), 1.0, [], []
    for _ in range(30):
        length += 0.003
        W = history(length)
        start = time.perf_counter()
        density = solver.update(W, density, Explicit.GAMMA_TOLERANCE)
        times.append((time.perf_counter() - start) * 1e3)
        iterations.append(solver._iterative.iterations)
    return {"nodes": space.n_nodes, "setup_ms": setup, "cold_ms": first["median_ms"],
            "cold_iterations": cold_iterations, "warm_ms": statistics.median(times),
            "warm_iterations": statistics.median(iterations), "residual": solver.residual,
            "target": "cold_ms <= 25, warm_ms <= 10"}


def _run(case: str, *arguments: str, threads: int = 0) -> dict[str, Any]:
    """A whole run as a user starts it, on all cores, or on `threads` of them."""
    environment = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        start = time.perf_counter()
        subprocess.run([sys.executable, "-m", f"skfsink.cases.{case}", *arguments, "--threads", str(threads), "--out",
                        str(out), "--quiet"], check=True, env=environment)
        wall = time.perf_counter() - start
        summary = json.loads((out / "summary.json").read_text())
    return {"wall_s": wall, "event": summary["event"], "energy": summary["energy"], "cost": summary["cost"]}


def run_M3() -> dict[str, Any]:
    """The default run."""
    return {**_run("single_edge_notch"), "target": "wall_s <= 120"}


def event_M4() -> dict[str, Any]:
    """Loading and dynamic event on M4."""
    return {**_run("single_edge_notch", "--mesh", "M4"), "target": "cost.wall_s.event <= 20, cost.wall_s.loading <= 8"}


def event_M4_one_thread() -> dict[str, Any]:
    """The same on one core."""
    return _run("single_edge_notch", "--mesh", "M4", threads=1)


def memory_M5() -> dict[str, Any]:
    """The dynamic run on M5 and the memory it takes."""
    return {**_run("single_edge_notch", "--mesh", "M5"), "target": "cost.peak_rss_mb < 1500"}


def quasistatic_M4() -> dict[str, Any]:
    """The quasi-static run on M4."""
    return {**_run("single_edge_notch", "--mesh", "M4", "--analysis", "quasistatic"), "target": "wall_s <= 120"}


def hht_M3() -> dict[str, Any]:
    """The event on M3 by HHT."""
    return {**_run("single_edge_notch", "--integrator", "hht"), "target": "cost.wall_s.event <= 300"}


def dog_bone() -> dict[str, Any]:
    """The dynamic run of the dog-bone of the paper's size, 82,992 hexahedra, on one core."""
    return {**_run("dog_bone", "--mesh", "paper", threads=1), "target": "cost.wall_s.event <= 480"}


def pressure() -> dict[str, Any]:
    """Shares of the event of the aneurysm that its pressure takes, which acts in the tear as well, on one core."""
    decks = HERE.parents[1] / "cases" / "aneurysm"
    methods = ("add_force", "work", "keep", "at", "stiffest")
    return {"coarse": _share(FollowerLoads, methods, lambda out: read_deck(decks / "scene.toml").run(**out)),
            "fine": _share(FollowerLoads, methods, lambda out: read_deck(decks / "fine.toml").run(**out)),
            "target": "share <= 0.05"}


def release_rate() -> dict[str, Any]:
    """Share of the event of the plate on M3 that its energy release rate takes with a look each microsecond."""
    def run(out: dict[str, Any]) -> None:
        single_edge_notch(mesh="M3", options=Options(observers=(EnergyRelease(1e-6),), **out))

    return {**_share(EnergyRelease, ("look",), run), "target": "share <= 0.05"}


def _share(kind: type, names: tuple[str, ...], run: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
    """Share of the event of a run that some methods take, on one core, when all is compiled."""
    spent = dict.fromkeys(names, 0.0)

    def watched(name: str, method: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            start = time.perf_counter()
            result = method(*arguments)
            spent[name] += time.perf_counter() - start
            return result

        return call

    def begin(integrator: Explicit, *arguments: Any) -> Any:
        spent.update(dict.fromkeys(names, 0.0))
        return start_of_event(integrator, *arguments)

    start_of_event, methods = Explicit.begin, {name: getattr(kind, name) for name in names}
    try:
        Explicit.begin = begin  # type: ignore[assignment, method-assign]
        for name, method in methods.items():
            setattr(kind, name, watched(name, method))
        with tempfile.TemporaryDirectory() as folder:
            for time_of in ("compiled", "counted"):
                run({"out": Path(folder) / time_of, "quiet": True, "threads": 1})
            summary = json.loads((Path(folder) / time_of / "summary.json").read_text())
    finally:
        Explicit.begin = start_of_event  # type: ignore[method-assign]
        for name, method in methods.items():
            setattr(kind, name, method)
    event = summary["cost"]["wall_s"]["event"]
    return {"elements": summary["elements"], "event_s": event, "spent_s": spent, "share": sum(spent.values()) / event}


def start_up() -> dict[str, Any]:
    """From the shell to the first step of the coarse plate: compiled code in the cache, and none of it."""
    probe = ("from pathlib import Path; from skfsink import simulate as s; step = s.Simulation._pause\n"
             "def first(*a): raise SystemExit(0)\n"
             "s.Simulation._pause = first\n"
             "from skfsink import Options; from skfsink.cases.single_edge_notch import single_edge_notch\n"
             "single_edge_notch(mesh='coarse', options=Options(out=Path('{}'), quiet=True))")

    def once(cache: str) -> float:
        with tempfile.TemporaryDirectory() as folder:
            start = time.perf_counter()
            subprocess.run([sys.executable, "-c", probe.format(Path(folder) / "run")], check=True,
                           env={**os.environ, "NUMBA_CACHE_DIR": cache})
            return time.perf_counter() - start

    with tempfile.TemporaryDirectory() as cache:
        cold = once(cache)
        warm = [once(cache) for _ in range(4)][1:]
    return {"cold_s": cold, "warm_s": statistics.median(warm), "target": "cold_s <= 20, warm_s <= 3"}


ALL = {f.__name__: f for f in (tangent, machine_limits, step, gamma, start_up, run_M3, event_M4, event_M4_one_thread,
                               memory_M5, quasistatic_M4, hht_M3, dog_bone, pressure, release_rate)}


def main(names: list[str]) -> None:
    """Measure what is named, or everything, and write it to `results/<processor>.json` beside this file."""
    if unknown := [name for name in names if name not in ALL]:
        raise SystemExit(f"benchmark.py: {unknown[0]} is none of {', '.join(ALL)}")
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
