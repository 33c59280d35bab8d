"""What was computed: parameters with their meaning, what differs between runs, and the command that does it again."""

from __future__ import annotations

import importlib
import inspect
import shlex
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import fields
from typing import Any

import docstring_parser

from ..results.loader import Run
from ..scene.options import Options
from ..scene.tables import TABLES
from .tables import EMPTY, Row, Table

__all__ = ["command_line", "differences", "meanings", "parameter_table", "run_labels"]

_LABELS = {"dynamic": "dynamic", "quasistatic": "quasi-static"}


def _shown(value: Any) -> str:
    if isinstance(value, Mapping):  # a grip, a traction, a region
        return ", ".join(f"{name} {_shown(item)}" for name, item in value.items())
    if isinstance(value, list | tuple):
        return "; ".join(map(_shown, value)) or EMPTY
    return EMPTY if value in (None, "") else "yes" if value is True else "no" if value is False else \
        f"{value:g}" if isinstance(value, float) else str(value)


def _defaults(case: str) -> dict[str, Any]:
    options = {**{f.name: getattr(Options(), f.name) for f in fields(Options)}, **Options().parameters()}
    try:
        function = getattr(importlib.import_module(f"skfsink.cases.{case}"), case)
    except (ImportError, AttributeError):
        return options
    return {**options, **{name: p.default for name, p in inspect.signature(function).parameters.items()}}


def meanings(case: str) -> dict[str, str]:
    """What the parameters of a case are, with unit and range, from the docstrings that `--help` shows."""
    found = _described(Options)
    with suppress(ImportError, AttributeError):
        found |= _described(getattr(importlib.import_module(f"skfsink.cases.{case}"), case))
    return found


def _described(documented: Any) -> dict[str, str]:
    parsed = docstring_parser.parse(documented.__doc__ or "")
    return {item.arg_name: " ".join((item.description or "").split()) for item in parsed.params}


def parameter_table(run: Run) -> Table:
    """All parameters of a run beside their defaults."""
    defaults, said = _defaults(run.case), meanings(run.case)
    rows = tuple(Row(name, said.get(name, ""), (
        _shown(value), _shown(defaults[name]) if name not in TABLES and defaults.get(name, value) != value else ""))
        for name, value in run.parameters.items())
    return Table("Parameters", ("value", "default, where it differs"), rows)


def differences(runs: Sequence[Run], labels: Sequence[str]) -> Table:
    """The parameters in which runs differ."""
    names = list(dict.fromkeys(["case", *(name for run in runs for name in run.parameters)]))
    said: dict[str, str] = {}
    for run in runs:
        said = {**meanings(run.case), **said}
    rows = []
    for name in names:
        values = [run.case if name == "case" else run.parameters.get(name) for run in runs]
        if any(value != values[0] for value in values):
            rows.append(Row(name, said.get(name, ""), tuple(map(_shown, values))))
    return Table("Parameters that differ", tuple(labels), tuple(rows))


def command_line(run: Run) -> str:
    """The command that computes the run again: all parameters that are not the defaults, or the deck it has left."""
    if run.case == "custom":
        return shlex.join(["skfsink", "run", str(run.folder / "scene.toml"), "--out", "FOLDER"])
    defaults = _defaults(run.case)
    words = []
    for name, value in run.parameters.items():
        flag = name.replace("_", "-")
        if name in defaults and defaults[name] == value:
            continue
        words += [f"--{flag}"] if value is True else [f"--no-{flag}"] if value is False else [f"--{flag}", str(value)]
    return shlex.join(["python", "-m", f"skfsink.cases.{run.case}", *words])


def run_labels(runs: Sequence[Run]) -> list[str]:
    """A short name for each run: the end of its path, as long as it must be to be the only one."""
    if len(runs) == 2 and [run.folder.name for run in runs] == list(_LABELS) and \
            runs[0].folder.parent == runs[1].folder.parent:
        return list(_LABELS.values())
    paths = [run.folder.absolute().parts for run in runs]
    for depth in range(1, max(map(len, paths)) + 1):
        labels = ["/".join(parts[-depth:]) for parts in paths]
        if len(set(labels)) == len(labels):
            return labels
    return [f"{label} ({i + 1})" for i, label in enumerate(labels)]
