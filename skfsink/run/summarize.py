"""The summary of a finished run (schema version 3)."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..fields.body import Body
from ..fields.energy import OPTIONAL_TERMS
from ..fields.fragments import fragments
from ..fields.momentum import terms_without
from ..results.frame import SPENT
from ..results.history import history_units, load_name
from ..results.summary import versions
from ..scene.scene import Scene
from ..system.peak import peak_rss_mb
from .material_point import beside_theory
from .observers.fragments import fragment_summary
from .observers.places import greatest_ratio
from .quantities import measured
from .simulate import Simulation
from .verdict import ending, verdict

__all__ = ["SCHEMA", "summarize"]

SCHEMA = 3   # 2 counted "sweeps"; 1 had "reaction_N_per_mm" for forces [N] on bodies in space, and no "units"


def summarize(scene: Scene, simulation: Simulation) -> dict[str, Any]:
    """Summary of a finished run; figures of the onset and of the event are null in one that did not fail."""
    body = simulation.body
    state, crack, greatest = simulation.state, simulation.crack, simulation.strength.greatest
    ledger, onset, tracker = state.ledger, simulation.onset.figures, crack.tracker
    space, cost = scene.sample.space, simulation.cost()
    dynamic = scene.controls.analysis == "dynamic"
    pressed = simulation.momentum.followers is not None
    without = terms_without(simulation.momentum, dynamic)
    units = history_units(space.volume_dim)
    balances = [abs(row["balance"]) for row in simulation.history.rows if row["phase"] != "loading"]
    ratio, place = greatest_ratio(simulation.density, body.since_begun(state))
    if "ratio" in onset:  # while it was loaded; beyond, W of dead points grows without meaning
        ratio, place = onset["ratio"], onset["place_of_ratio"]
    return {
        "schema": SCHEMA, "case": scene.case, "mesh": scene.sample.name, "analysis": scene.controls.analysis,
        "integrator": scene.controls.integrator if dynamic else None, "verdict": verdict(scene, simulation),
        "end": ending(scene, simulation),
        "elements": space.n_elements, "dofs": int(simulation.free.sum()) + space.n_nodes,
        "unknowns": {"displacement": int(simulation.free.sum()), "density": space.n_nodes},
        "units": {"load": units["reaction_N_per_mm"], "energy": units["elastic"]},
        "loading": {"greatest_load": greatest.get("load"),
                    "displacement_at_greatest_load_mm": greatest.get("displacement_mm"),
                    **({"greatest_pressure_MPa": greatest.get("pressure_MPa")} if pressed else {}),
                    "greatest_W_over_phi": ratio, "place_of_greatest_W_over_phi_mm": place},
        "material_point": _material_point(scene, simulation),
        "onset": {"displacement_mm": onset.get("displacement_mm"),
                  load_name(space.volume_dim): onset.get("reaction_N_per_mm"),
                  **({"pressure_MPa": onset.get("pressure_MPa")} if pressed else {}),
                  **{k: onset.get(k) for k in ("elastic_energy", "gamma_min", "place_mm", "boundary")},
                  "notch": simulation.guard.notch or None},
        "event": {"first_arrival_s": tracker.arrival if dynamic else None,
                  "first_arrival_pass": None if dynamic else tracker.arrival,
                  "mean_tip_speed_m_per_s": tracker.mean_speed() if dynamic else None,
                  "tear_angle_degree": _tear_angle(scene, simulation),
                  "max_branches": tracker.max_branches, "separated": tracker.separated,
                  "duration_s": state.time if dynamic and onset else None,
                  "added_mass": simulation.integrator.added_mass if dynamic and simulation.integrator else None,
                  **fragments(space, state.gamma, state.deleted, scene.sink_law.length_scale, SPENT)._asdict()},
        "energy": {"U_paper_at_arrival": crack.at_arrival.get("U_paper"), "U_paper_final": ledger.paper,
                   "D_sink_at_arrival": crack.at_arrival.get("D_sink"), "D_sink_final": ledger.sink,
                   "D_sink_stored": ledger.sink_stored, "D_sink_kinetic": ledger.sink_kinetic,
                   "initial": ledger.initial, "elastic_final": ledger.elastic, "kinetic_final": ledger.kinetic,
                   "external_work": onset.get("work", 0.0) + ledger.work, "deletion": ledger.deletion,
                   "numerical": ledger.numerical, "released": ledger.released,
                   **{name: getattr(ledger, name) for name in OPTIONAL_TERMS if name not in without},
                   **({"pressure_work": onset.get("pressure_work", 0.0) + ledger.pressure_work} if pressed else {}),
                   "balance_error_relative": max(balances, default=0.0) / ledger.scale(onset["elastic_energy"])
                   if onset else None},
        **({"cracks": crack_summary(scene, body)} if scene.cracks else {}),
        "fragments": fragment_summary(simulation.body, state, scene.sink_law.length_scale),
        "quantities": measured(scene, simulation), "model": dict(scene.model_choice) or None,
        "whole": {"energy": scene.whole.energy, "load": scene.whole.load, "displacement": scene.whole.displacement},
        "deleted_elements": len(state.deletions), "warnings": simulation.notes.texts,
        "notes": list(scene.sample.notes),
        "cost": {"wall_s": {k: round(v, 3) for k, v in cost["wall"].items()}, "steps": cost["steps"],
                 "rejected_steps": cost["rejected_steps"], "gamma_solves": cost["gamma_solves"],
                 "factorisations": cost["factorisations"],
                 "peak_rss_mb": round(peak_rss_mb(), 1),
                 **({"ranks": cost["ranks"]} if "ranks" in cost else {})},
        "versions": versions(), "assumed": list(scene.assumed), "moments": simulation.frames.moments,
        "series": "loading" if simulation.unfailed else "run"}


def crack_summary(scene: Scene, body: Body) -> list[dict[str, Any]]:
    """Initial cracks: their elements, extent and width, and the width of what they took of the density, all of
    them over their whole extent."""
    state, space = body.begin(), scene.space
    lost = float(np.einsum("eq,eq->", space.dX, 1.0 - body.momentum.effective(state.gamma, state.deleted)))
    extents = [crack.extent for crack in scene.cracks]
    whole = None if None in extents or not extents else sum(extents)  # type: ignore[arg-type]
    extent = "length_mm" if space.dim == 2 else "area_mm2"
    return [{"name": crack.name, "lips": crack.lips, "elements": crack.elements.size, extent: crack.extent,
             **({} if crack.reach is None else {"reach_mm": list(crack.reach)}),
             "width_mm": crack.width(space), "lost_width_mm": None if whole is None else lost / whole}
            for crack in scene.cracks]


def _tear_angle(scene: Scene, simulation: Simulation) -> float | None:
    """Direction of the tear in the undeformed plane, from the x axis [degrees], in (-90, 90].

    It is that from where the body begins to fail to the leading tip when the crack first arrives, or else at the end;
    None of a body in space, or where no tip has left the place of the onset by more than l.
    """
    place, arrival = simulation.onset.figures.get("place_mm"), simulation.crack.tracker.arrival
    if scene.space.dim == 3 or place is None:
        return None
    clock = "time_s" if scene.controls.analysis == "dynamic" else "step"
    rows = [row for row in simulation.history.rows if row["phase"] == "event" and np.isfinite(row["tip_x_mm"])
            and (arrival is None or row[clock] <= arrival)]
    if not rows:
        return None
    x, y = rows[-1]["tip_x_mm"] - place[0], rows[-1]["tip_y_mm"] - place[1]
    if np.hypot(x, y) < scene.sink_law.length_scale:
        return None
    angle = float(np.degrees(np.arctan2(y, x)))
    return angle - 180.0 * np.ceil((angle - 90.0) / 180.0)


def _material_point(scene: Scene, simulation: Simulation) -> dict[str, Any] | None:
    """Strength beside theory of a body that was loaded evenly."""
    greatest = simulation.strength.greatest
    if not simulation.guard.even or "F" not in greatest or scene.tractions or scene.pressures:
        return None
    return beside_theory(scene, np.array(greatest["F"]), np.array(greatest["P"]))
