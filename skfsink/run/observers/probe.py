"""Probes: observers that follow quantities through a run, of points, along lines and over surfaces."""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...errors import MeshError, ParameterError, require
from ...fem.places import find_places
from ...fem.surface import Surface
from ...fields.quantities import USUAL, quantities_of
from ...results.probes import PHASES, PROBES, ProbeFile, column_name
from ...scene.scene import Scene
from ...system.files import prepare_folder
from .observer import Recorder
from .view import View

__all__ = ["LineProbe", "MeanProbe", "PointProbe", "Probe", "position_of"]

_AXES = ("x", "y", "z")
Columns = Sequence[tuple[str, str]]  # names and units


class Probe(Recorder):
    """Base of the probes: writes `probes/NAME.csv`, a row at each look, in the loading after each increment.

    It looks in the event as the history does, or every so often, and where the crack branches or arrives. A class that
    derives from it says in `_prepared` what it follows, with columns and units, and in `_values` their values.

    Memory: the `rows` so far, as :meth:`.ProbeFile.append` takes them; what `open` finds in the scene is used by
    `prepare`, `loading`, `look` and `unfailed`.

    Parameters
    ----------
    name: of the probe and of its file: letters, digits, and . _ - after the first one.
    every: time between two looks [s]; None looks when the history has a row.
    every_passes: passes between two looks in a quasi-static event.

    Raises
    ------
    ParameterError
        It has no such name.
    """

    def __init__(self, name: str, *, every: float | None = None, every_passes: int = 1) -> None:
        if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,59}", name):
            raise ParameterError(f"the name of a probe must be up to 60 letters, digits and . _ -, as it is that of a "
                                 f"file; got {name!r:.80}")
        super().__init__()
        self.label, self.every, self.every_passes = name, every, every_passes

    @property
    def name(self) -> str:
        """What a checkpoint calls it."""
        return f"probe {self.label}"

    # --- what it follows ---
    @abstractmethod
    def _prepared(self, scene: Scene) -> Columns:
        """Find what is followed in a scene; names and units of the columns (SkfsinkError)."""

    @abstractmethod
    def _values(self, view: View) -> np.ndarray:
        """Their values now, (columns,), or (m, columns) for several rows."""

    def check(self, scene: Scene) -> None:
        """Refuse what the scene has not (SkfsinkError); the line names the probe."""
        self._columns_in(scene)

    def _columns_in(self, scene: Scene) -> Columns:
        try:
            return self._prepared(scene)
        except (MeshError, ParameterError) as error:
            raise type(error)(f"probe {self.label}: {error}") from None

    # --- the run ---
    def open(self, view: View, memory: Mapping[str, Any] | None = None) -> None:
        """Find what is followed, and take up the rows so far."""
        super().open(view, memory)
        self._names = [column_name(name, unit) for name, unit in self._columns_in(view.scene)]

    def prepare(self, view: View) -> None:
        """Begin the file with the rows so far."""
        folder = prepare_folder(view.folder / PROBES, overwrite=True)
        self._file = ProbeFile(folder / f"{self.label}.csv", self._names, self.rows)

    def loading(self, view: View) -> None:
        """The row of a load increment."""
        self.look(view)

    def due(self, view: View) -> bool:
        """When it is time, and when the crack branches or arrives."""
        if view.quasistatic:
            return bool(view.moment) or view.crossed_multiple_of(self.every_passes)
        every = view.scene.controls.record_every if self.every is None else self.every
        return bool(view.moment) or view.crossed_multiple_of(every)

    def look(self, view: View) -> None:
        """Add a row, or those of a line."""
        state, values = view.state, np.atleast_2d(self._values(view))
        event = state.phase != "loading"
        time = 0.0 if event and view.quasistatic else state.time
        first = [float(PHASES.index("event" if event else "loading")), state.step, time, view.displacement]
        rows = np.column_stack([np.tile(first, (len(values), 1)), values])
        self._rows.append(rows)
        self._file.append(rows)


def position_of(what: str, value: Any, dim: int) -> np.ndarray:
    """A point of a body of that dimension [mm], (dim,).

    Raises
    ------
    ParameterError
        It is none; `what` it is follows.
    """
    plain = value.tolist() if isinstance(value, np.ndarray) else value
    if not isinstance(plain, list | tuple) or len(plain) != dim:
        raise ParameterError(f"{what} must be {dim} coordinates [mm], as the mesh; got {plain!r:.80}")
    return np.array([require(f"{what} [{i}]", x, "mm") for i, x in enumerate(plain)])


class PointProbe(Probe):
    """Quantities at a point of the undeformed body.

    Displacement, velocity and gamma are interpolated; all others are means over the element that holds the point.

    Parameters
    ----------
    name, every, every_passes: as of :class:`Probe`.
    position: of the point in the undeformed body [mm], (dim,).
    quantity: names of :data:`.QUANTITIES`, with commas.

    Raises
    ------
    ParameterError
        A quantity is unknown.
    """

    def __init__(self, name: str, position: Sequence[float] | np.ndarray, quantity: str = USUAL, *,
                 every: float | None = None, every_passes: int = 1) -> None:
        super().__init__(name, every=every, every_passes=every_passes)
        self.position, self.quantity = position, quantity

    def _points(self, scene: Scene) -> np.ndarray:
        return position_of("position", self.position, scene.space.dim)[None]

    def _prepared(self, scene: Scene) -> Columns:
        self._quantities = quantities_of(self.quantity)
        self._places = find_places(scene.space, self._points(scene))
        return [(name, one.unit) for one in self._quantities for name in one.names(scene.space.dim)]

    def _values(self, view: View) -> np.ndarray:
        return np.hstack([one.values(view.body.momentum, view.state, self._places) for one in self._quantities])


class LineProbe(PointProbe):
    """The same at points at equal distances on a straight line, from `position` to `to`: a row for each at every look.

    Their distance from the first one and their coordinates in the undeformed body are columns.

    Parameters
    ----------
    name, position, quantity, every, every_passes: as of :class:`PointProbe`.
    to: the other end [mm], (dim,).
    points: their number, >= 2.
    """

    def __init__(self, name: str, position: Sequence[float] | np.ndarray, to: Sequence[float] | np.ndarray,
                 points: int, quantity: str = USUAL, *, every: float | None = None, every_passes: int = 1) -> None:
        super().__init__(name, position, quantity, every=every, every_passes=every_passes)
        self.to, self.points = to, points

    def _points(self, scene: Scene) -> np.ndarray:
        number = int(require("points", self.points, low=2, high=100_000, whole=True))
        dim = scene.space.dim
        first, last = position_of("position", self.position, dim), position_of("to", self.to, dim)
        if not (first != last).any():
            raise ParameterError("position and to are one point, and no line")
        return first + np.linspace(0.0, 1.0, number)[:, None] * (last - first)

    def _prepared(self, scene: Scene) -> Columns:
        columns, points = super()._prepared(scene), self._points(scene)
        self._fixed = np.column_stack([np.linalg.norm(points - points[0], axis=1), points])
        return [("s", "mm"), *((axis, "mm") for axis in _AXES[:scene.space.dim]), *columns]

    def _values(self, view: View) -> np.ndarray:
        return np.column_stack([self._fixed, super()._values(view)])


class MeanProbe(Probe):
    """Means of quantities over the surface at a boundary, per undeformed area.

    Parameters
    ----------
    name, every, every_passes: as of :class:`Probe`.
    boundary: its name; a facet belongs to it if all its nodes do.
    quantity: names of :data:`.QUANTITIES`, with commas.
    """

    def __init__(self, name: str, boundary: str, quantity: str = USUAL, *, every: float | None = None,
                 every_passes: int = 1) -> None:
        super().__init__(name, every=every, every_passes=every_passes)
        self.boundary, self.quantity = boundary, quantity

    def _prepared(self, scene: Scene) -> Columns:
        self._quantities = quantities_of(self.quantity)
        surface = Surface(scene.space, self.boundary, scene.sample.nodes(self.boundary))
        self._places, weights = surface.places()
        self._weights = weights / weights.sum()
        return [(name, one.unit) for one in self._quantities for name in one.names(scene.space.dim)]

    def _values(self, view: View) -> np.ndarray:
        return np.hstack([self._weights @ one.values(view.body.momentum, view.state, self._places)
                          for one in self._quantities])
