"""Peeling a strip of arterial media: strength across the layers and dissection energy, as Sommer et al. measured both.

Sommer, Gasser, Regitnig, Auer and Holzapfel (J. Biomech. Eng. 130 (2008) 021007), human abdominal aortas: the media
fails across its layers at 140.1 +- 15.9 kPa, and takes 5.1 +- 0.6 mJ/cm^2 (strips along the circumference; peel force
by width 22.9 +- 2.9 mN/mm) and 7.6 +- 2.7 mJ/cm^2 (along the axis; 34.8 +- 15.5 mN/mm) when it is peeled.

Here a strip of `hgo`, with fibres in its plane, has a weak layer at mid-thickness, and its arms are pulled apart
(T-peel) through equilibria; one arm is computed, in plane strain. The strength fixes the limiter Phi of the layer, the
energy should then fix the length l.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import skfem
from scipy.optimize import brentq

from ..errors import ConvergenceError
from ..fields.body import Body
from ..fields.state import State
from ..loads.grips import Grip
from ..material import HolzapfelGasserOgden, SinkLaw
from ..material.homogeneous import Peak, peaks
from ..material.regions import Region
from ..meshing.sample import Sample, mesh_sample
from ..methods.controls import StaticsControls
from ..methods.statics import Statics
from ..scene.scene import Scene
from .chart import page
from .part import Planned, Points
from .validation_table import Row

__all__ = ["Peel", "draw_peeling", "plan_peeling", "radial_limiter", "rows_peeling", "strength_across"]

STRENGTH = 0.1401                      # across the layers [MPa]
PUBLISHED = {"circumference": (0.051, 0.006, 22.9, 2.9), "axis": (0.076, 0.027, 34.8, 15.5)}  # [N/mm], [mN/mm]
BULK = 5.0                             # bulk modulus [MPa], 46 times the shear modulus in the plane of the fibres
ARM, CUT, LIGAMENT = 0.6, 1.2, 3.0     # thickness of an arm, length of the arms at first, and of what is whole [mm]
FIRST, LAST = 0.8, 2.0                 # way of the crack on which energies are taken [mm]
STRONG = 1e3                           # limiter of the arms, over that of the layer
LENGTHS = (0.15, 0.3, 0.6)             # l [mm]
PER_LENGTH = 4                         # elements in l; the layer is l thick, of which half is computed
SPEED = 1e-3                           # of the end of the arm [mm/s]; it only sets the clock
PASSES = 6000
MJ_CM2 = 100.0                         # in 1 N/mm


def tissue(normal: tuple[float, float, float] = (0.0, 1.0, 0.0),
           axis: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> HolzapfelGasserOgden:
    """The law, with its fibres in the plane across `normal`."""
    return HolzapfelGasserOgden(normal=normal, axis=axis, bulk_modulus=BULK)


def strength_across(phi: float) -> Peak:
    """Strength in uniaxial tension across the layers (Cauchy stress) with a limiter [MPa]."""
    return peaks(tissue((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), SinkLaw(phi=phi))["uniaxial tension"]


@cache
def radial_limiter() -> float:
    """The limiter Phi [MPa] with the measured strength."""
    return float(brentq(lambda phi: strength_across(phi).stress - STRENGTH, 4e-3, 0.02, xtol=1e-7))


def arm_sample(h: float) -> Sample:
    """One arm and what it is cut from, with squares of side `h`; mid-thickness of the strip is y = 0."""
    mesh = skfem.MeshQuad.init_tensor(np.linspace(0, CUT + LIGAMENT, round((CUT + LIGAMENT) / h) + 1),
                                      np.linspace(0, ARM, round(ARM / h) + 1))
    X = mesh.p.T
    sets = {"seam": (X[:, 1] < 1e-9) & (X[:, 0] > CUT - 1e-9), "end": X[:, 0] < 1e-9,
            "far": X[:, 0] > CUT + LIGAMENT - 1e-9}
    return mesh_sample("arm", meshio.Mesh(np.column_stack([X, np.zeros(len(X))]), [("quad", mesh.t.T)],
                                          point_sets={name: np.flatnonzero(at) for name, at in sets.items()}))


@dataclass(frozen=True)
class Peel:
    """A T-peel with a layer of length l [mm], `per_length` elements in it, and the limiter of the layer [MPa].

    `phi` 0 takes the limiter of the measured strength.
    """

    length_scale: float
    per_length: int = PER_LENGTH
    phi: float = 0.0

    def __call__(self) -> dict[str, Any]:
        """Peel force by width, and per area that is opened: energy that is gone, of which the sink takes D.

        Raises
        ------
        ConvergenceError
            The crack has not come that far.
        """
        l, phi, h = self.length_scale, self.phi or radial_limiter(), self.length_scale / self.per_length
        sample, law = arm_sample(h), tissue()
        space = sample.space
        layer = np.flatnonzero(space.X[space.conn].mean(axis=1)[:, 1] < 0.5 * l)
        weak = Region("layer", layer, law, SinkLaw(phi=phi, length_scale=l))
        grips = (Grip("end", (None, SPEED)), Grip("seam", (None, 0.0)), Grip("far", (0.0, None)))
        scene = Scene("study", "peel", {}, sample, law, SinkLaw(phi=STRONG * phi, length_scale=l), grips,
                      regions=(weak,))
        body, state = Body.of(scene), State.intact(space)
        statics = Statics(body, StaticsControls(increment=0.02, onset_tolerance=2e-3))
        for _ in statics.load(state):
            pass
        end, seam = sample.nodes("end"), sample.nodes("seam")
        state.begin_event(0.005)
        rows = []
        for _ in statics.propagate(state):
            open_to = space.X[seam[state.gamma[seam] < 0.1], 0]
            ledger = state.ledger
            rows.append((open_to.max() - CUT if open_to.size else 0.0, 2 * SPEED * state.grip,
                         1e3 * body.momentum.force(state.u)[end, 1].sum(), 2 * ledger.sink_stored,
                         2 * (ledger.work - ledger.elastic)))
            if rows[-1][0] > LAST:
                break
            if len(rows) >= PASSES:
                raise ConvergenceError(f"the crack has come {rows[-1][0]:.2f} mm of {LAST:g} mm in {PASSES} passes")
        if rows[-1][0] <= LAST:
            raise ConvergenceError(f"the crack has come {rows[-1][0]:.2f} mm of {LAST:g} mm: {statics.arrested}")
        way, opening, force, sink, gone = np.array(rows).T
        first = int(np.argmax(way > FIRST))
        run = way[-1] - way[first]
        band = weak.sink_law.failure_energy * l
        energy = (gone[-1] - gone[first]) / run
        keep = np.unique(np.linspace(0, len(rows) - 1, 150).astype(int))
        return {"length_scale_mm": l, "per_length": self.per_length, "phi_MPa": phi, "elements": space.n_elements,
                "energy_N_per_mm": energy, "energy_over_band": energy / band,
                "D_N_per_mm": (sink[-1] - sink[first]) / run, "force_mN_per_mm": float(force[first:].mean()),
                "force_onset_mN_per_mm": float(force[0]), "opening_mm": opening[keep].round(4),
                "force_course_mN_per_mm": force[keep].round(4), "way_mm": way[keep].round(4),
                "shape": outline(sample, state).round(3)}


def outline(sample: Sample, state: State) -> np.ndarray:
    """Outline of what is left of the arm (n, 2) [mm]: the lowest and the highest node with gamma > 0.1 of a column."""
    X = sample.space.X
    order = np.lexsort((X[:, 1], X[:, 0])).reshape(-1, len(sample.nodes("end")))
    left = state.gamma[order] > 0.1
    lowest = order[np.arange(len(order)), left.argmax(axis=1)]
    found: np.ndarray = (X + state.u)[np.concatenate([lowest, order[::-1, -1]])]
    return found


ENOUGH = 0.3  # l of the run that is to take the published energy [mm]


def fitting() -> dict[str, Any]:
    """The peel with the limiter that takes 5.1 mJ/cm^2 at l = 0.3 mm, if the energy is proportional to it."""
    measured = Peel(ENOUGH)()
    phi = measured["phi_MPa"] * PUBLISHED["circumference"][0] / measured["energy_N_per_mm"]
    return {**Peel(ENOUGH, phi=phi)(), "strength_MPa": strength_across(phi).stress}


def plan_peeling(quick: bool) -> list[Planned]:
    """Several l with the same number of elements in l, one l with other elements, and one run for the energy."""
    if quick:
        return [Planned("l/0.6/4", Peel(0.6), 5.0)]
    planned = [Planned(f"l/{l:g}/{PER_LENGTH}", Peel(l), 3.0 / l**2) for l in reversed(LENGTHS)]
    planned += [Planned(f"l/0.3/{n}", Peel(0.3, n), 2.0 * n) for n in (6, 8)]
    return [*planned, Planned("fit", fitting, 60.0)]


# --- what comes out ---
def computed(points: Points) -> list[dict[str, Any]]:
    """The peels with the limiter of the strength that did not fail, by l and by elements in it."""
    return sorted((point for key, point in points.items() if key.startswith("l/") and "failed" not in point),
                  key=lambda point: (point["length_scale_mm"], point["per_length"]))


def rows_peeling(points: Points) -> list[Row]:
    """The limiter of the strength, the energy at each l, and what l it would take; the run for the energy."""
    rows = []
    for peel in computed(points):
        l, n, energy = peel["length_scale_mm"], peel["per_length"], peel["energy_N_per_mm"]
        low, spread, force, _ = PUBLISHED["circumference"]
        rows.append(Row(f"peeled media, $l$ = {l:g} mm, elements of $l/{n}$ (mJ/cm²)",
                        f"{MJ_CM2 * low:.1f} ± {MJ_CM2 * spread:.1f}, 7.6 ± 2.7 (Sommer et al. 2008)",
                        f"{MJ_CM2 * energy:.3f}; force {peel['force_mN_per_mm']:.2f} mN/mm (22.9 and 34.8)", "–",
                        low - spread < energy < low + spread,
                        f"$\\Phi$ = {1e3 * peel['phi_MPa']:.1f} kPa from 140 kPa across the layers; "
                        f"{peel['energy_over_band']:.2f} $\\psi_fl$; 5.1 would take $l$ = {l * low / energy:.0f} mm"))
    if (fit := points.get("fit")) is not None and "failed" not in fit:
        low, spread, force, off = PUBLISHED["circumference"]
        rows.append(Row(f"peel force by width where the limiter is that of the energy, $l$ = {ENOUGH:g} mm (mN/mm)",
                        f"{force:g} ± {off:g} (Sommer et al. 2008)", f"{fit['force_mN_per_mm']:.1f}", "–",
                        abs(fit["force_mN_per_mm"] - force) < off,
                        f"{MJ_CM2 * fit['energy_N_per_mm']:.1f} mJ/cm² with $\\Phi$ = {1e3 * fit['phi_MPa']:.0f} kPa"))
        rows.append(Row("strength across the layers with that limiter (kPa)", "140 ± 16 (Sommer et al. 2008)",
                        f"{1e3 * fit['strength_MPa']:.0f}", "–", abs(fit["strength_MPa"] - STRENGTH) < 0.016,
                        "both are not had with one $\\Phi$ and an $l$ that is shorter than an arm is thick"))
    return rows


COLOURS = {0.15: "#33658a", 0.3: "#a63d40", 0.6: "#c9971c"}


def draw_peeling(points: Points, path: Path) -> None:
    """Force against opening, energy against l, and the strip as it is peeled."""
    peels = computed(points)
    with page(path, "Peeling of media", 1, 3, 2.7) as (force, energy, shape):
        for peel in peels:
            l, n = peel["length_scale_mm"], peel["per_length"]
            if n == PER_LENGTH:
                force.plot(peel["opening_mm"], peel["force_course_mN_per_mm"], linewidth=0.8, color=COLOURS[l],
                           label=f"$l$ = {l:g} mm")
            energy.plot(l, MJ_CM2 * peel["energy_N_per_mm"], "o", color=COLOURS[l], ms=4 if n == PER_LENGTH else 3,
                        fillstyle="full" if n == PER_LENGTH else "none")
            energy.annotate(f"l/{n}", (l, MJ_CM2 * peel["energy_N_per_mm"]), xytext=(4, -2), fontsize=6,
                            textcoords="offset points")
        for name, (value, spread, *_) in PUBLISHED.items():
            energy.axhspan(MJ_CM2 * (value - spread), MJ_CM2 * (value + spread), alpha=0.25, color="0.6")
            energy.text(0.12, MJ_CM2 * value, name, fontsize=6, va="center")
        force.set(xlabel="opening of the ends (mm)", ylabel="force by width (mN/mm)")
        energy.set(xlabel="$l$ (mm)", ylabel="dissection energy (mJ/cm²)", xscale="log", yscale="log",
                   xlim=(0.1, 1.0), ylim=(0.02, 20))
        shown = next((peel for peel in peels if peel["per_length"] == PER_LENGTH), None)
        if shown is not None:
            x, y = np.array(shown["shape"]).T
            for sign in (1, -1):
                shape.fill(x, sign * y, color="#c98b6b", linewidth=0.5, edgecolor="k")
            shape.set(aspect="equal", title=f"$l$ = {shown['length_scale_mm']:g} mm, {LAST:g} mm peeled", xticks=(2, 4))
            force.legend(fontsize=6)
            force.set(ylim=(0, 4 * max(peel["force_mN_per_mm"] for peel in peels)))
        shape.set(xlabel="x (mm)", ylabel="y (mm)")
