"""Stored energies of several invariants: I1', I2' and the squared stretches of fibres, in this order.

    W = k/2 (J - 1)^2 + psi(I1', I2', I4', I6', ...),      I1' = J^(-2/3) tr C,   I2' = J^(-4/3) |cof F|^2,
    I4' = J^(-2/3) |F A|^2   for the first family of fibres, with the direction A before deformation, I6' the second.

An invariant X' = J^(-p) X has, with G = F^-T,

    dX'/dF = J^(-p) (X_F - p X G),
    d2X'/dFdF = J^(-p) [X_FF - p (X_F G + G X_F) + p^2 X G G + p X G_iL G_kJ],

from which stress and modulus follow by the chain rule. The element loops (:mod:`skfsink.kernels.general`) do the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ..errors import require
from ..system.jit import njit
from .base import Material
from .compiled import GENERAL_LAW, CompiledLaw
from .crushed import crushed
from .sheet import SheetInvariants

__all__ = ["GeneralMaterial", "MooneyRivlin"]


@dataclass(frozen=True)
class GeneralMaterial(Material):
    """Nearly incompressible solid, W = k/2 (J - 1)^2 + psi(I1', I2', I4', ...); `law` is of type `GENERAL_LAW`.

    `fibres` gives the directions of its families; there are none unless a class says so.
    """

    law: ClassVar[Callable[..., None]]

    @cached_property
    def compiled_law(self) -> CompiledLaw:
        """`law` as the element loops take it."""
        return CompiledLaw(type(self).law, GENERAL_LAW)

    def fibres(self, centres: np.ndarray) -> np.ndarray:
        """Unit directions (n, families, 3) of the undeformed fibres at the points `centres` (n, dim) [mm]."""
        return np.zeros((len(centres), 0, 3))

    def isochoric(self, invariants: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """psi (...), its gradient (m, ...) and second derivatives (m, m, ...) [MPa] at `invariants` (m, ...)."""
        I = np.asarray(invariants, float)
        flat = np.ascontiguousarray(I.reshape(len(I), -1))
        m, n = flat.shape
        psi, d, dd = np.zeros(n), np.zeros((m, n)), np.zeros((m, m, n))
        type(self).law(flat, self.constants, psi, d, dd)
        return psi.reshape(I.shape[1:]), d.reshape(I.shape), dd.reshape(m, *I.shape)

    def _directions(self, fibres: np.ndarray | None) -> np.ndarray:
        return self.fibres(np.zeros((1, 3)))[0] if fibres is None else fibres

    def _invariants(self, F: np.ndarray, fibres: np.ndarray | None, floor: float) -> _Invariants:
        return _Invariants(F, self._directions(fibres), floor)

    def energy(self, F: np.ndarray, J_bar: Any = None, fibres: np.ndarray | None = None) -> np.ndarray:
        """Stored energy W [MPa]; `F` is (..., 3, 3), `J_bar` (...) replaces J in the volumetric part.

        `fibres` (..., families, 3) are other directions than those at the origin.
        """
        J = np.linalg.det(F)
        psi, _, _ = self.isochoric(self._invariants(F, fibres, 0.0).values)
        return psi + 0.5 * self.bulk_modulus * ((J if J_bar is None else J_bar) - 1) ** 2

    def isochoric_energy(self, F: np.ndarray, floor: float = 0.0, fibres: np.ndarray | None = None) -> np.ndarray:
        """Stored energy psi alone [MPa], (...); a point with J below `floor` is crushed."""
        return self.isochoric(self._invariants(F, fibres, floor).values)[0]

    def isochoric_stress(self, F: np.ndarray, floor: float = 0.0, fibres: np.ndarray | None = None) -> np.ndarray:
        """First Piola-Kirchhoff stress of psi alone [MPa], (..., 3, 3); a point with J below `floor` is crushed."""
        found = self._invariants(F, fibres, floor)
        _, d, _ = self.isochoric(found.values)
        return np.einsum("m...,m...iJ->...iJ", d, found.first)

    def isochoric_modulus(self, F: np.ndarray, floor: float = 0.0, fibres: np.ndarray | None = None) -> np.ndarray:
        """Tangent modulus of psi alone [MPa], indices iJkL; a point with J below `floor` is crushed."""
        found = self._invariants(F, fibres, floor)
        _, d, dd = self.isochoric(found.values)
        return (np.einsum("mn...,m...iJ,n...kL->...iJkL", dd, found.first, found.first)
                + np.einsum("m...,m...iJkL->...iJkL", d, found.second()))

    def first_piola(self, F: np.ndarray, fibres: np.ndarray | None = None) -> np.ndarray:
        """First Piola-Kirchhoff stress of the undamaged material, P0 = dW/dF [MPa]; (..., 3, 3)."""
        J = np.linalg.det(F)[..., None, None]
        return self.isochoric_stress(F, 0.0, fibres) + self.bulk_modulus * (J - 1) * cofactor(F)

    def modulus(self, F: np.ndarray, fibres: np.ndarray | None = None) -> np.ndarray:
        """Tangent modulus A = d2W/dFdF [MPa] of the undamaged material, indices iJkL; (..., 3, 3, 3, 3)."""
        J = np.linalg.det(F)[..., None, None, None, None]
        G = np.swapaxes(np.linalg.inv(F), -1, -2)
        return (self.isochoric_modulus(F, 0.0, fibres)
                + self.bulk_modulus * ((2 * J - 1) * J * outer(G, G) - (J - 1) * J * crossed(G)))

    def along(self, F: np.ndarray, fibres: np.ndarray | None) -> np.ndarray:
        """Squared stretches (families, ...) of `fibres` (..., families, 3) in a plane deformed by F (..., 2, 2)."""
        pulled = np.einsum("...iJ,...fJ->f...i", F, self._directions(fibres)[..., :2])
        return np.einsum("f...i,f...i->f...", pulled, pulled)

    def _across(self, t: np.ndarray, j: np.ndarray, J: np.ndarray, along: np.ndarray | None) -> np.ndarray:
        found = SheetInvariants(t, j, J, np.zeros((0, *t.shape)) if along is None else along)
        return np.asarray(np.einsum("m...,m...", self.isochoric(found.values)[1], found.across) / 3)

    @property
    def shear_modulus(self) -> float:
        """Shear modulus of the undeformed material without its fibres, mu = 2 (psi_1 + psi_2) [MPa]."""
        I = np.ones(2 + len(self._directions(None)))
        I[:2] = 3.0
        return 2 * float(self.isochoric(I)[1][:2].sum())


def outer(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a_iJ b_kL."""
    return np.einsum("...iJ,...kL->...iJkL", a, b)


def crossed(G: np.ndarray) -> np.ndarray:
    """G_iL G_kJ."""
    return np.einsum("...iL,...kJ->...iJkL", G, G)


def cofactor(F: np.ndarray) -> np.ndarray:
    """cof F (..., 3, 3), also where F is singular."""
    out = np.empty_like(F)
    for i in range(3):
        b, c = (i + 1) % 3, (i + 2) % 3
        for k in range(3):
            m, n = (k + 1) % 3, (k + 2) % 3
            out[..., i, k] = F[..., b, m] * F[..., c, n] - F[..., b, n] * F[..., c, m]
    return out


class _Invariants:
    """The invariants (m, ...) at F (..., 3, 3), and their first and second derivatives."""

    def __init__(self, F: np.ndarray, fibres: np.ndarray, floor: float) -> None:
        self._F, self._fibres = F, fibres
        J, cof = np.linalg.det(F), cofactor(F)
        J, s, J_e = crushed(J, floor)
        self._G = cof / J_e[..., None, None]
        self._C = np.einsum("...iJ,...iL->...JL", F, F)
        tr = np.einsum("...JJ", self._C)[..., None, None]
        plain = [tr[..., 0, 0], np.einsum("...iJ,...iJ", cof, cof)]
        slopes = [2 * F, 2 * (tr * F - F @ self._C)]
        for f in range(fibres.shape[-2]):
            A = fibres[..., f, :]
            n = np.einsum("...iJ,...J->...i", F, A)
            plain.append(np.einsum("...i,...i", n, n))
            slopes.append(2 * np.einsum("...i,...J->...iJ", n, np.broadcast_to(A, n.shape)))
        self._plain, self._slopes = plain, slopes
        self._p = [4 / 3 if m == 1 else 2 / 3 for m in range(len(plain))]
        self._scale = [J ** -p * s ** (1.5 * p) for p in self._p]
        self.values = np.stack([s * X for s, X in zip(self._scale, plain)])
        grow = (..., None, None)
        self.first = np.stack([s[grow] * (slope - p * X[grow] * self._G) for s, slope, p, X in
                               zip(self._scale, slopes, self._p, plain)])

    def second(self) -> np.ndarray:
        """Second derivatives, (m, ..., 3, 3, 3, 3)."""
        F, G, C, I = self._F, self._G, self._C, np.eye(3)
        unit = np.einsum("ik,JL->iJkL", I, I)
        tr = self._plain[0][..., None, None, None, None]
        curved: list[Any] = [2 * unit, 2 * (
            2 * outer(F, F) + tr * unit - np.einsum("ik,...JL->...iJkL", I, C)
            - np.einsum("...iL,...kJ->...iJkL", F, F) - np.einsum("...iM,...kM,JL->...iJkL", F, F, I))]
        for f in range(self._fibres.shape[-2]):
            A = self._fibres[..., f, :]
            curved.append(2 * np.einsum("ik,...J,...L->...iJkL", I, A, A))
        GG, GxG, grow = outer(G, G), crossed(G), (...,) + (None,) * 4
        return np.stack([s[grow] * (X_FF - p * (outer(X_F, G) + outer(G, X_F)) + X[grow] * (p**2 * GG + p * GxG))
                         for s, X_FF, p, X_F, X in zip(self._scale, curved, self._p, self._slopes, self._plain)])


@njit(cache=True)
def _mooney_rivlin_law(I, c, psi, d, dd):  # type: ignore[no-untyped-def]
    for i in range(psi.size):
        psi[i] = c[0] * (I[0, i] - 3.0) + c[1] * (I[1, i] - 3.0)
        d[0, i] = c[0]
        d[1, i] = c[1]


@dataclass(frozen=True)
class MooneyRivlin(GeneralMaterial):
    """Mooney (1940) and Rivlin (1948): psi = c1 (I1' - 3) + c2 (I2' - 3); the shear modulus is 2 (c1 + c2).

    The constants are attributed to a fit to Treloar's vulcanised rubber (Marckmann and Verron, Rubber Chem. Technol. 79
    (2006) 835-858), unverified; his uniaxial curve is met within 17 % at stretches of 1.1 to 5.4.

    Parameters
    ----------
    c1: First constant [MPa], > 0.
    c2: Second constant [MPa], >= 0.
    """

    law = staticmethod(_mooney_rivlin_law)

    c1: float = 0.162
    c2: float = 0.0059

    def __post_init__(self) -> None:
        super().__post_init__()
        require("c1", self.c1, "MPa", low=0, low_open=True)
        require("c2", self.c2, "MPa", low=0)

    @property
    def constants(self) -> np.ndarray:
        return np.array([self.c1, self.c2])
