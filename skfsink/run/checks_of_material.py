"""Checks of the constants of a material before a run: are they those of a solid, in the units that are asked for?"""

from __future__ import annotations

import logging

import numpy as np

from ..errors import ParameterError
from ..material import MATERIALS, limiter_of
from ..material.constants import FROM_SHEAR
from ..material.regions import Region
from ..scene.scene import Scene

__all__ = ["refuse_material", "warn_of_material"]

log = logging.getLogger(__name__)

DENSITY = 1e-3, 10.0, 25e3, 1e6    # kg/m^3: foams have 10 and more, osmium 22,600; t/mm^3 and g/cm^3 give less
WAVES = 0.1, 6000.0, 2e4           # shear waves [m/s]: gels have 1, rubbers 20, steel 3200, diamond 12,000
STRENGTH = 1e-10, 1e-5, 1e3, 1e6   # Phi/mu: glass has 1e-6, stretched rubbers 60 to 240
OTHER = 0.2                        # change of the shear modulus by which a default limiter is another material's
COMPRESSIBLE = 2.0 / 3.0           # k/mu below which Poisson's ratio is negative


def refuse_material(scene: Scene, part: Region) -> None:
    """Refuse a strength of nothing, and in a dynamic analysis a density or wave speed of no solid (ParameterError)."""
    material, where, phi = part.material, _where(scene, part), part.sink_law.phi
    ratio = phi / material.shear_modulus
    if not STRENGTH[0] <= ratio <= STRENGTH[3]:
        raise ParameterError(f"the energy limiter phi = {phi:.3g} MPa{where} is {ratio:.2g} of the shear modulus "
                             f"{material.shear_modulus:.3g} MPa (allowed {STRENGTH[0]:g} to {STRENGTH[3]:g}): both are "
                             f"in MPa; a number in Pa is to be divided by 1e6")
    if not scene.controls.dynamic:
        return
    if not DENSITY[0] <= material.density <= DENSITY[3]:
        raise ParameterError(f"density {material.density:.4g} kg/m^3{where} is that of no solid (allowed "
                             f"{DENSITY[0]:g} to {DENSITY[3]:g}): {_density_cure(material.density)}")
    if material.shear_wave_speed > WAVES[2]:
        raise ParameterError(f"shear waves{where} would run at {material.shear_wave_speed:.3g} m/s (at most "
                             f"{WAVES[2]:g}): the shear modulus {material.shear_modulus:.3g} MPa or the density "
                             f"{material.density:.4g} kg/m^3 is in another unit; a modulus in Pa is to be divided by "
                             f"1e6")


def warn_of_material(scene: Scene, part: Region) -> None:
    """Warn of constants that are unusual, and of a limiter that belongs to other ones."""
    material, where, phi = part.material, _where(scene, part), part.sink_law.phi
    ratio, stiff = phi / material.shear_modulus, material.bulk_modulus / material.shear_modulus
    if not STRENGTH[1] <= ratio <= STRENGTH[2]:
        log.warning("the energy limiter phi = %.3g MPa is %.2g of the shear modulus %.3g MPa (outside of %g to %g)%s: "
                    "it fails at strains of about %.2g; check the units of both (MPa)", phi, ratio,
                    material.shear_modulus, *STRENGTH[1:3], where, np.sqrt(2 * ratio))
    law = next((name for name in FROM_SHEAR if type(material) is MATERIALS[name]), "")  # of isotropic laws
    given = any(table["name"] == part.name and "phi" in table for table in scene.parameters.get("regions", ()))
    if law and phi == limiter_of(law).phi and not given:
        usual = MATERIALS[law]().shear_modulus
        if abs(material.shear_modulus / usual - 1) > OTHER:
            log.warning("phi = %.4g MPa belongs to %s with its default constants, of shear modulus %.3g MPa, and here "
                        "that is %.3g MPa%s: give the phi of this material, or its strength is that of the other one",
                        phi, law, usual, material.shear_modulus, where)
    if stiff < COMPRESSIBLE:
        log.warning("k/mu = %.3g is so small (below %.2g)%s that Poisson's ratio is negative; check the units of "
                    "bulk_modulus (MPa) and of the constants", stiff, COMPRESSIBLE, where)
    if not scene.controls.dynamic:
        return
    if not DENSITY[1] <= material.density <= DENSITY[2]:
        log.warning("density %.4g kg/m^3 is unusual for a solid (outside of %g to %g)%s: %s", material.density,
                    *DENSITY[1:3], where, _density_cure(material.density))
    if not WAVES[0] <= material.shear_wave_speed <= WAVES[1]:
        log.warning("shear waves run at %.3g m/s (outside of %g to %g)%s: check the units of the density (kg/m^3) and "
                    "of the constants (MPa)", material.shear_wave_speed, *WAVES[:2], where)


def _density_cure(density: float) -> str:
    """How the density may have been meant."""
    for unit, factor in (("t/mm^3", 1e12), ("kg/mm^3", 1e9), ("g/cm^3", 1e3)):
        if 100.0 <= density * factor < DENSITY[2]:
            return f"if it is in {unit}, give {density * factor:.4g} kg/m^3"
    return "give it in kg/m^3, where water has 1000"


def _where(scene: Scene, part: Region) -> str:
    """Of which material a message speaks, if there are several."""
    return "" if len(scene.parts) == 1 else f" of region {part.name}" if part.name else " outside of the regions"
