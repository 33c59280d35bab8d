"""Homogeneous deformations of an incompressible material with its sink: stress-stretch curves and strengths.

At a point gamma = H, so the stress of the material falls as exp(-(W/Phi)^m) while that of its stored energy grows. The
peak of their product is the strength: beyond it no static solution exists under a given load. The pressure is found
from the free direction, which bears no stress. A body is pulled along x; fibres keep their directions in x, y, z.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from .sink import SinkLaw

if TYPE_CHECKING:
    from .base import Material

__all__ = ["PATHS", "Curve", "Path", "Peak", "curve", "extent", "peak_of", "peaks", "wave_speed_at_failure"]


def _diagonal(*stretches: np.ndarray) -> np.ndarray:
    F = np.zeros((len(stretches[0]), 3, 3))
    for i, stretch in enumerate(stretches):
        F[:, i, i] = stretch
    return F


def _uniaxial(material: Material, s: np.ndarray) -> np.ndarray:
    """diag(s, b, 1/(s b)); b is s^(-1/2) without fibres, else found by bisection so that both sides are free."""
    fibres = getattr(material, "fibres", None)  # of a GeneralMaterial
    if fibres is None or not fibres(np.zeros((1, 3))).size:
        return _diagonal(s, s**-0.5, s**-0.5)
    low, high = -2 * np.abs(np.log(s)), np.abs(np.log(s))
    for _ in range(60):
        b = np.exp(0.5 * (low + high))
        cauchy = _cauchy(material, _diagonal(s, b, 1 / (s * b)))
        wide = cauchy[:, 1, 1] > cauchy[:, 2, 2]
        low, high = np.where(wide, low, np.log(b)), np.where(wide, np.log(b), high)
    b = np.exp(0.5 * (low + high))
    return _diagonal(s, b, 1 / (s * b))


def _simple_shear(material: Material, k: np.ndarray) -> np.ndarray:
    F = _diagonal(*3 * [np.ones_like(k)])
    F[:, 0, 1] = k
    return F


@dataclass(frozen=True)
class Path:
    """One kind of homogeneous deformation.

    Attributes
    ----------
    symbol, start: of the parameter, and its value in the undeformed body.
    gradient: isochoric F (n, 3, 3) of a material at values (n,) of the parameter.
    component: of the Cauchy stress that is reported.
    free: direction that bears no stress; None where no pressure enters the component.
    """

    symbol: str
    start: float
    gradient: Callable[[Material, np.ndarray], np.ndarray]
    component: tuple[int, int]
    free: int | None


PATHS = {
    "uniaxial tension": Path(r"\lambda", 1.0, _uniaxial, (0, 0), 2),
    "plane strain": Path(r"\lambda", 1.0, lambda _, s: _diagonal(s, 1 / s, np.ones_like(s)), (0, 0), 1),
    "equibiaxial tension": Path(r"\lambda", 1.0, lambda _, s: _diagonal(s, s, s**-2), (0, 0), 2),
    "simple shear": Path("k", 0.0, _simple_shear, (0, 1), None),
}


@dataclass(frozen=True)
class Curve:
    """A path's parameter, stored energy W [MPa], gamma = H, and Cauchy stress without and with the sink [MPa], (n,)."""

    at: np.ndarray
    W: np.ndarray
    gamma: np.ndarray
    elastic: np.ndarray
    stress: np.ndarray


@dataclass(frozen=True)
class Peak:
    """Strength on a path: the parameter and Cauchy stress [MPa] at the peak, and W [MPa] and gamma there."""

    at: float
    stress: float
    W: float
    gamma: float


def _cauchy(material: Material, F: np.ndarray) -> np.ndarray:
    """Cauchy stress at J = 1 but for a pressure, (n, 3, 3)."""
    return np.einsum("niJ,nkJ->nik", material.first_piola(F), F)


def curve(material: Material, law: SinkLaw, path: Path, at: Sequence[float] | np.ndarray) -> Curve:
    """What `path` meets at the values `at` (n,) of its parameter."""
    s = np.asarray(at, float)
    F = path.gradient(material, s)
    W = material.energy(F)
    cauchy = _cauchy(material, F)
    elastic = cauchy[:, path.component[0], path.component[1]]
    if path.free is not None:
        elastic = elastic - cauchy[:, path.free, path.free]
    gamma = law.history(W)
    return Curve(s, W, gamma, elastic, gamma * elastic)


def extent(material: Material, law: SinkLaw, path: Path, gamma: float = 1e-3) -> float:
    """The value of the parameter of `path` at which `gamma` is left."""
    limit = law.phi * (-np.log(gamma)) ** (1 / law.m)

    def excess(strain: float) -> float:
        return float(material.energy(path.gradient(material, np.array([_at(path, strain)])))[0]) - limit

    most = 0.1
    while excess(most) < 0:
        most *= 1.5
    return _at(path, float(brentq(excess, 0.0, most, xtol=1e-12)))


def _at(path: Path, strain: float) -> float:
    return float(np.exp(strain)) if path.start == 1.0 else strain


def wave_speed_at_failure(material: Material, law: SinkLaw) -> float:
    """Speed of a transverse wave along the way of a crack, where W has come to Phi [m/s, of the undeformed body].

    The material is stretched in plane strain, the wave runs at right angles to that: sqrt(A_1212/rho0), A being dP/dF.
    Without fibres A_1212 = 2 dpsi/dI1. A law that stiffens has a faster one than c_s.
    """
    path = PATHS["plane strain"]
    F = path.gradient(material, np.array([extent(material, law, path, float(np.exp(-1)))]))
    return float(np.sqrt(material.modulus(F)[0, 0, 1, 0, 1] / material.rho0)) * 1e-3


def peaks(material: Material, law: SinkLaw) -> dict[str, Peak]:
    """The strength on each of `PATHS`: uniaxial, plane-strain and equibiaxial tension, simple shear."""
    return {name: peak_of(material, law, path) for name, path in PATHS.items()}


def peak_of(material: Material, law: SinkLaw, path: Path) -> Peak:
    """The strength on one path."""
    at = np.linspace(path.start, extent(material, law, path), 500)
    top = int(np.argmax(curve(material, law, path, at).stress))

    def weakness(s: float) -> float:
        return -float(curve(material, law, path, [s]).stress[0])

    bounds = at[top - 1], at[min(top + 1, len(at) - 1)]
    best = minimize_scalar(weakness, bounds=bounds, method="bounded", options={"xatol": 1e-10})
    there = curve(material, law, path, [best.x])
    return Peak(float(best.x), float(there.stress[0]), float(there.W[0]), float(there.gamma[0]))
