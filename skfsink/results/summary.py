"""The summary of a run: `summary.json`."""

from __future__ import annotations

import json
import math
import platform
import re
from collections.abc import Mapping
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import OutputError
from ..system.files import write_atomic
from ..system.version import __version__

__all__ = ["SUMMARY", "read_summary", "versions", "write_summary"]

SUMMARY = "summary.json"


def write_summary(path: str | Path, summary: Mapping[str, Any], rows: bool = False) -> None:
    """Write the results of a run as JSON, arrays as lists. An OutputError names a number that is not finite.

    With `rows` a list of numbers is one line, as are points of a few numbers each.
    """
    text = json.dumps(_plain(summary, "summary"), indent=1, ensure_ascii=False, allow_nan=False)
    if rows:  # no text within quotes has a line break
        for numbers in (r"\[\n[-+.\deE,\s]+\]", r"\[\n(?:\s*\[[-+.\deE, ]{1,60}\],?)+\n\s*\]"):
            text = re.sub(numbers, _one_line, text)
    write_atomic(path, text + "\n")


def _one_line(found: re.Match[str]) -> str:
    return re.sub(r"\s+", " ", found[0]).replace("[ ", "[").replace(" ]", "]")


def read_summary(folder: Path, name: str = SUMMARY) -> dict[str, Any]:
    """The summary of a finished run; OutputError if there is none, or it is damaged."""
    path = folder / name
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(summary, dict) or "case" not in summary:
            raise ValueError("no summary")
        return _as_now(summary)
    except FileNotFoundError:
        raise OutputError(f"{path.parent} holds no finished run: there is no {path.name}") from None
    except (OSError, ValueError) as error:
        raise OutputError(f"{path} is damaged: {error}") from None


def _as_now(summary: dict[str, Any]) -> dict[str, Any]:
    """A summary of schema 1 or 2 under the names of schema 3, where these have changed."""
    for part in (summary, *(summary[name] for name in ("dynamic", "quasistatic") if name in summary)):
        event = part.get("event", {})
        if "first_arrival_sweep" in event:
            event["first_arrival_pass"] = event.pop("first_arrival_sweep")
    return summary


def _plain(value: Any, name: str) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item, f"{name}.{key}") for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist(), name)
    if isinstance(value, list | tuple):
        return [_plain(item, f"{name}[{i}]") for i, item in enumerate(value)]
    if isinstance(value, float) and not math.isfinite(value):
        raise OutputError(f"{name} is {value}: a summary holds finite numbers only")
    return str(value) if isinstance(value, Path) else value


def versions() -> dict[str, str]:
    """Versions of what the results came from, and the machine."""
    found = {"skfsink": __version__, "python": platform.python_version()}
    for package in ("numpy", "scipy", "scikit-fem", "numba", "pyamg", "meshio", "pypardiso"):
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return {**found, "machine": f"{platform.system()} {platform.machine()}"}
