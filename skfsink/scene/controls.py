"""How a scene is computed."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numba

from ..errors import ParameterError, choose, require
from ..fem.backends import backend
from ..fem.elements import ELEMENTS
from ..fields.density import GRADIENTS, SOLVERS
from ..fields.frame_fields import asked_fields
from ..fields.sinks import SINKS
from ..methods.controls import ExplicitControls, HHTControls, StaticsControls
from ..methods.integrators import INTEGRATORS
from .stop import NEVER, read_stop

__all__ = ["ANALYSES", "PICTURES", "SERIES", "STARTS", "Controls"]

ANALYSES = ("dynamic", "quasistatic", "both")
STARTS = ("onset", "rest")
PICTURES = ("png", "pdf", "svg")
SERIES = ("vtu", "vtkhdf")


@dataclass(frozen=True)
class Controls:
    """How a scene is computed.

    Parameters
    ----------
    analysis: "dynamic" or "quasistatic" ("both" is two runs).
    integrator: "explicit" or "hht", for the dynamic event.
    sink: "lumped", "consistent" or "nearest".
    gradient: "monotone" or "gauss", of the lumped and nearest sinks; that of the consistent one is always "gauss".
    element: "jbar", "plain", "planestress" (thin sheets in two dimensions) or "axisymmetric" (bodies of revolution
        about the y axis, by their half plane).
    overshoot: how far past the onset the state is scaled before the event, relative to the displacement, (0, 0.1].
    deletion: gamma at which an element fails, (0, 1e-2].
    force_floor: gamma below which a Gauss point exerts no force, [0, 0.1].
    event_time: longest dynamic event [s], > 0.
    aftermath: time for which it goes on after the sample has come apart [s], >= 0.
    record_every: time between rows of the history [s], > 0.
    frame_every: time between frames of the ParaView series [s], > 0.
    balance_tolerance: balance error, relative to the onset energy, at which a run is stopped, (0, 1].
    checkpoint_every: wall time between checkpoints [s], > 0.
    threads: that share factorisations and loops over elements, >= 0; 0 takes one for a plane body and else
        OMP_NUM_THREADS or the machine's cores, at most 4. Runs with the same number agree to the last bit.
    start: of a dynamic analysis, "onset" (statics until then) or "rest" (see :mod:`.rest`).
    density_solver: "multigrid" or "jacobi"; see :data:`.SOLVERS`. Several ranks take "jacobi" in the event.
    active_zone: explicit steps solve for gamma only where it changes (see :mod:`.active_zone`).
    contact: the lips of cracks bear on each other (see :mod:`.contact`), in events and quasi-static passes.
    kernels: "compiled", or "forms" (scikit-fem forms, for small meshes), or another name in :data:`.BACKENDS`.
    stop: what ends the run before its time: conditions as :mod:`.stop` has them, or a function of the view of the run.
    bulk_viscosity_linear, bulk_viscosity_quadratic: coefficients b1 and b2 of the bulk viscosity, [0, 10].
    fields: what is drawn besides the density, names of :data:`.frame_fields.DRAWN` with commas.
    pictures: "png", "pdf" or "svg".
    series: how the fields are stored, "vtu" (a file each frame) or "vtkhdf" (one file of all frames).
    """

    analysis: str = "dynamic"
    integrator: str = "explicit"
    sink: str = "lumped"
    gradient: str = "monotone"
    element: str = "jbar"
    overshoot: float = 0.005
    deletion: float = 1e-6
    force_floor: float = 1e-3
    event_time: float = 4e-4
    aftermath: float = 1e-5
    record_every: float = 1e-6
    frame_every: float = 5e-6
    balance_tolerance: float = 0.05
    checkpoint_every: float = 20.0
    threads: int = 0
    start: str = "onset"
    density_solver: str = "multigrid"
    active_zone: bool = True
    contact: bool = False
    kernels: str = "compiled"
    stop: str | Callable[..., Any] = ""
    bulk_viscosity_linear: float = 0.0
    bulk_viscosity_quadratic: float = 0.0
    fields: str = ""
    pictures: str = "png"
    series: str = "vtu"
    explicit: ExplicitControls = field(default_factory=ExplicitControls)
    hht: HHTControls = field(default_factory=HHTControls)
    statics: StaticsControls = field(default_factory=StaticsControls)

    @property
    def dynamic(self) -> bool:
        """Whether there is an event in time, alone or beside a quasi-static one."""
        return self.analysis != "quasistatic"

    def __post_init__(self) -> None:
        choose("analysis", self.analysis, ANALYSES)
        choose("integrator", self.integrator, INTEGRATORS)
        choose("start", self.start, STARTS)
        self._check_stop()
        if self.start == "rest" and self.analysis != "dynamic":
            raise ParameterError(f"start rest is for analysis dynamic; got {self.analysis}")
        if self.contact and self.element in (why := {
                "planestress": "the lips of a thin sheet buckle out of it",
                "axisymmetric": "the medium between lips is not made for rings"}):
            raise ParameterError(f"contact is for elements jbar and plain; got {self.element}: {why[self.element]}")
        if self.explicit.debris == "remove" and (self.integrator, self.analysis) != ("explicit", "dynamic"):
            raise ParameterError(f"debris remove is for analysis dynamic with integrator explicit; got analysis "
                                 f"{self.analysis}, integrator {self.integrator}: take debris keep")
        choose("sink", self.sink, SINKS)
        choose("gradient", self.gradient, GRADIENTS)
        choose("density_solver", self.density_solver, SOLVERS)
        choose("element", self.element, ELEMENTS)
        backend(self.kernels)
        asked_fields(self.fields)
        choose("pictures", self.pictures, PICTURES)
        choose("series", self.series, SERIES)
        require("overshoot", self.overshoot, low=0, high=0.1, low_open=True)
        require("deletion", self.deletion, low=0, high=1e-2, low_open=True)
        require("force_floor", self.force_floor, low=0, high=0.1)
        for name in ("event_time", "record_every", "frame_every", "checkpoint_every"):
            require(name, getattr(self, name), "s", low=0, low_open=True)
        require("aftermath", self.aftermath, "s", low=0)
        require("balance_tolerance", self.balance_tolerance, low=0, high=1, low_open=True)
        require("threads", self.threads, low=0, high=256, whole=True)
        for name in ("bulk_viscosity_linear", "bulk_viscosity_quadratic"):
            if require(name, getattr(self, name), low=0, high=10) and ELEMENTS[self.element].thin_sheet:
                raise ParameterError(f"{name} is for elements whose volume changes; element {self.element} is a sheet "
                                     f"that thins freely: take viscosity; got {getattr(self, name)!r}")

    def _check_stop(self) -> None:
        """Refuse a condition that never holds in this analysis (ParameterError)."""
        conditions = read_stop(self.stop)
        for condition in conditions if isinstance(conditions, tuple) else ():
            if condition.name == NEVER.get(self.analysis):
                raise ParameterError(f"stop: {condition.name} is for the other analysis; got '{condition}', with "
                                     f"analysis {self.analysis}")

    def workers(self, dim: int) -> int:
        """Number of threads to use for a body of that dimension, >= 1."""
        asked = os.environ.get("OMP_NUM_THREADS", "")
        most: int = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]
        cores = int(asked) if asked.isdecimal() and int(asked) else most
        return self.threads or (1 if dim == 2 else min(cores, 4))
