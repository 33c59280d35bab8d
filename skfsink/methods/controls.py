"""Options of the methods: explicit and implicit time integration, and statics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from ..errors import ParameterError, choose, require
from ..fem.linear import AUTO, LINEAR

__all__ = ["COUPLINGS", "DEBRIS", "MASSES", "EventControls", "ExplicitControls", "HHTControls", "StaticsControls"]

COUPLINGS = ("iterated", "single")
MASSES = ("lumped", "consistent")
DEBRIS = ("keep", "remove")


@dataclass(frozen=True)
class ExplicitControls:
    """Options of the explicit integrator.

    Parameters
    ----------
    courant: step as a fraction of the estimated stability limit 2/omega_max, in (0, 1].
    gamma_every: steps between solves for gamma, >= 1; 0 takes as many as fit; see :class:`.SolveInterval`.
    mass_floor: least lumped mass, as a fraction of the intact one, in [0, 1).
    estimate_every: steps after which omega_max is estimated again at the latest, >= 1.
    estimate_change: relative change of the cheap indicator that calls for a new estimate, in (0, 1).
    energy_tolerance: energy that a step may feed in or take out, of that of the body, in [0, 1]; else it is made again
        half as long. 0: no step is rejected, and one that feeds in energy calls for a new estimate of the limit.
    debris: "keep" or "remove" (delete pieces smaller than l that are cut off from all grips).
    raised_mass: greatest share of the volume whose elements get more mass, lest they shorten the step, in [0, 0.5];
        see :mod:`.raised_mass`.
    subcycled: greatest share of the volume whose elements take short steps of their own instead, in [0, 0.5]; then
        `raised_mass` is 0. See :mod:`.subcycling`.
    """

    courant: float = 0.8
    gamma_every: int = 0
    mass_floor: float = 1e-3
    estimate_every: int = 400
    estimate_change: float = 0.1
    energy_tolerance: float = 2e-5
    debris: str = "keep"
    raised_mass: float = 0.01
    subcycled: float = 0.0

    def __post_init__(self) -> None:
        require("courant", self.courant, low=0, high=1, low_open=True)
        require("gamma_every", self.gamma_every, "steps", low=0, whole=True)
        require("mass_floor", self.mass_floor, low=0, high=1, high_open=True)
        require("estimate_every", self.estimate_every, "steps", low=1, whole=True)
        require("estimate_change", self.estimate_change, low=0, high=1, low_open=True, high_open=True)
        require("energy_tolerance", self.energy_tolerance, low=0, high=1)
        choose("debris", self.debris, DEBRIS)
        require("raised_mass", self.raised_mass, low=0, high=0.5)
        if require("subcycled", self.subcycled, low=0, high=0.5) and self.raised_mass:
            raise ParameterError(f"subcycled {self.subcycled:g} is for elements as heavy as they are; got raised_mass "
                                 f"{self.raised_mass:g}: take raised_mass 0")


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
    gain_tolerance: energy that a step may feed in, of that of the body, in (0, 1]; else it is halved.
    max_iterations: iterations after which a step is rejected, >= 3.
    """

    alpha: float = -0.05
    dt: float = 1.6e-7
    dt_first: float = 0.0
    dt_least: float = 1e-13
    coupling: str = "iterated"
    mass: str = "lumped"
    mass_floor: float = ExplicitControls.mass_floor
    force_tolerance: float = 1e-3
    correction_tolerance: float = 2e-3
    gamma_tolerance: float = 1e-2
    gain_tolerance: float = 1e-3
    max_iterations: int = 16

    def __post_init__(self) -> None:
        require("hht_alpha", self.alpha, low=-1 / 3, high=0)
        require("hht_dt", self.dt, "s", low=0, low_open=True)
        require("hht_dt_first", self.dt_first, "s", low=0)
        require("hht_dt_least", self.dt_least, "s", low=0, low_open=True)
        require("force_tolerance", self.force_tolerance, low=0, high=0.1, low_open=True)
        require("correction_tolerance", self.correction_tolerance, low=0, high=0.1, low_open=True)
        require("gamma_tolerance", self.gamma_tolerance, low=0, high=0.1, low_open=True)
        require("gain_tolerance", self.gain_tolerance, low=0, high=1, low_open=True)
        require("max_iterations", self.max_iterations, low=3, whole=True)
        require("mass_floor", self.mass_floor, low=0, high=1, high_open=True)
        choose("coupling", self.coupling, COUPLINGS)
        choose("mass", self.mass, MASSES)

    @property
    def beta(self) -> float:
        """Newmark's beta = (1 - alpha)^2/4."""
        return (1 - self.alpha) ** 2 / 4

    @property
    def newmark_gamma(self) -> float:
        """Newmark's gamma = 1/2 - alpha."""
        return 0.5 - self.alpha


@dataclass(frozen=True)
class StaticsControls:
    """Options of the static analyses.

    Parameters
    ----------
    tolerance: residual force at which equilibrium is reached, relative to the forces inside, in (0, 0.01].
    gamma_tolerance: change of gamma in a pass at which the coupled fields are converged, in (0, 0.01].
    front: a pass fails the points whose stored energy is at least this share of the greatest one, in [0, 1]; 0 fails
        all that are past the energy limiter at once.
    increment: first (and largest) load increment, as displacement of a grip over the size of the body, or as change of
        a traction over twice the shear modulus, in (0, 0.5].
    onset_tolerance: width of the last bisection interval of the onset, relative to the load, in (0, 0.1].
    max_newton: Newton steps after which an equilibrium is given up, >= 3.
    max_passes: passes over the two fields after which a load increment is given up, >= 3.
    linear: what solves for displacements, a name in :data:`.LINEAR`, or "auto"; see :func:`.linear_for`.
    """

    tolerance: float = 1e-7
    gamma_tolerance: float = 1e-5
    increment: float = 0.01
    front: float = 0.95
    onset_tolerance: float = 5e-4
    max_newton: int = 40
    max_passes: int = 80
    linear: str = AUTO

    def __post_init__(self) -> None:
        require("static_tolerance", self.tolerance, low=0, high=0.01, low_open=True)
        require("gamma_tolerance", self.gamma_tolerance, low=0, high=0.01, low_open=True)
        require("front", self.front, low=0, high=1)
        require("increment", self.increment, low=0, high=0.5, low_open=True)
        require("onset_tolerance", self.onset_tolerance, low=0, high=0.1, low_open=True)
        require("max_newton", self.max_newton, low=3, whole=True)
        require("max_passes", self.max_passes, low=3, whole=True)
        choose("linear", self.linear, (AUTO, *LINEAR))


class EventControls(Protocol):
    """What an integrator asks of the options of a scene; see :class:`.Controls`."""

    @property
    def explicit(self) -> ExplicitControls:
        """Options of the explicit integrator."""

    @property
    def hht(self) -> HHTControls:
        """Options of the implicit one."""
