"""Picture of a material: stress against stretch on the homogeneous paths, and where it fails."""

from __future__ import annotations

from pathlib import Path as File

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .files import replaced
from .homogeneous import PATHS, Path, Peak, curve, extent
from .material import Material, SinkLaw
from .plot import BLUE, DPI, RED, STYLE, WIDTH

__all__ = ["stress_picture"]

COLOURS = {"uniaxial tension": BLUE, "plane strain": RED, "equibiaxial tension": "#c98a2b", "simple shear": "k"}


@matplotlib.rc_context(STYLE)
def stress_picture(material: Material, law: SinkLaw, strengths: dict[str, Peak], path: str | File,
                   title: str = "") -> None:
    """Cauchy stress on each of `PATHS`: with the sink (full), of the stored energy alone (dashed), and `strengths`."""
    figure = Figure((WIDTH, 3.2), layout="constrained")
    ax, side = figure.subplots(1, 2, width_ratios=[3, 2])
    for name, way in PATHS.items():
        _draw(side if way.free is None else ax, material, law, name, way, strengths[name])
    for panel, symbol, stress, letter in (
            (ax, r"stretch $\lambda$", r"Cauchy stress $\sigma$ (MPa)", "(a) tension"),
            (side, "amount of shear $k$", r"Cauchy shear stress $\tau$ (MPa)", "(b) simple shear")):
        shown = [strengths[name].stress for name, way in PATHS.items() if (way.free is None) == (panel is side)]
        panel.set(xlabel=symbol, ylabel=stress, title=letter, ylim=(0, 1.45 * max(shown)))
        panel.margins(x=0)
    ax.plot([], [], "--", color="0.4", linewidth=0.9, label="without sink")
    ax.plot([], [], "o", color="0.4", markersize=4, label="strength")
    ax.legend(loc="upper left")
    figure.suptitle(title)
    kind = File(path).suffix.lstrip(".") or "png"
    with replaced(path) as part:
        figure.savefig(part, format=kind, dpi=DPI, metadata={"CreationDate": None} if kind == "pdf" else None)


def _draw(ax: Axes, material: Material, law: SinkLaw, name: str, way: Path, peak: Peak) -> None:
    found = curve(material, law, way, np.linspace(way.start, extent(material, law, way), 600))
    colour = COLOURS[name]
    ax.plot(found.at, found.elastic, "--", color=colour, linewidth=0.9)
    ax.plot(found.at, found.stress, color=colour, label=name)
    ax.plot([peak.at], [peak.stress], "o", color=colour, markersize=4)
    ax.annotate(f"{peak.stress:.3g}", (peak.at, peak.stress), (0, 4), textcoords="offset points", ha="center",
                fontsize=7, color=colour)
