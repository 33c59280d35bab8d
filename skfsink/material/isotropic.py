"""Stored energies of I1' alone. They run through the fastest element loops.

Laws with a locking stretch (Gent, Arruda-Boyce) have a pole of the energy. Beyond `LOCKED` of the way to it they go on
as their second-order Taylor polynomial: energy, stress and modulus stay continuous and finite, as points that have
lost their density may be stretched at will, and no stress times zero may become NaN.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import require
from ..system.jit import njit
from .base import Material

__all__ = ["AAA", "LOCKED", "ArrudaBoyce", "Gent", "NeoHookean", "Yeoh"]

LOCKED = 0.999  #: share of the limit of I1' - 3 up to which a law that locks is used as it is


@njit(cache=True)
def _aaa_law(i1, c, psi, dpsi, ddpsi):  # type: ignore[no-untyped-def]
    for i in range(i1.size):
        z = i1[i] - 3.0
        psi[i] = (c[0] + c[1] * z) * z
        dpsi[i] = c[0] + 2.0 * c[1] * z
        ddpsi[i] = 2.0 * c[1]


@njit(cache=True)
def _neo_hookean_law(i1, c, psi, dpsi, ddpsi):  # type: ignore[no-untyped-def]
    for i in range(i1.size):
        psi[i] = 0.5 * c[0] * (i1[i] - 3.0)
        dpsi[i] = 0.5 * c[0]
        ddpsi[i] = 0.0


@njit(cache=True)
def _yeoh_law(i1, c, psi, dpsi, ddpsi):  # type: ignore[no-untyped-def]
    for i in range(i1.size):
        z = i1[i] - 3.0
        psi[i] = (c[0] + (c[1] + c[2] * z) * z) * z
        dpsi[i] = c[0] + (2.0 * c[1] + 3.0 * c[2] * z) * z
        ddpsi[i] = 2.0 * c[1] + 6.0 * c[2] * z


@njit(cache=True)
def _gent_law(i1, c, psi, dpsi, ddpsi):  # type: ignore[no-untyped-def]
    half_mu, limit = 0.5 * c[0], c[1]
    for i in range(i1.size):
        z = i1[i] - 3.0
        inside = min(z, LOCKED * limit)
        beyond, left = z - inside, 1.0 - inside / limit
        d, dd = half_mu / left, half_mu / (limit * left * left)
        psi[i] = -half_mu * limit * np.log1p(-inside / limit) + (d + 0.5 * dd * beyond) * beyond
        dpsi[i] = d + dd * beyond
        ddpsi[i] = dd


@njit(cache=True)
def _arruda_boyce_law(i1, c, psi, dpsi, ddpsi):  # type: ignore[no-untyped-def]
    mu, chain = c[0], 3.0 * c[1]
    limit = chain - 3.0
    for i in range(i1.size):
        z = i1[i] - 3.0
        inside = min(z, LOCKED * limit)
        beyond, left = z - inside, (limit - inside) / chain   # left = 1 - s
        d, dd = mu / 6.0 * (1.0 + 2.0 / left), mu / (3.0 * chain * left * left)
        psi[i] = (mu * c[1] * (0.5 * inside / chain - np.log1p(-inside / limit))
                  + (d + 0.5 * dd * beyond) * beyond)
        dpsi[i] = d + dd * beyond
        ddpsi[i] = dd


@dataclass(frozen=True)
class AAA(Material):
    """Abdominal aortic aneurysm, psi = c1 (I1' - 3) + c2 (I1' - 3)^2 (Eq. 31).

    The constants are those of the paper (Sec. 4).

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
    """Neo-Hookean solid, psi = mu/2 (I1' - 3); `mu` is the shear modulus [MPa], > 0.

    The constant is the initial shear modulus of :class:`AAA`, 2 c1.
    """

    law = staticmethod(_neo_hookean_law)

    mu: float = 2 * AAA.c1

    def __post_init__(self) -> None:
        super().__post_init__()
        require("mu", self.mu, "MPa", low=0, low_open=True)

    @property
    def constants(self) -> np.ndarray:
        return np.array([self.mu])


@dataclass(frozen=True)
class Yeoh(Material):
    """Yeoh's cubic (1993), psi = c1 z + c2 z^2 + c3 z^3 with z = I1' - 3.

    The constants are attributed to natural rubber in Volokh, Mech. Res. Commun. 37 (2010) 684-689, unverified. psi' has
    to stay positive, c2 > -sqrt(3 c1 c3), or the law softens by itself.

    Parameters
    ----------
    c1: Half the initial shear modulus [MPa], > 0.
    c2: Second constant [MPa], > -sqrt(3 c1 c3).
    c3: Third constant [MPa], >= 0.
    """

    law = staticmethod(_yeoh_law)

    c1: float = 0.298
    c2: float = 0.014
    c3: float = 0.00016

    def __post_init__(self) -> None:
        super().__post_init__()
        require("c1", self.c1, "MPa", low=0, low_open=True)
        require("c3", self.c3, "MPa", low=0)
        least = -float(np.sqrt(3 * self.c1 * self.c3))
        require("c2", self.c2, "MPa: below -sqrt(3 c1 c3) the law softens by itself", low=least,
                low_open=least < 0)

    @property
    def constants(self) -> np.ndarray:
        return np.array([self.c1, self.c2, self.c3])


@dataclass(frozen=True)
class Gent(Material):
    """Gent's law (Rubber Chem. Technol. 69 (1996) 59-61), psi = -mu Jm/2 log(1 - (I1' - 3)/Jm).

    It locks at I1' - 3 = Jm, and goes on as a parabola beyond 0.999 of that. The constants follow from those of
    :class:`ArrudaBoyce` for Treloar's vulcanised rubber: the same mu, and the same limit, Jm = 3 (N - 1) (Boyce, Rubber
    Chem. Technol. 69 (1996) 781-785, finds the two laws nearly equivalent). His uniaxial curve is met within 20 % at
    stretches of 1.9 to 7.6.

    Parameters
    ----------
    mu: Initial shear modulus [MPa], > 0.
    limit: Jm, the limit of I1' - 3, > 0.
    """

    law = staticmethod(_gent_law)

    mu: float = 0.27
    limit: float = 76.5

    def __post_init__(self) -> None:
        super().__post_init__()
        require("mu", self.mu, "MPa", low=0, low_open=True)
        require("limit", self.limit, low=0, low_open=True)

    @property
    def constants(self) -> np.ndarray:
        return np.array([self.mu, self.limit])


@dataclass(frozen=True)
class ArrudaBoyce(Material):
    """Eight-chain law of Arruda and Boyce (J. Mech. Phys. Solids 41 (1993) 389-412).

    With s = I1'/(3 N), the square of the stretch of a chain over its limit, and Cohen's inverse Langevin function
    L^-1(x) = x (3 - x^2)/(1 - x^2) (Rheol. Acta 30 (1991) 270-273; off by at most 4.94 %),

        psi' = mu/6 (3 - s)/(1 - s),    psi = mu N [s/2 - log(1 - s)] less its value at I1' = 3.

    It locks at I1' = 3 N, and goes on as a parabola beyond 0.999 of the way there. The constants are attributed
    to the authors' fit to Treloar's vulcanised rubber, unverified; his uniaxial curve is met within 9 % at stretches of
    1.9 to 7.6. The initial shear modulus is mu (N - 1/3)/(N - 1).

    Parameters
    ----------
    mu: Modulus of the chains, n k T [MPa], > 0.
    segments: N, rigid links in a chain, > 1.
    """

    law = staticmethod(_arruda_boyce_law)

    mu: float = 0.27
    segments: float = 26.5

    def __post_init__(self) -> None:
        super().__post_init__()
        require("mu", self.mu, "MPa", low=0, low_open=True)
        require("segments", self.segments, low=1, low_open=True)

    @property
    def constants(self) -> np.ndarray:
        return np.array([self.mu, self.segments])
