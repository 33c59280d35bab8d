"""The weak forms by compiled element loops: the backend of every run that asks for no other one."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..material import GeneralMaterial
from . import kernels
from .backend import BulkViscosity, Part
from .elements import ELEMENTS
from .pattern import Pattern
from .space import Space

__all__ = ["CompiledDensity", "CompiledMomentum"]


class CompiledMomentum:
    """Momentum balance by the loops of :mod:`.kernels`; its layout is that of :class:`.Tiles`.

    Memory: see :class:`.MomentumBackend`.
    """

    def __init__(self, space: Space, parts: Sequence[Part], element: str, *, threads: int = 1,
                 bulk_viscosity: BulkViscosity = BulkViscosity()) -> None:  # noqa: B008
        self._space, self._parts = space, parts
        self._plane_stress, self._j_bar = ELEMENTS[element].thin_sheet, ELEMENTS[element].j_bar
        self.tiles = kernels.Tiles(space, self._plane_stress, threads,
                                   [(part.elements, part.fibres) for part in parts])
        materials = [part.material for part in parts]
        self._laws = [kernels.Law(m.compiled_law, m.constants, m.bulk_modulus) for m in materials]
        speeds = [m.dilatational_wave_speed * 1e3 for m in materials]
        bulk = [float(b) for b in bulk_viscosity]
        self._viscous = [kernels.Viscous(m.viscosity, self._plane_stress, c_d, m.rho0 * c_d, *bulk)
                         for m, c_d in zip(materials, speeds)]
        self.gamma, self.W = self.tiles.gamma, self.tiles.W
        self.tile, self.untile, self.set_gamma = self.tiles.tile, self.tiles.untile, self.tiles.set_gamma
        self.relax, self.mean_force = self.tiles.relax, self.tiles.mean_force
        self.lump = space.lump
        self._rho0 = _density(space, parts)

    def force(self, u: np.ndarray, out: np.ndarray) -> float:
        """Internal force; see :class:`.MomentumBackend`."""
        return self.tiles.force(self._space.X + u, self._laws, out, self._j_bar)

    def along(self, u: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """Its derivative without a matrix; see :class:`.MomentumBackend`."""
        return self.tiles.along(self._space.X + u, self._laws, self._j_bar)

    @property
    def energy(self) -> float:
        """gamma-weighted stored energy at the last evaluation [N mm; N mm/mm in 2D]."""
        return float(self.tiles.psi.sum())

    def tangent(self, pattern: Pattern, u: np.ndarray, gamma: np.ndarray, convex: bool) -> np.ndarray:
        """Data of the tangent; see :class:`.MomentumBackend`."""
        data, *others = (self._tangent(part, pattern, u, gamma, convex) for part in self._parts)
        for other in others:
            data += other
        return data

    def _tangent(self, part: Part, pattern: Pattern, u: np.ndarray, gamma: np.ndarray, convex: bool) -> np.ndarray:
        material, elements, fibres = part
        if isinstance(material, GeneralMaterial) and fibres is not None:
            if self._plane_stress:
                return kernels.tangent_general_sheet(self._space, pattern, material, u, gamma, fibres, convex=convex,
                                                     elements=elements, threads=self.tiles.threads)
            return kernels.tangent_general(self._space, pattern, material, u, gamma, fibres, j_bar=self._j_bar,
                                           convex=convex, elements=elements, threads=self.tiles.threads)
        if self._plane_stress:
            return kernels.tangent_plane_stress(self._space, pattern, material, u, gamma, convex=convex,
                                                elements=elements, threads=self.tiles.threads)
        return kernels.tangent(self._space, pattern, material, u, gamma, j_bar=self._j_bar, convex=convex,
                               elements=elements, threads=self.tiles.threads)

    def mass(self, pattern: Pattern, gamma: np.ndarray) -> np.ndarray:
        """Data of the consistent mass matrix; see :class:`.MomentumBackend`."""
        return kernels.mass(self._space, pattern, gamma, self._rho0)

    def stiffest(self, u: np.ndarray, inverse_mass: np.ndarray) -> float:
        """Cheap lower bound of the highest frequency squared; see :class:`.MomentumBackend`."""
        x = self._space.X + u
        if self._plane_stress:
            return self.tiles.plane_stiffness(x, self._laws, inverse_mass)
        return self.tiles.volumetric(x, [law.bulk_modulus for law in self._laws], inverse_mass)

    def viscous_force(self, u: np.ndarray, v: np.ndarray, out: np.ndarray) -> float:
        """Viscous force; see :class:`.MomentumBackend`."""
        return self.tiles.viscous_force(self._space.X + u, v, self._viscous, out)

    def viscous_tangent(self, pattern: Pattern, motion: tuple[np.ndarray, np.ndarray], gamma: np.ndarray,
                        compression: float) -> np.ndarray:
        """Data of its derivative with the velocity; see :class:`.MomentumBackend`."""
        data = np.zeros(pattern.nnz)
        for law, part in zip(self._viscous, self._parts):
            data += kernels.viscous_tangent(self._space, pattern, law, motion, gamma, compression=compression,
                                            elements=part.elements, threads=self.tiles.threads)
        return data


def _density(space: Space, parts: Sequence[Part]) -> float | np.ndarray:
    """Density of the intact solid [t/mm^3], a number, or where materials differ one for each element (ne, 1)."""
    rho0 = parts[0].material.rho0
    if all(part.material.rho0 == rho0 for part in parts):
        return rho0
    values = np.empty((space.n_elements, 1))
    for part in parts:
        values[part.elements] = part.material.rho0
    return values


class CompiledDensity:
    """Matrices of the mass balance by compiled loops; see :class:`.DensityBackend`."""

    def __init__(self, space: Space, length_scale: float) -> None:
        self._space, self._length_scale = space, length_scale
        self.lump = space.lump

    def laplacian(self, pattern: Pattern, *, monotone: bool) -> np.ndarray:
        """Data of the gradient term; see :class:`.DensityBackend`."""
        assemble = kernels.monotone_laplacian if monotone else kernels.laplacian
        return assemble(self._space, pattern, self._length_scale**2)

    def sink(self, pattern: Pattern, sink: np.ndarray) -> np.ndarray:
        """Data of  int sink N_a N_b  on a scalar pattern."""
        return kernels.weighted_mass(self._space, pattern, sink)
