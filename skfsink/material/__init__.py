"""Stored energies and the sink law: what a material is made of.

A material is a frozen data class that knows `bulk_modulus`, `density` and its isochoric law `psi`. **Another stored
energy is one new class.** A law of I1' alone derives from :class:`Material`, lists the constants of `psi` in
`constants`, and gives `law`, a compiled function that fills psi and its two derivatives for an array of I1' (see
`NeoHookean`, nine lines). A law that also needs I2' or fibres derives from :class:`GeneralMaterial`. Nothing else in
the program has to change: the element loops call `law` through a function pointer. `MATERIALS` lists the laws by name.

Units: N, mm, MPa, tonne, s. Density is entered in kg/m^3 and held in t/mm^3.
"""

from .base import Material
from .compiled import GENERAL_LAW, LAW, CompiledLaw
from .constants import (
    MODULI,
    constant_names,
    constant_unit,
    constants_text,
    material_of,
    own_constants,
    own_names,
    read_constants,
    with_constant,
)
from .fibres import HolzapfelGasserOgden
from .general import GeneralMaterial, MooneyRivlin
from .isotropic import AAA, ArrudaBoyce, Gent, NeoHookean, Yeoh
from .library import LIMITERS, MATERIALS, Limiter, limiter_of, material_from
from .ogden import Ogden
from .sink import SinkLaw

__all__ = ["AAA", "GENERAL_LAW", "LAW", "LIMITERS", "MATERIALS", "MODULI", "ArrudaBoyce", "CompiledLaw",
           "GeneralMaterial", "Gent", "HolzapfelGasserOgden", "Limiter", "Material", "MooneyRivlin", "NeoHookean",
           "Ogden", "SinkLaw", "Yeoh", "constant_names", "constant_unit", "constants_text", "limiter_of",
           "material_from", "material_of", "own_constants", "own_names", "read_constants", "with_constant"]
