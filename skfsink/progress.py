"""What a person sees while a run goes on: its phase, how far it is, the time left, and the figures that matter."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

__all__ = ["Display", "Interrupt"]


class Display:
    """A progress line a phase; silent when `quiet`."""

    def __init__(self, quiet: bool = False) -> None:
        self.console = Console(stderr=True, quiet=quiet)
        self._progress = Progress(
            SpinnerColumn(), TextColumn("[bold]{task.description:<12}"), BarColumn(24),
            TextColumn("{task.percentage:>4.0f} %"), TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn(),
            TextColumn("{task.fields[figures]}"), console=self.console, disable=quiet)
        self._task: Any = None

    def __enter__(self) -> Display:
        self._progress.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None,
                 trace: TracebackType | None) -> None:
        self._progress.stop()

    def phase(self, name: str) -> None:
        """Begin a new phase."""
        if self._task is not None:
            self._progress.update(self._task, completed=1.0)
            self._progress.stop_task(self._task)
        self._task = self._progress.add_task(name, total=1.0, figures="")

    def update(self, fraction: float, figures: str) -> None:
        """Show that `fraction` of the phase is done, and `figures` beside it."""
        self._progress.update(self._task, completed=min(max(fraction, 0.0), 1.0), figures=figures)

    def say(self, text: str) -> None:
        """A line above the progress."""
        self.console.print(text, highlight=False)


class Interrupt:
    """Turns Ctrl-C and SIGTERM into a flag that a run looks at between steps; a second Ctrl-C stops at once."""

    def __init__(self) -> None:
        self.received = False
        self._old: dict[int, Any] = {}

    def __enter__(self) -> Interrupt:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                self._old[number] = signal.signal(number, self._note)
        return self

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.received and number == signal.SIGINT:
            raise KeyboardInterrupt
        self.received = True

    def __exit__(self, *_: object) -> None:
        for number, handler in self._old.items():
            signal.signal(number, handler)
