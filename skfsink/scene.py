"""A scene: everything that defines a run, and its file `scene.toml`."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numba
import numpy as np
import tomli_w

from .density import SINKS
from .digest import digest
from .errors import OutputError, ParameterError, require
from .explicit import ExplicitControls
from .halving import Whole
from .hht import HHTControls
from .loading import Loading
from .loads import Grip, Ramp, Traction
from .material import Material, SinkLaw
from .momentum import ELEMENTS, check_element
from .regions import Region, check_lengths, divided
from .sample import Sample
from .statics import StaticsControls
from .tables import joined, split
from .text import read_toml

__all__ = ["ANALYSES", "INTEGRATORS", "STARTS", "Controls", "Grip", "Scene", "choose", "read_choice",
           "read_parameters"]

ANALYSES = ("dynamic", "quasistatic", "both")
INTEGRATORS = ("explicit", "hht")
STARTS = ("onset", "rest")


def choose(name: str, value: str, allowed: tuple[str, ...]) -> str:
    """Return `value` if it is one of the words allowed for `name`."""
    if value not in allowed:
        raise ParameterError(f"{name} must be one of {', '.join(allowed)}; got {value!r}")
    return value


@dataclass(frozen=True)
class Controls:
    """How a scene is computed.

    Parameters
    ----------
    analysis: "dynamic" or "quasistatic" ("both" is two runs).
    integrator: "explicit" or "hht", for the dynamic event.
    sink: "lumped", "consistent" or "nearest".
    element: "jbar", "plain" or "planestress" (thin sheets in two dimensions).
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
    start: of a dynamic analysis, "onset" (statics up to there) or "rest" (see :mod:`.rest`).
    active_zone: explicit steps solve for gamma only where it changes (see :mod:`.zone`).
    """

    analysis: str = "dynamic"
    integrator: str = "explicit"
    sink: str = "lumped"
    element: str = "jbar"
    overshoot: float = 0.005
    deletion: float = 1e-6
    force_floor: float = 1e-3
    event_time: float = 2e-4
    aftermath: float = 1e-5
    record_every: float = 1e-6
    frame_every: float = 5e-6
    balance_tolerance: float = 0.05
    checkpoint_every: float = 20.0
    threads: int = 0
    start: str = "onset"
    active_zone: bool = True
    explicit: ExplicitControls = field(default_factory=ExplicitControls)
    hht: HHTControls = field(default_factory=HHTControls)
    statics: StaticsControls = field(default_factory=StaticsControls)

    def __post_init__(self) -> None:
        choose("analysis", self.analysis, ANALYSES)
        choose("integrator", self.integrator, INTEGRATORS)
        choose("start", self.start, STARTS)
        if self.start == "rest" and self.analysis != "dynamic":
            raise ParameterError(f"start rest is for analysis dynamic; got {self.analysis}")
        choose("sink", self.sink, SINKS)
        choose("element", self.element, ELEMENTS)
        require("overshoot", self.overshoot, low=0, high=0.1, low_open=True)
        require("deletion", self.deletion, low=0, high=1e-2, low_open=True)
        require("force-floor", self.force_floor, low=0, high=0.1)
        for name in ("event_time", "record_every", "frame_every", "checkpoint_every"):
            require(name.replace("_", "-"), getattr(self, name), "s", low=0, low_open=True)
        require("aftermath", self.aftermath, "s", low=0)
        require("balance-tolerance", self.balance_tolerance, low=0, high=1, low_open=True)
        require("threads", self.threads, low=0, high=256, whole=True)

    def workers(self, dim: int) -> int:
        """Number of threads to use for a body of that dimension, >= 1."""
        asked = os.environ.get("OMP_NUM_THREADS", "")
        most: int = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]
        cores = int(asked) if asked.isdecimal() and int(asked) else most
        return self.threads or (1 if dim == 2 else min(cores, 4))


def _first_two(X: np.ndarray) -> np.ndarray:
    return X[:, :2]


@dataclass(frozen=True, eq=False)
class Scene:
    """A sample of a material, held by grips, and how to compute it.

    Parameters
    ----------
    case: name of the case module.
    title: for pictures.
    parameters: the arguments of the case function, enough to make this scene again.
    sample, material, sink_law: what is computed.
    grips: the reaction of the first one that moves is the load that is reported, along its motion.
    tractions: dead loads; without a grip that moves, the first one is the load that is reported.
    regions: elements of other materials than `material`; no element is in two.
    faces: in three dimensions, the surfaces of a sheet along which a crack runs; they are no edges it arrives at.
    view: azimuth and elevation [degrees] from which pictures show a body in space.
    rollers: boundaries held on planes of symmetry or between faces; they are no grips.
    whole: factors from the figures of the body to those of the whole sample.
    flat: maps points of the body (n, dim) to its section (n, 2) [mm].
    controls: how it is computed.
    assumed: statements about lengths that the paper does not print.
    choice: of a model, as it is printed and stored; it does not decide results beyond the parameters.

    Raises
    ------
    MeshError
        The mesh lacks the boundary of a grip.
    ParameterError
        The element is not for meshes of this dimension, or a region for this body.
    """

    case: str
    title: str
    parameters: Mapping[str, Any]
    sample: Sample
    material: Material
    sink_law: SinkLaw
    grips: tuple[Grip, ...]
    tractions: tuple[Traction, ...] = ()
    regions: tuple[Region, ...] = ()
    faces: tuple[str, ...] = ()
    view: tuple[float, float] = (-75.0, 60.0)
    rollers: tuple[Grip, ...] = ()
    whole: Whole = Whole()  # noqa: RUF009
    flat: Callable[[np.ndarray], np.ndarray] = _first_two
    controls: Controls = field(default_factory=Controls)
    assumed: tuple[str, ...] = ()
    choice: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for boundary in (load.boundary for group in (self.grips, self.rollers, self.tractions) for load in group):
            self.sample.nodes(boundary)
        check_element(self.controls.element, self.sample.space)
        check_lengths(self.sink_law, self.regions)
        _ = self.parts
        loading = self.loading()
        if self.controls.start == "rest" and (loading.knots or self.tractions):
            raise ParameterError("start rest is for grips of constant velocity; this scene has "
                                 f"{'tractions' if self.tractions else 'ramps'}: take start onset")
        if self.controls.start == "rest" and loading.speed(0.0) == 0.0:
            raise ParameterError("start rest needs a grip that moves; all of them are still: give one a velocity, or "
                                 "take start onset")

    @property
    def parts(self) -> tuple[Region, ...]:
        """The body by its materials: what is in no region first, with an empty name, if there is any."""
        return divided(self.sample.space.n_elements, self.material, self.sink_law, self.regions)

    @property
    def region_numbers(self) -> np.ndarray:
        """Number of the region each element is in, from 1, (ne,); 0 where it is in none."""
        numbers = np.zeros(self.sample.space.n_elements, np.int32)
        for i, region in enumerate(self.regions):
            numbers[region.elements] = i + 1
        return numbers

    def part(self, analysis: str) -> Scene:
        """This scene in one of the two analyses."""
        return replace(self, parameters={**self.parameters, "analysis": analysis},
                       controls=replace(self.controls, analysis=analysis))

    def loading(self) -> Loading:
        """What is held, moved and pulled at each load time.

        Raises
        ------
        ParameterError, MeshError
            As of :class:`.Loading`.
        """
        nodes = self.sample.nodes
        return Loading(self.sample.space, [(nodes(grip.boundary), grip) for grip in (*self.grips, *self.rollers)],
                       [(nodes(traction.boundary), traction) for traction in self.tractions])

    def constraints(self) -> tuple[np.ndarray, np.ndarray]:
        """Mask of the free degrees of freedom (n*dim,) and velocity of the held ones at first (n, dim) [mm/s]."""
        loading = self.loading()
        return loading.free, loading.velocity(0.0)

    @property
    def moving(self) -> Grip | None:
        """The first grip that moves at some time, None if there is none."""
        return next((grip for grip in self.grips if any(isinstance(v, Ramp) or v for v in grip.velocity)), None)

    @property
    def opposite(self) -> Grip | None:
        """The grip to which the motion of that one is relative: the last one, None if it is itself."""
        return self.grips[-1] if self.grips and self.grips[-1] is not self.moving else None

    @property
    def speed(self) -> float:
        """Speed at which the grips part at first [mm/s]."""
        velocity = np.zeros((2, self.sample.space.dim))
        for row, grip in zip(velocity, (self.moving, self.opposite)):
            if grip is not None:
                row[:] = [v.rate(0.0) if isinstance(v, Ramp) else v or 0.0 for v in grip.velocity]
        return float(np.linalg.norm(velocity[0] - velocity[1]))

    def toml(self, mesh: str = "") -> str:
        """Text of `scene.toml`; `mesh` is the name of a file beside it that keeps the mesh of a file of the user's."""
        head = ("# A run of skfsink. Run it again with: skfsink run scene.toml\n"
                "# Plain numbers are in N, mm, MPa and s; density in kg/m^3.\n")
        parameters = {k: v.item() if isinstance(v, np.generic) else v for k, v in self.parameters.items()}
        source = {}
        if mesh and self.sample.source:
            parameters["mesh"], source = mesh, {"source": self.sample.source}
        choice = {"choice": dict(self.choice)} if self.choice else {}
        return head + tomli_w.dumps({"case": self.case, **source, **split(parameters), "assumed": list(self.assumed),
                                     **choice})

    @property
    def fingerprint(self) -> str:
        """Hash of all that decides the results of the run, whatever the scene was made from, and wherever the mesh is.

        It has two parts, the older one of which checkpoints of earlier versions have alone; see :mod:`.checkpoint`.
        """
        text = replace(self, parameters={**self.parameters, "mesh": ""}, choice={}).toml()
        hashed, space = hashlib.sha256(text.encode()), self.sample.space
        for array in (space.X, space.conn, *(nodes for _, nodes in sorted(self.sample.boundaries.items()))):
            hashed.update(array.tobytes())
        hashed.update(f"{self.grips} {self.rollers} {self.tractions}".encode())
        for region in self.regions:
            hashed.update(f"{region.name} {region.material} {region.sink_law}".encode() + region.elements.tobytes())
        controls = replace(self.controls, checkpoint_every=Controls.checkpoint_every)  # a checkpoint changes nothing
        rest = digest([controls, self.material, self.sink_law, self.regions, self.grips, self.rollers, self.tractions,
                       self.faces, self.whole, self.sample.boundaries])
        return f"{hashed.hexdigest()}-{rest}"


def read_parameters(folder: Path, case: str) -> dict[str, Any]:
    """Parameters in the `scene.toml` of a run; a mesh file that it keeps is given by its path.

    Raises
    ------
    OutputError
        The folder holds no readable scene, or one of another case.
    """
    path = folder / "scene.toml"
    if not path.is_file():
        raise OutputError(f"{folder} holds no run to resume: there is no {path}")
    try:
        data = read_toml(path)
        found, parameters = str(data["case"]), joined(data, case == "custom")
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise OutputError(f"{path} is not the scene of a run: {error}") from None
    if found != case:
        raise OutputError(f"{folder} holds a run of case {found}, not of {case}")
    if Path(mesh := str(parameters.get("mesh", ""))).suffix:
        parameters["mesh"] = str((folder / mesh).absolute())
    return parameters


def read_choice(folder: Path) -> dict[str, Any]:
    """The choice of a model in the `scene.toml` of a run; empty if there is none."""
    return dict(read_toml(folder / "scene.toml").get("choice", {}))
