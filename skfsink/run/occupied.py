"""One run in a folder at a time: a lock of the system, which it releases when the process ends, however that ends."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from ..errors import OutputError
from ..system.files import HIDDEN, prepare_folder

__all__ = ["Holder", "occupied"]

LOCK, HOLDER = HIDDEN  # the file that is locked, and what is known of who has locked it


@dataclass(frozen=True)
class Holder:
    """The process that is, or was when it was killed, in a folder.

    Attributes
    ----------
    process: its number.   host: name of its machine.   since: when it came, in ISO 8601 with the zone.
    """

    process: int
    host: str
    since: str

    @classmethod
    def read(cls, folder: Path) -> Holder | None:
        """That of a folder; None if there is none, or it is not known."""
        try:
            found = json.loads((folder / HOLDER).read_text(encoding="utf-8"))
            return cls(int(found["process"]), str(found["host"]), str(found["since"]))
        except (OSError, ValueError, KeyError, TypeError):
            return None

    @property
    def alive(self) -> bool | None:
        """Whether the process goes on; None if it is one of another machine. One of the same number that came later is
        another."""
        import psutil  # only those who look at runs of others need it

        if self.host != platform.node():
            return None
        try:
            came = psutil.Process(self.process).create_time()
            return came < datetime.fromisoformat(self.since).timestamp() + 1.0
        except (psutil.Error, ValueError, OverflowError):
            return False


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
        raise OutputError(f"{folder} is in use by another run ({_holder(folder)}): wait for it, stop it, or take "
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


def _holder(folder: Path) -> str:
    found = Holder.read(folder)
    return "its process is not known" if found is None else \
        f"process {found.process} on {found.host}, since {found.since}"
