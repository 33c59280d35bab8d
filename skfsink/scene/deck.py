"""Decks: scenes as TOML files, with units. The `scene.toml` that a run writes is one.

    case = "single_edge_notch"

    [parameters]
    side = "5 mm"
    notch = 1.5                  # a plain number: N, mm, MPa, s; density in kg/m^3
    density = "1433 kg/m^3"
    mesh = "coarse"              # or a mesh file, sought from the deck's folder

A `custom` scene also has tables [[grips]], [[tractions]], [[body_forces]] and [[regions]] (see :mod:`.tables`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import tomli_w

from ..errors import ParameterError, first_line
from ..system.files import path_of
from ..system.text import read_toml
from .case import Case
from .options import Options
from .registry import CASES, find_case
from .scene import Scene
from .stored import TABLES, tables_beside
from .tables import beside

__all__ = ["Deck", "read_deck"]

#: keys of a deck; the last four a run says of itself
TOP = ("case", "parameters", "source", "assumed", "choice", "made_in_python")
OUTPUT = ("out", "overwrite", "quiet", "resume", "partition", "frame_pieces",
          "observers")  # options of a run, which no deck has
LARGEST = 1_000_000  # bytes


@dataclass(frozen=True)
class Deck:
    """A scene as it was asked for: a case, and the parameters that differ from their defaults."""

    case: str
    parameters: Mapping[str, Any]

    def run(self, **changes: Any) -> Any:
        """Run it, to a :class:`.Result`.

        Parameters
        ----------
        changes: options that no deck has (out, overwrite, quiet, resume, partition, frame_pieces, observers), and
            parameters or tables in place of the deck's, as :meth:`changed` takes them.

        Raises
        ------
        SkfsinkError
            What is wrong with the deck, the folder or the run, in one line.
        """
        output = {name: changes.pop(name) for name in OUTPUT if name in changes}
        arguments, options = self.changed(**changes).check()
        return find_case(self.case).function(**arguments, options=replace(options, **output))

    def scene(self, **changes: Any) -> Scene:
        """The scene it asks for, with its mesh; `changes` are as :meth:`changed` takes them."""
        case = find_case(self.case)
        arguments, options = self.changed(**changes).check()
        return case.scene({**case.default_arguments, **arguments}, options)

    def changed(self, **parameters: Any) -> Deck:
        """The deck with other parameters: numbers, text with a unit, tables (`grips=[...]`), or a function as `stop`.

        A path of a mesh is sought from the current folder.

        Raises
        ------
        ParameterError
            There is no such parameter, or it has no such value.
        """
        case = find_case(self.case)
        if unknown := [name for name in parameters if name not in case.parameters]:
            raise ParameterError(f"{unknown[0]!r} is no parameter of {self.case}; `skfsink show {self.case}` lists "
                                 f"them, and a run takes {', '.join(OUTPUT)} besides")
        return replace(self, parameters={**self.parameters, **_read(case, parameters)})

    def check(self) -> tuple[dict[str, Any], Options]:
        """The arguments of the case function, those of the sample and the options; the latter are checked.

        Raises
        ------
        ParameterError
            There is no such case, no such parameter, or it has no such value.
        """
        case = find_case(self.case)
        arguments, values = case.divide(_read(case, self.parameters))
        return arguments, replace(Options(), **values, given_names=frozenset(self.parameters))

    def toml(self) -> str:
        """Its text."""
        return tomli_w.dumps({"case": self.case, **tables_beside(self.parameters)})


def _read(case: Case, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Values of parameters as :meth:`.Case.read` gives them; a path is text, and a function as `stop` is kept."""
    functions = {name: value for name, value in parameters.items() if name == "stop" and callable(value)}
    named = {name: str(value) if isinstance(value, Path) else value for name, value in parameters.items()
             if name not in functions}
    return {**case.read(named), **functions}


def read_deck(path: str | Path) -> Deck:
    """Read a deck.

    Raises
    ------
    ParameterError
        One line: the file is no deck, or it has a parameter, a unit or a value that cannot be.
    """
    path = path_of("the path of a deck", path)
    try:
        if not path.is_file():
            raise ParameterError(f"there is no deck {path}")
        if path.stat().st_size > LARGEST:
            raise ParameterError(f"{path} is no deck: it has more than {LARGEST:,} bytes")
        data = read_toml(path)
    except (OSError, ValueError, RecursionError) as error:
        raise ParameterError(f"{path} is no deck: {first_line(error)}") from None
    try:
        deck = _deck({key: beside(value, path.parent) if key in TABLES else value for key, value in data.items()})
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from None
    if Path(mesh := deck.parameters.get("mesh", "")).suffix:
        mesh = str((path.parent / path_of("mesh", mesh)).absolute())
        return replace(deck, parameters={**deck.parameters, "mesh": mesh})
    return deck


def _deck(data: Mapping[str, Any]) -> Deck:
    """The deck in the content of a file."""
    name, parameters = data.get("case"), data.get("parameters", {})
    if not isinstance(name, str) or not isinstance(parameters, dict):
        raise ParameterError(f"case must be a name, one of {', '.join(CASES)}, and parameters a table")
    case = find_case(name)
    top = (*TOP, *case.tables)
    if unknown := [key for key in data if key not in top]:
        beneath = "; it belongs under [parameters]" if unknown[0] in case.parameters else ""
        raise ParameterError(f"unknown key {unknown[0]!r}; the keys are {', '.join(top)}{beneath}")
    if parts := data.get("made_in_python"):
        raise ParameterError(f"it does not describe its run, parts of which were made in Python "
                             f"({', '.join(map(str, parts))}): run it again from there")
    if twice := parameters.keys() & {*TABLES}:
        raise ParameterError(f"{min(twice)} are tables beside the parameters: [[{min(twice)}]]")
    return Deck(name, case.read({**parameters, **{table: data.get(table, ()) for table in case.tables}}))
