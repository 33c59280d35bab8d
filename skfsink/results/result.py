"""The result of a run: what lies in its folder, and its last state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..fields.state import State
from ..scene.scene import Scene
from .history import Table
from .loader import Run

__all__ = ["Result"]


class Result(Run):
    """What a case function returns: a :class:`.Run` that knows its last state.

    All that a run has, it has too: `verdict`, `event`, `energies`, `frames`, `deletions`, `probes`, `table`, `plot`,
    `to_pandas`.

    Parameters
    ----------
    folder: where the files of the run are.
    scene: what was computed.
    summary: content of `summary.json`.
    history: columns of `history.csv` as arrays; of both analyses those of the dynamic one.
    state: the last state; of both analyses that of the dynamic one.
    parts: for `analysis="both"` the results of the two runs, by analysis; otherwise empty.
    observers: the user's that looked at this run; the parts have their own copies.
    """

    if TYPE_CHECKING:
        parts: Mapping[str, Result]
        state: State
        observers: tuple[Any, ...]

    def __init__(self, folder: Path, scene: Scene, summary: dict[str, Any], history: Table, state: State,
                 parts: Mapping[str, Result], observers: Sequence[Any] = ()) -> None:
        super().__init__(folder, summary, scene.case, dict(scene.parameters), scene.assumed, dict(scene.model_choice),
                         parts)
        vars(self).update(scene=scene, history=history, state=state, observers=tuple(observers))

    @property
    def title(self) -> str:
        """Of the scene."""
        return self.scene.title

    @property
    def failed(self) -> bool:
        """Whether the body has failed at all; without a failure there is no event."""
        return all(part.failed for part in self.parts.values()) if self.parts else self.summary["series"] == "run"
