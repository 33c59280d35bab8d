"""Quantities at places of a body, by name: what probes follow."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..errors import ParameterError
from ..fem.backend import among
from ..fem.places import Places
from .momentum import Momentum
from .state import State
from .stress import cauchy_stress, pressure, principal_stresses, von_mises

__all__ = ["QUANTITIES", "USUAL", "Quantity", "principal_stretches", "quantities_of"]

_AXES = ("x", "y", "z")


class Quantity(NamedTuple):
    """A quantity of a body at places of it.

    Attributes
    ----------
    meaning: in words.
    unit: of its components.
    names: of its components, of a body of that dimension.
    values: at the places, (m, components).
    """

    meaning: str
    unit: str
    names: Callable[[int], Sequence[str]]
    values: Callable[[Momentum, State, Places], np.ndarray]


def _vector(name: str) -> Callable[[int], Sequence[str]]:
    return lambda dim: [f"{name}_{axis}" for axis in _AXES[:dim]]


def _fixed(*names: str) -> Callable[[int], Sequence[str]]:
    return lambda dim: names


def _stress_names(dim: int) -> list[str]:
    return [f"stress_{pair}" for pair in ("xx", "yy", "zz", "xy", "yz", "xz")[:6 if dim == 3 else 4]]


def _stress(momentum: Momentum, state: State, places: Places) -> np.ndarray:
    """Element means, (m, 6)."""
    elements, index = np.unique(places.elements, return_inverse=True)
    found: np.ndarray = cauchy_stress(momentum, state.u, elements)[index.ravel()]
    return found


def _components(momentum: Momentum, state: State, places: Places) -> np.ndarray:
    return _stress(momentum, state, places)[:, :len(_stress_names(momentum.space.dim))]


def _principal(momentum: Momentum, state: State, places: Places) -> np.ndarray:
    return principal_stresses(_stress(momentum, state, places))[:, ::-1]


def principal_stretches(momentum: Momentum, u: np.ndarray, elements: np.ndarray) -> np.ndarray:
    """Principal stretches (m, 3) of the mean F of elements (m,) at `u` (n, dim), descending; NaN if it is inside out.

    Of a thin sheet the stretch across it is that which leaves no stress.
    """
    space = momentum.space
    dim = space.dim
    w = space.w[elements] / space.V[elements, None]
    F = np.zeros((elements.size, 3, 3))
    F[:] = np.eye(3)
    F[:, :dim, :dim] += np.einsum("eq,eai,eqaJ->eiJ", w, u[space.conn[elements]], space.slopes(elements))
    if space.axisymmetric:
        F[:, 2, 2] += np.einsum("eq,ea,eqa->e", w, u[space.conn[elements], 0], space.around[elements])
    upright = np.linalg.det(F) > 0.0
    F[~upright] = np.eye(3)
    if momentum.plane_stress:
        for part, here, own in among(momentum.parts, elements):
            F[here] = part.material.thin_sheet(F[here][:, :2, :2], None if part.fibres is None else part.fibres[own])
    stretches = np.sqrt(np.linalg.eigvalsh(np.swapaxes(F, -1, -2) @ F))[:, ::-1]
    stretches[~upright] = np.nan
    return stretches


def _stretches(momentum: Momentum, state: State, places: Places) -> np.ndarray:
    return principal_stretches(momentum, state.u, places.elements)


def _energy(momentum: Momentum, state: State, places: Places) -> np.ndarray:
    """Element means of W, at most 1000 as in frames, of the last evaluation of the force: that of the state."""
    elements = places.elements
    W = np.einsum("eq,eq->e", momentum.space.w[elements], np.minimum(momentum.W[elements], 1e3))
    return np.asarray(W / momentum.space.V[elements])[:, None]


#: Those of nodes are interpolated, all others are means over the element that holds the place.
QUANTITIES: Mapping[str, Quantity] = {
    "displacement": Quantity("displacement", "mm", _vector("u"), lambda m, s, p: p.at(m.space, s.u)),
    "velocity": Quantity("velocity", "mm/s", _vector("v"), lambda m, s, p: p.at(m.space, s.v)),
    "stretches": Quantity("principal stretches, the greatest first", "1",
                          _fixed("stretch_1", "stretch_2", "stretch_3"), _stretches),
    "stress": Quantity("components of the Cauchy stress, without a viscous one", "MPa", _stress_names, _components),
    "principal_stresses": Quantity("principal Cauchy stresses, the greatest first", "MPa",
                                   _fixed("stress_1", "stress_2", "stress_3"), _principal),
    "pressure": Quantity("-tr sigma/3", "MPa", _fixed("pressure"),
                         lambda m, s, p: pressure(_stress(m, s, p))[:, None]),
    "von_mises": Quantity("von Mises stress", "MPa", _fixed("von_mises"),
                          lambda m, s, p: von_mises(_stress(m, s, p))[:, None]),
    "W": Quantity("stored energy density of the undamaged material", "MPa", _fixed("W"), _energy),
    "gamma": Quantity("relative density", "1", _fixed("gamma"), lambda m, s, p: p.at(m.space, s.gamma)[:, None])}
#: of a point or a line that names none
USUAL = "displacement, velocity, stretches, stress, gamma"


def quantities_of(text: str) -> list[Quantity]:
    """The quantities that a text names, with commas.

    Raises
    ------
    ParameterError
        One is unknown, or is there twice.
    """
    names = [name.strip() for name in text.split(",")] if isinstance(text, str) else [text]
    for name in names:
        if name not in QUANTITIES:
            raise ParameterError(f"quantity must be one or more of {', '.join(QUANTITIES)}, with commas; got {name!r}")
        if names.count(name) > 1:
            raise ParameterError(f"quantity has {name} twice; got {text!r}")
    return [QUANTITIES[name] for name in names]
