"""Raised mass: what it costs to resolve the tip of a notch, and what it moves to make the steps long again.

The crack of a small plate runs 1 mm from a tip with rings of elements around it, on three meshes: with the short step
of the rings, with none, some and more of the volume raised in mass, with the mass raised when the tip has gone a
quarter of the way, and with short steps of the rings alone. Where elements fail the path is sensitive to rounding-like
differences, so every run is made at three Courant numbers that differ by 1 %. The reference of a mesh is the mean of
its three runs with short steps. Solves for gamma are as far apart in time in all runs, the default where that is not
cut short: ten short steps, the most there are between two solves by default, take a tenth of it. The same plates
without rings are what a notch costs that is not resolved; they begin to fail later.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ..fields.state import State
from ..methods.controls import ExplicitControls
from ..methods.explicit import Explicit
from .chart import page
from .meshes import load_plate
from .part import Part, Planned, Points
from .plate import Front, Integrator, Plate, warm
from .tolerance import DISTURBED, SEEDS, errors_of

__all__ = ["RAISED", "summary"]

DEFAULT = ExplicitControls.raised_mass
START = 0.25  # of the way, the first part [mm]


@dataclass(frozen=True)
class _Method:
    """A mesh, shares of the volume, and whether the mass is raised when the tip has gone `START` only."""

    mesh: str = "tip"
    raised: float = 0.0
    subcycled: float = 0.0
    later: bool = False

    @property
    def name(self) -> str:
        """As it is called in tables."""
        if self.mesh != "tip":
            return "no rings, short steps"
        if self.subcycled:
            return f"`subcycled` {self.subcycled:g}"
        if not self.raised:
            return "short steps (reference)"
        when = f" after {START:g} mm" if self.later else ", default" if self.raised == DEFAULT else ""
        return f"`raised_mass` {self.raised:g}{when}"

    def controls(self, courant: float, *, early: bool = False) -> ExplicitControls:
        """Options of the explicit scheme; `early` those before the mass is raised."""
        return ExplicitControls(courant, raised_mass=0.0 if early else self.raised, subcycled=self.subcycled)


METHODS = {"reference": _Method(), **{f"{share:g}": _Method(raised=share) for share in (0.001, 0.003, 0.01, 0.03)},
           "later": _Method(raised=DEFAULT, later=True),
           **{f"subcycled {share:g}": _Method(subcycled=share) for share in (0.0003, 0.001, 0.003)},
           "no rings": _Method("plate")}
#: what is compared: how it is called
MEASURES = {"start": "time of the first 0.25 mm", "transit": "time from 0.25 to 1 mm", "D": "$D$ at the arrival",
            "U": "$U$ at the arrival"}
SECONDS = {"reference": 8.0}  # of a run, about
MARKS = "ov^*sDphdx"


@cache
def _plate(mesh: str, seed: str) -> Plate:
    return Plate(load_plate(f"{mesh}{seed}"))


@dataclass(frozen=True)
class _Run:
    """Computes a point: a method on a mesh of that number, at a Courant number."""

    method: _Method
    seed: str
    courant: float

    def __call__(self) -> dict[str, Any]:
        """Times [us] of the first quarter of the way and of the rest, energies, steps, mass added and cost."""
        warm(2)
        plate = _plate(self.method.mesh, self.seed)
        onset = plate.onset_figures["opening_mm"]
        scheme = _explicit(plate, self.method.controls(self.courant))
        integrator: Integrator = scheme
        if self.method.later:
            integrator = _Later(_explicit(plate, self.method.controls(self.courant, early=True)), scheme,
                                Front(plate.sample))
        found = plate.event(lambda _: integrator)
        start = float(found["passed_us"][len(found["passed_us"]) // 4 - 1])
        return {**{name: found[name] for name in ("D", "U", "steps", "rejected", "cpu_s")}, "start": start,
                "transit": found["arrival_us"] - start, "added_mass": scheme.added_mass,
                "gamma_every": scheme.controls.gamma_every, "onset_mm": onset,
                "elements": plate.sample.space.n_elements}


class _Later:
    """One explicit scheme until the tip has gone `START`, and another, of more mass, from there on.

    Velocities stay, so that the mass that is added comes with kinetic energy: the ledger books it as numerical, that is
    as fed in.
    """

    def __init__(self, first: Explicit, then: Explicit, front: Front) -> None:
        self._first, self._then, self._front = first, then, front

    def begin(self, state: State) -> None:
        """Set the body in motion."""
        self._first.begin(state)

    @property
    def rejected(self) -> int:
        """Steps that were made again at half length."""
        return self._first.rejected + self._then.rejected

    def run(self, state: State, t_end: float) -> Iterator[State]:
        """Step until `t_end` [s], yielding the state after each step."""
        seen = state.gamma
        for _ in self._first.run(state, t_end):
            yield state
            if state.gamma is not seen:
                seen = state.gamma
                if self._front.tip(seen) >= START:
                    break
        self._first.sync(state)
        before = replace(state.ledger)
        self._then.begin(state)
        fed_in = state.ledger.kinetic - before.kinetic
        state.ledger = replace(before, kinetic=state.ledger.kinetic, numerical=before.numerical - fed_in)
        yield from self._then.run(state, t_end)


def _explicit(plate: Plate, controls: ExplicitControls) -> Explicit:
    """The scheme, with as many steps between solves for gamma as :func:`_steps_between_solves`."""
    return plate.explicit(replace(controls, gamma_every=_steps_between_solves(plate, controls)))


def _steps_between_solves(plate: Plate, controls: ExplicitControls) -> int:
    """How many of the first steps fit in the longest time between two solves for gamma."""
    state, scheme = plate.onset, plate.explicit(controls)
    state.begin_event(plate.overshoot)
    scheme.begin(state)
    scheme.step(state)
    return max(1, int(scheme.interval.longest / scheme.dt))


def plan(quick: bool) -> list[Planned]:
    """Every method at three Courant numbers on three meshes; if quick, once."""
    return [Planned(f"{name}/{ExplicitControls.courant * disturbed:.4g}/{seed}",
                    _Run(method, seed, ExplicitControls.courant * disturbed), SECONDS.get(name, 2.0))
            for name, method in METHODS.items()
            for seed in (SEEDS[:1] if quick else SEEDS) for disturbed in ((1.0,) if quick else DISTURBED)]


# --- what comes out ---
def summary(points: Points) -> list[dict[str, Any]]:
    """A row a method: mean `steps`, `cost` [s], `added`; of each measure (mean, its standard error, root mean square).

    Errors are relative to the reference of the same mesh; those of the reference are its scatter about its mean.
    """
    groups: dict[str, list[tuple[str, dict[str, Any]]]] = {}
    for key, point in points.items():
        method, _, seed = key.split("/")
        if "failed" not in point:
            groups.setdefault(method, []).append((seed, point))
    rows = []
    for method, runs in groups.items():
        row: dict[str, Any] = {"method": method, "runs": len(runs)}
        for name, key in (("steps", "steps"), ("cost", "cpu_s"), ("added", "added_mass"), ("onset", "onset_mm")):
            row[name] = float(np.mean([point[key] for _, point in runs]))
        for name in MEASURES:
            errors = errors_of(runs, groups["reference"], name)
            sure = float(errors.std(ddof=1) / np.sqrt(len(errors))) if len(errors) > 1 else 0.0
            row[name] = float(errors.mean()), sure, float(np.sqrt(np.mean(errors**2)))
        rows.append(row)
    return rows


def draw(points: Points, path: Path) -> None:
    """Mean error of each measure with its standard error, against processor time."""
    rows = summary(points)
    with page(path, "A resolved notch: more mass or short steps at its tip, against cost", 2, 2, 5.2) as axes:
        for ax, (name, label) in zip(axes, MEASURES.items()):
            for row, mark in zip(rows, MARKS):
                mean, sure, _ = row[name]
                ax.errorbar([row["cost"]], [100 * mean], [100 * sure], fmt=mark, capsize=3, linewidth=0.9,
                            ms=9 if mark == "*" else 5, label=METHODS[row["method"]].name.replace("`", ""))
            ax.axhspan(-0.5, 0.5, color="0.9")
            ax.set(xscale="log", xlabel="processor time (s)", ylabel="change (%)", title=label)
        axes[0].legend(fontsize=6)


def table(points: Points) -> list[str]:
    """A row a method: mass added, steps, processor time, mean changes ± their standard errors (root mean squares)."""
    lines = ["| smallest elements | mass added | onset (mm) | steps | processor time (s) | "
             + " | ".join(label for label in MEASURES.values()) + " |", "|---" * (5 + len(MEASURES)) + "|"]
    for row in summary(points):
        cells = [f"{100 * mean:+.1f} ± {100 * sure:.1f} % ({100 * square:.1f} %)" if row["method"] != "reference" else
                 f"({100 * square:.1f} %)" for mean, sure, square in (row[name] for name in MEASURES)]
        first = [METHODS[row["method"]].name, f"{100 * row['added']:.1f} %", f"{row['onset']:.4f}",
                 f"{row['steps']:,.0f}", f"{row['cost']:.2f}"]
        lines.append(f"| {' | '.join(first + cells)} |")
    return lines


RAISED = Part("raised", plan, draw, table)
