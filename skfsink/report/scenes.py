"""What was computed: parameters with their meaning, what differs between runs, and the command that does it again."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import SkfsinkError
from ..results.loader import Run
from ..results.tables import EMPTY, Row, Table
from ..scene.case import CaseParameter, shared_parameters
from ..scene.options import Options
from ..scene.registry import CASES, find_case
from ..scene.stored import SCENE, TABLES

__all__ = ["command_line", "differences", "kind", "meanings", "parameter_table", "path_labels", "run_labels",
           "wave_speeds"]

_LABELS = {"dynamic": "dynamic", "quasistatic": "quasi-static"}


def _shown(value: Any) -> str:
    if isinstance(value, Mapping):  # a grip, a traction, a region
        return ", ".join(f"{name} {_shown(item)}" for name, item in value.items())
    if isinstance(value, list | tuple):
        return "; ".join(map(_shown, value)) or EMPTY
    return EMPTY if value in (None, "") else "yes" if value is True else "no" if value is False else \
        f"{value:g}" if isinstance(value, float) else str(value)


def _parameters(case: str) -> Mapping[str, CaseParameter]:
    """The parameters of a case, or those of all if there is none of that name."""
    return find_case(case).parameters if case in CASES else shared_parameters()


def _defaults(case: str) -> dict[str, Any]:
    return {**{name: parameter.default for name, parameter in _parameters(case).items()}, **Options().parameters()}


def meanings(case: str) -> dict[str, str]:
    """What the parameters of a case are, with unit and range, from the docstrings that `--help` shows."""
    return {name: parameter.meaning for name, parameter in _parameters(case).items()}


def parameter_table(run: Run) -> Table:
    """All parameters of a run beside their defaults."""
    defaults, meaning_of = _defaults(run.case), meanings(run.case)
    rows = tuple(Row(name, meaning_of.get(name, ""), (
        _shown(value), _shown(defaults[name]) if name not in TABLES and defaults.get(name, value) != value else ""))
        for name, value in run.parameters.items())
    return Table("Parameters", ("value", "default, where it differs"), rows)


def differences(runs: Sequence[Run], labels: Sequence[str]) -> Table:
    """The parameters in which runs differ."""
    names = list(dict.fromkeys(["case", *(name for run in runs for name in run.parameters)]))
    meaning_of: dict[str, str] = {}
    for run in runs:
        meaning_of = {**meanings(run.case), **meaning_of}
    rows = []
    for name in names:
        values = [run.case if name == "case" else run.parameters.get(name) for run in runs]
        if any(value != values[0] for value in values):
            rows.append(Row(name, meaning_of.get(name, ""), tuple(map(_shown, values))))
    return Table("Parameters that differ", tuple(labels), tuple(rows))


def command_line(run: Run) -> str:
    """The command that computes the run again: all parameters that are not the defaults, or the deck it has left."""
    if run.case == "custom":
        return shlex.join(["skfsink", "run", str(run.folder / SCENE), "--out", "FOLDER"])
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
    return path_labels([run.folder for run in runs])


def path_labels(folders: Sequence[Path]) -> list[str]:
    """The end of each path, as long as it must be to be the only one."""
    if not folders:
        return []
    paths = [folder.absolute().parts for folder in folders]
    for depth in range(1, max(map(len, paths)) + 1):
        labels = ["/".join(parts[-depth:]) for parts in paths]
        if len(set(labels)) == len(labels):
            return labels
    return [f"{label} ({i + 1})" for i, label in enumerate(labels)]


def kind(run: Run) -> str:
    """The analysis of a run, and the integrator of a dynamic one."""
    if run.analysis == "both":
        return "dynamic and quasi-static"
    return "quasi-static" if run.analysis == "quasistatic" else f"dynamic ({run.parameters.get('integrator')})"


def wave_speeds(run: Run) -> tuple[float, float] | None:
    """Shear and Rayleigh wave speed [m/s] of a dynamic run; None where there is nothing to compare with them."""
    if run.analysis != "dynamic" or run.made_in_python:
        return None
    try:
        parts = run.scene.parts
    except SkfsinkError:  # a mesh file that is gone, for instance
        return None
    if len(parts) > 1:  # each has its own
        return None
    material = parts[0].material
    return material.shear_wave_speed, material.rayleigh_wave_speed
