"""Quantities with units: what each parameter is measured in, and text such as "5 mm" as a number in that unit."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

from .errors import ParameterError

__all__ = ["UNITS", "in_unit", "number_in"]

#: unit of each parameter that has one; the other numbers are pure
UNITS = {
    **dict.fromkeys(("side", "notch", "notch_width", "offset", "length", "gauge_length", "gauge_width", "grip_width",
                     "fillet", "thickness", "inner_radius", "length_scale", "merge_nodes"), "mm"),
    **dict.fromkeys(("c1", "c2", "bulk_modulus", "phi"), "MPa"),
    "density": "kg/m^3",
    "speed": "mm/s",
    **dict.fromkeys(("event_time", "aftermath", "hht_dt", "record_every", "frame_every", "checkpoint_every"), "s"),
}
LONGEST = 80  # characters of a quantity
#: a number, and units with one-digit powers between * and /
QUANTITY = re.compile(r"\s*(?P<number>[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?)\s*"
                      r"(?P<unit>([A-Za-zµ]+((\^|\*\*)-?\d)?(\s*[*/]\s*[A-Za-zµ]+((\^|\*\*)-?\d)?)*)?)\s*", re.ASCII)


@cache
def _registry() -> Any:
    import pint  # takes half a second, which only decks with units need

    return pint.UnitRegistry(cache_folder=None)


def in_unit(name: str, text: str, unit: str, plain: bool = False) -> float:
    """The quantity `text`, such as "5 mm", as a number in `unit` ("" for a pure number).

    With `plain` a number without a unit is one in `unit`.

    Raises
    ------
    ParameterError
        It is no quantity, or one of another dimension; the message names the one expected.
    """
    wanted = f"a quantity in {unit}" if unit else "a pure number"
    parts = QUANTITY.fullmatch(text) if len(text) <= LONGEST else None
    try:
        if parts is None:
            raise ValueError
        number = float(parts["number"])
        if parts["unit"] == unit or (plain and not parts["unit"]):
            return number
        return float(f"{number * _factor(parts['unit'], unit):.15g}")  # 5 µs are 5e-6 s, without a trace of the product
    except ValueError as error:
        raise ParameterError(f"{name} must be {wanted}, such as {_example(unit)}; got {text[:LONGEST]!r}"
                             + (f" ({error})" if str(error) else "")) from None


def number_in(name: str, value: Any, unit: str) -> Any:
    """A number of a deck as it is, or its text in `unit`.

    Raises
    ------
    ParameterError
        It is neither, or as of :func:`in_unit`.
    """
    if isinstance(value, str):
        return in_unit(name, value, unit)
    if isinstance(value, bool) or not isinstance(value, int | float):
        also = f", or text with a unit such as '1.5 {unit}'" if unit else ""
        raise ParameterError(f"{name} must be a number{also}; got {value!r:.80}")
    return value


def _example(unit: str) -> str:
    return repr(f"1.5 {unit}".strip())


@cache
def _factor(text: str, unit: str) -> float:
    """How many of `unit` are one of `text`."""
    if text == unit:
        return 1.0
    registry = _registry()
    try:
        found = registry.Unit(text or "dimensionless")
        return float(registry.Quantity(1.0, found).to(unit or "dimensionless").magnitude)
    except Exception as error:  # pint has many, some of Python's own
        if type(error).__name__ == "DimensionalityError":
            raise ValueError(f"its dimension is {found.dimensionality}, expected "
                             f"{registry.Unit(unit or 'dimensionless').dimensionality}") from None
        raise ValueError(f"{text!r} is no unit") from None
