"""Where the onset and the crack depend on the iteration or the mesh: staggering, unconverged passes, notch, l/h."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..fields.deletion import delete_failed
from ..fields.density import DensitySolver
from ..fields.state import State
from ..loads.grips import Grip
from ..methods.controls import StaticsControls
from ..methods.statics import Statics
from ..pictures.plot import BLUE, RED, SAND
from .blocks import block
from .part import Planned, Points
from .plate import SPEED, Plate

__all__ = ["draw_length", "draw_notch", "draw_staggering", "draw_unconverged", "length", "notch", "passes",
           "plan_length", "plan_notch", "plan_staggering", "plan_unconverged", "staggering", "unconverged"]


@cache
def _plate() -> Plate:
    return Plate(block(15, notch=0.4, width=0.06))


def _statics(plate: Plate, **controls: Any) -> Statics:
    return Statics(plate.body, StaticsControls(**controls))


# --- the iterated staggering ---
def staggering() -> dict[str, Any]:
    """Factor a pass by which the change of gamma falls, and least gamma, as the load nears the onset."""
    plate = _plate()
    statics, state = _statics(plate, onset_tolerance=1e-6, max_passes=2000), State.intact(plate.sample.space)
    load, factor, least = [], [], []
    for _ in statics.load(state):
        load.append(state.grip)
        factor.append(statics.factor)
        least.append(float(state.gamma.min()))
    return {"load": np.array(load) / load[-1], "factor": factor, "least": least}


def passes(most: int) -> dict[str, Any]:
    """Opening at the onset [mm] that is found when an increment is given up after `most` passes, and the reason."""
    plate = _plate()
    statics, state = _statics(plate, max_passes=most), State.intact(plate.sample.space)
    for _ in statics.load(state):
        pass
    return {"passes": most, "opening": state.grip * 2e-3, "refused": statics.refused, "newton": statics.newton_steps}


def plan_staggering(quick: bool) -> list[Planned]:
    most = (5, 80) if quick else (3, 5, 8, 12, 20, 40, 80)
    return [Planned("approach", staggering, 8.0)] + [Planned(f"{k} passes", partial(passes, k), 2.0) for k in most]


def draw_staggering(axes: Sequence[Axes], points: Points) -> None:
    found = points["approach"]
    distance = 1 - np.array(found["load"][:-1])
    axes[0].plot(distance, found["factor"][:-1], "o-", color=BLUE, markersize=3, fillstyle="none",
                 label="factor a pass")
    axes[0].plot(distance, found["least"][:-1], "s--", color=SAND, markersize=3, fillstyle="none",
                 label=r"least $\gamma$")
    axes[0].set(xscale="log", xlabel="distance to the onset, 1 - load / onset load", ylim=(0, 1.05),
                ylabel=r"factor of $\max|\Delta\gamma|$ a pass", title="Staggering stalls at the onset")
    axes[0].invert_xaxis()
    axes[0].legend(loc="lower right")
    mine = [p for p in points.values() if "passes" in p]
    right = mine[-1]["opening"]
    for reason, colour, style, name in (("passes", RED, "s", "given up after these"),
                                        ("runs away", BLUE, "o", "runs away")):
        some = [p for p in mine if p["refused"] == reason]
        axes[1].plot([p["passes"] for p in some], [p["opening"] / right for p in some], style, color=colour,
                     markersize=4, fillstyle="none", label=name)
    axes[1].set(xscale="log", xlabel="passes allowed in an increment", ylabel="onset found / onset",
                title="an onset that is found too early")
    axes[1].legend()


# --- a history that follows states that are no equilibria ---
def unconverged(increments: int, steps: int, share: float = 0.95) -> dict[str, Any]:
    """Mass lost on the way to `share` of the onset load if the history follows states short of equilibrium.

    Each of the `increments` moves the grips alone, then makes `steps` full Newton steps (-1: to the equilibrium), and
    then updates history, gamma and deletions, as a sweep does. The solid should be all but intact.
    """
    plate = _plate()
    target, statics, space = share * plate.onset.grip, _statics(plate), plate.sample.space
    state, newton, momentum = State.intact(space), statics.newton, plate.momentum
    density = DensitySolver(space, plate.law)  # that of the plate remembers another history
    momentum.set_gamma(state.gamma, state.deleted)
    for done in range(1, increments + 1):
        state.u += plate.body.loading.velocity(0.0) * target / increments
        if steps < 0:
            state.u, _ = newton.equilibrium(state.u)
        for _ in range(max(steps, 0)):
            newton._kept = None
            d, _ = newton._direction(state.u, momentum.force(state.u).ravel()[newton.free])
            state.u.reshape(-1)[newton.free] += d
        momentum.force(state.u)
        state.W_max = np.maximum(state.W_max, momentum.W)
        state.gamma = density.solve(state.W_max, state.gamma)
        state.time = float(done)
        delete_failed(space, state, plate.deletion, plate.law.failure_energy)
        momentum.set_gamma(state.gamma, state.deleted)
        if state.gamma.max() < 0.5:  # nothing is left that could be solved for
            break
    return {"increments": increments, "steps": steps, "lost": _lost(plate, state), "done": done,
            "deleted": float(state.deleted.mean()), "least": float(state.gamma.min())}


def _lost(plate: Plate, state: State) -> float:
    return 1 - float(plate.density.load @ state.gamma) / float(plate.density.load.sum())


def plan_unconverged(quick: bool) -> list[Planned]:
    counts = (1, 4, 16) if quick else (1, 2, 4, 8, 16, 32, 64)
    return [Planned(f"{n} increments, {k if k >= 0 else 'all'} steps", partial(unconverged, n, k), 0.02 * n + 0.1)
            for k in (0, 1, 2, 3, -1) for n in counts]


def draw_unconverged(axes: Sequence[Axes], points: Points) -> None:
    ax = axes[0]
    for k, colour, style in ((0, RED, "s--"), (1, "#c9793f", "^--"), (2, SAND, "v--"), (3, "0.5", "d--"),
                             (-1, BLUE, "o-")):
        mine = [p for p in points.values() if p["steps"] == k]
        ax.plot([np.log2(p["increments"]) for p in mine], [100 * p["lost"] for p in mine], style, color=colour,
                markersize=3.5, fillstyle="none", label="equilibria" if k < 0 else f"{k} Newton step" + "s" * (k != 1))
    ax.set(xlabel="increments to 95 % of the onset load", ylim=(-3, 103), ylabel="mass lost (%)",
           title="History of states that are no equilibria")
    ax.set_xticks(range(7), [str(2**k) for k in range(7)])
    ax.legend()


# --- the notch and the length scale ---
#: ends that slide sideways: the corners of a block whose ends are held fail before a blunt notch where h is small
ROLLERS = (Grip("top", (None, SPEED)), Grip("bottom", (None, -SPEED)), Grip("pin", (0.0, None)))


def notch(n: int, width: float) -> dict[str, Any]:
    """Opening and force at the onset of a block of n x n elements with a notch of 0.4 mm of this width [mm].

    `tip_mm` is how far from the end of the notch gamma is least.
    """
    plate = Plate(block(n, notch=0.4, width=width, rounded=width > 0), ROLLERS)
    X, weakest = plate.sample.space.X, np.argmin(plate.onset.gamma)
    return {"n": n, "width": width, "h": 1 / n, **plate.onset_figures,
            "tip_mm": float(np.linalg.norm(X[weakest] - (0.4, 0.5)))}


def plan_notch(quick: bool) -> list[Planned]:
    sizes = (10, 20, 40) if quick else (10, 20, 30, 40, 60, 80)
    return [Planned(f"width {width:g}, n {n}", partial(notch, n, width), 1e-3 * n**2)
            for width in (0.0, 0.1, 0.2) for n in sizes]


def draw_notch(axes: Sequence[Axes], points: Points) -> None:
    ax = axes[0]
    for width, style, colour, name in ((0.0, "s--", RED, "slit"), (0.1, "^-", SAND, "round, $l$ wide"),
                                       (0.2, "o-", BLUE, "round, $2l$ wide")):
        mine = [p for p in points.values() if p["width"] == width]
        ax.plot([1e3 * p["h"] for p in mine], [p["opening_mm"] for p in mine], style, color=colour,
                markersize=3.5, fillstyle="none", label=name)
    ax.set(xlabel="element size $h$ (µm)", ylabel="opening at the onset (mm)", xlim=(0, None), ylim=(0, None),
           title="A notch finer than the mesh")
    ax.legend()


def length(per_length: float, n: int) -> dict[str, Any]:
    """Onset of a block with a round notch of 0.2 x 0.2 mm at l/h, and what a quasi-static crack through it takes.

    U and D, when less than a thousandth of the energy is left.
    """
    plate = Plate(block(n, notch=0.2, width=0.2, rounded=True), ROLLERS)
    state = plate.onset
    state.begin_event(0.005)
    for _ in plate.statics().propagate(state):
        if state.ledger.elastic < 1e-3 * state.ledger.initial:
            break
    return {"l_over_h": per_length, "n": n, **plate.onset_figures, "U": state.ledger.paper, "D": state.ledger.sink,
            "passes": state.step, "grip": state.grip * 2e-3, "balance": state.ledger.error(state.ledger.initial)}


def plan_length(quick: bool) -> list[Planned]:
    sizes = (5, 15, 30) if quick else (5, 10, 15, 20, 25, 30, 40, 50)
    return [Planned(f"l/h {n / 10:g}", partial(length, n / 10, n), 1e-2 * n**2) for n in sizes]


def draw_length(axes: Sequence[Axes], points: Points) -> None:
    mine = list(points.values())
    done = [p for p in mine if "U" in p]
    finest = done[-1]
    axes[0].axvspan(0, 1.2, color="#f6e3e1")
    for key, style, colour, name in (("opening_mm", "o-", BLUE, "opening at the onset"), ("U", "s--", RED, "$U$"),
                                     ("D", "^-", SAND, "$D$")):
        axes[0].plot([p["l_over_h"] for p in done], [p[key] / finest[key] for p in done], style, color=colour,
                     markersize=3.5, fillstyle="none", label=name)
    axes[0].set(xlabel="$l/h$", xlim=(0.3, None), ylabel="of that of the finest mesh", ylim=(0, None),
                title="Elements coarse for $l$")
    axes[0].legend()
