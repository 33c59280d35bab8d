"""Tip and direction of the notch at which a body begins to fail, and the direction of a crack's front in a sheet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...errors import ParameterError
from ...fem.indicators import outer_faces
from ...fem.space import Space
from ...fields.release_rate import area_vectors
from ...scene.scene import Scene

__all__ = ["notch_tip", "through"]

SLIT = 0.03  # net area of a surface, of all of it, below which it is the two faces of a slit


def notch_tip(space: Space, node: int, within: float, left_out: Sequence[np.ndarray] = (),
              mirrored: Sequence[int] = (), gone: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray] | None:
    """Place of the node of the surface next to a node [mm], and the direction into the body there, (dim,) each.

    The direction is opposite to the mean normal of the surface, with a weight that falls from half of `within` [mm] to
    0 there, in which the flanks of a notch cancel; at the tip of a slit, where all does, it is away from the faces.
    Faces all of whose nodes are in one of `left_out`, as planes of symmetry, are no surface. `mirrored` are the
    normals (axes) of planes of symmetry that the notch is cut by: there is as much of it behind. `gone` are the numbers
    of elements that the body has not, as those of an initial crack. None where no surface is within three elements.
    """
    element, face = np.nonzero(outer_faces(space, left_out, gone))
    nodes = space.conn[element[:, None], space.face_corners[face]]
    surface = np.unique(nodes)
    if not surface.size:
        return None
    distance = np.linalg.norm(space.X[surface] - space.X[node], axis=1)
    tip = int(surface[np.argmin(distance)])
    if distance.min() > 3 * space.h[(space.conn == node).any(axis=1)].max():
        return None
    middles = space.X[nodes].mean(axis=1)
    weight = np.clip(2 * (1 - np.linalg.norm(middles - space.X[tip], axis=1) / within), 0.0, 1.0)
    near = (weight > 0) | (nodes == tip).any(axis=1)
    weight = np.maximum(weight[near, None], 1e-3)
    outwards = weight * area_vectors(space.X[nodes[near]], space.X[space.conn[element[near]]].mean(axis=1))
    into = -outwards.sum(axis=0)
    into[[*mirrored]] = 0.0
    if np.linalg.norm(into) < SLIT * np.linalg.norm(outwards, axis=1).sum():
        into = (weight * (space.X[tip] - middles[near])).sum(axis=0)
        into[[*mirrored]] = 0.0
    length = float(np.linalg.norm(into))
    return (space.X[tip].copy(), into / length) if length > 0 else None


def through(scene: Scene, tip: np.ndarray) -> np.ndarray:
    """Unit vector (3,) through the sheet at a tip, from one of its two faces to the other.

    Raises
    ------
    ParameterError
        The scene names no two faces.
    """
    if len(scene.faces) != 2:
        raise ParameterError("the front of the crack is not known: name the two faces of the sheet, as by faces = "
                             "\"back, front\"")
    X = scene.sample.space.X
    ends = [X[nodes[np.argmin(np.linalg.norm(X[nodes] - tip, axis=1))]]
            for nodes in (scene.sample.nodes(name) for name in scene.faces)]
    way = ends[1] - ends[0]
    return np.asarray(way / np.linalg.norm(way))
