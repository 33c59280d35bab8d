"""Grips, tractions and regions as the tables of a deck, with units, and back.

    [[grips]]                                   [[tractions]]                  [[regions]]
    boundary = "top"                            boundary = "right"             name = "inclusion"
    x = 0                                       x = "10 kPa/s"                 material = "neo-hookean"
    y = "1e-3 mm/s"                                                            constants = "mu = 2 MPa"
    z = [["0 s", "0 mm"], ["10 s", "0.2 mm"]]                                  phi = "1 MPa"
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from ..errors import ParameterError, require
from ..loads.grips import Grip, Ramp, Traction
from ..material import MATERIALS, own_constants
from ..material.regions import RegionLaw, one_bulk_modulus
from ..units import number_in

__all__ = ["TABLES", "grip_from", "grips_of", "read_tables", "region_from", "tables_beside",
           "traction_from", "tractions_of"]

AXES = ("x", "y", "z")
MOST = 1000  # tables of a kind, points of a ramp


# --- reading ---
def _table(kind: str, table: Any, needed: str, known: Sequence[str]) -> Mapping[str, Any]:
    """A table of a deck that has no other keys than those known."""
    if not isinstance(table, Mapping):
        raise ParameterError(f"{kind} must be tables; got {table!r:.80}")
    for key in table:
        if key not in known:
            raise ParameterError(f"{kind}: {key!r} is none of {', '.join(known)}")
    if not isinstance(table.get(needed), str) or not table[needed].isprintable():
        raise ParameterError(f"{kind}: {needed} must be a name; got {table.get(needed)!r:.80}")
    return table


def _number(name: str, value: Any, unit: str) -> float:
    return require(name, number_in(name, value, unit), unit)


def _course(name: str, value: Any, rate: str, unit: str) -> float | Ramp:
    """A number in the unit `rate`, or a ramp of points [time, value in `unit`]."""
    if not isinstance(value, list | tuple):
        return _number(name, value, rate)
    if len(value) > MOST or not all(isinstance(point, list | tuple) and len(point) == 2 for point in value):
        raise ParameterError(f"{name}: a ramp has 2 to {MOST} points [time, value]; got {value!r:.80}")
    times, values = (tuple(_number(name, point[i], of) for point in value) for i, of in enumerate(("s", unit)))
    try:
        return Ramp(times, values)
    except ParameterError as error:
        raise ParameterError(f"{name}: {error}") from None


def grip_from(table: Any) -> Grip:
    """The grip of a table; a component that is not there is free."""
    table = _table("grips", table, "boundary", ("boundary", *AXES))
    name = table["boundary"]
    return Grip(name, tuple(_course(f"grip {name}, {axis}", table[axis], "mm/s", "mm") if axis in table else None
                            for axis in AXES))


def traction_from(table: Any) -> Traction:
    """The traction of a table; a component that is not there is zero."""
    table = _table("tractions", table, "boundary", ("boundary", *AXES))
    name = table["boundary"]
    return Traction(name, tuple(_course(f"traction {name}, {axis}", table[axis], "MPa/s", "MPa") if axis in table
                                else 0.0 for axis in AXES))


def region_from(table: Any) -> RegionLaw:
    """What a region is made of, from a table."""
    units = {"phi": "MPa", "m": "", "bulk_modulus": "MPa", "density": "kg/m^3"}
    table = _table("regions", table, "name", ("name", "material", "constants", *units))
    name = table["name"]
    texts: dict[str, Any] = {key: table[key] for key in ("material", "constants") if key in table}
    for key, value in texts.items():
        if not isinstance(value, str) or not value.isprintable():
            raise ParameterError(f"region {name}: {key} must be text; got {value!r:.80}")
    if (law := texts.get("material", "aaa")) not in MATERIALS:
        raise ParameterError(f"region {name}: material must be one of {', '.join(MATERIALS)}; got {law!r}")
    numbers: dict[str, Any] = {key: _number(f"region {name}, {key}", table[key], unit)
                               for key, unit in units.items() if key in table}
    try:
        text, bulk = own_constants(law, texts.get("constants", ""))
        one_bulk_modulus(bulk, numbers.get("bulk_modulus"))
    except ParameterError as error:
        raise ParameterError(f"region {name}: {error}") from None
    if text:
        texts["constants"] = text
    if bulk is not None:
        numbers["bulk_modulus"] = bulk
    return RegionLaw(name, **texts, **numbers)


def grips_of(grips: Sequence[Grip], dim: int) -> tuple[Grip, ...]:
    """Grips with as many components as the body has dimensions; missing ones are free."""
    return tuple(Grip(grip.boundary, _fitted("grip", grip.boundary, grip.velocity, dim, None)) for grip in grips)


def tractions_of(tractions: Sequence[Traction], dim: int) -> tuple[Traction, ...]:
    """Tractions with as many components as the body has dimensions; missing ones are zero."""
    return tuple(Traction(t.boundary, _fitted("traction", t.boundary, t.rate, dim, 0.0)) for t in tractions)


def _fitted(kind: str, name: str, components: Sequence[Any], dim: int, nothing: Any) -> tuple[Any, ...]:
    components = (*components, *[nothing] * (dim - len(components)))
    if any(component not in (None, 0.0) for component in components[dim:]):
        raise ParameterError(f"{kind} {name} has a component z, and the mesh is plane")
    return components[:dim]


# --- writing ---
def _plain(course: float | Ramp) -> Any:
    if isinstance(course, Ramp):
        return [[float(t), float(value)] for t, value in zip(course.times, course.values)]
    return float(course)


def grip_table(grip: Grip) -> dict[str, Any]:
    """The table of a grip, in plain numbers."""
    return {"boundary": grip.boundary,
            **{axis: _plain(value) for axis, value in zip(AXES, grip.velocity) if value is not None}}


def traction_table(traction: Traction) -> dict[str, Any]:
    """The table of a traction, in plain numbers."""
    return {"boundary": traction.boundary, **{axis: _plain(rate) for axis, rate in zip(AXES, traction.rate)
                                              if isinstance(rate, Ramp) or rate}}


def region_table(region: RegionLaw) -> dict[str, Any]:
    """The table of a region, in plain numbers."""
    return {key: value for key, value in asdict(region).items() if value or key in ("name", "material")}


#: tables of a deck by name: how one is read, and how one is written
TABLES: dict[str, tuple[Callable[[Any], Any], Callable[[Any], dict[str, Any]]]] = {
    "grips": (grip_from, grip_table), "tractions": (traction_from, traction_table),
    "regions": (region_from, region_table)}


def read_tables(name: str, value: Any) -> tuple[dict[str, Any], ...]:
    """The tables of that name, with plain numbers in place of text with units.

    Raises
    ------
    ParameterError
        They are no such tables; the message says which and why.
    """
    if not isinstance(value, list | tuple) or len(value) > MOST:
        raise ParameterError(f"{name} must be tables [[{name}]], at most {MOST}; got {value!r:.80}")
    read, write = TABLES[name]
    return tuple(write(read(table)) for table in value)


def tables_beside(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters as a deck has them: numbers and text in the table `parameters`, and beside it each kind of tables."""
    tables = {name: [dict(table) for table in parameters[name]] for name in TABLES if parameters.get(name)}
    return {"parameters": {name: value for name, value in parameters.items() if name not in TABLES}, **tables}
