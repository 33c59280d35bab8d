"""Pulses: small waves in bars and blocks, undeformed and stretched, against the speeds of the acoustic tensor.

A wave of small amplitude on a homogeneous deformation F runs along N (undeformed) with

    rho0 c^2 m_i = A_iJkL N_J N_L m_k,      A = d2W/dFdF at F

(Ogden, Non-linear Elastic Deformations (1984), Sec. 6.4); c is per undeformed length, and the front is seen to move at
c |F N|. In an undeformed solid these are c_d and c_s. A bar whose sides roll along its axis bears the longitudinal
wave alone; with the axis held and its sides free across, the transverse one. In the block both leave an edge at once,
and its middle line sees them before anything comes from the other edges.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import skfem
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from ..fem.space import Space
from ..fields.body import Body
from ..fields.density import DensitySolver
from ..fields.momentum import Momentum
from ..fields.state import State
from ..loads.curve import Curve
from ..loads.grips import Grip
from ..loads.schedule import Loading
from ..material import AAA, Material, SinkLaw
from ..methods.controls import ExplicitControls, HHTControls
from ..methods.explicit import Explicit
from ..methods.hht import HHT
from .chart import page
from .part import Planned, Points
from .validation_table import Row

__all__ = ["KINDS", "Pulse", "acoustic_speeds", "delay", "draw_pulses", "plan_pulses", "rows_pulses"]

NAMES = {"explicit": "explicit", "hht": "HHT"}
KINDS = ("longitudinal", "transverse")
STRAIN = 1e-4          # of the pulse
WAVE = 0.96            # its length in the undeformed body [mm]
LENGTH, NEAR, FAR = 4.0, 1.0, 3.0   # of a bar, and the two sections that are looked at [mm]
STRETCH = {2: 1.3, 3: 1.5}  # along, of a bar whose sides bear no load
FORCES = 1e-4, 1e-6    # tolerance of HHT, relative to the forces inside: of the pulse alone; of a stretched body
ALLOWED = 0.01         # of the speed
SOFT = 2.0             # bulk over shear modulus of the block, lest its edges be heard too early
BLOCK = (1.6, 4.8)     # its length and height [mm]
BLOCK_NEAR, BLOCK_FAR, BLOCK_WAVE = 0.16, 0.64, 0.64  # [mm]


def acoustic_speeds(material: Material, stretches: tuple[float, ...]) -> tuple[float, float]:
    """Speeds of the longitudinal and a transverse wave along the first of the principal `stretches` [m/s].

    They are those seen, c |F N|; of 2 stretches the third is 1.
    """
    F = np.diag([*stretches, 1.0][:3])
    A = material.modulus(F)
    c = [np.sqrt(A[i, 0, i, 0] / material.rho0) * stretches[0] * 1e-3 for i in (0, 1)]
    return float(c[0]), float(c[1])


def free_sides(material: Material, stretch: float, dim: int) -> tuple[float, ...]:
    """Principal stretches of a bar that is pulled by `stretch` and free across; in 2D it is in plane strain.

    Sides that are free across have to be so at rest as well: the transverse wave would else swing about another state.
    """
    if stretch == 1.0:
        return (1.0,) * dim

    def sideways(across: float) -> float:
        F = np.diag([stretch, across, across if dim == 3 else 1.0])
        return float(material.first_piola(F)[1, 1])

    across = float(brentq(sideways, 0.5 / stretch, 1.0, xtol=1e-14))
    return (stretch,) + (across,) * (dim - 1)


@dataclass(frozen=True)
class Pulse:
    """A bar of n elements, or a block, through which a pulse is sent.

    Parameters
    ----------
    dim: 2 or 3.
    scheme: "explicit" or "hht".
    wave: "longitudinal" or "transverse"; "both" in a block.
    stretch: of the body before, along the way of the pulse.
    n: elements along a bar of `LENGTH`; along a block as many of the same size as it has room for.
    """

    dim: int
    scheme: str
    wave: str
    stretch: float
    n: int

    @property
    def stretches(self) -> tuple[float, ...]:
        """Principal stretches of the body before."""
        return free_sides(self.material, self.stretch, self.dim)

    @property
    def material(self) -> Material:
        """The law of the paper; softer in volume in the block."""
        return AAA(bulk_modulus=SOFT * AAA().shear_modulus) if self.wave == "both" else AAA()

    def __call__(self) -> dict[str, Any]:
        """Speed by travel time between two sections [m/s], that of the acoustic tensor, elements and steps."""
        expected = acoustic_speeds(self.material, self.stretches)
        waves = KINDS if self.wave == "both" else (self.wave,)
        times, seen, elements, h = self._run(min(expected) if self.wave == "both" else expected[KINDS.index(self.wave)],
                                             max(expected))
        x1, x2 = (BLOCK_NEAR, BLOCK_FAR) if self.wave == "both" else (NEAR, FAR)
        found: dict[str, Any] = {"dim": self.dim, "scheme": self.scheme, "wave": self.wave,
                                 "stretch": self.stretch, "elements": elements, "steps": len(times), "h_mm": h}
        for wave in waves:
            i = KINDS.index(wave)
            lag = delay(times, seen[:, 0, i], seen[:, 1, i])
            found[f"{wave}_m_per_s"] = (x2 - x1) * self.stretches[0] / lag * 1e-3
            found[f"{wave}_expected_m_per_s"] = expected[i]
        if self.scheme != "explicit":
            return found  # what is drawn
        keep = slice(None, None, max(1, len(times) // 200))
        found["time_us"] = (times[keep] * 1e6).round(4)
        top = np.abs(seen).max()
        for i in sorted({KINDS.index(wave) for wave in waves}):
            found[f"seen_{KINDS[i]}"] = (seen[keep, :, i] / top).round(4)
        return found

    def _run(self, slowest: float, fastest: float) -> tuple[np.ndarray, np.ndarray, int, float]:
        """Times [s] (n,), velocities along and across (n, 2, 2) at both sections, elements, and their size [mm]."""
        space, h, end, sections, length = self._space()
        c, across = slowest * 1e3 / self.stretches[0], fastest * 1e3 / self.stretches[0]  # mm/s, undeformed
        duration = length / c
        until = (end + 1.1 * length) / c
        loading = self._loading(space, STRAIN * c, duration, until)
        momentum = Momentum(space, self.material)
        body, state = Body(momentum, DensitySolver(space, SinkLaw(phi=1e3)), loading), State.intact(space)
        state.u = space.X * (np.array(self.stretches[:self.dim]) - 1.0)
        state.phase = "event"
        dt = h / across if self.wave == "both" else 0.5 * h / c
        integrator = (Explicit(body, ExplicitControls()) if self.scheme == "explicit" else
                      HHT(body, HHTControls(dt=dt, force_tolerance=FORCES[self.stretch != 1.0])))
        integrator.begin(state)
        times, seen = [0.0], [np.zeros((2, 2))]
        for _ in integrator.run(state, until):
            times.append(state.time)
            seen.append(np.array([state.v[nodes, :2].mean(axis=0) for nodes in sections]))
        return np.array(times), np.array(seen), space.n_elements, h

    def _space(self) -> tuple[Space, float, float, list[np.ndarray], float]:
        """Mesh, size of its elements, the way to look at, the nodes of both sections, and the length of the pulse."""
        if self.wave == "both":
            h = LENGTH / self.n
            lines = [np.linspace(0, size, round(size / h) + 1) for size in BLOCK]
            space = Space(skfem.MeshQuad.init_tensor(*lines))
            middle = np.abs(space.X[:, 1] - BLOCK[1] / 2) < 1e-9
            at = [np.flatnonzero(middle)[np.argmin(np.abs(space.X[middle, 0] - x))] for x in (BLOCK_NEAR, BLOCK_FAR)]
            return space, h, BLOCK_FAR, [np.array([k]) for k in at], BLOCK_WAVE
        h = LENGTH / self.n
        x, side = np.linspace(0, LENGTH, self.n + 1), np.array([0.0, h])
        mesh = skfem.MeshQuad.init_tensor(x, side) if self.dim == 2 else skfem.MeshHex.init_tensor(x, side, side)
        space = Space(mesh)
        return space, h, FAR, [np.flatnonzero(np.abs(space.X[:, 0] - x) < 1e-9) for x in (NEAR, FAR)], WAVE

    def _loading(self, space: Space, speed: float, duration: float, until: float) -> Loading:
        """The left end moves by a smooth step; the other end is held, and the sides as the wave wants it."""
        def moved(t: float) -> float:
            t = min(t, duration)
            return speed * (0.5 * t - 0.25 * duration / np.pi * np.sin(2 * np.pi * t / duration))

        step, X = Curve(moved, until=2 * until, points=(duration,)), space.X
        left, rest = X[:, 0] < 1e-9, X[:, 0] > 1e-9
        right = X[:, 0] > X[:, 0].max() - 1e-9
        if self.wave == "both":
            around = rest & (right | (X[:, 1] < 1e-9) | (X[:, 1] > X[:, 1].max() - 1e-9))
            return Loading(space, [(np.flatnonzero(left), Grip("left", (step, step))),
                                   (np.flatnonzero(around), Grip("around", (0.0, 0.0)))])
        along = 0 if self.wave == "longitudinal" else 1
        end = tuple(step if i == along else 0.0 for i in range(self.dim))
        held = tuple(None if i == along else 0.0 for i in range(self.dim))
        return Loading(space, [(np.flatnonzero(left), Grip("left", end)),
                               (np.flatnonzero(right), Grip("right", (0.0,) * self.dim)),
                               (np.flatnonzero(rest & ~right), Grip("sides", held))])


def delay(times: np.ndarray, first: np.ndarray, second: np.ndarray) -> float:
    """By how much `second` (n,) comes later than `first`: where their correlation is greatest [s]."""
    even = np.linspace(times[0], times[-1], 4001)
    a, b = (CubicSpline(times, f)(even) for f in (first, second))
    size = 2 * even.size
    match = np.fft.irfft(np.fft.rfft(b, size) * np.conj(np.fft.rfft(a, size)), size)[:even.size]
    k = int(np.argmax(match))
    low, top, high = match[k - 1], match[k], match[k + 1]
    return float((k + 0.5 * (low - high) / (low - 2 * top + high)) * (even[1] - even[0]))


def plan_pulses(quick: bool) -> list[Planned]:
    """Bars in 2D and 3D, both waves, both integrators, undeformed and stretched, on two meshes; and blocks."""
    planned = []
    for n, dim, scheme, wave, stretched in product((100,) if quick else (100, 200), (2, 3), ("explicit", "hht"),
                                                   ("longitudinal", "transverse"), (False, True)):
        pulse = Pulse(dim, scheme, wave, STRETCH[dim] if stretched else 1.0, n)
        planned.append(Planned(f"bar {dim}D/{scheme}/{wave}/{'stretched' if stretched else 'undeformed'}/{n}", pulse,
                               {"explicit": 1.0, "hht": 4.0}[scheme] * n / 100))
    for scheme, stretched, fine in product(("explicit", "hht"), (False, True), (False,) if quick else (False, True)):
        n = 100 if not fine else 200 if scheme == "explicit" else 150
        pulse = Pulse(2, scheme, "both", STRETCH[2] if stretched else 1.0, n)
        planned.append(Planned(f"block 2D/{scheme}/both/{'stretched' if stretched else 'undeformed'}/{n}", pulse,
                               {"explicit": 2.0, "hht": 20.0}[scheme] * (n / 100)**3))
    return planned


# --- what comes out ---
def rows_pulses(points: Points) -> list[Row]:
    """A row for each body, wave and stretch: both integrators on the finer mesh against the acoustic tensor."""
    groups: dict[tuple[str, str, str], dict[str, dict[int, float]]] = {}
    known: dict[tuple[str, str, str], float] = {}
    for key, point in points.items():
        body, scheme, _, state, n = key.split("/")
        for wave in KINDS:
            if (speed := point.get(f"{wave}_m_per_s")) is not None:
                group = (body, wave, f"{state} by {point['stretch']:g}" if state == "stretched" else state)
                groups.setdefault(group, {}).setdefault(scheme, {})[int(n)] = speed
                known[group] = point[f"{wave}_expected_m_per_s"]
    rows = []
    for (body, wave, state), schemes in groups.items():
        c, here, errors, off = known[body, wave, state], [], [], []
        for scheme, speeds in schemes.items():
            fine, coarse = speeds[max(speeds)], speeds[min(speeds)]
            here.append(f"{fine:.2f} ({NAMES[scheme]})")
            errors.append(f"{abs(fine / coarse - 1):.2%}" if len(speeds) > 1 else "one mesh")
            off.append(f"{coarse / c - 1:+.2%} → {fine / c - 1:+.2%}" if len(speeds) > 1 else f"{fine / c - 1:+.2%}")
        agrees = all(abs(speeds[max(speeds)] / c - 1) < ALLOWED for speeds in schemes.values())
        symbol = ("$c_d$", "$c_s$")[KINDS.index(wave)] if state == "undeformed" else "acoustic tensor"
        rows.append(Row(f"{body}, {wave} pulse, {state} (m/s)", f"{c:.2f}, {symbol}", ", ".join(here),
                        ", ".join(errors), agrees, f"numerical dispersion: {', '.join(off)}"))
    return rows


def draw_pulses(points: Points, path: Path) -> None:
    """The pulses at both sections over time, of the explicit runs on the finest mesh."""
    with page(path, "Pulses at two sections; dotted: the second crest by the acoustic tensor", 2, 2,
              4.6) as axes:
        panels = [("bar 2D", "longitudinal"), ("bar 2D", "transverse"), ("block 2D", "both"), ("bar 3D", "transverse")]
        for ax, (body, wave) in zip(axes, panels):
            for state, colour in (("undeformed", "k"), ("stretched", "#a63d40")):
                keys = [key for key in points if key.startswith(f"{body}/explicit/{wave}/{state}/")]
                if not keys:
                    continue
                point = points[max(keys, key=lambda key: int(key.split("/")[-1]))]
                for kind, style in zip(KINDS, ("-", "--")):
                    if f"seen_{kind}" not in point:
                        continue
                    label = f"{state}, {kind}" if wave == "both" else state
                    for k, curve in enumerate(np.array(point[f"seen_{kind}"]).T):
                        ax.plot(point["time_us"], curve, style, color=colour, linewidth=1, label=None if k else label)
                    x1, x2 = (BLOCK_NEAR, BLOCK_FAR) if wave == "both" else (NEAR, FAR)
                    first = np.array(point["time_us"])[np.argmax(np.array(point[f"seen_{kind}"])[:, 0])]
                    lag = (x2 - x1) * point["stretch"] / point[f"{kind}_expected_m_per_s"] * 1e3
                    ax.axvline(first + lag, color=colour, linestyle=":", linewidth=0.8)
            ax.set(xlabel="time (µs)", ylabel="velocity over its greatest", title=f"{body}, {wave}")
            if points:
                ax.set_ylim(-0.1, 1.5)
                ax.legend(fontsize=6, loc="upper right", ncols=2)
