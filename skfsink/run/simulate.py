"""A run from the intact sample to the broken one: loading to the onset, then the event, dynamic or quasi-static."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ..errors import CheckpointError, ConvergenceError, Interrupted
from ..fem.direct import one_thread_of_openblas
from ..fields.body import Body
from ..fields.frame_fields import ON_REQUEST, asked_fields
from ..fields.state import State
from ..methods.integrators import Integrator
from ..methods.ranks.integrator import RankOptions, integrator_of
from ..methods.ranks.statics import statics_of
from ..methods.rest import LoadingFromRest
from ..methods.statics import Statics
from ..scene.scene import Scene
from .checkpoint import CHECKPOINT, load_checkpoint, save_checkpoint, save_state
from .checks import warn
from .cost import Cost
from .display import Display, Interrupt
from .memory import linear_of
from .notes import Notes
from .observers.crack import Crack, tracker_of
from .observers.fragments import Fragments
from .observers.frames import Frames
from .observers.guard import Guard
from .observers.history import Deletions, History
from .observers.observer import Observer, Observers
from .observers.onset import Onset, Strength
from .observers.places import check_arrival, onset_text
from .observers.probe_surfaces import probes_of
from .observers.progress import Checkpoint, Progress
from .observers.range import check_scene
from .observers.view import View
from .stop import Stop
from .unreached import unreached

__all__ = ["Loaded", "Simulation", "standard_observers"]

log = logging.getLogger(__name__)


class Loaded(NamedTuple):
    """A state at the onset, and the memory of :class:`.Strength` on the way to it."""

    state: State
    strength: Mapping[str, Any] = MappingProxyType({"greatest": {}})


class Simulation:
    """One run of a scene in a folder, resumable at any moment.

    Memory: the whole run: `run` goes on from where it is; `unfailed`, `dissolved`, `ended`, `cost` and `checkpoint` are
    of the run so far.

    Parameters
    ----------
    scene: what to run; its analysis is "dynamic" or "quasistatic".
    folder: where `history.csv`, the series and the checkpoint go; it must exist.
    display: what the person sees.
    resume: take up the run where the checkpoint in `folder` left it.
    observers: a user's, beside those of every run or in their place; see :class:`.Observer`.
    ranks: what several ranks are asked for.

    Raises
    ------
    CheckpointError
        The checkpoint to resume from is missing, damaged, or of another scene, version, or other observers.
    ParameterError
        The observers cannot be those of a run; see :class:`.Observers`.

    Attributes
    ----------
    ended: why it ended before its time, as :class:`.Stop` says it; empty where it did not.
    """

    PATIENCE = 400.0  # a body that comes from rest in motion may take this many times `event_time` to crack
    SPENT = 1e-4      # of the energy at the onset: with less, a separated body is at rest
    CHECKPOINT = CHECKPOINT
    ONSET = "onset.npz"

    def __init__(self, scene: Scene, folder: Path, display: Display, resume: bool = False,
                 observers: Sequence[Observer] = (), ranks: RankOptions = RankOptions()) -> None:  # noqa: B008
        # a checkpoint that cannot be used is refused before any file is touched
        stored = load_checkpoint(folder / self.CHECKPOINT, scene.fingerprint) if resume else None
        if stored and "run" not in stored.memories:
            path = folder / self.CHECKPOINT
            raise CheckpointError(f"the checkpoint {path} is damaged: it is a state without its run")
        memory = stored.memories.pop("run") if stored else {}
        self.scene, self.folder, self.display, self._ranks = scene, folder, display, ranks
        self.body = Body.of(scene)
        self.momentum, self.density, self.free = self.body.momentum, self.body.density, self.body.free
        self.statics = statics_of(self.body, replace(scene.controls.statics, linear=linear_of(scene)))
        self.statics.until = scene.event_at
        self.notes = Notes(display.say, memory.get("warnings", ()))
        self.state = stored.state if stored else self.body.begin(State.intact(self.body.space))
        self.costs, self.ended = Cost(memory.get("cost")), str(memory.get("ended", ""))
        self._stop = Stop(scene)
        self.integrator: Integrator | None = None
        self._from_rest: LoadingFromRest | None = None
        tracker = tracker_of(scene, self.body)
        self.view = View(scene, folder, self.body, tracker, tracker.nothing(), self.state, save=self._save)
        self.observers = Observers(standard_observers(scene, display), (*probes_of(scene), *observers), resume)
        of = self.observers.of
        self.crack, self.guard, self.frames = of(Crack), of(Guard), of(Frames)
        self.onset, self.strength, self.history = of(Onset), of(Strength), of(History)
        memories = stored.memories if stored else {}
        self.observers.open(self.view, {name.removeprefix("observer "): kept for name, kept in memories.items()
                                        if name.startswith("observer ")} if stored else None)
        if stored:
            self._restore(memories)

    # --- the phases ---
    def run(self, onset: Loaded | None = None) -> State:
        """Run to the end from where the state is, or from a state that another run has loaded to the onset."""
        with Interrupt() as interrupt, self.notes, one_thread_of_openblas(), closing(self.observers):
            self.view.stop_asked = interrupt.heeded
            if self.state.phase == "loading":
                self._load(onset)
                if self.unfailed:
                    self.observers.unfailed(self.view)
                    self.state.phase = "done"
                else:
                    self._begin_event()
            if self.state.phase == "event":
                self.display.phase(self.scene.controls.analysis)
                if self.scene.controls.analysis == "quasistatic":
                    self._propagate()
                else:
                    self._integrate()
                self.state.phase = "done"
                if not self.dissolved:
                    check_arrival(self.scene, self.crack.tracker)
            self.costs.lap("event")
            self.checkpoint()
            if interrupt.heeded():
                raise Interrupted("interrupted")
        return self.state

    @property
    def unfailed(self) -> str:
        """Why the loading ended without a failure; empty where there was one, or it still goes on."""
        return "" if self._from_rest else self.statics.unfailed

    @property
    def dissolved(self) -> bool:
        """Whether a body that was loaded evenly has failed everywhere at once."""
        return self.guard.dissolved

    def _load(self, onset: Loaded | None) -> None:
        """Load to the onset, or take up the state of another run there."""
        check_scene(self.scene)
        warn(self.scene, self.folder)
        if onset is None:
            self._increase()
            if self.unfailed:
                return
        else:
            self.state = onset.state.copy()
            self.strength.restore(onset.strength)
            self.observers.loading(self.view.at(self.state, self.body.take(self.state)))
        self.view.on_time = self.state.grip >= self.scene.event_at
        if not self.view.on_time and self.scene.event_at < np.inf:
            log.warning("the body begins to fail at load time %.4g s, before event_at = %.4g s: the event begins "
                        "there, without the velocities asked for; lower event_at, or the load", self.state.grip,
                        self.scene.event_at)
        self.observers.onset(self.view.at(self.state, self.momentum.force(self.state.u)))
        if onset is None:
            save_state(self.folder / self.ONSET, self.scene.fingerprint, self.state)

    def _increase(self) -> None:
        """Increase the load up to the onset."""
        self.display.phase("loading")
        state, view = self.state, self.view
        if self.scene.controls.start == "rest" and self._from_rest is None:
            self._make_integrator()
        loading: LoadingFromRest | Statics = self._from_rest or self.statics
        for _ in loading.load(state):
            view.increment = loading.increment
            self.observers.loading(view.at(state, self.momentum.force(state.u), way=self.statics.clock.way(state.grip)))
            if loading is self.statics and (ended := self._stop(view)):
                self.ended = self.statics.unfailed = ended
                break
            self.observers.pause(view)
        if state.grip >= self.scene.event_at and not self.ended:  # whether anything moved up to there or not
            self.statics.unfailed = ""
        self.costs.lap("loading")

    def _begin_event(self) -> None:
        """Start a new ledger at the onset, from rest just past it unless the body has come there in motion."""
        state, overshoot = self.state, 0.0 if self._from_rest else self.scene.controls.overshoot
        if self.view.on_time:
            state.begin_event(0.0, state.grip)
        else:
            followers = self.momentum.followers
            pressures = None if followers is None else (1.0 + overshoot) * followers.pressures(state.u)
            state.begin_event(overshoot, self.statics.clock.grown(state.grip, overshoot))
            if followers is not None and pressures is not None:
                followers.at(state.grip)
                followers.hold(state.u, pressures)
        if self.view.on_time:
            state.v[...] = self.momentum.unheld(self.scene.initial_velocity())
        reaction = self.body.take(state)
        if self.scene.controls.analysis == "quasistatic":
            state.ledger.elastic, state.ledger.loads = self.momentum.energy, self.momentum.loads
            state.ledger.initial = self.momentum.potential
        else:
            self.statics.newton.release()
            if self.integrator is not None:
                self.costs.factorisations += self.integrator.factorisations
            self._make_integrator().begin(state)
        lasts = 0.0 if self.scene.controls.analysis == "quasistatic" else self.scene.controls.event_time
        if text := unreached(self.scene, state.grip, state.grip + lasts):
            log.warning(text)
        self.observers.begin(self.view.at(state, reaction, "begin"))
        self.ended = self._stop(self.view)
        self.display.say(f"the event begins at load time {state.grip:.4g} s" if self.view.on_time else
                         onset_text(self.onset.figures))

    def _make_integrator(self) -> Integrator:
        c = self.scene.controls
        if self.state.phase == "loading":
            self._from_rest = LoadingFromRest(self.body, c.hht)
            self.integrator = self._from_rest.integrator
        else:
            self.integrator = self.view.integrator = integrator_of(c.integrator, self.body, c, self._ranks)
        return self.integrator

    def _integrate(self) -> None:
        state, integrator, view, tracker = self.state, self.integrator, self.view, self.crack.tracker
        assert integrator is not None
        event_time, cracked = self.scene.controls.event_time, 0.0
        view.end = event_time
        if self.scene.controls.start == "rest":  # the instability has yet to grow: the clock is that of the crack
            view.end, cracked = self.PATIENCE * event_time, float(tracker.cracked_at.min())
        for _ in integrator.run(state, view.end) if not self.ended else ():
            self.costs.steps += 1
            self.observers.step(view.at(state, lambda: integrator.reaction, "step", dt=integrator.dt))
            self.ended = self._stop(view)
            if tracker.separated and state.time >= self.crack.separated_at + self.scene.controls.aftermath:
                break
            if cracked == np.inf and view.tips.branches:
                cracked = float(tracker.cracked_at.min())
            if self.ended or self.dissolved or state.time >= cracked + event_time:
                break
            self.observers.pause(view)
        integrator.sync(state)
        self.observers.finish(view.at(state, integrator.reaction, "end", dt=integrator.dt))

    def _propagate(self) -> None:
        state, view, tracker = self.state, self.view, self.crack.tracker
        spent = self.SPENT * self.onset.figures["elastic_energy"]
        try:
            for _ in self.statics.propagate(state) if not self.ended else ():
                self.costs.steps += 1
                self.observers.step(view.at(state, self.momentum.force(state.u), "step"))
                self.ended = self._stop(view)
                at_rest = self.statics.settled or state.ledger.elastic < spent
                if self.ended or self.dissolved or (tracker.separated and at_rest):
                    break
                self.observers.pause(view)
        except ConvergenceError as error:
            if tracker.arrival is None or self.momentum.dead is not None:
                raise
            self.statics.arrested = str(error).partition(";")[0]
            self.body.take(state)  # as the last pass has left it
        self.observers.finish(view.at(state, self.momentum.force(state.u), "end"))

    # --- costs and checkpoints ---
    def cost(self) -> dict[str, Any]:
        """Wall times and counts since the run began, over all its sessions."""
        stepping, rejected, looked = 0, 0, self.view.looked
        if self.integrator is not None:
            stepping = self.integrator.factorisations
            rejected = self.integrator.rejected if self.state.phase != "loading" else 0
        factorisations = (self.costs.factorisations + self.statics.factorisations + self.density.factorisations
                          + stepping)
        return {"wall": dict(self.costs.wall), "steps": self.costs.steps, "rejected_steps": rejected,
                "gamma_solves": self.costs.gamma_solves + self.density.solves + looked.solves,
                "factorisations": factorisations, **looked.cost()}

    def _save(self) -> None:
        self.costs.lap(self.state.phase)
        self.checkpoint()

    def checkpoint(self) -> None:
        """Write the checkpoint."""
        memories: dict[str, dict[str, Any]] = {"statics": self.statics.memory()}
        if self.integrator is not None:
            self.integrator.sync(self.state)
            memories["integrator"] = self.integrator.memory()
        memories |= {f"observer {name}": memory for name, memory in self.observers.memories().items()}
        memories["run"] = {"cost": self.cost(), "warnings": self.notes.kept, "ended": self.ended}
        save_checkpoint(self.folder / self.CHECKPOINT, self.scene.fingerprint, self.state, memories)

    def _restore(self, memories: dict[str, dict[str, Any]]) -> None:
        self.statics.restore(memories["statics"])
        if "integrator" in memories:
            self._make_integrator().restore(self.state, memories["integrator"])
        else:
            self.body.take(self.state)


def standard_observers(scene: Scene, display: Display) -> list[Observer]:
    """The observers of every run, in the order in which they look."""
    c = scene.controls
    every, fields = c.record_every, [name for name in asked_fields(c.fields) if name in ON_REQUEST]
    return [Crack(every), History(every), Strength(), Onset(), Frames(c.frame_every, fields=fields), Guard(every),
            Deletions(), Fragments(), Progress(display, every), Checkpoint(c.checkpoint_every)]
