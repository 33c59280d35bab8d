"""One event of the study of ranks, run on all of them: `mpiexec -n 2 python -m skfsink.methods.ranks FILE FOLDER`.

It runs `scene.toml` of the folder, and prints what it has cost as a line of JSON.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

from skfsink.run.compute import run
from skfsink.run.observers.observer import Observer
from skfsink.run.observers.view import View
from skfsink.scene.deck import read_deck


class Clock(Observer):
    """When steps were done: the wall time at each look.

    Memory: the `looks` so far.
    """

    def __init__(self, every: float) -> None:
        self.every = every
        self.looks: list[tuple[int, float]] = []

    def look(self, view: View) -> None:
        """Note step and time."""
        self.looks.append((view.state.step, time.perf_counter()))


def main(folder: Path) -> None:
    """Run the scene, and say what it has cost."""
    scene = read_deck(folder / "scene.toml").scene()
    clock = Clock(scene.controls.event_time / 10)
    summary = run(scene, folder / "run", [clock], quiet=True).summary
    (first, begun), (last, ended) = clock.looks[1], clock.looks[-2]  # without what begins and ends an event
    print(json.dumps({"step_s": (ended - begun) / (last - first), "cost": summary["cost"],
                      "elements": summary["elements"], "D": summary["energy"]["D_sink_final"]}))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
