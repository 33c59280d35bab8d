"""Stability of dynamic runs of strong materials: energy the schemes feed in, with rejected steps and without."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm

from ..errors import SkfsinkError
from ..fem import indicators
from ..material import SinkLaw, Yeoh
from ..methods.controls import ExplicitControls, HHTControls
from ..pictures.plot import RED
from .blocks import block
from .part import Planned, Points
from .plate import Integrator, Plate

__all__ = ["draw_strength", "explicit_event", "hht_event", "plan_strength"]

RATIOS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 138.0)   # Phi/mu; the last is that of the library
COURANTS = (0.1, 0.2, 0.4, 0.8, 1.0)
STEPS = (0.04, 0.16, 0.64)                         # of HHT [us]
END = 20e-6                                        # of the events [s]
NAMES = {"explicit": "Explicit", "hht": "HHT"}
LOST = 0.05                                        # of the energy at the start, at which a run would be stopped


@cache
def plate(ratio: float) -> Plate:
    """A block of 15 x 15 elements with a notch of 0.4 mm one element wide, of Yeoh's rubber with that Phi/mu."""
    material = Yeoh()
    return Plate(block(15, notch=0.4, width=0.06), material=material,
                 law=SinkLaw(phi=ratio * material.shear_modulus), overshoot=0.01)


def _event(ratio: float, scheme: Integrator) -> dict[str, Any]:
    """An event of `END`: the greatest energy fed in or taken out by then, of that of the start, and how far it came."""
    body = plate(ratio)
    state = body.onset
    state.begin_event(body.overshoot)
    scheme.begin(state)
    worst, why = 0.0, ""
    with np.errstate(all="ignore"):
        try:
            for _ in scheme.run(state, END):
                lost = abs(state.ledger.numerical) / state.ledger.initial
                worst = max(worst, lost) if np.isfinite(lost) else np.inf
                if not worst < 1.0:
                    why = "blew up"
                    break
        except SkfsinkError as error:
            why = str(error).partition(":")[0].partition(" at t =")[0]
    count, gamma = indicators.inverted(body.momentum.space, state.u, body.momentum.gamma)
    return {"ratio": ratio, "lost": worst if np.isfinite(worst) else 1e9, "ended_us": state.time * 1e6, "why": why,
            "steps": state.step, "rejected": scheme.rejected, "inside_out": count, "gamma_inside_out": gamma}


def explicit_event(ratio: float, courant: float, rejects: bool) -> dict[str, Any]:
    """The explicit scheme; without rejection steps are taken as they come."""
    tolerance = ExplicitControls.energy_tolerance if rejects else 0.0
    controls = ExplicitControls(courant=courant, energy_tolerance=tolerance)
    return {"scheme": "explicit", "courant": courant, "rejects": rejects,
            **_event(ratio, plate(ratio).explicit(controls))}


def hht_event(ratio: float, dt_us: float, rejects: bool) -> dict[str, Any]:
    """The implicit scheme."""
    tolerance = HHTControls.gain_tolerance if rejects else 1.0
    controls = HHTControls(dt=dt_us * 1e-6, gain_tolerance=tolerance)
    return {"scheme": "hht", "dt_us": dt_us, "rejects": rejects, **_event(ratio, plate(ratio).hht(controls))}


def plan_strength(quick: bool) -> list[Planned]:
    """Strength against Courant number, and against the step of HHT."""
    ratios = (0.1, 138.0) if quick else RATIOS
    courants, steps = ((0.4, 0.8), STEPS[1:2]) if quick else (COURANTS, STEPS)
    return [*(Planned(f"explicit {r:g} mu, Courant {c:g}{'' if rejects else ', no rejection'}",
                      partial(explicit_event, r, c, rejects), 0.5 / c) for r in ratios for c in courants
              for rejects in (True, False)),
            *(Planned(f"hht {r:g} mu, {dt:g} us{'' if rejects else ', no rejection'}",
                      partial(hht_event, r, dt, rejects), 0.3 / dt) for r in ratios for dt in steps
              for rejects in (True, False))]


def draw_strength(axes: Sequence[Axes], points: Points) -> None:
    """A map for each scheme: what is fed in or lost with rejected steps, and crosses where runs fail without them."""
    for ax, scheme in zip(axes, ("explicit", "hht")):
        key = "courant" if scheme == "explicit" else "dt_us"
        mine = [p for p in points.values() if p.get("scheme") == scheme]
        shown = [p for p in mine if p["rejects"]]
        drawn = ax.scatter([p["ratio"] for p in shown], [p[key] for p in shown],
                           c=[min(max(p["lost"], 1e-5), 1.0) for p in shown], norm=LogNorm(1e-5, 1), cmap="viridis_r",
                           marker="s", s=90)
        for rejects, mark, name in ((False, "x", "fails without rejected steps"), (True, "o", "fails with them")):
            failed = [p for p in mine if p["rejects"] is rejects and (p["why"] or p["lost"] > LOST)]
            if failed:
                ax.plot([p["ratio"] for p in failed], [p[key] for p in failed], mark, color=RED, markersize=5,
                        fillstyle="none", label=name)
        ax.set(xscale="log", xlabel=r"$\Phi/\mu$", title=f"{NAMES[scheme]}: strong materials")
        if key == "courant":
            ax.set(ylabel="Courant number", ylim=(0, 1.3))
        else:
            ax.set(ylabel="largest step (µs)", yscale="log", ylim=(0.02, 3))
        ax.legend(loc="upper left")
        ax.figure.colorbar(drawn, ax=ax, label="energy fed in or lost", pad=0.02)
