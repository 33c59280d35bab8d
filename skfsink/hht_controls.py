"""Options of the implicit integrator."""

from __future__ import annotations

from dataclasses import dataclass

from .errors import ParameterError, require
from .inertia import MASSES

__all__ = ["COUPLINGS", "HHTControls"]

COUPLINGS = ("iterated", "single")


@dataclass(frozen=True)
class HHTControls:
    """Options of the implicit integrator.

    Parameters
    ----------
    alpha: damping parameter, in [-1/3, 0].
    dt: largest time step [s], > 0.
    dt_first: first time step [s], > 0; 0 takes `dt`.
    dt_least: step below which the integration gives up [s], > 0.
    coupling: "iterated" or "single".
    mass: "lumped" by row sums, as in the explicit scheme, or "consistent" (Eq. 28). On a mesh of h = l/1.5 the
        consistent one drives the crack 8 % faster; the two agree as h falls.
    mass_floor: least lumped mass, as a fraction of the intact one, in [0, 1).
    force_tolerance, correction_tolerance: ABAQUS-like tests, in (0, 0.1].
    gamma_tolerance: change of gamma in the last iteration of a step, in (0, 0.1].
    max_iterations: iterations after which a step is rejected, >= 3.
    """

    alpha: float = -0.05
    dt: float = 1.6e-7
    dt_first: float = 0.0
    dt_least: float = 1e-13
    coupling: str = "iterated"
    mass: str = "lumped"
    mass_floor: float = 1e-3
    force_tolerance: float = 1e-3
    correction_tolerance: float = 2e-3
    gamma_tolerance: float = 1e-2
    max_iterations: int = 16

    def __post_init__(self) -> None:
        require("hht-alpha", self.alpha, low=-1 / 3, high=0)
        require("hht-dt", self.dt, "s", low=0, low_open=True)
        require("hht-dt-first", self.dt_first, "s", low=0)
        require("hht-dt-least", self.dt_least, "s", low=0, low_open=True)
        require("force-tolerance", self.force_tolerance, low=0, high=0.1, low_open=True)
        require("correction-tolerance", self.correction_tolerance, low=0, high=0.1, low_open=True)
        require("gamma-tolerance", self.gamma_tolerance, low=0, high=0.1, low_open=True)
        require("max-iterations", self.max_iterations, low=3, whole=True)
        require("mass-floor", self.mass_floor, low=0, high=1, high_open=True)
        if self.coupling not in COUPLINGS:
            raise ParameterError(f"coupling must be one of {', '.join(COUPLINGS)}; got {self.coupling!r}")
        if self.mass not in MASSES:
            raise ParameterError(f"mass must be one of {', '.join(MASSES)}; got {self.mass!r}")

    @property
    def beta(self) -> float:
        """Newmark's beta = (1 - alpha)^2/4."""
        return (1 - self.alpha) ** 2 / 4

    @property
    def newmark_gamma(self) -> float:
        """Newmark's gamma = 1/2 - alpha."""
        return 0.5 - self.alpha
