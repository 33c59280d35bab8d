"""Fibres whose directions depend on the place: around a line, along it, or given at the elements."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Protocol

import numpy as np
from scipy.spatial import cKDTree

from ..errors import ParameterError, place_text
from .fibres import HolzapfelGasserOgden

__all__ = ["AroundALine", "Directions", "GivenDirections", "OrientedFibres", "oriented"]

ON_THE_LINE = 1e-9  # distance from a line, over the greatest one, within which there is no direction around it


class Directions(Protocol):
    """Axes and normals of the fibres at places."""

    def at(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """Axes (n, 3) and normals (n, 3) at places (n, 3) [mm], of any length; without normals those of the law."""


@dataclass(frozen=True)
class AroundALine:
    """Axes around a line, or along it; the normals are the radii from it.

    Parameters
    ----------
    axis, centre: direction of the line, and a point on it [mm].
    along: whether the axes run along the line, instead of around it.
    """

    axis: tuple[float, float, float] = (0.0, 0.0, 1.0)
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    along: bool = False

    def at(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :class:`Directions`; on the line the radius is taken to be any across it."""
        line = np.array(self.axis) / np.linalg.norm(self.axis)
        radii = places - np.array(self.centre)
        radii = radii - (radii @ line)[:, None] * line
        radii[self.on_line(places)] = np.cross(line, np.eye(3)[np.argmin(np.abs(line))])
        return np.broadcast_to(line, radii.shape) if self.along else np.cross(line, radii), radii

    def on_line(self, places: np.ndarray) -> np.ndarray:
        """Mask (n,) of the places that lie on the line."""
        line = np.array(self.axis) / np.linalg.norm(self.axis)
        distance = np.linalg.norm(np.cross(places - np.array(self.centre), line), axis=1)
        return np.asarray(distance <= ON_THE_LINE * max(float(distance.max(initial=0.0)), 1e-300))


@dataclass(frozen=True, eq=False)
class GivenDirections:
    """Axes at certain places, such as the centres of elements; elsewhere that of the nearest one is taken.

    Parameters
    ----------
    places: (m, 3) [mm].   axes: (m, 3), of any length but zero.
    """

    places: np.ndarray
    axes: np.ndarray

    def at(self, places: np.ndarray) -> tuple[np.ndarray, None]:
        """See :class:`Directions`."""
        return self.axes[cKDTree(self.places).query(places)[1]], None


@dataclass(frozen=True)
class OrientedFibres(HolzapfelGasserOgden):
    """The law of :class:`HolzapfelGasserOgden` with `axis` and `normal` from :class:`Directions`.

    Parameters
    ----------
    directions: where there are none, `axis` and `normal` are those of the law.
    own_normal: whether the normals are those of the law in any case.
    """

    directions: Any = None
    own_normal: bool = False

    def fibres(self, centres: np.ndarray) -> np.ndarray:
        """Directions (n, 2, 3) at the points `centres` (n, dim) [mm]."""
        if self.directions is None:
            return super().fibres(centres)
        places = np.zeros((len(centres), 3))
        places[:, :centres.shape[1]] = centres
        axes, normals = self.directions.at(places)
        if normals is None or self.own_normal:
            normals = np.broadcast_to(np.array(self.normal, float), places.shape)
        cosine = np.linalg.norm(np.cross(axes, normals), axis=1)
        if (flat := cosine < 1e-6 * np.linalg.norm(axes, axis=1) * np.linalg.norm(normals, axis=1)).any():
            where = place_text(centres[np.argmax(flat)])
            raise ParameterError(f"fibres are parallel to their normal, or have no direction, at {where} mm: give "
                                 f"another normal")
        return self.families(axes, normals)


def oriented(material: HolzapfelGasserOgden, directions: Directions, normal: tuple[float, float, float] | None = None
             ) -> OrientedFibres:
    """A law with other directions of its fibres, and with one `normal` everywhere if that is given."""
    values = {f.name: getattr(material, f.name) for f in fields(HolzapfelGasserOgden)}
    if normal is not None:
        values["normal"] = normal
        if isinstance(directions, AroundALine):  # valid at any place, for the check of the law
            values["axis"] = next(tuple(map(float, e)) for e in np.eye(3) if np.linalg.norm(np.cross(e, normal)) > 0.5
                                  * np.linalg.norm(normal))
    return OrientedFibres(**values, directions=directions, own_normal=normal is not None)
