"""Options that all cases share: material, sink, loading, analysis, integrator, controls, output."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Group, Parameter, Token

from ..errors import ParameterError, choose, require
from ..material import (
    AAA,
    MATERIALS,
    MODULI,
    Material,
    SinkLaw,
    constant_names,
    constants_text,
    limiter_of,
    material_of,
    own_constants,
)
from ..methods.controls import ExplicitControls, HHTControls, StaticsControls
from ..system.files import path_of
from ..units import Unit
from .controls import Controls
from .schedule import check_observers

__all__ = ["LAYOUTS", "NOT_PHYSICS", "OUTSIDE_A_DECK", "QUANTITIES", "SAMPLE", "Options"]

#: options that say where a run goes, or are set by the run itself
OUTSIDE_A_DECK = ("out", "resume", "overwrite", "quiet", "partition", "frame_pieces", "observers", "corridor",
                 "kept_mesh", "given_names")
#: options that are no part of a scene: those, and how its model was chosen
NOT_PHYSICS = ("model", "tolerance", "quantity", *OUTSIDE_A_DECK)
LAYOUTS = ("corridor", "uniform", "two-pass")
QUANTITIES = ("onset_load", "onset_displacement", "U", "D", "arrival_time", "tip_speed", "crack_path")


def _number(kind: type, tokens: Sequence[Token]) -> Any:
    """The number in the text, or the text itself: :func:`require` then says which numbers are allowed."""
    try:
        return kind(tokens[0].value)
    except ValueError:
        return tokens[0].value


def _numbers(name: str) -> Parameter:
    """Numbers, and words, that `--help` shows together."""
    return Parameter(group=Group.create_ordered(name), converter=_number)


SAMPLE, MODEL, MATERIAL, SINK, LOADING, ANALYSIS, EXPLICIT, HHT, CONTROLS = map(_numbers, (
    "Sample", "Model", "Material", "Sink", "Loading", "Analysis", "Explicit integrator", "HHT integrator", "Controls"))
OUTPUT = Parameter(group=Group.create_ordered("Output"))
MODEL_FLAG = Parameter(group=MODEL.group)
STOP = Parameter(group=ANALYSIS.group, show_default=False)
CONTACT = Parameter(group=ANALYSIS.group, negative="", show_default=False)
FLAG = Parameter(negative="", show_default=False)


@Parameter(name="*")
@dataclass(frozen=True)
class Options:
    """What every case can be asked for besides its dimensions; plain numbers in N, mm, MPa, s.

    Parameters
    ----------
    model
        "auto" (the cheapest one whose measured error is within `tolerance`), or a model by name: onset, statics,
        dynamics, full; with -half, -slab, -plane-stress, -uniform, -two-pass, -everywhere as far as the case has them.
        It sets the options of this group, `analysis`, `integrator`, and where it has to `element` and `event_time`.
    tolerance
        Of "auto": greatest relative error of `quantity`, > 0.
    quantity
        What "auto" is to get right: "onset_load", "onset_displacement", "U", "D", "arrival_time", "tip_speed" or
        "crack_path".
    start
        Of a dynamic analysis: "onset" (statics until then) or "rest" (dynamics from the unloaded body on).
    half
        Compute the half (dog-bone: quarter) that mirror symmetry leaves.
    dimensions
        2 or 3; 3 makes a plate a slab of one layer of hexahedra. 0 takes those of the sample.
    mesh_layout
        "corridor" (fine where a crack may run), "uniform" (fine everywhere; needs gmsh) or "two-pass" (fine along the
        path of a first pass on elements twice as large; needs gmsh, or is "corridor").
    active_zone
        Explicit steps solve for γ only where it changes.
    material
        Law of the stored energy: "aaa" (the paper's), "neo-hookean", "yeoh", "mooney-rivlin", "gent", "arruda-boyce",
        "ogden" or "hgo"; `skfsink material NAME` shows one.
    c1
        First constant of aaa [MPa], > 0.
    c2
        Second constant of aaa [MPa], >= 0.
    constants
        Constants of another law than aaa, as "mu = 0.27 MPa, limit = 76.5"; those left out have their defaults. Of
        all laws but hgo and ogden also "E = 1 MPa, nu = 0.499" or "G = 0.33 MPa, nu = 0.499" in place of bulk_modulus
        and of mu or c1; of ogden nu. Numbers of a vector: "mu = 0.63 0.0012 MPa, alpha = 1.3 5".
    bulk_modulus
        Bulk modulus k [MPa], > 0.
    density
        Density of the intact material ρ0 [kg/m^3], > 0.
    viscosity
        Shear viscosity η of the material [MPa s], >= 0: a stress 2 η dev d beside the elastic one, in dynamic analyses.
    phi
        Energy limiter Φ [MPa], > 0; 0 takes the one that belongs to the law's default constants (aaa: 0.1686).
    m
        Sharpness of the energy limiter, >= 1.
    length_scale
        Characteristic length l of damage [mm], > 0.
    sink
        Quadrature of the sink: "lumped" (row sums), "consistent" (the paper's) or "nearest" (node).
    gradient
        Matrix of the gradient term of γ: "monotone" (keeps 0 < γ <= 1 on every mesh) or "gauss" (the paper's; that of
        the consistent sink in any case).
    density_solver
        Conjugate gradients for γ with "multigrid", or with "jacobi", the diagonal alone (what several ranks take).
    deletion
        γ at which an element fails, in (0, 0.01].
    force_floor
        γ below which a Gauss point exerts no force, in [0, 0.1].
    speed
        Speed of a grip [mm/s], > 0.
    overshoot
        Scaling of the state past the onset, relative to the onset displacement, in (0, 0.1].
    analysis
        "dynamic", "quasistatic" or "both".
    integrator
        Of the dynamic event: "explicit" or "hht".
    front
        Quasi-static: a pass fails the points with at least this share of the greatest stored energy, in [0, 1].
    linear
        Statics: "auto" (by the size of the body), "direct" (factors: by "pardiso", "cholmod" or "superlu", the first
        that is installed, or one of these by name) or "petsc-mumps" (factors), or conjugate gradients with the
        hierarchies "multigrid" or "petsc-gamg", for bodies whose factors are too large; those of PETSc are computed by
        all ranks.
    element
        "jbar" (element-constant J̄), "plain" (standard Q1, locks), "planestress" (thin sheet with free faces, in 2D) or
        "axisymmetric" (body of revolution about the y axis, J̄; a 2D mesh at x >= 0; figures are of the whole body).
    kernels
        What evaluates the weak forms: "compiled" (element loops) or "forms" (scikit-fem, for small meshes).
    contact
        The lips of a crack bear on each other instead of passing through.
    bulk_viscosity_linear
        Linear coefficient b1 of the bulk viscosity of elements, in [0, 10]; typical 0.06.
    bulk_viscosity_quadratic
        Quadratic coefficient b2 of the bulk viscosity, for elements that are compressed, in [0, 10]; typical 1.2.
    event_time
        Longest dynamic event [s], > 0.
    stop
        What ends the run before its time: arrival, branching, separated, or a limit, "crack_length > 2 mm",
        "displacement > 0.2 mm", "time > 50 us", "passes > 100"; of several with commas the first. From Python also a
        function of the view of the run (:class:`skfsink.run.View`).
    aftermath
        Time for which the event goes on after the sample has come apart [s], >= 0.
    courant
        Explicit step over the stability limit estimated for the deformed state, in (0, 1].
    gamma_every
        Explicit steps between solves for γ, >= 0; 0 takes as many as fit in 0.03 l/c_s (0.1 µs), at most 10.
    energy_tolerance
        Energy that an explicit step may feed in or take out, of that of the body, in [0, 1]; else it is rejected and
        made again half as long. 0 rejects none.
    debris
        Pieces smaller than l that an explicit event has cut off from all grips: "keep" or "remove" (delete them).
    raised_mass
        Greatest share of the volume whose elements get more mass, lest they shorten the explicit step, in [0, 0.5].
    subcycled
        Greatest share of the volume whose elements take short explicit steps of their own instead, in [0, 0.5].
    mass_floor
        Least lumped mass of a node, relative to the intact one, in [0, 1).
    hht_alpha
        Damping parameter α of HHT, in [-1/3, 0].
    hht_dt
        Largest time step of HHT [s], > 0.
    coupling
        Of the two fields in an HHT step: "iterated" or "single" (one pass).
    mass
        Of HHT: "lumped" (row sums, as in the explicit scheme) or "consistent" (the paper's).
    balance_tolerance
        Energy balance error, relative to the onset energy, at which the run stops, in (0, 1].
    record_every
        Time between rows of history.csv [s], > 0.
    frame_every
        Time between frames of the ParaView series [s], > 0.
    checkpoint_every
        Wall time between checkpoints [s], > 0.
    threads
        Threads that share factorisations and loops over elements, >= 0; 0 takes one for a plane body and else
        OMP_NUM_THREADS or the machine's cores, at most 4. Runs with the same number agree to the last bit.
    fields
        What is drawn besides γ and the speed, with commas, of von_mises, principal_stress (the greatest), pressure,
        stretch (the greatest principal one) and W (energy density).
    pictures
        Format of the pictures: "png", "pdf" or "svg"; films are GIFs.
    series
        Files of the fields: "vtu" (one a frame) or "vtkhdf" (one of all, made at the end of the run; needs h5py).
    out
        Output folder; default results/CASE/MESH-ANALYSIS[-INTEGRATOR].
    resume
        Folder of an interrupted run to go on with; its scene.toml rules.
    overwrite
        Use an output folder that is not empty.
    quiet
        Show no progress.
    partition
        Folder with the parts of the body, a file for each rank of MPI, that `skfsink partition` has made.
    frame_pieces
        Let each rank of MPI write its piece of a frame, in a .vtu file of its own beside a .pvtu file.
    corridor
        Mesh that the first of two passes has left; set by the run.
    kept_mesh
        Mesh of the body that the run has left in its folder; set by the run.
    given_names
        Names of the options that a command line gave; a resumed run checks that they are its own.
    observers
        A user's observers of the run, from Python (:class:`skfsink.run.Observer`).
    """

    model: Annotated[str, MODEL] = ""
    tolerance: Annotated[float, MODEL] = 0.05
    quantity: Annotated[str, MODEL] = "U"
    start: Annotated[str, MODEL] = Controls.start
    half: Annotated[bool, MODEL_FLAG] = False
    dimensions: Annotated[int, MODEL] = 0
    mesh_layout: Annotated[str, MODEL] = "corridor"
    active_zone: Annotated[bool, MODEL_FLAG] = Controls.active_zone
    material: Annotated[str, MATERIAL] = "aaa"
    c1: Annotated[float, MATERIAL, Unit("MPa")] = AAA.c1
    c2: Annotated[float, MATERIAL, Unit("MPa")] = AAA.c2
    constants: Annotated[str, MATERIAL] = ""
    bulk_modulus: Annotated[float, MATERIAL, Unit("MPa")] = AAA.bulk_modulus
    density: Annotated[float, MATERIAL, Unit("kg/m^3")] = AAA.density
    viscosity: Annotated[float, MATERIAL, Unit("MPa s")] = AAA.viscosity
    phi: Annotated[float, SINK, Unit("MPa")] = 0.0
    m: Annotated[float, SINK, Parameter(name=["--m"])] = SinkLaw.m
    length_scale: Annotated[float, SINK, Unit("mm")] = SinkLaw.length_scale
    sink: Annotated[str, SINK] = Controls.sink
    gradient: Annotated[str, SINK] = Controls.gradient
    density_solver: Annotated[str, SINK] = Controls.density_solver
    deletion: Annotated[float, SINK] = Controls.deletion
    force_floor: Annotated[float, SINK] = Controls.force_floor
    speed: Annotated[float, LOADING, Unit("mm/s")] = 1e-3
    overshoot: Annotated[float, LOADING] = Controls.overshoot
    analysis: Annotated[str, ANALYSIS] = Controls.analysis
    integrator: Annotated[str, ANALYSIS] = Controls.integrator
    front: Annotated[float, ANALYSIS] = StaticsControls.front
    linear: Annotated[str, ANALYSIS] = StaticsControls.linear
    element: Annotated[str, ANALYSIS] = Controls.element
    kernels: Annotated[str, ANALYSIS] = Controls.kernels
    contact: Annotated[bool, CONTACT] = Controls.contact
    bulk_viscosity_linear: Annotated[float, ANALYSIS] = Controls.bulk_viscosity_linear
    bulk_viscosity_quadratic: Annotated[float, ANALYSIS] = Controls.bulk_viscosity_quadratic
    event_time: Annotated[float, ANALYSIS, Unit("s")] = Controls.event_time
    stop: Annotated[str, STOP] = ""
    aftermath: Annotated[float, ANALYSIS, Unit("s")] = Controls.aftermath
    courant: Annotated[float, EXPLICIT] = ExplicitControls.courant
    gamma_every: Annotated[int, EXPLICIT] = ExplicitControls.gamma_every
    energy_tolerance: Annotated[float, EXPLICIT] = ExplicitControls.energy_tolerance
    debris: Annotated[str, EXPLICIT] = ExplicitControls.debris
    raised_mass: Annotated[float, EXPLICIT] = ExplicitControls.raised_mass
    subcycled: Annotated[float, EXPLICIT] = ExplicitControls.subcycled
    mass_floor: Annotated[float, EXPLICIT] = ExplicitControls.mass_floor
    hht_alpha: Annotated[float, HHT] = HHTControls.alpha
    hht_dt: Annotated[float, HHT, Unit("s")] = HHTControls.dt
    coupling: Annotated[str, HHT] = HHTControls.coupling
    mass: Annotated[str, HHT] = HHTControls.mass
    balance_tolerance: Annotated[float, CONTROLS] = Controls.balance_tolerance
    record_every: Annotated[float, CONTROLS, Unit("s")] = Controls.record_every
    frame_every: Annotated[float, CONTROLS, Unit("s")] = Controls.frame_every
    checkpoint_every: Annotated[float, CONTROLS, Unit("s")] = Controls.checkpoint_every
    threads: Annotated[int, CONTROLS] = Controls.threads
    fields: Annotated[str, OUTPUT] = Controls.fields
    pictures: Annotated[str, OUTPUT] = Controls.pictures
    series: Annotated[str, OUTPUT] = Controls.series
    out: Annotated[Path | None, OUTPUT] = None
    resume: Annotated[Path | None, OUTPUT] = None
    overwrite: Annotated[bool, OUTPUT, FLAG] = False
    quiet: Annotated[bool, OUTPUT, FLAG] = False
    partition: Annotated[Path | None, OUTPUT] = None
    frame_pieces: Annotated[bool, OUTPUT, FLAG] = False
    corridor: Annotated[Path | None, Parameter(parse=False)] = None
    kept_mesh: Annotated[Path | None, Parameter(parse=False)] = None
    given_names: Annotated[frozenset[str], Parameter(parse=False)] = frozenset()
    observers: Annotated[tuple[Any, ...], Parameter(parse=False)] = ()

    def __post_init__(self) -> None:
        for name in ("out", "resume", "partition", "corridor", "kept_mesh"):
            if (folder := getattr(self, name)) is not None:
                object.__setattr__(self, name, path_of(name, folder))
        object.__setattr__(self, "observers", check_observers(self.observers))
        for f in fields(self):
            name, value = f.name, getattr(self, f.name)
            if isinstance(f.default, bool) and not isinstance(value, bool):
                raise ParameterError(f"{name} must be true or false; got {value!r:.80}")
            if isinstance(f.default, str) and not isinstance(value, str) and f.name != "stop":
                also = ", such as 'mu = 0.27 MPa, limit = 76.5'" if f.name == "constants" else ""
                raise ParameterError(f"{name} must be text{also}; got {value!r:.80}")
        require("speed", self.speed, "mm/s", low=0, low_open=True)
        require("tolerance", self.tolerance, low=0, low_open=True)
        choose("quantity", self.quantity, QUANTITIES)
        choose("mesh_layout", self.mesh_layout, LAYOUTS)
        if self.dimensions not in (0, 2, 3):
            raise ParameterError(f"dimensions must be 2, 3, or 0 for those of the sample; got {self.dimensions!r}")
        self.stored_energy(), self.sink_law(), self.controls()

    def stored_energy(self) -> Material:
        """The material."""
        if self.material == "aaa" and not self.constants.strip():
            return AAA(self.bulk_modulus, self.density, self.c1, self.c2, viscosity=self.viscosity)
        text = self._constants()
        of_nu = own_constants(self.material, text)[1] if self.material in MATERIALS else None
        if of_nu is not None and ("bulk_modulus" in self.given_names or self.bulk_modulus != Options.bulk_modulus):
            raise ParameterError(f"bulk_modulus {self.bulk_modulus!r} MPa and the nu of the constants ({of_nu:.6g} "
                                 f"MPa) say the same: give one of them")
        return material_of(self.material, text, self.bulk_modulus, self.density, self.viscosity)

    def _constants(self) -> str:
        """Text of the constants of the law, with those of aaa that are options of their own."""
        changed = [name for name in ("c1", "c2")
                   if name in self.given_names or getattr(self, name) != getattr(Options, name)]
        if self.material != "aaa":
            for name in changed:
                if getattr(self, name) != getattr(Options, name):
                    raise ParameterError(f"{name} is a constant of aaa; those of {self.material} go into constants; "
                                         f"got {getattr(self, name)!r}")
            return self.constants
        names = constant_names("aaa", self.constants)
        if not names <= set(MODULI):
            raise ParameterError(f"constants are those of another law than aaa, whose are c1 and c2, or E, G and nu; "
                                 f"got {self.constants!r}")
        stiff = names & {"E", "G"}
        if stiff and "c1" in changed:
            raise ParameterError(f"c1 {self.c1!r} MPa and the {min(stiff)} of the constants say the same: give one of "
                                 f"them")
        moduli = {"c2": require("c2", self.c2, "MPa"), **({} if stiff else {"c1": require("c1", self.c1, "MPa")})}
        return ", ".join([*(f"{name} = {value!r} MPa" for name, value in moduli.items()), self.constants])

    def sink_law(self) -> SinkLaw:
        """The sink and flux laws."""
        return SinkLaw(limiter_of(self.material).phi if self.phi == 0 else self.phi, self.m, self.length_scale)

    def controls(self) -> Controls:
        """How to compute."""
        shared = {f.name: getattr(self, f.name) for f in fields(Controls)
                  if f.name not in ("explicit", "hht", "statics")}
        return Controls(
            **shared, explicit=ExplicitControls(self.courant, self.gamma_every, self.mass_floor,
                                                energy_tolerance=self.energy_tolerance, debris=self.debris,
                                                raised_mass=self.raised_mass, subcycled=self.subcycled),
            hht=HHTControls(self.hht_alpha, self.hht_dt, coupling=self.coupling, mass=self.mass,
                            mass_floor=self.mass_floor),
            statics=StaticsControls(front=self.front, linear=self.linear))

    def parameters(self) -> dict[str, Any]:
        """The options that decide results, by name; the energy limiter is that of the law where it was 0.

        E, G and nu have become constants of the law and the bulk modulus.
        """
        chosen = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in NOT_PHYSICS}
        if set(MODULI) & constant_names(self.material, self.constants):
            material = self.stored_energy()
            chosen |= {"bulk_modulus": material.bulk_modulus, "constants": constants_text(material)}
            if isinstance(material, AAA):
                chosen |= {"c1": material.c1, "constants": ""}
        if callable(self.stop):  # which stands in no file
            chosen["stop"] = ""
        return {**chosen, "phi": self.sink_law().phi}
