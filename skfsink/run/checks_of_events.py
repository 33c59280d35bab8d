"""Checks before a dynamic run: is its loading slow enough to be static, and how many steps and files may it come to?"""

from __future__ import annotations

import logging
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..errors import ParameterError
from ..fem import indicators
from ..loads.schedule import Loading
from ..scene.scene import Scene

__all__ = ["Expected", "fastest", "refuse_events", "warn_of_events"]

log = logging.getLogger(__name__)

FAST = 0.01, 1.0           # speed of the grips, in c_s, past which inertia counts, and past which waves lag behind
STEPS = 1e7, 1e9           # of an event: the finest meshes of the scenes take 1e5
DAYS = 3.0                 # estimated computing time that is warned of [days]
FRAMES = 1e4, 1e6          # files in the folder of the series
ROWS = 1e6                 # of the history, which is held in memory
ROW_BYTES = 330.0
FRAME_BYTES = {2: 80.0, 3: 160.0}   # of an element, compressed
EXPLICIT_SECONDS, HHT_SECONDS = 3e-6, 5e-5  # of an element in a step, its share of the density solves with it


class Expected:
    """What the dynamic event of a scene may come to at the most, if it lasts for the whole of `event_time`.

    Attributes
    ----------
    dt: estimated step [s]; of the undeformed body, which is about that of the stretched one.
    steps, frames, rows: their numbers.   days: computing time.   bytes: of the frames and rows.
    """

    def __init__(self, scene: Scene) -> None:
        c, space = scene.controls, scene.sample.space
        if c.integrator == "explicit":
            self.dt = _explicit_step(scene)
        else:
            self.dt = c.hht.dt
        self.steps = c.event_time / self.dt
        seconds = EXPLICIT_SECONDS if c.integrator == "explicit" else HHT_SECONDS
        self.days = self.steps * space.n_elements * seconds / 86400.0
        self.frames, self.rows = c.event_time / c.frame_every, c.event_time / c.record_every
        self.bytes = self.frames * FRAME_BYTES[space.dim] * space.n_elements + self.rows * ROW_BYTES


def _explicit_step(scene: Scene) -> float:
    """About the stable step of the explicit scheme [s]: a dilatational wave across the narrowest element."""
    width, plane_stress = indicators.widths(scene.sample.space), scene.controls.element == "planestress"
    step = np.inf
    for part in scene.parts:
        m = part.material
        stiff = 4.0 * m.shear_modulus if plane_stress else m.bulk_modulus + 4.0 / 3.0 * m.shear_modulus
        step = min(step, float(width[part.elements].min()) / np.sqrt(stiff / m.rho0))
    waves = scene.sink_law.length_scale / (1e3 * max(part.material.shear_wave_speed for part in scene.parts))
    return min(0.75 * scene.controls.explicit.courant * step, 0.03 * waves)


def fastest(scene: Scene, loading: Loading) -> tuple[float, float]:
    """Greatest speed at which grips part, and at which tractions would move them; both in the slowest c_s.

    A traction is a speed by the strain rate it brings: the rate of the traction over 2 mu, times the size of the body.
    """
    space, held = scene.sample.space, ~loading.free.reshape(scene.sample.space.X.shape)
    slowest = 1e3 * min(part.material.shear_wave_speed for part in scene.parts)
    softest = min(part.material.shear_modulus for part in scene.parts)
    grips = pull = 0.0
    for t in (0.0, *loading.knots):
        if t >= scene.event_at:  # from there on nothing is static
            break
        v = loading.velocity(t)
        parts = [float(np.ptp(v[held[:, i], i])) for i in range(space.dim) if held[:, i].any()]
        grips = max(grips, float(np.linalg.norm(parts)))
        pull = max(pull, loading.pull(t))
    return grips / slowest, pull / (2 * softest) * float(np.ptp(space.X, axis=0).max()) / slowest


def refuse_events(scene: Scene, loading: Loading) -> None:
    """Refuse grips faster than waves before a static onset, and more steps or frames than can be made (ParameterError).
    """
    c, expected = scene.controls, Expected(scene)
    speed, pull = fastest(scene, loading)
    if c.start != "rest" and max(speed, pull) > FAST[1]:
        raise ParameterError(f"{_loads(scene, speed, pull)}, faster than waves (c_s = {_slowest(scene):.3g} m/s), and "
                             f"the loading to the onset is static: lower the rate, or take start = 'rest'")
    if expected.steps > STEPS[1]:
        raise ParameterError(f"an event_time of {c.event_time:.3g} s may take {expected.steps:.2g} steps of about "
                             f"{expected.dt:.2g} s (at most {STEPS[1]:g}): lower it to a few times the time in which "
                             f"the crack crosses the body, or raise the step, as by a coarser mesh")
    if expected.frames > FRAMES[1]:
        raise ParameterError(f"a frame every {c.frame_every:.3g} s may make {expected.frames:.2g} frames in an "
                             f"event_time of {c.event_time:.3g} s (at most {FRAMES[1]:g}): raise frame_every, or "
                             f"lower event_time")


def warn_of_events(scene: Scene, loading: Loading, folder: Path) -> None:
    """Warn of a loading in which inertia counts, and of days of computing or a full disk; files go into `folder`."""
    c, expected = scene.controls, Expected(scene)
    speed, pull = fastest(scene, loading)
    if c.start != "rest" and max(speed, pull) > FAST[0]:
        log.warning("%s, %.2g of c_s = %.3g m/s (above %g): the loading to the onset is static and leaves inertia "
                    "out; take start = 'rest', or lower the rate", _loads(scene, speed, pull), max(speed, pull),
                    _slowest(scene), FAST[0])
    if expected.steps > STEPS[0] or expected.days > DAYS:
        log.warning("the event may take %.2g steps of about %.2g s, %.2g days of computing, if it lasts for the whole "
                    "event_time of %.3g s: lower event_time", expected.steps, expected.dt, expected.days,
                    c.event_time)
    there = float(shutil.disk_usage(next(p for p in _above(folder) if p.exists())).free)
    if expected.frames > FRAMES[0] or expected.rows > ROWS or expected.bytes > there:
        log.warning("the event may leave %.2g frames and %.2g rows of the history, about %.2g GB (there are %.2g GB), "
                    "if it lasts for the whole event_time of %.3g s: lower event_time, or raise frame_every and "
                    "record_every", expected.frames, expected.rows, expected.bytes / 1e9, there / 1e9, c.event_time)


def _slowest(scene: Scene) -> float:
    return min(part.material.shear_wave_speed for part in scene.parts)


def _loads(scene: Scene, speed: float, pull: float) -> str:
    """What is fast, and how fast."""
    if speed >= pull:
        return f"grips part at {speed * _slowest(scene):.3g} m/s"
    what = "tractions" if scene.tractions else "pressures"
    return f"{what} strain the body as grips that part at {pull * _slowest(scene):.3g} m/s"


def _above(folder: Path) -> Iterator[Path]:
    yield folder.absolute()
    yield from folder.absolute().parents
