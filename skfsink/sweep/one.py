"""One run of a sweep, in a process of its own: `python -m skfsink.sweep.one FOLDER`.

The folder holds `deck.toml`. Whoever runs it holds the lock `run.lock`, which the system releases when the process
ends, however it ends; a second process waits, and finds the run done or takes up its last checkpoint.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from filelock import FileLock

from ..errors import SkfsinkError
from ..run.compute import SUMMARY
from ..scene.deck import read_deck
from ..scene.stored import SCENE
from ..system.files import reported, write_atomic

__all__ = ["DECK", "FAILURE", "RUN", "finished", "run_folder"]

DECK, RUN, LOCK, FAILURE, LOG = "deck.toml", "run", "run.lock", "failure.txt", "starts.log"


def finished(folder: Path) -> bool:
    """Whether the run of a folder has its summary."""
    return (folder / RUN / SUMMARY).is_file()


def run_folder(folder: Path) -> None:
    """Run what the folder's deck says, from its last checkpoint if there is one, unless it is done."""
    with reported(f"cannot write {folder / LOCK}"):
        lock = FileLock(folder / LOCK).acquire()
    with lock:
        if finished(folder):
            return
        (folder / FAILURE).unlink(missing_ok=True)
        run = folder / RUN
        resumed = (run / SCENE).is_file()
        if not resumed and run.exists():
            shutil.rmtree(run)  # killed before there was anything to resume
        with reported(f"cannot write {folder / LOG}"), (folder / LOG).open("a") as log:
            log.write("resumed\n" if resumed else "begun\n")
        deck = read_deck(folder / DECK)
        try:
            deck.run(quiet=True, **({"resume": run} if resumed else {"out": run}))
        except SkfsinkError as error:
            if type(error).__name__ != "Interrupted":
                write_atomic(folder / FAILURE, f"{error}\n")
            raise


def main() -> None:
    """Run the folder of the command line."""
    try:
        run_folder(Path(sys.argv[1]))
    except SkfsinkError as error:
        print("skfsink:", error, file=sys.stderr)
        raise SystemExit(2) from None


if __name__ == "__main__":
    main()
