"""The square plates: their sketch with dimensions, and the figure of a plate in both analyses."""

from __future__ import annotations

from pathlib import Path

import paper
from layout import WIDTH, Panel, densities, dissipation, microseconds, save, title
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from runs import key_of
from sketch import dimension, plane_sample

from skfsink.pictures import plot
from skfsink.results import reference
from skfsink.scene.scene import Scene

__all__ = ["plate", "plate_figure"]


def plate(ax: Axes, scene: Scene) -> None:
    """Sketch of a plate: side, notches, and how far these are apart in height, in mm."""
    size, own = plane_sample(ax, scene), scene.parameters
    side, notch = own["side"], own["notch"]
    offset, double = own.get("offset", 0.0), "double" in scene.case
    low, high = (side - offset) / 2, (side + offset) / 2
    gap = 0.06 * size
    ax.set(xlim=(-0.06 * size, 1.2 * size), ylim=(-0.2 * size, 1.22 * size))
    dimension(ax, (side, 0), (side, side), f"{side:g}", (1.5 * gap, 0))
    dimension(ax, (0, low), (notch, low), f"{notch:g}", (0, gap))
    if double:
        dimension(ax, (side - notch, high), (side, high), f"{notch:g}", (0, gap))
    if offset:
        dimension(ax, (notch + 0.1 * size, low), (notch + 0.1 * size, high), f"{offset:g}")


def plate_figure(path: Path, case: str, early: str = "growing") -> None:
    """Geometry, the dynamic crack at `early` and across, U against crack length, the quasi-static crack twice."""
    dynamic, quasistatic = (reference.load(case, key_of(case, kind)) for kind in ("dynamic", "quasistatic"))
    figure = Figure((WIDTH, 4.9), layout="compressed")
    axes = figure.subplots(2, 3)
    plate(axes[0, 0], dynamic.scene)
    title(axes[0, 0], "a", "geometry (mm)")
    first, late = dynamic.frame(early), dynamic.frame("arrival", "end")
    panels: list[Panel] = [
        (dynamic, first, f"dynamic, {microseconds(first)}"), (dynamic, late, f"dynamic, {microseconds(late)}"),
        (quasistatic, quasistatic.frame("growing"), "quasi-static, growing"),
        (quasistatic, quasistatic.frame("arrival", "end"), "quasi-static, arrived")]
    drawn = [axes[0, 1], axes[0, 2], axes[1, 1], axes[1, 2]]
    densities(drawn, panels, "bcef")
    for ax in drawn:
        ax.label_outer()
    for ax in (axes[0, 1], axes[1, 1]):
        ax.tick_params(labelleft=True)
        ax.set_ylabel("$y$ (mm)")
    plot.density_bar(drawn)
    printed = {kind: value for (name, kind), value in paper.U.items() if name == case}
    dissipation(axes[1, 0], dynamic, quasistatic, printed)
    title(axes[1, 0], "d", "dissipated energy")
    save(figure, path)
