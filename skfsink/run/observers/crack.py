"""The crack: where and when it runs, branches and arrives, and the energies then."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...fields.body import Body
from ...fields.crack import CrackTracker
from ...scene.scene import Scene
from .observer import Observer
from .places import rim_of
from .view import View

__all__ = ["Crack", "tracker_of"]


def tracker_of(scene: Scene, body: Body) -> CrackTracker:
    """Follows the crack of a scene; a tip in the slowest material has to have moved between two looks at it."""
    names = [*(grip.boundary for grip in scene.grips), *(traction.boundary for traction in scene.tractions)]
    held = [scene.sample.nodes(name) for name in dict.fromkeys(names)]
    slowest = None if scene.controls.analysis == "quasistatic" else body.momentum.shear_wave_speeds[0]
    return CrackTracker(scene.sample.space, scene.sink_law.length_scale, slowest, held, *rim_of(scene),
                        before=body.cracked, gone=body.broken)


class Crack(Observer):
    """Marks what cracks in each step, finds the tips at each record, and says which moments come with them.

    It looks before all other observers and provides for them what they find in the :class:`.View`: `tips`, `moment`,
    and `waiting`, by which they look more rarely until something has cracked.

    Memory: the crack so far.

    Attributes
    ----------
    tracker: of the run.
    separated_at: record at which the sample was found to have come apart [s, or pass]; infinity before.
    at_arrival: energies and time of the first arrival; empty before.
    """

    kept = ("separated_at", "at_arrival")

    def __init__(self, every: float) -> None:
        self.every = every
        self.separated_at = np.inf
        self.at_arrival: dict[str, float] = {}
        self._marked: np.ndarray | None = None  # gamma when it was last looked at; a solve makes a new array

    def open(self, view: View, memory: Mapping[str, Any] | None = None) -> None:
        """Take up the crack so far."""
        super().open(view, memory)
        self.tracker = view.tracker
        view.waiting = view.scene.controls.start == "rest"
        if memory is not None:
            self.tracker.restore({name: memory[name] for name in self.tracker.memory()})
            self.separated_at = float(self.separated_at)

    def begin(self, view: View) -> None:
        """Mark what is cracked at the start of the event."""
        self.tracker.mark(view.state.time, view.state.gamma)

    def due(self, view: View) -> bool:
        """After each step."""
        return True

    def look(self, view: View) -> None:
        """Mark what has cracked; find the tips if the crack has arrived, or a record is due."""
        state, tracker, step, arrived = view.state, self.tracker, view.occasion == "step", False
        if step:
            arrived = state.gamma is not self._marked and tracker.mark(state.time, state.gamma)
            self._marked = state.gamma
            view.waiting = view.waiting and not np.isfinite(tracker.cracked_at).any()
            if not (arrived or super().due(view)):
                return
        branches = tracker.max_branches
        view.tips = tracker.look(state.time, state.gamma)
        if tracker.separated:
            self.separated_at = min(self.separated_at, state.time)
        if arrived:
            ledger = state.ledger
            self.at_arrival = {"U_paper": ledger.paper, "D_sink": ledger.sink, "elastic": ledger.elastic,
                               "kinetic": ledger.kinetic, "time": state.time}
            view.moment = "arrival"
        elif step and branches < 2 <= tracker.max_branches:
            view.moment = "branching"

    def memory(self) -> dict[str, Any]:
        """The crack so far."""
        return {**super().memory(), **self.tracker.memory()}
