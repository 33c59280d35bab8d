"""Checkpoints: everything a run needs to go on to the same result, in one file that is replaced atomically."""

from __future__ import annotations

import io
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from .._version import __version__
from ..errors import CheckpointError
from ..fields.energy import Ledger
from ..fields.state import State
from ..system.files import write_atomic

__all__ = ["load_checkpoint", "load_state", "save_checkpoint", "save_state"]

_ARRAYS = ("u", "v", "a", "gamma", "W_max", "deleted")


def _state_arrays(state: State) -> dict[str, np.ndarray]:
    times = np.array([t for t, _ in state.deletions])
    elements = np.array([e for _, e in state.deletions], np.int64)
    sink = {} if state.sink is None else {"sink": state.sink}
    return {**{name: getattr(state, name) for name in _ARRAYS}, **sink,
            "deletion_times": times, "deletion_elements": elements}


def _state_scalars(state: State) -> dict[str, Any]:
    return {"grip": state.grip, "time": state.time, "step": state.step, "phase": state.phase,
            "ledger": asdict(state.ledger)}


def _rebuild(arrays: dict[str, np.ndarray], scalars: dict[str, Any]) -> State:
    log = list(zip(arrays["deletion_times"].tolist(), arrays["deletion_elements"].tolist()))
    return State(**{name: arrays[name] for name in _ARRAYS}, sink=arrays.get("sink"), deletions=log,
                 grip=scalars["grip"], time=scalars["time"], step=scalars["step"], phase=scalars["phase"],
                 ledger=Ledger(**scalars["ledger"]))


def save_checkpoint(path: Path, fingerprint: str, state: State, memories: dict[str, dict[str, np.ndarray]],
                    extra: dict[str, Any]) -> None:
    """Write the state, the memories of the integrator and trackers (arrays by name), and `extra` (JSON)."""
    arrays = {f"state/{k}": v for k, v in _state_arrays(state).items()}
    arrays |= {f"{owner}/{k}": v for owner, memory in memories.items() for k, v in memory.items()}
    meta = {"version": __version__, "fingerprint": fingerprint, "state": _state_scalars(state), "extra": extra}
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
        return _rebuild(memories.pop("state"), meta["state"]), memories, meta["extra"]
    except (KeyError, TypeError) as error:
        raise CheckpointError(f"the checkpoint {path} is damaged: {error} is missing") from None


def save_state(path: Path, fingerprint: str, state: State) -> None:
    """Write a state alone, such as the onset."""
    save_checkpoint(path, fingerprint, state, {}, {})


def load_state(path: Path, fingerprint: str) -> State:
    """Read what :func:`save_state` wrote."""
    return load_checkpoint(path, fingerprint)[0]
