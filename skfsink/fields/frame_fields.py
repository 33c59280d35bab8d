"""Fields of elements that a run is asked to draw, and those of them that its frames have on request only."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from ..errors import ParameterError
from .momentum import Momentum
from .quantities import principal_stretches
from .stress import principal_stresses

__all__ = ["DRAWN", "ON_REQUEST", "asked_fields"]

#: Names of what `fields` may have: all are means of the elements, and in every frame but for those of `ON_REQUEST`.
DRAWN = ("von_mises", "principal_stress", "pressure", "stretch", "W")


def _greatest_stretch(momentum: Momentum, u: np.ndarray, stress: np.ndarray) -> np.ndarray:
    return principal_stretches(momentum, u, np.arange(momentum.space.n_elements))[:, 0]


def _greatest_stress(momentum: Momentum, u: np.ndarray, stress: np.ndarray) -> np.ndarray:
    return principal_stresses(stress)[:, -1]


#: Values (ne,) at a displacement (n, dim) with the stress (ne, 6): the greatest principal Cauchy stress [MPa], and the
#: greatest principal stretch; NaN where an element is inside out.
ON_REQUEST: Mapping[str, Callable[[Momentum, np.ndarray, np.ndarray], np.ndarray]] = {
    "principal_stress": _greatest_stress, "stretch": _greatest_stretch}


def asked_fields(text: str) -> tuple[str, ...]:
    """The names in a text, with commas.

    Raises
    ------
    ParameterError
        One is none of `DRAWN`, or is there twice.
    """
    names = tuple(name.strip() for name in text.split(",")) if text.strip() else ()
    for name in names:
        if name not in DRAWN:
            raise ParameterError(f"fields must be of {', '.join(DRAWN)}, with commas; got {name!r}")
        if names.count(name) > 1:
            raise ParameterError(f"fields has {name} twice; got {text!r}")
    return names
