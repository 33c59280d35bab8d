"""All results again, by one command: references, figures, tables, studies and the pages that are made from them.

The steps are commands that are documented where their results are; each goes on where it was stopped, so that this
command does too, and a step that is finished takes seconds. What they leave below `results` is then copied to where
the documentation has it. It needs the extras `mesh` and `view`.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter
from layout import start
from runs import CASES

from skfsink.errors import OutputError, ParameterError, require
from skfsink.study.speed_accuracy import PARTS
from skfsink.study.stability import FAILURES
from skfsink.study.validation import KNOWN

ROOT = Path(__file__).resolve().parents[1]
app = App(name="python figures/everything.py", help=__doc__, help_format="plaintext", version_flags=[])


@dataclass(frozen=True)
class Step:
    """A command: arguments of Python, how long it takes [h of one core], and which files are copied where.

    `copies` has files of `folder` and where they go, as they are called from the top of the repository. A command with
    `jobs` takes the option.
    """

    name: str
    arguments: tuple[str, ...]
    hours: float
    folder: str = ""
    copies: Mapping[str, str] = field(default_factory=dict)
    jobs: bool = False


def _study(name: str, hours: float, *pictures: str) -> Step:
    """A study whose numbers and pictures go to the pages."""
    return Step(name, ("-m", f"skfsink.study.{name}"), hours, f"results/study/{name}",
                {file: f"docs/images/{file}" for file in (f"{name}.json", *pictures)})


STEPS: dict[str, Step] = {step.name: step for step in (
    Step("scenes", ("figures/redraw.py", "--compute"), 1.5, jobs=True),
    Step("spread", ("figures/spread.py", "--compute"), 5.0, jobs=True),
    Step("front", ("figures/front.py",), 0.01),
    _study("convergence", 1.5, "convergence_event.png", "convergence_event_cracks.png",
           "convergence_layers.png"),
    _study("notch", 0.4, "notch.png"),
    _study("speed_accuracy", 2.5, "speed_accuracy.png", *(f"speed_accuracy_{part}.png" for part in PARTS)),
    _study("ranks", 0.8, "ranks_scaling.png"),
    _study("stability", 0.2, *(f"stability_{failure}.png" for failure in FAILURES)),
    Step("validation", ("-m", "skfsink.study.validation", "--page", "docs/validation.md"), 0.5,
         "results/study/validation", {"validation.json": "docs/images/validation.json"}
         | {f"validation_{part}.png": f"docs/images/validation_{part}.png" for part in KNOWN}),
    Step("ladder", ("-m", "skfsink.study.ladder", "--out", "results/study/ladder"), 1.5, "results/study/ladder",
         {f"{case}/ladder.json": f"cases/{case}/ladder.json" for case in CASES}
         | {"ladder.png": "docs/images/ladder.png"}),
    Step("ensemble", ("-m", "skfsink", "sweep", "cases/single_edge_notch/ensemble/scene.toml", "--vary",
                      "mesh.seed=1..50", "--out", "results/study/ensemble"), 1.0, "results/study/ensemble",
         {file: f"cases/single_edge_notch/ensemble/{file}" for file in ("sweep.csv", "sweep.png")}, jobs=True),
    Step("release_rate", ("figures/release_rate.py",), 0.1, "results/release_rate",
         {"release.png": "docs/images/release_rate.png"}),
    Step("pages", ("docs/make/scenes.py",), 0.01),
)}


def run(step: Step, jobs: int) -> None:
    """Run a step and copy its files.

    Raises
    ------
    OutputError
        It failed, or left a file out.
    """
    words = [*step.arguments, *(("--jobs", str(jobs)) if step.jobs else ())]
    status = subprocess.run([sys.executable, *words], check=False, cwd=ROOT,
                            env={**os.environ, "OMP_NUM_THREADS": "1"}).returncode
    if status:
        raise OutputError(f"step {step.name} ended with status {status}: python {shlex.join(words)}")
    for name, place in step.copies.items():
        source = ROOT / step.folder / name
        if not source.exists():
            raise OutputError(f"step {step.name} has not made {source}")
        shutil.copyfile(source, ROOT / place)


@app.default
def main(*, only: Annotated[tuple[str, ...], Parameter(consume_multiple=True, negative="", show_default=False)] = (),
         plan: Annotated[bool, Parameter(negative="")] = False, jobs: int = 1) -> None:
    """Make all results again.

    Parameters
    ----------
    only
        Steps by name; all of them if none is named.
    plan
        Only say what would be run, and about how long it takes.
    jobs
        Runs at a time of the steps that have several, 1 to 64.
    """
    jobs = int(require("jobs", jobs, low=1, high=64, whole=True))
    if unknown := [name for name in only if name not in STEPS]:
        raise ParameterError(f"--only must be one of {', '.join(STEPS)}; got {unknown[0]!r}")
    chosen = [step for step in STEPS.values() if not only or step.name in only]
    for i, step in enumerate(chosen):
        left = sum(later.hours for later in chosen[i:])
        print(f"{i + 1}/{len(chosen)}  {step.name}: python {shlex.join(step.arguments)}  "
              f"(about {step.hours:g} h; {left:.3g} h from here on, on one core)", flush=True)
        if not plan:
            run(step, jobs)


if __name__ == "__main__":
    start(app)
