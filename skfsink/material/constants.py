"""The constants of a law as text with units, "mu = 0.27 MPa, limit = 76.5", and the law with them."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from ..errors import ParameterError
from ..units import in_unit
from .base import Material
from .library import MATERIALS, material_from

__all__ = ["constant_unit", "constants_text", "material_of", "read_constants"]

COMMON = tuple(field.name for field in fields(Material))  # bulk_modulus and density have parameters of their own
_MPA, _PURE = ("mu", "c", "c1", "c2", "c3", "k1"), ("limit", "segments", "k2", "kappa")


def constant_unit(name: str) -> str:
    """Unit in which a constant of that name is a plain number; "" for a pure one."""
    return "MPa" if name in _MPA else "degree" if name == "angle" else ""


def read_constants(law: str, text: str) -> dict[str, Any]:
    """Constants of a law from text: name = value pairs between commas; the numbers of a vector have blanks between.

    Raises
    ------
    ParameterError
        The law has no such constant, it is there twice, or its value is no quantity in its unit.
    """
    known = [field.name for field in fields(MATERIALS[law]) if field.name not in COMMON]
    found: dict[str, Any] = {}
    for part in filter(str.strip, text.split(",")):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or name not in known:
            raise ParameterError(f"constants must be name = value pairs between commas, of {', '.join(known)} for "
                                 f"{law}; got {part.strip()!r}")
        if name in found:
            raise ParameterError(f"constants: {name} is there twice")
        if isinstance(getattr(MATERIALS[law], name), tuple):
            found[name] = tuple(in_unit(name, number, "") for number in value.split())
        else:
            found[name] = in_unit(name, value, constant_unit(name), plain=True)
    return found


def constants_text(material: Material) -> str:
    """Text that :func:`read_constants` reads: all constants of the law."""
    values = ((f.name, getattr(material, f.name)) for f in fields(material) if f.name not in COMMON)
    return ", ".join(f"{name} = " + (" ".join(f"{x!r}" for x in value) if isinstance(value, tuple) else
                                     f"{value!r} {constant_unit(name)}".strip()) for name, value in values)


def material_of(law: str, constants: str, bulk_modulus: float, density: float) -> Material:
    """The material of a law's name, its constants as text, k [MPa] and rho0 [kg/m^3].

    Raises
    ------
    ParameterError
        There is no such law or constant, or a value is outside its range.
    """
    if law not in MATERIALS:
        raise ParameterError(f"material must be one of {', '.join(MATERIALS)}; got {law!r}")
    return material_from(law, {**read_constants(law, constants), "bulk_modulus": bulk_modulus, "density": density})
