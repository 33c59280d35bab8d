"""The history of a run, a row at each record, and the log of what has failed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ...errors import CheckpointError, ParameterError
from ...fields.momentum import terms_without
from ...loads.follower import FollowerLoads
from ...results.history import HISTORY_COLUMNS, OF_PRESSURES, OF_RELEASE, deletions_header
from ...results.history import History as Rows
from ...system.files import write_atomic
from .observer import Observer
from .view import View

__all__ = ["VALUES", "Deletions", "History"]


def _timeless(view: View) -> bool:
    """Whether a state belongs to passes, which have no time."""
    return view.state.phase == "event" and view.quasistatic


def _tip(axis: int) -> Callable[[View], float]:
    """Position of the leading tip along an axis that the body may not have."""
    return lambda view: float(view.tips.position[axis]) if axis < view.tips.position.size else math.nan


def _energy(name: str) -> Callable[[View], float]:
    """An entry of the ledger."""
    return lambda view: float(getattr(view.state.ledger, name))


def _of_pressures(quantity: Callable[[FollowerLoads, np.ndarray], np.ndarray]) -> Callable[[View], float]:
    """A quantity of the first pressure; 0 without pressures."""
    def value(view: View) -> float:
        followers = view.body.loading.followers
        return 0.0 if followers is None else float(quantity(followers, view.state.u)[0])

    return value


def _released(place: int) -> Callable[[View], float]:
    """Greatest G, or the speed of its tip; NaN in the loading and where no observer follows it."""
    def value(view: View) -> float:
        following = view.release if view.state.phase == "event" else None
        return math.nan if following is None else following(view)[place]

    return value


#: what each column of :data:`.HISTORY_COLUMNS` says of a run
VALUES: dict[str, Callable[[View], Any]] = {
    "phase": lambda view: view.state.phase,
    "step": lambda view: view.state.step,
    "time_s": lambda view: 0.0 if _timeless(view) else view.state.time,
    "grip_displacement_mm": lambda view: view.displacement,
    "reaction_N_per_mm": lambda view: view.load,
    **{name: _energy(name) for name in ("elastic", "loads", "contact", "kinetic", "work", "pressure_work",
                                        "sink_stored", "sink_kinetic", "deletion", "numerical", "released", "viscous",
                                        "balance")},
    "pressure_MPa": _of_pressures(lambda followers, u: followers.pressures(u)),
    "swept_volume": _of_pressures(lambda followers, u: followers.swept(u)),
    "U_paper": _energy("paper"),
    "tip_x_mm": _tip(0), "tip_y_mm": _tip(1), "tip_z_mm": _tip(2),
    "crack_length_mm": lambda view: view.tips.length,
    "tip_speed_m_per_s": lambda view: 0.0 if _timeless(view) else view.tips.speed,
    "G_N_per_mm": _released(0), "G_tip_speed_m_per_s": _released(1),
    "tips": lambda view: view.tips.active,
    "branches": lambda view: view.tips.branches,
    "deleted_elements": lambda view: len(view.state.deletions),
    "gamma_min": lambda view: float(view.body.kept(view.state.gamma).min()),
    "dt_s": lambda view: view.dt,
}


class History(Observer):
    """Writes `history.csv`: a row for each load increment, at each record of the event, and when the crack arrives.

    Memory: the `rows` so far.

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
        """Take up the rows so far.

        Raises
        ------
        ParameterError
            A column is in one of :data:`.HISTORY_COLUMNS` and :data:`VALUES` alone.
        CheckpointError
            The rows so far have a column that is in neither.
        """
        for one, other, there in ((HISTORY_COLUMNS, VALUES, "VALUES of skfsink.run.observers.history"),
                                  (VALUES, HISTORY_COLUMNS, "HISTORY_COLUMNS of skfsink.results.history")):
            if alone := one.keys() - other.keys():
                raise ParameterError(f"the column {min(alone)} of the history is not in {there}: enter it in both")
        self._kept = memory["rows"] if memory is not None else []
        if unknown := {name for row in self._kept for name in row} - HISTORY_COLUMNS.keys():
            raise CheckpointError(f"the run in {view.folder} has the column {min(unknown)} in its history, which is "
                                  f"not known here: resume it from Python, with the column in HISTORY_COLUMNS and "
                                  f"VALUES")

    def prepare(self, view: View) -> None:
        """Begin the file with the rows so far."""
        without = terms_without(view.body.momentum, not view.quasistatic)
        if view.body.loading.followers is None:
            without += OF_PRESSURES
        if view.release is None:
            without += OF_RELEASE
        self._table = Rows(view.folder / "history.csv", self._kept, view.body.space.volume_dim, without)

    def loading(self, view: View) -> None:
        """The row of a load increment."""
        self._table.append({name: value(view) for name, value in VALUES.items()})

    def due(self, view: View) -> bool:
        """At each record, and when the crack arrives."""
        return bool(view.moment) or super().due(view)

    def look(self, view: View) -> None:
        """Add a row."""
        self._table.append({name: value(view) for name, value in VALUES.items()})

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
