"""Checks before a run: whether units, speeds, steps and files to come are such as can be meant, and whether it is held.

What cannot be meant is refused by :func:`refuse` before a file is touched, what may be is warned of by :func:`warn`;
both say the figures and the cure, and take no longer than a look at the mesh. Thresholds stand here, with what they
rest on; `docs/stability.md` has them in a table.
"""

from __future__ import annotations

import logging
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..errors import ParameterError, place_text
from ..fem import indicators
from ..fem.facets import boundary_facets
from ..fem.space import Space
from ..loads.rigid import free_motions, moves_as_a_whole, pieces
from ..loads.schedule import Loading
from ..material import MATERIALS, limiter_of
from ..material.constants import FROM_SHEAR
from ..material.regions import Region
from ..scene.scene import Scene

__all__ = ["Expected", "check_size", "refuse", "warn"]

log = logging.getLogger(__name__)

# --- the body against l: damage is spread over l, elements are to be l/3 ---
LEAST_BODY = 0.5, 3.0      # size of the body, in l, below which it is refused, and warned of: a crack is l wide
LARGEST_H = 100.0          # smallest element, in l, above which a mesh is refused: none of its cracks means anything
# --- the material ---
DENSITY = 1e-3, 10.0, 25e3, 1e6    # kg/m^3: foams have 10 and more, osmium 22,600; t/mm^3 and g/cm^3 give less
WAVES = 0.1, 6000.0, 2e4           # shear waves [m/s]: gels have 1, rubbers 20, steel 3200, diamond 12,000
STRENGTH = 1e-10, 1e-5, 1e3, 1e6   # Phi/mu: glass has 1e-6, stretched rubbers 60 to 240
OTHER = 0.2                        # change of the shear modulus by which a default limiter is another material's
COMPRESSIBLE = 2.0 / 3.0           # k/mu below which Poisson's ratio is negative
# --- the grips ---
PIECES = 100                # of a mesh, joined at single nodes; more are elements that nothing joins
# --- the loading ---
FAST = 0.01, 1.0           # speed of the grips, in c_s, past which inertia counts, and past which waves lag behind
# --- what is to come ---
STEPS = 1e7, 1e9           # of an event: the finest meshes of the scenes take 1e5
DAYS = 3.0                 # estimated computing time that is warned of [days]
FRAMES = 1e4, 1e6          # files in the folder of the series
ROWS = 1e6                 # of the history, which is held in memory
ROW_BYTES = 330.0
FRAME_BYTES = {2: 80.0, 3: 160.0}   # of an element, compressed
EXPLICIT_SECONDS, HHT_SECONDS = 3e-6, 5e-5  # of an element in a step, its share of the density solves with it


class Expected:
    """What the dynamic event of a scene may come to at the most, if it lasts for the whole of `event_time`.

    Attributes
    ----------
    dt: estimated step [s]; of the undeformed body, which is about that of the stretched one.
    steps, frames, rows: their numbers.   days: computing time.   bytes: of the frames and rows.
    """

    def __init__(self, scene: Scene) -> None:
        c, space = scene.controls, scene.sample.space
        if c.integrator == "explicit":
            self.dt = _explicit_step(scene)
        else:
            self.dt = c.hht.dt
        self.steps = c.event_time / self.dt
        seconds = EXPLICIT_SECONDS if c.integrator == "explicit" else HHT_SECONDS
        self.days = self.steps * space.n_elements * seconds / 86400.0
        self.frames, self.rows = c.event_time / c.frame_every, c.event_time / c.record_every
        self.bytes = self.frames * FRAME_BYTES[space.dim] * space.n_elements + self.rows * ROW_BYTES


def _explicit_step(scene: Scene) -> float:
    """About the stable step of the explicit scheme [s]: a dilatational wave across the narrowest element."""
    width, plane_stress = indicators.widths(scene.sample.space), scene.controls.element == "planestress"
    step = np.inf
    for part in scene.parts:
        m = part.material
        stiff = 4.0 * m.shear_modulus if plane_stress else m.bulk_modulus + 4.0 / 3.0 * m.shear_modulus
        step = min(step, float(width[part.elements].min()) / np.sqrt(stiff / m.rho0))
    waves = scene.sink_law.length_scale / (1e3 * max(part.material.shear_wave_speed for part in scene.parts))
    return min(0.75 * scene.controls.explicit.courant * step, 0.03 * waves)


def _where(scene: Scene, part: Region) -> str:
    """Of which material a message speaks, if there are several."""
    return "" if len(scene.parts) == 1 else f" of region {part.name}" if part.name else " outside of the regions"


def _dynamic(scene: Scene) -> bool:
    return scene.controls.analysis != "quasistatic"


def fastest(scene: Scene, loading: Loading) -> tuple[float, float]:
    """Greatest speed at which grips part, and at which tractions would move them; both in the slowest c_s.

    A traction is a speed by the strain rate it brings: the rate of the traction over 2 mu, times the size of the body.
    """
    space, held = scene.sample.space, ~loading.free.reshape(scene.sample.space.X.shape)
    slowest = 1e3 * min(part.material.shear_wave_speed for part in scene.parts)
    softest = min(part.material.shear_modulus for part in scene.parts)
    grips = pull = 0.0
    for t in (0.0, *loading.knots):
        if t >= scene.event_at:  # from there on nothing is static
            break
        v = loading.velocity(t)
        parts = [float(np.ptp(v[held[:, i], i])) for i in range(space.dim) if held[:, i].any()]
        grips = max(grips, float(np.linalg.norm(parts)))
        pull = max(pull, loading.pull(t))
    return grips / slowest, pull / (2 * softest) * float(np.ptp(space.X, axis=0).max()) / slowest


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
        _refuse_material(scene, part)
    loading = scene.loading()
    if _dynamic(scene):
        _refuse_events(scene, loading)
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


METRES = "multiply those of a mesh in m by 1000 (skfsink mesh IN OUT --from m)"


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


def _refuse_material(scene: Scene, part: Region) -> None:
    material, where, phi = part.material, _where(scene, part), part.sink_law.phi
    ratio = phi / material.shear_modulus
    if not STRENGTH[0] <= ratio <= STRENGTH[3]:
        raise ParameterError(f"the energy limiter phi = {phi:.3g} MPa{where} is {ratio:.2g} of the shear modulus "
                             f"{material.shear_modulus:.3g} MPa (allowed {STRENGTH[0]:g} to {STRENGTH[3]:g}): both are "
                             f"in MPa; a number in Pa is to be divided by 1e6")
    if not _dynamic(scene):
        return
    if not DENSITY[0] <= material.density <= DENSITY[3]:
        raise ParameterError(f"density {material.density:.4g} kg/m^3{where} is that of no solid (allowed "
                             f"{DENSITY[0]:g} to {DENSITY[3]:g}): {_density_cure(material.density)}")
    if material.shear_wave_speed > WAVES[2]:
        raise ParameterError(f"shear waves{where} would run at {material.shear_wave_speed:.3g} m/s (at most "
                             f"{WAVES[2]:g}): the shear modulus {material.shear_modulus:.3g} MPa or the density "
                             f"{material.density:.4g} kg/m^3 is in another unit; a modulus in Pa is to be divided by "
                             f"1e6")


def _density_cure(density: float) -> str:
    """How the density may have been meant."""
    for unit, factor in (("t/mm^3", 1e12), ("kg/mm^3", 1e9), ("g/cm^3", 1e3)):
        if 100.0 <= density * factor < DENSITY[2]:
            return f"if it is in {unit}, give {density * factor:.4g} kg/m^3"
    return "give it in kg/m^3, where water has 1000"


def _refuse_events(scene: Scene, loading: Loading) -> None:
    c, expected = scene.controls, Expected(scene)
    speed, pull = fastest(scene, loading)
    if c.start != "rest" and max(speed, pull) > FAST[1]:
        raise ParameterError(f"{_loads(scene, speed, pull)}, faster than waves (c_s = {_slowest(scene):.3g} m/s), and "
                             f"the loading to the onset is static: lower the rate, or take start = 'rest'")
    if expected.steps > STEPS[1]:
        raise ParameterError(f"an event_time of {c.event_time:.3g} s may take {expected.steps:.2g} steps of about "
                             f"{expected.dt:.2g} s (at most {STEPS[1]:g}): lower it to a few times the time in which "
                             f"the crack crosses the body, or raise the step, as by a coarser mesh")
    if expected.frames > FRAMES[1]:
        raise ParameterError(f"a frame every {c.frame_every:.3g} s may make {expected.frames:.2g} frames in an "
                             f"event_time of {c.event_time:.3g} s (at most {FRAMES[1]:g}): raise frame_every, or "
                             f"lower event_time")


def _slowest(scene: Scene) -> float:
    return min(part.material.shear_wave_speed for part in scene.parts)


def _loads(scene: Scene, speed: float, pull: float) -> str:
    """What is fast, and how fast."""
    if speed >= pull:
        return f"grips part at {speed * _slowest(scene):.3g} m/s"
    what = "tractions" if scene.tractions else "pressures"
    return f"{what} strain the body as grips that part at {pull * _slowest(scene):.3g} m/s"


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
        _warn_of_material(scene, part)
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
    if _dynamic(scene):
        _warn_of_events(scene, loading, folder)
    elif _is_viscous(scene):
        log.warning("viscosity has no effect in a quasi-static analysis, which has no velocities: take "
                    "analysis = 'dynamic', or leave it out")


def _is_viscous(scene: Scene) -> bool:
    c = scene.controls
    return bool(c.bulk_viscosity_linear or c.bulk_viscosity_quadratic
                or any(part.material.viscosity for part in scene.parts))


def _warn_of_material(scene: Scene, part: Region) -> None:
    material, where, phi = part.material, _where(scene, part), part.sink_law.phi
    ratio, stiff = phi / material.shear_modulus, material.bulk_modulus / material.shear_modulus
    if not STRENGTH[1] <= ratio <= STRENGTH[2]:
        log.warning("the energy limiter phi = %.3g MPa is %.2g of the shear modulus %.3g MPa (outside of %g to %g)%s: "
                    "it fails at strains of about %.2g; check the units of both (MPa)", phi, ratio,
                    material.shear_modulus, *STRENGTH[1:3], where, np.sqrt(2 * ratio))
    law = next((name for name in FROM_SHEAR if type(material) is MATERIALS[name]), "")  # of isotropic laws
    given = any(table["name"] == part.name and "phi" in table for table in scene.parameters.get("regions", ()))
    if law and phi == limiter_of(law).phi and not given:
        usual = MATERIALS[law]().shear_modulus
        if abs(material.shear_modulus / usual - 1) > OTHER:
            log.warning("phi = %.4g MPa belongs to %s with its default constants, of shear modulus %.3g MPa, and here "
                        "that is %.3g MPa%s: give the phi of this material, or its strength is that of the other one",
                        phi, law, usual, material.shear_modulus, where)
    if stiff < COMPRESSIBLE:
        log.warning("k/mu = %.3g is so small (below %.2g)%s that Poisson's ratio is negative; check the units of "
                    "bulk_modulus (MPa) and of the constants", stiff, COMPRESSIBLE, where)
    if not _dynamic(scene):
        return
    if not DENSITY[1] <= material.density <= DENSITY[2]:
        log.warning("density %.4g kg/m^3 is unusual for a solid (outside of %g to %g)%s: %s", material.density,
                    *DENSITY[1:3], where, _density_cure(material.density))
    if not WAVES[0] <= material.shear_wave_speed <= WAVES[1]:
        log.warning("shear waves run at %.3g m/s (outside of %g to %g)%s: check the units of the density (kg/m^3) and "
                    "of the constants (MPa)", material.shear_wave_speed, *WAVES[:2], where)


def _warn_of_events(scene: Scene, loading: Loading, folder: Path) -> None:
    c, expected = scene.controls, Expected(scene)
    speed, pull = fastest(scene, loading)
    if c.start != "rest" and max(speed, pull) > FAST[0]:
        log.warning("%s, %.2g of c_s = %.3g m/s (above %g): the loading to the onset is static and leaves inertia "
                    "out; take start = 'rest', or lower the rate", _loads(scene, speed, pull), max(speed, pull),
                    _slowest(scene), FAST[0])
    if expected.steps > STEPS[0] or expected.days > DAYS:
        log.warning("the event may take %.2g steps of about %.2g s, %.2g days of computing, if it lasts for the whole "
                    "event_time of %.3g s: lower event_time", expected.steps, expected.dt, expected.days,
                    c.event_time)
    there = float(shutil.disk_usage(next(p for p in _above(folder) if p.exists())).free)
    if expected.frames > FRAMES[0] or expected.rows > ROWS or expected.bytes > there:
        log.warning("the event may leave %.2g frames and %.2g rows of the history, about %.2g GB (there are %.2g GB), "
                    "if it lasts for the whole event_time of %.3g s: lower event_time, or raise frame_every and "
                    "record_every", expected.frames, expected.rows, expected.bytes / 1e9, there / 1e9, c.event_time)


def _above(folder: Path) -> Iterator[Path]:
    yield folder.absolute()
    yield from folder.absolute().parents
