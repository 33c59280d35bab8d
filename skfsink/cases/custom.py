"""A scene of your own: any mesh, held, moved and pulled at its named boundaries, of one or several materials."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ..errors import ParameterError
from ..loads.body_force import BodyForce
from ..loads.grips import Grip, Traction, Velocity
from ..loads.pressure import Filling, Pressure
from ..material.regions import Region, RegionLaw, by_element
from ..meshing.sample import file_sample
from ..results.result import Result
from ..run.checks import check_size
from ..run.compute import run_case
from ..run.keywords import case_function
from ..run.request import check_options
from ..scene.case import Case
from ..scene.fibres import with_fibres
from ..scene.options import SAMPLE, Options
from ..scene.scene import Scene
from ..scene.tables import (
    body_forces_of,
    cracks_of,
    grips_of,
    in_points,
    pressures_of,
    read_tables,
    regions_of,
    tractions_of,
    velocities_of,
)
from ..system.files import path_of
from ..units import Unit

__all__ = ["custom"]

IN_A_DECK = Parameter(parse=False)
#: what to ask for in the place of a model
INSTEAD = {"onset": 'event_time = "1 ns" ends the run at the onset', "statics": 'take analysis = "quasistatic"',
           "dynamics": "leave it out", "full": 'take start = "rest"'}
#: of the shared parameters: those for the cases of the paper alone
REFUSED = ("model", "tolerance", "quantity", "half", "dimensions", "mesh_layout", "speed")


@case_function
def custom(
        *,
        mesh: Annotated[str, SAMPLE] = "",
        title: Annotated[str, SAMPLE] = "Custom scene",
        faces: Annotated[str, SAMPLE] = "",
        merge_nodes: Annotated[float, SAMPLE, Unit("mm")] = 0.0,
        grips: Annotated[Sequence[Grip | Mapping[str, Any]], IN_A_DECK] = (),
        tractions: Annotated[Sequence[Traction | Mapping[str, Any]], IN_A_DECK] = (),
        pressures: Annotated[Sequence[Pressure | Mapping[str, Any]], IN_A_DECK] = (),
        fillings: Annotated[Sequence[Filling | Mapping[str, Any]], IN_A_DECK] = (),
        body_forces: Annotated[Sequence[Mapping[str, Any]], IN_A_DECK] = (),
        event_at: Annotated[float, SAMPLE, Unit("s")] = math.inf,
        velocities: Annotated[Sequence[Velocity | Mapping[str, Any]], IN_A_DECK] = (),
        regions: Annotated[Sequence[RegionLaw | Mapping[str, Any]], IN_A_DECK] = (),
        fibres: Annotated[Sequence[Mapping[str, Any]], IN_A_DECK] = (),
        probes: Annotated[Sequence[Mapping[str, Any]], IN_A_DECK] = (),
        cracks: Annotated[Sequence[Mapping[str, Any]], IN_A_DECK] = (),
        options: Options = Options(),  # noqa: B008
) -> Result:
    """Load a body of your own until it fails, and watch the crack.

    The body is the mesh; named boundaries of it are grips, or carry tractions. Boundaries that the mesh does not name
    may be called "left", "right" (least and greatest x), "bottom", "top" (y), "back" and "front" (z). It is loaded
    statically to the onset of failure; the crack then runs dynamically or quasi-statically.

    Parameters
    ----------
    mesh
        Path of a mesh file of quadrilaterals or hexahedra, in mm: gmsh, Abaqus .inp, VTU or what else meshio reads.
    title
        For pictures and reports.
    faces
        Of a sheet in three dimensions: names of the boundaries along which cracks run, with commas; they are no
        edges a crack arrives at.
    merge_nodes
        Distance within which nodes of the mesh become one [mm]; 0 leaves them apart. A mesh in pieces is refused.
    grips
        Boundaries that are held or moved: for x, y, z a velocity, or a ramp of points [time, displacement]; a
        component left out is free. The load is the force on the first one that moves. From Python also a
        :class:`.Curve`, a function of the load time.
    tractions
        Dead loads on boundaries, per undeformed area: for x, y, z a rate, or a ramp of points [time, traction]. From
        Python also a :class:`.Curve`.
    pressures
        Pressures on boundaries, which follow the deformed surface: a value, which is reached in the first second of
        load time, or a ramp of points [time, pressure]; or a rate. With `in_crack` they act in cracks from it as well.
    fillings
        Cavities into which a fluid is pumped: inflow, or a ramp of points [time, volume], and compliance, volume by
        pressure, of fluid and pump. A plane body counts as 1 mm thick.
    body_forces
        Forces per mass, such as weight, on the body or on a region: for x, y, z a rate, or a ramp of points [time,
        acceleration].
    event_at
        Load time at which a dynamic event begins, also where nothing has failed yet [s], >= 0; 0 begins it from the
        unloaded body, inf at the onset.
    velocities
        Of the body, or of a region, as the event begins at `event_at`, for x, y, z.
    regions
        Named sets of elements that are of another material, or of another strength.
    fibres
        Directions of the fibres of `hgo`, of the body or of a region: a vector, around or along a line, by two angles,
        or an array of the mesh file.
    probes
        What is followed through the run, each into a file of its own: quantities at points, along lines and over
        surfaces, forces on boundaries, enclosed volumes, openings.
    cracks
        Cracks that the mesh has not: elements along a line, in a surface or of a named set, broken from the start.
    options
        Material, analysis and controls; see :class:`~skfsink.scene.options.Options`. `speed` is for the other cases.

    Returns
    -------
    Result
        Summary, history and last state; its files are in the output folder.
    """
    if check_options(options).model:
        cure = INSTEAD.get(options.model, "analysis, integrator and start say what is computed")
        raise ParameterError(f"model is for the cases of the paper, whose models were measured; got {options.model!r}: "
                             f"{cure}")
    if not isinstance(faces, str):
        raise ParameterError(f"faces must be text, names of boundaries with commas, such as 'back, front'; got "
                             f"{faces!r:.80}")
    arguments = {"mesh": mesh, "title": title, "faces": faces, "merge_nodes": merge_nodes,
                 "grips": read_tables("grips", grips), "tractions": read_tables("tractions", tractions),
                 **{name: read_tables(name, tables) for name, tables in (
                     ("pressures", pressures), ("fillings", fillings), ("body_forces", body_forces),
                     ("regions", regions), ("fibres", fibres), ("velocities", velocities), ("probes", probes),
                     ("cracks", cracks))},
                 "event_at": event_at}
    return run_case(CASE, arguments, options)


def _scene(arguments: dict[str, Any], options: Options) -> Scene:
    if not Path(arguments["mesh"]).suffix:
        raise ParameterError(f"mesh must be the path of a mesh file; got {arguments['mesh']!r}")
    pressures = pressures_of(arguments.get("pressures", ()), arguments.get("fillings", ()))
    if not arguments["grips"] and not arguments["tractions"] and not pressures:
        raise ParameterError("grips: a scene needs at least one grip, traction or pressure; a deck has them as "
                             "[[grips]]")
    if options.speed != Options.speed:
        raise ParameterError(f"speed is for the cases of the paper; a grip of a custom scene has its own velocity; "
                             f"got {options.speed:g}")
    for name in ("half", "dimensions", "mesh_layout"):
        if getattr(options, name) != getattr(Options, name):
            raise ParameterError(f"{name} is for the cases of the paper; the mesh file {arguments['mesh']} is taken "
                                 f"unchanged")
    sample = file_sample(path_of("mesh", arguments["mesh"]), arguments.get("merge_nodes", 0.0))
    material, sink_law = options.stored_energy(), options.sink_law()
    regions = tuple(Region(law.name, sample.elements(law.name), *law.laws(material, sink_law))
                    for law in regions_of(arguments["regions"]))
    material, regions = with_fibres(arguments.get("fibres", ()), sample, material, regions,
                                    options.element == "axisymmetric")
    check_size(sample.space, sink_law.length_scale)  # before a crack that is not found in a body of another unit
    dim = sample.space.dim
    rho0 = by_element(sample.space.n_elements, material.rho0, regions, lambda region: region.material.rho0)
    weights = tuple(partial(BodyForce, rho0=rho0, rate=rate, elements=sample.elements(name) if name else None)
                    for name, rate in body_forces_of(arguments.get("body_forces", ()), dim))
    written = {name: in_points(arguments[name]) for name in ("grips", "tractions")}
    return Scene(
        case="custom", title=arguments["title"], sample=sample,
        parameters={**arguments, **written, **options.parameters()},
        material=material, sink_law=sink_law, controls=options.controls(), regions=regions,
        grips=grips_of(arguments["grips"], dim),
        tractions=tractions_of(arguments["tractions"], dim), loads=weights, pressures=pressures,
        event_at=arguments.get("event_at", math.inf), velocities=velocities_of(arguments.get("velocities", ()), dim),
        probes=tuple(arguments.get("probes", ())), cracks=cracks_of(arguments.get("cracks", ()), sample),
        faces=tuple(filter(None, (name.strip() for name in arguments["faces"].split(",")))))


CASE = Case(custom, _scene, REFUSED)

if __name__ == "__main__":
    from ..cli.program import command

    command(custom)
