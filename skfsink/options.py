"""Options that all cases share: material, sink, loading, analysis, integrator, controls, output."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from .errors import require
from .explicit import ExplicitControls
from .hht import HHTControls
from .material import AAA, SinkLaw
from .scene import Controls

__all__ = ["Options"]

NOT_PHYSICS = ("out", "resume", "overwrite", "quiet")  # say where a run goes, not what it is


@Parameter(name="*")
@dataclass(frozen=True)
class Options:
    """What every case can be asked for besides its dimensions; plain numbers in N, mm, MPa, s.

    Parameters
    ----------
    speed
        Speed of a grip [mm/s], > 0.
    c1
        First constant of the stored energy [MPa], > 0.
    c2
        Second constant of the stored energy [MPa], >= 0.
    bulk_modulus
        Bulk modulus k [MPa], > 0.
    phi
        Energy limiter Φ [MPa], > 0.
    m
        Sharpness of the energy limiter, >= 1.
    length_scale
        Characteristic length l of damage [mm], > 0.
    density
        Density of the intact material ρ0 [kg/m^3], > 0.
    analysis
        "dynamic", "quasistatic" or "both".
    integrator
        Of the dynamic event: "explicit" or "hht".
    hht_alpha
        Damping parameter α of HHT, in [-1/3, 0].
    hht_dt
        Largest time step of HHT [s], > 0.
    coupling
        Of the two fields in an HHT step: "iterated" or "single" (one pass).
    mass
        Of HHT: "lumped" (row sums, as in the explicit scheme) or "consistent" (the paper's).
    courant
        Explicit step over the stability limit estimated for the deformed state, in (0, 1].
    gamma_every
        Explicit steps between solves for γ, >= 1; 0 takes as many as fit in 0.03 l/c_s (0.1 µs).
    sink
        Quadrature of the sink: "lumped" (row sums), "consistent" (the paper's) or "nearest" (node).
    element
        "jbar" (element-constant J̄) or "plain" (standard Q1, locks).
    overshoot
        Scaling of the state past the onset, relative to the onset displacement, in (0, 0.1].
    force_floor
        γ below which a Gauss point exerts no force, in [0, 0.1].
    mass_floor
        Least lumped mass of a node in the explicit scheme, relative to the intact one, in [0, 1).
    deletion
        γ at which an element fails, in (0, 0.01].
    event_time
        Longest dynamic event [s], > 0.
    aftermath
        Time for which the event goes on after the sample has come apart [s], >= 0.
    record_every
        Time between rows of history.csv [s], > 0.
    frame_every
        Time between frames of the ParaView series [s], > 0.
    balance_tolerance
        Energy balance error, relative to the onset energy, at which the run stops, in (0, 1].
    checkpoint_every
        Wall time between checkpoints [s], > 0.
    threads
        Threads of the factorisations, >= 1; bits are reproducible with 1.
    out
        Output folder; default results/CASE/MESH-ANALYSIS[-INTEGRATOR].
    resume
        Folder of an interrupted run to go on with; its scene.toml rules.
    overwrite
        Use an output folder that is not empty.
    quiet
        Show no progress.
    """

    speed: float = 1e-3
    c1: float = 0.617
    c2: float = 1.215
    bulk_modulus: float = 500.0
    phi: float = 0.1686
    m: Annotated[float, Parameter(name=["--m"])] = 10.0
    length_scale: float = 0.1
    density: float = 1433.0
    analysis: str = "dynamic"
    integrator: str = "explicit"
    hht_alpha: float = -0.05
    hht_dt: float = 1.6e-7
    coupling: str = "iterated"
    mass: str = "lumped"
    courant: float = 0.8
    gamma_every: int = 0
    sink: str = "lumped"
    element: str = "jbar"
    overshoot: float = 0.005
    force_floor: float = 1e-3
    mass_floor: float = 1e-3
    deletion: float = 1e-6
    event_time: float = 2e-4
    aftermath: float = 1e-5
    record_every: float = 1e-6
    frame_every: float = 5e-6
    balance_tolerance: float = 0.05
    checkpoint_every: float = 20.0
    threads: int = 1
    out: Path | None = None
    resume: Path | None = None
    overwrite: Annotated[bool, Parameter(negative="")] = False
    quiet: Annotated[bool, Parameter(negative="")] = False

    def __post_init__(self) -> None:
        require("speed", self.speed, "mm/s", low=0, low_open=True)
        self.material(), self.sink_law(), self.controls()

    def material(self) -> AAA:
        """The stored energy."""
        return AAA(self.bulk_modulus, self.density, self.c1, self.c2)

    def sink_law(self) -> SinkLaw:
        """The sink and flux laws."""
        return SinkLaw(self.phi, self.m, self.length_scale)

    def controls(self) -> Controls:
        """How to compute."""
        return Controls(
            self.analysis, self.integrator, self.sink, self.element, self.overshoot, self.deletion, self.force_floor,
            self.event_time, self.aftermath, self.record_every, self.frame_every, self.balance_tolerance,
            self.checkpoint_every,
            self.threads, ExplicitControls(self.courant, self.gamma_every, self.mass_floor),
            HHTControls(self.hht_alpha, self.hht_dt, coupling=self.coupling, mass=self.mass))

    def parameters(self) -> dict[str, Any]:
        """The options that decide results, by name."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name not in NOT_PHYSICS}
