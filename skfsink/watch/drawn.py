"""Pictures for the page: drawn here, not by the runs, kept until their files change, and not too often."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass

from ..errors import first_line

__all__ = ["Drawn", "Pictures"]

REST = 2.0, 30.0  # seconds between two drawings of a picture, at the least and at the most
SHARE = 0.05      # of a processor that a picture may take: a run may need it


@dataclass(frozen=True)
class Drawn:
    """A picture: its kind, content, and words for those who cannot see it."""

    kind: str
    content: bytes
    alt: str


@dataclass
class _Entry:
    """A picture that is on the page: what it shows now, and how it was drawn last."""

    stamp: Hashable
    draw: Callable[[], Drawn]
    version: int = 1
    last: Drawn | None = None
    of: Hashable = None
    failure: str = ""
    when: float = -1e9
    cost: float = 0.0


class Pictures:
    """The pictures on the page, by name; one is drawn when it is asked for.

    Memory: how each picture is drawn and how it looked last: `offer`, `get`, `alt` and `failure` are of that.
    """

    def __init__(self) -> None:
        self._entries: dict[str, _Entry] = {}
        self._lock, self._drawing = threading.Lock(), threading.Lock()  # matplotlib's settings are of the process

    def offer(self, name: str, stamp: Hashable, draw: Callable[[], Drawn]) -> int:
        """Let a picture be asked for; its version, which rises when it is to be asked for again.

        A new `stamp` counts once the last drawing is long enough ago.
        """
        with self._lock:
            entry = self._entries.setdefault(name, _Entry(stamp, draw))
            if stamp != entry.stamp and time.monotonic() - entry.when > min(max(REST[0], entry.cost / SHARE), REST[1]):
                entry.stamp, entry.draw, entry.version = stamp, draw, entry.version + 1
            return entry.version

    def get(self, name: str) -> Drawn | None:
        """A picture, drawn if it is not yet; None if there is none, or it cannot be drawn (see `failure`)."""
        with self._lock:
            entry = self._entries.get(name)
        if entry is None:
            return None
        with self._drawing:
            stamp, draw = entry.stamp, entry.draw
            if entry.when < 0 or entry.of != stamp:
                begun = time.thread_time()
                try:
                    entry.last, entry.failure = draw(), ""
                except Exception as error:  # whatever a torn file or a curious name brings about: the page goes on
                    entry.failure = first_line(error)
                entry.of, entry.when = stamp, time.monotonic()
                entry.cost = time.thread_time() - begun
        return entry.last

    def alt(self, name: str, otherwise: str) -> str:
        """Words for a picture; `otherwise` until it is drawn."""
        entry = self._entries.get(name)
        return entry.last.alt if entry is not None and entry.last is not None else otherwise

    def failure(self, name: str) -> str:
        """Why the last drawing failed; empty if it did not."""
        entry = self._entries.get(name)
        return entry.failure if entry is not None else ""
