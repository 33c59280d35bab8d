"""The invariants of a thin sheet, whose stretch lambda across it is free.

With t = F:F, j = det F and q_f = |F A_f|^2 of the plane, A_f being the directions of fibres in it, J = j lambda and
z = log J^(1/3),

    I1' = p + s,   I2' = p s + 1/s,   I_f' = q_f e^(-2 z),      p = t e^(-2 z),   s = e^(4 z)/j^2.

They are functions of v = (t, j, q_f) and z. In z each is a sum of exponentials. An energy psi(I1', I2', I_f') +
k/2 (J - 1)^2 has no stress across the sheet where its derivative with z vanishes; at that z its derivatives with v are
those of the energy of the sheet, and W_bc - W_bz W_cz/W_zz the second ones.
"""

from __future__ import annotations

import numpy as np

__all__ = ["SheetInvariants"]


class SheetInvariants:
    """The invariants (m, ...) of a sheet with the volume ratio J (...), and their derivatives.

    Parameters
    ----------
    t, j, J: F:F and det F > 0 of the plane, and the volume ratio, (...).
    along: q_f, (families, ...).

    Attributes
    ----------
    values: I1', I2', I_f', (m, ...).   plane: derivatives with v, (m, m, ...), those of an invariant in a row.
    across, curved: first and second derivatives with z, (m, ...).
    """

    def __init__(self, t: np.ndarray, j: np.ndarray, J: np.ndarray, along: np.ndarray) -> None:
        R = J ** (-2 / 3)
        p, s = t * R, 1 / (R * j) ** 2
        o, q, zero = 1 / s, along * R, np.zeros_like(p)
        self._p, self._s, self._o, self._R, self._j = p, s, o, R, j
        self.values = np.stack([p + s, p * s + o, *q])
        self.across = np.stack([4 * s - 2 * p, 2 * p * s - 4 * o, *(-2 * q)])
        self.curved = np.stack([16 * s + 4 * p, 4 * p * s + 16 * o, *(4 * q)])
        self.plane = self._square([R, s * R], [-2 * s / j, 2 * (o - p * s) / j], R, zero)

    def _square(self, t: list[np.ndarray], j: list[np.ndarray], q: np.ndarray, zero: np.ndarray) -> np.ndarray:
        """A matrix (m, m, ...) with columns for t and j of the first two rows, and q on the diagonal of the others."""
        m = len(self.values)
        out = np.zeros((m, m, *zero.shape))
        out[:2, 0], out[:2, 1] = t, j
        for f in range(2, m):
            out[f, f] = q
        return out

    def mixed(self) -> np.ndarray:
        """Second derivatives with v and z, (m, m, ...)."""
        p, s, o, R, j = self._p, self._s, self._o, self._R, self._j
        return self._square([-2 * R, 2 * s * R], [-8 * s / j, -(4 * p * s + 8 * o) / j], -2 * R, np.zeros_like(p))

    def second(self) -> np.ndarray:
        """Second derivatives with v, (m, m, m, ...)."""
        p, s, o, R, j = self._p, self._s, self._o, self._R, self._j
        m = len(self.values)
        out = np.zeros((m, m, m, *p.shape))
        out[0, 1, 1], out[1, 1, 1] = 6 * s / j**2, (6 * p * s + 2 * o) / j**2
        out[1, 0, 1] = out[1, 1, 0] = -2 * s * R / j
        return out
