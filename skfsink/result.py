"""The result of a run: its summary (schema version 2), its history and its last state."""

from __future__ import annotations

import resource
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .history import history_units, load_name
from .output import versions
from .quantities import measured
from .scene import Scene
from .simulate import Simulation
from .state import State

__all__ = ["SCHEMA", "Result", "summarize"]

SCHEMA = 2   # 1 had "reaction_N_per_mm" for the force [N] on bodies in space, and no "units"


@dataclass(frozen=True, eq=False)
class Result:
    """What a case function returns.

    Attributes
    ----------
    folder: where the files of the run are.
    summary: content of `summary.json`.
    history: columns of `history.csv` as arrays.
    state: the last state.
    parts: for `analysis="both"` the results of the two runs, by analysis; otherwise empty.
    """

    folder: Path
    scene: Scene
    summary: dict[str, Any]
    history: dict[str, np.ndarray]
    state: State
    parts: dict[str, Result]


def peak_rss_mb() -> float:
    """Greatest memory this process has used [MB]."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak / 1e3


def summarize(scene: Scene, simulation: Simulation) -> dict[str, Any]:
    """Summary of a finished run."""
    state, recorder = simulation.state, simulation.recorder
    ledger, onset, tracker = state.ledger, recorder.onset, recorder.tracker
    space, cost = scene.sample.space, simulation.cost()
    dynamic = scene.controls.analysis == "dynamic"
    scale, units = onset["elastic_energy"], history_units(space.dim)
    balances = [abs(row["balance"]) for row in recorder.history.rows if row["phase"] != "loading"]
    return {
        "schema": SCHEMA, "case": scene.case, "mesh": scene.sample.name, "analysis": scene.controls.analysis,
        "integrator": scene.controls.integrator if dynamic else None,
        "elements": space.n_elements, "dofs": int(simulation.free.sum()) + space.n_nodes,
        "unknowns": {"displacement": int(simulation.free.sum()), "density": space.n_nodes},
        "units": {"load": units["reaction_N_per_mm"], "energy": units["elastic"]},
        "onset": {"displacement_mm": onset["displacement_mm"], load_name(space.dim): onset["reaction_N_per_mm"],
                  "elastic_energy": onset["elastic_energy"], "gamma_min": onset["gamma_min"]},
        "event": {"first_arrival_s": tracker.arrival if dynamic else None,
                  "first_arrival_sweep": None if dynamic else tracker.arrival,
                  "mean_tip_speed_m_per_s": tracker.mean_speed() if dynamic else None,
                  "max_branches": tracker.max_branches, "separated": tracker.separated,
                  "duration_s": state.time if dynamic else None},
        "energy": {"U_paper_at_arrival": recorder.at_arrival.get("U_paper"), "U_paper_final": ledger.paper,
                   "D_sink_at_arrival": recorder.at_arrival.get("D_sink"), "D_sink_final": ledger.sink,
                   "D_sink_stored": ledger.sink_stored, "D_sink_kinetic": ledger.sink_kinetic,
                   "initial": ledger.initial, "elastic_final": ledger.elastic, "kinetic_final": ledger.kinetic,
                   "external_work": onset["work"] + ledger.work, "deletion": ledger.deletion,
                   "numerical": ledger.numerical, "released": ledger.released,
                   "balance_error_relative": max(balances, default=0.0) / scale},
        "quantities": measured(scene, recorder), "model": dict(scene.choice) or None,
        "whole": {"energy": scene.whole.energy, "load": scene.whole.load, "displacement": scene.whole.displacement},
        "deleted_elements": int(state.deleted.sum()), "warnings": simulation.notes.texts,
        "cost": {"wall_s": {k: round(v, 3) for k, v in cost["wall"].items()}, "steps": cost["steps"],
                 "gamma_solves": cost["gamma_solves"], "factorisations": cost["factorisations"],
                 "peak_rss_mb": round(peak_rss_mb(), 1)},
        "versions": versions(), "assumed": list(scene.assumed), "moments": recorder.moments}
