"""What the program says when it cannot go on: one class for each kind of cause, one line for each message."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable

__all__ = ["CheckpointError", "ConvergenceError", "InstabilityError", "Interrupted", "MeshError", "MissingExtra",
           "OutputError", "ParameterError", "SkfsinkError", "choose", "first_line", "place_text", "require"]


class SkfsinkError(Exception):
    """Base class: every error a user can cause or cure. The command line prints it on one line and exits with 2."""


class ParameterError(SkfsinkError):
    """A parameter has no meaning or lies outside its range."""


class MeshError(SkfsinkError):
    """A mesh is unknown, unreadable, or has elements that are not convex quadrilaterals or hexahedra."""


class MissingExtra(SkfsinkError):
    """An optional package is needed for what was asked."""


class OutputError(SkfsinkError):
    """The output folder cannot be used."""


class CheckpointError(SkfsinkError):
    """A checkpoint is damaged, or belongs to another scene."""


class ConvergenceError(SkfsinkError):
    """An iteration did not converge, and no smaller step is left to try."""


class Interrupted(SkfsinkError):
    """What was running was interrupted and left what it takes to go on."""


class InstabilityError(SkfsinkError):
    """The energy ledger, or a field, shows that a computed result can no longer be trusted."""


def choose(name: str, value: str, allowed: Collection[str]) -> str:
    """Return `value` if it is one of the words allowed for `name`.

    Raises
    ------
    ParameterError
        It is none of them; the line lists those there are.
    """
    if value not in allowed:
        raise ParameterError(f"{name} must be one of {', '.join(allowed)}; got {value!r}")
    return value


def require(name: str, value: float, unit: str = "", *, low: float = -math.inf, high: float = math.inf,
            low_open: bool = False, high_open: bool = False, whole: bool = False) -> float:
    """Return `value` as a float if it is a finite number, or a `whole` one, in the interval asked for.

    Raises
    ------
    ParameterError
        One line that names the parameter, the offending value and the range that is allowed.
    """
    left = ("(" if low_open or low == -math.inf else "[") + f"{low:g}"
    right = f"{high:g}" + (")" if high_open or high == math.inf else "]")
    kind = "whole" if whole else "finite"
    allowed = f"{name} must be a {kind} number in {left}, {right}" + (f" {unit}" if unit else "")
    try:
        number = math.nan if isinstance(value, str | bytes) else float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    too_low = number <= low if low_open else number < low
    too_high = number >= high if high_open else number > high
    if not math.isfinite(number) or too_low or too_high or (whole and number % 1):
        raise ParameterError(f"{allowed}; got {value!r}")
    return number


def first_line(error: BaseException) -> str:
    """What an error says, on one line; the name of its class where it says nothing."""
    return str(error).splitlines()[0] if str(error) else type(error).__name__


def place_text(x: Iterable[float]) -> str:
    """A place as it stands in a message, to three digits."""
    return "(" + ", ".join(f"{value:.3g}" for value in x) + ")"
