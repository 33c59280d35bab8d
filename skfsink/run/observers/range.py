"""The range of the methods: a material, an element or a mesh beyond it is warned of before the run, and at the onset.

Thresholds stand here; what they are based on is in `docs/stability.md`.
"""

from __future__ import annotations

import logging

import numpy as np

from ...errors import place_text
from ...fem import indicators
from ...fem.elements import ELEMENTS
from ...fem.space import Space
from ...fields.state import State
from ...material.regions import Region
from ...scene.scene import Scene
from .places import symmetry_planes

__all__ = ["COARSE", "SHARP", "check_onset", "check_pressure", "check_scene", "check_volume"]

log = logging.getLogger(__name__)

LOCKS = 50.0           # k/mu past which the plain element is warned of
STIFF = 2e4            # k/mu past which rounding comes near the equilibria
COARSE = 1.2           # l/h below which the mesh decides where and when it cracks
NARROW = 0.1           # width of an element, of the median one, below which it governs the explicit step
SHARP = 60.0           # degrees by which a notch may turn at one node
CHECKERED = 0.1        # amplitude of an alternating pressure, of mu
FIRM = 3e3             # k/Phi with which a body that fails has changed its volume by less than half a per cent
SWELLING = 0.01        # mean change of volume, of a body that is to be nearly incompressible


def check_scene(scene: Scene) -> None:
    """Warn of a material, an element or a mesh beyond the range of the methods."""
    space, l = scene.sample.space, scene.sink_law.length_scale
    # the part that is least compressible for its shear modulus is the first to lock, and the first to lose digits
    part = max(scene.parts, key=lambda part: part.material.bulk_modulus / part.material.shear_modulus)
    ratio = part.material.bulk_modulus / part.material.shear_modulus
    if scene.controls.element == "plain" and ratio > LOCKS:
        log.warning("the plain element locks at k/mu = %.4g (above %g)%s: stiffness, onset load and U come out too "
                    "high; take element = 'jbar'", ratio, LOCKS, _where(scene, part))
    if ratio > STIFF and scene.controls.element != "planestress":
        enough = max(1e3 * part.material.shear_modulus, FIRM * part.sink_law.phi)
        cure = (f"with bulk_modulus {enough:.3g} the solid is as good as incompressible"
                if enough < 0.5 * part.material.bulk_modulus else
                "its strength phi asks for a bulk_modulus as large: look at the balance error, or take 'hht'")
        log.warning("k/mu = %.3g%s is so large (above %g) that rounding comes near the tolerance of equilibria, "
                    "and the explicit step falls with its root; %s", ratio, _where(scene, part), STIFF, cure)
    h = float(space.h.min())
    if h > l / COARSE:
        log.warning("no element is finer than h = %.3g mm, l/h = %.2f (less than %g): onset and U are those of the "
                    "mesh; refine it to h <= l/3, or raise length_scale", h, l / h, COARSE)
    angle, place = indicators.turning(space, [plane.nodes for _, plane in symmetry_planes(scene)])
    if angle > SHARP:
        log.warning("a notch turns by %.0f degrees at one node, at %s mm (above %g): its sharpness is that "
                    "of the mesh, on which onset and U depend; round it with at least 4 elements", angle,
                    place_text(place), SHARP)
    c = scene.controls
    if c.dynamic and c.integrator == "explicit":
        _check_widths(space, max(c.explicit.raised_mass, c.explicit.subcycled))


def _check_widths(space: Space, raised: float) -> None:
    """Elements that cut the explicit step for all others, unless they fill less than the share that gets more mass or
    short steps of its own."""
    widths = indicators.widths(space)
    typical, e = float(np.median(widths)), int(np.argmin(widths))
    share = float(space.V[widths < NARROW * typical].sum() / space.V.sum())
    if share > raised:
        log.warning("an element near %s mm is %.2g mm narrow, most are %.2g mm (a share less than %g): it makes "
                    "the explicit step that much shorter for all; mend the mesh there, raise the mass of such elements "
                    "(they fill %.1g of the volume: raised_mass %.2g), or take integrator = 'hht'",
                    place_text(space.X[space.conn[e]].mean(axis=0)), widths[e], typical, NARROW, share, 1.1 * share)


def check_onset(scene: Scene, state: State) -> None:
    """Warn of a mesh that decides on the onset, and of pressures that alternate."""
    space, l = scene.sample.space, scene.sink_law.length_scale
    weakest = int(np.argmin(state.gamma))
    h = indicators.size_near(space, weakest, l)
    if h > l / COARSE:
        log.warning("where it begins to fail, at %s mm, elements have h = %.3g mm, l/h = %.2f (less than %g): "
                    "onset and U are those of the mesh; refine it there to h <= l/3, or raise length_scale",
                    place_text(space.X[weakest]), h, l / h, COARSE)
    check_pressure(scene, state)
    check_volume(scene, state)


def check_volume(scene: Scene, state: State) -> None:
    """A nearly incompressible body (k/mu above :data:`LOCKS`) whose stresses have grown beside its bulk modulus."""
    if scene.controls.element == "planestress":
        return
    space = scene.sample.space
    for part in scene.parts:
        k, there = part.material.bulk_modulus, part.elements[~state.deleted[part.elements]]
        if not there.size or k < LOCKS * part.material.shear_modulus:
            continue
        change = np.abs(indicators.element_pressure(space, state.u, 1.0)[there])
        mean = float(change @ space.V[there] / space.V[there].sum())
        if mean > SWELLING:
            log.warning("the volume has changed by %.2g %% on average (above %g)%s, though k/mu = %.3g: stresses are "
                        "no longer small beside bulk_modulus = %g MPa, and the body is as compressible as that; for a "
                        "nearly incompressible one raise it to %.2g MPa", 100 * mean, 100 * SWELLING,
                        _where(scene, part), k / part.material.shear_modulus, k, k * mean / (0.2 * SWELLING))


def check_pressure(scene: Scene, state: State) -> None:
    """Pressures that alternate, in each material for itself, since they jump between two; not of failed elements."""
    if not ELEMENTS[scene.controls.element].j_bar:
        return
    space = scene.sample.space
    for part in scene.parts:
        k, there = part.material.bulk_modulus, part.elements[~state.deleted[part.elements]]
        if not there.size:
            continue
        amplitude = indicators.alternation(space, indicators.element_pressure(space, state.u, k), there)
        if amplitude > CHECKERED * part.material.shear_modulus:
            log.warning("pressures of neighbouring elements alternate by %.3g MPa (above %g mu)%s: a checkerboard, "
                        "with %.2g of the energy limiter; break up the rows of the mesh, or lower bulk_modulus",
                        amplitude, CHECKERED, _where(scene, part), amplitude**2 / (2 * k) / part.sink_law.phi)


def _where(scene: Scene, part: Region) -> str:
    """Of which material a warning speaks, if there are several."""
    if len(scene.parts) == 1:
        return ""
    return f" in region {part.name}" if part.name else " outside of the regions"
