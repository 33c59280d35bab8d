"""Energy release rate of each tip that advances, and of the notch at the onset, while a run goes on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...errors import ParameterError, require
from ...fields.crack import Plane
from ...fields.release_rate import RADIUS, energy_release_rate
from ...results.release import RELEASE, load_release, release_header, write_release
from .notch_tip import notch_tip, through
from .observer import Observer
from .places import symmetry_planes
from .view import View

__all__ = ["EnergyRelease"]

BACK = 3.0   # length, in l, over which the direction of a crack is looked for
ROOT = 3.0   # length, in l, over which the surface of a notch tells into where it points
JUMP = 3.0   # distance, in l, which a tip may have gone between two looks


class EnergyRelease(Observer):
    """Writes G of each tip into `release.csv`, and draws it against time into `release.png`.

    A tip is one of the tracker's that advances; its direction is that of the last 3 l of its crack. At the onset it is
    the notch, or the initial crack, at which the body begins to fail. On a plane of symmetry along the crack, G is that
    of the whole body. In 3D the front runs through the sheet, from one of its `faces` to the other. A row without a G
    says in `note` why. G scatters, as elements fail one by one and gamma is solved for at intervals; its mean over the
    last 4 l/c_s is beside it. The history of the run has the greatest G of a look, and the speed of that tip.

    Memory: the rows so far, the last places of each tip, which tell its speed, and when it last looked; `greatest` is
    of that look.

    Parameters
    ----------
    every: time between two looks [s].
    radius: of the domain, in lengths l of the sink law, >= 3.
    every_passes: passes between two looks in a quasi-static event.

    Attributes
    ----------
    rows: as :func:`.release_header` names them.

    Raises
    ------
    ParameterError
        A parameter is out of its range, or, when a run begins, its body is viscous.
    """

    kept = ("rows", "trails", "looked")

    def __init__(self, every: float, radius: float = RADIUS, every_passes: int = 1) -> None:
        self.every = require("every", every, "s", low=0, low_open=True)
        self.radius = require("radius", radius, "lengths l", low=3)
        self.every_passes = int(require("every_passes", every_passes, low=1, whole=True))
        self.rows: list[list[Any]] = []
        self.trails: dict[str, list[list[float]]] = {}  #: [time, x, y(, z)] of each tip, by its number
        self.looked = -1.0  #: time or pass of the last look

    def open(self, view: View, memory: Mapping[str, Any] | None = None) -> None:
        """Refuse a viscous body; take up the rows so far."""
        super().open(view, memory)
        if view.body.momentum.is_viscous and not view.quasistatic:
            raise ParameterError("EnergyRelease cannot look at a viscous body: what viscosity takes on the way to the "
                                 "tip makes G depend on the domain; leave the viscosity out")
        self._planes = [plane for _, plane in symmetry_planes(view.scene)]
        view.release = view.release or self.greatest

    def onset(self, view: View) -> None:
        """G of the notch, or of the initial crack, at which the body begins to fail."""
        node = int(np.argmin(view.body.kept(view.state.gamma)))
        if (tip := self._end_of_crack(view, node)) is not None:
            self._add(view, "onset", 0, *tip, math.nan, "")
            return
        faces = [view.scene.sample.nodes(name) for name in view.scene.faces]
        found = notch_tip(view.body.space, node, ROOT * view.tracker.l, [plane.nodes for plane in self._planes] + faces,
                          [plane.axis for plane in self._images(view, view.body.space.X[node])
                           if isinstance(plane.axis, int)], view.body.broken)
        if found is None:
            self._add(view, "onset", 0, view.body.space.X[node], None, math.nan, "it begins to fail at no notch")
        else:
            self._add(view, "onset", 0, *found, math.nan, "")

    def _end_of_crack(self, view: View, node: int) -> tuple[np.ndarray, np.ndarray] | None:
        """Place and direction of the end of an initial crack, along a line, within three elements of a node."""
        space = view.body.space
        near = 3 * float(space.h[(space.conn == node).any(axis=1)].max())
        ends = [(float(np.linalg.norm(place - space.X[node])), place, direction)
                for crack in view.scene.cracks for place, direction in crack.tips]
        distance, place, direction = min(ends, key=lambda end: end[0], default=(math.inf, None, None))
        return None if distance > near or place is None or direction is None else (place, direction)

    def look(self, view: View) -> None:
        """G of the tips that advance, as they were last found."""
        tips, tracker, time = view.tips, view.tracker, view.state.time
        if time == self.looked:
            return
        self.looked = time
        for node in tips.nodes[tracker.advances(time, tips.nodes)]:
            place = view.body.space.X[node]
            back = tracker.backwards(int(node), BACK * tracker.l)
            number = self._number(time, place, JUMP * tracker.l)
            note = "" if back is not None else "the crack is too short to have a direction"
            self._add(view, "event", number, place, None if back is None else -back, self._speed(view, number), note)

    def greatest(self, view: View) -> tuple[float, float]:
        """The greatest G of a tip at the last look [N/mm], at this moment where it is due, and the speed of that tip
        [m/s]; NaN without one."""
        if view.occasion != "step" or self.due(view):
            self.look(view)
        header = release_header(view.body.space.dim, view.clock)
        place, speed = header.index("G_N_per_mm"), header.index("speed_m_per_s")
        found = []
        for row in reversed(self.rows):
            if row[:2] != ["event", self.looked]:
                break
            if not math.isnan(row[place]):
                found.append((row[place], row[speed]))
        return max(found, key=lambda one: one[0], default=(math.nan, math.nan))

    def _number(self, time: float, place: np.ndarray, jump: float) -> int:
        """The number of the tip that was nearest to a place; a new one if none was near."""
        best, least = "", jump
        for number, trail in self.trails.items():
            distance = float(np.linalg.norm(np.array(trail[-1][1:]) - place))
            if trail[-1][0] < time and distance < least:
                best, least = number, distance
        best = best or str(len(self.trails) + 1)
        self.trails.setdefault(best, []).append([time, *place.tolist()])
        return int(best)

    def _speed(self, view: View, number: int) -> float:
        """Slope of the place of a tip over the last 4 l/c_s, by least squares [m/s]; NaN in passes and at first."""
        if view.quasistatic:
            return math.nan
        trail = np.array([entry for entry in self.trails[str(number)] if entry[0] >= view.state.time - _window(view)])
        if len(trail) < 3:
            return math.nan
        t = trail[:, 0] - trail[:, 0].mean()
        return float(np.linalg.norm(t @ trail[:, 1:] / (t @ t))) * 1e-3

    def _add(self, view: View, phase: str, number: int, tip: np.ndarray, direction: np.ndarray | None, speed: float,
             note: str) -> None:
        """A row of a tip; without a direction it has a note."""
        dim = view.body.space.dim
        value, static, vector = math.nan, math.nan, np.full(dim, math.nan)
        if direction is not None:
            try:
                front = through(view.scene, tip) if dim == 3 else None
                if front is not None:
                    direction = direction - (direction @ front) * front
                images = self._images(view, tip)
                for plane in images:
                    direction = plane.within(direction)
                rate = energy_release_rate(view.body, view.state, tip, direction, self.radius * view.tracker.l,
                                           front=front)
                times = 2 ** len(images)
                direction, vector = rate.direction, times * rate.vector
                value, static = times * rate.G, times * rate.static
                for plane in images:
                    vector = plane.within(vector)
            except ParameterError as error:
                note = str(error)
        shown = np.full(dim, math.nan) if direction is None else direction
        mean = math.nan if view.quasistatic or phase == "onset" else self._mean(view, number, value)
        self.rows.append([phase, view.state.time, number, *tip.tolist(), *shown.tolist(), speed, value, mean, static,
                          *vector.tolist(), note])

    def _mean(self, view: View, number: int, value: float) -> float:
        """Mean of the G of a tip over the last 4 l/c_s, with its `value` now [N/mm]; NaN if there was none."""
        column = release_header(view.body.space.dim, view.clock).index("G_N_per_mm")
        values = [value]
        for row in reversed(self.rows):
            if row[0] != "event" or row[1] < view.state.time - _window(view):
                break
            if row[2] == number:
                values.append(row[column])
        known = [one for one in values if not math.isnan(one)]
        return sum(known) / len(known) if known else math.nan

    def _images(self, view: View, tip: np.ndarray) -> list[Plane]:
        """The planes of symmetry that a tip is on, nearer than l, so that its crack runs along them."""
        X, l = view.body.space.X, view.tracker.l
        return [plane for plane in self._planes if plane.height(tip[None], X[plane.nodes[0]])[0] < l]

    def finish(self, view: View) -> None:
        """Write the file, and draw the picture."""
        from ...pictures.release import release_picture

        self._write(view)
        law = view.scene.sink_law
        release_picture(load_release(view.folder / RELEASE), view.folder / "release.png", view.scene.title,
                        law.failure_energy * law.length_scale)

    def unfailed(self, view: View) -> None:
        """Write the file, which has no rows."""
        self._write(view)

    def _write(self, view: View) -> None:
        write_release(view.folder / RELEASE, release_header(view.body.space.dim, view.clock), self.rows)


def _window(view: View) -> float:
    """4 l/c_s [s], over which the speed of a tip is fitted as well."""
    return 4 * view.tracker.l / (view.body.momentum.shear_wave_speeds[0] * 1e3)

