"""The deformed body as it is drawn: live elements, cut open along the crack, seen from a direction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..fem.space import Space
from ..fields.crack import CRACKED
from ..fields.fragments import joined
from ..results.frame import SPENT, Frame

__all__ = ["FACETS", "OBLIQUE", "Body", "View", "bodies", "body", "extent", "fastest",
           "live_elements", "outer_facets", "round_up", "speed", "turned"]

View = tuple[float, float]          # azimuth and elevation [degrees] from which a body in space is seen
OBLIQUE = (-75.0, 60.0)
TORN = 3.0          # times the stretch of what is whole around it: a cracked element that is stretched more is torn
LEAST_PIECE = 0.02  # of the body; smaller fragments do not widen the axes

# nodes of an element are numbered lexicographically (see `space`); facets go round as seen from outside
FACETS = {2: np.array([[0, 1], [1, 3], [3, 2], [2, 0]]),
           3: np.array([[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]])}
_FACES = {2: [2, 1, 3, 0], 3: [0, 1, 2, 3, 4, 5]}  # their numbers in `Space.outer_faces`
_LIGHT = np.array([-0.3, 0.4, 0.87])  # towards the light: right, up, out of the picture


class Body(NamedTuple):
    """A frame as it is drawn."""

    triangles: np.ndarray  # from back to front: x, y [mm], gamma, brightness, colour of their corners, (nt, 3, 5)
    outline: np.ndarray    # lines along the edge of a plane body [mm], (lines, 2, 2)
    box: np.ndarray        # least and greatest x, y [mm], (2, 2)


def live_elements(space: Space, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """Elements to draw (nl,), and their corners on the deformed body [mm], (nl, na, dim).

    Left out are elements that are deleted, spent at every node, or torn apart. A spent node flies as it likes: each
    element has it move with the nodes that are not spent, so that the lips of a crack part cleanly. Torn is an element
    with a cracked node, of which an edge is stretched `TORN` times as much as any around it that has none. What has not
    cracked is drawn however far it is stretched.
    """
    holds = frame.gamma[space.conn] >= SPENT
    elements = np.flatnonzero(~frame.deleted & holds.any(axis=1))
    x = (space.X + frame.u)[space.conn[elements]]
    partly = np.flatnonzero(~holds[elements].all(axis=1))  # have a spent node
    conn, held = space.conn[elements[partly]], holds[elements[partly]][:, :, None]
    moved = np.sum(frame.u[conn], axis=1, where=held, keepdims=True) / held.sum(axis=1, keepdims=True)
    x[partly] = space.X[conn] + np.where(held, frame.u[conn], moved)
    if (frame.gamma[space.conn[elements]] >= CRACKED).all():  # nothing can be torn
        return elements, x
    X = space.X[space.conn[elements]]
    pairs = [(a, a | 1 << i) for i in range(space.dim) for a in range(2**space.dim) if not a >> i & 1]
    stretch = [_lengths(x[:, a] - x[:, b]) / _lengths(X[:, a] - X[:, b]) for a, b in pairs]
    kept = ~_torn(space, elements, frame.gamma, np.max(stretch, axis=0))
    return elements[kept], x[kept]


def _lengths(vectors: np.ndarray) -> np.ndarray:
    """Of vectors (k, dim), (k,)."""
    lengths: np.ndarray = np.sqrt(np.einsum("ki,ki->k", vectors, vectors))
    return lengths


def _torn(space: Space, elements: np.ndarray, gamma: np.ndarray, stretch: np.ndarray) -> np.ndarray:
    """Mask of the elements (nl,), with their greatest stretch of an edge, that are torn apart."""
    conn = space.conn[elements]
    whole = (gamma[conn] >= CRACKED).all(axis=1)
    around = np.zeros(space.n_nodes)  # greatest stretch of the whole elements at a node
    np.maximum.at(around, conn[whole], stretch[whole, None])
    usual = max(1.0, float(np.median(stretch[whole]))) if whole.any() else 1.0  # where none is near
    beside = around[conn].max(axis=1)
    return ~whole & (stretch > TORN * np.where(beside > 0, np.maximum(beside, 1.0), usual))


def bodies(space: Space, frames: Sequence[Frame], view: View,
           colours: Sequence[np.ndarray | None] | None = None) -> tuple[list[Body], np.ndarray, float]:
    """What to draw of the frames, the limits of the axes [mm] with a margin, (2, 2), and their height over width.

    `colours` are nodal values (n,) for each frame; without them it is gamma.
    """
    drawn = [body(space, frame, view, colour) for frame, colour in zip(frames, colours or [None] * len(frames))]
    left = [b.box for b in drawn if np.isfinite(b.box).all()] or [
        body(space, Frame(0.0, "", np.zeros_like(space.X), np.ones(space.n_nodes), np.zeros(space.n_elements, bool)),
             view).box]  # nothing is left in any frame
    box = np.array([np.min([low for low, _ in left], axis=0), np.max([high for _, high in left], axis=0)])
    box += 0.02 * np.ptp(box, axis=0).max() * np.array([[-1], [1]])
    width, height = box[1] - box[0]
    return drawn, box, float(height / width)


def body(space: Space, frame: Frame, view: View, colour: np.ndarray | None = None) -> Body:
    """The frame as it is drawn, coloured by gamma or by the nodal values `colour` (n,), which cracked nodes lack."""
    elements, x = live_elements(space, frame)
    gamma, facets = frame.gamma[space.conn[elements]], FACETS[space.dim]
    value = gamma if colour is None else _held(colour[space.conn[elements]], gamma >= CRACKED)
    if space.dim == 2:
        edge = space.outer_faces[elements][:, _FACES[2]] & (gamma[:, facets].min(axis=2) >= CRACKED)
        faces = np.dstack([x, gamma, np.ones_like(gamma), value])[:, [0, 1, 3, 2]]
        return Body(_triangles(faces), x[:, facets][edge], extent(space, elements, x, gamma))
    x = x @ turned(view).T
    box, (element, facet) = extent(space, elements, x[:, :, :2], gamma), np.nonzero(outer_facets(space, elements))
    x, gamma, value = (values[element[:, None], facets[facet]] for values in (x, gamma, value))
    normal = np.cross(x[:, 2] - x[:, 0], x[:, 3] - x[:, 1])
    light = 0.65 + 0.35 * np.clip(normal @ _LIGHT / np.linalg.norm(normal, axis=1), 0, 1)
    faces = np.dstack([x[:, :, :2], gamma, np.broadcast_to(light[:, None], gamma.shape), value])
    seen = np.flatnonzero(normal[:, 2] > 0)
    return Body(_triangles(faces[seen[np.argsort(x[seen, :, 2].mean(axis=1))]]), np.zeros((0, 2, 2)), box)


def turned(view: View) -> np.ndarray:
    """Unit vectors to the right, up, and to the observer, (3, 3)."""
    (ca, ce), (sa, se) = np.cos(np.radians(view)), np.sin(np.radians(view))
    return np.array([[-sa, ca, 0], [-ca * se, -sa * se, ce], [ca * ce, sa * ce, se]])


def speed(frame: Frame) -> np.ndarray:
    """Speed of the nodes [m/s], (n,)."""
    assert frame.v is not None
    values: np.ndarray = np.linalg.norm(frame.v, axis=1) / 1e3
    return values


def fastest(frames: Sequence[Frame]) -> float:
    """A round speed [m/s] that all but the fastest few of the nodes that hold stay below; frames may lack it."""
    speeds = [speed(frame)[frame.gamma >= CRACKED] for frame in frames if frame.v is not None]
    all_of_them = np.concatenate(speeds)
    return round_up(float(np.quantile(all_of_them, 0.999)) if all_of_them.size else 0.0)


def round_up(value: float) -> float:
    """The next of 1, 1.5, 2, 3, 4, 5, 6, 8 times a power of ten that is not less; 1e-9 at the least."""
    unit = 10.0 ** np.floor(np.log10(max(value, 1e-9)))
    return float(unit * next(step for step in (1, 1.5, 2, 3, 4, 5, 6, 8, 10) if step * unit >= value))


def _held(values: np.ndarray, holds: np.ndarray) -> np.ndarray:
    """Corner values (nl, na) of elements, those of corners that do not hold replaced by the mean of the others."""
    count = np.maximum(holds.sum(axis=1, keepdims=True), 1)
    replaced: np.ndarray = np.where(holds, values, np.sum(values, axis=1, where=holds, keepdims=True) / count)
    return replaced


def _triangles(faces: np.ndarray) -> np.ndarray:
    """Four triangles about the centre of each face (nf, 4, 5), cut off where gamma falls below `CRACKED`."""
    centre = np.broadcast_to(faces.mean(axis=1, keepdims=True), faces.shape)
    fan = np.stack([faces, np.roll(faces, -1, axis=1), centre], axis=2).reshape(-1, 3, 5)
    above = fan[:, :, 2] >= CRACKED
    count = above.sum(axis=1)
    whole, rim = np.flatnonzero(count == 3), np.flatnonzero(count % 3)
    one = count[rim] == 1
    first = np.where(one, above[rim].argmax(axis=1), above[rim].argmin(axis=1))  # the corner unlike the two others
    a, b, c = (fan[rim, (first + k) % 3] for k in range(3))
    ab, ac = (a + (end - a) * (CRACKED - a[:, 2:3]) / (end - a)[:, 2:3] for end in (b, c))
    kept = [fan[whole], *(np.stack(corners, axis=1)[mask] for corners, mask in
                          (((a, ab, ac), one), ((ab, b, c), ~one), ((ab, c, ac), ~one)))]
    order = np.concatenate([whole, rim[one], rim[~one], rim[~one]])
    return np.concatenate(kept)[np.argsort(order, kind="stable")]


def outer_facets(space: Space, elements: np.ndarray) -> np.ndarray:
    """Which facets of the elements, (nl, facets), are shared with no other of them."""
    gone = np.ones(space.n_elements, bool)
    gone[elements] = False
    return space.faces_without(np.flatnonzero(gone))[elements][:, _FACES[space.dim]]


def extent(space: Space, elements: np.ndarray, x: np.ndarray, gamma: np.ndarray) -> np.ndarray:
    """Least and greatest x, y (2, 2) of the pieces of the body that are not small fragments; NaN if nothing is left."""
    if not len(elements):
        return np.full((2, 2), np.nan)
    piece = joined(space.conn[elements], gamma >= SPENT)
    volume = np.bincount(piece, space.extent[elements])
    kept = x[volume[piece] > LEAST_PIECE * volume.sum()].reshape(-1, 2)
    return np.array([kept.min(axis=0), kept.max(axis=0)])
