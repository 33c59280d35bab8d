"""Work-precision study: error against processor time, one point a method, its Pareto front drawn and named.

`python -m skfsink.study.speed_accuracy` writes `speed_accuracy.json` and a picture a part. It goes on where it was
stopped; `--quick` takes fewer points and less than three minutes.
"""

# ruff: noqa: E402

from __future__ import annotations

import logging
import os

for _name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from ..errors import Interrupted
from ..run.display import Display
from ..system.files import write_atomic
from . import integrators, refinement
from .chart import page
from .integrators import TIME
from .models import MODEL
from .part import Part, Points
from .raised import RAISED
from .refinement import SPACE
from .solvers import SOLVERS
from .store import Store
from .tolerance import TOLERANCE

__all__ = ["PARTS", "measure", "run_parts", "speed_accuracy"]

PARTS: dict[str, Part] = {part.name: part for part in (TIME, TOLERANCE, RAISED, SPACE, MODEL, SOLVERS)}
FLAG = Parameter(negative="", show_default=False)


def speed_accuracy(*, only: Literal["time", "tolerance", "raised", "space", "model", "solvers"] | None = None,
                   quick: Annotated[bool, FLAG] = False, fresh: Annotated[bool, FLAG] = False,
                   out: Path = Path("results/study/speed_accuracy"), quiet: Annotated[bool, FLAG] = False) -> None:
    """Measure what each method costs and how far it is off, and chart one against the other.

    Parameters
    ----------
    only
        One part of the study: integrators, rejected steps, raised mass, meshes and elements, the model, or linear
        solvers.
    quick
        Fewer points, in less than three minutes.
    fresh
        Measure all points anew; without it, those in the folder are kept.
    out
        Folder for the figures and pictures.
    quiet
        Show no progress.
    """
    measure("speed_accuracy", [PARTS[only]] if only else list(PARTS.values()), out, quick, fresh, quiet)


def measure(name: str, parts: list[Part], out: Path, quick: bool, fresh: bool, quiet: bool) -> None:
    """Measure the parts of the study of that name, into `out`/NAME.json, and draw them; see :func:`run_parts`."""
    logging.getLogger("skfsink").setLevel(logging.ERROR)  # methods are taken to their limits, where runs would warn
    store = Store(out / f"{name}.json", name, fresh)
    with Display(quiet) as display:
        run_parts(store, parts, quick, display)


def run_parts(store: Store, parts: list[Part], quick: bool, display: Display) -> None:
    """Compute the points of `parts` that `store` does not have, and draw each part beside its file.

    Raises
    ------
    Interrupted
        Ctrl-C or SIGTERM; the points so far are in the file.
    """
    folder = store.path.parent
    found: dict[str, Points] = {}
    for part in parts:
        display.phase(part.name)
        planned = part.plan(quick)
        points: Points = {}
        todo = sum(p.seconds for p in planned if f"{part.name}/{p.key}" not in store.points)
        done = 0.0
        try:
            for p in planned:
                key = f"{part.name}/{p.key}"
                new = key not in store.points
                display.update(done / todo if todo else 1.0, p.key)
                points[p.key] = store.point(key, p.compute)
                done += p.seconds if new else 0.0
                if new and "failed" in points[p.key]:
                    display.say(f"{p.key} failed: {points[p.key]['failed']}")
        except KeyboardInterrupt:
            kept = (f"{len(store.points)} points are in {store.path}, and the same command goes on from there"
                    if store.points else "nothing was computed yet")
            raise Interrupted(f"interrupted; {kept}") from None
        found[part.name] = points
        part.draw(points, folder / f"{store.study}_{part.name}.png")
        display.update(1.0, "")
    if {"time", "space"} <= found.keys():
        draw_headline(found["time"], found["space"], folder / f"{store.study}.png")
    store.save()  # with the command that made it complete
    tables = [f"## {part.name}\n\n" + "\n".join(part.table(found[part.name])) + "\n" for part in parts]
    write_atomic(folder / f"{store.study}.md", "\n".join(tables))


def draw_headline(time: Points, space: Points, path: Path) -> None:
    """The two questions of every run: which integrator, and which mesh."""
    with page(path, "Error against cost", 1, 2, 5.2) as axes:
        integrators.panel(axes[0], integrators.summary(time), "history")
        axes[0].set(title="dynamic event, by integrator", ylabel="relative error of the tip history (L2)")
        refinement.panel(axes[1], space, "onset opening")
        axes[1].set(title="loading to the onset, by element and mesh")
        axes[0].legend(fontsize=5.5, loc="upper left", bbox_to_anchor=(0.58, -0.19), borderaxespad=0)
        axes[1].legend(fontsize=5.5, loc="upper right")


if __name__ == "__main__":
    from ..cli.program import command

    command(speed_accuracy, package="study")
