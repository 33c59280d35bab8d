"""Stress against stretch of a material, drawn on axes of matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import choose
from .homogeneous import PATHS, Peak, curve, extent, peak_of
from .sink import SinkLaw

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .base import Material

__all__ = ["draw_path", "plot_paths"]

STRETCH = 2.0  # up to which a stored energy without a sink is drawn; of a shear, its amount plus 1


def draw_path(ax: Axes, material: Material, law: SinkLaw, name: str, colour: str, peak: Peak) -> None:
    """A path of `PATHS` with the sink (full) and without (dashed), and the strength, which the label says."""
    way = PATHS[name]
    end = way.start + 1.15 * (extent(material, law, way) - way.start)
    found = curve(material, law, way, np.linspace(way.start, end, 700))
    ax.plot(found.at, found.elastic, "--", color=colour, linewidth=0.9)
    left = found.gamma > 1e-4
    ax.plot(found.at[left], found.stress[left], color=colour,
            label=f"{name}: {peak.stress:#.4g} MPa at ${way.symbol}$ = {peak.at:.3f}")
    ax.plot([peak.at], [peak.stress], "o", color=colour, markersize=4)


def plot_paths(material: Material, law: SinkLaw | None, path: str, ax: Axes | None) -> Axes:
    """What :meth:`.Material.plot` draws."""
    names = [choose("path", path, PATHS)] if path else [name for name, way in PATHS.items() if way.free is not None]
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.figure().subplots()
    tallest = 0.0
    for i, name in enumerate(names):
        way, colour = PATHS[name], f"C{i}"
        if law is None:
            at = np.linspace(way.start, way.start + STRETCH - 1.0, 300)
            ax.plot(at, curve(material, SinkLaw(), way, at).elastic, color=colour, label=name)
        else:
            peak = peak_of(material, law, way)
            draw_path(ax, material, law, name, colour, peak)
            tallest = max(tallest, peak.stress)
    shear = path == "simple shear"
    ax.set(xlabel="amount of shear $k$" if shear else r"stretch $\lambda$",
           ylabel=r"Cauchy shear stress $\tau$ (MPa)" if shear else r"Cauchy stress $\sigma$ (MPa)")
    if law is not None:
        ax.set_ylim(0, 1.35 * tallest)
    ax.legend()
    return ax
