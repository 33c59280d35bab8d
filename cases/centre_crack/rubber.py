"""Cracks in a sheet of rubber at several stretches along them: `python cases/centre_crack/rubber.py [FOLDER]`.

`rubber.toml` is run at each of `STRETCHES`, four minutes each, in FOLDER (results/rubber); runs that are there are not
run again. The table of `speed.py` is printed, and the speeds are drawn beside those of waves in `rubber.png` there.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
from speed import HEADER, figures, line, waves

import skfsink
from skfsink.material import Material
from skfsink.scene.deck import Deck

HERE = Path(__file__).parent
STRETCHES = (2.0, 2.5, 3.0, 3.5)
HALF = 5.0  # of the length of the strip [mm]


def strip(stretch: float) -> Deck:
    """The deck with this stretch along the crack."""
    deck = skfsink.read_deck(HERE / "rubber.toml")
    x = {"left": -HALF * (stretch - 1), "right": HALF * (stretch - 1)}
    grips = [{**grip, "x": [[0.0, 0.0], [1.0, x[grip["boundary"]]]]} if grip["boundary"] in x else grip
             for grip in deck.parameters["grips"]]
    return replace(deck, parameters={**deck.parameters, "grips": grips})


def picture(found: list[dict[str, float]], material: Material, path: Path) -> None:
    """Speeds over c_s, of fronts and of waves along the sheet stretched as it is at the onset."""
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    along, across = np.array([[f["along"], f["across"]] for f in found]).T
    fine = np.linspace(along.min(), along.max(), 50)
    speeds = np.array([waves(material, a, c) for a, c in zip(fine, np.interp(fine, along, across))])
    figure, axes = plt.subplots(figsize=(4.5, 3.2), layout="constrained")
    for speed, style, label in zip(speeds.T, ("-", "--"), ("transverse wave", "longitudinal wave")):
        axes.plot(fine, speed / material.shear_wave_speed, style, color="0.4", label=label)
    axes.axhline(1.0, color="0.7", linewidth=0.8, label="$c_s$ of the undeformed sheet")
    axes.plot(along, [f["speed"] / f["c_s"] for f in found], "o", color="C3", label="front of the cracks")
    axes.set(xlabel="stretch along the cracks", ylabel="speed over $c_s$ (undeformed body)", ylim=(0, None))
    axes.legend(fontsize=7, loc="lower right")
    figure.savefig(path, dpi=150)


def main(folder: Path) -> None:
    """Run, print and draw."""
    found = []
    print(HEADER)
    for stretch in STRETCHES:
        out = folder / f"stretch={stretch:g}"
        if not (out / "summary.json").exists():
            strip(stretch).run(out=out)
        run = skfsink.load(out)
        found.append(figures(run))
        print(line(run, found[-1]))
    picture(found, run.scene.material, folder / "rubber.png")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/rubber"))
