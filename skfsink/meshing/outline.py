"""Unstructured all-quadrilateral meshes of notched samples, made with gmsh.

A sample is described by its *outline*, a closed chain of straight and circular `Edge` pieces that carry the
names of the boundaries, and by a `SizeField`, fine inside boxes and bands and graded outside of them.
`mesh_outline` turns these into a `meshio.Mesh`. The samples' own outlines are in :mod:`.shapes`.

The meshes are irregular on purpose, since long rows of aligned elements steer a crack. Frontal Delaunay
triangles are recombined and subdivided into quadrilaterals; a slight ripple of the element size, drawn from
`seed`, breaks up the rows that grow where the size is uniform.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray

from ..errors import MeshError, MissingExtra, require
from .edge import Edge
from .ring import Ring, joined, parted

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Box = tuple[float, float, float, float]  # x0, x1, y0, y1 of a rectangle of fine elements
Band = tuple[float, float, float, float, float]  # x0, y0, x1, y1 of a line, and the distance from it
Distance = Callable[[float, float], float]
Sizes = Callable[[float, float], float]  # element size at a point

RIPPLE = 0.08  # root mean square of the relative ripple of the element size
RIPPLE_LENGTH = 15  # its wavelength in fine element sizes
TYPICAL_SCALE = 1.155  # triangles of 1.155 h make quadrilaterals of size h
TOLERANCE = 0.01  # relative, for the number of elements
LOOSE = 0.05  # the same along a corridor, which has no number to meet
SMALLEST = 0.25  # least area over longest diagonal, in element sizes (a square has 0.71)
LEAST_JACOBIAN = 0.5
ATTEMPTS = 12  # meshes that are made to meet the last three
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


@dataclass(frozen=True)
class SizeField:
    """Element size: `h` inside boxes and bands, growing by `grading` per unit of distance up to `h_coarse`.

    With `distance`, of a point from a corridor of fine elements [mm], there are no boxes and bands.
    """

    h: float
    h_coarse: float
    boxes: tuple[Box, ...] = ()
    bands: tuple[Band, ...] = ()
    grading: float = 0.15
    distance: Distance | None = None

    def __post_init__(self) -> None:
        require("h", self.h, "mm", low=0, low_open=True)
        require("h_coarse", self.h_coarse, "mm", low=self.h)
        require("grading", self.grading, low=0, low_open=True)

    def __call__(self, x: float, y: float) -> float:
        """The element size at a point."""
        if self.distance is not None:
            return min(self.h_coarse, self.h + self.grading * self.distance(x, y))
        away = [math.hypot(max(a - x, x - b, 0), max(c - y, y - d, 0)) for a, b, c, d in self.boxes]
        for a, b, c, d, width in self.bands:
            along = ((x - a) * (c - a) + (y - b) * (d - b)) / ((c - a) ** 2 + (d - b) ** 2)
            along = min(1.0, max(0.0, along))
            away.append(max(0.0, math.hypot(x - a - along * (c - a), y - b - along * (d - b)) - width))
        return min(self.h_coarse, self.h + self.grading * min(away, default=0.0))


def mesh_outline(outline: Sequence[Edge], size: SizeField, *, seed: int = 0,
                 image: Callable[[Array], Array] | None = None) -> meshio.Mesh:
    """Mesh the region inside a closed `outline` with quadrilaterals; the boundary names become cell sets.

    With `image`, a symmetry of points (n, 2), the element sizes have that symmetry, as :func:`completed` wants it
    along a seam.

    What gmsh makes of a size field is some per cent off, by an amount that depends on the seed, and may have
    a tiny element, which would spoil the time step. Meshes are therefore made, each with its own ripple and a
    rescaled field, until one has as many elements as squares of the asked sizes and no bad element. Rings of elements
    around arcs (see :mod:`.ring`) are added to it.
    """
    require("seed", seed, low=0)
    scale, best, least = TYPICAL_SCALE, None, math.inf
    outside, rings = parted(outline, size.h)

    def sizes(x: float, y: float) -> float:
        there = [(x, y)] if image is None else [(x, y), tuple(image(np.array([[x, y]]))[0].tolist())]
        return min([size(x, y), *(ring.size(*point, size.grading) for ring in rings for point in there)])

    with _gmsh_model() as gmsh:
        names = _add_outline(gmsh, outside, rings)
        for attempt in range(ATTEMPTS):
            ripple = _ripple(RIPPLE_LENGTH * size.h, seed, attempt, image=image)
            points, quads, lines, triangles = _generate(gmsh, sizes, ripple, scale, names)
            ratio, miss = _judge(points, quads, sizes, TOLERANCE if size.distance is None else LOOSE)
            if miss < least and not triangles:
                best, least = (points, quads, lines), miss
            if least <= 1:
                break
            scale *= math.sqrt(ratio)
    if best is None:
        raise MeshError("gmsh made no mesh of convex quadrilaterals only; try another seed")
    points, quads, lines = best
    for ring in rings:
        points, quads = joined(ring, points, quads, lines)
    return _to_meshio(points, quads, {name: lines[name] for name in dict.fromkeys(edge.name for edge in outline)})


def scaled_jacobian(points: Array, quads: Indices) -> Array:
    """Smallest sine of the four corner angles of each quadrilateral: 1 for rectangles, <= 0 if not convex."""
    corners = points[quads][:, :, :2]
    ahead, back = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    cross = ahead[..., 0] * back[..., 1] - ahead[..., 1] * back[..., 0]
    smallest: Array = (cross / np.linalg.norm(ahead, axis=2) / np.linalg.norm(back, axis=2)).min(axis=1)
    return smallest


def completed(part: meshio.Mesh, seam: str, image: Callable[[Array], Array],
              names: Mapping[str, str] | None = None) -> meshio.Mesh:
    """A part of a symmetric mesh joined to its image; the boundary `seam`, where they meet, goes.

    `image` maps points (n, 2) by a reflection or half a turn that takes the seam to itself; nodes of the seam that
    have no node as their image are moved to where they have one. `names` are those of images of boundaries that are
    not called like the original.
    """
    points, quads, lines = part.points.copy(), part.cells_dict["quad"], part.cells_dict["line"]
    members = {name: np.asarray(sets[1]) for name, sets in part.cell_sets.items()}
    joint = np.unique(lines[members.pop(seam)])
    ends = points[joint, :2]
    along = np.argsort(ends @ np.ptp(ends, axis=0))
    partner = joint.copy()
    if not np.allclose(image(ends), ends):  # the seam is turned round
        partner[along] = joint[along[::-1]]
    gap = float(np.linalg.norm(image(ends) - points[partner, :2], axis=1).max())
    if gap > 0.1 * float(np.linalg.norm(np.diff(ends[along], axis=0), axis=1).min()):
        raise MeshError(f"nodes of the boundary {seam!r} are {gap:.3g} mm from their images; try another seed")
    points[joint, :2] = (ends + image(points[partner, :2])) / 2
    apart = np.setdiff1d(np.arange(len(points)), joint)
    number = np.empty(len(points), int)
    number[apart] = len(points) + np.arange(len(apart))
    number[joint] = partner
    copy = points[apart].copy()
    copy[:, :2] = image(copy[:, :2])
    joined = np.concatenate([points, copy])
    other, lines_there = number[quads], number[lines]
    if _areas(joined[other[:1]])[0] < 0:
        other, lines_there = other[:, ::-1], lines_there[:, ::-1]
    kept = np.unique(np.concatenate([*members.values()]))
    index = np.full(len(lines), -1)
    index[kept] = np.arange(len(kept))
    sets: dict[str, list[Indices]] = {}
    for k, rename in ((0, {}), (1, names or {})):
        for name, ids in members.items():
            found = sets.setdefault(rename.get(name, name), [np.zeros(0, int), np.zeros(0, int)])
            found[1] = np.concatenate([found[1], index[ids] + k * len(kept)])
    cells = [("quad", np.concatenate([quads, other])), ("line", np.concatenate([lines[kept], lines_there[kept]]))]
    return meshio.Mesh(joined, cells, cell_sets=sets)


def _ripple(length: float, *seeds: int, waves: int = 8,
            image: Callable[[Array], Array] | None = None) -> Callable[[float, float], float]:
    """A random smooth factor around 1: a sum of plane waves of all directions and about the given length."""
    random = np.random.default_rng([int(require("seed", seed, low=0)) for seed in seeds])
    angle, phase = random.uniform(0, 2 * np.pi, (2, waves))
    number = 2 * np.pi / length * random.uniform(0.7, 1.4, waves)
    kx, ky = number * np.cos(angle), number * np.sin(angle)
    amplitude = RIPPLE * math.sqrt(2 / waves)

    def factor(x: float, y: float) -> float:
        return 1 + amplitude * float(np.sin(kx * x + ky * y + phase).sum())

    if image is None:
        return factor
    return lambda x, y: (factor(x, y) + factor(*image(np.array([[x, y]]))[0])) / 2


@contextmanager
def _gmsh_model() -> Iterator[Any]:
    """The gmsh module with an empty model and the options of this module."""
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


def _add_outline(gmsh: Any, outline: Sequence[Edge], rings: Sequence[Ring]) -> dict[int, str]:
    """Add the surface inside the outline to the model; returns the boundary names by curve tag.

    Curves that rings of elements end at are divided as these are.
    """
    occ = gmsh.model.occ
    corners = [occ.addPoint(*edge.end, 0) for edge in outline]
    names: dict[int, str] = {}
    for i, edge in enumerate(outline):
        if edge.via is None:
            tag = occ.addLine(corners[i - 1], corners[i])
        else:
            via = occ.addPoint(*edge.via, 0)
            tag = occ.addCircleArc(corners[i - 1], via, corners[i], center=False)
            occ.remove([(0, via)])
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
        if edge.name or edge.via is None:
            continue
        ring = next(ends)
        yield tags[i], ring.count, 1.0
        if ring.seams[0] is None:
            yield tags[i - 1], ring.layers, ring.growth
        if ring.seams[1] is None:
            yield tags[i + 1], ring.layers, 1 / ring.growth


def _generate(gmsh: Any, size: Sizes, ripple: Callable[[float, float], float], scale: float,
              names: Mapping[int, str]) -> tuple[Array, Indices, dict[str, Indices], int]:
    """Mesh the model: points, counter-clockwise quads, line cells by name, number of triangles left."""
    mesh = gmsh.model.mesh
    mesh.clear()
    mesh.setSizeCallback(lambda dim, tag, x, y, z, _: scale * ripple(x, y) * size(x, y))
    for _, tag in gmsh.model.getEntities(1):
        if names[tag] and gmsh.model.getType(1, tag) == "Circle":
            x0, y0, _, x1, y1, _ = gmsh.model.getBoundingBox(1, tag)
            edges = gmsh.model.occ.getMass(1, tag) / size((x0 + x1) / 2, (y0 + y1) / 2)
            if edges < SHORT_ARC:  # an even number of them, at least four
                mesh.setTransfiniteCurve(tag, 2 * max(2, math.ceil(edges / 2)) + 1)
    mesh.generate(2)
    tags, coordinates, _ = mesh.getNodes()
    index = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    index[tags] = np.arange(len(tags))
    points = coordinates.reshape(-1, 3)
    triangles, quads = (index[mesh.getElementsByType(kind)[1]] for kind in (2, 3))
    quads = quads.reshape(-1, 4)
    quads = np.where(_areas(points[quads])[:, None] < 0, quads[:, ::-1], quads)
    blocks: dict[str, list[Indices]] = {}
    for _, tag in gmsh.model.getEntities(1):
        if names[tag]:
            blocks.setdefault(names[tag], []).append(index[mesh.getElements(1, tag)[2][0]].reshape(-1, 2))
    lines = {name: np.concatenate(found) for name, found in blocks.items()}
    return points, quads, lines, len(triangles) // 3


def _judge(points: Array, quads: Indices, size: Sizes, allowed: float) -> tuple[float, float]:
    """Number of elements over that of squares of the asked sizes; badness (1: good enough), with what it may be off."""
    cells = points[quads]
    wanted = np.array([size(x, y) for x, y, _ in cells.mean(axis=1).tolist()])
    areas, diagonals = _areas(cells), np.linalg.norm(cells[:, 2:] - cells[:, :2], axis=2)
    ratio = len(quads) / float(np.sum(areas / wanted**2))
    smallest, jacobian = np.min(areas / diagonals.max(axis=1) / wanted), scaled_jacobian(points, quads).min()
    if smallest <= 0 or jacobian <= 0:
        return ratio, math.inf
    return ratio, max(abs(ratio - 1) / allowed, SMALLEST / smallest, LEAST_JACOBIAN / jacobian)


def _areas(cells: Array) -> Array:
    """Areas of quadrilaterals given by their corners, positive if counter-clockwise."""
    one, two = cells[:, 2] - cells[:, 0], cells[:, 3] - cells[:, 1]
    return (one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]) / 2


def _to_meshio(points: Array, quads: Indices, lines: Mapping[str, Indices]) -> meshio.Mesh:
    """Quadrilaterals and named line cells, numbered along strips (for locality)."""
    x, y, _ = points[quads].mean(axis=1).T
    quads = quads[np.lexsort((y, np.floor(x / np.sqrt(16 * np.median(_areas(points[quads]))))))]
    used, first = np.unique(quads, return_index=True)
    order = used[np.argsort(first)]
    index = np.full(len(points), -1)
    index[order] = np.arange(len(order))
    grid = 2.0 ** (math.ceil(math.log2(np.abs(points).max())) - 28)  # coordinates of 28 bits compress well
    points = np.round(points[order] / grid) * grid
    blocks: list[Indices] = [index[block] for block in lines.values()]
    owner = np.repeat(np.array(list(lines)), [len(block) for block in blocks])
    sets = {name: [np.zeros(0, int), np.flatnonzero(owner == name)] for name in lines}
    return meshio.Mesh(points, [("quad", index[quads]), ("line", np.concatenate(blocks))], cell_sets=sets)


def has_gmsh() -> bool:
    """Whether meshes can be made here."""
    try:
        import gmsh  # noqa: F401
    except (ImportError, OSError):
        return False
    return True
