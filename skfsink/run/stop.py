"""When a run ends before its time: the conditions of its scene, looked at with its records."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..scene.scene import Scene
from ..scene.stop import Condition, read_stop
from .observers.view import View

__all__ = ["Stop"]

#: whether a condition of that name holds, of a view and the limit
_MET: dict[str, Callable[[View, float], Any]] = {
    "arrival": lambda view, _: view.tracker.arrival is not None,
    "branching": lambda view, _: view.tracker.max_branches > 1,
    "separated": lambda view, _: view.tracker.separated,
    "crack_length": lambda view, limit: view.tips.length > limit,
    "displacement": lambda view, limit: view.displacement > limit,
    "time": lambda view, limit: view.state.phase == "event" and not view.quasistatic and view.state.time > limit,
    "passes": lambda view, limit: view.state.phase == "event" and view.quasistatic and view.state.step > limit,
}


class Stop:
    """Says why a run is to end now, looked at after each load increment, with each record of a dynamic event, when the
    crack arrives or branches, and after each pass.

    It depends on the state alone, so that a resumed run ends where one without an interruption does.

    Parameters
    ----------
    scene: whose `controls.stop` names conditions, or is a function of the :class:`.View` that gives true, or a text
        that says why, when the run is to end.
    """

    def __init__(self, scene: Scene) -> None:
        self._stop, self._every = read_stop(scene.controls.stop), scene.controls.record_every

    def __call__(self, view: View) -> str:
        """The reason, to follow "because"; empty where the run goes on."""
        if not self._stop or not self._looks(view):
            return ""
        if isinstance(self._stop, tuple):
            met: Any = next((condition for condition in self._stop if _met(condition, view)), "")
        else:
            found = self._stop(view)
            met = found if isinstance(found, str) else getattr(self._stop, "__name__", "the function") if found else ""
        return f"it was to stop at {met}" if met else ""

    def _looks(self, view: View) -> bool:
        return (view.occasion != "step" or view.quasistatic or bool(view.moment)
                or view.crossed_multiple_of(self._every))


def _met(condition: Condition, view: View) -> bool:
    return bool(_MET[condition.name](view, condition.limit))
