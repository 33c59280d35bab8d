"""A case: a function that people call, the scene it makes, and its parameters with their units and meanings."""

from __future__ import annotations

import difflib
import inspect
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Any

from docstring_parser import parse

from ..errors import MeshError
from ..system.shipped import data_folder
from ..units import kind_and_unit
from .options import OUTSIDE_A_DECK, Options
from .scene import Scene
from .stored import TABLES, StoredScene
from .tables import read_tables
from .typed import Mistake, Record

__all__ = ["Case", "CaseParameter", "shared_parameters"]

#: parameters that a scene.toml of an earlier version has not; they take their defaults
NEWER = ("merge_nodes", "pressures", "fillings", "body_forces", "velocities", "event_at", "fibres")


@dataclass(frozen=True)
class CaseParameter:
    """A parameter of a case, as its annotation, its default and its docstring have it.

    Attributes
    ----------
    name: in Python and in decks.
    annotation: of the function, or of :class:`.Options`: its type is the `kind`, and it may have a `unit` such as "mm";
        that of pure numbers, and of what is no number, is "".
    default: of the case function, or of :class:`.Options`.
    meaning: one sentence, with unit and range.
    shared: whether all cases have it (a field of :class:`.Options`), or it belongs to the sample.
    """

    name: str
    annotation: Any
    default: Any
    meaning: str
    shared: bool

    @property
    def kind(self) -> Any:
        """Type of the value."""
        return kind_and_unit(self.annotation)[0]

    @property
    def unit(self) -> str:
        """What the number is measured in."""
        return kind_and_unit(self.annotation)[1]

    @property
    def has_tables(self) -> bool:
        """Whether its value is a sequence of tables, as grips and regions are."""
        return self.name in TABLES


@dataclass(frozen=True)
class Case:
    """A case: all that the program knows of it.

    Parameters
    ----------
    function: that people call; its signature and docstring are the command line and its help.
    scene: makes the scene from the arguments of the function (all but `options`) and the options.
    refused: names of shared parameters that have no meaning in it; `scene`, or the function, refuses other values than
        their defaults, and `skfsink show` leaves them out.
    """

    function: Callable[..., Any]
    scene: Callable[[dict[str, Any], Options], Scene]
    refused: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Of the function, its module and its folder in `cases`."""
        return self.function.__name__

    @property
    def summary(self) -> str:
        """What it is, in a sentence."""
        return parse(self.function.__doc__ or "").short_description or ""

    @property
    def description(self) -> str:
        """What it is, in all its sentences."""
        text = parse(self.function.__doc__ or "")
        return " ".join(f"{text.short_description or ''} {text.long_description or ''}".split())

    @property
    def meshes(self) -> tuple[str, ...]:
        """Names of the meshes that come with the program, in alphabetical order; none where it takes mesh files."""
        try:
            return tuple(sorted(path.stem for path in (data_folder(self.name) / "meshes").glob("*.vtu")))
        except MeshError:
            return ()

    @cached_property
    def parameters(self) -> Mapping[str, CaseParameter]:
        """Every parameter that a deck may have, by name; those of the sample come first."""
        return {**{p.name: p for p in self.arguments}, **shared_parameters()}

    @cached_property
    def arguments(self) -> tuple[CaseParameter, ...]:
        """Those of the sample: the arguments of the function but for `options`."""
        meanings, signature = _meanings(self.function), inspect.signature(self.function, eval_str=True)
        return tuple(CaseParameter(name, argument.annotation, argument.default, meanings.get(name, ""), shared=False)
                     for name, argument in signature.parameters.items() if name != "options")

    @property
    def defaults(self) -> dict[str, Any]:
        """Default of every parameter."""
        return {name: parameter.default for name, parameter in self.parameters.items()}

    @property
    def default_arguments(self) -> dict[str, Any]:
        """Arguments of the function by default."""
        return {parameter.name: parameter.default for parameter in self.arguments}

    @cached_property
    def _record(self) -> Record:
        known = {name: parameter.annotation for name, parameter in self.parameters.items() if not parameter.has_tables}
        return Record(known, partial(_message, self.name, tuple(known)))

    def read(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Values of parameters from a deck: text with a unit becomes a number in the unit of the parameter.

        Raises
        ------
        ParameterError
            There is no such parameter, or it has no such value.
        """
        plain = self._record.read({name: value for name, value in values.items() if name not in self.tables})
        tables = {name: read_tables(name, values[name]) for name in self.tables if name in values}
        return {name: {**plain, **tables}[name] for name in values}

    @property
    def tables(self) -> tuple[str, ...]:
        """Names of the parameters that are tables."""
        return tuple(p.name for p in self.arguments if p.has_tables)

    def divide(self, parameters: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        """The arguments of the function that are among the parameters, and the rest: values of options."""
        names = self.default_arguments
        return ({name: parameters[name] for name in names if name in parameters},
                {name: value for name, value in parameters.items() if name not in names})

    @property
    def newer(self) -> dict[str, Any]:
        """Arguments that a scene.toml of an earlier version has not, at their defaults."""
        return {name: default for name, default in self.default_arguments.items() if name in NEWER}

    def from_stored(self, stored: StoredScene, folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
        """The arguments of the function and the values of options of the run in a folder.

        Raises
        ------
        KeyError
            An argument of the function is not there.
        """
        arguments, values = self.divide(stored.parameters_in(folder))
        return {name: {**self.newer, **arguments}[name] for name in self.default_arguments}, values


def _message(case: str, known: Sequence[str], mistake: Mistake, values: Mapping[str, Any]) -> str:
    if mistake.unknown:
        near = difflib.get_close_matches(mistake.field[:60].lower().replace("-", "_"), known, 1, 0.75)
        return (f"{mistake.field!r} is no parameter; {f'{near[0]!r} is one, and ' if near else ''}`skfsink show "
                f"{case}` lists them")
    if mistake.field == "mesh" and isinstance(mistake.value, str):
        return mistake.text + r": for \ in a path write /, or put the path in single quotes"
    return mistake.text


@cache
def shared_parameters() -> Mapping[str, CaseParameter]:
    """The parameters that all cases have, by name: the options that a deck may have."""
    annotations, meanings = typing.get_type_hints(Options, include_extras=True), _meanings(Options)
    return {f.name: CaseParameter(f.name, annotations[f.name], f.default, meanings[f.name], shared=True)
            for f in fields(Options) if f.name not in OUTSIDE_A_DECK}


def _meanings(documented: Any) -> dict[str, str]:
    """Meaning of each parameter in a docstring, on one line."""
    described = parse(documented.__doc__ or "").params
    return {item.arg_name: " ".join((item.description or "").split()) for item in described}
