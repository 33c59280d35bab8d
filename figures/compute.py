"""Runs of the cases by their documented command line, each in a process of its own, and resumed where they stopped."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

from runs import COARSE, Run

from skfsink.errors import OutputError, SkfsinkError
from skfsink.results import reference
from skfsink.run.compute import SUMMARY
from skfsink.scene.stored import SCENE
from skfsink.system.files import write_atomic

__all__ = ["compute", "finish", "in_parallel"]

ROOT = Path(__file__).resolve().parents[1]
Item = TypeVar("Item")


def finish(case: str, arguments: Sequence[str], folder: Path) -> Path:
    """Run a case to its end in `folder`: nothing is done if it is there already, and an interrupted run goes on.

    Raises
    ------
    OutputError
        The run failed, or the folder holds one with other arguments.
    """
    command = [sys.executable, "-m", f"skfsink.cases.{case}", *arguments]
    note, text = folder.with_name(folder.name + ".command"), shlex.join([case, *arguments]) + "\n"
    begun = (folder / SCENE).exists()
    if begun and (found := note.read_text() if note.exists() else "unknown arguments") != text:
        raise OutputError(f"{folder} holds a run of {found.strip()}, and not of {text.strip()}: remove it to run again")
    if begun and (folder / SUMMARY).exists():
        return folder
    folder.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(note, text)
    where = ["--resume", str(folder)] if begun else ["--out", str(folder), "--overwrite"]
    print(f"{'resuming' if begun else 'running'} {text.strip()}", flush=True)
    log = folder.with_name(folder.name + ".log")
    with open(log, "a", encoding="utf-8") as file:
        status = subprocess.run([*command, *where, "--quiet"], stdout=file, stderr=subprocess.STDOUT, check=False,
                                cwd=ROOT, env={**os.environ, "OMP_NUM_THREADS": "1"}).returncode
    if status:
        last = (log.read_text(encoding="utf-8", errors="replace").strip().splitlines() or ["no message"])[-1]
        raise OutputError(f"{text.strip()} ended with status {status}: {last}")
    return folder


def compute(runs: Sequence[Run], jobs: int) -> list[str]:
    """Finish the runs, `jobs` at a time, and store their references; returns a line for each that failed."""

    def one(run: Run) -> None:
        folder = finish(run.case, run.arguments, ROOT / "results" / "reference" / run.case / run.key)
        if run.key == COARSE:
            stored = reference.store_coarse(folder, run.case)
        else:
            target = reference.reference_folder(run.case, run.key)
            stored = reference.store(folder, target, run.frames, run.velocity)
        print(f"stored {stored}", flush=True)

    return in_parallel(one, runs, jobs)


def in_parallel(work: Callable[[Item], None], items: Sequence[Item], jobs: int) -> list[str]:
    """Do the work on each item, `jobs` at a time; returns what went wrong, a line for each item that failed."""

    def guarded(item: Item) -> str:
        try:
            work(item)
            return ""
        except SkfsinkError as error:
            return str(error)

    pool = ThreadPoolExecutor(jobs)
    try:
        return [line for line in pool.map(guarded, items) if line]
    finally:
        pool.shutdown(cancel_futures=True)  # after Ctrl-C, which ends the runs under way, none begins
