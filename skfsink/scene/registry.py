"""The cases: modules of `skfsink.cases` with a function of the same name each."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import pkgutil
from collections.abc import Callable
from dataclasses import fields
from typing import Any

from ..errors import ParameterError
from .options import Options

__all__ = ["CASES", "NOT_IN_A_DECK", "case_function", "parameters_of"]

#: found without importing them: a case is one file, and is named nowhere else
CASES = tuple(sorted(module.name for module in pkgutil.iter_modules(
    importlib.util.find_spec("skfsink.cases").submodule_search_locations)))  # type: ignore[union-attr]
NOT_IN_A_DECK = ("out", "resume", "overwrite", "quiet", "corridor", "kept", "given")


def case_function(case: str) -> Callable[..., Any]:
    """The function of a case.

    Raises
    ------
    ParameterError
        There is no such case.
    """
    if case not in CASES:
        raise ParameterError(f"case must be one of {', '.join(CASES)}; got {case!r}")
    function: Callable[..., Any] = getattr(importlib.import_module(f"skfsink.cases.{case}"), case)
    return function


def parameters_of(case: str) -> dict[str, Any]:
    """Every parameter that a deck of `case` may have, with its default; those of the sample come first."""
    own = {name: p.default for name, p in inspect.signature(case_function(case)).parameters.items()
           if name != "options"}
    options = Options()
    return {**own, **{f.name: getattr(options, f.name) for f in fields(Options) if f.name not in NOT_IN_A_DECK}}
