"""The protocol of a material: stored energy of I1', stress, modulus, wave speeds.

The stored energy per reference volume is split as in Eq. (31),

    W(F) = k/2 (J - 1)^2 + psi(I1'),      I1' = J^(-2/3) tr(C),   C = F^T F,

with `J` replaced by its element mean in the volumetric part (Eq. 12, 13; see :mod:`skfsink.fem.kernels`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from scipy.optimize import brentq

from ..errors import require
from .compiled import CompiledLaw
from .drawn import plot_paths

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .sink import SinkLaw

__all__ = ["Material"]

_TONNE_PER_MM3 = 1e-12  # of 1 kg/m^3


@dataclass(frozen=True)
class Material:
    """Nearly incompressible isotropic solid, W = k/2 (J - 1)^2 + psi(I1').

    Parameters
    ----------
    bulk_modulus: Bulk modulus k [MPa], > 0.
    density: Mass density of the intact solid, rho0 [kg/m^3], > 0.
    viscosity: Shear viscosity eta [MPa s], >= 0: a Newtonian stress 2 eta dev d beside the elastic one, where it moves.
    """

    law: ClassVar[Callable[..., None]]

    bulk_modulus: float = 500.0
    density: float = 1433.0
    viscosity: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        for name in (one.name for one in fields(self) if one.type in (float, "float")):
            if isinstance(value := getattr(self, name), int | np.number):  # whole numbers: the loops take floats alone
                object.__setattr__(self, name, float(value))
        require("bulk_modulus", self.bulk_modulus, "MPa", low=0, low_open=True)
        require("density", self.density, "kg/m^3", low=0, low_open=True)
        require("viscosity", self.viscosity, "MPa s", low=0)

    @property
    def constants(self) -> np.ndarray:
        """Constants of the isochoric law, as `law` expects them."""
        raise NotImplementedError

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "compiled_law"}  # an address, of here

    @cached_property
    def compiled_law(self) -> CompiledLaw:
        """`law` as the element loops take it."""
        return CompiledLaw(type(self).law)

    @property
    def rho0(self) -> float:
        """Density of the intact solid [t/mm^3]."""
        return self.density * _TONNE_PER_MM3

    def isochoric(self, i1: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """psi, dpsi/dI1' and d2psi/dI1'2 [MPa] at the values `i1` (any shape) of I1'."""
        i1 = np.asarray(i1, float)
        flat = np.ascontiguousarray(i1.ravel())
        out = tuple(np.empty_like(flat) for _ in range(3))
        type(self).law(flat, self.constants, *out)
        return out[0].reshape(i1.shape), out[1].reshape(i1.shape), out[2].reshape(i1.shape)

    def energy(self, F: np.ndarray, J_bar: Any = None) -> np.ndarray:
        """Stored energy W [MPa], Eq. (31); `F` is (..., 3, 3), `J_bar` (...) replaces J in the volumetric part."""
        J = np.linalg.det(F)
        psi, _, _ = self.isochoric(J ** (-2 / 3) * np.einsum("...iJ,...iJ", F, F))
        return psi + 0.5 * self.bulk_modulus * ((J if J_bar is None else J_bar) - 1) ** 2

    def first_piola(self, F: np.ndarray) -> np.ndarray:
        """First Piola-Kirchhoff stress of the undamaged material, P0 = dW/dF = F S0 [MPa] (Eq. 11); (..., 3, 3)."""
        J = np.linalg.det(F)[..., None, None]
        Finv_T = np.swapaxes(np.linalg.inv(F), -1, -2)
        tr_C = np.einsum("...iJ,...iJ", F, F)[..., None, None]
        _, dpsi, _ = self.isochoric((J ** (-2 / 3) * tr_C)[..., 0, 0])
        dI1 = J ** (-2 / 3) * (2 * F - 2 / 3 * tr_C * Finv_T)
        return dpsi[..., None, None] * dI1 + self.bulk_modulus * (J - 1) * J * Finv_T

    def modulus(self, F: np.ndarray) -> np.ndarray:
        """Tangent modulus A = d2W/dFdF [MPa] of the undamaged material, indices iJkL; (..., 3, 3, 3, 3)."""
        J = np.linalg.det(F)[..., None, None, None, None]
        G = np.swapaxes(np.linalg.inv(F), -1, -2)
        tr_C = np.einsum("...iJ,...iJ", F, F)[..., None, None, None, None]
        FG = np.einsum("...iJ,...kL->...iJkL", F, G)
        GG = np.einsum("...iJ,...kL->...iJkL", G, G)
        GF = np.einsum("...iJ,...kL->...iJkL", G, F)
        G_cross = np.einsum("...iL,...kJ->...iJkL", G, G)
        unit = np.einsum("ik,JL->iJkL", np.eye(3), np.eye(3))
        scale = J ** (-2 / 3)
        _, dpsi, ddpsi = self.isochoric((scale * tr_C)[..., 0, 0, 0, 0])
        dI1 = scale[..., 0, 0] * (2 * F - 2 / 3 * tr_C[..., 0, 0] * G)
        ddI1 = scale * (2 * unit - 4 / 3 * (FG + GF) + 4 / 9 * tr_C * GG + 2 / 3 * tr_C * G_cross)
        grow = (...,) + (None,) * 4
        return (ddpsi[grow] * np.einsum("...iJ,...kL->...iJkL", dI1, dI1) + dpsi[grow] * ddI1
                + self.bulk_modulus * ((2 * J - 1) * J * GG - (J - 1) * J * G_cross))

    def thin_sheet(self, F: np.ndarray, fibres: np.ndarray | None = None) -> np.ndarray:
        """F (..., 3, 3) with the F_33 that leaves no stress P_33, from the part (..., 2, 2) in the plane, det > 0.

        `fibres` (..., families, 3) are directions in the plane, of a law that has fibres.
        """
        thin = np.zeros((*F.shape[:-2], 3, 3))
        thin[..., :2, :2] = F
        t, j = np.einsum("...iJ,...iJ", F, F), np.linalg.det(F)
        thin[..., 2, 2] = self.stretch_across(t, j, self.along(F, fibres))
        return thin

    def along(self, F: np.ndarray, fibres: np.ndarray | None) -> np.ndarray:
        """Squared stretches (families, ...) of `fibres` in the plane, which a law of I1' alone has not."""
        return np.zeros((0, *F.shape[:-2]))

    def stretch_across(self, t: np.ndarray, j: np.ndarray, along: np.ndarray | None = None) -> np.ndarray:
        """The F_33 that leaves no stress P_33, from t = F : F and j = det F > 0 of the plane, (...).

        `along` are the squared stretches of fibres, (families, ...). Found by bisection of log J; the element loops use
        Newton's method (:mod:`.kernels.plane_stress`).
        """
        low, high = np.full(j.shape, -12.0), np.full(j.shape, 12.0)
        for _ in range(64):
            log_J = 0.5 * (low + high)
            J = np.exp(log_J)
            falls = self._across(t, j, J, along) + self.bulk_modulus * J * (J - 1) < 0
            low, high = np.where(falls, log_J, low), np.where(falls, high, log_J)
        return np.asarray(np.exp(0.5 * (low + high)) / j)

    def _across(self, t: np.ndarray, j: np.ndarray, J: np.ndarray, along: np.ndarray | None) -> np.ndarray:
        """Derivative of psi with log J at a fixed deformation of the plane [MPa]."""
        I, square = J ** (-2 / 3), (J / j) ** 2
        _, dpsi, _ = self.isochoric(I * (t + square))
        return np.asarray(dpsi * I * (4 / 3 * square - 2 / 3 * t))

    def plot(self, sink_law: SinkLaw | None = None, path: str = "", ax: Axes | None = None) -> Axes:
        """Draw stress against stretch of homogeneous deformations: with the sink full, without it dashed.

        Parameters
        ----------
        sink_law: energy limiter and sharpness, as `materials.limiter("gent")` gives those of a law; None draws the
            stored energy alone, up to a stretch of 2.
        path: "uniaxial tension", "plane strain", "equibiaxial tension" or "simple shear"; left out: the tensions.
        ax: axes of matplotlib to draw on; left out: those of a new figure of pyplot.

        Returns
        -------
        The axes.

        Raises
        ------
        ParameterError
            There is no such path.
        """
        return plot_paths(self, sink_law, path, ax)

    @property
    def shear_modulus(self) -> float:
        """Shear modulus of the undeformed material, mu = 2 psi'(3) [MPa]."""
        return 2 * float(self.isochoric(3.0)[1])

    @property
    def shear_wave_speed(self) -> float:
        """c_s = sqrt(mu/rho0) [m/s]."""
        return float(np.sqrt(self.shear_modulus / self.rho0)) * 1e-3

    @property
    def dilatational_wave_speed(self) -> float:
        """c_d = sqrt((k + 4 mu/3)/rho0) [m/s]."""
        return float(np.sqrt((self.bulk_modulus + 4 / 3 * self.shear_modulus) / self.rho0)) * 1e-3

    @property
    def rayleigh_wave_speed(self) -> float:
        """c_R, of a half-space (in plane strain) [m/s]; see :func:`rayleigh_speed`."""
        return rayleigh_speed(self.shear_wave_speed, self.dilatational_wave_speed)


def rayleigh_speed(shear: float, longitudinal: float) -> float:
    """Root c_R of (2 - c^2/c_s^2)^2 = 4 sqrt(1 - c^2/c_d^2) sqrt(1 - c^2/c_s^2), of two speeds of waves.

    Of a thin sheet the `longitudinal` one is that of the sheet.
    """
    ratio2 = (shear / longitudinal) ** 2

    def rayleigh(s: float) -> float:  # s = (c/c_s)^2; the trivial root s = 0 is left out of the bracket
        return (2 - s) ** 2 - 4 * np.sqrt((1 - s * ratio2) * (1 - s))

    return shear * float(np.sqrt(brentq(rayleigh, 0.1, 1 - 1e-12, xtol=1e-14)))
