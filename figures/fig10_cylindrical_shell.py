"""Fig. 9 and 10, cylindrical shell: geometry, the cracks on the deformed shell, the speed, the quasi-static crack."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from layout import WIDTH, microseconds, save, script
from matplotlib.figure import Figure
from runs import key_of
from solids import SHELL, density_strip, scale_bar, shell, speed_strip, triad, view

from skfsink.pictures.body import fastest
from skfsink.pictures.render import bounds
from skfsink.results import reference

CASE = "cylindrical_shell"


def draw(path: Path) -> None:
    """Draw the figure."""
    dynamic, quasistatic = (reference.load(CASE, key_of(CASE, kind)) for kind in ("dynamic", "quasistatic"))
    stages = [dynamic.frame("growing * 0.7"), dynamic.frame("arrival", "end"),
              dynamic.frame("arrival + 1e-5", "end"), dynamic.frame("arrival + 2e-5", "end")]
    slow = quasistatic.frame("arrival", "end")
    box = np.array([pick([bounds(ref.space, [frame], SHELL)[i] for ref, frame in
                          [*((dynamic, stage) for stage in stages), (quasistatic, slow)]], axis=0)
                    for i, pick in enumerate((np.min, np.max))])
    largest = fastest(stages)
    gap, columns = 0.1, 3
    width = (WIDTH - gap * columns) / columns
    tall = width * float(np.divide(*np.ptp(box, axis=0)[::-1]))
    row = tall + 0.28
    page = 3 * row + 0.55
    figure = Figure((WIDTH, page))

    def place(i: int) -> tuple[float, float, float, float]:
        left, top = gap + i % columns * (width + gap), page - (i // columns) * row
        return left / WIDTH, (top - row) / page, width / WIDTH, tall / page

    gamma = [("(a)", "cracks run", stages[0]), ("(b)", "cracks arrive", stages[1]), ("(c)", "", stages[2]),
             ("(d)", "", stages[3])]
    ax = figure.add_axes(place(0))
    shell(ax, dynamic, width)
    ax.set_title("geometry (mm)", loc="left")
    for i, (letter, text, frame) in enumerate(gamma, 1):
        ax = figure.add_axes(place(i))
        view(ax, dynamic, frame, SHELL, box, width)
        ax.set_title(" ".join(filter(None, [letter, text and text + ",", microseconds(frame)])), loc="left")
        if i == 1:
            scale_bar(ax, box, corner=(0.97, 0.03))
            triad(ax, SHELL, box, corner=(0.09, 0.05))
    ax = figure.add_axes(place(5))
    view(ax, quasistatic, slow, SHELL, box, width)
    ax.set_title("(e) quasi-static", loc="left")
    for i, (letter, frame) in enumerate(zip("fgh", stages[1:]), 6):
        ax = figure.add_axes(place(i))
        if frame.v is not None:
            view(ax, dynamic, frame, SHELL, box, width, "speed", largest)
        ax.set_axis_off()
        ax.set_title(f"({letter}) speed, {microseconds(frame)}", loc="left")
    for k, strip in enumerate((density_strip, lambda cax: speed_strip(cax, largest))):
        strip(figure.add_axes(((0.3 + k * 3.7) / WIDTH, 0.38 / page, 2.9 / WIDTH, 0.09 / page)))
    save(figure, path)


if __name__ == "__main__":
    script(draw, __file__)
