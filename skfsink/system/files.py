"""Files that a reader finds whole, at any moment and after a kill: the old content or the new, never a part."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..errors import OutputError, ParameterError

__all__ = ["HIDDEN", "path_of", "prepare_folder", "replaced", "reported", "write_atomic"]

HIDDEN = (".lock", ".running")  # files of the lock of a run; a folder that has no others counts as empty


def path_of(name: str, value: object) -> Path:
    """A path, of a Path or a text, `~` for the home folder; `name` says in the error what it is of.

    Raises
    ------
    ParameterError
        It is neither, or there is no such home folder.
    """
    if not isinstance(value, str | os.PathLike):
        raise ParameterError(f"{name} must be a path; got {value!r:.80}")
    try:
        return Path(value).expanduser()
    except RuntimeError:
        raise ParameterError(f"{name}: the home folder in {os.fspath(value)!r:.80} is not known: give the whole path"
                             ) from None


@contextmanager
def reported(failure: str) -> Iterator[None]:
    """Turn an error of the operating system into an OutputError."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"{failure}: {error.strerror or error}") from error


@contextmanager
def replaced(path: str | Path, lasting: bool = True) -> Iterator[Path]:
    """Give the path of a temporary file beside `path`, and put that in its place once the block has filled it.

    One that is not `lasting` may be lost if the machine fails, and takes no time of the disk.

    Raises
    ------
    OutputError
        The file cannot be written. What stood at `path` before is untouched then, as after any other error.
    """
    part = Path(path).with_name(f".{Path(path).name}.part")
    try:
        with reported(f"cannot write {path}"):
            yield part
            if lasting:
                with open(part, "r+b") as file:
                    os.fsync(file.fileno())
            os.replace(part, path)
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def write_atomic(path: str | Path, content: bytes | str, lasting: bool = True) -> None:
    """Write a file so that a reader finds the old content or the new, never a part. Text is UTF-8, lines end in LF.

    `lasting` is as in :func:`replaced`.
    """
    with replaced(path, lasting) as part:
        part.write_bytes(content.encode() if isinstance(content, str) else content)


def prepare_folder(path: str | Path, overwrite: bool = False) -> Path:
    """Make the folder of a run, and try that it can be written to. Nothing in it is ever deleted.

    Raises
    ------
    OutputError
        It is no folder, cannot be written, or has something in it and `overwrite` was not given.
    """
    path = Path(path)
    with reported(f"cannot write to the output folder {path}"):
        if path.exists() and not path.is_dir():
            raise OutputError(f"the output folder {path} is a file")
        path.mkdir(parents=True, exist_ok=True)
        if not overwrite and any(entry.name not in HIDDEN for entry in path.iterdir()):
            raise OutputError(f"the output folder {path} is not empty; name another one, or allow to overwrite it")
        tempfile.TemporaryFile(dir=path).close()
    return path
