"""Probes of boundaries: forces on them, volumes that they enclose, distances between them; and probes of a deck."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from inspect import Parameter, signature
from typing import Any

import numpy as np

from ...errors import ParameterError, choose
from ...fem.places import find_places
from ...fem.surface import Surface
from ...loads.pressure import Filling
from ...scene.scene import Scene
from .observer import Observer
from .probe import Columns, LineProbe, MeanProbe, PointProbe, Probe, position_of
from .release import EnergyRelease
from .view import View

__all__ = ["PROBE_KINDS", "OpeningProbe", "ReactionProbe", "VolumeProbe", "probe_of", "probes_of"]

_AXES = ("x", "y", "z")


class ReactionProbe(Probe):
    """Components of the force that holds or moves boundaries: sums over their nodes of internal forces less dead loads.

    On a boundary that nothing holds the sum is 0 in equilibrium; in motion it is what its own mass takes.

    Parameters
    ----------
    name, every, every_passes: as of :class:`.Probe`.
    boundary: names of boundaries, with commas; empty for those of all grips and rollers of the scene.
    """

    def __init__(self, name: str, boundary: str = "", *, every: float | None = None, every_passes: int = 1) -> None:
        super().__init__(name, every=every, every_passes=every_passes)
        self.boundary = boundary

    def _prepared(self, scene: Scene) -> Columns:
        names = [part.strip() for part in self.boundary.split(",")] if self.boundary else list(dict.fromkeys(
            grip.boundary for grip in (*scene.grips, *scene.rollers)))
        if not names:
            raise ParameterError("the scene has no grips: name the boundary whose force is to be followed")
        self._nodes = [scene.sample.nodes(boundary) for boundary in names]
        unit = "N" if scene.space.volume_dim == 3 else "N/mm"
        return [(f"{boundary}_{axis}", unit) for boundary in names for axis in _AXES[:scene.space.dim]]

    def _values(self, view: View) -> np.ndarray:
        return np.concatenate([view.reaction[nodes].sum(axis=0) for nodes in self._nodes])


class VolumeProbe(Probe):
    """Volume (in the plane: area) that a boundary encloses, in the deformed body.

    The rims of an open boundary are closed by flat caps: they have to be in planes, and a boundary in the plane has to
    be one line. With a `position` straight lines from the rims to that point close it: the middle of a cavity of which
    planes of symmetry through that point leave a part. Of a body of revolution it is the volume within the rings,
    closed by disks normal to the axis, or by cones to a point on it. Once an element at the boundary has failed there
    is no such volume, and NaN is written. With a filling of that boundary it is that of the filling, the undeformed one
    and what the boundary has swept: below elements that have failed it stays as it was then.

    Parameters
    ----------
    name, every, every_passes: as of :class:`.Probe`.
    boundary: its name.
    position: a point that stays at its place [mm], (dim,), or None for flat caps.
    """

    def __init__(self, name: str, boundary: str, position: Sequence[float] | np.ndarray | None = None, *,
                 every: float | None = None, every_passes: int = 1) -> None:
        super().__init__(name, every=every, every_passes=every_passes)
        self.boundary, self.position = boundary, position

    def _prepared(self, scene: Scene) -> Columns:
        space = scene.space
        self._apex = None if self.position is None else position_of("position", self.position, space.dim)
        self._surface = Surface(space, self.boundary, scene.sample.nodes(self.boundary))
        if self._apex is None:
            self._surface.check_caps()
        before, size = self._surface.volume(space.X, self._apex), float(np.ptp(space.X, axis=0).max())
        if abs(before) < 1e-12 * size**space.volume_dim and (self._apex is not None or self._surface.rims()):
            raise ParameterError(f"the boundary {self.boundary!r} is flat, and encloses nothing")
        self._sign = 1.0 if before > 0.0 else -1.0  # a closed slit has none; it is a cavity
        self._before = before
        self._filling = next((k for k, load in enumerate(scene.pressures)
                              if isinstance(load, Filling) and load.boundary == self.boundary), None)
        return [("volume", "mm^3") if space.volume_dim == 3 else ("area", "mm^2")]

    def _values(self, view: View) -> np.ndarray:
        followers = view.body.loading.followers
        if self._filling is not None and followers is not None:  # swept is outwards, into the body
            return np.array([self._sign * (self._before - followers.swept(view.state.u)[self._filling])])
        if view.state.deleted[self._surface.elements].any():
            return np.array([np.nan])
        return np.array([self._sign * self._surface.volume(view.body.space.X + view.state.u, self._apex)])


class OpeningProbe(Probe):
    """Distance of two points or boundaries, as of the lips of a notch, and by how much it has grown.

    A point is one of the undeformed body, and goes with it; a boundary is the mean of its nodes.

    Parameters
    ----------
    name, every, every_passes: as of :class:`.Probe`.
    one, other: coordinates in the undeformed body [mm], (dim,), or the name of a boundary.
    """

    def __init__(self, name: str, one: str | Sequence[float] | np.ndarray, other: str | Sequence[float] | np.ndarray, *,
                 every: float | None = None, every_passes: int = 1) -> None:
        super().__init__(name, every=every, every_passes=every_passes)
        self.one, self.other = one, other

    def _prepared(self, scene: Scene) -> Columns:
        space, self._weights = scene.space, []
        for end in (self.one, self.other):
            if isinstance(end, str):
                nodes = scene.sample.nodes(end)
                self._weights.append((nodes, np.full(nodes.size, 1.0 / nodes.size)))
            else:
                places = find_places(space, position_of("the end of an opening", end, space.dim)[None])
                self._weights.append((space.conn[places.elements[0]], places.N[0]))
        self._before = self._distance(space.X)
        if self._before == 0.0 and isinstance(self.one, str) and self.one == self.other:
            raise ParameterError(f"the ends are one boundary, {self.one!r}")
        return [("distance", "mm"), ("opening", "mm")]

    def _distance(self, x: np.ndarray) -> float:
        a, b = (weights @ x[nodes] for nodes, weights in self._weights)
        return float(np.linalg.norm(a - b))

    def _values(self, view: View) -> np.ndarray:
        distance = self._distance(view.body.space.X + view.state.u)
        return np.array([distance, distance - self._before])


#: by the word of a deck
PROBE_KINDS: Mapping[str, type[Probe]] = {
    "point": PointProbe, "line": LineProbe, "mean": MeanProbe, "reaction": ReactionProbe, "volume": VolumeProbe,
    "opening": OpeningProbe}
RELEASE_RATE = "release_rate"  # the word of a deck for EnergyRelease, which has files of its own
KINDS = (*PROBE_KINDS, RELEASE_RATE)


def probe_of(table: Mapping[str, Any]) -> Observer:
    """The probe that a table of a deck asks for; see :mod:`skfsink.scene.tables`.

    Raises
    ------
    ParameterError
        It is of no kind, has what probes of its kind have not, or lacks what they need.
    """
    name, values = table["name"], {key: value for key, value in table.items() if key not in ("name", "kind")}
    if "kind" not in table:
        raise ParameterError(f"probe {name}: kind is missing; it must be one of {', '.join(KINDS)}")
    choose(f"probe {name}: kind", table["kind"], KINDS)
    if table["kind"] == RELEASE_RATE:
        if "every" not in values:
            raise ParameterError(f"probe {name}: a {RELEASE_RATE} needs every, as every = \"1 us\"")
        return EnergyRelease(**_only(name, RELEASE_RATE, values, ["every", "radius", "every_passes"]))
    make = PROBE_KINDS[table["kind"]]
    if make is OpeningProbe:
        return OpeningProbe(name, _end(name, values, "position", "boundary"), _end(name, values, "to", "to_boundary"),
                            **_only(name, table["kind"], values, ["every", "every_passes"]))
    taken = dict(list(signature(make.__init__).parameters.items())[2:])
    values = _only(name, table["kind"], values, taken)
    if missing := [key for key, parameter in taken.items() if parameter.default is Parameter.empty
                   and key not in values]:
        raise ParameterError(f"probe {name}: a {table['kind']} needs {missing[0]}")
    return make(name, **values)


def _only(name: str, kind: str, values: Mapping[str, Any], allowed: Iterable[str]) -> dict[str, Any]:
    if others := [key for key in values if key not in allowed]:
        raise ParameterError(f"probe {name}: {others[0]} is no key of a {kind}, which takes {', '.join(allowed)}")
    return dict(values)


def _end(name: str, values: dict[str, Any], point: str, boundary: str) -> Any:
    """One end of an opening, which leaves the values."""
    found = [values.pop(key) for key in (point, boundary) if key in values]
    if len(found) != 1:
        raise ParameterError(f"probe {name}: an opening needs {point} or {boundary}" + (", not both" if found else ""))
    return found[0]


def probes_of(scene: Scene) -> list[Observer]:
    """The probes that a scene asks for (ParameterError)."""
    return [probe_of(table) for table in scene.probes]
