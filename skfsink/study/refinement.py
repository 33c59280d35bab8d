"""Space: error of the elements and meshes against their cost, from loading the notched plate of 4 x 4 mm.

Two families: the coarse mesh with its elements divided into four again and again (h = l/1.5 to l/12), whose rates can
be observed and whose limit is extrapolated; and the committed unstructured meshes M3 to M5, to be judged by that
limit. Hexahedra are one layer of the same mesh, held in z, so that they are in plane strain too.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
from matplotlib.axes import Axes

from ..meshing.sample import Sample, load_sample
from ..meshing.sweeping import swept
from .chart import draw_front, page
from .meshes import refined
from .part import Part, Planned, Points
from .plate import PULLED, SLAB, Plate, warm
from .rates import extrapolated, observed_rate

__all__ = ["SPACE", "limits"]

COARSE, UNSTRUCTURED = 0.1 / 1.5, {"M3": 0.0331, "M4": 0.02505, "M5": 0.0202}  # element sizes [mm]
CENTRE = (0.95, 2.0)   # of the rounding of the notch [mm]
OPENING = 0.1          # of the grips, at which the intact plates are compared [mm]; the onset is beyond
KINDS = {"quads": None, "hexes": 0.05}  # thickness of the slab [mm]
#: what is compared: its group in a point, its name there, and how it is called
QUANTITIES = {
    "reaction": ("held", "reaction_N_per_mm", f"force at an opening of {OPENING:g} mm"),
    "energy": ("held", "elastic_N", f"energy at an opening of {OPENING:g} mm"),
    "onset opening": ("onset", "opening_mm", "opening at the onset"),
    "onset reaction": ("onset", "reaction_N_per_mm", "force at the onset"),
    "onset energy": ("onset", "elastic_N", "energy at the onset"),
}


def plate(mesh: str, kind: str) -> Sample:
    """The plate on a mesh: a committed one, or `coarse/2^n`, divided n times."""
    name, _, times = mesh.partition("/2^")
    thickness = KINDS[kind]

    def lift(section: meshio.Mesh) -> meshio.Mesh:
        for _ in range(int(times or 0)):
            section = refined(section, CENTRE)
        return section if thickness is None else swept(section, thickness, 1)

    return load_sample("single_edge_notch", name, lift=lift)


def size(mesh: str) -> float:
    """Size of the fine elements of a mesh [mm]."""
    name, _, times = mesh.partition("/2^")
    return UNSTRUCTURED.get(name, COARSE) / 2 ** int(times or 0)


def plan(quick: bool) -> list[Planned]:
    """Meshes from coarse to fine, with both elements in two and three dimensions."""
    levels = {"quads": 3 if quick else 4, "hexes": 1 if quick else 3}
    planned = []
    for kind in KINDS:
        meshes = [f"coarse/2^{n}" if n else "coarse" for n in range(levels[kind])]
        for mesh in [*meshes, *(["M3"] if quick else UNSTRUCTURED)]:
            for element in ("jbar", "plain"):
                if quick and (mesh, element if kind == "quads" else "") in (("coarse/2^2", "plain"), ("M3", "")):
                    continue
                seconds = 2 * (COARSE / size(mesh)) ** 2.2 * (1 if kind == "quads" else 3)
                planned.append(Planned(f"{mesh}/{element}/{kind}", _Load(mesh, element, kind), seconds))
    return planned


class _Load:
    """Computes a point."""

    def __init__(self, mesh: str, element: str, kind: str) -> None:
        self.mesh, self.element, self.kind = mesh, element, kind

    def __call__(self) -> dict[str, Any]:
        warm(2 if self.kind == "quads" else 3)
        sample = plate(self.mesh, self.kind)
        pulled = Plate(sample, PULLED if self.kind == "quads" else SLAB, element=self.element, onset_tolerance=2e-5)
        held = pulled.held_at(OPENING)
        return {"h_mm": size(self.mesh), "elements": sample.space.n_elements,
                "unknowns": int(pulled.body.free.sum()) + sample.space.n_nodes, "held": held,
                "onset": pulled.onset_figures, "cpu_s": pulled.onset_figures["loading_cpu_s"]}


# --- what comes out ---
def value(point: dict[str, Any], quantity: str) -> float:
    """A quantity of a point."""
    group, name, _ = QUANTITIES[quantity]
    return float(point[group][name])


def limits(points: Points) -> dict[str, tuple[float, float]]:
    """Limit and rate of each quantity, extrapolated from the quads with J_bar that were divided again and again."""
    family = _family(points, "jbar", "quads")
    h = [p["h_mm"] for p in family]
    return {quantity: extrapolated(h, [value(p, quantity) for p in family]) for quantity in QUANTITIES}


def _family(points: Points, element: str, kind: str, unstructured: bool = False) -> list[dict[str, Any]]:
    chosen = [{"mesh": key.rsplit("/", 2)[0], **p} for key, p in points.items()
              if key.endswith(f"/{element}/{kind}") and key.startswith("M") == unstructured and "failed" not in p]
    return sorted(chosen, key=lambda p: -p["h_mm"])


#: element, kind, unstructured, colour, marker, name
LINES = (("jbar", "quads", False, "#33658a", "o-", "J̄, divided"),
         ("plain", "quads", False, "#a63d40", "o-", "plain, divided"),
         ("jbar", "quads", True, "#33658a", "^:", "J̄, M3 to M5"),
         ("plain", "quads", True, "#a63d40", "^:", "plain, M3 to M5"),
         ("jbar", "hexes", False, "#86bbd8", "s--", "J̄, hexes"),
         ("plain", "hexes", False, "#e08e79", "s--", "plain, hexes"))


def draw(points: Points, path: Path) -> None:
    """Above, errors against the element size with their rates; below, against the cost of loading to the onset."""
    found, shown = limits(points), ("reaction", "onset opening", "onset energy")
    with page(path, "Error of elements and meshes", 2, 3, 7.0) as axes:
        for column, quantity in enumerate(shown):
            ax = axes[column]
            for element, kind, unstructured, colour, style, name in LINES:
                if family := _family(points, element, kind, unstructured):
                    h, error = [p["h_mm"] for p in family], errors(family, quantity, found)
                    rate = f" (rate {observed_rate(h, error):.1f})" if len(h) > 2 and not unstructured else ""
                    ax.plot(h, error, style, ms=3.5, color=colour, label=name + rate)
            ax.set(xscale="log", yscale="log", xlabel="element size $h$ (mm)",
                   ylabel=f"relative error of the\n{QUANTITIES[quantity][2]}")
            ax.legend(fontsize=5)
            panel(axes[column + 3], points, quantity)


def panel(ax: Axes, points: Points, quantity: str) -> None:
    """Errors of a quantity against the cost of loading to the onset, with the Pareto front."""
    found = limits(points)
    cost: list[float] = []
    error: list[float] = []
    names: list[str] = []
    for element, kind, unstructured, colour, style, name in LINES:
        if family := _family(points, element, kind, unstructured):
            seconds, e = [p["cpu_s"] for p in family], errors(family, quantity, found)
            ax.plot(seconds, e, style, ms=3.5, color=colour, label=name)
            cost, error = cost + seconds, error + e
            names += [f"{name.split(',')[0]}, {kind}, {p['mesh']} (l/{0.1 / p['h_mm']:.1f})" for p in family]
    ax.set(xscale="log", yscale="log", xlabel="processor time of the loading (s)",
           ylabel=f"relative error of the\n{QUANTITIES[quantity][2]}")
    draw_front(ax, cost, error, names)


def errors(family: list[dict[str, Any]], quantity: str, found: dict[str, tuple[float, float]]) -> list[float]:
    """Relative errors of a quantity against the limits."""
    return [abs(value(p, quantity) / found[quantity][0] - 1) for p in family]


def table(points: Points) -> list[str]:
    """Errors of every mesh and element, and the rates."""
    found = limits(points)
    lines = ["| mesh | elements | loading (s) | " + " | ".join(QUANTITIES) + " |", "|---" * (3 + len(QUANTITIES)) + "|"]
    lines.append("| limit | | | " + " | ".join(f"{found[q][0]:.5g}" for q in QUANTITIES) + " |")
    for key, p in points.items():
        mesh, element, kind = key.rsplit("/", 2)
        head = f"| {mesh}, {element}, {kind} | {p.get('elements', '')} | {p['cpu_s']:.1f} | "
        lines.append(head + (f"failed: {p['failed']}" if "failed" in p else " | ".join(
            f"{100 * (value(p, q) / found[q][0] - 1):+.2f} %" for q in QUANTITIES)) + " |")
    for element, kind, unstructured, *_, name in LINES:
        family = _family(points, element, kind, unstructured)
        if len(family) > 2 and not unstructured:
            h = [p["h_mm"] for p in family]
            lines.append(f"| rate of {name}, {kind} | | | " + " | ".join(
                f"{observed_rate(h, errors(family, q, found)):.2f}" for q in QUANTITIES) + " |")
    return lines


SPACE = Part("space", plan, draw, table)
