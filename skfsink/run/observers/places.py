"""Where a body begins to fail, what is there, and what of its surface is no edge of it.

A *clamp* is a boundary that a grip holds in more than its normal: it hinders the body in contracting, so that strains
are greatest at its ends. A *plane of symmetry* is a flat boundary that is held at its place in its normal alone: the
body goes on behind it, as its image.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from ...errors import place_text
from ...fem import indicators
from ...fields.crack import CrackTracker, Plane
from ...fields.density import DensitySolver
from ...fields.state import State
from ...loads.grips import Grip, Ramp, Sliding
from ...loads.sliding import normal_of
from ...scene.scene import Scene
from ...units import MMHG

__all__ = ["beginning", "check_arrival", "check_beginning", "greatest_ratio", "onset_text", "rim_of", "symmetry_planes"]

log = logging.getLogger(__name__)

FLAT = 1e-6        # of the size of the body: nodes that are in a plane
EVEN = 0.05        # spread of 1 - gamma, of its greatest value, below which a body fails everywhere at once
SIDE = 0.4         # of the nodes of the surface: a boundary with more of them tells nothing about a place
AWAY = 3.0         # distance from a notch, in l, from which on a failure is not at it
SHARP = 25.0       # degrees: a surface that turns by as much at a node is a notch, not a fillet
NOTCHES = ("notch", "crack", "slit", "hole", "cut", "flaw")  # words in names of boundaries


def _outer(scene: Scene) -> np.ndarray:
    """Mask (n,) of the nodes of the surface."""
    mask = np.zeros(scene.sample.space.n_nodes, bool)
    mask[scene.sample.rim()] = True
    return mask


def _normal(scene: Scene, boundary: str) -> int | None:
    """The axis that is normal to a boundary, None if it is not flat in one."""
    X = scene.sample.space.X
    extents = np.ptp(X[scene.sample.nodes(boundary)], axis=0)
    flat = np.flatnonzero(extents <= FLAT * float(np.ptp(X, axis=0).max()))
    return int(flat[0]) if flat.size == 1 else None


def _held(scene: Scene, grips: Iterable[Grip]) -> Iterator[tuple[str, np.ndarray]]:
    """The boundary of each grip once, and the components in which most of its nodes are held."""
    held = ~scene.loading().free.reshape(scene.sample.space.X.shape)
    for name in dict.fromkeys(grip.boundary for grip in grips):
        yield name, np.flatnonzero(held[scene.sample.nodes(name)].mean(axis=0) > 0.5)


def _stands(value: float | Ramp | None) -> bool:
    """Whether a component is held at its place, or is left to another grip."""
    return value is None or not any(value.values if isinstance(value, Ramp) else [value])


def symmetry_planes(scene: Scene) -> list[tuple[str, Plane]]:
    """The planes of symmetry, by their names; without those that are `faces`, along which cracks run anyway.

    The axis of revolution, "", is one of the half plane.
    """
    found: list[tuple[str, Plane]] = []
    if (axis_nodes := np.flatnonzero(scene.space.on_axis)).size:
        found.append(("", Plane(0, axis_nodes)))
    outer, grips = _outer(scene), (*scene.grips, *scene.rollers)
    for name, held in _held(scene, grips):
        axis, nodes = _normal(scene, name), scene.sample.nodes(name)
        if axis is None or name in scene.faces or held.tolist() != [axis] or not outer[nodes].all():
            continue
        if all(isinstance(grip, Sliding) or _stands(grip.velocity[axis]) for grip in grips if grip.boundary == name):
            found.append((name, Plane(axis, nodes)))
    for name in dict.fromkeys(grip.boundary for grip in grips if isinstance(grip, Sliding)):
        nodes = scene.sample.nodes(name)
        if _normal(scene, name) is None and name not in scene.faces and outer[nodes].all():
            found.append((name, Plane(normal_of(scene.sample.space, nodes, name), nodes)))
    return found


def rim_of(scene: Scene) -> tuple[np.ndarray, list[Plane]]:
    """Nodes of the rim that a crack arrives at, and the planes of symmetry, which are no part of it."""
    planes = symmetry_planes(scene)
    return scene.sample.rim(*scene.faces, *(name for name, _ in planes if name)), [plane for _, plane in planes]


def clamps(scene: Scene) -> list[str]:
    """Names of the boundaries that grips hold in more than their normal."""
    return [name for name, held in _held(scene, scene.grips) if held.size and held.tolist() != [_normal(scene, name)]]


# --- the onset ---
def beginning(scene: Scene, state: State) -> dict[str, Any]:
    """Where the body begins to fail: `place_mm` of the weakest node, and the `boundary` there.

    That is the named boundary nearest to it within l, no plane of symmetry and no side of a sheet; "surface" or
    "inside" if there is none, by whether the rim is within l; "everywhere" if all nodes are as weak.
    """
    weakest = int(np.argmin(state.gamma))
    return {"place_mm": scene.sample.space.X[weakest].tolist(), "boundary": _boundary_at(scene, state, weakest)}


def _boundary_at(scene: Scene, state: State, node: int) -> str:
    lost, outer, sample = 1.0 - state.gamma, _outer(scene), scene.sample
    if np.ptp(lost) <= EVEN * lost.max():
        return "everywhere"
    grips = {grip.boundary for grip in scene.grips}
    limit = scene.sink_law.length_scale * (1 + 1e-9)
    x, X, rim = sample.space.X[node], sample.space.X, rim_of(scene)[0]
    others = {*scene.faces, *(name for name, _ in symmetry_planes(scene))}
    best = (limit, 3, len(X), "surface" if rim.size and _distance(X[rim], x) <= limit else "inside")
    for crack in scene.cracks:
        distance = _distance(X[sample.space.conn[crack.elements].ravel()], x)
        best = min(best, (round(distance, 9), 0, crack.elements.size, crack.name))
    for name, nodes in sample.boundaries.items():
        if not nodes.size or name in others or not outer[nodes].all() or nodes.size > SIDE * outer.sum():
            continue
        kind = 0 if _is_notch(name) else 1 if name in grips else 2
        distance = _distance(X[nodes], x)
        best = min(best, (round(distance, 9), kind, nodes.size, name))
    return best[-1]


def _is_notch(name: str) -> bool:
    return any(word in name.lower() for word in NOTCHES)


def _distance(X: np.ndarray, x: np.ndarray) -> float:
    return float(np.linalg.norm(X - x, axis=1).min())


def onset_text(onset: dict[str, Any]) -> str:
    """The onset in words."""
    x, boundary = place_text(onset["place_mm"]), onset["boundary"]
    where = {"everywhere": "everywhere at once, most", "inside": "inside,", "surface": "at its surface,"}.get(
        boundary, f"at {boundary},")
    p = onset.get("pressure_MPa")
    under = "" if p is None else f", under {1e3 * p:.4g} kPa ({p * MMHG:.4g} mmHg)"
    return f"the body begins to fail {where} at {x} mm{under}"


def check_beginning(scene: Scene, state: State) -> None:
    """Warn where the body begins to fail at a clamp, or has a notch and fails elsewhere."""
    space, l, sample = scene.sample.space, scene.sink_law.length_scale, scene.sample
    node = int(np.argmin(state.gamma))
    x, at = space.X[node], _boundary_at(scene, state, node)
    if at == "everywhere":
        return
    near = [(distance, name) for name in clamps(scene)
            if (distance := _distance(space.X[sample.nodes(name)], x)) <= l]
    if near:
        log.warning("the body begins to fail at the grip %s, at %s mm (nearer than l = %g mm): onset and crack are "
                    "those of the clamp, not of the body; give it wider ends, or the elements at the grip a stronger "
                    "region, or let the boundary slide", min(near)[1], place_text(x), l)
        return
    notch = _notch_nodes(scene)
    if at in [crack.name for crack in scene.cracks]:
        return
    if notch.size and (distance := _distance(space.X[notch], x)) > AWAY * l and not _on_plane(scene, x):
        log.warning("the body begins to fail at %s mm (%s), %.3g mm away from its notch (more than %g l): check grips "
                    "and mesh there, and whether the notch is loaded", place_text(x), at, distance, AWAY)


def _notch_nodes(scene: Scene) -> np.ndarray:
    """Nodes of boundaries that are called a notch, or else where the surface turns inwards sharply."""
    named = [nodes for name, nodes in scene.sample.boundaries.items() if _is_notch(name)]
    if named:
        return np.unique(np.concatenate(named))
    nodes, angles = indicators.turnings(scene.sample.space)
    return np.unique(nodes[angles > SHARP])


def _on_plane(scene: Scene, x: np.ndarray) -> bool:
    """Whether a point is at a plane of symmetry, where half of a slit ends without a corner."""
    X, l = scene.sample.space.X, scene.sink_law.length_scale
    return any(_distance(X[plane.nodes], x) <= l for _, plane in symmetry_planes(scene))


def greatest_ratio(density: DensitySolver, state: State) -> tuple[float, np.ndarray]:
    """Greatest W/Phi that any Gauss point has seen, and the middle of its element [mm]."""
    ratio = (state.W_max / density.phi).max(axis=1)
    space = density.space
    middle: np.ndarray = space.X[space.conn[int(np.argmax(ratio))]].mean(axis=0)
    return float(ratio.max()), middle


# --- the end ---
def check_arrival(scene: Scene, tracker: CrackTracker) -> None:
    """Say why a body that came apart has no first arrival, and so neither U nor D there."""
    if tracker.arrival is not None or not tracker.separated:
        return
    space, sample = scene.sample.space, scene.sample
    cracked = np.isfinite(tracker.cracked_at)
    if space.dim == 3:
        sides = [(int(cracked[nodes].sum()), name) for name, nodes in sample.boundaries.items() if nodes.size]
        names = [name for number, name in sorted(sides, reverse=True)[:2] if number]
        log.warning("the sample came apart without a first arrival, so arrival, U and D there are empty: the crack "
                    "runs through the surfaces of the sheet, which count as edges; name them, as by faces = \"%s\"",
                    ", ".join(names) or "back, front")
        return
    shares = [(float(cracked[nodes].mean()), name) for name, nodes in sample.boundaries.items() if nodes.size]
    share, name = max(shares, default=(0.0, "its surface"))
    log.warning("the sample came apart without a first arrival, so arrival, U and D there are empty: the crack joined "
                "no two edges but ran along the boundary %s (%.0f %% of its nodes cracked); take U and D at the end, "
                "or see that it does not fail there", name, 100 * share)
