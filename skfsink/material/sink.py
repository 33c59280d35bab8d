"""The sink law: how the relative density falls as the stored energy grows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import gamma as gamma_function
from scipy.special import gammaincc

from ..errors import require
from ..system.jit import njit

__all__ = ["SinkLaw"]


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
        require("length_scale", self.length_scale, "mm", low=0, low_open=True)
        require("epsilon", self.epsilon, low=0, high=1e-3, low_open=True)

    def history(self, W: Any) -> np.ndarray:
        """H = exp(-(W/Phi)^m) of Eq. (10). H falls as W grows, so the least H is that of the greatest W."""
        W = np.asarray(W, float)
        H = np.empty(W.size)
        m = int(self.m) if float(self.m).is_integer() else self.m  # integer powers are products, five times as fast
        _history(W.ravel(), 1 / self.phi, m, float(np.exp(-40 / self.m)), H)
        return H.reshape(W.shape)

    def coefficients(self, W: np.ndarray) -> np.ndarray:
        """Coefficients 1/(H + eps) of the sink in Eq. (9) for the greatest stored energy W [MPa], of the same shape."""
        H = self.history(W)
        H += self.epsilon
        return np.divide(1.0, H, out=H)

    @property
    def failure_energy(self) -> float:
        """Energy of a volume element taken to failure, psi_f = Phi Gamma(1/m, 0)/m [MPa] (Eq. 30)."""
        return self.phi / self.m * float(gamma_function(1 / self.m) * gammaincc(1 / self.m, 0.0))
