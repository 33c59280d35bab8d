"""Case functions as people call them: parameters of the sample and all options as keywords, text with units allowed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from functools import wraps
from typing import Any, Protocol, cast

from ..errors import ParameterError
from ..results.result import Result
from ..scene.options import OUTSIDE_A_DECK, Options
from ..scene.registry import find_case
from ..scene.scene import Scene

__all__ = ["CaseFunction", "case_function"]

_OPTIONS = tuple(field.name for field in fields(Options))


class CaseFunction(Protocol):
    """A case function: run the case, or make its scene only."""

    __name__: str

    def __call__(self, **keywords: Any) -> Result:
        """Run it; the keywords are parameters of the sample and :class:`.Options`, by name."""

    def scene(self, **keywords: Any) -> Scene:
        """The scene, with its mesh, that the same call would run."""


def case_function(function: Callable[..., Any]) -> CaseFunction:
    """Let a function with parameters and `options` take the options as keywords as well, and make its scene.

    `single_edge_notch(mesh="coarse", phi="0.2 MPa", quiet=True)` is
    `single_edge_notch(mesh="coarse", options=Options(phi=0.2, quiet=True))`. A keyword comes before the same field of
    `options`. The signature stays, of which command line and decks are made.

    Raises
    ------
    ParameterError
        By the function: there is no parameter or option of that name, or it has no such value.
    """
    name = function.__name__

    @wraps(function)
    def run(**keywords: Any) -> Any:
        arguments, options = _divided(name, keywords)
        return function(**arguments, options=options)

    def scene(**keywords: Any) -> Scene:
        arguments, options = _divided(name, keywords)
        case = find_case(name)
        return case.scene({**case.default_arguments, **arguments}, options)

    run.scene = scene  # type: ignore[attr-defined]
    return cast(CaseFunction, run)


def _divided(name: str, keywords: dict[str, Any]) -> tuple[dict[str, Any], Any]:
    """The arguments of the function of a case, and the options."""
    case, options = find_case(name), keywords.pop("options", Options())
    named = [parameter.name for parameter in case.arguments]
    if unknown := [key for key in keywords if key not in (*named, *_OPTIONS)]:
        raise ParameterError(f"{name} has no parameter {unknown[0]!r}; `skfsink show {name}` lists them, and "
                             f"{', '.join(OUTSIDE_A_DECK[:5])} say where a run goes")
    units = {key: value for key, value in keywords.items()
             if isinstance(value, str) and key in case.parameters and case.parameters[key].unit}
    plain = {**keywords, **case.read(units)}
    shared = {key: value for key, value in plain.items() if key not in named}
    if shared and isinstance(options, Options):
        options = replace(options, **shared, given_names=options.given_names | shared.keys())
    elif shared:
        raise ParameterError(f"options must be skfsink.Options; got {options!r:.80}: leave them out, and give each as "
                             f"a keyword")
    return {key: value for key, value in plain.items() if key in named}, options
