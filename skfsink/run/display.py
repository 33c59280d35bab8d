"""What a person sees while a run goes on: its phase, how far it is, the time left, and the figures that matter."""

from __future__ import annotations

import _thread
import signal
import threading
import time
from collections import deque
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any

from rich.console import Console, Group
from rich.live import Live
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.text import Text

__all__ = ["Display", "Interrupt"]


class Display:
    """A progress line a phase with the figures below it; a line every ten seconds where there is no terminal.

    Memory: the phase begun last, which `update` shows and `phase` ends, and the last lines, to which `say` adds;
    `status` gives both.

    Attributes
    ----------
    changed: called after each change of what is shown.
    """

    LOG_EVERY = 10.0  # seconds
    LINES = 40        # that are kept

    def __init__(self, quiet: bool = False) -> None:
        self.console = Console(stderr=True, quiet=quiet)
        self._quiet = quiet
        self._progress = Progress(
            TextColumn("[bold]{task.description:<12}"), BarColumn(24), TextColumn("{task.percentage:>3.0f} %"),
            TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn(), console=self.console)
        self._figures = Text(style="cyan")
        self._live = Live(Group(self._progress, self._figures), console=self.console, refresh_per_second=4)
        self._task: Any = None
        self._phase, self._begun = "", time.time()
        self._logged = 0.0
        self._lines: deque[str] = deque(maxlen=self.LINES)
        self.changed: Callable[[], None] = lambda: None

    def __enter__(self) -> Display:
        if self.console.is_terminal and not self._quiet:
            self._live.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None,
                 trace: TracebackType | None) -> None:
        self._figures.plain = ""
        self._live.stop()

    def phase(self, name: str) -> None:
        """Begin a new phase."""
        if self._task is not None:
            self._progress.update(self._task, completed=1.0)
            self._progress.stop_task(self._task)
        self._task = self._progress.add_task(name, total=1.0)
        self._phase, self._begun, self._figures.plain = name, time.time(), ""
        if not self.console.is_terminal:
            self.say(name)
        else:
            self._note(name)

    def update(self, fraction: float, figures: str) -> None:
        """Show that `fraction` of the phase is done, and `figures` below it; nothing before the first one."""
        if self._task is None:
            return
        fraction = min(max(fraction, 0.0), 1.0)
        self._progress.update(self._task, completed=fraction)
        self._figures.plain = figures
        if time.monotonic() - self._logged > self.LOG_EVERY:
            self._logged = time.monotonic()
            line = f"{self._phase} {fraction:.0%}  {figures}"
            if self.console.is_terminal:
                self._note(line)
            else:
                self.say(line)
        self.changed()

    def say(self, text: str) -> None:
        """A line above the progress."""
        self.console.print(text, highlight=False, markup=False, soft_wrap=True)
        self._note(text)

    def _note(self, line: str) -> None:
        self._lines.append(line)
        self.changed()

    def status(self) -> dict[str, Any]:
        """What is shown now: the phase, when it began [s since 1970], how far it is, its time left [s] if that can be
        told, the figures, and the last lines."""
        task = next((task for task in self._progress.tasks if task.id == self._task), None)
        return {"phase": self._phase, "phase_began": self._begun, "fraction": task.completed if task else 0.0,
                "left_s": task.time_remaining if task else None, "figures": self._figures.plain,
                "lines": list(self._lines)}


class Interrupt:
    """Turns Ctrl-C and SIGTERM into a flag that a run looks at between steps.

    A second Ctrl-C stops at once; so does a step that goes on for `PATIENCE` after the first: its KeyboardInterrupt
    leaves the checkpoint that was written last.

    Memory: whether a signal was `received`, which `heeded` tells.
    """

    PATIENCE = 5.0  # seconds

    def __init__(self) -> None:
        self.received = False
        self._old: dict[int, Any] = {}
        self._timer = threading.Timer(self.PATIENCE, _thread.interrupt_main)
        self._timer.daemon = True

    def __enter__(self) -> Interrupt:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                self._old[number] = signal.signal(number, self._note)
        return self

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.received and number == signal.SIGINT:
            raise KeyboardInterrupt
        if not self.received:
            self.received = True
            self._timer.start()

    def heeded(self) -> bool:
        """Whether to stop; the caller is about to, and will not be hurried any more."""
        if self.received:
            self._timer.cancel()
        return self.received

    def __exit__(self, *_: object) -> None:
        self._timer.cancel()
        for number, handler in self._old.items():
            signal.signal(number, handler)
