"""Decks: scenes as TOML files, with units. The `scene.toml` that a run writes is one.

    case = "single_edge_notch"

    [parameters]
    side = "5 mm"
    notch = 1.5                  # a plain number: N, mm, MPa, s; density in kg/m^3
    density = "1433 kg/m^3"
    mesh = "coarse"              # or a mesh file, sought from the deck's folder

A `custom` scene also has tables [[grips]], [[tractions]] and [[regions]] (see :mod:`.tables`).
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..errors import ParameterError
from ..system.text import read_toml
from ..units import UNITS, number_in
from .options import Options
from .registry import CASES, case_function, parameters_of
from .tables import TABLES, joined, read_tables

__all__ = ["Deck", "read_deck", "read_value"]

TOP = ("case", "parameters", "source", "assumed", "choice")  # the last three a run says of itself; a deck may have them
LARGEST = 1_000_000  # bytes


@dataclass(frozen=True)
class Deck:
    """A scene as it was asked for: a case, and the parameters that are not to have their defaults."""

    case: str
    parameters: Mapping[str, Any]

    def run(self, **output: Any) -> Any:
        """Run it, to a :class:`.Result`; `output` are the options that say where: out, overwrite, quiet, resume."""
        own, options = self.check()
        return case_function(self.case)(**own, options=replace(options, **output))

    def check(self) -> tuple[dict[str, Any], Options]:
        """The arguments of the case function, those of the sample and the options; the latter are checked."""
        names = [name for name in inspect.signature(case_function(self.case)).parameters if name != "options"]
        own = {name: self.parameters[name] for name in names if name in self.parameters}
        shared = {name: value for name, value in self.parameters.items() if name not in names}
        return own, replace(Options(), **shared, given=frozenset(self.parameters))


def read_deck(path: Path) -> Deck:
    """Read a deck.

    Raises
    ------
    ParameterError
        One line: the file is no deck, or it has a parameter, a unit or a value that cannot be.
    """
    try:
        if not path.is_file():
            raise ParameterError(f"there is no deck {path}")
        if path.stat().st_size > LARGEST:
            raise ParameterError(f"{path} is no deck: it has more than {LARGEST:,} bytes")
        data = read_toml(path)
    except (OSError, ValueError, RecursionError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ParameterError(f"{path} is no deck: {reason}") from None
    case, parameters = data.get("case"), data.setdefault("parameters", {})
    top = (*TOP, *TABLES) if case == "custom" else TOP
    if unknown := [key for key in data if key not in top]:
        raise ParameterError(f"{path}: {unknown[0]!r} is none of {', '.join(top)}")
    if not isinstance(case, str) or not isinstance(parameters, dict):
        raise ParameterError(f"{path}: case must be a name, one of {', '.join(CASES)}, and parameters a table")
    try:
        known = parameters_of(case)
        if twice := parameters.keys() & TABLES.keys():
            raise ParameterError(f"{min(twice)} are tables beside the parameters: [[{min(twice)}]]")
        read = {name: read_value(name, value, known) for name, value in joined(data, case == "custom").items()}
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from None
    if "mesh" in read and Path(read["mesh"]).suffix:
        read["mesh"] = str((path.parent / read["mesh"]).absolute())
    return Deck(case, read)


def read_value(name: str, value: Any, known: Mapping[str, Any]) -> Any:
    """The value of a parameter, `known` with its default: text with a unit becomes a number in the parameter's unit.

    Raises
    ------
    ParameterError
        There is no such parameter, or it has no such value.
    """
    if name not in known:
        raise ParameterError(f"{name!r} is no parameter; `skfsink show CASE` lists them")
    default = known[name]
    if name in TABLES:
        return read_tables(name, value)
    if isinstance(default, bool):
        if not isinstance(value, bool):
            raise ParameterError(f"{name} must be true or false; got {value!r}")
        return value
    if isinstance(default, str):
        if not isinstance(value, str) or not value.isprintable():
            path = name == "mesh" and isinstance(value, str)
            raise ParameterError(f"{name} must be text; got {value!r:.80}" + (
                r": for \ in a path write /, or put the path in single quotes" if path else ""))
        return value
    return number_in(name, value, UNITS.get(name, ""))
