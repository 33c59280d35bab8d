"""Stability in time: the explicit limit, long HHT steps through the instability, alpha, energy in deleted elements."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..fem.pattern import Pattern
from ..fields.body import Body
from ..fields.density import DensitySolver
from ..fields.momentum import Momentum
from ..fields.state import State
from ..loads.schedule import Loading
from ..material import AAA, SinkLaw
from ..methods.controls import ExplicitControls, HHTControls
from ..methods.explicit import Explicit
from ..methods.frequency import highest_frequency
from ..pictures.plot import BLUE, RED, SAND
from .blocks import block, surface
from .part import Planned, Points
from .plate import Plate

__all__ = ["amplification", "deletion", "draw_alpha", "draw_deletion", "draw_explicit", "draw_hht", "explicit",
           "growth", "long_steps", "plan_alpha", "plan_deletion", "plan_explicit", "plan_hht"]

STATES = {"intact": BLUE, "stretched": SAND, "damaged": RED}


# --- the explicit limit ---
def resting(kind: str) -> tuple[Momentum, DensitySolver, np.ndarray, State]:
    """A distorted block held all around: intact, stretched by 1.3, or with a crack (gamma down to 1e-15)."""
    space = block(12, distortion=0.2).space
    momentum, density = Momentum(space, AAA()), DensitySolver(space, SinkLaw())
    free = np.repeat(~surface(space), 2)
    state = State.intact(space)
    if kind == "stretched":
        state.u = space.X * (np.array([1.3, 1 / 1.3]) - 1)
    if kind == "damaged":
        points = np.einsum("qa,eai->eqi", space.N, space.X[space.conn])
        cracked = (np.abs(points[..., 1] - 0.5) < 0.06) & (points[..., 0] < 0.6)
        state.gamma = density.solve(np.where(cracked, 1.0, 0.0), state.gamma)
    return momentum, density, free, state


def explicit(kind: str, courant: float) -> dict[str, Any]:
    """Growth a step of a disturbance of 1e-8 mm at a fixed step of `courant` times the predicted limit."""
    momentum, density, free, state = resting(kind)
    scheme = Explicit(Body(momentum, density, Loading.steady(momentum.space, free, np.zeros_like(state.u))),
                      ExplicitControls(gamma_every=10**6))
    scheme.begin(state)
    omega, _ = highest_frequency(momentum, Pattern(momentum.space, 2, free, upper=True), free, state.u, scheme.mass,
                                 tolerance=1e-8)
    rest = state.u.copy()
    noise = np.random.default_rng(0).normal(size=rest.shape) * 1e-8
    noise.reshape(-1)[~free] = 0.0
    state.u += noise
    scheme.begin(state)
    scheme.length.fix(courant * 2 / omega)
    sizes = [1.0]
    while sizes[-1] < 1e5 and len(sizes) <= 400:
        scheme.step(state)
        sizes.append(float(np.abs(state.u - rest).max() / np.abs(noise).max()))
    first = next((i for i, size in enumerate(sizes) if size > 10), None)
    grown = 1.0 if first is None else (sizes[-1] / sizes[first]) ** (1 / max(len(sizes) - 1 - first, 1))
    return {"state": kind, "courant": courant, "growth": grown, "predicted": growth(courant), "steps": len(sizes) - 1,
            "omega_max": omega, "greatest": max(sizes)}


def growth(courant: float) -> float:
    """Factor a step by which central differences let the highest mode grow at dt = courant * 2/omega_max."""
    return 1.0 if courant <= 1 else float((courant + np.sqrt(courant**2 - 1)) ** 2)


def plan_explicit(quick: bool) -> list[Planned]:
    courants = (0.9, 0.99, 1.01, 1.1, 1.3) if quick else (0.8, 0.9, 0.95, 0.98, 0.99, 1.005, 1.01, 1.02, 1.05, 1.1, 1.2,
                                                         1.3)
    return [Planned(f"{kind} {c:g}", partial(explicit, kind, c), 0.1) for kind in STATES for c in courants]


def draw_explicit(axes: Sequence[Axes], points: Points) -> None:
    ax = axes[0]
    c = np.linspace(0.8, 1.3, 400)
    ax.plot(c, [growth(x) for x in c], color="0.6", label=r"$(C+\sqrt{C^2-1})^2$")
    for k, (kind, colour) in enumerate(STATES.items()):
        mine = [p for p in points.values() if p["state"] == kind]
        ax.plot([p["courant"] for p in mine], [p["growth"] for p in mine], "os^"[k], color=colour, markersize=4.5 - k,
                fillstyle="none", label=kind)
    ax.axvline(1, color="0.6", linewidth=0.6, linestyle=":")
    ax.set(xlabel=r"$\Delta t\,\omega_{\max}/2$, of the deformed, damaged body", ylabel="growth a step",
           title="Explicit: blow-up above the limit")
    ax.legend()


# --- HHT: long steps through the instability; deletion ---
@cache
def plate(force_floor: float = 1e-3, threshold: float = 1e-6) -> Plate:
    """A block of 15 x 15 elements with a notch of 0.4 mm one element wide, h = l/1.5."""
    return Plate(block(15, notch=0.4, width=0.06), force_floor=force_floor, deletion=threshold, overshoot=0.01)


def _started(notched: Plate) -> State:
    state = notched.onset
    state.begin_event(notched.overshoot)
    return state


def long_steps(dt_us: float, guarded: bool, end_us: float = 20.0) -> dict[str, Any]:
    """Share of the elements that failed, and the energy taken, `end_us` after the onset with steps of up to `dt_us`."""
    notched = plate()
    state = _started(notched)
    hht = notched.hht(HHTControls(dt=dt_us * 1e-6))
    if not guarded:
        hht.scheme.failing_step = np.inf
    hht.begin(state)
    for _ in hht.run(state, end_us * 1e-6):
        pass
    return {"dt_us": dt_us, "guarded": guarded, "deleted": float(state.deleted.mean()),
            "lost_density": 1 - float(notched.density.load @ state.gamma) / float(notched.density.load.sum()),
            "sink": state.ledger.sink / state.ledger.initial, "steps": state.step, "rejected": hht.rejected,
            "numerical": state.ledger.numerical / state.ledger.initial,
            "balance": state.ledger.error(state.ledger.initial)}


def plan_hht(quick: bool) -> list[Planned]:
    steps = (0.2, 2.0, 20.0) if quick else (0.05, 0.1, 0.2, 0.34, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
    return [Planned(f"{dt:g} us, {'guarded' if guarded else 'without guard'}", partial(long_steps, dt, guarded),
                    0.5 + 0.5 / dt) for dt in steps for guarded in (True, False)]


def draw_hht(axes: Sequence[Axes], points: Points) -> None:
    ax = axes[0]
    for guarded, style, name in ((True, "o-", r"at most $0.1\,l/c_s$ where elements fail"),
                                 (False, "s--", "without that guard")):
        mine = [p for p in points.values() if p.get("guarded") is guarded]  # a run that was given up is left out
        ax.plot([p["dt_us"] for p in mine], [100 * p["lost_density"] for p in mine], style,
                color=BLUE if guarded else RED, markersize=3.5, fillstyle="none", label=name)
    ax.axvline(0.34, color="0.6", linewidth=0.6, linestyle=":")
    ax.annotate(r"$0.1\,l/c_s$", (0.34, 1), xytext=(3, 2), textcoords="offset points", fontsize=7, color="0.4")
    ax.set(xscale="log", xlabel="largest step (µs)", ylabel="mass lost after 20 µs (%)", ylim=(0, None),
           title="HHT: long steps through the instability")
    ax.legend()


def deletion(threshold: float, force_floor: float, end_us: float = 20.0) -> dict[str, Any]:
    """Energy in elements at the moment they were deleted, of that of the onset, in an explicit event."""
    notched = plate(force_floor, threshold)
    state = _started(notched)
    scheme = notched.explicit(ExplicitControls())
    scheme.begin(state)
    for _ in scheme.run(state, end_us * 1e-6):
        pass
    ledger = state.ledger
    return {"threshold": threshold, "force_floor": force_floor, "deletion": ledger.deletion / ledger.initial,
            "sink": ledger.sink / ledger.initial, "paper": ledger.paper / ledger.initial,
            "deleted": int(state.deleted.sum()), "steps": state.step,
            "numerical": ledger.numerical / ledger.initial, "balance": ledger.error(ledger.initial)}


def plan_deletion(quick: bool) -> list[Planned]:
    thresholds = (0.3, 1e-2, 1e-6) if quick else (0.5, 0.3, 0.1, 3e-2, 1e-2, 1e-3, 1e-4, 1e-6, 1e-9)
    return [Planned(f"deletion {t:g}, floor {floor:g}", partial(deletion, t, floor), 2.5)
            for floor in (1e-3, 0.0) for t in thresholds]


def draw_deletion(axes: Sequence[Axes], points: Points) -> None:
    ax = axes[0]
    for floor, colour, style in ((0.0, RED, "s--"), (1e-3, BLUE, "o-")):
        mine = [p for p in points.values() if p.get("force_floor") == floor and "deletion" in p]
        ax.plot([p["threshold"] for p in mine], [max(p["deletion"], 1e-14) for p in mine], style, color=colour,
                markersize=3.5, fillstyle="none", label=f"force floor {floor:g}")
    ax.axhline(1e-2, color="0.6", linewidth=0.6, linestyle=":")
    ax.annotate("warning", (1e-9, 1e-2), xytext=(2, 2), textcoords="offset points", fontsize=7, color="0.4")
    ax.annotate("none", (1e-9, 1e-14), xytext=(2, 3), textcoords="offset points", fontsize=7, color="0.4")
    ax.axvspan(1e-2, 1, color="#f6e3e1")
    ax.set(xscale="log", yscale="log", xlabel=r"$\gamma$ at which an element is deleted",
           ylabel="energy deleted with them\n(of the onset)", xlim=(5e-10, 1),
           title="Deletion of elements that carry energy")
    ax.legend(loc=(0.02, 0.66))


# --- alpha ---
def amplification(alpha: float, z: float) -> np.ndarray:
    """Matrix that takes (u, dt v, dt^2 a) of a linear oscillator with omega dt = z over one HHT step (Eq. 25-29)."""
    beta, gamma = (1 - alpha) ** 2 / 4, 0.5 - alpha
    new = np.array([[z * z * (1 + alpha), 0, 1], [1, 0, -beta], [0, 1, -gamma]])
    old = np.array([[z * z * alpha, 0, 0], [1, 1, 0.5 - beta], [0, 1, 1 - gamma]])
    return np.linalg.solve(new, old)


def alpha_scan(alpha: float) -> dict[str, Any]:
    """Spectral radii over omega dt from 0.01 to 1e4: the greatest, where, and that of infinitely long steps."""
    z = np.logspace(-2, 4, 241)
    radii = np.array([np.abs(np.linalg.eigvals(amplification(alpha, x))).max() for x in z])
    return {"alpha": alpha, "greatest": float(radii.max()), "at": float(z[radii.argmax()]), "last": float(radii[-1])}


def plan_alpha(quick: bool) -> list[Planned]:
    values = np.round(np.linspace(-0.8, 0.2, 21 if quick else 61), 6)
    return [Planned(f"alpha {a:g}", partial(alpha_scan, float(a)), 0.02) for a in sorted({*values, -1 / 3, 0.0, -0.05})]


def draw_alpha(axes: Sequence[Axes], points: Points) -> None:
    ax = axes[0]
    mine = sorted(points.values(), key=lambda p: p["alpha"])
    a = [p["alpha"] for p in mine]
    ax.axvspan(-1 / 3, 0, color="#dbe6f0", label="allowed")
    ax.plot(a, [p["greatest"] for p in mine], color=RED, label=r"greatest over $\omega\Delta t$")
    ax.plot(a, [p["last"] for p in mine], color=BLUE, label=r"at $\omega\Delta t=10^4$")
    ax.axhline(1, color="0.6", linewidth=0.6, linestyle=":")
    ax.set(xlabel=r"$\alpha$", ylabel="spectral radius", title=r"HHT: $\alpha$ outside its range")
    ax.legend(loc=(0.12, 0.62))
