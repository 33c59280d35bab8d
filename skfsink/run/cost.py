"""What a run has cost so far, over all its sessions: wall times by phase, steps, solves and factorisations."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

__all__ = ["Cost"]


class Cost:
    """Clocks and counters of a run.

    Memory: all of it: `lap` books the time since the last one, `memory` gives what a checkpoint needs.

    Attributes
    ----------
    wall: time of "loading", "event" and "output" [s].
    steps: of the event.   gamma_solves, factorisations: of earlier sessions, and of solvers that are gone.
    """

    def __init__(self, memory: Mapping[str, Any] | None = None) -> None:
        memory = memory or {}
        self.wall: dict[str, float] = dict(memory.get("wall", {"loading": 0.0, "event": 0.0, "output": 0.0}))
        self.steps, self.gamma_solves, self.factorisations = (
            int(memory.get(name, 0)) for name in ("steps", "gamma_solves", "factorisations"))
        self._clock = time.perf_counter()

    def lap(self, phase: str) -> None:
        """Book the time since the last call as that of a phase."""
        now = time.perf_counter()
        self.wall[phase] += now - self._clock
        self._clock = now
