"""Draws all figures and tables of the paper from the stored reference results; with --compute it runs the cases first.

A figure whose references are not all there is left out with a message, and the exit status is 1 then.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Annotated

import matplotlib
from compute import compute
from cyclopts import App, Parameter
from layout import start
from runs import CASES, FIGURES, RUNS

from skfsink.errors import ParameterError, SkfsinkError, require
from skfsink.pictures import plot

HERE = Path(__file__).resolve().parent
app = App(name="python figures/redraw.py", help=__doc__, help_format="plaintext", version_flags=[])


def select(only: tuple[str, ...]) -> list[str]:
    """The figures that are meant by names or first letters of figures, or by cases: all of these that use the case."""
    for word in only:
        if word not in CASES and not any(name.startswith(word) for name in FIGURES):
            raise ParameterError(f"--only must be one of {', '.join((*FIGURES, *CASES))}; got {word!r}")
    return [name for name, needs in FIGURES.items() if not only or any(
        name.startswith(word) or any(need.startswith(f"{word}/") for need in needs) for word in only)]


@app.default
def main(*, only: Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative="", show_default=False)] = (),
         compute_: Annotated[bool, Parameter(name="--compute", negative="")] = False, jobs: int = 1,
         out: Annotated[Path, Parameter(show_default=False)] = HERE) -> int:
    """Draw the figures.

    Parameters
    ----------
    only
        Figures (fig05, table1) or cases (simple_shear: all figures it is in); all of them if none is named.
    compute_
        First run the cases that the figures need, in `results/reference`, and store what is needed of them. A run that
        is finished is not run again, one that was interrupted goes on.
    jobs
        Runs at a time, 1 to 64.
    out
        Folder of the figures, this one unless given.
    """
    jobs = int(require("jobs", jobs, low=1, high=64, whole=True))
    figures, failed = select(only), []
    if compute_:
        needed = {need for name in figures for need in FIGURES[name]}
        cases = {need.split("/")[0] for need in needed}
        failed = compute([run for run in RUNS if run.name in needed or (run.key == "coarse" and run.case in cases)],
                         jobs)
    for name in figures:
        try:
            with matplotlib.rc_context(plot.STYLE):
                importlib.import_module(name).draw(out / f"{name}.png")
            print(f"{name}: {out / name}.png", flush=True)
        except SkfsinkError as error:
            failed.append(f"{name} is left out: {error}")
    for line in failed:
        print("skfsink:", line, file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    start(app)
