"""The warnings of a run, from wherever in the package they come."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from types import TracebackType

__all__ = ["Notes"]


class Notes(logging.Handler):
    """The warnings of a run, each once: shown when they come up, and kept.

    As a context manager it listens to all modules of the package. Two warnings are the same if they were made from the
    same text, whatever the numbers in it.

    Memory: the warnings `kept`; `emit` leaves out one that came up before, `texts` has all so far.

    Parameters
    ----------
    show: what to do with a new one.
    kept: what :attr:`kept` was in an earlier session of the run.

    Attributes
    ----------
    kept: (text before numbers were put in, text) of each.
    """

    def __init__(self, show: Callable[[str], None], kept: Sequence[Sequence[str]] = ()) -> None:
        super().__init__(logging.WARNING)
        self._show = show
        self.kept: list[tuple[str, str]] = [(str(form), str(text)) for form, text in kept]

    @property
    def texts(self) -> list[str]:
        """The warnings, in the order they came up."""
        return [text for _, text in self.kept]

    def emit(self, record: logging.LogRecord) -> None:
        """Take up a warning."""
        form = str(record.msg)
        if form not in (known for known, _ in self.kept):
            self.kept.append((form, record.getMessage()))
            self._show("warning: " + self.kept[-1][1])

    def __enter__(self) -> Notes:
        logging.getLogger("skfsink").addHandler(self)
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None,
                 trace: TracebackType | None) -> None:
        logging.getLogger("skfsink").removeHandler(self)
