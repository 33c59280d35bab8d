"""Fig. 4, single-edge notched plate: geometry, three meshes, a speed of 1e-15 mm/s, and the quasi-static crack."""

from __future__ import annotations

from pathlib import Path

from flat import plate
from layout import WIDTH, Panel, densities, microseconds, save, script, title
from matplotlib.figure import Figure

from skfsink.pictures import plot
from skfsink.results import reference

CASE = "single_edge_notch"
KEYS = {"M3-dynamic": "M3", "M4-dynamic": "M4", "M5-dynamic": "M5", "M4-dynamic-1e-15": r"M4, $10^{-15}$ mm/s",
        "M4-quasistatic": "M4, quasi-static"}


def draw(path: Path) -> None:
    """Draw the figure."""
    results = {key: reference.load(CASE, key) for key in KEYS}
    figure = Figure((WIDTH, 4.9), layout="compressed")
    axes = figure.subplots(2, 3).ravel()
    plate(axes[0], results["M4-dynamic"].scene)
    title(axes[0], "a", "geometry (mm)")
    panels: list[Panel] = []
    for key, ref in results.items():
        frame = ref.frame("arrival", "end")
        panels.append((ref, frame, KEYS[key] if key.endswith("static") else f"{KEYS[key]}, {microseconds(frame)}"))
    densities(axes[1:], panels, "bcdef")
    for ax in axes[1:]:
        ax.label_outer()
    axes[1].tick_params(labelleft=True)
    axes[1].set_ylabel(axes[3].get_ylabel())
    plot.density_bar(axes.tolist())
    save(figure, path)


if __name__ == "__main__":
    script(draw, __file__)
