"""Fig. 11: the quasi-static cracks of all six samples, on the deformed shape."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import paper
from layout import WIDTH, densities, save, script
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from runs import CASES, key_of
from solids import DOG_BONE, SHELL, gauge_box, scale_bar, triad, view

from skfsink.pictures.plot import GAMMA_MAP
from skfsink.pictures.render import bounds
from skfsink.results import reference


def draw(path: Path) -> None:
    """Draw the figure."""
    results = {case: reference.load(case, key_of(case, "quasistatic")) for case in CASES}
    page, cell, side, row = 4.85, 2.14, 1.72, 2.4
    figure = Figure((WIDTH, page))
    for i, (letter, (case, ref)) in enumerate(zip("abcdef", results.items(), strict=True)):
        left, bottom = 0.42 + i % 3 * cell, page - 0.3 - side - i // 3 * row
        ax = figure.add_axes((left / WIDTH, bottom / page, side / WIDTH, side / page))
        frame, text = ref.frame("arrival", "end"), paper.TITLES[case]
        if ref.space.dim == 2:
            densities([ax], [(ref, frame, text)], letter)
            ax.set_anchor("N")
            continue
        bone = case == "dog_bone"
        camera = DOG_BONE if bone else SHELL
        box = gauge_box([(ref, frame)]) if bone else bounds(ref.space, [frame], camera)
        width, height = np.ptp(box, axis=0)
        ax.set_position(((left - 0.3) / WIDTH, (bottom - 0.2) / page, (side + 0.3) / WIDTH, (side + 0.2) / page))
        view(ax, ref, frame, camera, box, min(1.0, width / height) * (side + 0.3))
        scale_bar(ax, box, corner=(1.5, 0.03) if bone else (1.0, 0.0))
        triad(ax, camera, box, corner=(-0.35, 0.05) if bone else (0.08, -0.02))
        figure.text(left / WIDTH, (bottom + side + 0.08) / page, f"({letter}) {text}", va="bottom")
    bar = figure.add_axes(((WIDTH - 0.62) / WIDTH, 0.2, 0.12 / WIDTH, 0.6))
    figure.colorbar(ScalarMappable(cmap=GAMMA_MAP), cax=bar).set_label(r"relative density $\gamma$")
    save(figure, path)


if __name__ == "__main__":
    script(draw, __file__)
