"""Validation against what is known: `python -m skfsink.study.validation`.

Pulses against the acoustic tensor, one tearing energy in different test pieces, cavitation against closed forms and
published values, and cracks that run along strips: what they take, where they branch, and when they outrun shear
waves. It writes `validation.json`, a picture a part and the one table, which `--page docs/validation.md` puts into the
documentation; it goes on where it was stopped, and needs gmsh.
"""

# ruff: noqa: E402

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

from cyclopts import Parameter

from ..run.display import Display
from .part import Part, Planned, Points
from .speed_accuracy import run_parts
from .store import Store
from .validation_branching import draw_branching, plan_branching, rows_branching
from .validation_cavitation import draw_cavitation, plan_cavitation, rows_cavitation
from .validation_peeling import draw_peeling, plan_peeling, rows_peeling
from .validation_pulses import draw_pulses, plan_pulses, rows_pulses
from .validation_running import draw_running, plan_running, rows_running
from .validation_supershear import draw_supershear, plan_supershear, rows_supershear
from .validation_table import Row, lines, renew
from .validation_tearing import draw_tearing, plan_tearing, rows_tearing

__all__ = ["KNOWN", "Known", "rows_of", "validation"]


class Known(NamedTuple):
    """A part of the study: its points, what is drawn of them, and their rows in the table."""

    plan: Callable[[bool], list[Planned]]
    draw: Callable[[Points, Path], None]
    rows: Callable[[Points], list[Row]]

    def table(self, points: Points) -> list[str]:
        """The rows as a table."""
        return lines(self.rows(points))


KNOWN = {"pulses": Known(plan_pulses, draw_pulses, rows_pulses),
         "tearing": Known(plan_tearing, draw_tearing, rows_tearing),
         "cavitation": Known(plan_cavitation, draw_cavitation, rows_cavitation),
         "running": Known(plan_running, draw_running, rows_running),
         "supershear": Known(plan_supershear, draw_supershear, rows_supershear),
         "branching": Known(plan_branching, draw_branching, rows_branching),
         "peeling": Known(plan_peeling, draw_peeling, rows_peeling)}
FLAG = Parameter(negative="", show_default=False)


def rows_of(points: Points) -> list[Row]:
    """The rows of all parts, of the points of a store."""
    return [row for name, known in KNOWN.items() for row in known.rows(
        {key.partition("/")[2]: point for key, point in points.items() if key.startswith(f"{name}/")})]


def validation(*, only: Literal["pulses", "tearing", "cavitation", "running", "supershear", "branching",
                                "peeling"] | None = None,
               quick: Annotated[bool, FLAG] = False, fresh: Annotated[bool, FLAG] = False,
               out: Path = Path("results/study/validation"), page: Path | None = None,
               quiet: Annotated[bool, FLAG] = False) -> None:
    """Hold the program against closed forms and published values.

    Parameters
    ----------
    only
        One part.
    quick
        One mesh of each body, in three minutes.
    fresh
        Compute all points anew; without it, those in the folder are kept.
    out
        Folder for the figures and pictures.
    page
        A page whose table is renewed with all that the folder has.
    quiet
        Show no progress.
    """
    logging.getLogger("skfsink").setLevel(logging.ERROR)  # bodies are loaded to where they bear no more
    store = Store(out / "validation.json", "validation", fresh)
    chosen = {only: KNOWN[only]} if only else KNOWN
    with Display(quiet) as display:
        run_parts(store, [Part(name, known.plan, known.draw, known.table) for name, known in chosen.items()], quick,
                  display)
    if page is not None:
        renew(page, rows_of(store.points))


if __name__ == "__main__":
    from ..cli.program import command

    command(validation, package="study")
