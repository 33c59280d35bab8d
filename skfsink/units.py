"""Quantities with units: the unit of a parameter in its annotation, and text such as "5 mm" as a number in it.

Units are read as they are written: kg/m^3, kg/m**3, kg/m3, kg/m³, kg m^-3, kg·m⁻³, N/(mm^2).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from numbers import Real
from typing import Annotated, Any, get_args, get_origin

from .errors import ParameterError

__all__ = ["MMHG", "Unit", "in_unit", "kind_and_unit", "measures", "number_in"]

MMHG = 7500.6157584566  #: mmHg in a MPa
LONGEST = 80  # characters of a quantity
#: characters as they are typeset, and as they are typed
TYPED = str.maketrans({"\u03bc": "µ", "−": "-", "–": "-", "·": "*", "⋅": "*", "×": "*", "°": "degree",
                       **dict.fromkeys("\u00a0\u202f\u2009\u2007\ufeff", " ")})
RAISED = re.compile("[⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻]+")  # superscripts
PLAIN = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻", "0123456789+-")
_POWER = r"(?:(?:\^|\*\*)?[+-]?\d)?"
_UNIT = rf"[A-Za-zµ]+{_POWER}"
_TERM = rf"(?:{_UNIT}|\(\s*{_UNIT}(?:(?:\s*[*/]\s*|\s+){_UNIT})*\s*\){_POWER})"
#: a number, and units with one-digit powers between *, / and blanks
QUANTITY = re.compile(rf"\s*(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{{1,3}})?)"
                      rf"(?:\s*[*x]\s*10(?:\^|\*\*)(?P<ten>[+-]?\d{{1,2}}))?"
                      rf"\s*(?P<unit>(?:{_TERM}(?:(?:\s*[*/]\s*|\s+){_TERM})*)?)\s*", re.ASCII)
COMMA = re.compile(r"\s*[+-]?\d[\d.]*,\d")  # of a decimal number, or between thousands


@dataclass(frozen=True)
class Unit:
    """What a number is measured in, as part of its annotation: `side: Annotated[float, Unit("mm")]`."""

    symbol: str


def kind_and_unit(annotation: Any) -> tuple[Any, str]:
    """The type in an annotation, and its unit; "" if it has none."""
    kind, *marks = get_args(annotation) if get_origin(annotation) is Annotated else [annotation]
    return kind, next((mark.symbol for mark in marks if isinstance(mark, Unit)), "")


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
        The text is not a quantity, or its unit measures something else; the message names the one expected.
    """
    wanted = f"a quantity in {unit}" if unit else "a pure number"
    typed = RAISED.sub(lambda found: f"^{found[0].translate(PLAIN)}", text[:LONGEST])
    typed = typed.replace("°C", "degC").translate(TYPED)
    parts = QUANTITY.fullmatch(typed) if len(text) <= LONGEST else None
    try:
        if COMMA.match(typed):
            raise ValueError("decimals stand after a point, and nothing between thousands")
        if parts is None or (parts["ten"] and "e" in parts["number"].lower()):
            raise ValueError
        if unit in ("MPa", "MPa/s") and re.search(r"(?<![A-Za-zµ])mPa", typed):
            raise ValueError("mPa is a thousandth of a pascal: write MPa, or 1e-3 Pa if it is meant")
        number = float(parts["number"] + (f"e{parts['ten']}" if parts["ten"] else ""))
        if parts["unit"] == unit or (plain and not parts["unit"]):
            return number
        return float(f"{number * _factor(_written(parts['unit']), unit):.15g}")  # 5 µs are 5e-6 s, to the last digit
    except ValueError as error:
        raise ParameterError(f"{name} must be {wanted}, such as {_example(unit)}; got {text[:LONGEST]!r}"
                             + (f" ({error})" if str(error) else "")) from None


def measures(text: str, unit: str) -> bool:
    """Whether a text, such as "5 mm", is a quantity that has a number in `unit`."""
    try:
        in_unit("", text, unit)
    except ParameterError:
        return False
    return True


def number_in(name: str, value: Any, unit: str) -> Any:
    """A number of a deck as it is, or its text in `unit`.

    Raises
    ------
    ParameterError
        It is neither, or as of :func:`in_unit`.
    """
    if isinstance(value, str):
        return in_unit(name, value, unit)
    if isinstance(value, bool) or not isinstance(value, Real):  # those of numpy too
        also = f", or text with a unit such as '1.5 {unit}'" if unit else ""
        raise ParameterError(f"{name} must be a number{also}; got {value!r:.80}")
    return value


def _example(unit: str) -> str:
    return repr(f"1.5 {unit}".strip())


def _written(unit: str) -> str:
    """A unit with * for each product and ^ before each power.

    A blank that follows a slash is refused: J/m s is J/(m s) to some and J s/m to others.
    """
    unit = re.sub(r"\s*([*/])\s*|(?<=\()\s+|\s+(?=\))", r"\1", unit.strip().replace("**", "^"))
    unit = re.sub(r"(?<=[A-Za-zµ)])\^?(?=[+-]?\d)", "^", unit).replace("^+", "^")
    if re.search(r"/[^()]*\s", re.sub(r"\([^()]*\)", "()", unit)):
        raise ValueError(f"{unit!r} may be read in two ways: write brackets, as in N/(mm s)")
    return re.sub(r"\s+|(?<=[\dA-Za-zµ)])(?=\()", "*", unit)


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
        case = f"; capitals count: {unit}" if text.lower() == unit.lower() else ""
        raise ValueError(f"{text!r} is no unit{case}") from None
