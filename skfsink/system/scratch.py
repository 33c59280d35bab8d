"""Folders for files of the program that are no results; a temporary one where the home folder cannot be written."""

from __future__ import annotations

import logging
import os
import stat
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from pathlib import Path

__all__ = ["first_writable", "is_writable", "place_matplotlib", "temporary_folder"]

log = logging.getLogger(__name__)


@cache
def temporary_folder() -> Path | None:
    """A temporary folder of this user for what all runs on this machine share; a warning names it once in a process.

    Compiled code is read from it. So a folder that others may write to is not taken, and one for this process alone is
    made instead. None where there is no temporary folder either.
    """
    owner = os.getuid() if hasattr(os, "getuid") else 0
    try:
        folder = Path(tempfile.gettempdir()) / f"skfsink-{owner}"
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        status = folder.lstat()
        private = not hasattr(os, "getuid") or (status.st_uid == owner and not status.st_mode & 0o022)
        if not (stat.S_ISDIR(status.st_mode) and private and is_writable(folder)):
            folder = Path(tempfile.mkdtemp(prefix="skfsink-"))
    except OSError:
        log.warning("no folder can be written to keep compiled loops in: they are compiled at every start, which takes "
                    "half a minute; set the environment variable TMPDIR to a folder that can be written")
        return None
    log.warning("the home folder cannot be written: what makes the next start faster is kept in %s; the environment "
                "variables NUMBA_CACHE_DIR and MPLCONFIGDIR name other places", folder)
    return folder


def is_writable(folder: Path) -> bool:
    """Whether a file can be made in a folder, which is made if it is not there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except (OSError, ValueError):
        return False
    return True


def first_writable(folders: Iterable[Path]) -> Path | None:
    """The first folder that can be written, or None."""
    return next((folder for folder in folders if is_writable(folder)), None)


def place_matplotlib() -> None:
    """Let matplotlib, which is imported later, keep its list of fonts in a temporary folder if it cannot at home.

    It would make a new folder in each process otherwise, and look for all fonts again.
    """
    if "MPLCONFIGDIR" in os.environ:
        return
    for variable, default in (("XDG_CONFIG_HOME", "~/.config"), ("XDG_CACHE_HOME", "~/.cache")):
        place = Path(os.environ.get(variable) or os.path.expanduser(default)) / "matplotlib"
        while not os.path.exists(place) and place != place.parent:
            place = place.parent
        if not os.access(place, os.W_OK | os.X_OK):
            if (folder := temporary_folder()) is not None:
                os.environ["MPLCONFIGDIR"] = str(folder / "matplotlib")
            return
