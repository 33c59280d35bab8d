"""Bodies and runs for the tests of the guards."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from skfsink.errors import Interrupted
from skfsink.fields.body import Body
from skfsink.fields.state import State
from skfsink.material import AAA, SinkLaw
from skfsink.meshing.sample import Sample
from skfsink.run.display import Display
from skfsink.run.observers.crack import tracker_of
from skfsink.run.observers.guard import Guard
from skfsink.run.observers.observer import Observer
from skfsink.run.observers.view import View
from skfsink.run.simulate import Simulation
from skfsink.scene.controls import Controls
from skfsink.scene.scene import Scene
from skfsink.study.blocks import block
from skfsink.study.plate import PULLED, Plate

PLAIN = block(15)      # h = l/1.5, without a notch: nothing to warn of
NOTCHED = Plate(block(15, notch=0.4, width=0.06))
SHARP = r"a notch turns by 90 degrees"  # what a notch cut out of rows of elements always gives


def scene(sample: Sample = PLAIN, material: AAA | None = None, law: SinkLaw | None = None, **controls: Any) -> Scene:
    """A block between grips."""
    return Scene("block", "Block", {}, sample, material or AAA(), law or SinkLaw(), PULLED,
                 controls=Controls(**controls))


class Watched:
    """A guard with a state in order: intact, a little stretched, a closed ledger with an energy of 1 at the onset."""

    def __init__(self, of: Scene | None = None, stretch: float = 0.01) -> None:
        self.scene = of or scene()
        space, body = self.scene.sample.space, Body.of(self.scene)
        self.momentum, self.guard, self.state = body.momentum, Guard(1e-6), State.intact(space)
        tracker = tracker_of(self.scene, body)
        self.view = View(self.scene, Path(), body, tracker, tracker.nothing(), self.state)
        self.guard.open(self.view)
        self.guard.scale = 1.0
        self.state.phase = "event"
        self.state.u = space.X * (np.array([1 / (1 + stretch), 1 + stretch]) - 1)
        self.state.ledger.initial = self.state.ledger.elastic = 1.0
        self.update()

    def update(self) -> None:
        """Evaluate the force."""
        self.momentum.set_gamma(self.state.gamma, self.state.deleted)
        self.momentum.force(self.state.u)


class Stop(Observer):
    """Stops a run between two steps, with a checkpoint, as Ctrl-C does after a number of steps."""

    def __init__(self, after: int) -> None:
        self.left = after

    def due(self, view: View) -> bool:
        return False

    def pause(self, view: View) -> None:
        self.left -= 1
        if self.left == 0:
            view.save()
            raise Interrupted("stopped")


def simulation(of: Scene, folder: Path, *observers: Observer) -> Simulation:
    """A run of a scene in a folder."""
    folder.mkdir(exist_ok=True)
    return Simulation(of, folder, Display(True), observers=observers)


def event(folder: Path, **controls: Any) -> Simulation:
    """A run of the notched block from its onset on, not yet started."""
    controls = {"event_time": 1e-5, "overshoot": 0.01, "checkpoint_every": 1e6, **controls}
    return simulation(dataclasses.replace(NOTCHED.scene, controls=Controls(**controls)), folder)
