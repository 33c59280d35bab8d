"""What the loading has come to: the greatest load on the way, and the state at the onset."""

from __future__ import annotations

from typing import Any

from ..material_point import mean_deformation, mean_stress
from .history import VALUES
from .observer import Observer
from .places import beginning, check_beginning, greatest_ratio
from .view import View

__all__ = ["Onset", "Strength"]


class Strength(Observer):
    """The greatest load of the loading, which is the strength of a body that is loaded evenly.

    Memory: the greatest load so far.

    Attributes
    ----------
    greatest: load, displacement, mean deformation gradient F and nominal stress P [MPa] where the load was greatest in
        amount; with a pressure also the greatest one, in amount, `pressure_MPa`. Empty before.
    """

    kept = ("greatest",)

    def __init__(self) -> None:
        self.greatest: dict[str, Any] = {}

    def loading(self, view: View) -> None:
        """Pushed or pulled, whichever was more."""
        load, momentum = view.load, view.body.momentum
        if abs(load) > abs(self.greatest.get("load", 0.0)):
            self.greatest = {**self.greatest, "load": load, "displacement_mm": view.displacement,
                             "F": mean_deformation(momentum, view.state.u).tolist(),
                             "P": mean_stress(momentum.space, view.reaction).tolist()}
        pressure = _pressure(view)
        if abs(pressure.get("pressure_MPa", 0.0)) > abs(self.greatest.get("pressure_MPa", 0.0)):
            self.greatest.update(pressure)


def _pressure(view: View) -> dict[str, float]:
    """The first pressure, or that in the first filling; empty without one."""
    return {"pressure_MPa": VALUES["pressure_MPa"](view)} if view.body.loading.followers is not None else {}


class Onset(Observer):
    """Figures of the state at the onset, and a warning where it begins at a clamp, or away from a notch.

    Memory: the `figures`; empty before the onset. An event that begins at a load time has no place where it fails.
    """

    kept = ("figures",)

    def __init__(self) -> None:
        self.figures: dict[str, Any] = {}

    def onset(self, view: View) -> None:
        """Note the onset."""
        state, ledger = view.body.since_begun(view.state), view.state.ledger
        ratio, place = greatest_ratio(view.body.density, state)
        self.figures = {"displacement_mm": view.displacement, "reaction_N_per_mm": view.load, **_pressure(view),
                        "elastic_energy": ledger.elastic, "gamma_min": float(state.gamma.min()), "sink": ledger.sink,
                        "work": ledger.work, "pressure_work": ledger.pressure_work,
                        "loading_balance": ledger.balance, **({} if view.on_time else beginning(view.scene, state)),
                        "ratio": ratio, "place_of_ratio": place.tolist()}
        if not view.on_time:
            check_beginning(view.scene, state)
