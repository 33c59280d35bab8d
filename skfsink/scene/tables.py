"""Grips, loads and regions as the tables of a deck, with units, and back.

    [[grips]]                                   [[tractions]]                  [[regions]]
    boundary = "top"                            boundary = "right"             name = "inclusion"
    x = 0                                       x = "10 kPa/s"                 material = "neo-hookean"
    y = "1e-3 mm/s"                                                            constants = "mu = 2 MPa"
    z = [["0 s", "0 mm"], ["10 s", "0.2 mm"]]                                  phi = "1 MPa"

    [[pressures]]                               [[fillings]]
    boundary = "inner"                          boundary = "inner"
    value = "16 kPa"                            inflow = "1 mm^3/s"
    in_crack = true                             compliance = "0.1 mm^3/kPa"
    [[probes]]                                  what is followed: see `skfsink.run.observers`
    name = "tip"
    kind = "point"
    position = ["1 mm", "2 mm"]
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from numbers import Real
from typing import Annotated, Any, get_type_hints

from ..errors import ParameterError, require
from ..loads.grips import Grip, Ramp, Traction
from ..loads.pressure import Filling, Pressure
from ..material import MATERIALS, own_constants
from ..material.regions import RegionLaw, one_bulk_modulus
from ..meshing.cracks import InitialCrack, crack_along, crack_of_elements
from ..meshing.sample import Sample
from ..units import Unit, number_in
from .typed import Mistake, Record

__all__ = ["cracks_of", "grips_of", "pressures_of", "read_tables", "regions_of", "tractions_of"]

AXES = ("x", "y", "z")
MOST = 1000  # tables of a kind, points of a ramp
RISE = 1.0   # load time [s] in which a pressure that is given by its value rises to it


@dataclass(frozen=True)
class Course:
    """Mark in the annotation of a component: a number in the unit `rate`, or a ramp of points [time, value in `unit`].
    """

    rate: str
    unit: str

    def read(self, value: Any) -> float | list[list[float]]:
        """The component in plain numbers; the ParameterError is to follow its name."""
        if not isinstance(value, list | tuple):
            return require("", number_in("", value, self.rate), self.rate)
        if len(value) > MOST or not all(isinstance(point, list | tuple) and len(point) == 2 for point in value):
            raise ParameterError(f": a ramp has 2 to {MOST} points [time, value]; got {value!r:.80}")
        times, values = ([require("", number_in("", point[i], unit), unit) for point in value]
                         for i, unit in enumerate(("s", self.unit)))
        try:
            return _plain(Ramp(tuple(times), tuple(values)))
        except ParameterError as error:
            raise ParameterError(f": {error}") from None


@dataclass(frozen=True)
class PressureCourse(Course):
    """The same for a pressure: a number is its value in the `unit`, to which it rises in the first second."""

    def read(self, value: Any) -> list[list[float]]:
        """The ramp in plain numbers."""
        if not isinstance(value, list | tuple):
            value = [[0.0, 0.0], [RISE, require("", number_in("", value, self.unit), self.unit)]]
        ramp = super().read(value)
        assert isinstance(ramp, list)
        return ramp


@dataclass(frozen=True)
class Place:
    """Mark in the annotation of a point: a list of coordinates [mm]."""

    def read(self, value: Any) -> list[float]:
        """The point in plain numbers; the ParameterError is to follow its name."""
        if not isinstance(value, list | tuple) or len(value) not in (2, 3):
            raise ParameterError(f" must be 2 or 3 coordinates [x, y, z]; got {value!r:.80}")
        return [require("", number_in("", x, "mm"), "mm") for x in value]


@dataclass(frozen=True)
class Way:
    """Mark in the annotation of a list of points."""

    def read(self, value: Any) -> list[list[float]]:
        """The points in plain numbers; the ParameterError is to follow its name."""
        if not isinstance(value, list | tuple) or not 2 <= len(value) <= MOST:
            raise ParameterError(f" must be 2 to {MOST} points [x, y, z]; got {value!r:.80}")
        try:
            return [Place().read(point) for point in value]
        except ParameterError as error:
            raise ParameterError(f": a point{error}") from None


def _message(kind: str, mistake: Mistake, table: Any) -> str:
    key = next(iter(TYPES[kind]))
    if not mistake.field:
        return f"{kind} must be tables; got {table!r:.80}"
    if mistake.unknown:
        return f"{kind}: {mistake.field!r} is none of {', '.join(TYPES[kind])}"
    if mistake.field == key:
        return f"{kind}: {key} must be a name; got {mistake.value!r:.80}"
    return f"{kind.removesuffix('s')} {table[key]}, {mistake.text}"


#: the fields of a table of each kind; the first names it, and those left out are free, zero, or as in the body
TYPES: Mapping[str, Mapping[str, Any]] = {
    "grips": {"boundary": str, **dict.fromkeys(AXES, Annotated[list, Course("mm/s", "mm")])},
    "tractions": {"boundary": str, **dict.fromkeys(AXES, Annotated[list, Course("MPa/s", "MPa")])},
    "pressures": {"boundary": str, "value": Annotated[list, PressureCourse("MPa/s", "MPa")],
                  "rate": Annotated[float, Unit("MPa/s")], "in_crack": bool},
    "fillings": {"boundary": str, "inflow": Annotated[list, Course("mm^3/s", "mm^3")],
                 "compliance": Annotated[float, Unit("mm^3/MPa")]},
    "regions": get_type_hints(RegionLaw, include_extras=True),
    "probes": {"name": str, "kind": str, "position": Annotated[list, Place()], "to": Annotated[list, Place()],
               "points": int, "boundary": str, "to_boundary": str, "quantity": str,
               "every": Annotated[float, Unit("s")], "every_passes": int},
    "cracks": {"name": str, "points": Annotated[list, Way()], "lips": str, "width": Annotated[float, Unit("mm")],
               "elements": str}}
NEEDED = {"fillings": ("boundary", "inflow", "compliance")}
RECORDS = {kind: Record(types, partial(_message, kind), needed=NEEDED.get(kind, (next(iter(types)),)), finite=True)
           for kind, types in TYPES.items()}


def read_tables(kind: str, tables: Any) -> tuple[dict[str, Any], ...]:
    """The tables of a kind, with plain numbers in place of text with units; each may also be the object it stands for.

    Raises
    ------
    ParameterError
        They are no such tables; the message says which and why.
    """
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
    return tuple({name: course for name, course in table.items() if kind != "tractions" or course != 0.0}
                 for table in read)


def _with_constants(table: Mapping[str, Any]) -> dict[str, Any]:
    """The table of a region, with the constants that E, G and nu stand for."""
    law = RegionLaw(**table)
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
    if isinstance(item, Grip):
        return {"boundary": item.boundary, **{axis: _plain(v) for axis, v in zip(AXES, item.velocity) if v is not None}}
    if isinstance(item, Traction):
        return {"boundary": item.boundary, **{axis: _plain(v) for axis, v in zip(AXES, item.rate) if v != 0.0}}
    if isinstance(item, Pressure):
        name = "value" if isinstance(item.rate, Ramp) else "rate"
        return {"boundary": item.boundary, name: _plain(item.rate), **({"in_crack": True} if item.in_crack else {})}
    if isinstance(item, Filling):
        return {"boundary": item.boundary, "inflow": _plain(item.inflow), "compliance": _plain(item.compliance)}
    if isinstance(item, RegionLaw):
        return {name: value for name, value in asdict(item).items() if value or name in ("name", "material")}
    return item


def _plain(course: Any) -> Any:
    """The component of a table; what is no number stays as it is, for the record to read or refuse."""
    if isinstance(course, Ramp):
        return [[float(time), float(value)] for time, value in zip(course.times, course.values)]
    return float(course) if isinstance(course, Real) and not isinstance(course, bool) else course


def grips_of(tables: Sequence[Mapping[str, Any]], dim: int) -> tuple[Grip, ...]:
    """The grips of a body of that dimension from their tables."""
    return tuple(Grip(table["boundary"], _components("grip", table, dim, None))
                 for table in read_tables("grips", tables))


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
        return crack_of_elements(sample.space, name, sample.elements(table["elements"]), lips)
    width = table.get("width")
    return crack_along(sample.space, name, table["points"], lips,
                       None if width is None else require(f"crack {name}: width", width, "mm", low=0, low_open=True))


def _components(kind: str, table: Mapping[str, Any], dim: int, missing: float | None) -> tuple[Any, ...]:
    courses = [table.get(axis, missing) for axis in AXES]
    if any(course not in (None, 0.0) for course in courses[dim:]):
        raise ParameterError(f"{kind} {table['boundary']} has a component z, and the mesh is plane")
    return tuple(_course(course) for course in courses[:dim])


def _course(course: Any) -> Any:
    """The ramp of a list of points; anything else as it is."""
    return Ramp(*zip(*course)) if isinstance(course, list) else course
