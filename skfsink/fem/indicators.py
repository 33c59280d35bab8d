"""Measures of how sound a mesh or a state is, as numbers: what the guards and the stability study look at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .graph import node_key
from .space import Space

__all__ = ["Corner", "alternation", "below", "corner_near", "element_pressure", "greatest_stretch", "inverted",
           "mean_density", "outer_faces", "size_near", "turning", "turnings"]


class Corner(NamedTuple):
    """A node (2D) or an edge (3D) at which the body's surface turns inwards.

    Attributes
    ----------
    angle: by which it turns [degrees].   place: [mm], (dim,).
    radius: of the circle that the facets beside it are chords of [mm].   thickness: of their elements [mm].
    into: unit vector into the body, (dim,).
    """

    angle: float
    place: np.ndarray
    radius: float
    thickness: float
    into: np.ndarray


def outer_faces(space: Space, planes: Sequence[np.ndarray] = (), gone: np.ndarray | None = None) -> np.ndarray:
    """Mask (ne, 2 dim) of the faces on the surface of a body, numbered as `space.outer_faces`.

    Parameters
    ----------
    planes: nodes of each plane of symmetry: faces in it are none of the surface, since the body goes on behind them.
    gone: numbers of elements that the body lacks; the faces of others that met them are of its surface.
    """
    mask = space.outer_faces.copy() if gone is None or not gone.size else space.faces_without(gone)
    for plane in planes:
        on = np.zeros(space.n_nodes, bool)
        on[plane] = True
        for face, corners in enumerate(space.face_corners):
            mask[:, face] &= ~on[space.conn[:, corners]].all(axis=1)
    return mask


def turning(space: Space, planes: Sequence[np.ndarray] = ()) -> tuple[float, np.ndarray]:
    """Greatest angle [degrees] by which the body's surface turns inwards at a node (2D) or an edge (3D), and its place.

    A round notch meshed by n elements turns by 180/n at a node, a square one by 90, a slit by 180; convex corners do
    not count. The angle is that of the body around the node or edge, less 180 degrees. At a plane of symmetry (`planes`
    as in :func:`outer_faces`) it is that of the body with its image.
    """
    nodes, angles = turnings(space, planes)
    worst = int(np.argmax(angles))
    return float(angles[worst]), space.X[nodes[worst]].mean(axis=0)


def turnings(space: Space, planes: Sequence[np.ndarray] = (), gone: np.ndarray | None = None
             ) -> tuple[np.ndarray, np.ndarray]:
    """The node (m, 1), or the two nodes of an edge (m, 2), and the angle (m,) of :func:`turning` for each of them.

    The angle is negative where the surface turns outwards, and -180 inside; `planes` and `gone` are those of
    :func:`outer_faces`.
    """
    dim, conn = space.dim, space.conn
    corners = np.arange(2**dim)
    outer = outer_faces(space, planes, gone)               # (ne, 2 dim): whether face 2 axis + side is on the surface
    here = np.ones(space.n_elements)
    here[[] if gone is None else gone] = 0.0
    keys, angles, on_surface = [], [], []
    for along in range(dim) if dim == 3 else [-1]:
        i, j = (axis for axis in range(dim) if axis != along)
        for a in corners if dim == 2 else corners[(corners >> along & 1) == 0]:
            ends = [a] if dim == 2 else [a, a | 1 << along]
            arms = [sum(space.X[conn[:, end ^ 1 << axis]] - space.X[conn[:, end]] for end in ends)  # type: ignore[misc]
                    for axis in (i, j)]
            if dim == 3:
                edge = space.X[conn[:, ends[1]]] - space.X[conn[:, ends[0]]]
                edge /= np.linalg.norm(edge, axis=1, keepdims=True)
                arms = [arm - np.einsum("ei,ei->e", arm, edge)[:, None] * edge for arm in arms]
            lengths = np.linalg.norm(arms[0], axis=1) * np.linalg.norm(arms[1], axis=1)
            cosine = np.einsum("ei,ei->e", *arms) / lengths
            angles.append(here * np.arccos(np.clip(cosine, -1.0, 1.0)))
            keys.append(node_key(conn[:, ends], space.n_nodes))
            on_surface.append(outer[:, 2 * i + (a >> i & 1)] | outer[:, 2 * j + (a >> j & 1)])
    places, where = np.unique(np.concatenate(keys), return_inverse=True)
    around = np.bincount(where, np.concatenate(angles), len(places))
    nodes = places[:, None] if dim == 2 else np.stack(np.divmod(places, space.n_nodes), axis=1)
    for plane in planes:
        around = np.where(np.isin(nodes, plane).all(axis=1), 2.0 * around, around)  # with its image
    around[np.bincount(where, np.concatenate(on_surface), len(places)) == 0] = 0.0
    return nodes, np.degrees(around) - 180.0


def corner_near(space: Space, element: int, planes: Sequence[np.ndarray] = (), gone: np.ndarray | None = None
                ) -> Corner | None:
    """Where the surface turns inwards the most: at the element, or else at those that share a node with it.

    None where it does not, by a degree at least. `planes` and `gone` as in :func:`outer_faces`.
    """
    nodes, angles = turnings(space, planes, gone)
    around = np.isin(space.conn, space.conn[element]).any(axis=1)
    for near in (space.conn[element], np.unique(space.conn[around])):
        here = np.flatnonzero(np.isin(nodes, near).all(axis=1) & (angles > 1.0))
        if here.size:
            break
    else:
        return None
    worst = int(here[np.argmax(angles[here])])
    corner = space.X[nodes[worst]]
    place, breadth = corner.mean(axis=0), 1.0 if space.dim == 2 else float(np.linalg.norm(corner[1] - corner[0]))
    owners, faces = np.nonzero(outer_faces(space, planes, gone))
    members = np.take_along_axis(space.conn[owners], space.face_corners[faces], axis=1)
    beside = np.isin(members, nodes[worst]).sum(axis=1) == nodes.shape[1]
    owners, members = owners[beside], members[beside]
    far = np.array([space.X[np.setdiff1d(facet, nodes[worst])].mean(axis=0) for facet in members]) - place
    lengths = np.linalg.norm(far, axis=1)
    thickness = space.extent[owners] / (lengths * breadth)
    into = (space.X[space.conn[owners]].mean(axis=1) - space.X[members].mean(axis=1)).sum(axis=0)
    for plane in planes:
        if np.isin(nodes[worst], plane).all():
            into = _within(space.X[plane], into)
    if np.linalg.norm(into) < 1e-6 * lengths.mean():       # the lips of a slit face each other
        into = -far.mean(axis=0)
    return Corner(float(angles[worst]), place, float(lengths.mean() / np.radians(angles[worst])),
                  float(thickness.mean()), into / np.linalg.norm(into))


def _within(points: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """The part of a vector (dim,) in the plane, or on the line, of some points (k, dim)."""
    normal = np.linalg.svd(np.cov(points.T))[0][:, -1]
    part: np.ndarray = vector - (vector @ normal) * normal
    return part


def below(space: Space, corner: Corner, depth: float) -> np.ndarray:
    """Elements (k,) straight below a corner, no deeper than `depth` [mm]: their middles are near that line."""
    away = space.X[space.conn].mean(axis=1) - corner.place
    along = away @ corner.into
    aside = np.linalg.norm(away - along[:, None] * corner.into, axis=1)
    facet = corner.radius * np.radians(corner.angle)
    return np.flatnonzero((along > 0) & (along <= depth) & (aside <= np.maximum(0.75 * space.h, facet)))


def size_near(space: Space, node: int, radius: float) -> float:
    """Mean size h [mm] of the elements with a node within `radius` [mm] of a node."""
    near = np.linalg.norm(space.X - space.X[node], axis=1) <= radius
    return float(space.h[near[space.conn].any(axis=1)].mean())


def widths(space: Space) -> np.ndarray:
    """Width of the elements [mm], (ne,): their size across the longest edge or face; waves cross it first."""
    x = space.X[space.conn]
    na, dim = space.conn.shape[1], space.dim
    ends = [(a, a + 2**i) for i in range(dim) for a in range(na) if not a >> i & 1]
    edges = np.stack([np.linalg.norm(x[:, b] - x[:, a], axis=1) for a, b in ends], axis=1)
    along = edges.reshape(len(x), dim, -1).max(axis=2)  # longest of each reference direction
    width: np.ndarray = space.extent / np.sort(along, axis=1)[:, 1:].prod(axis=1)
    return width


def inverted(space: Space, u: np.ndarray, gamma: np.ndarray) -> tuple[int, float]:
    """Gauss points with gamma > 0 and J <= 0 at the displacement `u`: their number, and the greatest gamma there.

    `gamma` (ne, nq) is the density that the force sees. Points beyond the axis of revolution count.
    """
    plane, around = _ratios(space, u)
    inside_out = ((plane <= 0.0) | (around <= 0.0)) & (gamma > 0.0)
    return int(inside_out.sum()), float(gamma[inside_out].max(initial=0.0))


def element_pressure(space: Space, u: np.ndarray, bulk_modulus: float) -> np.ndarray:
    """k (J_bar - 1) of the elements at the displacement `u` [MPa], (ne,)."""
    plane, around = _ratios(space, u)
    return bulk_modulus * (space.element_mean(plane * around) - 1.0)


def _ratios(space: Space, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """det F in the space of the mesh, and r/R of a body of revolution, 1 of others; at the Gauss points (ne, nq)."""
    plane, F = np.linalg.det(np.eye(space.dim) + space.gradient(u)), np.ones((*space.w.shape, 3, 3))
    space.add_hoop(F, u)
    return plane, F[..., 2, 2]


def alternation(space: Space, pressure: np.ndarray, part: np.ndarray | slice = slice(None)) -> float:
    """Amplitude [MPa] with which element pressures (ne,) alternate: rms of what a smoothing over the nodes takes away.

    Each element is compared with the mean over its nodes of the mean over their elements: a pressure that is linear in
    space passes on an even mesh, a checkerboard is taken away as a whole. `part` says which elements are looked at, as
    if the others were not there: the pressure jumps where materials meet.
    """
    weight, pressure, conn = space.V[part], pressure[part], space.conn[part]
    elements = np.repeat(np.arange(len(conn)), conn.shape[1])
    nodes = conn.ravel()
    total = np.bincount(nodes, weight[elements], space.n_nodes)
    at_nodes = np.bincount(nodes, (weight * pressure)[elements], space.n_nodes) / np.maximum(total, 1e-300)
    rough = pressure - at_nodes[conn].mean(axis=1)
    return float(np.sqrt(weight @ rough**2 / weight.sum()))


def mean_density(space: Space, gamma: np.ndarray) -> float:
    """Mean of the nodal relative density over the body."""
    return float(np.einsum("eq,eq->", space.w, space.at_gauss(gamma)) / space.V.sum())


def greatest_stretch(space: Space, u: np.ndarray, live: np.ndarray) -> float:
    """Greatest length of an edge of the `live` elements, a mask (ne,), displaced by `u` (n, dim), relative to its
    undeformed one; at least 1."""
    greatest, corners, conn = 1.0, np.arange(2**space.dim), space.conn[live]
    for axis in range(space.dim):
        ends = [conn[:, corners[(corners >> axis & 1) == side]] for side in range(2)]
        before = space.X[ends[1]] - space.X[ends[0]]
        after = before + u[ends[1]] - u[ends[0]]
        square = np.einsum("eai,eai->ea", after, after) / np.einsum("eai,eai->ea", before, before)
        greatest = max(greatest, float(square.max(initial=0.0)) ** 0.5)
    return greatest
