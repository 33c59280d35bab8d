"""Quantities of a deck that a sweep may vary: parameters, constants of laws, numbers of its tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..errors import ParameterError
from ..material import MATERIALS, MODULI, constant_unit, own_names, with_constant
from ..scene.case import Case
from ..scene.deck import Deck
from ..scene.registry import find_case
from ..scene.tables import number_fields, read_tables
from ..units import number_in

__all__ = ["Varied", "varied"]

Parameters = Mapping[str, Any]


@dataclass(frozen=True)
class Varied:
    """A quantity of a deck.

    Attributes
    ----------
    name: of its column.   kind: type of its values.   unit: of these; "" for pure numbers and for text.
    read: a value, as plain number or text, from a number or text with a unit.
    put: the parameters of a deck with a value of it.
    """

    name: str
    kind: type
    unit: str
    read: Callable[[Any], Any]
    put: Callable[[Parameters, Any], dict[str, Any]]


def varied(name: str, deck: Deck) -> Varied:
    """The quantity of a deck that is called NAME, CONSTANT, REGION.CONSTANT, CRACK.FIELD, TABLE.FIELD or TABLE.N.FIELD.

    NAME is a parameter of its case, with - or . for _; CONSTANT one of its law, or E, G or nu; REGION a region of it,
    which also has the fields phi, m, bulk_modulus, density and viscosity; CRACK an initial
    crack, by its name, with the fields length and width; TABLE a kind of tables, such as fibres, of which N is the
    first (1) or a later one: where the deck has several, it must be said which.

    Raises
    ------
    ParameterError
        There is no such quantity.
    """
    case, plain = find_case(deck.case), name.replace(".", "_").replace("-", "_")
    law = str(deck.parameters.get("material", "aaa"))
    constants = own_names(law) if law != "aaa" and law in MATERIALS else []  # those of aaa are parameters
    if name in constants or (name in MODULI and law in MATERIALS):
        return _constant(name, law)
    if plain in case.parameters and not case.parameters[plain].has_tables:
        return _parameter(case, plain)
    head, dot, tail = name.rpartition(".")
    regions: Sequence[Any] = deck.parameters.get("regions", ())
    if dot and (found := [i for i, table in enumerate(regions) if table["name"] == head]):
        own = str(regions[found[0]].get("material", ""))
        if own and tail in own_names(own):
            return _constant_of_region(name, found[0], own, tail)
        return _of_table(name, "regions", found[0], tail)
    cracks: Sequence[Any] = deck.parameters.get("cracks", ())
    if dot and (found := [i for i, table in enumerate(cracks) if table["name"] == head]):
        return _of_table(name, "cracks", found[0], tail)
    kind = head.partition(".")[0]
    if kind in case.tables and (tables := deck.parameters.get(kind, ())):
        return _of_table(name, kind, _which(name, len(tables)), tail)
    others = f"; constants of {law} are {', '.join(constants)}" if constants else ""
    raise ParameterError(f"--vary {plain if not dot else name}: there is no such parameter; `skfsink show "
                         f"{deck.case}` lists them{others}")


def _parameter(case: Case, name: str) -> Varied:
    parameter = case.parameters[name]
    return Varied(name, parameter.kind, parameter.unit, lambda value: case.read({name: value})[name],
                  lambda parameters, value: {**parameters, name: value})


def _constant(name: str, law: str) -> Varied:
    return Varied(name, float, constant_unit(name), _quantity(name, law), lambda parameters, value: {
        **parameters, "constants": with_constant(str(parameters.get("constants", "")), name, value)})


def _constant_of_region(name: str, number: int, law: str, constant: str) -> Varied:
    def put(parameters: Parameters, value: Any) -> dict[str, Any]:
        text = str(parameters["regions"][number].get("constants", ""))
        return _with_field(parameters, "regions", number, "constants", with_constant(text, constant, value))

    return Varied(name, float, constant_unit(constant), _quantity(constant, law), put)


def _quantity(name: str, law: str) -> Callable[[Any], Any]:
    if isinstance(getattr(MATERIALS[law], name, None), tuple):
        raise ParameterError(f"--vary {name}: it is a vector; vary the numbers of [[fibres]] instead")

    def read(value: Any) -> float:
        return float(number_in(name, value, constant_unit(name)))

    return read


def _which(name: str, count: int) -> int:
    """Number from zero of the table that TABLE.N.FIELD, or TABLE.FIELD of the only one, is of."""
    kind, *which, field = name.split(".")
    if not which and count == 1:
        return 0
    if len(which) == 1 and which[0].isdecimal() and 1 <= int(which[0]) <= count:
        return int(which[0]) - 1
    if count == 1:
        raise ParameterError(f"--vary {name}: the deck has one table [[{kind}]]: it is {kind}.{field}")
    raise ParameterError(f"--vary {name}: the deck has {count} tables [[{kind}]]: say which, {kind}.1.{field} to "
                         f"{kind}.{count}.{field}")


def _of_table(name: str, kind: str, number: int, field: str) -> Varied:
    units = number_fields(kind)
    if field not in units:
        raise ParameterError(f"--vary {name}: there is no such parameter; numbers of {kind} are {', '.join(units)}")

    def read(value: Any) -> Any:
        return float(number_in(name, value, units[field]))

    return Varied(name, float, units[field], read,
                  lambda parameters, value: _with_field(parameters, kind, number, field, value))


def _with_field(parameters: Parameters, kind: str, number: int, field: str, value: Any) -> dict[str, Any]:
    tables = [dict(table) for table in parameters[kind]]
    tables[number][field] = value
    return {**parameters, kind: read_tables(kind, tables)}
