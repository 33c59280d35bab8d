"""Pressures on boundaries that follow the deformed surface: one that is given, or that of a fluid that is pumped in."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import ParameterError, require
from .grips import Ramp

__all__ = ["Filling", "Pressure"]


@dataclass(frozen=True)
class Pressure:
    """A pressure on a boundary, per deformed area and against its outward normal.

    Parameters
    ----------
    boundary: on which it acts, where its elements bear force.
    rate: of the pressure [MPa/s], or a ramp of the pressure [MPa].
    in_crack: whether it acts in cracks as well that come from the boundary: on the elements that bear force beside
        those that do not, as far as these are joined to the boundary by sides. Else it ends where the boundary has
        failed.
    """

    boundary: str
    rate: float | Ramp
    in_crack: bool = False


@dataclass(frozen=True)
class Filling:
    """A fluid that is pumped into a cavity: its pressure is what the cavity gives way to it.

    p = (Q(t) - V)/C, with Q the volume pumped in, V that by which the cavity has grown, and C the compliance. With a
    small C the volume is prescribed, so that a body is loaded beyond the greatest pressure that it bears.

    Parameters
    ----------
    boundary: of the cavity.
    inflow: volume in a time [mm^3/s; mm^2/s in 2D, by mm of thickness], or a ramp of the volume [mm^3; mm^2].
    compliance: of fluid and pump, volume by pressure [mm^3/MPa; mm^2/MPa], above 0.

    Raises
    ------
    ParameterError
        The compliance is not above 0.
    """

    boundary: str
    inflow: float | Ramp
    compliance: float

    def __post_init__(self) -> None:
        if not require(f"compliance of the filling of {self.boundary}", self.compliance, "mm^3/MPa") > 0.0:
            raise ParameterError(f"compliance of the filling of {self.boundary} must be above 0 mm^3/MPa; got "
                                 f"{self.compliance:g}")
