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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import meshio
import numpy as np
from numpy.typing import NDArray

from ..errors import MeshError, require
from .edge import Edge
from .gmsh_model import Blocks, Sizes, add_outline, areas, generate, gmsh_model
from .ring import joined, parted

__all__ = ["Band", "Box", "Distance", "Edge", "SizeField", "completed", "mesh_outline", "scaled_jacobian"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Box = tuple[float, float, float, float]  # x0, x1, y0, y1 of a rectangle of fine elements
Band = tuple[float, float, float, float, float]  # x0, y0, x1, y1 of a line, and the distance from it
Distance = Callable[[float, float], float]

RIPPLE = 0.08  # root mean square of the relative ripple of the element size
RIPPLE_LENGTH = 15  # its wavelength in fine element sizes
TYPICAL_SCALE = 1.155  # triangles of 1.155 h make quadrilaterals of size h
TOLERANCE = 0.01  # relative, for the number of elements
LOOSE = 0.05  # the same along a corridor, which has no number to meet
SMALLEST = 0.25  # least area over longest diagonal, in element sizes (a square has 0.71)
SMALLEST_AT_RINGS = 0.125  # the same where rings make elements smaller: those that end them are as flat as they are
LEAST_JACOBIAN = 0.5
ATTEMPTS = 12  # meshes that are made to meet the last three


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

    Raises
    ------
    MeshError
        No mesh has convex quadrilaterals only, or rings of elements cannot be laid around an arc.
    MissingExtra
        There is no gmsh.
    """
    require("seed", seed, low=0)
    scale, best, least = TYPICAL_SCALE, None, math.inf
    outside, rings = parted(outline, size.h)

    def sizes(x: float, y: float) -> float:
        there = [[x, y]] if image is None or not rings else [[x, y], *image(np.array([[x, y]])).tolist()]
        return min([size(x, y), *(ring.size(a, b, size.grading) for ring in rings for a, b in there)])

    with gmsh_model() as gmsh:
        names = add_outline(gmsh, outside, rings)
        for attempt in range(ATTEMPTS):
            ripple = _ripple(RIPPLE_LENGTH * size.h, seed, attempt, image=image)
            points, quads, blocks, triangles = generate(gmsh, sizes, ripple, scale, names)
            ratio, miss = _judge(points, quads, sizes, size, TOLERANCE if size.distance is None else LOOSE)
            if miss < least and not triangles:
                best, least = (points, quads, blocks), miss
            if least <= 1:
                break
            scale *= math.sqrt(ratio)
    if best is None:
        raise MeshError("gmsh made no mesh of convex quadrilaterals only; try another seed")
    points, quads, blocks = best
    for ring in rings:
        points, quads, more = joined(ring, points, quads)
        blocks = blocks + more
    return _to_meshio(points, quads, blocks, list(dict.fromkeys(edge.name for edge in outline)))


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
    if areas(joined[other[:1]])[0] < 0:
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


def _judge(points: Array, quads: Indices, size: Sizes, without: Sizes, allowed: float) -> tuple[float, float]:
    """Number of elements over that of squares of the asked sizes; badness (1: good enough), with what it may be off.

    `without` are the sizes as they would be without rings.
    """
    cells = points[quads]
    centres = cells.mean(axis=1)[:, :2].tolist()
    wanted, alone = (np.array([sizes(x, y) for x, y in centres]) for sizes in (size, without))
    area, diagonals = areas(cells), np.linalg.norm(cells[:, 2:] - cells[:, :2], axis=2)
    ratio = len(quads) / float(np.sum(area / wanted**2))
    least = np.where(wanted < alone, SMALLEST_AT_RINGS, SMALLEST) * wanted
    smallest, jacobian = np.min(area / diagonals.max(axis=1) / least), scaled_jacobian(points, quads).min()
    if smallest <= 0 or jacobian <= 0:
        return ratio, math.inf
    return ratio, max(abs(ratio - 1) / allowed, 1 / smallest, LEAST_JACOBIAN / jacobian)


def _to_meshio(points: Array, quads: Indices, blocks: Blocks, names: Sequence[str]) -> meshio.Mesh:
    """Quadrilaterals and named line cells, numbered along strips (for locality)."""
    x, y, _ = points[quads].mean(axis=1).T
    quads = quads[np.lexsort((y, np.floor(x / np.sqrt(16 * np.median(areas(points[quads]))))))]
    used, first = np.unique(quads, return_index=True)
    order = used[np.argsort(first)]
    index = np.full(len(points), -1)
    index[order] = np.arange(len(order))
    grid = 2.0 ** (math.ceil(math.log2(np.abs(points).max())) - 28)  # coordinates of 28 bits compress well
    points = np.round(points[order] / grid) * grid
    owner = np.repeat([name for name, _ in blocks], [len(lines) for _, lines in blocks])
    sets = {name: [np.zeros(0, int), np.flatnonzero(owner == name)] for name in names}
    lines = index[np.concatenate([lines for _, lines in blocks])]
    return meshio.Mesh(points, [("quad", index[quads]), ("line", lines)], cell_sets=sets)
