"""What a person sees of a run, and the checkpoints that let it go on."""

from __future__ import annotations

import time

from ...errors import Interrupted
from ...results.history import history_units
from ..display import Display
from .observer import Observer
from .view import View

__all__ = ["Checkpoint", "Progress"]


class Progress(Observer):
    """Shows how far a run is, and the figures that matter.

    Parameters
    ----------
    display: where.
    every: time between two looks in the event [s].
    """

    def __init__(self, display: Display, every: float) -> None:
        self.display, self.every = display, every

    def loading(self, view: View) -> None:
        """After each load increment."""
        tolerance, state = view.scene.controls.statics.onset_tolerance, view.state
        done = 0.5 * min(1.0, tolerance * state.grip / (view.increment or float("inf"))) ** 0.25
        self.display.update(done, f"grips {view.displacement:.4f} mm  load {view.load:.4f} {_unit(view)}  "
                                  f"least γ {view.body.kept(state.gamma).min():.3f}")

    def due(self, view: View) -> bool:
        """At each record, and when the crack arrives."""
        return bool(view.moment) or super().due(view)

    def look(self, view: View) -> None:
        """Show the event, which is as far as its clock, or as its crack."""
        if view.occasion != "step":
            return
        state, tips, ledger, X = view.state, view.tips, view.state.ledger, view.body.space.X
        size = float((X.max(axis=0) - X.min(axis=0)).max())
        done = 0.0 if view.quasistatic else state.time / view.end
        tip = (f"tip {tips.position[0]:.2f}, {tips.position[1]:.2f} mm ×{tips.branches}" if tips.branches
               else "no tip yet")
        rejected = 0 if view.integrator is None else view.integrator.rejected
        again = f"  {rejected} steps rejected" if rejected else ""
        clock = f"pass {state.step}" if view.quasistatic else f"{state.time * 1e6:.1f} µs"
        self.display.update(max(done, 0.9 * tips.length / size), (
            f"{clock}  {tip}  load {view.load:.3f} {_unit(view)}  elastic {ledger.elastic:.4f} "
            f"kinetic {ledger.kinetic:.4f} D {ledger.sink:.4f} U {ledger.paper:.4f}{again}"))


def _unit(view: View) -> str:
    """Of the load."""
    return history_units(view.body.space.volume_dim)["reaction_N_per_mm"]


class Checkpoint(Observer):
    """Has a checkpoint written now and then, and when the run is asked to stop.

    Memory: when the last one was written.

    Parameters
    ----------
    wall: time between checkpoints, of the clock on the wall [s].
    """

    def __init__(self, wall: float) -> None:
        self.wall, self._last = wall, time.perf_counter()

    def due(self, view: View) -> bool:
        """It looks between the steps."""
        return False

    def pause(self, view: View) -> None:
        """Save when it is time, and stop when asked to.

        Raises
        ------
        Interrupted
            Ctrl-C or SIGTERM.
        """
        stop = view.stop_asked()
        if stop or time.perf_counter() - self._last > self.wall:
            view.save()
            self._last = time.perf_counter()
            if stop or view.stop_asked():
                raise Interrupted("interrupted")
