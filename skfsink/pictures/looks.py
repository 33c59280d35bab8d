"""How a field looks: its name with unit, its colours, and their range, which all but the extreme values keep to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, Normalize

from ..errors import choose
from ..fem.space import Space
from ..fields.crack import CRACKED
from ..fields.frame_fields import DRAWN
from ..results.frame import Frame
from . import body as deformed
from .plot import GAMMA_SCALE, SPEED_MAP

__all__ = ["FIELDS", "Scale", "cells_of", "nodal", "scale_of"]

MOST = 0.99  # of the volume that holds has values within the colours, in each frame
_BOTH = matplotlib.colormaps["RdBu_r"]

#: What can be drawn, with its unit, by name.
FIELDS = {"gamma": r"relative density $\gamma$", "speed": "speed of the material (m/s)",
          "von_mises": "von Mises stress (MPa)", "principal_stress": "greatest principal stress (MPa)",
          "pressure": "pressure (MPa)", "stretch": "greatest principal stretch",
          "W": "stored energy density $W$ (MPa)"}


class Scale(NamedTuple):
    """Colours of a field.

    Attributes
    ----------
    colours: what gives them.   label: of the bar.   extend: ends of the bar beyond which there are values.
    """

    colours: ScalarMappable
    label: str
    extend: str

    @property
    def limits(self) -> tuple[float, float]:
        """The values of the first and the last colour."""
        low, high = self.colours.get_clim()
        return float(low), float(high)

    @property
    def map(self) -> Colormap:
        """Its colours."""
        return self.colours.get_cmap()


def cells_of(field: str) -> tuple[str, ...]:
    """Fields of the elements that a frame needs for it.

    Raises
    ------
    ParameterError
        There is no such field.
    """
    return (field,) if choose("field", field, FIELDS) in DRAWN else ()


def nodal(space: Space, frame: Frame, field: str) -> np.ndarray:
    """Values at the nodes, (n,): those of elements are averaged by their volume, failed and crushed ones left out."""
    if field == "gamma":
        return frame.gamma
    if field == "speed":
        return deformed.speed(frame)
    values = frame.cells[field]
    known = np.isfinite(values) & ~frame.deleted
    weight = np.repeat(np.where(known, space.extent, 0.0), space.conn.shape[1])
    nodes, n = space.conn.ravel(), space.n_nodes
    there = np.bincount(nodes, weight, n)
    total = np.bincount(nodes, weight * np.repeat(np.where(known, values, 0.0), space.conn.shape[1]), n)
    return np.asarray(np.divide(total, there, out=np.zeros(n), where=there > 0))


def scale_of(space: Space, frames: Sequence[Frame], values: Sequence[np.ndarray], field: str) -> Scale:
    """Colours for the values (n,) of a field in the frames."""
    label = FIELDS[field]
    if field == "gamma":
        return Scale(GAMMA_SCALE, label, "neither")
    if field == "speed":
        return Scale(ScalarMappable(Normalize(0, deformed.fastest(frames)), SPEED_MAP), label, "max")
    volume = np.bincount(space.conn.ravel(), np.repeat(space.extent, space.conn.shape[1]), space.n_nodes)
    ends = [_within(value[holds], volume[holds]) for frame, value in zip(frames, values)
            if (holds := frame.gamma >= CRACKED).any()] or [(0.0, 0.0)]
    low, high = min(end for end, _ in ends), max(end for _, end in ends)
    if field in ("pressure", "principal_stress") and low < -0.05 * abs(high):  # pushed here, pulled there
        most = deformed.round_up(max(-low, high))
        return Scale(ScalarMappable(Normalize(-most, most), _BOTH), label, "both")
    base = 1.0 if field == "stretch" else 0.0
    return Scale(ScalarMappable(Normalize(base, base + deformed.round_up(high - base)), SPEED_MAP), label, "max")


def _within(values: np.ndarray, volume: np.ndarray) -> tuple[float, float]:
    """Values (m,) between which all but a share of the volume (m,) lies at either end."""
    order = np.argsort(values)
    share = np.cumsum(volume[order]) / volume.sum()
    low, high = np.searchsorted(share, [1.0 - MOST, MOST])
    return float(values[order[low]]), float(values[order[min(high, order.size - 1)]])
