"""The constants of a law as text with units, "mu = 0.27 MPa, limit = 76.5", and the law with them.

In place of a law's own stiffness there may be Young's modulus `E` or the shear modulus `G` of the undeformed material,
and Poisson's ratio `nu` in place of the bulk modulus: k = 2 G (1 + nu)/(3 (1 - 2 nu)), G = E/(2 (1 + nu)).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from ..errors import ParameterError, choose, require
from ..units import in_unit
from .base import Material
from .library import MATERIALS, material_from

__all__ = ["MODULI", "constant_names", "constant_unit", "constants_text", "material_of", "own_constants", "own_names",
           "read_constants", "with_constant"]

COMMON = tuple(field.name for field in fields(Material))  # these have parameters of their own
_MPA, _PURE = ("mu", "c", "c1", "c2", "c3", "k1", "E", "G"), ("limit", "segments", "k2", "kappa", "nu")
MODULI = ("E", "G", "nu")
#: the constant that the shear modulus of the undeformed material determines, and how; the rest are the other constants
FROM_SHEAR = {
    "aaa": ("c1", lambda G, rest: G / 2), "neo-hookean": ("mu", lambda G, rest: G),
    "yeoh": ("c1", lambda G, rest: G / 2), "mooney-rivlin": ("c1", lambda G, rest: G / 2 - rest["c2"]),
    "gent": ("mu", lambda G, rest: G),
    "arruda-boyce": ("mu", lambda G, rest: G * (rest["segments"] - 1) / (rest["segments"] - 1 / 3)),
    "ogden": ("mu", lambda G, rest: rest["mu"])}  # which it does not determine


def constant_unit(name: str) -> str:
    """Unit in which a constant of that name is a plain number; "" for a pure one."""
    return "MPa" if name in _MPA else "degree" if name == "angle" else ""


def read_constants(law: str, text: str) -> dict[str, Any]:
    """Constants of a law from text: name = value pairs between commas; a vector is 1 0 0, or a list [1, 0, 0].

    The numbers of a vector have a unit each, or there is one at the end for all of them. E or G become the constant of
    the law that they determine, and nu becomes `bulk_modulus`.

    Raises
    ------
    ParameterError
        The law has no such constant, it is there twice, its value is no quantity in its unit, or E, G and nu do not
        determine the law.
    """
    found = _pairs(law, text)
    return _from_moduli(law, found) if set(MODULI) & found.keys() else found


def constant_names(law: str, text: str) -> set[str]:
    """The names in a text of constants; raises as :func:`read_constants`."""
    return set(_pairs(law, text))


def own_names(law: str) -> list[str]:
    """Names of the constants of a law, without those that all laws have."""
    return [field.name for field in fields(MATERIALS[law]) if field.name not in COMMON]


def with_constant(text: str, name: str, value: float) -> str:
    """A text of constants in which one has another value, in its unit."""
    others = [part.strip() for part in _parts(text) if part.partition("=")[0].strip() != name]
    return ", ".join([*others, f"{name} = {value!r} {constant_unit(name)}".strip()])


def _parts(text: str) -> list[str]:
    """What stands between the commas of a text that are not within a list."""
    return [*filter(str.strip, re.split(r",(?![^\[]*\])", text))]


def _pairs(law: str, text: str) -> dict[str, Any]:
    constants = own_names(law)
    known = [*constants, *MODULI]
    found: dict[str, Any] = {}
    for part in _parts(text):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        name = "nu" if name == "ν" else name
        if not equals or name not in known:
            comma = "; decimals stand after a point" if found and part.strip()[:1].isdigit() else ""
            raise ParameterError(f"constants must be name = value pairs between commas, of {', '.join(constants)} for "
                                 f"{law}, or E, G and nu; got {part.strip()!r}{comma}")
        if name in found:
            raise ParameterError(f"constants: {name} is there twice")
        if isinstance(getattr(MATERIALS[law], name, None), tuple):
            found[name] = _vector(name, value)
        else:
            found[name] = in_unit(name, value, constant_unit(name), plain=True)
    return found


def _vector(name: str, text: str) -> tuple[float, ...]:
    """The numbers of a vector: between the commas of a list, or between blanks."""
    unit = constant_unit(name)
    if text.startswith("[") and text.endswith("]"):
        return tuple(in_unit(name, part.strip(), unit, plain=True) for part in text[1:-1].split(","))
    parts: list[str] = []
    for piece in text.split():
        if parts and not re.match(r"[-+.\d]", piece):
            parts[-1] += f" {piece}"  # a unit
        else:
            parts.append(piece)
    own = [" " in part for part in parts]
    if any(own) and not all(own):
        if own.index(True) != len(parts) - 1:
            raise ParameterError(f"{name} must have a unit for each number, or one at the end for all; got {text!r}")
        parts = [part if " " in part else f"{part} {parts[-1].split(' ', 1)[1]}" for part in parts]
    return tuple(in_unit(name, part, unit, plain=True) for part in parts)


def _from_moduli(law: str, found: Mapping[str, Any]) -> dict[str, Any]:
    constants = {name: value for name, value in found.items() if name not in MODULI}
    if law == "ogden" and {"E", "G"} & found.keys():
        raise ParameterError("constants: E and G leave open how the terms of ogden share the stiffness: give mu and "
                             "alpha, and nu")
    if law not in FROM_SHEAR:
        raise ParameterError(f"constants: E, G and nu are for isotropic laws; {law} has fibres: give its own constants")
    shear, other = FROM_SHEAR[law]
    for name, value in found.items():
        if name in ("E", "G"):
            require(name, value, "MPa", low=0, low_open=True)
    if "nu" in found and not -1 < found["nu"] < 0.5:
        cure = "nu = 0.5 is incompressible: give nu = 0.4999, or bulk_modulus" if found["nu"] >= 0.5 else "correct it"
        raise ParameterError(f"constants: nu must be in (-1, 0.5); got {found['nu']:g}: {cure}")
    stiff = [name for name in ("E", "G", shear) if name in found]
    if len(stiff) > 1:
        raise ParameterError(f"constants: {' and '.join(stiff)} of {law} say the same: give one of them, and nu")
    if "E" in found and "nu" not in found:
        raise ParameterError("constants: E alone is not enough: give nu as well, such as nu = 0.499")
    if law == "mooney-rivlin" and shear not in found and "c2" not in found:
        raise ParameterError("constants: E, G and nu leave open how c1 and c2 of mooney-rivlin share the stiffness: "
                             "give c2 as well, or c1 and c2")
    if stiff and stiff[0] != shear:
        G = found["G"] if "G" in found else found["E"] / (2 * (1 + found["nu"]))
        defaults = {field.name: field.default for field in fields(MATERIALS[law])}
        constants[shear] = other(G, {**defaults, **constants})
        if constants[shear] <= 0:
            raise ParameterError(f"constants: {shear} of {law} would be {constants[shear]:g} MPa, and must be > 0: the "
                                 f"shear modulus {G:g} MPa is 2 (c1 + c2)")
    if "nu" in found:
        G, nu = material_from(law, constants).shear_modulus, found["nu"]
        constants["bulk_modulus"] = 2 * G * (1 + nu) / (3 * (1 - 2 * nu))
    return constants


def own_constants(law: str, text: str) -> tuple[str, float | None]:
    """Constants as text without E, G and nu, and the bulk modulus [MPa] if they say it; other text is as it was.

    Raises
    ------
    ParameterError
        As of :func:`read_constants`.
    """
    if not set(MODULI) & _pairs(law, text).keys():
        return text, None
    found = read_constants(law, text)
    return constants_text(material_from(law, found)), found.get("bulk_modulus")


def constants_text(material: Material) -> str:
    """Text that :func:`read_constants` reads: all constants of the law."""
    values = ((f.name, getattr(material, f.name)) for f in fields(material) if f.name not in COMMON)
    return ", ".join(f"{name} = " + " ".join(f"{x!r}" for x in (value if isinstance(value, tuple) else (value,)))
                     + f" {constant_unit(name)}".rstrip() for name, value in values)


def material_of(law: str, constants: str, bulk_modulus: float, density: float, viscosity: float = 0.0) -> Material:
    """The material of a law's name, its constants as text, k [MPa] unless these have nu, rho0 [kg/m^3], eta [MPa s].

    Raises
    ------
    ParameterError
        There is no such law or constant, or a value is outside its range.
    """
    choose("material", law, MATERIALS)
    return material_from(law, {"bulk_modulus": bulk_modulus, "density": density, "viscosity": viscosity,
                               **read_constants(law, constants)})
