"""Keeps in the folder of a run how far it is, for those who watch it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import Interrupted, SkfsinkError, first_line
from ..results.status import STATUS, Status
from ..system.files import write_atomic
from .display import Display

__all__ = ["EVERY", "told"]

EVERY = 1.0  # seconds between two words at the least, but for a new phase


@contextmanager
def told(folder: Path, display: Display, warnings: Callable[[], Sequence[str]]) -> Iterator[None]:
    """Write what a display shows to `status.json` while the block runs, at most every `EVERY` seconds.

    The file goes with the end of the block; after an error it stays, and says what has ended the run. If it cannot be
    written, the run goes on all the same.
    """
    last, phase = 0.0, ""

    def write(ended: str = "") -> None:
        nonlocal last, phase
        now = time.monotonic()
        shown = display.status()
        if not ended and now - last < EVERY and shown["phase"] == phase:
            return
        last, phase = now, shown["phase"]
        status = Status(**shown, written=time.time(), warnings=tuple(warnings()), ended=ended)
        with suppress(SkfsinkError, OSError):
            write_atomic(folder / STATUS, status.text(), lasting=False)

    display.changed = write
    write()
    try:
        yield
    except BaseException as error:
        stopped = isinstance(error, Interrupted | KeyboardInterrupt)
        write("interrupted" if stopped else first_line(error))
        raise
    else:
        with suppress(OSError):
            (folder / STATUS).unlink(missing_ok=True)
    finally:
        display.changed = lambda: None
