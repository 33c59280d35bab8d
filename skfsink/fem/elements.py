"""The elements by name: adding one is the function of its forms, and a line in `ELEMENTS`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from ..errors import ParameterError, choose
from ..material import Material
from .forms import MomentumForms, momentum_forms, plane_stress_forms
from .space import Space

__all__ = ["ELEMENTS", "Element", "check_element"]


class Element(NamedTuple):
    """How an element turns displacement into stored energy.

    Attributes
    ----------
    forms: its weak forms for a material.
    dimensions: of the meshes it is made for.
    thin_sheet: whether it is a thin sheet with free faces (plane stress).
    axisymmetric: whether it is of bodies of revolution, whose space says so.
    j_bar: whether its volume change is one value an element (Eq. 13); the compiled loops are told so.
    compiled: whether there are compiled loops for it; without them it takes `--kernels forms`.
    """

    forms: Callable[[Material], MomentumForms]
    dimensions: tuple[int, ...] = (2, 3)
    thin_sheet: bool = False
    axisymmetric: bool = False
    j_bar: bool = False
    compiled: bool = False


ELEMENTS: dict[str, Element] = {
    "jbar": Element(partial(momentum_forms, j_bar=True), j_bar=True, compiled=True),
    "plain": Element(partial(momentum_forms, j_bar=False), compiled=True),
    "planestress": Element(plane_stress_forms, dimensions=(2,), thin_sheet=True, compiled=True),
    "axisymmetric": Element(partial(momentum_forms, j_bar=True), dimensions=(2,), axisymmetric=True, j_bar=True,
                            compiled=True),
}


def check_element(name: str, space: Space, kernels: str = "compiled") -> Element:
    """The element of that name, for a body of that dimension.

    Raises
    ------
    ParameterError
        There is none, it is not made for the dimension, or has no compiled loops; or the space is of revolution and the
        element is not, or the other way round.
    """
    element = ELEMENTS[choose("element", name, ELEMENTS)]
    if space.dim not in element.dimensions:
        cells = ("quadrilaterals", "hexahedra") if space.dim == 3 else ("hexahedra", "quadrilaterals")
        raise ParameterError(f"element {name} is for meshes of {cells[0]}; this one has {cells[1]}: take jbar")
    if element.axisymmetric and not space.axisymmetric:
        raise ParameterError(f"element {name} is for bodies of revolution, and the space is not that of one: take "
                             f"Space(mesh, axisymmetric=True)")
    if space.axisymmetric and not element.axisymmetric:
        raise ParameterError(f"element {name} is not for bodies of revolution, and the space is that of one: take "
                             f"axisymmetric")
    if kernels == "compiled" and not element.compiled:
        raise ParameterError(f"element {name} has no compiled loops: take kernels = 'forms'")
    return element
