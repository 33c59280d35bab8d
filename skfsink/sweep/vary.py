"""What a sweep varies: `notch=1..3:5`, `mesh.seed=1..20`, `sink=lumped,consistent`."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from ..errors import ParameterError
from ..scene.case import Case

__all__ = ["combinations", "read_variation"]

MOST = 10_000  # runs of a sweep


def read_variation(text: str, case: Case) -> tuple[str, list[Any]]:
    """A parameter and its values, from `NAME=A..B:N` (N values), `NAME=A..B` (whole numbers) or `NAME=A,B,C`.

    A dot in the name is an underscore; a value may have a unit.

    Raises
    ------
    ParameterError
        The text is none of these, or a value is not one of that parameter.
    """
    name, equals, values = text.partition("=")
    name = name.strip().replace(".", "_").replace("-", "_")
    if not equals or not values.strip():
        raise ParameterError(f"--vary takes NAME=A..B:N, NAME=A..B or NAME=A,B,C; got {text!r}")
    if name not in case.parameters or case.parameters[name].has_tables:
        raise ParameterError(f"--vary {name}: there is no such parameter; `skfsink show CASE` lists them")
    kind = case.parameters[name].kind
    if ".." not in values:
        return name, [_value(case, name, part.strip()) for part in values.split(",")]
    first, _, rest = values.partition("..")
    last, colon, count = rest.partition(":")
    low, high = (_value(case, name, end.strip()) for end in (first, last))
    if isinstance(low, str | bool) or isinstance(high, str | bool):
        raise ParameterError(f"--vary {name} has no range of values; got {values!r}")
    if colon:
        if not count.strip().isdecimal() or not 2 <= int(count) <= MOST:
            raise ParameterError(f"--vary {name}: the number of values must be 2 to {MOST}; got {count!r}")
        numbers = [float(x) for x in np.linspace(low, high, int(count))]
        whole = kind is int and all(x.is_integer() for x in numbers)
        return name, [int(x) for x in numbers] if whole else [float(f"{x:.12g}") for x in numbers]
    if low % 1 or high % 1 or not 0 <= high - low < MOST:
        raise ParameterError(f"--vary {name} from A to B takes whole numbers A <= B; got {values!r}; "
                             f"{values}:N gives N values between")
    return name, [kind(x) for x in range(int(low), int(high) + 1)]


def _value(case: Case, name: str, text: str) -> Any:
    kind = case.parameters[name].kind
    value: Any = {"true": True, "false": False}.get(text, text) if kind is bool else text
    if kind in (int, float):
        with suppress(ValueError):
            value = int(text) if text.lstrip("+-").isdecimal() else float(text)
    return case.read({name: value})[name]


def combinations(variations: Sequence[tuple[str, list[Any]]]) -> Iterator[dict[str, Any]]:
    """Each combination of the values.

    Raises
    ------
    ParameterError
        A parameter varies twice, or there are too many combinations.
    """
    names = [name for name, _ in variations]
    if twice := {name for name in names if names.count(name) > 1}:
        raise ParameterError(f"--vary {twice.pop()} is given twice")
    count = int(np.prod([len(values) for _, values in variations], dtype=float))
    if count > MOST:
        raise ParameterError(f"a sweep has at most {MOST} runs; these are {count}")
    for values in itertools.product(*(values for _, values in variations)):
        yield dict(zip(names, values))
