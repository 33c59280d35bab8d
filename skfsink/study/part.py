"""A part of a study: which points it has, and what is drawn of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

__all__ = ["Part", "Planned", "Points"]

Points = dict[str, dict[str, Any]]  # by key, as the store gives them


class Planned(NamedTuple):
    """A point to be computed: its key, how, and about how long it takes [s], for the time left."""

    key: str
    compute: Callable[[], dict[str, Any]]
    seconds: float = 1.0


class Part(NamedTuple):
    """A part of a study.

    `plan` gives the points in the order in which they are computed, fewer if it is given True (quick). `draw` makes
    the picture of the points at a path; `table` gives their figures for the report, a line a row.
    """

    name: str
    plan: Callable[[bool], list[Planned]]
    draw: Callable[[Points, Path], None]
    table: Callable[[Points], list[str]]
