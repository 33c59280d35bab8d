"""Stored energy and sink law: what the material is made of.

The stored energy per reference volume is split as in Eq. (31),

    W(F) = k/2 (J - 1)^2 + psi(I1'),      I1' = J^(-2/3) tr(C),   C = F^T F,

with `J` replaced by its element mean in the volumetric part (Eq. 12, 13; see :mod:`skfsink.kernels`).
A material is a frozen data class that knows `bulk_modulus`, `density` and its isochoric law `psi`. **Another
stored energy is one new class**: derive from :class:`Material`, list the constants of `psi` in `constants`, and
give `law`, a compiled function that fills psi and its two derivatives for an array of I1' (see :class:`NeoHookean`,
nine lines). Nothing else in the program has to change: the element loops call `law` through a function pointer.

Units: N, mm, MPa, tonne, s. Density is entered in kg/m^3 and held in t/mm^3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numba import float64, njit, types
from numba.experimental.function_type import _get_wrapper_address
from scipy.optimize import brentq
from scipy.special import gamma as gamma_function
from scipy.special import gammaincc

from .errors import require

__all__ = ["AAA", "LAW", "CompiledLaw", "Material", "NeoHookean", "SinkLaw"]

_vector = types.Array(float64, 1, "C")
#: Compiled type of an isochoric law: law(I1', constants, psi, psi', psi'') fills the last three.
LAW = types.FunctionType(types.void(_vector, _vector, _vector, _vector, _vector))
_LAW_SIGNATURE = "void(float64[::1], float64[::1], float64[::1], float64[::1], float64[::1])"

class CompiledLaw(types.WrapperAddressProtocol):
    """A compiled law with its address looked up once; numba would do so at every call, at 0.3 ms each."""

    def __init__(self, law: Any) -> None:
        self._address = _get_wrapper_address(law, LAW.signature)

    def __wrapper_address__(self) -> int:
        return int(self._address)

    def signature(self) -> Any:
        """Its type."""
        return LAW.signature


_TONNE_PER_MM3 = 1e-12  # of 1 kg/m^3


@njit(_LAW_SIGNATURE, cache=True)
def _aaa_law(i1, c, psi, dpsi, ddpsi):  # type: ignore[no-untyped-def]
    for i in range(i1.size):
        z = i1[i] - 3.0
        psi[i] = (c[0] + c[1] * z) * z
        dpsi[i] = c[0] + 2.0 * c[1] * z
        ddpsi[i] = 2.0 * c[1]


@njit(_LAW_SIGNATURE, cache=True)
def _neo_hookean_law(i1, c, psi, dpsi, ddpsi):  # type: ignore[no-untyped-def]
    for i in range(i1.size):
        psi[i] = 0.5 * c[0] * (i1[i] - 3.0)
        dpsi[i] = 0.5 * c[0]
        ddpsi[i] = 0.0


@njit(cache=True)
def _history(W, inverse_phi, m, negligible, H):  # type: ignore[no-untyped-def]
    for i in range(W.size):
        r = W[i] * inverse_phi
        if r < negligible:     # r^m < exp(-40) is nothing beside 1 in double precision
            H[i] = 1.0
        else:
            x = r**m
            H[i] = np.exp(-x) if x > 1e-8 else 1.0 - x


@dataclass(frozen=True)
class Material:
    """Nearly incompressible isotropic solid, W = k/2 (J - 1)^2 + psi(I1').

    Parameters
    ----------
    bulk_modulus: Bulk modulus k [MPa], > 0.
    density: Mass density of the intact solid, rho0 [kg/m^3], > 0.
    """

    law: ClassVar[Callable[..., None]]

    bulk_modulus: float = 500.0
    density: float = 1433.0

    def __post_init__(self) -> None:
        require("bulk-modulus", self.bulk_modulus, "MPa", low=0, low_open=True)
        require("density", self.density, "kg/m^3", low=0, low_open=True)

    @property
    def constants(self) -> np.ndarray:
        """Constants of the isochoric law, as `law` expects them."""
        raise NotImplementedError

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

    def second_piola(self, F: np.ndarray) -> np.ndarray:
        """Second Piola-Kirchhoff stress of the undamaged material, S0 = 2 dW/dC [MPa] (Eq. 4, 11); (..., 3, 3)."""
        return np.linalg.solve(F, self.first_piola(F))

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

    def thin_sheet(self, F: np.ndarray) -> np.ndarray:
        """F (..., 3, 3) with the F_33 that leaves no stress P_33, from the part (..., 2, 2) in the plane, det > 0.

        Found by bisection of log J; the element loops use Newton's method (:mod:`.kernels.plane_stress`).
        """
        j = np.linalg.det(F)
        t = np.einsum("...iJ,...iJ", F, F)
        low, high = np.full(j.shape, -12.0), np.full(j.shape, 12.0)
        for _ in range(64):
            log_J = 0.5 * (low + high)
            J = np.exp(log_J)
            I, square = J ** (-2 / 3), (J / j) ** 2
            _, dpsi, _ = self.isochoric(I * (t + square))
            falls = dpsi * I * (4 / 3 * square - 2 / 3 * t) + self.bulk_modulus * J * (J - 1) < 0
            low, high = np.where(falls, log_J, low), np.where(falls, high, log_J)
        thin = np.zeros((*F.shape[:-2], 3, 3))
        thin[..., :2, :2] = F
        thin[..., 2, 2] = np.exp(0.5 * (low + high)) / j
        return thin

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
        """Root c_R of (2 - c^2/c_s^2)^2 = 4 sqrt(1 - c^2/c_d^2) sqrt(1 - c^2/c_s^2) [m/s]."""
        ratio2 = (self.shear_wave_speed / self.dilatational_wave_speed) ** 2

        def rayleigh(s: float) -> float:  # s = (c/c_s)^2; the trivial root s = 0 is left out of the bracket
            return (2 - s) ** 2 - 4 * np.sqrt((1 - s * ratio2) * (1 - s))

        return self.shear_wave_speed * float(np.sqrt(brentq(rayleigh, 0.1, 1 - 1e-12, xtol=1e-14)))


@dataclass(frozen=True)
class AAA(Material):
    """Abdominal aortic aneurysm, psi = c1 (I1' - 3) + c2 (I1' - 3)^2 (Eq. 31).

    Parameters
    ----------
    c1: First constant [MPa], > 0.
    c2: Second constant [MPa], >= 0.
    """

    law = staticmethod(_aaa_law)

    c1: float = 0.617
    c2: float = 1.215

    def __post_init__(self) -> None:
        super().__post_init__()
        require("c1", self.c1, "MPa", low=0, low_open=True)
        require("c2", self.c2, "MPa", low=0)

    @property
    def constants(self) -> np.ndarray:
        return np.array([self.c1, self.c2])


@dataclass(frozen=True)
class NeoHookean(Material):
    """Neo-Hookean solid, psi = mu/2 (I1' - 3); `mu` is the shear modulus [MPa], > 0."""

    law = staticmethod(_neo_hookean_law)

    mu: float = 1.234

    def __post_init__(self) -> None:
        super().__post_init__()
        require("mu", self.mu, "MPa", low=0, low_open=True)

    @property
    def constants(self) -> np.ndarray:
        return np.array([self.mu])


@dataclass(frozen=True)
class SinkLaw:
    """Mass sink and mass flux of the material-sink theory (Eq. 5-10).

    The relative density gamma obeys  Div(l^2 Grad gamma) + 1 - gamma/(H + eps) = 0  with
    H = min over history of exp(-(W/Phi)^m).

    Parameters
    ----------
    phi: Energy limiter Phi [MPa], > 0.
    m: Sharpness of the limiter, >= 1.
    length_scale: Characteristic length l of the damaged region [mm], > 0.
    epsilon: Numerical stabilization of the sink in Eq. (9), > 0 and <= 1e-3.
    """

    phi: float = 0.1686
    m: float = 10.0
    length_scale: float = 0.1
    epsilon: float = 1e-15

    def __post_init__(self) -> None:
        require("phi", self.phi, "MPa", low=0, low_open=True)
        require("m", self.m, low=1)
        require("length-scale", self.length_scale, "mm", low=0, low_open=True)
        require("epsilon", self.epsilon, low=0, high=1e-3, low_open=True)

    def history(self, W: Any) -> np.ndarray:
        """H = exp(-(W/Phi)^m) of Eq. (10). H falls as W grows, so the least H is that of the greatest W."""
        W = np.asarray(W, float)
        H = np.empty(W.size)
        m = int(self.m) if float(self.m).is_integer() else self.m  # integer powers are products, five times as fast
        _history(W.ravel(), 1 / self.phi, m, float(np.exp(-40 / self.m)), H)
        return H.reshape(W.shape)

    @property
    def failure_energy(self) -> float:
        """Energy of a volume element taken to failure, psi_f = Phi Gamma(1/m, 0)/m [MPa] (Eq. 30)."""
        return self.phi / self.m * float(gamma_function(1 / self.m) * gammaincc(1 / self.m, 0.0))
