"""Draws the direction of the tear over that of the fibres: `python cases/fibre_plate/tear.py SWEEP.csv tear.png`."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from skfsink.pictures.plot import BLUE, RED, STYLE, save


@matplotlib.rc_context(STYLE)
def main(table: Path, picture: Path) -> None:
    """One point a run; those that begin to fail elsewhere than at the notch are hollow."""
    with table.open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["tear_angle [degree]"]]
    figure = Figure((3.6, 2.8), layout="constrained")
    ax = figure.subplots()
    ax.plot([0, 90], [0, 90], "--", color="0.5", linewidth=0.8, label="along the fibres")
    for begun, style in ((True, {"color": BLUE, "label": "from the notch"}),
                         (False, {"color": RED, "mfc": "none", "label": "from a corner of the clamps"})):
        some = [row for row in rows if (row["onset_boundary"] == "notch") is begun]
        if some:
            ax.plot(*zip(*[(float(row["fibres.azimuth"]), float(row["tear_angle [degree]"])) for row in some]), "o",
                    markersize=4, **style)
    ax.set(xlabel="angle of the fibres to the notch (degrees)", ylabel="angle of the tear (degrees)",
           xticks=range(0, 91, 15), yticks=range(-30, 91, 30))
    ax.legend(loc="upper left")
    save(figure, picture, "")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
