"""Cavitation with elements: a ball, a cylinder in plane strain and a membrane with a hole, pulled from outside.

Ball (an octant) and cylinder (a quarter of its section) are pulled by a negative pressure that follows the surface, up
to the greatest that there is; the membrane (in plane stress) by its rim. The bodies are 20 times as large as the hole,
and nearly incompressible; closed forms are in :mod:`.validation_voids`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import skfem
from skfem.io.meshio import from_meshio

from ..errors import ConvergenceError
from ..fem.space import Space
from ..fields.body import Body
from ..fields.density import DensitySolver
from ..fields.momentum import Momentum
from ..fields.state import State
from ..loads.grips import Grip
from ..loads.pressure import Pressure
from ..loads.schedule import Loading
from ..material import AAA, Material, NeoHookean, SinkLaw, Yeoh, limiter_of
from ..material.homogeneous import peaks
from ..methods.controls import StaticsControls
from ..methods.statics import Statics
from .chart import page
from .part import Planned, Points
from .validation_table import Row
from .validation_voids import MOST, cavitation_pressure, critical_membrane

__all__ = ["Closed", "Void", "draw_cavitation", "plan_cavitation", "rows_cavitation"]

KINDS = ("ball", "cylinder", "membrane")
HOLE, RATIO = 1.0, 20.0           # radius of the hole [mm], and of the body over it
SIZES = (10.0, 2.0, 0.5)          # radii of the hole over l
COLOURS = {f"{size:g} l": colour for size, colour in zip(SIZES, ("#33658a", "#a63d40", "#c9971c"))}
MESHES = {True: (2, 24), False: (4, 32)}  # elements along half a quarter and across, of a ball and of others
ALLOWED = 0.03                    # of the closed form
ENDLESS = 1000.0                  # stretch of a hole that nothing limits
INCREMENT = 0.05                  # of the load
AXES = "xyz"


def annulus(n: int, radii: np.ndarray) -> Space:
    """Quarter of a ring with layers between these `radii`, 2 n elements around."""
    mesh = skfem.MeshQuad.init_tensor(radii, np.linspace(0, np.pi / 2, 2 * n + 1))
    r, angle = mesh.p
    return Space(skfem.MeshQuad(np.array([r * np.cos(angle), r * np.sin(angle)]), mesh.t))


def octant(n: int, radii: np.ndarray) -> Space:
    """Octant of a hollow ball with layers between these `radii`, of three patches of n x n faces."""
    line = np.linspace(0, 1, n + 1)
    patch = skfem.MeshQuad.init_tensor(line, line)
    a, b = np.tan(patch.p * np.pi / 4)
    points = [np.roll(np.array([np.ones_like(a), a, b]), k, axis=0) for k in range(3)]
    p = np.hstack([x / np.linalg.norm(x, axis=0) for x in points])
    t = np.hstack([patch.t + k * a.size for k in range(3)])
    _, first, number = np.unique(np.round(p, 9), axis=1, return_index=True, return_inverse=True)
    p, t = p[:, first], number.ravel()[t]
    X = np.hstack([r * p for r in radii])
    cells = np.hstack([np.vstack([t + i * p.shape[1], t + (i + 1) * p.shape[1]]) for i in range(len(radii) - 1)])
    return Space(from_meshio(meshio.Mesh(X.T, [("hexahedron", cells.T)])))


@dataclass(frozen=True)
class Void:
    """A ball, cylinder or membrane with a hole of 1 mm, pulled from outside until it bears no more.

    Parameters
    ----------
    kind: "ball", "cylinder" or "membrane".
    material: its law.
    law: sink; its length l is what the hole is compared with. None: nothing fails.
    level: 0 for the coarse mesh, 1 for that of half its sizes.
    """

    kind: str
    material: Material
    law: SinkLaw | None
    level: int

    def __call__(self) -> dict[str, Any]:
        """Greatest tension [MPa], stretch of the hole there, closed form, and why it went no further."""
        ratio, (n, layers) = RATIO, MESHES[self.kind == "ball"]
        radii = HOLE * ratio ** np.linspace(0, 1, (layers << self.level) + 1)
        space = (octant if self.kind == "ball" else annulus)(n << self.level, radii)
        radius = np.linalg.norm(space.X, axis=1)
        outer, inner = (np.flatnonzero(np.isclose(radius, r)) for r in (HOLE * ratio, HOLE))
        dim = space.dim
        planes = [(np.flatnonzero(np.abs(space.X[:, i]) < 1e-9),
                   Grip(AXES[i], tuple(0.0 if j == i else None for j in range(dim)))) for i in range(dim)]
        if self.kind == "membrane":
            free = Loading(space, planes).free.copy()
            free.reshape(-1, dim)[outer] = False
            velocity = np.zeros_like(space.X)
            velocity[outer] = space.X[outer] / (HOLE * ratio)
            loading = Loading.steady(space, free, velocity)
        else:
            loading = Loading(space, planes, (), (), [(outer, Pressure("outer", -1.0))])
        element = "planestress" if self.kind == "membrane" else "jbar"
        momentum = Momentum(space, self.material, element, followers=loading.followers)
        law = self.law or SinkLaw(phi=1e9)
        statics = Statics(Body(momentum, DensitySolver(space, law), loading),
                          StaticsControls(increment=INCREMENT, onset_tolerance=2e-3))
        state, best, hole = State.intact(space), 0.0, 1.0
        curve = []
        why = ""
        try:
            for _ in statics.load(state):
                pulled = self._tension(space, momentum, state, outer)
                grown = float(np.linalg.norm((space.X + state.u)[inner], axis=1).mean()) / HOLE
                curve.append((grown, pulled))
                if pulled > best:
                    best, hole = pulled, grown
                if grown > MOST:
                    why = "the hole has grown beyond sense"
                    break
        except ConvergenceError as error:
            why = str(error)
        grown, pulled = np.array(curve).T
        return {"kind": self.kind, "tension_MPa": best, "hole": hole, "elements": space.n_elements,
                "gamma_rim": [float(state.gamma[inner].min()), float(state.gamma[inner].max())],
                "why": why or statics.unfailed or statics.refused,
                "hole_over_l": HOLE / law.length_scale if self.law else None,
                "grown": grown.round(4), "pulled_MPa": pulled.round(5)}

    def _tension(self, space: Space, momentum: Momentum, state: State, outer: np.ndarray) -> float:
        """Tension on the outside: that which is given, or the Cauchy stress of a membrane [MPa]."""
        if self.kind != "membrane":
            return state.grip
        force = momentum.force(state.u)[outer]
        out = space.X[outer] / np.linalg.norm(space.X[outer], axis=1)[:, None]
        R = float(np.linalg.norm(space.X[outer], axis=1).mean())
        nominal = float((force * out).sum()) / (0.5 * np.pi * R)
        stretch = float(np.linalg.norm((space.X + state.u)[outer], axis=1).mean()) / R
        return nominal * stretch


@dataclass(frozen=True)
class Closed:
    """Closed forms: tension at cavitation [MPa] and stretch of the hole there, with a finite and an endless body."""

    kind: str
    material: Material
    law: SinkLaw | None

    def __call__(self) -> dict[str, Any]:
        """Both, with the strength in uniaxial tension where there is a sink."""
        if self.kind == "membrane":
            endless, finite = critical_membrane(self.material, self.law), critical_membrane(self.material, self.law,
                                                                                            RATIO)
        else:
            most = MOST if self.law else ENDLESS
            endless, finite = (cavitation_pressure(self.material, self.law, self.kind, ratio, most)
                               for ratio in (np.inf, RATIO))
        found = {"endless_MPa": endless[0], "endless_hole": endless[1], "finite_MPa": finite[0],
                 "finite_hole": finite[1]}
        if self.law is not None:
            found["strength_MPa"] = peaks(self.material, self.law)["uniaxial tension"].stress
        return found


def plan_cavitation(quick: bool) -> list[Planned]:
    """Closed forms, the neo-Hookean ball, and rubber with holes of several sizes over l, on two meshes."""
    rubber, limiter = Yeoh(), SinkLaw(phi=limiter_of("yeoh").phi)
    planned = [Planned(f"closed/{kind}/yeoh", Closed(kind, rubber, limiter), 3.0) for kind in KINDS]
    planned.append(Planned("closed/ball/neo-hookean", Closed("ball", NeoHookean(), None), 0.1))
    planned.append(Planned("closed/ball/aaa", Closed("ball", AAA(), SinkLaw()), 0.1))
    for level in (0,) if quick else (0, 1):
        ball = Void("ball", NeoHookean(), None, level)
        planned.append(Planned(f"ball/neo-hookean/{level}", ball, 8.0 + 60.0 * level))
        for kind in KINDS:
            for size in SIZES:
                law = replace(limiter, length_scale=HOLE / size)
                planned.append(Planned(f"{kind}/yeoh of {size:g} l/{level}", Void(kind, rubber, law, level),
                                       4.0 + 40.0 * level if kind == "ball" else 1.0))
    return planned


# --- what comes out ---
def rows_cavitation(points: Points) -> list[Row]:
    """Closed forms against published values, and elements against closed forms."""
    rows = []
    if (found := points.get("closed/ball/neo-hookean")) is not None:
        known = 2.5 * NeoHookean().mu
        rows.append(Row("cavitation of an endless neo-Hookean ball (MPa)", f"{known:.3f}, 5/2 $\\mu$",
                        f"{found['endless_MPa']:.3f} (a hole stretched by {ENDLESS:g})", "–",
                        abs(found["endless_MPa"] / known - 1) < 0.01, "$p$ rises to its limit as 2$\\mu/a$"))
    published = {"ball": (2.0, 3.0, "a void in bulk rubber"), "membrane": (50.0, 60.0, "a void in a rubber membrane")}
    for kind, (low, high, name) in published.items():
        if (found := points.get(f"closed/{kind}/yeoh")) is not None:
            value = found["endless_MPa"]
            rows.append(Row(f"{name} becomes unstable (MPa)", f"{low:g} to {high:g} (Volokh 2011)",
                            f"{value:.2f}, closed form of `yeoh` with its sink", "–", low <= value <= high,
                            f"$l=0$; the hole is then stretched by {found['endless_hole']:.1f}"))
    for key, group in grouped(points).items():
        kind, material, size = key
        known = points[f"closed/{kind}/{material}"]["finite_MPa"]
        fine, coarse = group[-1]["tension_MPa"], group[0]["tension_MPa"]
        error = abs(fine - coarse)
        agrees = abs(fine / known - 1) < ALLOWED
        small = size not in ("", f"{SIZES[0]:g} l")
        rows.append(Row(f"{kind}, {material}{f', hole of {size}' if size else ''} (MPa)",
                        f"{known:.3f}, closed form with $l=0$", f"{fine:.3f}",
                        f"{error:.3f}" if len(group) > 1 else "one mesh", None if small else agrees,
                        f"{fine / known - 1:+.1%}" + ("; $l$ spreads the sink about a small hole" if small else
                                                      FAILS.format(group[-1]["gamma_rim"][0]) if size else "")))
    if (found := points.get("closed/ball/aaa")) is not None:
        rows.append(Row("a void in the wall of the paper (`aaa`) (MPa)",
                        "considerably less than the strength (Volokh 2015, of aneurysms)",
                        f"{found['endless_MPa']:.2f}; strength {found['strength_MPa']:.2f} in uniaxial tension", "–",
                        None, "closed form, $l=0$; no number was at hand"))
        rows.append(Row("a void in thrombus (MPa)", "0.18 (Volokh 2015)", "–", "–", None,
                        "its limiter is not in a source at hand, and is not guessed"))
    return rows


FAILS = r"; the sink runs away at $\gamma={:.2f}$ of the rim, which the closed form follows to 0.02 and less"


def grouped(points: Points) -> dict[tuple[str, str, str], list[dict[str, Any]]]:
    """Points with elements by kind, material, and size of the hole ("" without a sink), coarse first."""
    found: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    for key, point in points.items():
        kind, name, _ = key.split("/")
        if kind != "closed" and "failed" not in point:
            material, _, size = name.partition(" of ")
            found.setdefault((kind, material, size), []).append(point)
    return found


def draw_cavitation(points: Points, path: Path) -> None:
    """Tension against the stretch of the hole, for each kind of body."""
    with page(path, "Tension on a body with a hole, of rubber (yeoh)", 1, 3, 2.8) as axes:
        for ax, kind in zip(axes, KINDS):
            for (body, material, size), group in grouped(points).items():
                if body == kind and material == "yeoh":
                    ax.plot(group[-1]["grown"], group[-1]["pulled_MPa"], linewidth=1, color=COLOURS[size],
                            label=f"hole of {size}")
            if (found := points.get(f"closed/{kind}/yeoh")) is not None:
                ax.plot(found["finite_hole"], found["finite_MPa"], "kx", ms=5, label="closed form")
            ax.set(xlabel="stretch of the hole", ylabel="tension outside (MPa)", title=kind)
            if points:
                ax.set(xlim=(1, None), ylim=(0, None))
                ax.legend(fontsize=6, loc="best")
