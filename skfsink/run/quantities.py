"""What a run is asked for: figures of the whole sample, comparable between models of it."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from ..fields.state import State
from ..scene.scene import Scene
from .simulate import Simulation

__all__ = ["PATH", "crack_cells", "failed_until", "measured", "relative_error"]

PATH = "crack_path"
NEAR = 1.5  # lengths l between cells of two cracks that are the same


def measured(scene: Scene, simulation: Simulation) -> dict[str, float | None]:
    """Figures of a run for the whole sample, whatever part of it was computed; None where its model gives none.

    onset_load [N; N/mm of a plate], onset_displacement of the grips [mm], U and D at the first arrival [N mm; N mm/mm],
    arrival_time from the first cracked node to the first arrival [s], tip_speed until then [m/s].
    """
    whole, onset = scene.whole, simulation.onset.figures
    arrival, tracker = simulation.crack.at_arrival, simulation.crack.tracker
    dynamic = scene.controls.analysis == "dynamic"
    first = float(tracker.cracked_at.min())
    return {"onset_load": onset["reaction_N_per_mm"] * whole.load if onset else None,
            "onset_displacement": onset["displacement_mm"] * whole.displacement if onset else None,
            "U": arrival["U_paper"] * whole.energy if arrival else None,
            "D": arrival["D_sink"] * whole.energy if arrival else None,
            "arrival_time": tracker.arrival - first if dynamic and tracker.arrival is not None else None,
            "tip_speed": tracker.mean_speed() if dynamic and arrival else None}


def failed_until(state: State, until: float | None) -> list[int]:
    """Elements that had failed at a time (quasi-static: a pass), in the order in which they did; None takes all."""
    return [element for time, element in state.deletions if until is None or time <= until]


def crack_cells(scene: Scene, state: State, until: float | None) -> list[list[int]]:
    """The crack at the first arrival: squares of side l of the section in which elements had failed, ascending.

    `until` is the time (quasi-static: pass) of the arrival; None takes all.
    """
    space = scene.sample.space
    middle = space.X[space.conn[failed_until(state, until)]].mean(axis=1).reshape(-1, space.dim)
    cells = np.floor(scene.whole.places(scene.flat(middle)) / scene.sink_law.length_scale).astype(int)
    found: list[list[int]] = np.unique(cells, axis=0).tolist()
    return found


def relative_error(quantity: str, value: Any, reference: Any) -> float | None:
    """Error of a quantity relative to that of a reference; None if one of the two does not give it.

    Of the path it is the greater share of the cells of one crack that are more than 1.5 l from the other one.
    """
    if quantity == PATH:
        if not value or not reference:
            return None
        a, b = np.array(value, float), np.array(reference, float)
        return max(float(np.mean(cKDTree(to).query(of)[0] > NEAR)) for of, to in ((a, b), (b, a)))
    if value is None or reference is None:
        return None
    return abs(value - reference) / abs(reference)
