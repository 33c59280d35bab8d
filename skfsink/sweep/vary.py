"""What a sweep varies: `notch=1..3:5`, `mesh.seed=1..20`, `sink=lumped,consistent`, `angle=0..90:7`, `core.mu=1,2`."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ParameterError
from ..scene.deck import Deck
from .varied import Varied, varied

__all__ = ["Variation", "combinations", "read_variation", "values_of", "with_values"]

MOST = 10_000  # runs of a sweep


@dataclass(frozen=True)
class Variation:
    """A quantity of a deck and its values.

    Attributes
    ----------
    what: the quantity.   values: in its unit, or text.
    """

    what: Varied
    values: list[Any]

    @property
    def name(self) -> str:
        """Of its column in the table."""
        return self.what.name


def read_variation(text: str, deck: Deck) -> Variation:
    """What varies, from `NAME=A..B:N` (N values), `NAME=A..B` (whole numbers) or `NAME=A,B,C`; see :func:`.varied`.

    A dot in the name of a parameter is an underscore; a value may have a unit.

    Raises
    ------
    ParameterError
        The text is none of these, or a value is not one of that quantity.
    """
    name, equals, values = (part.strip() for part in text.partition("="))
    if not equals or not values:
        raise ParameterError(f"--vary takes NAME=A..B:N, NAME=A..B or NAME=A,B,C; got {text!r}")
    what = varied(name, deck)
    if ".." not in values:
        return Variation(what, [what.read(_number(what, part.strip())) for part in values.split(",")])
    first, _, rest = values.partition("..")
    last, colon, count = rest.partition(":")
    low, high = (what.read(_number(what, end.strip())) for end in (first, last))
    if isinstance(low, str | bool) or isinstance(high, str | bool):
        raise ParameterError(f"--vary {what.name} has no range of values; got {values!r}")
    if colon:
        if not count.strip().isdecimal() or not 2 <= int(count) <= MOST:
            raise ParameterError(f"--vary {what.name}: the number of values must be 2 to {MOST}; got {count!r}")
        numbers = [float(x) for x in np.linspace(low, high, int(count))]
        whole = what.kind is int and all(x.is_integer() for x in numbers)
        return Variation(what, [int(x) for x in numbers] if whole else [float(f"{x:.12g}") for x in numbers])
    if low % 1 or high % 1 or not 0 <= high - low < MOST:
        raise ParameterError(f"--vary {what.name} from A to B takes whole numbers A <= B; got {values!r}; "
                             f"{values}:N gives N values between")
    return Variation(what, [what.kind(x) for x in range(int(low), int(high) + 1)])


def values_of(name: str, values: Any, deck: Deck) -> Variation:
    """What varies, from its name and its values: numbers, or text with a unit.

    Raises
    ------
    ParameterError
        There is no such quantity, or a value is not one of it.
    """
    if isinstance(values, str) or not isinstance(values, Sequence | np.ndarray) or not len(values):
        raise ParameterError(f"{name} varies over a list of values; got {values!r:.80}")
    what = varied(name, deck)
    plain = values.tolist() if isinstance(values, np.ndarray) else values
    return Variation(what, [what.read(str(value) if isinstance(value, Path) else value) for value in plain])


def _number(what: Varied, text: str) -> Any:
    """The plain number, or the flag, in a text; other text as it is."""
    value: Any = {"true": True, "false": False}.get(text, text) if what.kind is bool else text
    if what.kind in (int, float):
        with suppress(ValueError):
            value = int(text) if text.lstrip("+-").isdecimal() else float(text)
    return value


def combinations(variations: Sequence[tuple[str, list[Any]]]) -> Iterator[dict[str, Any]]:
    """Each combination of the values, by name.

    Raises
    ------
    ParameterError
        A name varies twice, or there are too many combinations.
    """
    names = [name for name, _ in variations]
    if twice := {name for name in names if names.count(name) > 1}:
        raise ParameterError(f"--vary {twice.pop()} is given twice")
    count = int(np.prod([len(values) for _, values in variations], dtype=float))
    if count > MOST:
        raise ParameterError(f"a sweep has at most {MOST} runs; these are {count}")
    for values in itertools.product(*(values for _, values in variations)):
        yield dict(zip(names, values))


def with_values(variations: Sequence[Variation], values: Mapping[str, Any], parameters: Mapping[str, Any]
                ) -> dict[str, Any]:
    """The parameters of a deck with the values of one combination."""
    whole = dict(parameters)
    for variation in variations:
        whole = variation.what.put(whole, values[variation.name])
    return whole
