"""How well a mesh resolves the notch at which a body begins to fail, and how late that makes the onset.

The sink sees the energy at Gauss points, the first of which lie below the surface, where there is less of it: the
thicker the elements at the tip, the later the onset. How much was measured at notches: `docs/notches.md`. A surface
that turns inwards is none where energy does not fall off below it, as through the wall of a sac.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...errors import place_text
from ...fem.indicators import Corner, below, corner_near
from ...fem.space import Space
from ...meshing.cracks import InitialCrack
from ...meshing.edge import ALONG
from .range import SHARP

__all__ = ["LATE", "SLOPE", "check_tip", "late", "thickness_for"]

log = logging.getLogger(__name__)

SLOPE = 0.61  # delay of the onset, of the opening, over the thickness of the elements, of the radius of the tip
LATE = 0.03   # of the opening, past which an onset is warned of
LOCAL = 0.4   # of the greatest W/Phi, to which it falls below a notch within half of the radius, or REACH elements
REACH = 3.0   # thicknesses


def late(share: float) -> float:
    """By how much of the opening an onset is late, for elements of a thickness, as a share of the radius of the tip."""
    return SLOPE * share


def thickness_for(delay: float) -> float:
    """Thickness of elements, as a share of the radius of the tip, with which an onset is late by `delay`."""
    return delay / SLOPE


def is_local(space: Space, corner: Corner, loaded: np.ndarray) -> bool:
    """Whether W/Phi, `loaded` (ne,), is concentrated at a corner, so that it falls off below it over its radius.

    Through the wall of a sac, or of a thin tube, it does not: its inner surface is no notch.
    """
    depth = max(0.5 * corner.radius, REACH * corner.thickness)
    return bool(loaded[below(space, corner, depth)].min(initial=np.inf) < LOCAL * loaded.max())


def _touches(space: Space, crack: InitialCrack, place: np.ndarray) -> bool:
    """Whether a place is at the elements of a crack, by half of an element."""
    beside = np.linalg.norm(space.X[space.conn[crack.elements]] - place, axis=2).min(axis=1)
    return bool((beside <= 0.5 * space.h[crack.elements]).any())


def check_tip(space: Space, element: int, loaded: np.ndarray, planes: Sequence[np.ndarray] = (),
              cracks: Sequence[InitialCrack] = ()) -> dict[str, Any]:
    """Warn where the onset, in an element, is that of a mesh that does not resolve the notch there.

    Parameters
    ----------
    space, element: the mesh, and where it begins to fail.
    loaded: greatest W/Phi of each element, (ne,).
    planes: nodes of each plane of symmetry: what ends there is looked at with its image.
    cracks: that the body has from the start: their elements are none of it, so that their ends are notches.

    Returns
    -------
    Of the notch `radius_mm`, `elements_per_radius`, `thickness_mm` of its elements, `late`, the share of the opening by
    which the onset is expected to be late, and `place_mm`; radius and late are None at a sharp corner. Empty where the
    surface does not turn inwards, or the load is not local there.
    """
    gone = np.concatenate([crack.elements for crack in cracks]) if cracks else None
    corner = corner_near(space, element, planes, gone)
    if corner is None:
        return {}
    radius, sharp = corner.radius, corner.angle > SHARP
    if not sharp and not is_local(space, corner, loaded):
        return {}
    delay = late(corner.thickness / radius)
    figures = {"radius_mm": None if sharp else radius, "elements_per_radius": math.degrees(1.0) / corner.angle,
               "thickness_mm": corner.thickness, "late": None if sharp else delay, "place_mm": corner.place.tolist()}
    at = next((crack.name for crack in cracks if _touches(space, crack, corner.place)), "")
    if sharp and at:
        log.warning("the body begins to fail at the crack %s, at %s mm, whose end is as sharp as the elements there "
                    "are small (h = %.3g mm): the onset depends on their size, and falls about as its root; compare "
                    "bodies with equal elements there, or mesh a notch with a round tip", at, place_text(corner.place),
                    corner.thickness)
    elif sharp:
        log.warning("the body begins to fail at a sharp corner, which turns by %.0f degrees (above %g), at %s mm: the "
                    "onset depends on the size of the elements there; round it", corner.angle, SHARP,
                    place_text(corner.place))
    elif delay > LATE:
        log.warning("the body begins to fail at a notch of radius %.2g mm, with %.2g elements in a radius, at %s mm: "
                    "the onset may be late by %.0f %% of the opening (above %g); make elements there %.2g mm large, or "
                    "lay rings of %.2g mm around the tip (h_tip of a sample, h of an Edge)", radius,
                    figures["elements_per_radius"], place_text(corner.place), 100 * delay, 100 * LATE,
                    thickness_for(LATE) * radius, radius / ALONG)
    return figures
