"""The result of a run: its summary, its history and its last state."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..fields.state import State
from ..scene.scene import Scene

__all__ = ["Result"]


@dataclass(frozen=True, eq=False)
class Result:
    """What a case function returns.

    Attributes
    ----------
    folder: where the files of the run are.
    summary: content of `summary.json`.
    history: columns of `history.csv` as arrays.
    state: the last state.
    parts: for `analysis="both"` the results of the two runs, by analysis; otherwise empty.
    observers: the user's that looked at this run; the parts have their own copies.
    """

    folder: Path
    scene: Scene
    summary: dict[str, Any]
    history: dict[str, np.ndarray]
    state: State
    parts: dict[str, Result]
    observers: tuple[Any, ...] = ()

    @property
    def failed(self) -> bool:
        """Whether the body has failed at all; without a failure there is no event."""
        return all(part.failed for part in self.parts.values()) if self.parts else self.summary["series"] == "run"
