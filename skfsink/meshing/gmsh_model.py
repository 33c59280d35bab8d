"""Outlines as models of gmsh, and the quadrilaterals that gmsh makes of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import MeshError, MissingExtra, place_text
from .edge import Edge
from .ring import INNER, Ring

__all__ = ["Blocks", "add_outline", "areas", "generate", "gmsh_model", "has_gmsh"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Sizes = Callable[[float, float], float]  # element size at a point
Blocks = list[tuple[str, Indices]]  # pieces of boundaries: their names, and their lines (m, 2)

SHORT_ARC = 12  # arcs of fewer edges get equal edges
OPTIONS = {
    "General.Terminal": 0,
    "General.NumThreads": 1,
    "Mesh.Algorithm": 6,  # frontal Delaunay
    "Mesh.RecombineAll": 1,
    "Mesh.RecombinationAlgorithm": 2,  # full-quad: recombine at twice the size, then subdivide
    "Mesh.Smoothing": 10,
    "Mesh.MeshSizeExtendFromBoundary": 0,
    "Mesh.MeshSizeFromPoints": 0,
    "Mesh.MeshSizeFromCurvature": 0,
}


@contextmanager
def gmsh_model() -> Iterator[Any]:
    """The gmsh module with an empty model and the options of this module.

    Raises
    ------
    MissingExtra
        gmsh cannot be imported.
    MeshError
        It is in use.
    """
    try:
        import gmsh
    except (ImportError, OSError) as error:  # OSError: a system library that gmsh needs is missing
        raise MissingExtra(f"making a mesh needs gmsh, which cannot be imported ({error})") from error
    if gmsh.isInitialized():
        raise MeshError("gmsh is in use; call gmsh.finalize() before making a mesh")
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        for option, value in OPTIONS.items():
            gmsh.option.setNumber(option, value)
        gmsh.model.add("sample")
        yield gmsh
    finally:
        gmsh.finalize()


def add_outline(gmsh: Any, outline: Sequence[Edge], rings: Sequence[Ring]) -> dict[int, str]:
    """Add the surface inside the outline to the model; returns the boundary names by curve tag.

    Curves that rings of elements end at are divided as these are. MeshError: a piece is no line or arc.
    """
    occ = gmsh.model.occ
    corners = [occ.addPoint(*edge.end, 0) for edge in outline]
    names: dict[int, str] = {}
    for i, edge in enumerate(outline):
        try:
            if edge.via is None:
                tag = occ.addLine(corners[i - 1], corners[i])
            else:
                via = occ.addPoint(*edge.via, 0)
                tag = occ.addCircleArc(corners[i - 1], via, corners[i], center=False)
                occ.remove([(0, via)])
        except Exception as error:  # gmsh raises nothing more special
            start = np.array(outline[i - 1].end)
            raise MeshError(f"the edge {edge.name!r} from {place_text(start)} to {place_text(np.array(edge.end))} mm "
                            f"is no {'line' if edge.via is None else 'arc'} (gmsh: {_short(error)}): leave it out, or "
                            f"make it longer") from None
        names[tag] = edge.name
    occ.addPlaneSurface([occ.addCurveLoop(list(names))])
    occ.synchronize()
    for tag, count, growth in _divisions(outline, list(names), rings):
        gmsh.model.mesh.setTransfiniteCurve(tag, count + 1, "Progression", growth)
    return names


def _divisions(outline: Sequence[Edge], tags: Sequence[int], rings: Sequence[Ring]) -> Iterator[tuple[int, int, float]]:
    """Number of elements, and ratio of the length of one and the next, on the curves that rings end at."""
    ends = iter(rings)
    for i, edge in enumerate(outline):
        if edge.name != INNER or edge.via is None:
            continue
        ring = next(ends)
        yield tags[i], ring.elements, 1.0
        if ring.seams[0] is None:
            yield tags[i - 1], ring.layers, ring.growth
        if ring.seams[1] is None:
            yield tags[i + 1], ring.layers, 1 / ring.growth


def generate(gmsh: Any, size: Sizes, ripple: Sizes, scale: float,
             names: Mapping[int, str]) -> tuple[Array, Indices, Blocks, int]:
    """Mesh the model with the element size `scale * ripple * size`.

    Returns
    -------
    points (n, 3), counter-clockwise quads (ne, 4), the lines of the boundaries, and the number of triangles left.

    Raises
    ------
    MeshError
        gmsh gives up, as where an edge is shorter than two elements.
    """
    mesh = gmsh.model.mesh
    mesh.clear()
    mesh.setSizeCallback(lambda dim, tag, x, y, z, _: scale * ripple(x, y) * size(x, y))
    for _, tag in gmsh.model.getEntities(1):
        if names[tag] != INNER and gmsh.model.getType(1, tag) == "Circle":
            x0, y0, _, x1, y1, _ = gmsh.model.getBoundingBox(1, tag)
            edges = gmsh.model.occ.getMass(1, tag) / size((x0 + x1) / 2, (y0 + y1) / 2)
            if edges < SHORT_ARC:  # an even number of them, at least four
                mesh.setTransfiniteCurve(tag, 2 * max(2, math.ceil(edges / 2)) + 1)
    try:
        mesh.generate(2)
    except Exception as error:  # gmsh raises nothing more special
        raise MeshError(_why_none(gmsh, size, names, _short(error))) from None
    tags, coordinates, _ = mesh.getNodes()
    index = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    index[tags] = np.arange(len(tags))
    points = coordinates.reshape(-1, 3)
    triangles, quads = (index[mesh.getElementsByType(kind)[1]] for kind in (2, 3))
    quads = quads.reshape(-1, 4)
    quads = np.where(areas(points[quads])[:, None] < 0, quads[:, ::-1], quads)
    blocks = [(names[tag], index[mesh.getElements(1, tag)[2][0]].reshape(-1, 2))
              for _, tag in gmsh.model.getEntities(1) if names[tag] != INNER]
    return points, quads, blocks, len(triangles) // 3


def _why_none(gmsh: Any, size: Sizes, names: Mapping[int, str], said: str) -> str:
    """Why gmsh has made no mesh: the piece that is shortest, counted in the elements there."""
    found = []
    for _, tag in gmsh.model.getEntities(1):
        if names[tag] != INNER:
            x0, y0, _, x1, y1, _ = gmsh.model.getBoundingBox(1, tag)
            place = (x0 + x1) / 2, (y0 + y1) / 2
            found.append((gmsh.model.occ.getMass(1, tag) / size(*place), names[tag], place))
    shortest, name, place = min(found)
    if shortest >= 2.0:
        return f"gmsh made no mesh: {said}; try another seed, or other sizes of elements"
    h = size(*place)
    return (f"the edge {name!r} around {place_text(np.array(place))} mm is {shortest * h:.3g} mm long, and elements "
            f"there are {h:.3g} mm large, of which an edge takes two (gmsh: {said}): make elements there at most "
            f"{shortest * h / 2:.2g} mm, or the edge longer")


def _short(error: Exception) -> str:
    return str(error).strip().splitlines()[0].rstrip(".") if str(error).strip() else type(error).__name__


def areas(cells: Array) -> Array:
    """Areas of quadrilaterals given by their corners, positive if counter-clockwise."""
    one, two = cells[:, 2] - cells[:, 0], cells[:, 3] - cells[:, 1]
    return (one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]) / 2


def has_gmsh() -> bool:
    """Whether meshes can be made here."""
    try:
        import gmsh  # noqa: F401
    except (ImportError, OSError):
        return False
    return True
