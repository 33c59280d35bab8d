"""Checkpoints: everything a run needs to go on to the same result, in one file that is replaced atomically."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np

from .._version import __version__
from ..errors import CheckpointError
from ..fields.state import State
from ..system.files import write_atomic

__all__ = ["load_checkpoint", "load_state", "save_checkpoint", "save_state"]


def save_checkpoint(path: Path, fingerprint: str, state: State, memories: dict[str, dict[str, np.ndarray]],
                    extra: dict[str, Any]) -> None:
    """Write the state, the memories of the integrator and trackers (arrays by name), and `extra` (JSON)."""
    fields, values = state.stored()
    arrays = {f"state/{k}": v for k, v in fields.items()}
    arrays |= {f"{owner}/{k}": v for owner, memory in memories.items() for k, v in memory.items()}
    meta = {"version": __version__, "fingerprint": fingerprint, "state": values, "extra": extra}
    arrays["meta"] = np.frombuffer(json.dumps(meta).encode(), np.uint8)
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    write_atomic(path, buffer.getvalue())


def load_checkpoint(path: Path, fingerprint: str) -> tuple[State, dict[str, dict[str, np.ndarray]], dict[str, Any]]:
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
    if found not in (fingerprint, fingerprint.partition("-")[0]):  # the latter is of an earlier version
        raise CheckpointError(f"the checkpoint {path} belongs to another scene than scene.toml beside it")
    memories: dict[str, dict[str, np.ndarray]] = {}
    for key, value in arrays.items():
        owner, name = key.split("/", 1)
        memories.setdefault(owner, {})[name] = value
    try:
        return State.restored(memories.pop("state"), meta["state"]), memories, meta["extra"]
    except (KeyError, TypeError) as error:
        raise CheckpointError(f"the checkpoint {path} is damaged: {error} is missing") from None


def save_state(path: Path, fingerprint: str, state: State) -> None:
    """Write a state alone, such as the onset."""
    save_checkpoint(path, fingerprint, state, {}, {})


def load_state(path: Path, fingerprint: str) -> State:
    """Read what :func:`save_state` wrote."""
    return load_checkpoint(path, fingerprint)[0]
