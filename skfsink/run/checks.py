"""Checks before a run: whether units, speeds, steps and files to come are such as can be meant, and whether it is held.

What cannot be meant is refused by :func:`refuse` before a file is touched, what may be is warned of by :func:`warn`;
both say the figures and the cure, and take no longer than a look at the mesh. Thresholds stand here, with what they
rest on; `docs/stability.md` has them in a table.
"""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from ..errors import ParameterError, place_text
from ..fem.facets import boundary_facets
from ..fem.space import Space
from ..loads.rigid import free_motions, moves_as_a_whole, pieces
from ..loads.schedule import Loading
from ..scene.scene import Scene
from .checks_of_events import refuse_events, warn_of_events
from .checks_of_material import refuse_material, warn_of_material

__all__ = ["check_size", "is_viscous", "refuse", "warn"]

log = logging.getLogger(__name__)

# --- the body against l: damage is spread over l, elements are to be l/3 ---
LEAST_BODY = 0.5, 3.0      # size of the body, in l, below which it is refused, and warned of: a crack is l wide
LARGEST_H = 100.0          # smallest element, in l, above which a mesh is refused: none of its cracks means anything
# --- the grips ---
PIECES = 100                # of a mesh, joined at single nodes; more are elements that nothing joins


# --- what cannot be meant ---
def refuse(scene: Scene) -> None:
    """Refuse a scene whose figures cannot be meant.

    Raises
    ------
    ParameterError
        A body smaller than l, or elements of many l; a density or wave speed of no solid; a strength of none; grips
        faster than waves before a static onset; more steps or frames than can be made; a body, or a piece of one,
        that nothing holds or nothing strains; a traction or pressure that grips take up.
    """
    space = scene.sample.space
    check_size(space, scene.sink_law.length_scale)
    for part in scene.parts:
        refuse_material(scene, part)
    loading = scene.loading()
    if scene.controls.dynamic:
        refuse_events(scene, loading)
    _refuse_idle(scene, loading)
    label = pieces(space)
    count = int(label.max()) + 1
    if count > PIECES:
        raise ParameterError(f"the mesh is in {count} pieces that share no side (at most {PIECES}): merge nodes that "
                             f"coincide")
    for motion in free_motions(space, loading.free, label, loading.sliding):
        if motion.unheld:
            raise ParameterError(f"nothing holds {motion.piece}: its nodes are in no grip, nor joined to a piece that "
                                 f"is held; merge nodes that coincide, or hold it at a boundary")
    if not scene.velocities and not any(loading.speed(t) > 0.0 or loading.pull(t) > 0.0
                                        for t in (0.0, *loading.knots)):
        raise ParameterError("nothing loads the body: all its grips, tractions and pressures are still; give one of "
                             "them a velocity (a rate), or a ramp that rises")
    if not (scene.tractions or scene.pressures or scene.velocities) and moves_as_a_whole(space, loading, label):
        whole = "the body" if count == 1 else f"each of the {count} pieces of the body, which share no side,"
        raise ParameterError(f"the grips move {whole} as a whole and strain nothing: hold another boundary in the "
                             f"direction of the one that moves{', or merge nodes that coincide' if count > 1 else ''}")


def _refuse_idle(scene: Scene, loading: Loading) -> None:
    """Refuse tractions and pressures that act on held nodes alone, and would strain nothing."""
    free = loading.free.reshape(scene.sample.space.X.shape)
    if loading.tractions is not None and (idle := loading.tractions.idle(free)):
        boundary, axis = scene.tractions[idle[0][0]].boundary, "xyz"[idle[0][1]]
        raise ParameterError(f"the traction on {boundary} acts along {axis}, which grips hold at all of its nodes, and "
                             f"strains nothing: leave {axis} out of the grip, or of the traction")
    if loading.followers is not None and (useless := loading.followers.idle(free)):
        boundary = scene.pressures[useless[0]].boundary
        raise ParameterError(f"the pressure on {boundary} acts where grips hold all of its nodes against it, and "
                             f"strains nothing: end the grip short of {boundary}, or leave the pressure out")


METRES = "multiply those of a mesh in m by 1000 (skfsink mesh IN OUT --from m)"


def check_size(space: Space, length_scale: float, *, of_metres: str = METRES,
               of_micrometres: str = "divide those of a mesh in µm by 1000") -> None:
    """Refuse a body smaller than the length l [mm] of the sink, and elements of many l (ParameterError).

    `of_metres` and `of_micrometres` are the cures of a mesh in one of these units.
    """
    l, size, h = length_scale, float(np.ptp(space.X, axis=0).max()), float(space.h.min())
    if size < LEAST_BODY[0] * l:
        raise ParameterError(f"the body is {size:.3g} mm across, {size / l:.2g} of the length l = {l:g} mm over which "
                             f"damage spreads: coordinates are in mm, so {of_metres}, or lower length_scale")
    if h > LARGEST_H * l:
        raise ParameterError(f"the smallest element has h = {h:.3g} mm, {h / l:.3g} times the length l = {l:g} mm over "
                             f"which damage spreads (at most {LARGEST_H:g}): coordinates are in mm, so "
                             f"{of_micrometres}, or raise length_scale")


# --- what may be meant ---
def warn(scene: Scene, folder: Path) -> None:
    """Warn of figures of a scene that are unusual; its files go into `folder`."""
    space, l = scene.sample.space, scene.sink_law.length_scale
    size = float(np.ptp(space.X, axis=0).max())
    if size < LEAST_BODY[1] * l and space.n_elements > 1:  # a single element is a material point
        log.warning("the body is %.3g mm across, %.2g times the length l = %g mm over which damage spreads (less than "
                    "%g): it fails as a whole, without a crack; check the unit of the mesh (mm), or lower "
                    "length_scale", size, size / l, l, LEAST_BODY[1])
    for part in scene.parts:
        warn_of_material(scene, part)
    if (meant := scene.sample.element) and meant != scene.controls.element:
        what = "plane stress" if meant == "planestress" else "a body of revolution"
        log.warning("the mesh file has elements of %s, and the run takes element = '%s'%s: take element = '%s', or go "
                    "on if it is meant", what, scene.controls.element,
                    ", in plane strain" if scene.controls.element in ("jbar", "plain") else "", meant)
    loading = scene.loading()
    motions = [motion for motion in free_motions(space, loading.free, sliding=loading.sliding) if not motion.unheld]
    if motions:
        log.warning("the grips leave %s%s: it may drift or turn as it is loaded, which displacements and pictures "
                    "show; %s", ", and ".join(f"{m.piece} free to {m.name}" for m in motions[:3]),
                    f", and {len(motions) - 3} more motions" if len(motions) > 3 else "",
                    "; ".join(dict.fromkeys(m.cure for m in motions)))
    for kind, load in (*(("traction", load) for load in scene.tractions), *(("pressure", p) for p in scene.pressures)):
        nodes = scene.sample.nodes(load.boundary)
        bare = np.setdiff1d(nodes, space.mesh.facets[:, boundary_facets(space, nodes)])
        if bare.size:
            log.warning("the %s on %s acts on a part of it: %d of its %d nodes are on no side of the surface that has "
                        "all its nodes in it, such as the one at %s mm", kind, load.boundary, bare.size, nodes.size,
                        place_text(space.X[bare[0]]))
    if scene.controls.dynamic:
        warn_of_events(scene, loading, folder)
    elif is_viscous(scene):
        log.warning("viscosity has no effect in a quasi-static analysis, which has no velocities: take "
                    "analysis = 'dynamic', or leave it out")


def is_viscous(scene: Scene) -> bool:
    """Whether something in a scene is viscous."""
    c = scene.controls
    return bool(c.bulk_viscosity_linear or c.bulk_viscosity_quadratic
                or any(part.material.viscosity for part in scene.parts))
