"""The page: what the runs that are watched show now, put into the template."""

from __future__ import annotations

import threading
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from jinja2 import Environment

from ..errors import OutputError
from ..report.page import environment
from ..report.scenes import kind
from ..results.tables import EMPTY
from ..system.version import __version__
from .drawn import Drawn, Pictures
from .figures import Figure, Scenes, joint_figures, own_figures
from .places import Place, labelled, places
from .seen import STATES, Seen, duration, look, look_stamp
from .tables import energy_table, now_table

__all__ = ["Watch"]

MOST = 6  # runs of which all is shown side by side: the curves have as many colours
PHASES = {"": "beginning", "loading": "loading", "dynamic": "event, dynamic", "quasistatic": "event, quasi-static",
          "output": "pictures and summary"}


@dataclass(frozen=True)
class Entry:
    """A run on the page."""

    key: int
    seen: Seen

    @property
    def label(self) -> str:
        """Its name."""
        return self.seen.place.label

    @property
    def what(self) -> str:
        """Case, mesh and analysis; of a mesh file its name, without the folders."""
        run = self.seen.run
        return "" if run is None else f"{run.title}, mesh {Path(run.parameters.get('mesh', EMPTY)).name}, {kind(run)}"

    @property
    def phase(self) -> str:
        """What it does, or what it did last."""
        status = self.seen.status
        return "" if status is None or self.seen.state == "finished" else PHASES.get(status.phase, status.phase)

    @property
    def fraction(self) -> float | None:
        """Part of the phase that is done."""
        if self.seen.state == "finished":
            return 1.0
        return None if self.seen.status is None else self.seen.status.fraction

    @property
    def left(self) -> str:
        """Time left in the phase."""
        status = self.seen.status
        known = status is not None and self.seen.state == "running" and status.left_s is not None
        return f"about {duration(status.left_s)}" if known and status and status.left_s is not None else ""

    @property
    def process(self) -> str:
        """Who runs it, since when, and when it said so last."""
        holder, status = self.seen.holder, self.seen.status
        said = "" if status is None else time.strftime("last word at %H:%M:%S", time.localtime(status.written))
        if holder is None or not self.seen.goes_on:
            return said
        return ", ".join(filter(None, [f"process {holder.process} on {holder.host} since {holder.since}", said]))

    @property
    def lines(self) -> str:
        """Last lines of its log."""
        return "" if self.seen.status is None else "\n".join(self.seen.status.lines)

    @cached_property
    def changed(self) -> int:
        """When its history changed last."""
        return max((one[0] for one in self.seen.stamp if isinstance(one, tuple)), default=0)


class Watch:
    """Runs in some folders, and the page about them.

    Memory: the runs as they were last, their numbers, and the pictures: `page` looks for what has changed, `picture`
    has what the page names.

    Parameters
    ----------
    folders: of runs and sweeps.

    Raises
    ------
    OutputError
        One of them holds neither.
    """

    def __init__(self, folders: Sequence[Path]) -> None:
        if not folders:
            raise OutputError("name at least one folder of a run or a sweep")
        self.folders = tuple(folder.absolute() for folder in folders)
        self._found = {folder: places(given) for folder, given in zip(self.folders, folders)}
        self._keys: dict[Path, int] = {}
        self._seen: dict[Path, Seen] = {}
        self._scenes, self._pictures = Scenes(), Pictures()
        self._looking = threading.Lock()
        self._templates: Environment = environment("skfsink.watch", "skfsink.report")

    def page(self, asked: Collection[int] = ()) -> str:
        """The page as text; `asked` are the numbers of the runs to be shown, by default all or those that go on."""
        with self._looking:
            entries = self._entries()
            shown = [entry for entry in entries if entry.key in asked] or _chosen(entries)
            figures = [*joint_figures([entry.seen for entry in shown], self._scenes)]
            own = {entry.key: own_figures(entry.key, entry.seen, self._scenes) for entry in shown}
            group = "-".join(str(entry.key) for entry in shown)
            seen = [entry.seen for entry in shown]
            return self._templates.get_template("watch.html").render(
                version=__version__, entries=entries, shown=shown, several=len(shown) > 1, many=len(entries) > 1,
                title=_title(entries, shown), heading=_heading(entries), states=STATES, said=_said(entries),
                goes_on=any(entry.seen.goes_on for entry in entries),
                charts={figure.title: self._offered(figure, f"{group}/") for figure in figures},
                own={key: {figure.title: self._offered(figure) for figure in some} for key, some in own.items()},
                now=now_table(seen), energies=energy_table(seen))

    def picture(self, name: str) -> Drawn | None:
        """A picture that the page names; None if there is none of that name, or it cannot be drawn."""
        return self._pictures.get(name)

    def failure(self, name: str) -> str:
        """Why a picture cannot be drawn; empty where there is none."""
        return self._pictures.failure(name)

    def _offered(self, figure: Figure, group: str = "") -> dict[str, Any]:
        name = group + figure.name
        version = self._pictures.offer(name, figure.stamp, figure.draw)
        return {"source": f"picture/{name}?v={version}", "alt": self._pictures.alt(name, figure.alt), "name": name,
                "failure": self._pictures.failure(name)}

    def _entries(self) -> list[Entry]:
        for folder in self.folders:
            try:
                self._found[folder] = places(folder)
            except OutputError:  # it has gone, or is being begun anew: what was in it is shown as it is now
                continue
        found = labelled([place for folder in self.folders for place in self._found[folder]])
        return [Entry(self._keys.setdefault(place.folder, len(self._keys)), self._look(place)) for place in found]

    def _look(self, place: Place) -> Seen:
        before = self._seen.get(place.folder)
        if before is None or before.stamp != look_stamp(place) or before.place != place:
            before = self._seen[place.folder] = look(place)
        return before


def _chosen(entries: Sequence[Entry]) -> list[Entry]:
    """The runs of which all is shown, of those that have begun: those that go on, then those that have changed last."""
    begun = [entry for entry in entries if entry.seen.state != "waiting"] or entries
    first = sorted(begun, key=lambda entry: (entry.seen.state != "running", -entry.changed))[:MOST]
    return [entry for entry in begun if entry in first]


def _heading(entries: Sequence[Entry]) -> str:
    if len(entries) > 1:
        return f"{len(entries)} runs"
    what = entries[0].what or entries[0].label
    return what[0].upper() + what[1:]


def _title(entries: Sequence[Entry], shown: Sequence[Entry]) -> str:
    """Of the window: what can be read on its tab."""
    if len(entries) > 1:
        return f"{_count(entries)} – skfsink"
    entry = shown[0]
    done = f"{entry.fraction:.0%} " if entry.fraction is not None and entry.seen.state == "running" else ""
    return f"{done}{entry.phase or entry.seen.state} – {entry.label} – skfsink"


def _said(entries: Sequence[Entry]) -> str:
    """The states in words, which a screen reader says when they change."""
    return _count(entries) if len(entries) > 1 else entries[0].seen.state


def _count(entries: Sequence[Entry]) -> str:
    states = [entry.seen.state for entry in entries]
    return ", ".join(f"{states.count(state)} {state}" for state in STATES if state in states)
