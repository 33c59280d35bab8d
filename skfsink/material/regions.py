"""Regions: parts of a body that are of another material, or of another strength, than the rest.

Displacement and relative density are single fields, continuous across the face between two materials; so is the
traction, in the weak sense. Strain, stored energy and the sink jump there. The length l and epsilon belong to the
field gamma, not to a material, and are those of the whole body.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from ..errors import ParameterError
from ..units import Unit
from . import Material, SinkLaw, limiter_of, material_of, own_constants

__all__ = ["Region", "RegionLaw", "among", "by_element", "check_lengths", "divided", "rest_of"]


@dataclass(frozen=True, eq=False)
class Region:
    """Elements of a material of their own.

    Attributes
    ----------
    name: of the set of elements.
    elements: their numbers, ascending.
    material, sink_law: theirs; the length l is that of the whole body.

    Raises
    ------
    ParameterError
        There are no elements, or they are not whole numbers.
    """

    name: str
    elements: np.ndarray
    material: Material
    sink_law: SinkLaw

    def __post_init__(self) -> None:
        elements = np.asarray(self.elements)
        if not elements.size:
            raise ParameterError(f"region {self.name} has no elements: leave it out, or name a set that has some")
        if elements.dtype.kind not in "iu" or elements.ndim != 1:
            raise ParameterError(f"the elements of region {self.name} must be a list of whole numbers; got an array "
                                 f"of {elements.dtype} with the shape {elements.shape}")
        object.__setattr__(self, "elements", np.unique(elements).astype(np.int64))


def among(regions: Sequence[Region], elements: np.ndarray) -> tuple[Region, ...]:
    """The regions that have some of `elements` (m,), by their numbers among these."""
    found = ((region, np.flatnonzero(np.isin(elements, region.elements))) for region in regions)
    return tuple(Region(region.name, own, region.material, region.sink_law) for region, own in found if own.size)


def rest_of(regions: Sequence[Region], n_elements: int) -> np.ndarray:
    """Numbers of the elements that are in no region, ascending.

    Raises
    ------
    ParameterError
        A region has elements that the mesh has not, or that are in another region too.
    """
    owner = np.full(n_elements, -1)
    for i, region in enumerate(regions):
        for e in region.elements[[0, -1]]:
            if not 0 <= e < n_elements:
                raise ParameterError(f"region {region.name} has the element {e}; those of the mesh are 0 to "
                                     f"{n_elements - 1}: take the numbers of this mesh")
        taken = region.elements[owner[region.elements] >= 0]
        if taken.size:
            other = regions[owner[taken[0]]].name
            raise ParameterError(f"regions {other} and {region.name} overlap: {taken.size} element(s) are in both, "
                                 f"such as {taken[0]}; an element has one material")
        owner[region.elements] = i
    return np.flatnonzero(owner < 0)


def check_lengths(law: SinkLaw, regions: Sequence[Region]) -> None:
    """Refuse regions whose length l or epsilon is not that of the body's `law` (ParameterError)."""
    for region in regions:
        sink_law = region.sink_law
        if sink_law.length_scale != law.length_scale:
            raise ParameterError(f"region {region.name} has the length_scale {sink_law.length_scale:g} mm, the body "
                                 f"{law.length_scale:g} mm: gamma is one field with one length, give both the same")
        if sink_law.epsilon != law.epsilon:
            raise ParameterError(f"region {region.name} has the epsilon {sink_law.epsilon:g}, the body "
                                 f"{law.epsilon:g}: gamma is one field, give both the same")


def divided(n_elements: int, material: Material, sink_law: SinkLaw, regions: Sequence[Region]) -> tuple[Region, ...]:
    """The body by its materials: what is in no region first, with an empty name, if there is any."""
    rest = rest_of(regions, n_elements)
    return (*((Region("", rest, material, sink_law),) if rest.size else ()), *regions)


@dataclass(frozen=True)
class RegionLaw:
    """What a named set of elements is made of.

    Parameters
    ----------
    name: of the set of elements in the mesh.
    material: name of the law; empty takes the law of the body with its constants and its energy limiter.
    constants: of a law that is named, as text ("mu = 2 MPa", or "E = 3 MPa, nu = 0.499"); those left out have their
        defaults.
    phi: energy limiter Phi [MPa], > 0; 0 takes the one that belongs to the law, or that of the body with its law.
    m: sharpness of the limiter, >= 1; 0 takes that of the body.
    bulk_modulus: bulk modulus k [MPa], > 0; 0 takes that of the body.
    density: density rho0 [kg/m^3], > 0; 0 takes that of the body.
    viscosity: shear viscosity eta [MPa s], > 0; 0 takes that of the body.
    """

    name: str
    material: str = ""
    constants: str = ""
    phi: Annotated[float, Unit("MPa")] = 0.0
    m: float = 0.0
    bulk_modulus: Annotated[float, Unit("MPa")] = 0.0
    density: Annotated[float, Unit("kg/m^3")] = 0.0
    viscosity: Annotated[float, Unit("MPa s")] = 0.0

    def __post_init__(self) -> None:
        if self.constants and not self.material:
            raise ParameterError(f"region {self.name}: constants {self.constants!r} are those of no law: give a "
                                 f"material as well")

    def laws(self, material: Material, sink_law: SinkLaw) -> tuple[Material, SinkLaw]:
        """Material and sink law of the region, in a body of these."""
        try:
            if not self.material:
                given = {"bulk_modulus": self.bulk_modulus, "density": self.density, "viscosity": self.viscosity}
                law = replace(material, **{name: value for name, value in given.items() if value})
                return law, replace(sink_law, phi=self.phi or sink_law.phi, m=self.m or sink_law.m)
            if self.bulk_modulus:
                one_bulk_modulus(own_constants(self.material, self.constants)[1], self.bulk_modulus)
            law = material_of(self.material, self.constants, self.bulk_modulus or material.bulk_modulus,
                              self.density or material.density, self.viscosity or material.viscosity)
            phi = self.phi or limiter_of(self.material).phi
            return law, SinkLaw(phi, self.m or sink_law.m, sink_law.length_scale, sink_law.epsilon)
        except ParameterError as error:
            raise ParameterError(f"region {self.name}: {error}") from None


def by_element(n_elements: int, rest: float, regions: Sequence[Region],
               value: Callable[[Region], float]) -> float | np.ndarray:
    """A constant of the materials, `rest` outside of the regions: a number where it is the same in all, else (ne,)."""
    numbers = [value(region) for region in regions]
    if all(number == rest for number in numbers):
        return rest
    values = np.full(n_elements, float(rest))
    for region, number in zip(regions, numbers):
        values[region.elements] = number
    return values


def one_bulk_modulus(of_nu: float | None, bulk_modulus: float | None) -> None:
    """Refuse a bulk modulus that is given beside a Poisson ratio, from which it follows (ParameterError)."""
    if of_nu is not None and bulk_modulus is not None:
        raise ParameterError(f"bulk_modulus {bulk_modulus:g} MPa and the nu of the constants ({of_nu:.6g} MPa) say the "
                             f"same: give one of them")
