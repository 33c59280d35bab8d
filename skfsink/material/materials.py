"""The materials as `skfsink.materials` has them: `materials.gent(mu="0.3 MPa")`, with `_` for `-` in the names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from functools import partial
from typing import Any

from ..errors import ParameterError, choose
from ..units import number_in
from .base import Material
from .constants import material_of, own_names
from .library import LIMITERS, MATERIALS, limiter_of
from .sink import SinkLaw

__all__ = ["Materials", "materials"]

UNITS = {"bulk_modulus": "MPa", "density": "kg/m^3", "viscosity": "MPa s"}  # of what all laws have


class Materials:
    """The laws of :data:`.MATERIALS`, each as a function of its constants, and their energy limiters.

    `materials.neo_hookean(E="1 MPa", nu=0.499)` is that law with these constants, `materials.aaa()` one with its
    default ones. Text has a unit; plain numbers are in MPa, density in kg/m^3.
    """

    def __getattr__(self, name: str) -> Callable[..., Material]:
        law = name.replace("_", "-")
        if law not in MATERIALS:
            raise AttributeError(f"materials has no {name}; it has {', '.join(dir(self))}")
        return partial(_material, law)

    def __dir__(self) -> list[str]:
        return [*(name.replace("-", "_") for name in MATERIALS), "limiter"]

    @staticmethod
    def limiter(name: str, length_scale: float = SinkLaw.length_scale) -> SinkLaw:
        """The sink with the energy limiter that belongs to the default constants of a law, and a length l [mm].

        Raises
        ------
        ParameterError
            There is no such law, or it has no limiter of its own.
        """
        law = choose("material", name.replace("_", "-"), MATERIALS)
        limiter = limiter_of(law)
        return SinkLaw(limiter.phi, limiter.m, length_scale)

    def __repr__(self) -> str:
        lines = ["materials, with the defaults of their constants, and limiters in MPa:"]
        for law, kind in MATERIALS.items():
            defaults = {field.name: field.default for field in fields(kind)}
            own = ", ".join(f"{constant}={defaults[constant]!r}" for constant in own_names(law))
            limiter = f"; phi {LIMITERS[law].phi:g}" if law in LIMITERS else ""
            lines.append(f"  {law.replace('-', '_')}({own}){limiter}")
        return "\n".join(lines)


def _material(law: str, **constants: Any) -> Material:
    """The material of a law with its `constants`: numbers, or text with units; also bulk_modulus, density, viscosity.

    Raises
    ------
    ParameterError
        A constant is unknown, or is outside its range.
    """
    shared = {field.name: field.default for field in fields(Material)}
    text = ", ".join(f"{name} = {_text(value)}" for name, value in constants.items() if name not in shared)
    given = {name: number_in(name, constants[name], unit) for name, unit in UNITS.items() if name in constants}
    if "nu" in constants and "bulk_modulus" in given:
        raise ParameterError(f"{law}: bulk_modulus and nu say the same: give one of them")
    return material_of(law, text, **{**shared, **given})


def _text(value: Any) -> str:
    """A constant as its text in a deck: the numbers of a vector have blanks between."""
    if isinstance(value, str):
        return value
    if isinstance(value, list | tuple):
        return " ".join(map(_text, value))
    return repr(float(number_in("constants", value, "")))


materials = Materials()
