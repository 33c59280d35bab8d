"""Checkpoints: everything a run needs to go on to the same result, in one file that is replaced atomically."""

from __future__ import annotations

import io
import json
import shlex
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import CheckpointError, ParameterError, first_line
from ..fields.state import State
from ..scene.stored import SCENE
from ..system.files import write_atomic
from ..system.version import __version__

__all__ = ["CHECKPOINT", "Stored", "check_version", "load_checkpoint", "load_state", "save_checkpoint", "save_state",
           "storable"]

CHECKPOINT = "checkpoint.npz"
PLAIN = (bool, int, float, str, type(None))  # what JSON gives back as it was, beside lists and dicts


class Stored(NamedTuple):
    """What a checkpoint holds: the state, and by its owner what each part of the run remembers."""

    state: State
    memories: dict[str, dict[str, Any]]


def save_checkpoint(path: Path, fingerprint: str, state: State, memories: Mapping[str, Mapping[str, Any]]) -> None:
    """Write the state, and the memories of integrator, observers and others: what is :func:`storable`."""
    fields, values = state.stored()
    arrays = {f"state/{name}": value for name, value in fields.items()}
    plain: dict[str, dict[str, Any]] = {}
    for owner, memory in memories.items():
        content = storable(owner, memory)
        plain[owner] = {name: value for name, value in content.items() if not isinstance(value, np.ndarray)}
        arrays |= {f"{owner}/{name}": value for name, value in content.items() if isinstance(value, np.ndarray)}
    meta = {"version": __version__, "fingerprint": fingerprint, "state": values, "memories": plain}
    arrays["meta"] = np.frombuffer(json.dumps(meta).encode(), np.uint8)
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    write_atomic(path, buffer.getvalue())


def storable(owner: str, memory: Mapping[str, Any]) -> dict[str, Any]:
    """A memory as a checkpoint gives it back: arrays of numbers, and plain values: numbers, text, lists, dicts.

    Numbers of numpy have become plain ones, and tuples lists.

    Raises
    ------
    ParameterError
        Something in it is none of these, or would come back as something else; the line names `owner` and attribute.
    """
    content = {}
    for name, value in memory.items():
        try:
            content[name] = value if type(value) is np.ndarray and not value.dtype.hasobject else _plain(value)
        except (TypeError, RecursionError) as error:
            what = str(error) if isinstance(error, TypeError) else "lists in lists without end"
            raise ParameterError(f"the {owner} keeps {name} with {what}, which a checkpoint cannot give back: keep "
                                 f"numbers, text, lists, dicts whose keys are text, or arrays of numbers (none in "
                                 f"lists)") from None
    return content


def _plain(value: Any) -> Any:
    """A value with plain numbers and lists in it; TypeError, which says what, if JSON would lose or change another."""
    kind = type(value)
    if kind in PLAIN:
        return value
    if kind in (list, tuple):
        return [_plain(item) for item in value]
    if kind is dict:
        if odd := [key for key in value if type(key) is not str]:
            raise TypeError(f"the key {odd[0]!r:.80} of a dict")
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, np.generic) and type(number := value.item()) in PLAIN:
        return number
    if isinstance(value, np.ndarray):
        raise TypeError("an array of objects" if value.dtype.hasobject else "an array in a list or a dict"
                        if kind is np.ndarray else f"an array of the class {kind.__name__}")
    raise TypeError(f"a value of the type {kind.__name__}")


def load_checkpoint(path: Path, fingerprint: str) -> Stored:
    """What :func:`save_checkpoint` wrote.

    Raises
    ------
    CheckpointError
        The file is missing, damaged, or was made by another scene or version.
    """
    if not path.is_file():
        raise CheckpointError(f"there is no checkpoint {path}")
    with _undamaged(path), np.load(path, allow_pickle=False) as data:
        arrays = {name: data[name] for name in data.files}
        meta = json.loads(arrays.pop("meta").tobytes())
        version, found = meta["version"], meta["fingerprint"]
    _refuse_version(version, path.parent)
    if found != fingerprint:
        raise CheckpointError(f"the checkpoint {path} belongs to another scene than scene.toml beside it")
    try:
        memories: dict[str, dict[str, Any]] = {**meta["memories"], "state": {}}
        for key, value in arrays.items():
            owner, name = key.rsplit("/", 1)
            memories[owner][name] = value
        return Stored(State.restored(memories.pop("state"), meta["state"]), memories)
    except (KeyError, TypeError) as error:
        raise CheckpointError(f"the checkpoint {path} is damaged: {error} is missing") from None


def check_version(folder: Path) -> None:
    """Refuse to go on with the run in a folder if another version has written it (CheckpointError).

    A run of both analyses has its checkpoints in the folders of these; a missing one is for who reads it to refuse.
    """
    for path in (folder / CHECKPOINT, *(folder / part / CHECKPOINT for part in ("dynamic", "quasistatic"))):
        if path.is_file():
            with _undamaged(path), np.load(path, allow_pickle=False) as data:
                version = json.loads(data["meta"].tobytes())["version"]
            _refuse_version(version, folder)


def _refuse_version(version: str, folder: Path) -> None:
    """Refuse what another version has written in the folder of a run."""
    if version != __version__:
        raise CheckpointError(f"the run in {folder} was written by skfsink {version}, this is {__version__}, which "
                              f"cannot go on with it: start anew with skfsink run "
                              f"{shlex.quote(str(folder / SCENE))}")


@contextmanager
def _undamaged(path: Path) -> Iterator[None]:
    """Whatever goes wrong while a checkpoint is read is a CheckpointError."""
    try:
        yield
    except Exception as error:
        raise CheckpointError(f"the checkpoint {path} is damaged: {first_line(error)}") from None


def save_state(path: Path, fingerprint: str, state: State) -> None:
    """Write a state alone, such as the onset."""
    save_checkpoint(path, fingerprint, state, {})


def load_state(path: Path, fingerprint: str) -> State:
    """Read what :func:`save_state` wrote."""
    return load_checkpoint(path, fingerprint).state
