"""Options of the static analyses."""

from __future__ import annotations

from dataclasses import dataclass

from .errors import require

__all__ = ["StaticsControls"]


@dataclass(frozen=True)
class StaticsControls:
    """Options of the static analyses.

    Parameters
    ----------
    tolerance: residual force at which equilibrium is reached, relative to the forces inside, in (0, 0.01].
    gamma_tolerance: change of gamma in a pass at which the coupled fields are converged, in (0, 0.01].
    front: a sweep fails the points whose stored energy is at least this share of the greatest one, in [0, 1]; 0 fails
        all that are past the energy limiter at once.
    increment: first (and largest) load increment, as displacement of a grip over the size of the body, or as change of
        a traction over twice the shear modulus, in (0, 0.5].
    onset_tolerance: width of the last bisection interval of the onset, relative to the load, in (0, 0.1].
    max_newton: Newton steps after which an equilibrium is given up, >= 3.
    max_passes: passes over the two fields after which a load increment is given up, >= 3.
    """

    tolerance: float = 1e-7
    gamma_tolerance: float = 1e-5
    increment: float = 0.01
    front: float = 0.8
    onset_tolerance: float = 5e-4
    max_newton: int = 40
    max_passes: int = 80

    def __post_init__(self) -> None:
        require("static-tolerance", self.tolerance, low=0, high=0.01, low_open=True)
        require("gamma-tolerance", self.gamma_tolerance, low=0, high=0.01, low_open=True)
        require("front", self.front, low=0, high=1)
        require("increment", self.increment, low=0, high=0.5, low_open=True)
        require("onset-tolerance", self.onset_tolerance, low=0, high=0.1, low_open=True)
        require("max-newton", self.max_newton, low=3, whole=True)
        require("max-passes", self.max_passes, low=3, whole=True)
