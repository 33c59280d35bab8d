"""The history of a run, a row at each record, and the log of what has failed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...results.history import History as Rows
from ...results.history import deletions_header
from ...system.files import write_atomic
from .observer import Observer
from .view import View

__all__ = ["Deletions", "History", "row_of"]


def row_of(view: View) -> dict[str, Any]:
    """The row of a history for a moment of a run, by the names of :data:`.HISTORY_COLUMNS`."""
    state, tips, ledger = view.state, view.tips, view.state.ledger
    x = np.full(3, np.nan)
    x[:tips.position.size] = tips.position
    timeless = state.phase == "event" and view.quasistatic
    return {
        "phase": state.phase, "step": state.step, "time_s": 0.0 if timeless else state.time,
        "grip_displacement_mm": view.displacement, "reaction_N_per_mm": view.load,
        "elastic": ledger.elastic, "loads": ledger.loads, "kinetic": ledger.kinetic, "work": ledger.work,
        "sink_stored": ledger.sink_stored, "sink_kinetic": ledger.sink_kinetic, "deletion": ledger.deletion,
        "numerical": ledger.numerical, "released": ledger.released, "U_paper": ledger.paper,
        "balance": ledger.balance, "tip_x_mm": float(x[0]), "tip_y_mm": float(x[1]), "tip_z_mm": float(x[2]),
        "crack_length_mm": tips.length, "tip_speed_m_per_s": 0.0 if timeless else tips.speed,
        "tips": tips.active, "branches": tips.branches, "deleted_elements": int(state.deleted.sum()),
        "gamma_min": float(state.gamma.min()), "dt_s": view.dt}


class History(Observer):
    """Writes `history.csv`: a row for each load increment, at each record of the event, and when the crack arrives.

    Memory: the rows so far.

    Parameters
    ----------
    every: time between rows [s]; in a quasi-static event there is one a pass.
    """

    def __init__(self, every: float) -> None:
        self.every = every
        self._kept: list[dict[str, Any]] = []

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The rows so far."""
        return self._table.rows

    def open(self, view: View, memory: Mapping[str, Any] | None = None) -> None:
        """Take up the rows so far."""
        self._kept = memory["rows"] if memory is not None else []

    def prepare(self, view: View) -> None:
        """Begin the file with the rows so far."""
        self._table = Rows(view.folder / "history.csv", self._kept, view.body.space.dim)

    def loading(self, view: View) -> None:
        """The row of a load increment."""
        self._table.append(row_of(view))

    def due(self, view: View) -> bool:
        """At each record, and when the crack arrives."""
        return bool(view.moment) or super().due(view)

    def look(self, view: View) -> None:
        """Add a row."""
        self._table.append(row_of(view))

    def memory(self) -> dict[str, Any]:
        """The rows so far."""
        return {"rows": self.rows}


class Deletions(Observer):
    """Writes `deletions.csv`, the log of failed elements, at the end."""

    def due(self, view: View) -> bool:
        """Only at the end."""
        return False

    def unfailed(self, view: View) -> None:
        """The log of a run without a failure is empty."""
        self.finish(view)

    def finish(self, view: View) -> None:
        """Write the log."""
        log = "".join(f"{int(time) if view.quasistatic else time!r},{element}\n"
                      for time, element in view.state.deletions)
        write_atomic(view.folder / "deletions.csv", ",".join(deletions_header(view.clock)) + "\n" + log)
