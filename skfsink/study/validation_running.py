"""Cracks that run along strips: speed and energy taken against W H, and the first branch.

Strips of the law of the paper of several heights, in plane stress and, softer in volume, in plane strain; see
:mod:`.running_strip`. Held against them: one curve Gamma(v), and branches at about twice the energy that a crack
needs (Bleyer, Roux-Langlois, Molinari, Int. J. Fract. 204 (2017) 79-100, of a phase field); a crack that has not heard
of the grips runs at v = c_R (1 - Gamma/G), without inertia, and in a strip it gathers speed (Freund, Dynamic
Fracture Mechanics (1990); Goldman, Livne, Fineberg, Phys. Rev. Lett. 104 (2010) 114301).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..material import AAA
from .chart import page
from .part import Planned, Points
from .plate import first_passages
from .running_strip import PIECE, RunningStrip, WayPiece, pieces
from .validation_table import Row

__all__ = ["draw_running", "plan_running", "rows_running"]

SOFT = 5.0    # bulk modulus in plane strain [MPa]: a strip held at its width bears the less stretch the stiffer it is
STATES = {"plane stress": ("planestress", AAA()), "plane strain": ("jbar", AAA(bulk_modulus=SOFT))}
#: heights [mm], and W H over psi_f l of the strips that are that high
STRIPS = {"plane stress": {2.0: (0.4, 0.45, 0.5, 0.6, 0.7, 0.85, 1.0, 1.3), 4.0: (0.4, 0.5, 0.7, 1.0),
                           6.0: (0.4, 0.5, 0.7, 1.0), 12.0: (0.4, 0.5)},
          "plane strain": {2.0: (0.4, 0.45, 0.5, 0.6, 0.7, 0.85, 1.0, 1.3), 4.0: (0.5, 0.7)}}
FINER = (2.0, (0.5, 0.7), 5.0)   # height, energies, elements in l of the strips that are computed again
RUN = 3.5                        # least way that is followed [mm]
COARSE = 3.0                     # elements in l
FAST = 0.75                      # over c_R: pieces of the way that are as fast are compared between heights
SAME = 0.15                      # between heights
TWICE = (1.6, 2.4)               # of what the crack takes before: when it branches at "about twice"


def plan_running(quick: bool) -> list[Planned]:
    """All strips; if quick, three of one height."""
    planned = []
    for state, heights in STRIPS.items():
        element, material = STATES[state]
        for height, energies in heights.items():
            for energy in energies:
                strip = RunningStrip(height, max(RUN, height / 2), energy, element, COARSE, material=material)
                planned.append(Planned(f"{state}/{height:g}/{energy:g}/{COARSE:g}", strip, 12.0))
        height, energies, fine = FINER
        planned += [Planned(f"{state}/{height:g}/{energy:g}/{fine:g}",
                            RunningStrip(height, RUN, energy, element, fine, material=material), 40.0)
                    for energy in energies]
    return planned[:8:3] if quick else planned


# --- what comes out ---
def runs(points: Points, state: str, fine: float = COARSE) -> dict[float, dict[float, dict[str, Any]]]:
    """The points of a state of stress on one mesh by height and energy, those that did not fail."""
    found: dict[float, dict[float, dict[str, Any]]] = {}
    for key, point in points.items():
        there, height, energy, elements = key.split("/")
        if there == state and float(elements) == fine and "failed" not in point:
            found.setdefault(float(height), {})[float(energy)] = point
    return {height: dict(sorted(group.items())) for height, group in sorted(found.items())}


def mean_taken(point: dict[str, Any], least: float = 0.0, most: float = np.inf) -> float:
    """Mean D per length over psi_f l in the pieces of the way with speeds in [least, most) c_R; NaN without any."""
    taken = [piece.taken for piece in pieces(point) if least <= piece.speed / point["c_R"] < most]
    return float(np.mean(taken)) if taken else float("nan")


def mean_speed(point: dict[str, Any]) -> float:
    """Mean speed over c_R of all pieces of the way; NaN without any."""
    way = pieces(point)
    return float(len(way) / sum(1 / piece.speed for piece in way) / point["c_R"]) if way else float("nan")


def all_pieces(groups: dict[float, dict[float, dict[str, Any]]]) -> list[tuple[float, WayPiece, dict[str, Any]]]:
    """Height, piece and point of all pieces."""
    return [(height, piece, point) for height, group in groups.items() for point in group.values()
            for piece in pieces(point)]


def toughness(groups: dict[float, dict[float, dict[str, Any]]]) -> float:
    """Gamma over psi_f l: mean D per length of the strip with the least W H whose crack ran on, up to its last piece.

    The last piece before a branch is left out.
    """
    ran = [(energy, point) for group in groups.values() for energy, point in group.items() if len(pieces(point)) > 1]
    least = min((energy for energy, _ in ran), default=np.nan)
    taken = [piece.taken for energy, point in ran if energy == least
             for piece in pieces(point)[:-1 if point["branched_mm"] is not None else None]]
    return float(np.mean(taken)) if taken else float("nan")


def before_branches(groups: dict[float, dict[float, dict[str, Any]]]) -> list[float]:
    """D per length over psi_f l in the last piece before the first branch, of all strips that have one."""
    return [pieces(point)[-1].taken for group in groups.values() for point in group.values()
            if point["branched_mm"] is not None and pieces(point)]


def early(point: dict[str, Any]) -> list[WayPiece]:
    """Pieces of the way before waves from the tip can have come back from the grips."""
    back = point["height_mm"] / point["c_d"] * 1e3  # us
    x, t = np.array(point["tip_mm"]), np.array(point["time_us"])
    return [piece for piece in pieces(point) if float(first_passages(t, x, np.array([piece.x]))[0]) < back]


def rows_running(points: Points) -> list[Row]:
    """Four rows a state of stress: one curve, W H and D at the first branch, and the early run."""
    rows = []
    for state in STATES:
        groups, finer = runs(points, state), runs(points, state, FINER[2])
        gamma = toughness(groups)
        if not np.isfinite(gamma):
            continue
        fine = [(mean_taken(point), mean_taken(groups[height][energy])) for height, group in finer.items()
                for energy, point in group.items() if energy in groups.get(height, {})]
        error = ", ".join(f"{abs(a / b - 1):.0%}" for a, b in fine if np.isfinite(a / b)) or "one mesh"
        rows += [_one_curve(state, groups, error), _first_branch(state, groups, gamma),
                 _before_branch(state, groups, finer, gamma), _early_run(state, groups)]
    return rows


def _one_curve(state: str, groups: dict[float, dict[float, dict[str, Any]]], error: str) -> Row:
    """D per length of fast cracks at the energies at which strips of all heights have some."""
    taken = {height: {energy: mean_taken(point, FAST) for energy, point in group.items()}
             for height, group in groups.items()}
    taken = {height: {energy: D for energy, D in group.items() if np.isfinite(D)} for height, group in taken.items()}
    taken = {height: group for height, group in taken.items() if group}
    common = sorted(set.intersection(*(set(group) for group in taken.values()))) if taken else []
    what = f"strips, {state}: $\\Gamma/\\psi_fl$ of cracks faster than {FAST:g} $c_R$"
    known = "one curve $\\Gamma(v)$ (Bleyer et al. 2017)"
    if len(taken) < 2 or not common:
        return Row(what, known, "–", error, None, "no two heights have one at the same $WH$")
    means = [float(np.mean([group[energy] for energy in common])) for group in taken.values()]
    spread = max(means) / min(means) - 1
    every = [piece.taken for _, piece, point in all_pieces(groups) if piece.speed > FAST * point["c_R"]]
    return Row(f"{what}, {', '.join(f'{h:g}' for h in taken)} mm high", known,
               ", ".join(f"{mean:.2f}" for mean in means), error, spread < SAME,
               f"{spread:.0%} between heights at $WH={', '.join(f'{e:g}' for e in common)}\\,\\psi_fl$; single pieces "
               f"of {PIECE:g} $l$ of all strips take {min(every):.2f} to {max(every):.2f} at such speeds")


def _first_branch(state: str, groups: dict[float, dict[float, dict[str, Any]]], gamma: float) -> Row:
    """W H over Gamma of the strips that branched and of those that did not."""
    branched = [energy for group in groups.values() for energy, p in group.items() if p["branched_mm"] is not None]
    single = [energy for group in groups.values() for energy, p in group.items()
              if p["branched_mm"] is None and len(pieces(p)) > 1]
    least = min(branched, default=np.nan) / gamma
    most = f"; up to {max(single) / gamma:.1f} a crack ran {RUN:g} mm without" if single else ""
    return Row(f"strips, {state}: $WH/\\Gamma$ from which a crack branches", "about 2 (Bleyer et al. 2017)",
               f"{least:.1f}", f"{0.05 / gamma:.1f}, steps of $WH$", TWICE[0] <= least <= TWICE[1],
               f"the least that branched within {RUN:g} mm{most}; $\\Gamma={gamma:.2f}\\,\\psi_fl$")


def _before_branch(state: str, groups: dict[float, dict[float, dict[str, Any]]],
                   finer: dict[float, dict[float, dict[str, Any]]], gamma: float) -> Row:
    """D per length in the last piece before the first branch, over Gamma."""
    found, fine = np.array(before_branches(groups)) / gamma, np.array(before_branches(finer)) / gamma
    error = f"{abs(fine.mean() / found.mean() - 1):.0%}" if fine.size and found.size else "one mesh"
    mean = float(found.mean()) if found.size else np.nan
    return Row(f"strips, {state}: what the last {PIECE:g} $l$ before the first branch take, over $\\Gamma$",
               "about 2 (Bleyer et al. 2017)", f"{mean:.1f}" + (f" ({found.min():.1f} to {found.max():.1f} in "
               f"{found.size} strips)" if found.size else ""), error, TWICE[0] <= mean <= TWICE[1],
               "the band widens before it forks")


def _early_run(state: str, groups: dict[float, dict[float, dict[str, Any]]]) -> Row:
    """G (1 - v/c_R) over D per length of cracks that no wave from the grips has reached, by height."""
    found: dict[float, float] = {}
    for height, group in groups.items():
        ratios = [point["energy_over_band"] * (1 - piece.speed / point["c_R"]) / piece.taken for point in group.values()
                  for piece in early(point)]
        if len(ratios) > 1:
            found[height] = float(np.mean(ratios))
    last = list(found.values())[-1] if found else np.nan
    return Row(f"strips, {state}: $WH(1-v/c_R)$ over $D$ per length, of cracks that no wave from the grips has "
               f"reached, {', '.join(f'{h:g}' for h in found) or 'no'} mm high", "1 (Freund; Goldman et al. 2010)",
               ", ".join(f"{ratio:.2f}" for ratio in found.values()) or "–", "–", bool(abs(last - 1) < SAME) if found
               else None, "means; nearer to 1 the more lengths $l$ a strip is high" if len(found) > 1 else "means")


COLOURS = {2.0: "#2f6690", 4.0: "#d08c2f", 6.0: "#a63d40", 12.0: "#4f7942"}


def draw_running(points: Points, path: Path) -> None:
    """D per length against the speed of each piece of the way; speed against W H; and D on the way to a branch."""
    with page(path, "Cracks along strips: what they take, how fast they run, and where they branch", 2, 2, 5.6) as axes:
        for column, state in enumerate(STATES):
            groups, finer = runs(points, state), runs(points, state, FINER[2])
            top, low = axes[column], axes[column + 2]
            for height, piece, point in all_pieces(groups):
                top.plot(piece.speed / point["c_R"], piece.taken, "o", color=COLOURS[height], ms=3)
            for height, piece, point in all_pieces(finer):
                top.plot(piece.speed / point["c_R"], piece.taken, "o", color=COLOURS[height], ms=4, fillstyle="none")
            for height in groups:
                top.plot([], [], "o", color=COLOURS[height], ms=3, label=f"$H={height:g}$ mm")
            top.plot([], [], "ko", fillstyle="none", ms=4, label=f"$l/{FINER[2]:g}$")
            top.axvline(1.0, color="k", linestyle="--", linewidth=0.8)
            top.set(xlabel="$v/c_R$ of a piece of the way", ylabel=r"$D$ per length over $\psi_fl$", title=state,
                    xlim=(0, 1.4), ylim=(0, 0.9))
            top.legend(fontsize=6, loc="upper left")
            _draw_speeds(low, groups)


def _draw_speeds(ax: Axes, groups: dict[float, dict[float, dict[str, Any]]]) -> None:
    """Mean speed of each crack against W H, and the relation of a crack in an endless body."""
    for k, (height, group) in enumerate(groups.items()):  # beside each other, where several have stopped
        for energy, point in group.items():
            branched, speed = point["branched_mm"] is not None, mean_speed(point)
            if point["arrested"] and not branched and not np.isfinite(speed):
                speed = 0.0
            ax.plot(energy + 0.008 * (k - 1), speed, "^" if branched else "o", color=COLOURS[height], ms=4)
    gamma = toughness(groups)
    if np.isfinite(gamma):
        G = np.linspace(gamma, 1.4, 100)
        ax.plot(G, 1 - gamma / G, "k:", linewidth=1, label=r"$1-\Gamma/G$")
    ax.plot([], [], "ko", ms=4, label="one crack")
    ax.plot([], [], "k^", ms=4, label="branched")
    ax.axhline(1.0, color="k", linestyle="--", linewidth=0.8)
    ax.set(xlabel=r"$WH$ over $\psi_fl$", ylabel="mean $v/c_R$ before a branch", xlim=(0.3, 1.4), ylim=(-0.05, 1.3))
    ax.legend(fontsize=6, loc="lower right")
