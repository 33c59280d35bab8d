"""One run in a folder at a time: a lock of the system, which it releases when the process ends, however that ends."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path

from ..errors import OutputError
from ..system.files import HIDDEN, prepare_folder

__all__ = ["occupied"]

LOCK, HOLDER = HIDDEN  # the file that is locked, and what is known of who has locked it


@contextmanager
def occupied(folder: Path) -> Iterator[str]:
    """Keep other runs out of a folder, which is made if it is not there; gives a warning if it cannot be locked.

    What was in the folder is there again after an error; nothing of the lock is left otherwise.

    Raises
    ------
    OutputError
        Another run is in it, or it cannot be written to.
    """
    from filelock import FileLock, Timeout  # only runs need it

    prepare_folder(folder, overwrite=True)
    path, holder = folder / LOCK, folder / HOLDER
    there, before = path.exists(), holder.read_bytes() if holder.exists() else None
    lock, warning = FileLock(path, thread_local=False, fallback_to_soft=False), ""
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise OutputError(f"{folder} is in use by another run ({_holder(holder)}): wait for it, stop it, or take "
                          f"another folder") from None
    except (OSError, NotImplementedError) as error:
        reason = getattr(error, "strerror", None) or error
        warning = f"the folder {folder} cannot be locked ({reason}): see to it that no other run writes to it"
    since = datetime.now().astimezone().isoformat(" ", "seconds")
    with suppress(OSError):
        holder.write_text(json.dumps({"process": os.getpid(), "host": platform.node(), "since": since}))
    restored = before
    try:
        yield warning
        there, restored = False, None
    finally:
        with suppress(OSError):
            if restored is None:
                holder.unlink(missing_ok=True)
            else:
                holder.write_bytes(restored)
            if not there and not warning:
                path.unlink(missing_ok=True)  # while it is locked: who waits for it makes a new one
        lock.release()


def _holder(path: Path) -> str:
    try:
        found = json.loads(path.read_text())
        return f"process {int(found['process'])} on {found['host']}, since {found['since']}"
    except (OSError, ValueError, KeyError, TypeError):
        return "its process is not known"
