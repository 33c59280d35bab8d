"""The points of a study in one JSON file that grows with it: a study that was stopped goes on where it was."""

from __future__ import annotations

import json
import os
import shlex
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ..errors import ConvergenceError, InstabilityError, OutputError
from ..results.summary import write_summary
from .machine import machine

__all__ = ["Store"]

SCHEMA = 1


class Store:
    """Points of a study by key, in a file that is replaced as a whole after each.

    Memory: the `points` so far: `point` computes each once, `save` writes them all.

    Parameters
    ----------
    path: of the JSON file; its folder is made. A file of the same study, machine and versions is taken up.
    study: name of the study.
    fresh: start anew, whatever is there.

    Attributes
    ----------
    points: the stored points by key, in the order they were computed.

    Raises
    ------
    OutputError
        The file is not one of this study, or was made on another machine or by other versions: its figures must not
        be mixed with those of this one.
    """

    def __init__(self, path: str | Path, study: str, fresh: bool = False) -> None:
        self.path, self.study = Path(path), study
        self.machine = machine()
        self.points: dict[str, dict[str, Any]] = {}
        if self.path.exists() and not fresh:
            stored = self._read()
            for name in ("processor", "cores", "versions"):
                was, now = stored["machine"][name], self.machine[name]
                if was != now:
                    if isinstance(now, dict):
                        name = next(k for k in {**was, **now} if was.get(k) != now.get(k))
                        was, now = was.get(name), now.get(name)
                    raise OutputError(f"{self.path} was measured with {name} {was}, and this is {now}: give --fresh to "
                                      f"measure all points anew, or another --out")
            self.points = stored["points"]
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"cannot make the folder {self.path.parent}: {error.strerror}") from error

    def point(self, key: str, compute: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """The stored point `key`, or that which `compute` gives, stored with its `wall_s` and `cpu_s`.

        Values are those of JSON, and arrays. `compute` may give its own `wall_s` and `cpu_s`. Where it raises a
        ConvergenceError or an InstabilityError, that is the result: `failed` is the message. Any other exception, as
        the KeyboardInterrupt of a Ctrl-C, leaves the file as it is.
        """
        if key not in self.points:
            wall, cpu = time.perf_counter(), _cpu()
            try:
                found = compute()
            except (ConvergenceError, InstabilityError) as error:
                found = {"failed": str(error)}
            self.points[key] = {"wall_s": time.perf_counter() - wall, "cpu_s": _cpu() - cpu, **found}
            try:
                self.save()
            except OutputError:
                del self.points[key]
                raise
            self.points = self._read()["points"]  # the same values whether computed or stored
        return self.points[key]

    def save(self) -> None:
        """Write the file."""
        write_summary(self.path, {"schema": SCHEMA, "study": self.study, "command": _command(sys.orig_argv[1:]),
                                  "machine": self.machine, "points": self.points}, rows=True)

    def _read(self) -> dict[str, Any]:
        try:
            stored = json.loads(self.path.read_text(encoding="utf-8"))
            if stored["study"] != self.study or stored["schema"] != SCHEMA:
                raise KeyError
            return {"machine": {name: stored["machine"][name] for name in ("processor", "cores", "versions")},
                    "points": dict(stored["points"])}
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise OutputError(f"{self.path} is not a file of the study {self.study}: name another --out, or give "
                              f"--fresh to replace it") from error


def _cpu() -> float:
    """Processor time of this process and its ended children [s]."""
    return sum(os.times()[:4])


def _command(words: Sequence[str]) -> str:
    """The command line of a study without what does not change its points: where it writes, and whether it is quiet."""
    kept = [word for word, before in zip(words, ["", *words])
            if word not in ("--out", "--page", "--quiet") and before not in ("--out", "--page")
            and not word.startswith(("--out=", "--page="))]
    return shlex.join(["python", *kept])
