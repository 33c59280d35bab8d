"""Stability in space: locking, checkerboards, elements pressed flat, and the consistent sink."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import cg, spsolve

from ..errors import ConvergenceError
from ..fem.indicators import alternation, element_pressure
from ..fem.space import Space
from ..fields.density import DensitySolver
from ..fields.momentum import Momentum
from ..fields.sinks import SINKS
from ..material import AAA, SinkLaw
from ..methods.controls import StaticsControls
from ..methods.newton import Newton
from ..pictures.plot import BLUE, RED, SAND
from .blocks import block, surface, trapezium
from .part import Planned, Points

__all__ = ["checkerboard", "consistent", "draw_checkerboard", "draw_flat", "draw_locking", "draw_sink", "flattened",
           "locking", "plan_checkerboard", "plan_flat", "plan_locking", "plan_sink"]

MU = AAA().shear_modulus
LAW = SinkLaw()


# --- locking ---
def locking(element: str, ratio: float, n: int = 16) -> dict[str, Any]:
    """Force that moves the end of Cook's membrane by 1 mm, at a bulk modulus of `ratio` mu; what Newton's method took.

    `rounding` is the residual that is left after ten more steps, relative to the forces inside.
    """
    space = trapezium(n)
    momentum = Momentum(space, AAA(bulk_modulus=ratio * MU), element)
    left, right = np.isclose(space.X[:, 0], 0), np.isclose(space.X[:, 0], 48)
    free = np.ones(space.X.shape, bool)
    free[left] = False
    free[right, 1] = False
    move = np.zeros_like(space.X)
    move[right, 1] = 1.0
    newton = Newton(momentum, free.ravel(), StaticsControls().tolerance, 40)
    try:
        u, force = newton.equilibrium(newton.predict(np.zeros_like(space.X), move))
    except ConvergenceError as error:
        return {"element": element, "ratio": ratio, "refused": str(error)}
    steps = newton.steps
    best = np.inf
    for _ in range(10):  # as far down as it goes
        residual = force.ravel()[newton.free]
        best = min(best, float(np.linalg.norm(residual) / np.linalg.norm(force)))
        d, _ = newton._direction(u, residual)
        u.reshape(-1)[newton.free] += d
        force = momentum.force(u)
    return {"element": element, "ratio": ratio, "force": float(force[right, 1].sum()), "newton": steps,
            "rounding": best}


def plan_locking(quick: bool) -> list[Planned]:
    decades = range(1, 8, 2) if quick else range(11)
    return [Planned(f"{element}, k/mu {10.0 ** d:g}", partial(locking, element, 10.0**d), 0.15)
            for element in ("jbar", "plain") for d in decades]


def draw_locking(axes: Sequence[Axes], points: Points) -> None:
    for element, style, colour, name in (("jbar", "o-", BLUE, r"element-constant $\bar J$"),
                                         ("plain", "s--", RED, "plain Q1")):
        mine = [p for p in points.values() if p["element"] == element and "force" in p]
        refused = [p["ratio"] for p in points.values() if p["element"] == element and "refused" in p]
        axes[1].plot(refused, [2e-6 if element == "jbar" else 8e-7] * len(refused), "x", color=colour, markersize=4)
        axes[0].plot([p["ratio"] for p in mine], [p["force"] for p in mine], style, color=colour, markersize=3.5,
                     fillstyle="none", label=name)
        axes[1].plot([p["ratio"] for p in mine], [p["rounding"] for p in mine], style, color=colour, markersize=3.5,
                     fillstyle="none", label=name)
    axes[0].set(xscale="log", yscale="log", xlabel=r"$k/\mu$", ylabel="force at 1 mm (N/mm)",
                title="Locking: Cook's membrane")
    axes[0].axvline(50, color="0.6", linewidth=0.6, linestyle=":")
    axes[1].axhline(1e-7, color="0.6", linewidth=0.6, linestyle=":")
    axes[1].annotate("tolerance of equilibria", (axes[1].get_xlim()[0], 1e-7), xytext=(3, 2), fontsize=7, color="0.4",
                     textcoords="offset points")
    axes[1].axvline(2e4, color="0.6", linewidth=0.6, linestyle=":")
    axes[1].plot([], [], "x", color="0.4", markersize=4, label="no equilibrium")
    axes[1].legend(loc="lower right")
    axes[1].set(xscale="log", yscale="log", xlabel=r"$k/\mu$", ylabel="residual left by rounding",
                title="volume so stiff that rounding shows", ylim=(1e-13, 1e-5))
    axes[0].legend()


# --- checkerboard ---
def checkerboard(ratio: float, distortion: float, n: int = 16) -> dict[str, Any]:
    """Alternating pressure of a block held all around whose top is moved sideways by 1 %, as in a driven cavity."""
    space = block(n, distortion=distortion).space
    momentum = Momentum(space, AAA(bulk_modulus=ratio * MU))
    free = np.repeat(~surface(space), 2)
    move = np.zeros_like(space.X)
    top = np.isclose(space.X[:, 1], 1.0) & (space.X[:, 0] > 1e-9) & (space.X[:, 0] < 1 - 1e-9)
    move[top, 0] = 0.01
    newton = Newton(momentum, free, StaticsControls().tolerance, 60)
    u, _ = newton.equilibrium(newton.predict(np.zeros_like(space.X), move))
    pressure = element_pressure(space, u, ratio * MU)
    amplitude = alternation(space, pressure)
    return {"ratio": ratio, "distortion": distortion, "amplitude": amplitude / MU,
            "energy": amplitude**2 / (2 * ratio * MU) / LAW.phi}


def plan_checkerboard(quick: bool) -> list[Planned]:
    ratios = (1e2, 1e4) if quick else (1e1, 1e2, 1e3, 1e4, 1e5)
    amounts = (0.0, 0.2) if quick else (0.0, 0.02, 0.05, 0.1, 0.2, 0.3)
    return [Planned(f"k/mu {r:g}, distortion {a:g}", partial(checkerboard, r, a), 0.1) for r in ratios for a in amounts]


def draw_checkerboard(axes: Sequence[Axes], points: Points) -> None:
    ratios = sorted({p["ratio"] for p in points.values() if "ratio" in p})
    for k, ratio in enumerate(ratios):
        mine = [p for p in points.values() if p.get("ratio") == ratio]
        colour = str(0.75 * (1 - k / max(len(ratios) - 1, 1)))
        axes[0].plot([100 * p["distortion"] for p in mine], [p["amplitude"] for p in mine], "o-", color=colour,
                     markersize=3, label=rf"$k/\mu=10^{{{np.log10(ratio):.0f}}}$")
        axes[1].plot([100 * p["distortion"] for p in mine], [p["energy"] for p in mine], "o-", color=colour,
                     markersize=3)
    axes[0].set(yscale="log", xlabel="distortion of the mesh (% of $h$)", ylabel=r"alternating pressure / $\mu$",
                title=r"Q1 with $\bar J$: checkerboard of pressure")
    axes[1].set(yscale="log", xlabel="distortion of the mesh (% of $h$)", ylabel=r"its energy / $\Phi$",
                title="what the sink sees of it")
    axes[0].axhline(0.1, color="0.6", linewidth=0.6, linestyle=":")
    axes[0].annotate("warning", (30, 0.1), xytext=(0, 2), textcoords="offset points", fontsize=7, color="0.4",
                     ha="right")
    axes[0].legend(ncols=2)


# --- elements pressed flat ---
def flattened(stretch: float) -> dict[str, Any]:
    """A block of 4 x 4 distorted elements between grips, sides free, pressed to `stretch` of its height.

    Least J: `moved` with the grips moved alone, `full` after a full step of Newton's method from there, `least` in the
    equilibrium that is reached in increments of 5 %, if it is; `single` says whether one increment reaches it too.
    `energy` is the greatest stored energy in it over the energy limiter.
    """
    space = block(4, distortion=0.2).space
    momentum = Momentum(space, AAA())
    top, bottom = np.isclose(space.X[:, 1], 1.0), np.isclose(space.X[:, 1], 0.0)
    free = np.ones(space.X.shape, bool)
    free[top | bottom] = False
    move = np.zeros_like(space.X)
    move[top, 1] = stretch - 1
    newton = Newton(momentum, free.ravel(), StaticsControls().tolerance, StaticsControls().max_newton)
    force = momentum.force(move)
    found: dict[str, Any] = {"stretch": stretch, "moved": momentum.least_J}
    d, _ = newton._direction(move, force.ravel()[newton.free])
    full = move.copy()
    full.reshape(-1)[newton.free] += d
    momentum.force(full)
    found["full"] = momentum.least_J
    for name, increments in (("single", 1), ("many", int(np.ceil((1 - stretch) / 0.05)))):
        u = np.zeros_like(space.X)
        try:
            for _ in range(increments):
                u, force = newton.equilibrium(newton.predict(u, move / increments))
        except ConvergenceError as error:
            found[name] = str(error)
        else:
            found |= {name: "", "least": momentum.least_J, "energy": float(momentum.W.max()) / LAW.phi,
                      "force": float(force[top, 1].sum())}
    return found


def plan_flat(quick: bool) -> list[Planned]:
    stretches = np.linspace(0.9, 0.1, 5) if quick else np.linspace(0.95, 0.02, 32)
    return [Planned(f"pressed to {s:.3f}", partial(flattened, float(s)), 0.1) for s in stretches]


def draw_flat(axes: Sequence[Axes], points: Points) -> None:
    mine = sorted(points.values(), key=lambda p: p["stretch"])
    found = [p for p in mine if p["many"] == ""]
    axes[0].axhspan(-10, 0, color="#f6e3e1")
    for key, style, colour, name in (("moved", ":", "0.4", "grips moved alone"), ("full", "s--", RED, "one full step")):
        axes[0].plot([p["stretch"] for p in mine], [p[key] for p in mine], style, color=colour, markersize=3,
                     fillstyle="none", label=name)
    axes[0].plot([p["stretch"] for p in found], [p["least"] for p in found], "o-", color=BLUE, markersize=3,
                 fillstyle="none", label="increments of 5 %")
    refused = [p["stretch"] for p in mine if p["single"]]
    axes[0].plot(refused, np.full(len(refused), -1.9), "x", color="k", markersize=3, label="refused in one")
    refused = [p["stretch"] for p in mine if p["many"]]
    axes[0].plot(refused, np.full(len(refused), -1.7), "+", color=BLUE, markersize=4, label="refused in increments")
    axes[0].set(xlabel="height of the pressed block / its own", ylabel="least $J$", ylim=(-2, 1.1),
                title="Elements pressed flat", xlim=(0, 1))
    axes[1].plot([p["stretch"] for p in found], [p["energy"] for p in found], "o-", color=SAND, markersize=3)
    axes[1].axhline(1, color="0.6", linewidth=0.6, linestyle=":")
    axes[1].set(yscale="log", xlabel="height of the pressed block / its own", ylabel=r"greatest $W/\Phi$",
                title="the sink takes them before that")
    axes[0].legend(loc=(0.02, 0.14), fontsize=6)


# --- the consistent sink ---
def consistent(sink: str, per_length: int, epsilon: float, seed: int) -> dict[str, Any]:
    """Least gamma beside a crack whose faces cut through elements, and conjugate-gradient iterations.

    `jacobi` of them with the diagonal as preconditioner (5000 at the most), `amg` with that of a run; `amg_converged`
    says whether that got there.
    """
    space = block(10 * per_length, distortion=0.2, seed=seed).space
    W = np.where(_cracked(space, 0.5 + 0.02 * seed / per_length), 1.0, 0.0)
    law = SinkLaw(epsilon=epsilon)
    solver = DensitySolver(space, law, sink)
    data = solver._assemble(1.0 / (law.history(W) + law.epsilon))
    one = np.ones(space.n_nodes)
    result = solver._iterative.solve(solver.pattern.matrix(data), data[solver.pattern.diagonal], solver.load, one)
    A = solver.pattern.matrix(data)
    scale = diags_array(1 / np.sqrt(A.diagonal()))
    scaled = csc_array(scale @ A @ scale)
    gamma = scale @ spsolve(scaled, scale @ solver.load)
    count = 0

    def another(_: np.ndarray) -> None:
        nonlocal count
        count += 1

    cg(scaled, scale @ solver.load, rtol=1e-8, maxiter=5000, callback=another)
    return {"sink": sink, "l_over_h": per_length, "epsilon": epsilon, "least": float(gamma.min()),
            "greatest": float(gamma.max()), "jacobi": count, "amg": solver._iterative.iterations,
            "amg_converged": result is not None}


def _cracked(space: Space, middle: float) -> np.ndarray:
    """Gauss points (ne, nq) of a wavy band 0.07 mm wide, about this height, through 0.6 of the block."""
    x, y = np.moveaxis(np.einsum("qa,eai->eqi", space.N, space.X[space.conn]), -1, 0)
    mask: np.ndarray = (np.abs(y - middle - 0.05 * np.sin(8 * x)) < 0.035) & (x < 0.6)
    return mask


def plan_sink(quick: bool) -> list[Planned]:
    sizes = (2, 4) if quick else (1, 2, 3, 4, 6, 8)
    floors = (1e-3, 1e-6) if quick else (1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12)
    return ([Planned(f"{sink}, l/h {n}, mesh {seed}", partial(consistent, sink, n, 1e-15, seed), 0.1 * n)
             for sink in SINKS for n in sizes for seed in range(1 if quick else 5)]
            + [Planned(f"{sink}, eps {e:g}", partial(consistent, sink, 4, e, 0), 0.5)
               for sink in ("lumped", "consistent") for e in floors])


def draw_sink(axes: Sequence[Axes], points: Points) -> None:
    for sink, colour, style in (("lumped", BLUE, "o-"), ("nearest", SAND, "^-"), ("consistent", RED, "s--")):
        sizes = sorted({p["l_over_h"] for p in points.values()})
        axes[0].plot(sizes, [min(p["least"] for p in points.values() if p["sink"] == sink and p["l_over_h"] == n)
                             for n in sizes], style, color=colour, markersize=3.5, fillstyle="none", label=sink)
        mine = sorted((p for key, p in points.items() if p["sink"] == sink and "eps" in key),
                      key=lambda p: p["epsilon"])
        if len(mine) > 1:
            axes[1].plot([1 / p["epsilon"] for p in mine], [p["jacobi"] for p in mine], style, color=colour,
                         markersize=3.5, fillstyle="none", label=f"{sink}, diagonal")
            amg = [p for p in mine if p["amg_converged"]]
            axes[1].plot([1 / p["epsilon"] for p in amg], [p["amg"] for p in amg], style, color=colour, linewidth=0.7,
                         markersize=3.5, label=f"{sink}, pyamg")
    axes[0].axhspan(-1, 0, color="#f6e3e1", zorder=0)
    axes[0].set(xlabel="$l/h$", ylabel=r"least $\gamma$", ylim=(-0.2, 0.05), title=r"Sinks: $\gamma$ beside a crack")
    axes[1].set(xscale="log", yscale="log", xlabel=r"greatest sink coefficient, $1/\varepsilon$",
                ylabel="CG iterations", title="stagnating conjugate gradients")
    axes[0].legend()
    axes[1].legend(fontsize=6)
