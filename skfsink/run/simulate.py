"""A run from the intact sample to the broken one: loading to the onset, then the event, dynamic or quasi-static."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import CheckpointError, Interrupted
from ..fem.direct import one_thread_of_openblas
from ..fields.body import Body
from ..fields.state import State
from ..methods.explicit import Explicit
from ..methods.integrators import INTEGRATORS, Integrator
from ..methods.rest import LoadingFromRest
from ..methods.statics import Statics
from ..results.history import history_units
from ..scene.scene import Scene
from .checkpoint import load_checkpoint, save_checkpoint, save_state
from .checks import warn
from .display import Display, Interrupt
from .notes import Notes
from .places import check_arrival, said
from .recorder import Recorder

__all__ = ["Simulation"]


class Simulation:
    """One run of a scene in a folder, resumable at any moment.

    Memory: the whole run: `run` goes on from where it is; `unfailed`, `dissolved`, `cost` and `checkpoint` are of the
    run so far.

    Parameters
    ----------
    scene: what to run; its analysis is "dynamic" or "quasistatic".
    folder: where `history.csv`, the series and the checkpoint go; it must exist.
    display: what the person sees.
    resume: take up the run where the checkpoint in `folder` left it.

    Raises
    ------
    CheckpointError
        The checkpoint to resume from is missing, damaged, or of another scene or version.
    """

    PATIENCE = 400.0  # a body that comes from rest in motion may take this many times `event_time` to crack
    CHECKPOINT = "checkpoint.npz"
    ONSET = "onset.npz"

    def __init__(self, scene: Scene, folder: Path, display: Display, resume: bool = False) -> None:
        # a checkpoint that cannot be used is refused before any file is touched
        stored = load_checkpoint(folder / self.CHECKPOINT, scene.fingerprint) if resume else None
        if stored and "recorder" not in stored[2]:
            path = folder / self.CHECKPOINT
            raise CheckpointError(f"the checkpoint {path} is damaged: it is a state without its run")
        self.scene, self.folder, self.display = scene, folder, display
        self.body = Body.of(scene)
        self.momentum, self.density, self.loading = self.body.momentum, self.body.density, self.body.loading
        self.free = self.body.free
        self.statics = Statics(self.body, scene.controls.statics)
        self.recorder = Recorder(scene, folder, self.momentum, self.density, self.loading,
                                 stored[2]["recorder"] if stored else None)
        self.notes = Notes(display.say, stored[2].get("warnings", []) if stored else [])
        self.state = State.intact(self.body.space)
        self.integrator: Integrator | None = None
        self._from_rest: LoadingFromRest | None = None
        self.wall = {"loading": 0.0, "event": 0.0, "output": 0.0}
        self.counts = {"steps": 0, "gamma_solves": 0, "factorisations": 0}
        self._saved = self._clock = time.perf_counter()
        if stored:
            self._restore(*stored)

    # --- the phases ---
    def run(self, onset: State | None = None, greatest: Mapping[str, Any] | None = None) -> State:
        """Run to the end from where the state is.

        `onset` is a state already loaded to the onset, `greatest` what :attr:`.Recorder.greatest` was on the way.
        """
        with Interrupt() as interrupt, self.notes, one_thread_of_openblas(), closing(self.recorder.series), \
                closing(self.recorder.loading_series):
            self._interrupt = interrupt
            if self.state.phase == "loading":
                self.recorder.guard.check_scene()
                warn(self.scene, self.folder)
                if onset is None:
                    self._load()
                else:
                    self.recorder.greatest = dict(greatest or {})
                    self._adopt(onset)
                if self.unfailed:
                    self.recorder.unfailed(self.state)
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
                    check_arrival(self.scene, self.recorder.tracker)
            self._lap("event")
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
        return self.recorder.guard.dissolved

    def _load(self) -> None:
        self.display.phase("loading")
        state = self.state
        tolerance = self.scene.controls.statics.onset_tolerance
        started = False
        if self.scene.controls.start == "rest" and self._from_rest is None:
            self._make_integrator()
        loading: LoadingFromRest | Statics = self._from_rest or self.statics
        for _ in loading.load(state):
            reaction = self.momentum.force(state.u)
            self.recorder.loading(state, reaction, self.statics.way(state.grip))
            started = True
            done = 0.5 * min(1.0, tolerance * state.grip / (loading.increment or np.inf)) ** 0.25
            self.display.update(done, f"grips {self.recorder.gauge.displacement(state):.4f} mm  load "
                                      f"{self.recorder.load(reaction):.4f} {self._unit}  "
                                      f"least γ {state.gamma.min():.3f}")
            self._pause("loading")
        self._lap("loading")
        if self.unfailed:
            return
        if started or not self.recorder.onset:
            self.recorder.reached_onset(state, self.momentum.force(state.u))
        save_state(self.folder / self.ONSET, self.scene.fingerprint, state)

    def _adopt(self, onset: State) -> None:
        self.state = onset
        reaction = self.body.take(onset)
        self.recorder.loading(onset, reaction)
        self.recorder.reached_onset(onset, reaction)

    def _begin_event(self) -> None:
        """Start a new ledger at the onset, from rest just past it unless the body has come there in motion."""
        state, overshoot = self.state, 0.0 if self._from_rest else self.scene.controls.overshoot
        state.begin_event(overshoot, self.statics.past(state.grip, overshoot))
        reaction = self.body.take(state)
        if self.scene.controls.analysis == "quasistatic":
            state.ledger.elastic, state.ledger.loads = self.momentum.energy, self.momentum.loads
            state.ledger.initial = self.momentum.potential
        else:
            self.statics.newton.release()
            if self.integrator is not None:
                self.counts["factorisations"] += self.integrator.factorisations
            self._make_integrator()
            assert self.integrator is not None
            self.integrator.begin(state)
        self.recorder.start(state, reaction)
        self.display.say(said(self.recorder.onset))

    def _make_integrator(self) -> None:
        c = self.scene.controls
        if self.state.phase == "loading":
            self._from_rest = LoadingFromRest(self.body, c.hht)
            self.integrator = self._from_rest.integrator
        else:
            self.integrator = INTEGRATORS[c.integrator](self.body, getattr(c, c.integrator))
            if isinstance(self.integrator, Explicit):
                self.recorder.guard.step_share = partial(self.integrator.step_share, self.state)

    def _integrate(self) -> None:
        state, integrator, recorder = self.state, self.integrator, self.recorder
        assert integrator is not None
        end, cracked = self.scene.controls.event_time, 0.0
        if self.scene.controls.start == "rest":  # the instability has yet to grow: the clock is that of the crack
            end, cracked = self.PATIENCE * end, float(recorder.tracker.cracked_at.min())
        before = state.time
        for _ in integrator.run(state, end):
            self.counts["steps"] += 1
            if recorder.watch(state, integrator.reaction, before, integrator.dt):
                self._show(state, state.time / end, f"{state.time * 1e6:.1f} µs")
            before = state.time
            if recorder.tracker.separated and state.time >= recorder.separated_at + self.scene.controls.aftermath:
                break
            if self.dissolved:
                break
            if cracked == np.inf and recorder.tips.branches:
                cracked = float(recorder.tracker.cracked_at.min())
            if state.time >= cracked + self.scene.controls.event_time:
                break
            self._pause("event")
        integrator.sync(state)
        recorder.finish(state, integrator.reaction, integrator.dt)

    def _propagate(self) -> None:
        state, recorder = self.state, self.recorder
        before = state.time
        scale = recorder.onset["elastic_energy"]
        for _ in self.statics.propagate(state):
            self.counts["steps"] += 1
            if recorder.watch(state, self.momentum.force(state.u), before, 0.0):
                self._show(state, 0.0, f"pass {state.step}")
            before = state.time
            at_rest = self.statics.settled or state.ledger.elastic < 1e-4 * scale
            if self.dissolved or (recorder.tracker.separated and at_rest):
                break
            self._pause("event")
        recorder.finish(state, self.momentum.force(state.u), 0.0)

    def _show(self, state: State, fraction: float, clock: str) -> None:
        tips, ledger = self.recorder.tips, state.ledger
        size = float((self.scene.sample.space.X.max(axis=0) - self.scene.sample.space.X.min(axis=0)).max())
        load = self.recorder.history.rows[-1]["reaction_N_per_mm"]
        self.display.update(max(fraction, 0.9 * tips.length / size), (
            f"{clock}  tip {tips.position[0]:.2f}, {tips.position[1]:.2f} mm ×{tips.branches}  "
            f"load {load:.3f} {self._unit}  elastic {ledger.elastic:.4f} kinetic {ledger.kinetic:.4f} "
            f"D {ledger.sink:.4f} U {ledger.paper:.4f}"))

    @property
    def _unit(self) -> str:
        """Of the load."""
        return history_units(self.scene.sample.space.dim)["reaction_N_per_mm"]

    # --- clocks and checkpoints ---
    def _lap(self, phase: str) -> None:
        now = time.perf_counter()
        self.wall[phase] += now - self._clock
        self._clock = now

    def _pause(self, phase: str) -> None:
        """Between steps: save a checkpoint when one is due, and stop when asked to."""
        stop = self._interrupt.heeded()
        if stop or time.perf_counter() - self._saved > self.scene.controls.checkpoint_every:
            self._lap(phase)
            self.checkpoint()
            self._saved = time.perf_counter()
            if stop or self._interrupt.heeded():
                raise Interrupted("interrupted")

    def _solver_counts(self) -> dict[str, int]:
        factorisations = self.statics.factorisations + self.density.factorisations
        if self.integrator is not None:
            factorisations += self.integrator.factorisations
        return {"gamma_solves": self.density.solves, "factorisations": factorisations}

    def cost(self) -> dict[str, Any]:
        """Wall times and counts since the run began, over all its sessions."""
        live = self._solver_counts()
        return {"wall": dict(self.wall), "steps": self.counts["steps"],
                **{k: self.counts[k] + n for k, n in live.items()}}

    def checkpoint(self) -> None:
        """Write the checkpoint."""
        memories = {"tracker": self.recorder.tracker.memory(), "statics": self.statics.memory()}
        if self.integrator is not None:
            self.integrator.sync(self.state)
            memories["integrator"] = self.integrator.memory()
        save_checkpoint(self.folder / self.CHECKPOINT, self.scene.fingerprint, self.state, memories,
                        {"recorder": self.recorder.memory(), "cost": self.cost(), "warnings": self.notes.kept})

    def _restore(self, state: State, memories: dict[str, Any], extra: dict[str, Any]) -> None:
        self.state = state
        self.recorder.tracker.restore(memories["tracker"])
        self.statics.restore(memories["statics"])
        cost = extra["cost"]
        self.wall.update(cost.pop("wall"))
        self.counts.update(cost)
        if "integrator" in memories:
            self._make_integrator()
            assert self.integrator is not None
            self.integrator.restore(state, memories["integrator"])
        else:
            self.body.take(state)
