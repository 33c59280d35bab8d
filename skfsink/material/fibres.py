"""Soft tissue reinforced by two families of fibres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import ParameterError, require
from ..system.jit import njit
from .general import GeneralMaterial

__all__ = ["HolzapfelGasserOgden"]

STEEPEST = 40.0  #: exponent k2 E^2 up to which the energy of the fibres is exponential


@njit(cache=True)
def _hgo_law(I, c, psi, d, dd):  # type: ignore[no-untyped-def]
    half_c, k1, k2, kappa = 0.5 * c[0], c[1], c[2], c[3]
    along = 1.0 - 3.0 * kappa
    most = np.sqrt(STEEPEST / k2)
    for i in range(psi.size):
        psi[i] = half_c * (I[0, i] - 3.0)
        d[0, i] = half_c
        dd[0, 0, i] = 0.0
        for f in range(2, I.shape[0]):
            E = kappa * I[0, i] + along * I[f, i] - 1.0
            inside = min(max(E, 0.0), most)
            beyond = max(E, 0.0) - inside
            e = np.exp(k2 * inside * inside)
            slope = k1 * inside * e
            curvature = k1 * (1.0 + 2.0 * k2 * inside * inside) * e if E > 0.0 else 0.0
            psi[i] += 0.5 * k1 / k2 * (e - 1.0) + (slope + 0.5 * curvature * beyond) * beyond
            slope += curvature * beyond
            d[0, i] += kappa * slope
            d[f, i] = along * slope
            dd[0, 0, i] += kappa * kappa * curvature
            dd[0, f, i] = kappa * along * curvature
            dd[f, 0, i] = kappa * along * curvature
            dd[f, f, i] = along * along * curvature


@dataclass(frozen=True)
class HolzapfelGasserOgden(GeneralMaterial):
    """Arterial tissue of Gasser, Ogden and Holzapfel, J. R. Soc. Interface 3 (2006) 15-35.

        psi = c/2 (I1' - 3) + k1/(2 k2) sum_f [exp(k2 <E_f>^2) - 1],   E_f = kappa I1' + (1 - 3 kappa) I_f' - 1,

    with the squared stretch I_f' of each of two families of fibres at plus and minus `angle` to `axis`, in the plane
    of which `normal` is the normal. A family bears load only where its mean strain E_f is positive (<E> = max(E, 0)):
    there the energy is convex in F but for the factors J^(-2/3), and the stress is continuous where a family goes
    slack; its modulus jumps. Beyond k2 E^2 = 40 the energy goes on as a parabola in E, so that it stays finite at
    points that have lost their density. In plane strain the normal is z by default, and the fibres lie in the plane.

    The constants are the authors' for the adventitia of an iliac artery; `axis` is its circumference. Some programs
    take a c that multiplies I1' - 3: theirs is half of this one.

    Parameters
    ----------
    c: Shear modulus of the matrix [MPa], > 0.
    k1: Stiffness of the fibres [MPa], >= 0.
    k2: How fast they stiffen, > 0.
    kappa: Dispersion of their directions, 0 (all alike) to 1/3 (none preferred).
    angle: Of the families to the axis [degrees], 0 to 90.
    axis: Vector in the plane of the fibres, half-way between the families.
    normal: Vector across that plane; the part of `axis` along it is left out.
    """

    law = staticmethod(_hgo_law)

    c: float = 0.00764
    k1: float = 0.9966
    k2: float = 524.6
    kappa: float = 0.226
    angle: float = 49.98
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        require("c", self.c, "MPa", low=0, low_open=True)
        require("k1", self.k1, "MPa", low=0)
        require("k2", self.k2, low=0, low_open=True)
        require("kappa", self.kappa, low=0, high=1 / 3)
        require("angle", self.angle, "degrees", low=0, high=90)
        for name in ("axis", "normal"):
            value = getattr(self, name)
            if not isinstance(value, tuple | list) or len(value) != 3:
                raise ParameterError(f"{name} must be a vector of three numbers; got {value!r}")
            object.__setattr__(self, name, tuple(require(f"{name}[{i}]", x) for i, x in enumerate(value)))
            if not any(getattr(self, name)):
                raise ParameterError(f"{name} must not be the zero vector")
        if np.linalg.norm(np.cross(self.axis, self.normal)) < 1e-6 * np.linalg.norm(self.axis) * np.linalg.norm(
                self.normal):
            raise ParameterError(f"axis must not be parallel to normal; got {self.axis} and {self.normal}")

    @property
    def constants(self) -> np.ndarray:
        return np.array([self.c, self.k1, self.k2, self.kappa])

    def fibres(self, centres: np.ndarray) -> np.ndarray:
        """The same two directions everywhere, (n, 2, 3); :class:`.OrientedFibres` makes them depend on the place."""
        pair = self.families(np.array([self.axis], float), np.array([self.normal], float))
        return np.broadcast_to(pair[0], (len(centres), 2, 3))

    def families(self, axes: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Directions (n, 2, 3) at plus and minus `angle` to axes (n, 3) in the planes across normals (n, 3)."""
        n = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        axis = axes - (axes * n).sum(axis=1, keepdims=True) * n
        axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
        cos, sin = np.cos(np.radians(self.angle)), np.sin(np.radians(self.angle))
        return np.stack([cos * axis + sin * np.cross(n, axis), cos * axis - sin * np.cross(n, axis)], axis=1)

    @property
    def shear_modulus(self) -> float:
        """Initial shear modulus c + k1 (1 - 3 kappa)^2 sin^2(2 angle) [MPa], along the axis in the plane of the fibres.

        One family is pulled then. A shear that leaves both slack meets c alone.
        """
        return self.c + self.k1 * (1 - 3 * self.kappa) ** 2 * float(np.sin(np.radians(2 * self.angle))) ** 2
