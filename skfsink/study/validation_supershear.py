"""Cracks in stretched neo-Hookean sheets, faster than shear waves, and the same strips of a solid that stays linear.

Experiments on neo-Hookean gels (Wang, Shi, Fineberg, Science 381 (2023) 415-419) and simulations (Pundir, Adda-Bedia,
Kammer, arXiv 2308.09315) find tensile cracks faster than c_R and c_s above a critical stretch, because of large
deformations alone; their stretches and parameters were not at hand. Here a crack runs in a thin strip along a weak
layer, which keeps it from branching; the law is neo-Hookean, so that c_s along the strip does not depend on the
stretch. The control has the same W H over psi_f l, but a limiter so low that it fails at strains of half a per cent.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.ticker import MaxNLocator

from ..material import NeoHookean, SinkLaw
from ..material.base import rayleigh_speed
from .chart import page
from .part import Planned, Points
from .plate import first_passages
from .running_strip import RunningStrip
from .validation_table import Row

__all__ = ["SERIES", "SMALL", "Series", "crossing", "draw_supershear", "plan_supershear", "rows_supershear", "strip_at"]

class Series(NamedTuple):
    """Strips of one height [mm] and limiter [MPa], at some stretches.

    With `small` below 1 they are a control: the limiter is that part of the one given, and W H over psi_f l is as at
    the stretch with the one given.
    """

    limiter: float
    height: float
    small: float
    stretches: tuple[float, ...]


RUN, MEASURED = 6.0, 2.0      # way of the crack, and that after which its speed is taken [mm]
LAYER, ASIDE = 0.5, 2.0       # half the width of the layer, and of the corridor of fine elements, in l
COARSE, FINER = 3.0, 5.0      # elements in l
SMALL = 1e-4
RAYLEIGH = rayleigh_speed(1.0, 2.0)  # c_R over c_s of an incompressible sheet
#: at the same stretch a limiter twice as high halves W H over psi_f l, and a height twice as large doubles it
SERIES = {"neo-Hookean": Series(0.7, 2.0, 1.0, (1.08, 1.1, 1.125, 1.15, 1.175, 1.2, 1.25, 1.3)),
          "tougher": Series(1.4, 2.0, 1.0, (1.15, 1.2, 1.25, 1.3)),
          "control": Series(0.7, 2.0, SMALL, (1.1, 1.15, 1.2, 1.25, 1.3)),
          "higher": Series(3.5, 10.0, 1.0, (1.1, 1.2, 1.3, 1.4, 1.5)),
          "higher control": Series(3.5, 10.0, SMALL, (1.1, 1.2, 1.3, 1.4, 1.5))}
REFINED = {"neo-Hookean": 1.15, "control": 1.25}  # stretches that are computed on finer elements too


def strip_at(stretch: float, series: Series, fine: float = COARSE) -> RunningStrip:
    """The strip of a series at a stretch, which of a control is that of the solid with the same W H over psi_f l."""
    def strip(energy: float, small: float) -> RunningStrip:
        return RunningStrip(series.height, RUN, energy, "planestress", fine, ASIDE, NeoHookean(),
                            SinkLaw(phi=small * series.limiter), LAYER)

    stretched = strip(1.0, 1.0)
    energy = float(stretched.material.energy(stretched.gradient(stretch))) * series.height / stretched.band
    return strip(energy, series.small)


def plan_supershear(quick: bool) -> list[Planned]:
    """All series, and some strips of finer elements; if quick, three strips of the first."""
    def planned(name: str, stretch: float, fine: float) -> Planned:
        return Planned(f"{name}/{stretch:g}/{fine:g}", strip_at(stretch, SERIES[name], fine), 10.0 * (fine / COARSE)**2)

    found = [planned(name, stretch, COARSE) for name, series in SERIES.items() for stretch in series.stretches]
    return found[1:8:3] if quick else found + [planned(*refined, FINER) for refined in REFINED.items()]


# --- what comes out ---
def measured(point: dict[str, Any]) -> tuple[float, float]:
    """Speed over c_s, and D per length over psi_f l, of the way past :data:`MEASURED`; NaN if the crack stopped."""
    way, time, taken = (np.array(point[name]) for name in ("tip_mm", "time_us", "taken_N"))
    if point["arrested"] or way[-1] < MEASURED + 1.0:
        return float("nan"), float("nan")
    marks = np.array([MEASURED, min(RUN, way[-1])])
    first, last = first_passages(time, way, marks)
    D = np.diff(np.interp([first, last], time, taken))[0]
    length = float(np.diff(marks)[0])
    return float(length / (last - first) * 1e3 / point["c_s"]), float(D / length / point["band_N_per_mm"])


def strips(points: Points, name: str, fine: float = COARSE) -> dict[float, dict[str, Any]]:
    """The points of a series on one mesh, by stretch, those that did not fail."""
    found = {}
    for key, point in points.items():
        there, stretch, elements = key.split("/")
        if there == name and float(elements) == fine and "failed" not in point:
            found[float(stretch)] = point
    return dict(sorted(found.items()))


def crossing(at: np.ndarray, speed: np.ndarray, level: float) -> float:
    """The first value of `at` (n,), ascending, where the `speed` (n,) rises past a level, linear in between; NaN where
    it does not."""
    keep = np.isfinite(speed)
    at, speed = at[keep], speed[keep]
    above = np.flatnonzero((speed[1:] >= level) & (speed[:-1] < level))
    if not above.size:
        return float("nan")
    k = int(above[0])
    return float(at[k] + (level - speed[k]) / (speed[k + 1] - speed[k]) * (at[k + 1] - at[k]))


def speeds(points: Points, name: str, fine: float = COARSE) -> tuple[np.ndarray, np.ndarray]:
    """Stretches and speeds over c_s of a series."""
    group = strips(points, name, fine)
    return np.array(list(group)), np.array([measured(point)[0] for point in group.values()])


def rows_supershear(points: Points) -> list[Row]:
    """Of each stretched series the stretch past which a crack is faster than c_s, of each control its greatest speed.
    """
    rows = []
    for name, series in SERIES.items():
        group, (at, speed) = strips(points, name), speeds(points, name)
        if not np.isfinite(speed).any():
            continue
        fine_at, fine = speeds(points, name, FINER)
        off = [f"{abs(b / speed[list(at).index(a)] - 1):.1%} of $v$" for a, b in zip(fine_at, fine) if a in at]
        error, energy = ", ".join(off) or "one mesh", np.array([p["energy_over_band"] for p in group.values()])
        body, rayleigh = f"{series.height / SinkLaw.length_scale:g} $l$ high", next(iter(group.values()))
        if series.small < 1.0:
            limit, greatest = float(rayleigh["c_R"] / rayleigh["c_s"]), int(np.nanargmax(speed))
            slow = crossing(energy, speed, limit)
            rows.append(Row(f"strip with a weak layer, small strain, {body}: greatest $v/c_s$",
                            f"below {limit:.3f}, $c_R$ (linear fracture mechanics)", f"{speed[greatest]:.3f}", error,
                            bool(speed[greatest] < limit), f"at $WH={energy[greatest]:.1f}\\,\\psi_fl$"
                            + (f"; past $c_R$ from {slow:.1f}" if np.isfinite(slow) else "")))
            continue
        found, most = crossing(at, speed, 1.0), f"up to {np.nanmax(speed):.2f} $c_s$"
        other = control_speed(points, series.height, crossing(energy, speed, 1.0))
        if np.isfinite(found):
            most += f"; $WH={crossing(energy, speed, 1.0):.1f}\\,\\psi_fl$ there, with which the crack at small strain "
            most += f"runs at {other:.2f} $c_s$" if np.isfinite(other) else "was not computed"
        rows.append(Row(f"strip with a weak layer, neo-Hookean, $\\Phi={series.limiter:g}$ MPa, {body}: stretch past "
                        f"which a crack outruns $c_s$, and that at small strain not $c_R$",
                        "there is one, by material (Wang et al. 2023; Pundir et al. 2024)",
                        f"{found:.3f}" if np.isfinite(found) else f"none up to {at[-1]:g}", error,
                        bool(np.isfinite(found) and other < RAYLEIGH), most))
    return rows


def control_speed(points: Points, height: float, energy: float) -> float:
    """Speed over c_s of a crack at small strain in a strip of a height [mm] and W H over psi_f l; NaN if not known."""
    for name, series in SERIES.items():
        group, (_, speed) = strips(points, name), speeds(points, name)
        if series.small < 1.0 and series.height == height and group:
            at = [point["energy_over_band"] for point in group.values()]
            return float(np.interp(energy, at, speed, left=np.nan, right=np.nan))
    return float("nan")


def draw_supershear(points: Points, path: Path) -> None:
    """Speed against the stretch of the stretched series, and of all against W H over psi_f l, and over D per length."""
    styles = {"neo-Hookean": ("#a63d40", "-"), "tougher": ("#d08c2f", "-"), "higher": ("#4f7942", "-"),
              "control": ("#a63d40", ":"), "higher control": ("#4f7942", ":")}
    with page(path, "Cracks along a weak layer of thin strips: stretched (lines), at small strain (dotted)", 1, 3, 3.0,
              9.5) as axes:
        for name, (colour, style) in styles.items():
            series = SERIES[name]
            kind = rf"$\Phi={series.limiter:g}$ MPa" if series.small == 1.0 else "small strain"
            label = rf"{kind}, $H={series.height / SinkLaw.length_scale:g}\,l$"
            for fine, mark in ((COARSE, "o"), (FINER, "s")):
                if not (group := strips(points, name, fine)):
                    continue
                speed, taken = np.array([measured(point) for point in group.values()]).T
                energy = np.array([point["energy_over_band"] for point in group.values()])
                look: dict[str, Any] = {"color": colour, "linestyle": style, "linewidth": 0.8, "ms": 4, "label": label}
                if fine == FINER:
                    look |= {"ms": 6, "fillstyle": "none", "label": None}
                for ax, x in zip(axes, (np.array(list(group)), energy, energy / taken)):
                    if ax is not axes[0] or series.small == 1.0:
                        ax.plot(x, speed, mark, **look)
        for ax, name in zip(axes, (r"stretch $\lambda$", r"$WH$ over $\psi_fl$", "$WH$ over $D$ per length")):
            for level, text in ((1.0, "$c_s$"), (RAYLEIGH, "$c_R$")):
                ax.axhline(level, color="k", linestyle="--", linewidth=0.6)
                ax.text(0.99, level, text, transform=ax.get_yaxis_transform(), ha="right", va="bottom", fontsize=7)
            ax.set(xlabel=name, ylabel="$v/c_s$", ylim=(0.5, 1.55))
            ax.xaxis.set_major_locator(MaxNLocator(5))
        if points:
            axes[2].legend(fontsize=5.5, loc="lower right")
