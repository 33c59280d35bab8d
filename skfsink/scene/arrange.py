"""The body that stands for a sample: where its elements are fine, whole or half, in two or three dimensions.

Meshes of a sample are sections; the steps from a section to a body are made here, for every case alike:

layout      "corridor": the committed mesh, fine in a corridor wide enough for any crack of the sample; "uniform": fine
            everywhere; "two-pass": fine along the path that a first pass on elements twice as large has found.
half        the section cut along its mirrors, with rollers there.
dimensions  a plate may be computed as a slab of one layer of hexahedra between faces that keep their distance, which is
            plane strain in space.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import meshio

from ..errors import MeshError, ParameterError
from ..loads.grips import Grip
from ..meshing.sample import Sample, kept_sample, load_sample, shape_sample
from ..meshing.shapes import SHAPES
from ..meshing.sweeping import swept
from ..meshing.symmetry import Mirror, Whole, cut
from ..meshing.vtu import read_mesh
from .options import Options

__all__ = ["COARSER", "arrange", "laid_out"]

COARSER = 2.0  # element size of a first pass over that of the mesh it is for
Lift = Callable[[meshio.Mesh], meshio.Mesh]


def arrange(case: str, own: Mapping[str, Any], options: Options, grips: tuple[Grip, ...], *, lift: Lift | None = None,
            faces: tuple[str, ...] = (), mirrors: tuple[Mirror, ...] = (), asymmetry: str = "it has no mirror plane",
            thickness: float = 1.0) -> dict[str, Any]:
    """The fields `sample`, `grips`, `rollers`, `faces` and `whole` of the scene of a case.

    Parameters
    ----------
    case, own, options: arguments of the case, with `half`, `dimensions`, `mesh_layout` and `corridor` of the options.
    grips: of the whole body, the first one above the others along y.
    lift: makes the section a body in space.   faces: surfaces of this along which cracks run.
    mirrors: planes of symmetry, along which a half (or quarter) is cut; `asymmetry` says why there are none.
    thickness: of the sample over that of the body, where they are not the same [mm/mm].

    Raises
    ------
    ParameterError
        The sample has no half or no body of this dimension, or it is a mesh file, which is taken as it is.
    MissingExtra
        The mesh has to be made, and gmsh is not installed.
    """
    cuts = mirrors if options.half else ()
    if options.half and not mirrors:
        raise ParameterError(f"half: {case} has no half that could be computed alone: {asymmetry}")
    changed = [f"--{name}" for name, is_so in (("half", options.half), ("dimensions", options.dimensions != 0),
                                                ("mesh-layout", options.mesh_layout != "corridor")) if is_so]
    if changed and Path(own["mesh"]).suffix:
        raise ParameterError(f"{', '.join(changed)} is for the meshes {', '.join(SHAPES[case].meshes)}; the mesh file "
                             f"{own['mesh']} is as it is")
    rollers: tuple[Grip, ...] = ()
    natural = 2 if lift is None else 3
    if options.dimensions not in (0, natural):
        if natural == 3:
            raise ParameterError(f"dimensions must be 3 for {case}; got 2" + (
                " (its section alone is --element planestress)" if case == "dog_bone" else ""))
        depth = SHAPES[case].meshes[own["mesh"]]["h"] if own["mesh"] in SHAPES[case].meshes else 1.0
        faces, rollers = ("back", "front"), tuple(Grip(name, (None, None, 0.0)) for name in ("back", "front"))
        grips = tuple(Grip(grip.boundary, (*grip.velocity, 0.0)) for grip in grips)
        lift, thickness = lambda section: swept(section, depth, 1), thickness / depth
    dim = len(grips[0].velocity)
    for mirror in cuts:
        roller = Grip(mirror.name, tuple(0.0 if i == mirror.axis else None for i in range(dim)))
        grips, rollers = ((*grips[:-1], roller), rollers) if mirror.between else (grips, (*rollers, roller))
        faces = (*faces, mirror.name) if mirror.along else faces

    def body(section: meshio.Mesh) -> meshio.Mesh:
        for mirror in cuts:
            section = cut(section, mirror)
        return section if lift is None else lift(section)

    return {"sample": _sample(case, own, options, body), "grips": grips, "rollers": rollers, "faces": faces,
            "whole": Whole.of(cuts, thickness)}


def _sample(case: str, own: Mapping[str, Any], options: Options, body: Lift) -> Sample:
    shape, name = SHAPES[case], own["mesh"]
    if options.kept is not None:
        return kept_sample(options.kept)
    if options.mesh_layout == "two-pass" and options.corridor is not None:
        path = options.corridor
        if not path.is_file():
            raise MeshError(f"there is no mesh of a corridor {path}; a run with --mesh-layout two-pass leaves it")
        return load_sample(case, name, lambda: read_mesh(path), body)
    settings = laid_out(case, name, options)
    if settings.get("symmetry") == "mirror" and f"{name}-mirror" in shape.meshes:
        own, settings = {**own, "mesh": f"{name}-mirror"}, {k: v for k, v in settings.items() if k != "symmetry"}
    return shape_sample(case, own, body, settings)


def laid_out(case: str, name: str, options: Options, distance: Callable[[float, float], float] | None = None
             ) -> dict[str, Any]:
    """Arguments of the shape's function, besides those of the named mesh, for its layout and for a half of it.

    `distance` from a path makes the fine mesh of two passes; without it "two-pass" is the mesh of the first.
    """
    shape = SHAPES[case]
    if name not in shape.meshes:
        return {}
    known, fine = inspect.signature(shape.make).parameters, shape.meshes[name]["h"]
    settings: dict[str, Any] = {}
    if options.half and "symmetry" in known and known["symmetry"].default == "none":
        settings["symmetry"] = "mirror"
    if options.mesh_layout == "uniform":
        settings["h_coarse"] = fine
    elif distance is not None:
        settings["distance"] = distance
    elif options.mesh_layout == "two-pass":
        coarse = shape.meshes[name].get("h_coarse", known["h_coarse"].default)
        settings |= {"h": COARSER * fine, "h_coarse": max(COARSER * fine, coarse)}
    return {k: v for k, v in settings.items() if v != shape.meshes[name].get(k)}

