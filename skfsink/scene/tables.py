"""Grips, loads and regions as the tables of a deck, with units, and back.

    [[grips]]                                   [[tractions]]                  [[regions]]
    boundary = "top"                            boundary = "right"             name = "inclusion"
    x = 0                                       x = "10 kPa/s"                 material = "neo-hookean"
    y = "1e-3 mm/s"    # or: normal = 0                                        constants = "mu = 2 MPa"
    z = [["0 s", "0 mm"], ["10 s", "0.2 mm"]]  # or "points.csv"               phi = "1 MPa"

    [[pressures]]                               [[fillings]]                   [[probes]]
    boundary = "inner"                          boundary = "inner"             name = "tip"
    value = "16 kPa"                            inflow = "1 mm^3/s"            kind = "point"
    in_crack = true                             compliance = "0.1 mm^3/kPa"    position = ["1 mm", "2 mm"]
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import numpy as np

from ..errors import ParameterError, require
from ..loads.curve import Curve
from ..loads.grips import Grip, Ramp, Sliding, Traction, Velocity
from ..loads.pressure import Filling, Pressure
from ..loads.rotation import Rotation
from ..material import MATERIALS, own_constants
from ..material.regions import RegionLaw, one_bulk_modulus
from ..meshing.cracks import InitialCrack, crack_along, crack_of_elements, of_length
from ..meshing.sample import Sample
from ..system.files import path_of
from ..units import Unit, kind_and_unit
from .course_file import SUFFIX
from .marks import MOST, Course, Direction, Place, PressureCourse, Still, Vector, Way, plain
from .typed import Mistake, Record

__all__ = ["beside", "body_forces_of", "cracks_of", "curved", "grips_of", "in_points", "number_fields", "pressures_of",
           "read_tables", "regions_of", "tractions_of", "velocities_of"]

AXES = ("x", "y", "z")
SINGULAR = {"body_forces": "body force", "velocities": "velocity", "fibres": "fibres of"}


def _message(kind: str, mistake: Mistake, table: Any) -> str:
    key = next(iter(TYPES[kind]))
    if not mistake.field:
        return f"{kind} must be tables; got {table!r:.80}"
    if mistake.unknown:
        return f"{kind}: unknown key {mistake.field!r}; the keys are {', '.join(TYPES[kind])}"
    if mistake.field == key:
        return f"{kind}: {key} must be a name; got {mistake.value!r:.80}"
    return f"{SINGULAR.get(kind, kind.removesuffix('s'))} {table.get(key, 'of the body')}, {mistake.text}"


#: the fields of a table of each kind; the first names it, and those left out are free, zero, or as in the body
TYPES: Mapping[str, Mapping[str, Any]] = {
    "grips": {"boundary": str, **dict.fromkeys(AXES, Annotated[list, Course("mm/s", "mm", curve=True)]),
              "normal": Annotated[float, Still()], "angle": Annotated[list, Course("degree/s", "degree")],
              "centre": Annotated[list, Vector("mm")], "axis": Annotated[list, Vector("")]},
    "tractions": {"boundary": str, **dict.fromkeys(AXES, Annotated[list, Course("MPa/s", "MPa", curve=True)])},
    "pressures": {"boundary": str, "value": Annotated[list, PressureCourse("MPa/s", "MPa")],
                  "rate": Annotated[float, Unit("MPa/s")], "in_crack": bool},
    "fillings": {"boundary": str, "inflow": Annotated[list, Course("mm^3/s", "mm^3")],
                 "compliance": Annotated[float, Unit("mm^3/MPa")]},
    "body_forces": {"region": str, **dict.fromkeys(AXES, Annotated[list, Course("mm/s^3", "mm/s^2")])},
    "velocities": {"region": str, **dict.fromkeys(AXES, Annotated[float, Unit("mm/s")])},
    "regions": get_type_hints(RegionLaw, include_extras=True),
    "probes": {"name": str, "kind": str, "position": Annotated[list, Place()], "to": Annotated[list, Place()],
               "points": int, "boundary": str, "to_boundary": str, "quantity": str, "radius": float,
               "every": Annotated[float, Unit("s")], "every_passes": int},
    "fibres": {"region": str, "direction": Annotated[list, Direction()], "array": str,
               "azimuth": Annotated[float, Unit("degree")], "elevation": Annotated[float, Unit("degree")],
               "axis": Annotated[list, Vector("")], "centre": Annotated[list, Vector("mm")],
               "normal": Annotated[list, Vector("")]},
    "cracks": {"name": str, "points": Annotated[list, Way()], "lips": str, "width": Annotated[float, Unit("mm")],
               "length": Annotated[float, Unit("mm")], "elements": str}}
#: kinds whose first field may be left out: they are of the whole body then
WITHOUT_NAME = ("body_forces", "velocities", "fibres")
#: fields of a table that may not be left out, where these are others than the first
NEEDED = {"fillings": ("boundary", "inflow", "compliance"), **dict.fromkeys(WITHOUT_NAME, ())}
RECORDS = {kind: Record(types, partial(_message, kind), needed=NEEDED.get(kind, (next(iter(types)),)), finite=True)
           for kind, types in TYPES.items()}


def number_fields(kind: str) -> dict[str, str]:
    """Fields of a table of a kind that are plain numbers, with their units."""
    found = {name: kind_and_unit(annotation) for name, annotation in TYPES[kind].items()}
    return {name: unit for name, (type_, unit) in found.items() if type_ is float}


def read_tables(kind: str, tables: Any) -> tuple[dict[str, Any], ...]:
    """The tables of a kind, with plain numbers in place of text with units; each may also be the object it stands for.

    Raises
    ------
    ParameterError
        They are no such tables; the message says which and why.
    """
    if isinstance(tables, Mapping):
        raise ParameterError(f"{kind} must be tables [[{kind}]], with two brackets each, as there may be several; got "
                             f"{tables!r:.80}")
    if not isinstance(tables, list | tuple) or len(tables) > MOST:
        raise ParameterError(f"{kind} must be tables [[{kind}]], at most {MOST}; got {tables!r:.80}")
    read = [RECORDS[kind].read(_table(table)) for table in tables]
    if kind == "regions":
        return tuple(map(_with_constants, read))
    if kind == "pressures":
        for table in read:
            if ("value" in table) == ("rate" in table):
                raise ParameterError(f"pressure {table['boundary']} must have a value (a pressure, or a ramp of points "
                                     f"[time, pressure]) or a rate; got {'both' if 'rate' in table else 'neither'}")
    for table in read if kind == "grips" else ():
        _one_kind(table)
    for table in read if kind == "fibres" else ():
        _one_direction(table)
    if kind not in ("tractions", "body_forces", "velocities"):
        return tuple(read)
    return tuple({name: course for name, course in table.items() if course != 0.0} for table in read)


def curved(tables: Any) -> bool:
    """Whether a component of one of the tables, as :func:`read_tables` gives them, is a function of the time."""
    return any(isinstance(value, Curve) for table in tables if isinstance(table, Mapping) for value in table.values())


def in_points(tables: Sequence[Mapping[str, Any]]) -> tuple[dict[str, Any], ...]:
    """The tables with points in place of functions of the time, as a file has them: their polylines, of at most 1000
    points."""
    def points(value: Any) -> Any:
        if not isinstance(value, Curve):
            return value
        kept = np.unique(np.linspace(0, len(value.times) - 1, MOST).round().astype(int))
        return [[float(value.times[k]), float(value.values[k])] for k in kept]

    return tuple({key: points(value) for key, value in table.items()} for table in tables)


def _one_kind(table: Mapping[str, Any]) -> None:
    """Refuse a grip that is to do two things at once, or one of them in part (ParameterError)."""
    name, others = table["boundary"], [axis for axis in AXES if axis in table]
    if "normal" in table and (others or "angle" in table):
        raise ParameterError(f"grip {name} has normal and {[*others, 'angle'][0]}: a boundary that slides is held "
                             f"along its normal alone; hold other components by a second grip on it")
    if len(table) == 1:
        raise ParameterError(f"grip {name} holds nothing: give it x, y, z, normal or angle; a component that is left "
                             f"out is free")
    if "angle" in table and others:
        raise ParameterError(f"grip {name} has angle and {others[0]}: a boundary that turns is held in all directions")
    if ("angle" in table) != ("centre" in table) or ("axis" in table and "angle" not in table):
        raise ParameterError(f"grip {name} must have angle and centre together, and in space an axis; got "
                             f"{', '.join(key for key in ('angle', 'centre', 'axis') if key in table)}")


def _one_direction(table: Mapping[str, Any]) -> None:
    """Refuse fibres whose direction is not given, or twice (ParameterError)."""
    of = f"fibres of {table['region']}" if "region" in table else "fibres of the body"
    given = [key for key in ("direction", "array", "azimuth") if key in table]
    if len(given) != 1:
        raise ParameterError(f"{of} must have one of direction, array and azimuth; got {' and '.join(given) or 'none'}")
    if "elevation" in table and "azimuth" not in table:
        raise ParameterError(f"{of}: elevation goes with azimuth")
    around = isinstance(table.get("direction"), str)
    if odd := [key for key in ("axis", "centre") if key in table and not around]:
        raise ParameterError(f"{of}: {odd[0]} is for the directions circumferential and axial")


def _with_constants(table: Mapping[str, Any]) -> dict[str, Any]:
    """The table of a region, with the constants that E, G and nu stand for."""
    law = RegionLaw(**table)
    if not law.material:
        return _table(law)
    if law.material not in MATERIALS:
        raise ParameterError(f"region {law.name}: material must be one of {', '.join(MATERIALS)}; got {law.material!r}")
    try:
        constants, bulk_modulus = own_constants(law.material, law.constants)
        one_bulk_modulus(bulk_modulus, table.get("bulk_modulus"))
    except ParameterError as error:
        raise ParameterError(f"region {law.name}: {error}") from None
    return _table(RegionLaw(**{**table, **({"constants": constants} if constants else {}),
                               **({} if bulk_modulus is None else {"bulk_modulus": bulk_modulus})}))


# --- objects and their tables ---
def _table(item: Any) -> Any:
    """The table of a grip, a load or a region; anything else as it is."""
    if isinstance(item, Sliding):
        return {"boundary": item.boundary, "normal": 0.0}
    if isinstance(item, Rotation):
        return {"boundary": item.boundary, "angle": plain(item.angle), "centre": list(item.centre),
                **({"axis": list(item.axis)} if item.axis else {})}
    if isinstance(item, Grip):
        return {"boundary": item.boundary, **{axis: plain(v) for axis, v in zip(AXES, item.velocity) if v is not None}}
    if isinstance(item, Velocity):
        return {**({"region": item.region} if item.region else {}), **dict(zip(AXES, map(float, item.velocity)))}
    if isinstance(item, Traction):
        return {"boundary": item.boundary, **{axis: plain(v) for axis, v in zip(AXES, item.rate) if v != 0.0}}
    if isinstance(item, Pressure):
        name = "value" if isinstance(item.rate, Ramp) else "rate"
        return {"boundary": item.boundary, name: plain(item.rate), **({"in_crack": True} if item.in_crack else {})}
    if isinstance(item, Filling):
        return {"boundary": item.boundary, "inflow": plain(item.inflow), "compliance": plain(item.compliance)}
    if isinstance(item, RegionLaw):
        return {name: value for name, value in asdict(item).items() if value or name == "name"}
    return item


def beside(tables: Any, folder: Path) -> Any:
    """Tables in which paths of CSV files, relative to the folder of a deck, are absolute; anything else as it is."""
    if not isinstance(tables, list):
        return tables

    def path(key: str, value: Any) -> Any:
        named = key in (*AXES, "angle") and isinstance(value, str) and value.lower().endswith(SUFFIX)
        return str((folder / path_of(key, value)).absolute()) if named else value

    return [{key: path(key, value) for key, value in table.items()} if isinstance(table, Mapping) else table
            for table in tables]


def grips_of(tables: Sequence[Mapping[str, Any]], dim: int) -> tuple[Grip, ...]:
    """The grips of a body of that dimension from their tables."""
    return tuple(_grip(table, dim) for table in read_tables("grips", tables))


def _grip(table: Mapping[str, Any], dim: int) -> Grip:
    if "normal" in table:
        return Sliding(table["boundary"])
    if "angle" in table:
        centre, axis = tuple(table["centre"]), tuple(table.get("axis", ()))
        return Rotation(table["boundary"], _course(table["angle"]), centre, axis)
    return Grip(table["boundary"], _components("grip", table, dim, None))


def tractions_of(tables: Sequence[Mapping[str, Any]], dim: int) -> tuple[Traction, ...]:
    """The tractions on a body of that dimension from their tables."""
    return tuple(Traction(table["boundary"], _components("traction", table, dim, 0.0))
                 for table in read_tables("tractions", tables))


def pressures_of(pressures: Sequence[Mapping[str, Any]],
                 fillings: Sequence[Mapping[str, Any]]) -> tuple[Pressure | Filling, ...]:
    """Pressures and fillings from their tables; pressures come first."""
    given = [Pressure(table["boundary"], _course(table["value"]) if "value" in table else table["rate"],
                      table.get("in_crack", False)) for table in read_tables("pressures", pressures)]
    return (*given, *(Filling(table["boundary"], _course(table["inflow"]), table["compliance"])
                      for table in read_tables("fillings", fillings)))


def body_forces_of(tables: Sequence[Mapping[str, Any]], dim: int) -> tuple[tuple[str, tuple[Any, ...]], ...]:
    """The region of each body force, "" for the whole body, and its components in a body of that dimension."""
    return tuple((table.get("region", ""), _components("body force", table, dim, 0.0))
                 for table in read_tables("body_forces", tables))


def velocities_of(tables: Sequence[Mapping[str, Any]], dim: int) -> tuple[Velocity, ...]:
    """The velocities of a body of that dimension, and of regions of it, as the event begins."""
    return tuple(Velocity(table.get("region", ""), _components("velocity", table, dim, 0.0))
                 for table in read_tables("velocities", tables))


def regions_of(tables: Sequence[Mapping[str, Any]]) -> tuple[RegionLaw, ...]:
    """What regions are made of, from their tables."""
    return tuple(RegionLaw(**table) for table in read_tables("regions", tables))


def cracks_of(tables: Sequence[Mapping[str, Any]], sample: Sample) -> tuple[InitialCrack, ...]:
    """The initial cracks of a sample from their tables (SkfsinkError)."""
    return tuple(_crack(table, sample) for table in read_tables("cracks", tables))


def _crack(table: Mapping[str, Any], sample: Sample) -> InitialCrack:
    name = table["name"]
    if ("points" in table) == ("elements" in table):
        raise ParameterError(f"crack {name} needs points or elements, the name of a set of them"
                             + (", not both" if "points" in table else ""))
    if "lips" not in table:
        raise ParameterError(f"crack {name} needs lips, which decide on the onset: broken as those of a crack that has "
                             f"run, or whole as those of a cut")
    lips = table["lips"]
    if "elements" in table:
        if "width" in table:
            raise ParameterError(f"crack {name}: width is for points; a set of elements is as wide as it is")
        if "length" in table:
            raise ParameterError(f"crack {name}: length is for points; a set of elements is as long as it is")
        return crack_of_elements(sample.space, name, sample.elements(table["elements"]), lips)
    width = table.get("width")
    points = table["points"]
    if "length" in table:
        if sample.space.dim == 3:
            raise ParameterError(f"crack {name}: length is for a line in the plane; a surface has its points")
        points = of_length(points, require(f"crack {name}: length", table["length"], "mm", low=0, low_open=True))
    return crack_along(sample.space, name, points, lips,
                       None if width is None else require(f"crack {name}: width", width, "mm", low=0, low_open=True))


def _components(kind: str, table: Mapping[str, Any], dim: int, missing: float | None) -> tuple[Any, ...]:
    courses = [table.get(axis, missing) for axis in AXES]
    if any(course not in (None, 0.0) for course in courses[dim:]):
        name = table.get("boundary") or table.get("region") or "of the body"
        raise ParameterError(f"{kind} {name} has a component z, and the mesh is plane")
    return tuple(map(_course, courses[:dim]))


def _course(course: Any) -> Any:
    """A ramp of points; a rate, or nothing, as it is."""
    return Ramp(*zip(*course)) if isinstance(course, list) else course
