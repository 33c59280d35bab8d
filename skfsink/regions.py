"""Regions: parts of a body that are of another material, or of another strength, than the rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .material import Material, SinkLaw

__all__ = ["Region"]


@dataclass(frozen=True, eq=False)
class Region:
    """Elements of a material of their own.

    Attributes
    ----------
    name: of the set of elements.
    elements: their numbers, ascending.
    material, sink_law: theirs; the length l is that of the whole body.
    """

    name: str
    elements: np.ndarray
    material: Material
    sink_law: SinkLaw
