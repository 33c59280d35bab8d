"""What became of a run, in one line: cracked, arrested, still running, failed everywhere, or not failed at all."""

from __future__ import annotations

import numpy as np

from ..errors import place_text
from ..scene.scene import Scene
from .observers.places import greatest_ratio
from .simulate import Simulation

__all__ = ["verdict"]

SOFTENED = 0.99  # least gamma of a body that has kept its strength


def verdict(scene: Scene, simulation: Simulation) -> str:
    """One line on what happened in a finished run."""
    state, tracker, event = simulation.state, simulation.crack.tracker, scene.controls.event_time
    if simulation.unfailed:
        ratio, place = greatest_ratio(simulation.density, simulation.body.since_begun(state))
        least = float(simulation.body.kept(state.gamma).min())
        soft = f"; the body has softened to gamma = {least:.3g}" if least < SOFTENED else ""
        return (f"nothing failed: the greatest W/Phi was {ratio:.3g}, at {place_text(place)} mm, where points fail "
                f"near 1{soft}; the loading ended because {simulation.unfailed}")
    if simulation.dissolved:
        return f"failed everywhere at once, {_when(scene, state.time)}: no place of it was weaker than another"
    cracked = np.isfinite(tracker.cracked_at)
    if simulation.ended:
        where = f"the leading tip is at {_tip(scene, simulation)}" if cracked.any() else "nothing has cracked yet"
        return f"ended {_when(scene, state.time)}, because {simulation.ended}; {where}"
    even = simulation.guard.even
    quasistatic = scene.controls.analysis == "quasistatic"
    model = str(scene.model_choice.get("model", ""))
    if not cracked.any() and model.partition("-")[0] == "onset":
        return f"only the onset was computed, as by the model {model}: it leaves out the crack"
    if not cracked.any():
        why = ("the body is loaded evenly, and no place of it is weaker than another; its result is the greatest load"
               if even else simulation.statics.arrested or "what has begun takes a longer event_time to run away")
        when = "past the onset" if quasistatic else f"in the event_time of {event:g} s"
        return f"nothing cracked {when}, least gamma {simulation.body.kept(state.gamma).min():.3g}: {why}"
    if tracker.separated:
        first = "" if tracker.arrival is None else f", arrived first {_when(scene, tracker.arrival)}"
        return f"cracked and separated{first}; apart {_when(scene, simulation.crack.separated_at)}"
    tip = _tip(scene, simulation)
    arrived = "" if tracker.arrival is None else f" after it had arrived {_when(scene, tracker.arrival)}"
    if quasistatic and simulation.statics.arrested:
        return f"arrested at {tip}{arrived}: {simulation.statics.arrested}"
    if simulation.history.rows[-1]["tips"]:
        return f"the crack was still running at event_time = {event:g} s{arrived and ','}{arrived}: its tip is at {tip}"
    return f"arrested at {tip}{arrived}: no tip has moved for 5 l/c_s at the end of the event"


def _tip(scene: Scene, simulation: Simulation) -> str:
    """Where the leading tip is."""
    last = simulation.history.rows[-1]
    return f"{place_text(last[f'tip_{x}_mm'] for x in 'xyz'[:scene.sample.space.dim])} mm"


def ending(scene: Scene, simulation: Simulation) -> str:
    """Why a finished run has ended, to follow \"because\"."""
    if simulation.ended or simulation.unfailed:
        return simulation.ended or simulation.unfailed
    if simulation.dissolved:
        return "the body failed everywhere at once"
    if simulation.crack.tracker.separated:
        return "the sample came apart"
    if scene.controls.analysis == "quasistatic":
        return simulation.statics.arrested or "the passes changed nothing any more"
    return f"event_time = {scene.controls.event_time:g} s was over"


def _when(scene: Scene, clock: float) -> str:
    """A time of the event, or a pass."""
    return f"in pass {clock:.0f}" if scene.controls.analysis == "quasistatic" else f"at {clock * 1e6:.4g} µs"
