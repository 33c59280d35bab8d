"""Closed forms of cavitation: the tension under which a small hole in a ball, a cylinder or a membrane grows
without bound.

Of an incompressible body whose hole has grown by the stretch a, with gamma = H at each point (no length l),

    p = int_b^a H(W) W'(s)/(s^n - 1) ds,     b^n - 1 = (a^n - 1) (A/B)^n,

n = 3 for a ball (W of s, s, s^-2), n = 2 for a cylinder in plane strain (s, 1, 1/s), A and B being the radii of hole
and body (Ball, Phil. Trans. R. Soc. A 306 (1982) 557-611, with the sink). The greatest p is the tension at
cavitation; of a neo-Hookean ball without end and without sink it is 5/2 mu. In a membrane the radial balance
(R s_r)' = s_t is integrated from the hole outwards.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from ..material import Material, SinkLaw

__all__ = ["MOST", "cavitation_pressure", "critical_membrane", "membrane_stress"]

MOST = 12.0  # stretch of the hole up to which is looked


def _shell(kind: str, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """I1, its derivative and the power n, of a ball or a cylinder at the hoop stretch s."""
    if kind == "ball":
        return 2 * s**2 + s**-4, 4 * s - 4 * s**-5, 3
    return 1 + s**2 + s**-2, 2 * s - 2 * s**-3, 2


def cavitation_pressure(material: Material, law: SinkLaw | None, kind: str, ratio: float = np.inf,
                        most: float = MOST) -> tuple[float, float]:
    """Greatest tension on the outside of a ball or cylinder [MPa], and the stretch of the hole there.

    `ratio` is that of the radii, B/A; without a `law` nothing fails. The hole is looked at up to the stretch `most`.
    """
    s = np.linspace(1.0, most, 200001)[1:]
    I1, slope, n = _shell(kind, s)
    psi, d, _ = material.isochoric(I1)
    H = 1.0 if law is None else law.history(psi)
    integrand = H * d * slope / (s**n - 1)
    total = np.concatenate([[0.0], np.cumsum(0.5 * (integrand[1:] + integrand[:-1]) * np.diff(s))])
    total += integrand[0] * (s[0] - 1.0)
    outer = (1 + (s**n - 1) / ratio**n) ** (1 / n)
    p = total - np.interp(outer, s, total, left=0.0)
    best = int(np.argmax(p))
    return float(p[best]), float(s[best])


def membrane_stress(material: Material, law: SinkLaw | None, hole: float, ratio: float = 200.0) -> tuple[float, float]:
    """Cauchy stress [MPa] and stretch at `ratio` radii from a hole in a membrane that has grown by the stretch `hole`.
    """
    def stresses(a: float, b: float) -> tuple[float, float]:
        """Nominal stresses of principal stretches a, b in the plane."""
        I1 = a * a + b * b + 1 / (a * b) ** 2
        psi, d, _ = (float(x) for x in material.isochoric(np.array(I1)))
        H = 1.0 if law is None else float(law.history(np.array([psi]))[0])
        c = 1 / (a * b) ** 2
        return 2 * H * d * (a - c / a), 2 * H * d * (b - c / b)

    def outwards(x: float, y: np.ndarray) -> list[float]:
        """Derivatives of both stretches by x = log R."""
        a, b = y
        e = 1e-6
        radial, hoop = stresses(a, b)
        by_a = (stresses(a + e, b)[0] - stresses(a - e, b)[0]) / (2 * e)
        by_b = (stresses(a, b + e)[0] - stresses(a, b - e)[0]) / (2 * e)
        return [(hoop - radial - by_b * (a - b)) / by_a, a - b]

    found = solve_ivp(outwards, (0.0, np.log(ratio)), [hole**-0.5, hole], rtol=1e-8, atol=1e-10)
    a, b = found.y[:, -1]
    return stresses(a, b)[0] * a, float(b)


def critical_membrane(material: Material, law: SinkLaw | None, ratio: float = 200.0,
                      most: float = MOST) -> tuple[float, float]:
    """Greatest Cauchy stress of a membrane far from its hole [MPa], and the stretch of the hole there.

    The hole is opened in steps up to the stretch `most`, or to where the stress falls.
    """
    best = (0.0, 1.0)
    for hole in np.arange(1.5, most, 0.05):
        with np.errstate(all="ignore"):
            stress = membrane_stress(material, law, float(hole), ratio)[0]
        if not stress > best[0]:
            break
        best = float(stress), float(hole)
    return best
