"""The branching plate of the phase-field codes: a pre-cracked plate of glass under a traction that comes at once.

Borden, Verhoosel, Scott, Hughes and Landis (Comput. Methods Appl. Mech. Eng. 217-220 (2012) 77-95), and many since:
100 x 40 mm, cracked to the middle, E = 32 GPa, nu = 0.2, G_c = 3 J/m^2, 1 MPa on its long edges from t = 0 on, plane
strain. The limiter of the sink is found in a strip of the same elements (:mod:`.validation_glass`), and not from the
plate. When the plate starts is known in closed form (:func:`start_expected`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from scipy.spatial import cKDTree

from ..loads.grips import Grip, Ramp, Traction
from ..material import SinkLaw
from ..meshing.cracks import crack_of_elements
from ..meshing.sample import mesh_sample
from ..scene.controls import Controls
from ..scene.scene import Scene
from .chart import page
from .part import Planned, Points
from .plate import first_passages
from .validation_glass import (
    BROKEN,
    GLASS,
    PER_LENGTH,
    POISSON,
    SEEDS,
    TOUGHNESS,
    YOUNG,
    computed,
    cracked_mesh,
    event_of,
    limiter,
    strip_of,
    tip_elements,
)
from .validation_table import Row

__all__ = ["Branching", "draw_branching", "forked", "plan_branching", "plate_mesh", "rows_branching", "start_expected"]

LENGTH, HEIGHT, CUT = 100.0, 40.0, 50.0  # of the plate [mm]
FINE = 11.0                    # fine elements of the plate within that of mid-height [mm]
TRACTION = 1.0                 # [MPa]
AT_FIRST, RISE = 0.02, 2e-7    # of the traction at rest, from which the event begins; and when it is all there [s]
APART = 2.0                    # gap in what has cracked, where it has branched, in l
LENGTHS = (1.0, 0.7, 0.5)      # l of the plates [mm]
GRID = 0.4                     # of the picture of gamma [mm]


def plate_mesh(h: float) -> meshio.Mesh:
    """The plate with elements of size `h` [mm] ahead of its slit; `tip` are those of the slit that are broken."""
    mesh = cracked_mesh(LENGTH, HEIGHT, CUT, h, FINE, holds=True)
    tip = tip_elements(mesh_sample("plate", mesh), CUT, BROKEN * PER_LENGTH * h)
    mesh.cell_sets["tip"] = [tip, np.zeros(0, int)]
    return mesh


def start_expected() -> float:
    """When the plate starts [s]: K of a half-line crack under a step of the stress, and the way of the waves to it.

    Waves from both long edges meet at the crack after H/(2 c_d) and load it with twice the traction s; from then on
    K = 4 s/(1 - nu) sqrt(c_d t (1 - 2 nu)/pi) (Freund, Dynamic Fracture Mechanics, 1990, Sec. 2.5). It starts at
    K^2 = E G_c/(1 - nu^2), before the next waves come, at 3 H/(2 c_d).
    """
    fast = GLASS.dilatational_wave_speed * 1e3
    needed = YOUNG * TOUGHNESS / (1 - POISSON**2)
    return HEIGHT / (2 * fast) + needed * np.pi * (1 - POISSON) ** 2 / (16 * TRACTION**2 * fast * (1 - 2 * POISSON))


def forked(points: np.ndarray, width: float, gap: float) -> tuple[float | None, float]:
    """Where a gap of more than `gap` parts what has cracked, over ten columns at least, and the length of all of it.

    `points` (n, 2) are those that have cracked [mm]; they are looked at in columns of `width` [mm]. The place is None
    if they are not parted; past it both branches count.
    """
    columns = np.floor(points[:, 0] / width).astype(int)
    heights = [np.sort(points[columns == column, 1]) for column in np.unique(columns)]
    gaps = np.array([np.diff(y, prepend=y[0]).max() for y in heights])
    first = next((k for k in range(len(gaps) - 9) if (gaps[k:k + 10] > gap).all()), len(gaps))
    middles = np.array([[y.mean()] * 2 if k < first or g <= gap else
                        [part.mean() for part in np.split(y, [int(np.diff(y).argmax()) + 1])]
                        for k, (y, g) in enumerate(zip(heights, gaps))])
    lengths = np.hypot(width, np.diff(middles, axis=0))
    length = width + float(lengths[:first, 0].sum() + lengths[first:].sum())
    return (float(np.unique(columns)[first] * width) if first < len(gaps) else None), length


@dataclass(frozen=True)
class Branching:
    """The plate, with a limiter from the strip of the same elements, for a length l [mm]."""

    length_scale: float
    event_time: float = 8e-5

    def __call__(self) -> dict[str, Any]:
        """When it starts, branches and arrives, speed of the leading tip, and the energy that the sink takes."""
        l = self.length_scale
        phi = limiter(l)
        sample = mesh_sample("plate", plate_mesh(l / PER_LENGTH))
        up, down = (Ramp((0.0, 1.0, 1.0 + RISE), (0.0, sign * AT_FIRST * TRACTION, sign * TRACTION))
                    for sign in (1, -1))
        tractions = [Traction(name, (0.0, up if name in ("top", "waist above") else down))
                     for name in ("top", "bottom", "waist", "waist above")]
        grips = (Grip("waist", (0.0, None)), Grip("waist above", (0.0, None)), Grip("foot", (None, 0.0)))
        crack = crack_of_elements(sample.space, "crack", sample.elements("tip"), "broken")
        scene = Scene("study", "plate", {}, sample, GLASS, SinkLaw(phi=phi, length_scale=l), grips,
                      tractions=tuple(tractions), cracks=(crack,), event_at=1.0,
                      controls=Controls(event_time=self.event_time, record_every=5e-7, frame_every=self.event_time,
                                        checkpoint_every=600.0))
        rows, simulation = computed(scene)
        event, space = event_of(rows), sample.space
        way = np.fmax.accumulate(np.nan_to_num(event["x"], nan=CUT))
        when, arrival = simulation.crack.tracker.cracked_at, simulation.crack.tracker.arrival
        end = len(way) - 1 if arrival is None else min(int(np.searchsorted(event["time"], arrival)), len(way) - 1)
        started = way[end] > CUT + l
        cracked = np.flatnonzero(when <= event["time"][end])
        place, length = forked(space.X[cracked], l, APART * l)
        beside = cracked[np.abs(space.X[cracked, 0] - place) < l] if place is not None else cracked[:0]
        x, y = np.meshgrid(np.arange(CUT - 5, LENGTH, GRID), np.arange(0, HEIGHT, GRID))
        near = cKDTree(space.X).query(np.column_stack([x.ravel(), y.ravel()]))[1]
        return {"length_scale_mm": l, "phi_MPa": phi, "elements": space.n_elements,
                "start_s": first_passages(event["time"], way, np.array([CUT + l]))[0] if started else None,
                "arrival_s": arrival, "arrival_mm": way[end],
                "branch_mm": place, "branch_s": float(when[beside].max()) if beside.size else None,
                "speed_over_rayleigh": leading(event["time"][:end + 1], way[:end + 1], CUT + 2 * l, l),
                "D_per_length_over_G_c": event["D"][end] / length / TOUGHNESS, "D_N": event["D"][end],
                "crack_mm": length,
                "time_us": (event["time"] * 1e6).round(2), "way_mm": way.round(3), "D_course_N": event["D"].round(5),
                "elastic_course_N": event["elastic"].round(5),
                "gamma": (100 * simulation.state.gamma[near]).round().astype(int).reshape(x.shape)}


def leading(t: np.ndarray, way: np.ndarray, start: float, l: float) -> list[float]:
    """Median and greatest speed of the leading tip over ways of 8 l, over c_R, from `start` [mm] to its end."""
    marks = np.arange(start, way.max() - l, 8 * l)
    speeds = np.diff(marks) / np.diff(first_passages(t, way, marks)) * 1e-3 / GLASS.rayleigh_wave_speed
    return [float(np.median(speeds)), float(speeds.max())] if speeds.size else []


def plan_branching(quick: bool) -> list[Planned]:
    """The strip on two meshes, and the plate with several lengths l; if quick, the plate with the greater one alone."""
    planned = [*(Planned(f"strip/{PER_LENGTH}/{seed}", partial(strip_of, PER_LENGTH, seed), 30.0) for seed in SEEDS),
               *(Planned(f"plate/{l:g}", Branching(l), 70.0 / l**3) for l in (LENGTHS[:1] if quick else LENGTHS))]
    return planned if quick else [*planned, Planned("strip/4/0", partial(strip_of, 4, 0), 70.0)]


# --- what comes out ---
def parted(points: Points) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """The strips and the plates that did not fail, coarse first."""
    good = {key: point for key, point in points.items() if "failed" not in point}
    return ([point for key, point in good.items() if key.startswith("strip/")],
            [point for key, point in good.items() if key.startswith("plate/")])


SOURCE = "phase-field codes, after Borden et al. 2012"


def rows_branching(points: Points) -> list[Row]:
    """What a crack in the strip takes on each mesh, and the plate against closed form and published values."""
    strips, plates = parted(points)
    rows = []
    for n in sorted({strip["per_length"] for strip in strips}):
        group = [strip for strip in strips if strip["per_length"] == n]
        G, D, speed = (np.array([strip[name] for strip in group])
                       for name in ("G_over_band", "D_over_band", "speed_over_rayleigh"))
        rows.append(Row(f"glass, strip, elements of $l/{n}$: $G$ at which a crack runs, over $\\psi_fl$", "–",
                        f"{G.mean():.2f}; $D$ per length {D.mean():.2f} at {speed.mean():.2f} $c_R$",
                        f"{np.ptp(G) / 2:.2f}, {len(group)} meshes" if len(group) > 1 else "one mesh", None,
                        f"{G.mean() * n:.1f} times $\\psi_fh$, $h$ the size of the elements"))
    if not plates:
        return rows
    fine, coarse = plates[-1], plates[-2 if len(plates) > 1 else -1]

    def row(name: str, known: str, value: Any, unit: float, digits: int, agrees: bool | None, reason: str) -> None:
        here, other = ((None if (v := value(p)) is None else v * unit) for p in (fine, coarse))
        error = "one mesh" if fine is coarse else ("–" if here is None or other is None else
                                                   f"{abs(here - other):.{digits}f}")
        rows.append(Row(f"branching plate, {name}", known, "none" if here is None else f"{here:.{digits}f}", error,
                        agrees, reason))

    expected = start_expected() * 1e6
    start, branch, speed = fine["start_s"], fine["branch_s"], fine["speed_over_rayleigh"]
    row("start (µs)", f"{expected:.1f}, half-line crack under a step (Freund 1990)", lambda p: p["start_s"], 1e6, 1,
        start is not None and abs(start * 1e6 / expected - 1) < 0.2,
        "when the tip has gone $l$; a sharp tip and no time to get going in the closed form")
    found = [p["branch_s"] for p in plates if p["branch_s"] is not None]
    scattered = len(found) > 1 and max(found) - min(found) > 5e-6
    row("branching (µs)", f"about 35 ({SOURCE})", lambda p: p["branch_s"], 1e6, 1,
        None if scattered else branch is not None and abs(branch * 1e6 - 35) < 5,
        "when the branches are $2\\,l$ apart" + (f"; the meshes differ by {1e6 * (max(found) - min(found)):.0f} µs"
                                                if scattered else ""))
    row("tip at an edge (µs)", f"about 80 ({SOURCE})", lambda p: p["arrival_s"], 1e6, 1,
        fine["arrival_s"] is not None and abs(fine["arrival_s"] * 1e6 - 80) < 10,
        f"the leading tip is at $x$ = {fine['arrival_mm']:.0f} mm then, and the published one at the right edge")
    row("speed of the tip over $c_R$, median", f"below 0.6 ({SOURCE})",
        lambda p: p["speed_over_rayleigh"][0] if p["speed_over_rayleigh"] else None, 1.0, 2,
        bool(speed) and speed[0] < 0.6, f"over ways of $8\\,l$; the greatest is {speed[1]:.2f}" if speed else "")
    row("$D$ per length of all branches, over $G_c$", "1 if the strip's $G$ is what a fast crack takes",
        lambda p: p["D_per_length_over_G_c"], 1.0, 2, None, "stored and kinetic energy, up to the first edge")
    return rows


def draw_branching(points: Points, path: Path) -> None:
    """gamma at the end for the two smallest lengths l; way of the leading tip and the energies in time."""
    _, plates = parted(points)
    with page(path, "The branching plate", 2, 2, 4.6) as axes:
        for ax, plate in zip(axes, plates[-2:]):
            gamma = np.array(plate["gamma"]) / 100
            image = ax.imshow(gamma, origin="lower", extent=(CUT - 5, LENGTH, 0, HEIGHT), cmap="magma", vmin=0, vmax=1)
            ax.set(title=f"$\\gamma$ at the end, $l$ = {plate['length_scale_mm']:g} mm", xlabel="x (mm)",
                   ylabel="y (mm)")
            ax.figure.colorbar(image, ax=ax, shrink=0.7)
        for plate, style in zip(plates, (":", "--", "-")[-len(plates):]):
            label, t = f"$l$ = {plate['length_scale_mm']:g} mm", np.array(plate["time_us"])
            axes[2].plot(t, plate["way_mm"], style, color="#33658a", label=label)
            for name, colour, what in (("elastic", "#c9971c", "stored"), ("D", "#a63d40", "$D$")):
                axes[3].plot(t, np.array(plate[f"{name}_course_N"]), style, color=colour, label=f"{what}, {label}")
        expected = start_expected() * 1e6
        axes[2].axvline(expected, color="k", linestyle=":", linewidth=0.8, label="start, closed form")
        axes[2].axvline(35, color="0.6", linestyle="--", linewidth=0.8, label="branching, published")
        x = np.array([expected, expected + 30])
        axes[2].plot(x, CUT + 0.6 * GLASS.rayleigh_wave_speed * 1e-3 * (x - expected), color="0.7", linewidth=0.8,
                     label="0.6 $c_R$")
        axes[2].set(xlabel="time (µs)", ylabel="leading tip, x (mm)", ylim=(CUT - 2, LENGTH + 2))
        axes[3].set(xlabel="time (µs)", ylabel="energy (N mm/mm)")
        for ax in axes[2:] if plates else ():
            ax.legend(fontsize=6)
