"""A run as its files show it now: running, finished, failed; files that are torn or gone are said, and end nothing."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

from ..errors import SkfsinkError, first_line
from ..results.history import Table
from ..results.loader import Run, load
from ..results.status import STATUS, Status
from ..results.summary import SUMMARY
from ..run.occupied import HOLDER, Holder
from ..scene.stored import SCENE
from .places import Place

__all__ = ["STATES", "Seen", "duration", "look", "look_stamp", "stamp_of"]

#: States of a run, with what they mean.
STATES = {"running": "it goes on", "silent": "it ran on another machine and has said nothing for a while",
          "waiting": "it has not begun", "finished": "it has come to its end", "failed": "it has ended with an error",
          "interrupted": "it was stopped and can be resumed", "killed": "its process is gone and it can be resumed",
          "gone": "its folder is not there any more", "damaged": "its files cannot be read"}
FILES = (SCENE, STATUS, HOLDER, SUMMARY, "history.csv",
         *(f"series/{name}.{kind}" for name in ("run", "loading") for kind in ("pvd", "vtkhdf")))
SILENT = 600.0  # seconds without a word after which a run on another machine is not taken to go on
LONG = 60.0     # seconds without a word that are said of a run that goes on

Stamp = tuple[object, ...]
Value = TypeVar("Value")


@dataclass(frozen=True)
class Seen:
    """A run at the moment it was looked at.

    Attributes
    ----------
    place: where it is.
    state: one of `STATES`.
    text: what is to be said of that; may be empty.
    run: what the loader reads; None if there is nothing to read.
    history: rows so far; None if there are none, or they cannot be read.
    status: how far it is; None if it does not say.
    holder: its process; None if there is none.
    stamp: of its files: two looks with the same one show the same.
    """

    place: Place
    state: str
    text: str = ""
    run: Run | None = None
    history: Table | None = None
    status: Status | None = None
    holder: Holder | None = None
    stamp: Stamp = field(default=(), compare=False)

    @property
    def goes_on(self) -> bool:
        """Whether more is to be expected of it."""
        return self.state in ("running", "silent", "waiting")

    @property
    def warnings(self) -> list[str]:
        """What it warned of."""
        if self.status is not None:
            return list(self.status.warnings)
        return [] if self.run is None else self.run.warnings


def look_stamp(place: Place) -> Stamp:
    """What changes when a file of a run does, or its process ends, or it is silent for a minute more."""
    holder, said = Holder.read(place.folder), _age(place.folder / STATUS)
    alive = None if holder is None else holder.alive
    quiet = 0 if holder is None or alive is False else int(said // LONG)
    return (alive, quiet, *(stamp_of(place.folder / name) for name in FILES),
            *([] if place.failure is None else [stamp_of(place.failure)]))


def stamp_of(path: Path) -> tuple[int, int] | None:
    """What changes when a file does; None if it is not there."""
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size


def _age(path: Path) -> float:
    """Seconds since a file was written; 0 if it is not there."""
    try:
        return max(0.0, time.time() - os.stat(path).st_mtime)
    except OSError:
        return 0.0


def look(place: Place) -> Seen:
    """The run at a place."""
    stamp = look_stamp(place)
    holder = Holder.read(place.folder)
    status, problem = _tolerant(lambda: Status.read(place.folder))
    run, failure = _tolerant(lambda: load(place.folder) if (place.folder / SCENE).is_file() else None)
    history = None
    if run is not None and not failure and (place.folder / "history.csv").is_file():
        history, failure = _tolerant(lambda: run.history)
    problem = failure or problem
    state, text = _state(place, run, status, holder)
    if state == "finished" and run is not None:
        text = run.verdict
    if problem:
        state, text = (state if state in ("running", "gone") else "damaged"), problem
    return Seen(place, state, text, run, history, status, holder, stamp)


def _state(place: Place, run: Run | None, status: Status | None, holder: Holder | None) -> tuple[str, str]:
    """State of a run, and what is to be said of it."""
    if holder is not None and holder.alive is not False:
        quiet = _age(place.folder / STATUS)
        if holder.alive is None and quiet > SILENT:
            return "silent", f"no word for {duration(quiet)}; whether it goes on is known on {holder.host} alone"
        return "running", f"no word for {duration(quiet)}: what it does takes long, or it hangs" if quiet > LONG else ""
    if not (place.folder if place.failure is None else place.failure.parent).is_dir():
        return "gone", "its folder is not there any more"
    if place.failure is not None and place.failure.is_file():
        return "failed", _first_line_of(place.failure)
    if run is not None and run.finished:
        return "finished", ""
    if status is not None and status.ended:
        return ("interrupted", "") if status.ended == "interrupted" else ("failed", status.ended)
    if status is not None or holder is not None:
        return "killed", "its process is gone"
    return ("waiting", "") if run is None else ("interrupted", "no process is in it")


def _tolerant(read: Callable[[], Value]) -> tuple[Value | None, str]:
    """What is read, and why it could not be; a file may vanish or be torn at any moment."""
    try:
        return read(), ""
    except (SkfsinkError, OSError) as error:
        return None, first_line(error)


def _first_line_of(path: Path) -> str:
    try:
        return (path.read_text(encoding="utf-8", errors="replace").splitlines() or [""])[0]
    except OSError:
        return ""


def duration(seconds: float) -> str:
    """A time as one says it: 42 s, 3 min 5 s, 2 h 14 min, 3 d 4 h."""
    left = round(seconds)
    units = (86400, "d"), (3600, "h"), (60, "min"), (1, "s")
    for (long, name), (short, rest) in pairwise(units):
        if left >= long:
            return f"{left // long} {name} {left % long // short} {rest}".removesuffix(f" 0 {rest}")
    return f"{left} s"
