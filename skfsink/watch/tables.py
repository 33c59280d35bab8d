"""What the page tabulates of runs: the last row of the history, and where the energy of the event is."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from ..results.history import Table as History
from ..results.loader import ENERGIES
from ..results.tables import EMPTY, Row, Table, row_of, table_of
from .seen import Seen

__all__ = ["energy_table", "now_table"]


def now_table(shown: Sequence[Seen]) -> Table:
    """Figures of the runs at their last record."""
    histories = [_filled(seen.history) for seen in shown]

    def row(name: str, unit: str, value: Callable[[Seen, dict[str, Any]], Any]) -> Row:
        return row_of(name, unit, [None if one is None else value(seen, _last(one))
                                   for seen, one in zip(shown, histories)])

    def column(name: str, unit: str, key: str, event: bool = False) -> Row:
        return row(name, unit, lambda _, last: last[key] if last["phase"] == "event" or not event else None)

    forces = _units(histories, "reaction_N_per_mm")
    load = row_of("load", forces, [None if one is None else float(one["reaction_N_per_mm"][-1]) for one in histories])
    rows = [
        row("part of the run", "", lambda _, last: last["phase"]),
        column("displacement of the grips", "mm", "grip_displacement_mm"), load,
        column("least relative density γ of a node", "", "gamma_min"),
        row("time since onset", "µs", lambda seen, last: 1e6 * last["time_s"] if _timed(seen, last) else None),
        row("pass", "", lambda seen, last: None if last["phase"] != "event" or _timed(seen, last) else last["step"]),
        column("length of the crack", "mm", "crack_length_mm", event=True),
        row("leading tip, undeformed", "mm", lambda _, last: _tip(last)),
        row("speed of the tip", "m/s", lambda seen, last: last["tip_speed_m_per_s"] if _timed(seen, last) else None),
        column("tips that advance", "", "tips", event=True),
        column("branches", "", "branches", event=True),
        column("failed elements", "", "deleted_elements", event=True),
        row("time step", "s", lambda seen, last: last["dt_s"] if _timed(seen, last) else None),
        row("balance error, of the onset energy", "%", lambda seen, last: _error(seen)),
    ]
    return table_of("Figures at the last record", [seen.place.label for seen in shown], rows)


def energy_table(shown: Sequence[Seen]) -> Table:
    """Where the energy of the event is at the last record."""
    known = [seen.run.energies if seen.run is not None and seen.history is not None else {} for seen in shown]
    unit = next((energy.unit for energies in known for energy in energies.values()), "")
    rows = [row_of(meaning, [energies[name].unit if name in energies else unit for energies in known],
                   [energies[name].end if name in energies else None for energies in known])
            for name, _, meaning in ENERGIES]
    return table_of("Energies of the event at the last record", [seen.place.label for seen in shown], rows)


def _filled(history: History | None) -> History | None:
    return None if history is None or not len(history["step"]) else history


def _last(history: History) -> dict[str, Any]:
    """The last row, as Python's own numbers and words."""
    return {name: values[-1].item() for name, values in history.items()}


def _units(histories: Sequence[History | None], column: str) -> list[str]:
    known = [None if history is None else history.units[column] for history in histories]
    first = next(filter(None, known), "")
    return [unit or first for unit in known]


def _timed(seen: Seen, last: dict[str, Any]) -> bool:
    """Whether a row is of an event that has a time."""
    return last["phase"] == "event" and seen.run is not None and seen.run.analysis == "dynamic"


def _tip(last: dict[str, Any]) -> str:
    """Position of the leading tip."""
    place = [last[f"tip_{axis}_mm"] for axis in "xyz"]
    found = [f"{value:.3f}" for value in place if math.isfinite(value)]
    return ", ".join(found) if found and last["phase"] == "event" else EMPTY


def _error(seen: Seen) -> float | None:
    """What the energies of the event fail to add up to, of those at its start [%]."""
    energies = {} if seen.run is None else seen.run.energies
    if not energies:
        return None
    start = energies["elastic"].start + energies["kinetic"].start
    return 100.0 * energies["balance"].end / start if start else None
