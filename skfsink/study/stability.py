"""Stability study: where each method fails, a map or a curve each.

`python -m skfsink.study.stability` writes `stability.json`, a picture for each failure and a page of them all. It goes
on where it was stopped; `--quick` takes fewer points. What the pictures show is explained in `docs/stability.md`.
"""

# ruff: noqa: E402

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import logging
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from cyclopts import Parameter
from matplotlib.axes import Axes

from ..run.display import Display
from . import stability_elements as elements
from . import stability_onset as onset
from . import stability_strength as strength
from . import stability_time as time
from .chart import page
from .part import Part, Planned, Points
from .speed_accuracy import run_parts
from .store import Store

__all__ = ["FAILURES", "Failure", "stability"]


class Failure(NamedTuple):
    """A failure: the points of its map, and what draws them on so many axes."""

    plan: Callable[[bool], list[Planned]]
    draw: Callable[[Sequence[Axes], Points], None]
    panels: int = 1


FAILURES = {
    "explicit": Failure(time.plan_explicit, time.draw_explicit),
    "hht": Failure(time.plan_hht, time.draw_hht),
    "strength": Failure(strength.plan_strength, strength.draw_strength, 2),
    "alpha": Failure(time.plan_alpha, time.draw_alpha),
    "staggering": Failure(onset.plan_staggering, onset.draw_staggering, 2),
    "sink": Failure(elements.plan_sink, elements.draw_sink, 2),
    "locking": Failure(elements.plan_locking, elements.draw_locking, 2),
    "checkerboard": Failure(elements.plan_checkerboard, elements.draw_checkerboard, 2),
    "flat": Failure(elements.plan_flat, elements.draw_flat, 2),
    "deletion": Failure(time.plan_deletion, time.draw_deletion),
    "unconverged": Failure(onset.plan_unconverged, onset.draw_unconverged),
    "notch": Failure(onset.plan_notch, onset.draw_notch),
    "length": Failure(onset.plan_length, onset.draw_length),
}
FLAG = Parameter(negative="", show_default=False)


def stability(*, only: Literal["explicit", "hht", "strength", "alpha", "staggering", "sink", "locking", "checkerboard",
                               "flat", "deletion", "unconverged", "notch", "length"] | None = None,
              quick: Annotated[bool, FLAG] = False, fresh: Annotated[bool, FLAG] = False,
              out: Path = Path("results/study/stability"), quiet: Annotated[bool, FLAG] = False) -> None:
    """Find where the methods fail, and draw it.

    Parameters
    ----------
    only
        One failure.
    quick
        Fewer points, in less than three minutes.
    fresh
        Compute all points anew; without it, those in the folder are kept.
    out
        Folder for the figures and pictures.
    quiet
        Show no progress.
    """
    store = Store(out / "stability.json", "stability", fresh)
    chosen = {only: FAILURES[only]} if only else FAILURES
    points: dict[str, Points] = {}
    logging.disable(logging.WARNING)  # failures are what is looked for here
    try:
        with Display(quiet) as display:
            run_parts(store, [Part(name, failure.plan, partial(_picture, name, points), _table)
                              for name, failure in chosen.items()], quick, display)
    finally:
        logging.disable(logging.NOTSET)
    if not only:
        _overview(points, out / "stability.png")


def _picture(name: str, seen: dict[str, Points], points: Points, path: Path) -> None:
    """The picture of one failure; what it shows goes to `seen`."""
    failure, seen[name] = FAILURES[name], points
    with page(path, "", 1, failure.panels, 2.7, width=3.6 * failure.panels) as axes:
        failure.draw(axes, points)


def _table(points: Points) -> list[str]:
    """The figures of the points as a table, a line each; lists of numbers and times are left out."""
    rows = [{"point": key, **{name: value for name, value in point.items() if name not in ("wall_s", "cpu_s")}}
            for key, point in points.items()]
    names = list(dict.fromkeys(name for row in rows for name, value in row.items() if not isinstance(value, list)))
    lines = [names, ["---"] * len(names)] + [[_text(row.get(name, "")) for name in names] for row in rows]
    return ["| " + " | ".join(line) + " |" for line in lines]


def _text(value: Any) -> str:
    return f"{value:.5g}" if isinstance(value, float) else "" if isinstance(value, list) else str(value)


def _overview(points: dict[str, Points], path: Path) -> None:
    """All failures on one page."""
    panels = sum(failure.panels for failure in FAILURES.values())
    rows = -(-panels // 3)
    with page(path, "Where the methods fail", rows, 3, 2.3 * rows, width=10.8) as axes:
        free = iter(axes)
        for name, failure in FAILURES.items():
            failure.draw([next(free) for _ in range(failure.panels)], points[name])
        for ax in free:
            ax.set_axis_off()


if __name__ == "__main__":
    from ..cli.program import command

    command(stability, package="study")
