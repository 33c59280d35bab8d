"""Fig. 8, dog-bone: geometry, the crack on the deformed sample, the speed of the material, the quasi-static crack."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from layout import WIDTH, microseconds, save, script, title
from matplotlib.figure import Figure
from runs import key_of
from solids import DOG_BONE, density_strip, dog_bone, gauge_box, scale_bar, speed_strip, triad, view

from skfsink.pictures.body import fastest
from skfsink.results import reference


def draw(path: Path) -> None:
    """Draw the figure."""
    dynamic, quasistatic = (reference.load("dog_bone", key_of("dog_bone", kind)) for kind in ("dynamic", "quasistatic"))
    early, late = dynamic.frame("growing"), dynamic.frame("arrival", "end")
    slow = quasistatic.frame("arrival", "end")
    box = gauge_box([(dynamic, early), (dynamic, late), (quasistatic, slow)])
    moving = [frame for frame in (early, late) if frame.v is not None]
    largest, running = fastest(moving), moving[0] if moving else early
    width, gap, sketch = 1.29, 0.1, 1.5
    tall = width * float(np.divide(*np.ptp(box, axis=0)[::-1]))
    page = tall + 1.0
    figure = Figure((WIDTH, page))

    def place(left: float, bottom: float, wide: float, high: float) -> tuple[float, float, float, float]:
        return left / WIDTH, bottom / page, wide / WIDTH, high / page

    ax = figure.add_axes(place(0.02, 0.02, sketch, tall + 0.73))
    dog_bone(ax, dynamic.scene)
    title(ax, "a", "geometry (mm)")
    panels = [("b", f"dynamic, {microseconds(early)}", dynamic, early, "gamma"),
              ("c", f"dynamic, {microseconds(late)}", dynamic, late, "gamma"),
              ("d", f"speed, {microseconds(running)}", dynamic, running, "speed"),
              ("e", "quasi-static", quasistatic, slow, "gamma")]
    left = WIDTH - 4 * (width + gap)
    for i, (letter, text, ref, frame, field) in enumerate(panels):
        ax = figure.add_axes(place(left + i * (width + gap), 0.75, width, tall))
        view(ax, ref, frame, DOG_BONE, box, width, field, largest if field == "speed" else 1.0)
        title(ax, letter, text)
        if not i:
            scale_bar(ax, box, corner=(0.66, -0.045))
            triad(ax, DOG_BONE, box, corner=(0.03, 0.46))
    density_strip(figure.add_axes(place(left + 0.1, 0.42, 2 * width + gap - 0.2, 0.08)))
    speed_strip(figure.add_axes(place(left + 2 * (width + gap) + 0.05, 0.42, width - 0.1, 0.08)), largest)
    save(figure, path)


if __name__ == "__main__":
    script(draw, __file__)
