"""Picture of a material: stress against stretch on the homogeneous paths, and where it fails."""

from __future__ import annotations

from pathlib import Path as File

import matplotlib
from matplotlib.figure import Figure

from ..material import Material, SinkLaw
from ..material.drawn import draw_path
from ..material.homogeneous import PATHS, Peak, extent
from ..system.files import replaced
from .plot import BLUE, DPI, RED, STYLE, WIDTH

__all__ = ["stress_picture"]

COLOURS = {"uniaxial tension": BLUE, "plane strain": RED, "equibiaxial tension": "#c98a2b", "simple shear": "k"}


@matplotlib.rc_context(STYLE)
def stress_picture(material: Material, law: SinkLaw, strengths: dict[str, Peak], path: str | File,
                   title: str = "") -> None:
    """Cauchy stress on each of `PATHS`: with the sink (full), of the stored energy alone (dashed), and `strengths`."""
    figure = Figure((WIDTH, 3.5), layout="constrained")
    ax, side = figure.subplots(1, 2, width_ratios=[3, 2])
    for name, way in PATHS.items():
        draw_path(side if way.free is None else ax, material, law, name, COLOURS[name], strengths[name])
    for panel, symbol, stress, letter in (
            (ax, r"stretch $\lambda$", r"Cauchy stress $\sigma$ (MPa)", "(a) tension"),
            (side, "amount of shear $k$", r"Cauchy shear stress $\tau$ (MPa)", "(b) simple shear")):
        shown = [(strengths[name].stress, extent(material, law, way), way.start) for name, way in PATHS.items()
                 if (way.free is None) == (panel is side)]
        tallest, longest, start = (max(values) for values in zip(*shown))
        panel.set(xlabel=symbol, ylabel=stress, title=letter, ylim=(0, 1.35 * tallest),
                  xlim=(start, start + 1.06 * (longest - start)))
    ax.plot([], [], "--", color="0.4", linewidth=0.9, label="without sink")
    figure.legend(loc="outside lower center", ncols=2)
    figure.suptitle(title)
    kind = File(path).suffix.lstrip(".") or "png"
    with replaced(path) as part:
        figure.savefig(part, format=kind, dpi=DPI, metadata={"CreationDate": None} if kind == "pdf" else None)
