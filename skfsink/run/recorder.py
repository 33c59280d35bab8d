"""What a run leaves behind as it goes: rows of the history, frames of the series, and the key moments."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..fields.crack import CrackTracker, Tips
from ..fields.density import DensitySolver
from ..fields.momentum import Momentum
from ..fields.state import State
from ..fields.stress import cauchy_stress, pressure, von_mises
from ..loads.schedule import Loading
from ..results.history import History, deletions_header
from ..results.series import Series
from ..scene.scene import Scene
from ..system.files import prepare_folder, write_atomic
from .gauge import Gauge
from .guard import Guard
from .material_point import mean_deformation, mean_stress
from .places import beginning, check_beginning, greatest_ratio, rim_of

__all__ = ["Recorder"]


class Recorder:
    """Writes the history and the series of one run, follows the crack, and has it guarded.

    `memory` is what :meth:`memory` gave for a checkpoint, to go on from there.

    Memory: rows, frames, moments and the crack so far. `loading`, `loading_frame`, `unfailed`, `reached_onset`,
    `start`, `watch`, `frame` and `finish` add to them, in the order of the run; `memory` gives what a checkpoint needs.

    Attributes
    ----------
    tracker: the crack.   tips: the crack at the last record.   guard: watches the run.
    moments: frame number of each key moment: onset, branching, arrival, end.
    onset, at_arrival: figures noted at those moments.
    greatest: load, displacement, mean deformation gradient F and nominal stress P [MPa] where the load was greatest
        in amount while the body was loaded.
    loading_frames: time and label of the frames of the loading.
    """

    LOADING_FRAMES = 50.0  # of the way of the loading: frames are at least that part of it apart
    RARER = 50.0  # times the interval of rows and frames, while a body from rest has not cracked

    def __init__(self, scene: Scene, folder: Path, momentum: Momentum, density: DensitySolver,
                 loading: Loading, memory: dict[str, Any] | None = None) -> None:
        self.scene, self.momentum, self.density = scene, momentum, density
        sample, space = scene.sample, scene.sample.space
        names = [*(grip.boundary for grip in scene.grips), *(traction.boundary for traction in scene.tractions)]
        held = [sample.nodes(name) for name in dict.fromkeys(names)]
        # a tip in the slowest material has to have moved between two looks at it
        self.clock = "pass" if scene.controls.analysis == "quasistatic" else "s"   #: unit of the time of the event
        self.tracker = CrackTracker(space, scene.sink_law.length_scale,
                                    momentum.shear_wave_speeds[0] if self.clock == "s" else None, held,
                                    *rim_of(scene))
        self._cells = {"region": scene.region_numbers} if scene.regions else {}
        if memory is None:
            prepare_folder(folder / "series", overwrite=True)
        self.series = Series(folder / "series", "run", space)
        self.loading_series = Series(folder / "series", "loading", space)
        self.tips: Tips = self.tracker.look(0.0, np.ones(space.n_nodes))
        self.tracker.track.clear()
        memory = memory or {"rows": [], "frames": [], "moments": {}, "onset": {}, "at_arrival": {}}
        self.loading_frames: list[tuple[float, str]] = [(float(t), "") for t, _ in memory.get("loading_frames", ())]
        self._framed = float(memory.get("framed", 0.0))
        self.greatest: dict[str, Any] = dict(memory.get("greatest", {}))
        self.frames: list[tuple[float, str]] = [(float(t), str(label)) for t, label in memory["frames"]]
        self.moments: dict[str, int] = dict(memory["moments"])
        self.onset: dict[str, Any] = dict(memory["onset"])
        self.at_arrival: dict[str, float] = dict(memory["at_arrival"])
        self.separated_at = float(memory.get("separated_at", np.inf))   #: record of the separation [s, or pass]
        self.series.resume(len(self.frames))  # this may refuse, before any file is touched
        self.loading_series.resume(len(self.loading_frames))
        self.history = History(folder / "history.csv", memory["rows"], space.dim)
        self._marked: np.ndarray | None = None  # gamma when the tracker last looked; a solve makes a new array
        self.gauge = Gauge(scene, loading)
        controls = scene.controls
        quasistatic = controls.analysis == "quasistatic"
        self.guard = Guard(scene, momentum)
        self.guard.scale, self.guard.evenness = (self.onset.get(name, 0.0) for name in ("elastic_energy", "evenness"))
        self.guard.dissolved = bool(memory.get("dissolved", False))
        self.guard.overlaps = list(memory.get("overlaps", []))
        self._waiting = controls.start == "rest"
        self._record_every = 1.0 if quasistatic else controls.record_every
        self._frame_every = 10.0 if quasistatic else controls.frame_every

    # --- loading ---
    def loading(self, state: State, reaction: np.ndarray, way: float = 0.0) -> None:
        """Row of a load increment, and a frame where the `way` of the loading (in largest increments) asks for one."""
        self.guard.check_overlap(state)
        row = self._row(state, reaction, self.tips, 0.0)
        self.history.append(row)
        load = row["reaction_N_per_mm"]
        if abs(load) > abs(self.greatest.get("load", 0.0)):  # pushed or pulled, whichever was more
            self.greatest = {"load": load, "displacement_mm": row["grip_displacement_mm"],
                             "F": mean_deformation(self.momentum, state.u).tolist(),
                             "P": mean_stress(self.momentum.space, reaction).tolist()}
        if way >= self._framed + max(1.0, self._framed / self.LOADING_FRAMES):
            self._framed = way
            self.loading_frame(state)

    def loading_frame(self, state: State) -> None:
        """Add the state to the series of the loading."""
        self.loading_frames.append((state.time, ""))
        self._add(self.loading_series, state)

    def unfailed(self, state: State) -> None:
        """Last frame of a run that ends without a failure."""
        if not self.loading_frames or self.loading_frames[-1][0] != state.time:
            self.loading_frame(state)
        self.loading_frames[-1] = (state.time, "end")
        self.moments = {"end": len(self.loading_frames) - 1}
        self.guard.check_end()
        self._close(state)

    def reached_onset(self, state: State, reaction: np.ndarray) -> None:
        """Note the onset."""
        self.onset = {"displacement_mm": self.gauge.displacement(state), "reaction_N_per_mm": self.load(reaction),
                      "elastic_energy": state.ledger.elastic, "gamma_min": float(state.gamma.min()),
                      "sink": state.ledger.sink, "work": state.ledger.work,
                      "loading_balance": state.ledger.balance, **beginning(self.scene, state)}
        ratio, place = greatest_ratio(self.density, state)
        self.onset |= {"ratio": ratio, "place_of_ratio": place.tolist()}
        check_beginning(self.scene, state)
        self.guard.scale = state.ledger.elastic
        self.guard.check_onset(state)
        self.onset["evenness"] = self.guard.evenness

    def load(self, reaction: np.ndarray) -> float:
        """The load that is reported, see :class:`.Gauge` [N; N/mm in 2D]."""
        return self.gauge.load(reaction)

    # --- the event ---
    def start(self, state: State, reaction: np.ndarray) -> None:
        """First row and frame of the event."""
        self.tracker.mark(state.time, state.gamma)
        self._record(state, reaction, 0.0)
        self.frame(state, "onset")

    def watch(self, state: State, reaction: np.ndarray, before: float, dt: float) -> bool:
        """To be called after each step from time `before`; True when a row was written."""
        self.guard.check_step(state)
        arrived = state.gamma is not self._marked and self.tracker.mark(state.time, state.gamma)
        self._marked = state.gamma
        rarer = self.RARER if self._waits() else 1.0
        due = int(state.time / (rarer * self._record_every)) != int(before / (rarer * self._record_every))
        if not (due or arrived):
            return False
        branches = self.tracker.max_branches
        self._record(state, reaction, dt)
        if arrived:
            ledger = state.ledger
            self.at_arrival = {"U_paper": ledger.paper, "D_sink": ledger.sink, "elastic": ledger.elastic,
                               "kinetic": ledger.kinetic, "time": state.time}
            self.frame(state, "arrival")
        elif branches < 2 <= self.tracker.max_branches:
            self.frame(state, "branching")
        elif int(state.time / (rarer * self._frame_every)) != int(before / (rarer * self._frame_every)):
            self.frame(state, "")
        return True

    def _waits(self) -> bool:
        """Whether a body that has come from rest in motion has not cracked yet, which may take thousands of records."""
        self._waiting = self._waiting and not np.isfinite(self.tracker.cracked_at).any()
        return self._waiting

    def finish(self, state: State, reaction: np.ndarray, dt: float) -> None:
        """Last row and frame, and the log of deleted elements."""
        self._record(state, reaction, dt)
        self.frame(state, "end")
        self.guard.check_end()
        self._close(state)

    def _close(self, state: State) -> None:
        self.series.flush()
        self.loading_series.flush()
        log = "".join(f"{int(time) if self.clock == 'pass' else time!r},{element}\n"
                      for time, element in state.deletions)
        write_atomic(self.history.path.with_name("deletions.csv"), ",".join(deletions_header(self.clock)) + "\n" + log)

    def frame(self, state: State, label: str) -> None:
        """Add the state to the ParaView series."""
        self.guard.check_overlap(state)
        if label:
            self.moments[label] = len(self.frames)
        self.frames.append((state.time, label))
        self._add(self.series, state)

    def _add(self, series: Series, state: State) -> None:
        momentum, space = self.momentum, self.scene.sample.space
        stress = cauchy_stress(momentum, state.u)
        crushed = np.isnan(stress).any(axis=1)
        self.guard.check_stress(state, crushed)
        series.add(
            state.time,
            {"displacement": state.u, "velocity": state.v, "gamma": state.gamma},
            {"deleted": state.deleted.astype(np.int8), "W": space.element_mean(np.minimum(momentum.W, 1e3)),
             "gamma_element": space.element_mean(momentum.gamma), "stress": stress, "pressure": pressure(stress),
             "von_mises": von_mises(stress), "crushed": crushed.astype(np.int8), **self._cells})

    def _record(self, state: State, reaction: np.ndarray, dt: float) -> None:
        self.tips = self.tracker.look(state.time, state.gamma)
        self.history.append(self._row(state, reaction, self.tips, dt))
        if self.tracker.separated:
            self.separated_at = min(self.separated_at, state.time)
        self.guard.check_record(state)

    def _row(self, state: State, reaction: np.ndarray, tips: Tips, dt: float) -> dict[str, Any]:
        ledger = state.ledger
        x = np.full(3, np.nan)
        x[:tips.position.size] = tips.position
        quasistatic = state.phase == "event" and self.scene.controls.analysis == "quasistatic"
        return {
            "phase": state.phase, "step": state.step, "time_s": 0.0 if quasistatic else state.time,
            "grip_displacement_mm": self.gauge.displacement(state), "reaction_N_per_mm": self.load(reaction),
            "elastic": ledger.elastic, "loads": ledger.loads, "kinetic": ledger.kinetic, "work": ledger.work,
            "sink_stored": ledger.sink_stored, "sink_kinetic": ledger.sink_kinetic, "deletion": ledger.deletion,
            "numerical": ledger.numerical, "released": ledger.released, "U_paper": ledger.paper,
            "balance": ledger.balance, "tip_x_mm": float(x[0]), "tip_y_mm": float(x[1]), "tip_z_mm": float(x[2]),
            "crack_length_mm": tips.length, "tip_speed_m_per_s": 0.0 if quasistatic else tips.speed,
            "tips": tips.active, "branches": tips.branches, "deleted_elements": int(state.deleted.sum()),
            "gamma_min": float(state.gamma.min()), "dt_s": dt}

    # --- checkpoints ---
    def memory(self) -> dict[str, Any]:
        """What goes into a checkpoint as JSON; the tracker's arrays go beside it."""
        self.series.flush()  # a checkpoint names its frames
        self.loading_series.flush()
        return {"rows": self.history.rows, "frames": self.frames, "loading_frames": self.loading_frames,
                "dissolved": self.guard.dissolved, "framed": self._framed, "greatest": self.greatest,
                "moments": self.moments, "onset": self.onset,
                "at_arrival": self.at_arrival, "separated_at": self.separated_at,
                "overlaps": self.guard.overlaps}
