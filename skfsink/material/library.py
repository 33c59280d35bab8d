"""The materials by name, and the energy limiters that belong to their default constants."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from ..errors import ParameterError, choose
from .base import Material
from .fibres import HolzapfelGasserOgden
from .general import MooneyRivlin
from .isotropic import AAA, ArrudaBoyce, Gent, NeoHookean, Yeoh
from .ogden import Ogden
from .sink import SinkLaw

__all__ = ["LIMITERS", "MATERIALS", "Limiter", "limiter_of", "material_from"]

MATERIALS: dict[str, type[Material]] = {
    "aaa": AAA, "neo-hookean": NeoHookean, "yeoh": Yeoh, "mooney-rivlin": MooneyRivlin, "gent": Gent,
    "arruda-boyce": ArrudaBoyce, "ogden": Ogden, "hgo": HolzapfelGasserOgden}


@dataclass(frozen=True)
class Limiter:
    """Energy limiter Phi [MPa] and sharpness m for a material's default constants, and where they come from."""

    phi: float
    m: float
    source: str


_TRELOAR = "assumed: strength in uniaxial tension at a stretch of 7.6, where Treloar's curve ends"
LIMITERS: dict[str, Limiter] = {
    "aaa": Limiter(SinkLaw.phi, SinkLaw.m, "the paper, Sec. 4"),
    "neo-hookean": Limiter(SinkLaw.phi, SinkLaw.m, "that of aaa"),
    "yeoh": Limiter(82.0, 10.0, "attributed to Volokh, Mech. Res. Commun. 37 (2010) 684-689, unverified"),
    "mooney-rivlin": Limiter(11.36, 10.0, _TRELOAR),
    "gent": Limiter(15.62, 10.0, _TRELOAR),
    "arruda-boyce": Limiter(13.74, 10.0, _TRELOAR),
    "ogden": Limiter(14.42, 10.0, _TRELOAR),
    "hgo": Limiter(0.027, 10.0, "assumed: strength along the axis of 1.03 MPa, attributed to iliac adventitia in "
                   "Holzapfel, Sommer and Regitnig, J. Biomech. Eng. 126 (2004) 657-665, unverified"),
}


def limiter_of(name: str) -> Limiter:
    """The limiter that belongs to the default constants of the material called `name`.

    Raises
    ------
    ParameterError
        It has none.
    """
    if name not in LIMITERS:
        raise ParameterError(f"material {name} has no energy limiter of its own: give phi [MPa], or enter one in "
                             f"skfsink.material.LIMITERS")
    return LIMITERS[name]


def material_from(name: str, constants: Mapping[str, Any] | None = None) -> Material:
    """The material called `name` with `constants` instead of its default ones.

    Raises
    ------
    ParameterError
        The name or a constant is unknown (the message lists those there are), or a value is outside its range.
    """
    choose("material", name, MATERIALS)
    kind, values = MATERIALS[name], dict(constants or {})
    allowed = [field.name for field in fields(kind)]
    for constant in values:
        if constant not in allowed:
            raise ParameterError(f"{name} has no constant {constant!r}; its constants are {', '.join(allowed)}")
    return kind(**values)
