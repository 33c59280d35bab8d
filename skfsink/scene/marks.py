"""Marks in the annotations of a table's fields: how a course in time, a point or a vector is read from a deck."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real
from typing import Any

from ..errors import ParameterError, require
from ..loads.curve import Curve
from ..loads.grips import Ramp
from ..system.files import path_of
from ..units import measures, number_in
from .course_file import SUFFIX, read_course

__all__ = ["MOST", "Course", "Direction", "Place", "PressureCourse", "Still", "Vector", "Way", "plain"]

MOST = 1000  # tables of a kind, points of a ramp
RISE = 1.0   # load time [s] in which a pressure that is given by its value rises to it


@dataclass(frozen=True)
class Course:
    """Mark in the annotation of a component: a number in the unit `rate`, or a ramp of points [time, value in `unit`],
    also as the path of a CSV file. With `curve` a function of the load time, which stands in no deck, is kept.
    """

    rate: str
    unit: str
    curve: bool = False

    def read(self, value: Any) -> float | list[list[float]] | Curve:
        """The component in plain numbers; the ParameterError is to follow its name."""
        if isinstance(value, Curve):
            if self.curve:
                return value
            raise ParameterError(" takes no function of the time, as x, y and z of grips and tractions do: give a ramp "
                                 "of points [time, value]")
        if isinstance(value, str) and value.lower().endswith(SUFFIX):
            value = read_course(path_of("", value), self.unit, MOST)
        if not isinstance(value, list | tuple):
            try:
                return require("", number_in("", value, self.rate), self.rate)
            except ParameterError:
                if isinstance(value, str) and measures(value, self.unit):
                    raise ParameterError(f" must be a quantity in {self.rate}, or a ramp of points [time, value] such "
                                         f"as [['0 s', '0 {self.unit}'], ['1 s', {value!r}]]; got {value!r:.80}"
                                         ) from None
                raise
        if len(value) > MOST or not all(isinstance(point, list | tuple) and len(point) == 2 for point in value):
            raise ParameterError(f": a ramp has 2 to {MOST} points [time, value]; got {value!r:.80}")
        times, values = ([require("", number_in("", point[i], unit), unit) for point in value]
                         for i, unit in enumerate(("s", self.unit)))
        try:
            return plain(Ramp(tuple(times), tuple(values)))
        except ParameterError as error:
            raise ParameterError(f": {error}") from None


@dataclass(frozen=True)
class PressureCourse(Course):
    """The same for a pressure: a number is its value in the `unit`, to which it rises in the first second."""

    def read(self, value: Any) -> list[list[float]]:
        """The ramp in plain numbers."""
        if not isinstance(value, list | tuple | Curve) and not str(value).lower().endswith(SUFFIX):
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


class Still:
    """Mark in the annotation of the component normal to a boundary: 0, no other number."""

    @staticmethod
    def read(value: Any) -> float:
        if number_in("", value, "mm/s") != 0.0:
            raise ParameterError(f" must be 0: the boundary slides on its plane, which stands still; got {value!r:.80}")
        return 0.0


@dataclass(frozen=True)
class Vector:
    """Mark in the annotation of a list of numbers in a unit."""

    unit: str

    def read(self, value: Any) -> list[float]:
        """The numbers; the ParameterError is to follow the name of the field."""
        if not isinstance(value, list | tuple) or not 2 <= len(value) <= 3:
            raise ParameterError(f" must be a list of a number for each axis; got {value!r:.80}")
        return [require("", number_in("", item, self.unit), self.unit) for item in value]


class Direction:
    """Mark in the annotation of a direction: a word, or a list of numbers."""

    WORDS = ("circumferential", "axial")

    def read(self, value: Any) -> str | list[float]:
        """The word or the numbers; the ParameterError is to follow the name of the field."""
        if isinstance(value, list | tuple):
            return Vector("").read(value)
        if value not in self.WORDS:
            raise ParameterError(f" must be {', '.join(self.WORDS)}, or a list of a number for each axis; got "
                                 f"{value!r:.80}")
        return str(value)


def plain(course: Any) -> Any:
    """The component of a table; what is no number stays as it is, for the record to read or refuse."""
    if isinstance(course, Ramp) and not isinstance(course, Curve):
        return [[float(time), float(value)] for time, value in zip(course.times, course.values)]
    return float(course) if isinstance(course, Real) and not isinstance(course, bool) else course
