"""A crack that runs along a long strip between rigid grips, held at a stretch: speed, energy taken, first branch.

The strip has a cut from its left edge, and a crack of some lengths l in front of it that is broken from the start, with
lips as of a crack that has run. It is stretched in equilibrium while the sink rests; then the sink acts, and the crack
is let go. Ahead of it the strip is in pure shear, so that W H is released per length once the crack has come to run
steadily (Rivlin and Thomas 1953). The elements are unstructured, lest rows of them guide the crack.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from ..errors import ConvergenceError, InstabilityError
from ..fields.body import Body
from ..fields.state import State
from ..material import AAA, Material, SinkLaw
from ..material.base import rayleigh_speed
from ..material.regions import Region
from ..meshing.cracks import crack_along
from ..meshing.outline import Edge, SizeField, mesh_outline
from ..meshing.sample import Sample, load_sample
from ..meshing.vtu import write_mesh
from ..methods.explicit import Explicit
from ..methods.statics import Statics
from ..run.observers.crack import tracker_of
from ..scene.controls import Controls
from ..scene.scene import Scene
from .plate import PULLED, SPEED, first_passages

__all__ = ["BURST", "PIECE", "RunningStrip", "WayPiece", "pieces", "sheet_speed"]

STARTED = 10.0     # length of the crack in front of the cut, in l
ENDS = 1.5         # heights behind the tip and beyond the run that are kept from the ends
GRADING = 0.2
COARSEST = 1 / 12  # of the height: greatest element
LOOKS = 0.25       # time between looks at the tips, in l/c_s
PATIENCE = 4.0     # heights over c_s: time in which a crack that has not gone on by l has stopped
TOUGH = 1e3        # limiter of what cannot fail, over that of the layer
INCREMENT = 0.02   # of the stretch, in which the strip is loaded
BURST = 5.0        # way after which the start, where much fails at once as the sink begins to act, is over, in l
PIECE = 4.0        # length of the pieces of the way in which speed and D are taken, in l
MOST = 120         # rows of a track that are kept, evenly over its looks
OPEN = 0.05        # of the energy in the strip: by how much the ledger may be open, or fed


def sheet_speed(material: Material) -> float:
    """Speed of the longitudinal wave in a thin undeformed sheet, sqrt(E/(rho0 (1 - nu^2))) [m/s]."""
    k, mu = material.bulk_modulus, material.shear_modulus
    return float(np.sqrt(4 * mu * (3 * k + mu) / (3 * k + 4 * mu) / material.rho0)) * 1e-3


@dataclass(frozen=True)
class RunningStrip:
    """A strip of a given height and the energy W H ahead of its crack.

    Parameters
    ----------
    height: H [mm].   run: by how much the crack is followed [mm].
    energy: W H ahead of the crack, over psi_f l.
    element: "planestress", or "jbar" or "plain" for plane strain.
    fine: elements in l where the crack runs.   aside: half the height of that corridor, in l.
    material, law: stored energy and sink.
    layer: half the width of a layer along the middle that alone can fail, in l, so that the crack cannot branch.
    """

    height: float
    run: float
    energy: float
    element: str = "planestress"
    fine: float = 3.0
    aside: float = 4.0
    material: Material = field(default_factory=AAA)
    law: SinkLaw = field(default_factory=SinkLaw)
    layer: float = np.inf

    # --- the body ---
    @property
    def start(self) -> float:
        """Where the tip is at the start [mm]; the left edge is at 0."""
        return ENDS * self.height + STARTED * self.law.length_scale

    @property
    def length(self) -> float:
        """Of the strip [mm]."""
        return self.start + self.run + ENDS * self.height

    @property
    def band(self) -> float:
        """Energy of a failed band as wide as l, psi_f l [N/mm]."""
        return self.law.failure_energy * self.law.length_scale

    def gradient(self, stretch: float) -> np.ndarray:
        """F ahead of the crack (3, 3) at a stretch of the strip."""
        F = np.diag([1.0, stretch, 1.0])
        return self.material.thin_sheet(F[:2, :2]) if self.element == "planestress" else F

    @cached_property
    def stretch(self) -> float:
        """Of the strip, with which W H ahead of the crack is what it is to be."""
        W = self.energy * self.band / self.height
        return float(brentq(lambda s: float(self.material.energy(self.gradient(s))) - W, 1.0, 4.0, xtol=1e-12))

    def speeds(self) -> dict[str, float]:
        """Shear and Rayleigh waves [m/s]: undeformed, and shear waves ahead of the crack, along it and across it."""
        shear = self.material.shear_wave_speed
        thin = self.element == "planestress"
        longest = sheet_speed(self.material) if thin else self.material.dilatational_wave_speed
        A = self.material.modulus(self.gradient(self.stretch))
        return {"c_s": shear, "c_R": rayleigh_speed(shear, longest), "c_d": longest,
                "c_s_ahead": float(np.sqrt(A[1, 0, 1, 0] / self.material.rho0)) * 1e-3}

    @cached_property
    def sample(self) -> Sample:
        """The strip with its cut, fine where the crack runs; needs gmsh."""
        l = self.law.length_scale
        return strip_mesh(self.length, self.height, self.start - STARTED * l, self.start + self.run, l, self.fine,
                          self.aside)

    @cached_property
    def scene(self) -> Scene:
        """The strip between its grips, with the crack that is broken from the start."""
        middle, l = self.height / 2, self.law.length_scale
        crack = crack_along(self.sample.space, "crack", ((self.start - STARTED * l, middle), (self.start, middle)),
                            "broken")
        return Scene("study", "study", {}, self.sample, self.material, self.law, PULLED, cracks=(crack,),
                     regions=self.tough, controls=Controls(element=self.element))

    @property
    def tough(self) -> tuple[Region, ...]:
        """What cannot fail: all beside the layer."""
        space = self.sample.space
        away = np.abs(space.X[space.conn].mean(axis=1)[:, 1] - self.height / 2)
        beside = np.flatnonzero(away > self.layer * self.law.length_scale)
        law = replace(self.law, phi=TOUGH * self.law.phi)
        return (Region("tough", beside, self.material, law),) if beside.size else ()

    def stretched(self, body: Body) -> State:
        """The strip at its stretch, in equilibrium with the crack that is there; the sink rests.

        Raises
        ------
        ConvergenceError
            It has none that increments of a sixteenth of :data:`INCREMENT` lead to.
        """
        state = body.begin()
        body.momentum.set_gamma(state.gamma, state.deleted)
        state.grip = (self.stretch - 1) * self.height / (2 * SPEED)
        for finer in (1, 4, 16):
            try:
                state.u = self._pulled(body, state, finer * int(np.ceil((self.stretch - 1) / INCREMENT)))
                return state
            except ConvergenceError:
                if finer == 16:
                    raise
        return state

    def _pulled(self, body: Body, state: State, steps: int) -> np.ndarray:
        """Displacement in equilibrium at the load time of `state`, reached in some steps."""
        newton, u = Statics(body, self.scene.controls.statics).newton, state.u
        for k in range(steps):
            body.momentum.set_time(state.grip * k / steps)
            guess = newton.predict(u, body.loading.velocity(0.0) * state.grip / steps)
            body.momentum.set_time(state.grip * (k + 1) / steps)
            u = newton.equilibrium(guess)[0]
        newton.release()
        return u

    # --- the event ---
    def __call__(self) -> dict[str, Any]:
        """What the crack did, from where the sink begins to act.

        Returns
        -------
        `time_us`, `tip_mm`: track of the farthest tip, from where it started.   `taken_N`, `failed_N`: D and U of the
        paper then [N mm/mm].   `branched_us`, `branched_mm`: when and where the tip was as two arms were seen to run
        (each longer than 2.5 l, both going on for l/c_s), None if they were not.   `arrested`: whether the crack gave
        up before the end of its run.   `elements`, `steps`, `stretch`, speeds of waves [m/s], `ledger` (how far it is
        open, over the energy at the start).

        Raises
        ------
        InstabilityError
            The ledger is open, or energy was fed in, by more than :data:`OPEN`.
        """
        scene, body = self.scene, Body.of(self.scene)
        state = self.stretched(body)
        state.begin_event(0.0)
        integrator, tracker = Explicit.of(body, scene.controls), tracker_of(scene, body)
        integrator.begin(state)
        tracker.mark(0.0, state.gamma)
        l, shear = self.law.length_scale, self.material.shear_wave_speed * 1e3
        rows, seen, double, branch = [(0.0, 0.0, 0.0, 0.0)], state.gamma, 0, None
        look, moved = 0.0, (0.0, 0.0)
        for _ in integrator.run(state, np.inf):
            if state.gamma is not seen:
                seen = state.gamma
                tracker.mark(state.time, seen)
            if state.time < look:
                continue
            look = state.time + LOOKS * l / shear
            tips, ledger = tracker.look(state.time, state.gamma), state.ledger
            ahead = tips.points[:, 0] > self.start  # the cut may tear at its corners
            way = max(rows[-1][1], float(tips.points[:, 0].max(initial=self.start)) - self.start)
            rows.append((state.time, way, ledger.sink + ledger.deletion, ledger.paper))
            guard(state)
            double = double + 1 if (ahead & tracker.advances(state.time, tips.nodes)).sum() >= 2 else 0
            if branch is None and double * LOOKS >= 1.0:
                branch = rows[-double]
            if way > moved[1] + l:
                moved = state.time, way
            stopped = state.time - moved[0] > PATIENCE * self.height / shear
            if way >= self.run or stopped or (branch is not None and way > branch[1] + 6 * l):
                break
        kept = np.unique(np.linspace(0, len(rows) - 1, MOST).round().astype(int))
        time, way, taken, failed = np.array(rows)[kept].T
        return {"height_mm": self.height, "energy_over_band": self.energy, "band_N_per_mm": self.band, "l_mm": l,
                "stretch": self.stretch, "element": self.element, "fine": self.fine, **self.speeds(),
                "elements": scene.space.n_elements, "steps": state.step, "arrested": stopped,
                "branched_us": branch and branch[0] * 1e6, "branched_mm": branch and branch[1],
                "ledger": state.ledger.error(state.ledger.initial), "time_us": (time * 1e6).round(3),
                "tip_mm": way.round(4), "taken_N": taken.round(7), "failed_N": failed.round(7)}


@cache
def strip_mesh(length: float, height: float, cut: float, end: float, l: float, fine: float, aside: float) -> Sample:
    """The strip with a cut as wide as l/2 [mm]; `fine` elements in l up to `aside` l from its middle, as far as `end`.
    """
    middle, r, h = height / 2, l / 4, l / fine
    outline = [Edge("bottom", (length, 0)), Edge("right", (length, height)), Edge("top", (0, height)),
               Edge("upper", (0, middle + r)), Edge("flank", (cut - r, middle + r)),
               Edge("notch", (cut - r, middle - r), via=(cut, middle)), Edge("flank", (0, middle - r)),
               Edge("lower", (0, 0))]
    corridor = (cut - l, end + 4 * l, middle - aside * l, middle + aside * l)
    mesh = mesh_outline(outline, SizeField(h, max(h, COARSEST * height), (corridor,), grading=GRADING))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "strip.vtu"
        write_mesh(path, mesh)
        return load_sample("study", str(path))


def guard(state: State) -> None:
    """Refuse a run whose ledger is open (InstabilityError)."""
    ledger = state.ledger
    worst = max(ledger.error(ledger.initial), -ledger.numerical / ledger.initial)
    if not worst <= OPEN:
        raise InstabilityError(f"the ledger is open, or energy was fed in, by {worst:.2%} of that of the stretched "
                               f"strip at {state.time * 1e6:.2f} µs")



class WayPiece(NamedTuple):
    """A piece of the way of a crack: where it ends [mm], speed [m/s], D and U per length over psi_f l.

    U per length over psi_f l is the width of what has failed, in l.
    """

    x: float
    speed: float
    taken: float
    width: float


def pieces(point: dict[str, Any]) -> list[WayPiece]:
    """The way of a crack cut into pieces of :data:`PIECE` l, from past the first burst to its end or first branch."""
    way, time, taken, failed = (np.array(point[name]) for name in ("tip_mm", "time_us", "taken_N", "failed_N"))
    l, end = point["l_mm"], way[-1] if point["branched_mm"] is None else point["branched_mm"]
    marks = np.arange(BURST * l, end + 1e-9, PIECE * l)
    if len(marks) < 2:
        return []
    passed = first_passages(time, way, marks)
    D, U = (np.diff(np.interp(passed, time, of)) / (PIECE * l * point["band_N_per_mm"]) for of in (taken, failed))
    speed = PIECE * l / np.maximum(np.diff(passed), 1e-9) * 1e3
    return [WayPiece(*row) for row in zip(marks[1:].tolist(), speed.tolist(), D.tolist(), U.tolist())]
