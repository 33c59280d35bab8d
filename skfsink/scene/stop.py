"""Conditions that end a run before its time: by name, with a limit, or a function of the view of the run.

    stop = "arrival"                            the crack has arrived at an edge
    stop = "crack_length > 2 mm, time > 50 us"  whichever comes first
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..errors import ParameterError
from ..units import in_unit

__all__ = ["CONDITIONS", "NEVER", "Condition", "read_stop", "stop_of"]

#: names of the conditions, and the unit of the limit of those that have one
CONDITIONS = {"arrival": None, "branching": None, "separated": None, "crack_length": "mm", "displacement": "mm",
              "time": "s", "passes": ""}
#: the condition that has no meaning in an analysis: passes have no time
NEVER = {"quasistatic": "time", "dynamic": "passes"}


@dataclass(frozen=True)
class Condition:
    """A condition: a name in `CONDITIONS`, and the limit that is to be passed, if it has one, in that unit."""

    name: str
    limit: float = 0.0

    def __str__(self) -> str:
        unit = CONDITIONS[self.name]
        return self.name if unit is None else f"{self.name} > {self.limit!r} {unit}".rstrip()


def read_stop(stop: str | Callable[..., Any]) -> tuple[Condition, ...] | Callable[..., Any]:
    """The conditions in a text, none in an empty one; a function as it is.

    Raises
    ------
    ParameterError
        It is neither, or a condition is unknown, or lacks its limit.
    """
    if callable(stop):
        return stop
    if not isinstance(stop, str):
        raise ParameterError(f"stop must be text, such as 'crack_length > 2 mm', or a function of the view of a run; "
                             f"got {stop!r:.80}")
    return tuple(_condition(part.strip()) for part in stop.split(",")) if stop.strip() else ()


def _condition(text: str) -> Condition:
    name, _, limit = (part.strip() for part in text.partition(">"))
    if name not in CONDITIONS:
        raise ParameterError(f"stop must name one of {', '.join(CONDITIONS)}; got {text!r:.80}")
    unit = CONDITIONS[name]
    if (unit is None) != (not limit):
        raise ParameterError(f"stop: {name} has no limit; got {text!r:.80}" if limit else
                             f"stop: {name} needs a limit, such as '{name} > {f'2 {unit}'.rstrip()}'")
    if unit is None:
        return Condition(name)
    return Condition(name, in_unit(f"stop: the limit of {name}", limit, unit, plain=True))


def stop_of(stop: str | Callable[..., Any], analysis: str) -> str | Callable[..., Any]:
    """Of what ends a run of both analyses, the conditions that one of them has."""
    conditions = read_stop(stop)
    if not isinstance(conditions, tuple):
        return conditions
    return ", ".join(str(condition) for condition in conditions if condition.name != NEVER[analysis])
