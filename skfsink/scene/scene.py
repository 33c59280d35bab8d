"""A scene: everything that defines a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..errors import MeshError, ParameterError, require
from ..fem.backends import backend
from ..fem.elements import ELEMENTS, check_element
from ..fem.space import Space
from ..fields.fragments import joined
from ..loads.grips import Grip, Ramp, Traction, Velocity
from ..loads.nodal import NodalLoads
from ..loads.pressure import Filling, Pressure
from ..loads.schedule import Loading
from ..material import Material, SinkLaw
from ..material.regions import Region, check_lengths, divided
from ..meshing.cracks import InitialCrack
from ..meshing.mesh_file import one_line
from ..meshing.sample import Sample
from ..meshing.symmetry import Whole
from ..methods.subcycling import check_subcycling
from .controls import Controls
from .digest import digest
from .fibres import directions_of
from .stop import stop_of
from .stored import StoredScene

__all__ = ["Scene"]

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
    sample, material, sink_law: what is computed; the element axisymmetric makes the sample one of revolution.
    grips: the reaction of the first one that moves is the load that is reported, along its motion.
    tractions: dead loads; without a grip that moves, the first one is the load that is reported.
    pressures: pressures that follow the surface, given or of a fluid; without a grip that moves and a traction, the
        first one is the load that is reported.
    loads: dead loads of other kinds, each made from the spaces by a function or an object that is called.
    event_at: load time at which a dynamic event begins, also where nothing has failed yet [s], >= 0; 0 begins it from
        the unloaded body. It begins at the onset if that comes first.
    velocities: that the body, or regions of it, have then; what is held moves as its grip does.
    regions: elements of other materials than `material`; no element is in two.
    cracks: elements that are broken from the start, so that the mesh need not have the crack.
    faces: in three dimensions, the surfaces of a sheet along which a crack runs; they are no edges it arrives at.
    view: azimuth and elevation [degrees] from which pictures show a body in space.
    rollers: boundaries held on planes of symmetry or between faces; they are no grips.
    whole: factors from the figures of the body to those of the whole sample.
    flat: maps points of the body (n, dim) to its section (n, 2) [mm].
    controls: how it is computed.
    assumed: statements about lengths that the paper does not print.
    probes: what is followed through a run, as tables of a deck; it decides nothing of it.
    model_choice: how the model was chosen, as it is printed and stored; it decides nothing beyond the parameters.

    Raises
    ------
    MeshError
        The mesh lacks the boundary of a grip, or one of the faces.
    ParameterError
        The element is not for meshes of this dimension, or a region for this body; or initial cracks leave none.
    """

    case: str
    title: str
    parameters: Mapping[str, Any]
    sample: Sample
    material: Material
    sink_law: SinkLaw
    grips: tuple[Grip, ...]
    tractions: tuple[Traction, ...] = ()
    pressures: tuple[Pressure | Filling, ...] = ()
    loads: tuple[Callable[[Space], NodalLoads], ...] = ()
    event_at: float = np.inf
    velocities: tuple[Velocity, ...] = ()
    regions: tuple[Region, ...] = ()
    cracks: tuple[InitialCrack, ...] = ()
    faces: tuple[str, ...] = ()
    view: tuple[float, float] = (-75.0, 60.0)
    rollers: tuple[Grip, ...] = ()
    whole: Whole = Whole()  # noqa: RUF009
    flat: Callable[[np.ndarray], np.ndarray] = _first_two
    controls: Controls = field(default_factory=Controls)
    assumed: tuple[str, ...] = ()
    probes: tuple[Mapping[str, Any], ...] = ()
    model_choice: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if ELEMENTS[self.controls.element].axisymmetric and self.sample.space.dim == 2:
            object.__setattr__(self, "sample", self.sample.revolved())
        for boundary in (load.boundary for group in (self.grips, self.rollers, self.tractions, self.pressures)
                         for load in group):
            self.sample.nodes(boundary)
        for name in self.faces:
            if name not in self.sample.boundaries:
                raise MeshError(f"faces: {name!r} is no boundary of mesh {self.sample.name}, which has "
                                f"{one_line(', '.join(sorted(self.sample.boundaries))) or 'none'}; names are parted by "
                                f"commas")
        check_element(self.controls.element, self.sample.space, self.controls.kernels)
        backend(self.controls.kernels).check(self.sample.space)
        check_lengths(self.sink_law, self.regions)
        _ = self.parts
        self._check_cracks()
        loading = self.loading()
        if self.controls.start == "rest" and (loading.knots or loading.dead or loading.followers or loading.turns):
            what = ("tractions" if self.tractions else "dead loads" if loading.dead else
                    "pressures" if loading.followers else "ramps" if loading.knots else "a grip that turns")
            raise ParameterError(f"start rest is for grips of constant velocity; this scene has {what}: take start "
                                 f"onset")
        self._check_beginning()
        if self.controls.explicit.subcycled and self.controls.dynamic and self.controls.integrator == "explicit":
            check_subcycling(loading, self.controls, max(part.material.viscosity for part in self.parts))
        if self.controls.start == "rest" and loading.speed(0.0) == 0.0:
            raise ParameterError("start rest needs a grip that moves; all of them are still: give one a velocity, or "
                                 "take start onset")

    def _check_cracks(self) -> None:
        """Refuse initial cracks that cut the body into pieces, or take a whole boundary that is held or loaded."""
        if not self.cracks:
            return
        space, whole = self.space, np.ones(self.space.n_nodes, bool)
        names = [crack.name for crack in self.cracks]
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise ParameterError(f"two cracks are called {twice}: give one of them another name")
        whole[space.conn[self.broken]] = False
        for boundary in (load.boundary for group in (self.grips, self.tractions) for load in group):
            if not whole[self.sample.nodes(boundary)].any():
                raise ParameterError(f"cracks {', '.join(names)} take the whole boundary {boundary}, which is held or "
                                     f"loaded: make them smaller")
        holds = whole[space.conn[np.setdiff1d(np.arange(space.n_elements), self.broken)]]
        conn = np.delete(space.conn, self.broken, axis=0)[holds.any(axis=1)]
        pieces = len(np.unique(joined(conn, holds[holds.any(axis=1)])))
        if pieces != 1:
            raise ParameterError(f"cracks {', '.join(names)} cut the body into {pieces} pieces before it is loaded: a "
                                 f"crack must leave it whole")

    @property
    def broken(self) -> np.ndarray:
        """Numbers of the elements of initial cracks, ascending."""
        return np.unique(np.concatenate([np.zeros(0, np.int64), *(crack.elements for crack in self.cracks)]))

    @property
    def cut(self) -> np.ndarray:
        """Numbers of the elements of initial cracks whose lips are whole, ascending."""
        cuts = [crack.elements for crack in self.cracks if crack.lips == "whole"]
        return np.unique(np.concatenate([np.zeros(0, np.int64), *cuts]))

    def _check_beginning(self) -> None:
        """Refuse a time of the event, and velocities then, that cannot be (ParameterError, MeshError)."""
        if self.event_at != np.inf:
            require("event_at", self.event_at, "s", low=0)
        if self.event_at == np.inf and not self.velocities:
            return
        what = "velocities are" if self.event_at == np.inf else "event_at is"
        if self.controls.analysis != "dynamic" or self.controls.start != "onset":
            raise ParameterError(f"{what} for analysis dynamic with start onset; got analysis "
                                 f"{self.controls.analysis}, start {self.controls.start}")
        if self.event_at == np.inf:
            raise ParameterError("velocities are those at the load time event_at: give it, 0 s for the unloaded body")
        for velocity in self.velocities:
            if len(velocity.velocity) != self.sample.space.dim:
                raise ParameterError(f"velocity of {velocity.region or 'the body'} must have {self.sample.space.dim} "
                                     f"components, as the mesh; got {len(velocity.velocity)}")
            for value in velocity.velocity:
                require(f"velocity of {velocity.region or 'the body'}", value, "mm/s")
        self.initial_velocity()

    def initial_velocity(self) -> np.ndarray:
        """Velocity of the nodes as the event begins, (n, dim) [mm/s]; later ones of `velocities` replace earlier ones.
        """
        space, v = self.sample.space, np.zeros_like(self.sample.space.X)
        for velocity in self.velocities:
            elements = self.sample.elements(velocity.region) if velocity.region else np.arange(space.n_elements)
            v[np.unique(space.conn[elements])] = velocity.velocity
        return v

    @property
    def space(self) -> Space:
        """The spaces of the sample."""
        return self.sample.space

    @property
    def parts(self) -> tuple[Region, ...]:
        """The body by its materials: what is in no region first, with an empty name, if there is any."""
        return divided(self.sample.space.n_elements, self.material, self.sink_law, self.regions)

    @property
    def fibres(self) -> np.ndarray | None:
        """Directions of the fibres of the elements, (ne, families, 3), NaN where there are none; None without any."""
        return directions_of(self.parts, self.space.X[self.space.conn].mean(axis=1))

    @property
    def region_numbers(self) -> np.ndarray:
        """Number of the region each element is in, from 1, (ne,); 0 where it is in none."""
        numbers = np.zeros(self.sample.space.n_elements, np.int32)
        for i, region in enumerate(self.regions):
            numbers[region.elements] = i + 1
        return numbers

    def part(self, analysis: str) -> Scene:
        """This scene in one of the two analyses."""
        stop = stop_of(self.controls.stop, analysis)
        asked = {"analysis": analysis, "stop": "" if callable(stop) else stop}
        return replace(self, parameters={**self.parameters, **asked},
                       controls=replace(self.controls, analysis=analysis, stop=stop))

    def loading(self) -> Loading:
        """What is held, moved and pulled at each load time.

        Raises
        ------
        ParameterError, MeshError
            As of :class:`.Loading`.
        """
        nodes = self.sample.nodes
        return Loading(self.sample.space, [(nodes(grip.boundary), grip) for grip in (*self.grips, *self.rollers)],
                       [(nodes(traction.boundary), traction) for traction in self.tractions],
                       [make(self.sample.space) for make in self.loads],
                       [(nodes(load.boundary), load) for load in self.pressures], self.event_at)

    def constraints(self) -> tuple[np.ndarray, np.ndarray]:
        """Mask of the free degrees of freedom (n*dim,) and velocity of the held ones at first (n, dim) [mm/s]."""
        loading = self.loading()
        return loading.free, loading.velocity(0.0)

    @property
    def moving(self) -> Grip | None:
        """The first grip that moves at some time, None if there is none."""
        return next((grip for grip in self.grips if grip.moves), None)

    @property
    def opposite(self) -> Grip | None:
        """The grip to which the motion of that one is relative: the last one, None if it is itself."""
        return self.grips[-1] if self.grips and self.grips[-1] is not self.moving else None

    @property
    def speed(self) -> float:
        """Speed at which the grips part at first [mm/s]."""
        velocity = np.zeros((2, self.sample.space.dim))
        for row, grip in zip(velocity, (self.moving, self.opposite)):
            if grip is not None and grip.velocity:
                row[:] = [v.rate(0.0) if isinstance(v, Ramp) else v or 0.0 for v in grip.velocity]
        return float(np.linalg.norm(velocity[0] - velocity[1]))

    def stored(self, mesh_file: str = "") -> StoredScene:
        """What `scene.toml` is to say of it; `mesh_file` is a file beside it that keeps the mesh of a user's file."""
        source = self.sample.source if mesh_file else ""
        parameters = {**self.parameters, "mesh": mesh_file} if source else self.parameters
        return StoredScene(self.case, parameters, source, self.assumed, self.model_choice)

    @property
    def fingerprint(self) -> str:
        """Hash of all that decides the results, whatever the scene was made from, and wherever the mesh is."""
        text = replace(self, parameters={**self.parameters, "mesh": ""}, model_choice={}).stored().toml()
        controls = replace(self.controls, checkpoint_every=Controls.checkpoint_every)  # a checkpoint changes nothing
        space = self.sample.space
        return digest([text, space.X, space.conn, self.sample.boundaries, controls,
                       tuple(backend(controls.kernels)), self.material, self.sink_law, self.regions, self.grips,
                       self.rollers, self.tractions, self.loads, self.faces, self.whole,
                       *((self.pressures,) if self.pressures else ()),
                       *([self.broken, self.cut] if self.cracks else []),
                       *([] if self.event_at == np.inf else [self.event_at, self.velocities])])
