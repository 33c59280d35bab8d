"""Checkpoints: everything a run needs to go on to the same result, in one file that is replaced atomically."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import CheckpointError
from ..fields.state import State
from ..system.files import write_atomic
from ..system.version import __version__

__all__ = ["Stored", "load_checkpoint", "load_state", "save_checkpoint", "save_state"]


class Stored(NamedTuple):
    """What a checkpoint holds: the state, and by its owner what each part of the run remembers."""

    state: State
    memories: dict[str, dict[str, Any]]


def save_checkpoint(path: Path, fingerprint: str, state: State, memories: Mapping[str, Mapping[str, Any]]) -> None:
    """Write the state, and the memories of integrator, observers and others: arrays, and plain values as JSON has."""
    fields, values = state.stored()
    arrays = {f"state/{name}": value for name, value in fields.items()}
    plain: dict[str, dict[str, Any]] = {}
    for owner, memory in memories.items():
        plain[owner] = {name: value for name, value in memory.items() if not isinstance(value, np.ndarray)}
        arrays |= {f"{owner}/{name}": value for name, value in memory.items() if isinstance(value, np.ndarray)}
    meta = {"version": __version__, "fingerprint": fingerprint, "state": values, "memories": plain}
    arrays["meta"] = np.frombuffer(json.dumps(meta).encode(), np.uint8)
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    write_atomic(path, buffer.getvalue())


def load_checkpoint(path: Path, fingerprint: str) -> Stored:
    """What :func:`save_checkpoint` wrote.

    Raises
    ------
    CheckpointError
        The file is missing, damaged, or was made by another scene or version.
    """
    if not path.is_file():
        raise CheckpointError(f"there is no checkpoint {path}")
    try:
        with np.load(path, allow_pickle=False) as data:
            arrays = {name: data[name] for name in data.files}
        meta = json.loads(arrays.pop("meta").tobytes())
        version, found = meta["version"], meta["fingerprint"]
    except Exception as error:
        first = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise CheckpointError(f"the checkpoint {path} is damaged: {first}") from None
    if version != __version__:
        raise CheckpointError(f"the checkpoint {path} was written by skfsink {version}, this is {__version__}")
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


def save_state(path: Path, fingerprint: str, state: State) -> None:
    """Write a state alone, such as the onset."""
    save_checkpoint(path, fingerprint, state, {})


def load_state(path: Path, fingerprint: str) -> State:
    """Read what :func:`save_state` wrote."""
    return load_checkpoint(path, fingerprint).state
