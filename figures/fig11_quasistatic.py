"""Fig. 11: the quasi-static cracks of all six samples, on the deformed shape."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import paper
from layout import WIDTH, densities, save, script, title
from matplotlib.figure import Figure
from runs import CASES, key_of
from solids import DOG_BONE, SHELL, gauge_box, scale_bar, triad, view

from skfsink import plot, reference
from skfsink.render import bounds


def draw(path: Path) -> None:
    """Draw the figure."""
    results = {case: reference.load(case, key_of(case, "quasistatic")) for case in CASES}
    figure = Figure((WIDTH, 5.0), layout="compressed")
    axes = figure.subplots(2, 3).ravel()
    for ax, letter, (case, ref) in zip(axes, "abcdef", results.items(), strict=True):
        frame, text = ref.frame("arrival", "end"), paper.TITLES[case]
        if ref.space.dim == 2:
            densities([ax], [(ref, frame, text)], letter)
            continue
        camera = DOG_BONE if case == "dog_bone" else SHELL
        box = gauge_box([(ref, frame)]) if case == "dog_bone" else bounds(ref.space, [frame], camera)
        width, height = np.ptp(box, axis=0)
        view(ax, ref, frame, camera, box, min(2.0, 2.0 * width / height))
        scale_bar(ax, box, corner=(1.45, 0.03) if case == "dog_bone" else (1.0, 0.03))
        triad(ax, camera, box, corner=(-0.25, 0.03) if case == "dog_bone" else (0.09, 0.0))
        title(ax, letter, text)
    plot.density_bar(axes.tolist())
    save(figure, path)


if __name__ == "__main__":
    script(draw, __file__)
