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
from dataclasses import dataclass, replace
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

__all__ = ["COARSER", "Arrangement", "arrange", "laid_out"]

COARSER = 2.0  # element size of a first pass over that of the mesh it is for
Lift = Callable[[meshio.Mesh], meshio.Mesh]


@dataclass(frozen=True)
class Arrangement:
    """What holds and moves a body, and how it comes from the section of the sample.

    Parameters
    ----------
    grips: the first one above the others along y.
    lift: makes the section a body in space; None leaves it plane.
    faces: surfaces of a body in space along which cracks run.
    rollers: boundaries held on planes of symmetry or between faces.
    thickness: of the sample over that of the body, where they are not the same [mm/mm].
    """

    grips: tuple[Grip, ...]
    lift: Lift | None = None
    faces: tuple[str, ...] = ()
    rollers: tuple[Grip, ...] = ()
    thickness: float = 1.0

    def as_slab(self, depth: float) -> Arrangement:
        """Of a plate one layer of hexahedra that is `depth` [mm] thick, between faces that keep their distance."""
        return Arrangement(
            tuple(Grip(grip.boundary, (*grip.velocity, 0.0)) for grip in self.grips),
            lambda section: swept(section, depth, 1), ("back", "front"),
            tuple(Grip(name, (None, None, 0.0)) for name in ("back", "front")), self.thickness / depth)

    def cut_along(self, mirror: Mirror) -> Arrangement:
        """Of the part on one side of a plane of symmetry, with rollers there; see :class:`.Mirror`."""
        dim = len(self.grips[0].velocity)
        roller = Grip(mirror.name, tuple(0.0 if i == mirror.axis else None for i in range(dim)))
        half = replace(self, faces=(*self.faces, mirror.name)) if mirror.along else self
        if mirror.between:
            return replace(half, grips=(*self.grips[:-1], roller))
        return replace(half, rollers=(*self.rollers, roller))


def arrange(case: str, arguments: Mapping[str, Any], options: Options, grips: tuple[Grip, ...], *,
            lift: Lift | None = None, faces: tuple[str, ...] = (), mirrors: tuple[Mirror, ...] = (),
            asymmetry: str = "it has no mirror plane", thickness: float = 1.0) -> dict[str, Any]:
    """The fields `sample`, `grips`, `rollers`, `faces` and `whole` of the scene of a case.

    Parameters
    ----------
    case, arguments, options: of the scene, with `half`, `dimensions`, `mesh_layout` and `corridor` of the options.
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
    if options.half and not mirrors:
        raise ParameterError(f"half: {case} has no half that could be computed alone: {asymmetry}")
    _check_mesh_file(case, arguments["mesh"], options)
    if options.half and options.element == "axisymmetric" and any(mirror.axis == 0 for mirror in mirrors):
        raise ParameterError(f"half: with element axisymmetric {case} is a body of revolution about x = 0, which is "
                             f"not cut along x: leave half out")
    body = Arrangement(grips, lift, faces, thickness=thickness)
    if options.dimensions not in (0, 2 if lift is None else 3):
        body = body.as_slab(_slab_depth(case, arguments["mesh"], options.dimensions))
    cuts = mirrors if options.half else ()
    for mirror in cuts:
        body = body.cut_along(mirror)

    def from_section(section: meshio.Mesh) -> meshio.Mesh:
        for mirror in cuts:
            section = cut(section, mirror)
        return section if body.lift is None else body.lift(section)

    return {"sample": _sample(case, arguments, options, from_section), "grips": body.grips, "rollers": body.rollers,
            "faces": body.faces, "whole": Whole.of(cuts, body.thickness)}


def _check_mesh_file(case: str, mesh: str, options: Options) -> None:
    """Refuse options that change a mesh together with a mesh file, which is taken as it is (ParameterError)."""
    changes = {"half": options.half, "dimensions": options.dimensions != 0,
               "mesh-layout": options.mesh_layout != "corridor"}
    if Path(mesh).suffix and any(changes.values()):
        flags = ", ".join(f"--{name}" for name, changed in changes.items() if changed)
        raise ParameterError(f"{flags} is for the meshes {', '.join(SHAPES[case].meshes)}; the mesh file {mesh} is as "
                             f"it is")


def _slab_depth(case: str, mesh: str, dimensions: int) -> float:
    """Thickness of a plate as a slab [mm], the size of its fine elements (ParameterError: it is no plate)."""
    if dimensions == 2:
        raise ParameterError(f"dimensions must be 3 for {case}; got 2" + (
            " (its section alone is element = 'planestress')" if case == "dog_bone" else ""))
    depth: float = SHAPES[case].meshes[mesh]["h"] if mesh in SHAPES[case].meshes else 1.0
    return depth


def _sample(case: str, arguments: Mapping[str, Any], options: Options, from_section: Lift) -> Sample:
    """The sample on the mesh that a run has left, or on that of the layout."""
    shape, name = SHAPES[case], arguments["mesh"]
    if options.kept_mesh is not None:
        return kept_sample(options.kept_mesh)
    if options.mesh_layout == "two-pass" and options.corridor is not None:
        path = options.corridor
        if not path.is_file():
            raise MeshError(f"there is no mesh of a corridor {path}; a run with mesh_layout = 'two-pass' leaves it")
        return load_sample(case, name, lambda: read_mesh(path), from_section)
    settings = laid_out(case, name, options)
    if settings.get("symmetry") == "mirror" and f"{name}-mirror" in shape.meshes:
        arguments = {**arguments, "mesh": f"{name}-mirror"}
        settings = {key: value for key, value in settings.items() if key != "symmetry"}
    return shape_sample(case, arguments, from_section, settings)


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
    return {key: value for key, value in settings.items() if value != shape.meshes[name].get(key)}
