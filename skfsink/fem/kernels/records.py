"""What the element loops take, by name: numba takes named tuples of arrays and numbers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

__all__ = ["Elements", "Piece", "Solid", "Viscous", "Volumetric"]


class Elements(NamedTuple):
    """Tiles of elements of one material, and what a loop leaves there; all but `psi` are (tiles, rows, lanes).

    Attributes
    ----------
    conn: nodes.
    geometry: d xi/d X by component, then the quadrature weights, and of a body of revolution 1/R, each at all Gauss
        points.
    gamma: relative density at the Gauss points.
    fibres: directions, three rows for each family.
    force: forces on the nodes, by node, then component.
    W: stored energy density at the Gauss points.
    psi: gamma-weighted stored energy, (tiles, lanes).
    """

    conn: np.ndarray
    geometry: np.ndarray
    gamma: np.ndarray
    fibres: np.ndarray
    force: np.ndarray
    W: np.ndarray
    psi: np.ndarray

    def share(self, s: int, shares: int) -> Elements:
        """Share number `s` of `shares`: a run of neighbouring tiles."""
        n = len(self.conn)
        part = slice(n * s // shares, n * (s + 1) // shares)
        return Elements(*(array[part] for array in self))


class Volumetric(NamedTuple):
    """The volumetric part of the stored energy: k [MPa], and whether J is its element mean."""

    bulk_modulus: float
    j_bar: bool


class Solid(NamedTuple):
    """What a tangent asks of a material besides psi: moduli [MPa], and which tangent is wanted."""

    bulk_modulus: float
    shear_modulus: float
    j_bar: bool
    convex: bool


class Viscous(NamedTuple):
    """The viscosity of a material in its elements; see :mod:`.viscous`.

    Attributes
    ----------
    eta: shear viscosity [MPa s].   sheet: whether the elements are a thin sheet.
    speed, impedance: c_d [mm/s], and rho0 c_d [t/(mm^2 s)].
    linear, quadratic: b1 and b2 of the bulk viscosity.
    """

    eta: float
    sheet: bool
    speed: float
    impedance: float
    linear: float
    quadratic: float


class Piece(NamedTuple):
    """Elements for the second derivatives, element by element.

    Attributes
    ----------
    conn: nodes (ne, na).   dN: Grad N (ne, nq, na, dim).   w, gamma: (ne, nq).   slot: see :class:`.Pattern`.
    fibres: directions (ne, families, 3).   around: N_a/R (ne, nq, na) of a body of revolution, else (ne, 0, na).
    """

    conn: np.ndarray
    dN: np.ndarray
    w: np.ndarray
    gamma: np.ndarray
    slot: np.ndarray
    fibres: np.ndarray
    around: np.ndarray
