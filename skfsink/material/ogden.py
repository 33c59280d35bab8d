"""Ogden's law, a sum of powers of the principal stretches, as a function of I1' and I2'.

The squares x_i of the isochoric stretches are the roots of  P(x) = x^3 - I1' x^2 + I2' x - 1,  so that
psi = sum_i g(x_i),  g(x) = sum_p mu_p/alpha_p (x^(alpha_p/2) - 1),  is a function of I1' and I2' alone. It is smooth
where stretches are equal, though the stretches themselves are not: with G(x) = x g'(x) and divided differences,

    psi_1  = (x G)[x1, x2, x3],                psi_2  = -G[x1, x2, x3],
    psi_11 = (x^3 G)[x1, x1, x2, x2, x3, x3],  psi_12 = -(x^2 G)[...],  psi_22 = (x G)[...]

(derivatives of the integral of g P'/P around the roots). They are found without a difference of nearly equal numbers:

- near the undeformed body from the series of g at x = 1, whose sums over the roots follow from I1' and I2' by
  recursion, without roots;
- else from the root a that is alone and the pair b, c = M +- sqrt(D), D < 0 at crushed points, whose invariants belong
  to no deformation. What the pair has part in is even in sqrt(D): the cubic  T(x) = rho + r (x - M) + Q(x) [sigma +
  s (x - M)],  Q(x) = (x - M)^2 - D,  that has the values and slopes of G at b and c. Of equal ones it is a series in D.

The largest root is alone if I1' >= I2', and otherwise the largest of 1/x_i, with I1' and I2' exchanged and -alpha_p.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ParameterError, require
from ..system.jit import njit
from .general import GeneralMaterial

__all__ = ["Ogden"]

TERMS = 31      #: of the series about the undeformed body
NEAR = 0.02     #: I1' - 3 and I2' - 3 up to which it is used; squared stretches differ from 1 by less than 0.19
PAIR = 0.02     #: D/M^2 up to which a pair is a series
STEEPEST = 10.0  #: greatest |alpha|/2: with 31 terms the series is right to rounding

#: the loops that call a law know no errors
QUIET: dict[str, Any] = {"error_model": "numpy", "fastmath": {"contract", "arcp", "nsz"}}


@njit(**QUIET)
def _near(i1, i2, series):  # type: ignore[no-untyped-def]
    """psi, psi_1, psi_2, psi_11, psi_12, psi_22 at I1' - 3 and I2' - 3, from the coefficients of g and x^n G at x = 1.

    The roots x = 1 + u have the symmetric functions e of u; p are sums of their powers, h and hh the divided
    differences of powers of u at the roots, and at the roots twice.
    """
    e1, e2, e3 = i1, i2 - 2.0 * i1, i1 - i2
    psi, d1, d2, d11, d12, d22 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    p1, p2, p3 = 3.0, 0.0, 0.0             # of the last three powers
    h1, h2, h3, hh1, hh2, hh3 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(1, TERMS):
        if k == 1:
            p = e1
        elif k == 2:
            p = e1 * p1 - 2.0 * e2
        else:
            p = e1 * p1 - e2 * p2 + e3 * p3
        p3, p2, p1 = p2, p1, p
        psi += series[0, k] * p
        h = 1.0 if k == 2 else e1 * h1 - e2 * h2 + e3 * h3
        h3, h2, h1 = h2, h1, h
        d1 += series[2, k] * h
        d2 -= series[1, k] * h
        if k + 3 < TERMS:  # h of the power k - 2, with the power k + 3 of a function
            hh = h + e1 * hh1 - e2 * hh2 + e3 * hh3
            hh3, hh2, hh1 = hh2, hh1, hh
            d11 += series[4, k + 3] * hh
            d12 -= series[3, k + 3] * hh
            d22 += series[2, k + 3] * hh
        if k > 4 and abs(p1) + abs(p2) + abs(p3) + abs(hh1) + abs(hh2) + abs(hh3) < 1e-18:
            break
    return psi, d1, d2, d11, d12, d22


@njit(**QUIET)
def _alone(I1, I2):  # type: ignore[no-untyped-def]
    """Largest root of x^3 - I1 x^2 + I2 x - 1 for I1 >= I2, by Halley's method.

    It begins at (I1 + 2 s c)/3, s^2 = I1^2 - 3 I2, with 4 c^3 - 3 c = r, of which the cubic is right to 1e-4 for r of 0
    to 1, where the two other roots are real; and not below 1, where the polynomial is I2 - I1.
    """
    s = np.sqrt(max(I1 * I1 - 3.0 * I2, 1e-60))
    r = ((2.0 * I1 * I1 - 9.0 * I2) * I1 + 27.0) / (2.0 * s * s * s)
    r = max(min(r, 2.0), 0.0)
    x = max((I1 + 2.0 * s * (0.8660254 + r * (1.0 / 6.0 + r * (0.0098286 * r - 0.0425206)))) / 3.0, 1.0)
    for _ in range(20):
        P, slope = ((x - I1) * x + I2) * x - 1.0, (3.0 * x - 2.0 * I1) * x + I2
        step = P * slope / (slope * slope - P * (3.0 * x - I1))
        x -= step
        if abs(step) < 1e-6 * x:  # the error left is of the order of its cube
            break
    return x


@njit(**QUIET)
def _equal(e, inverse, q):  # type: ignore[no-untyped-def]
    """rho, r, sigma, s of (x/M)^e for a pair that is nearly equal, from the series in q = D/M^2; `inverse` is 1/M."""
    rho, r, sigma, s, even, power, before = 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0
    for j in range(10):                     # `before` is q^(j - 1)
        odd = even * (e - 2 * j) / (2 * j + 1)    # binomials of 2 j + 1, and of 2 j
        rho += even * power
        r += odd * power
        sigma += j * even * before
        s += j * odd * before
        before = power
        power *= q
        even = odd * (e - 2 * j - 1) / (2 * j + 2)
        if abs(before) < 1e-18:
            break
    return rho, r * inverse, sigma * inverse * inverse, s * inverse * inverse * inverse


@njit(**QUIET)
def _far(I1, I2, exponents, weights, sign):  # type: ignore[no-untyped-def]
    """What :func:`_near` gives, for I1 >= I2, of  sum_p weight_p sum_i (x_i^e_p - 1),  e_p = sign exponent_p."""
    a = _alone(I1, I2)
    product = 1.0 / a                      # b c
    M = 0.5 * product * (I2 - product)
    D = M * M - product
    X = a - M
    Q = 1.0 / (X * X - D)
    log_a = np.log(a)
    equal = M > 0.0 and abs(D) < PAIR * M * M
    half = np.sqrt(abs(D))
    inverse = 1.0 / M if equal else 0.5 / half
    b = M + half                           # of a pair that is complex only in name
    inverse_b = 1.0 / b
    first = np.log(M) if equal else np.log(b) if D > 0.0 else np.arctan2(half, M)
    psi, f, df, rho, r, sigma, s = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for p in range(exponents.size):
        e = sign * exponents[p]
        A = np.exp(e * log_a)
        if equal:
            B = np.exp(e * first)
            mean, r_p, sigma_p, s_p = _equal(e, inverse, D * inverse * inverse)
            mean, r_p, sigma_p, s_p = B * mean, B * r_p, B * sigma_p, B * s_p
        elif D > 0.0:
            B = np.exp(e * first)
            C = 1.0 / (A * B)              # a b c = 1
            db, dc = e * B * inverse_b, e * C * (b * a)
            mean, r_p, sigma_p = 0.5 * (B + C), (B - C) * inverse, 0.5 * (db - dc) * inverse
            s_p = (db + dc - 2.0 * r_p) * inverse * inverse
        else:                              # M +- i half, with the modulus a^(-1/2)
            B = 1.0 / np.sqrt(A)
            slope = e * B * np.sqrt(a)
            mean, r_p = B * np.cos(e * first), 2.0 * B * np.sin(e * first) * inverse
            sigma_p = slope * np.sin((e - 1.0) * first) * inverse
            s_p = -2.0 * (slope * np.cos((e - 1.0) * first) - r_p) * inverse * inverse
        psi += weights[p] * (A + 2.0 * mean - 3.0)
        g = weights[p] * e                 # G = x g'
        f += g * A
        df += g * e * A * product
        rho += g * mean
        r += g * r_p
        sigma += g * sigma_p
        s += g * s_p
    d1, d2, d11, d12, d22 = 0.0, 0.0, 0.0, 0.0, 0.0
    for n in range(4):                     # of x^n G
        once = (f - rho - r * X) * Q                                # [a, b, c]
        slope = (df - r - 2.0 * X * once) * Q                       # [a, a, b, c]
        twice = (slope - s - 2.0 * X * (once - sigma - s * X) * Q) * Q
        if n == 0:
            d2 = -once
        elif n == 1:
            d1, d22 = once, twice
        elif n == 2:
            d12 = -twice
        else:
            d11 = twice
        f, df = a * f, f + a * df
        rho, r, sigma, s = M * rho + D * r, rho + M * r, r + D * s + M * sigma, sigma + M * s
    return psi, d1, d2, d11, d12, d22


@njit(cache=True, **QUIET)
def _ogden_law(I, c, psi, d, dd):  # type: ignore[no-untyped-def]
    n = int(c[0])
    exponents, weights, series = c[1:1 + n], c[1 + n:1 + 2 * n], c[1 + 2 * n:].reshape(5, TERMS)
    for i in range(psi.size):
        I1, I2 = I[0, i], I[1, i]
        if abs(I1 - 3.0) < NEAR and abs(I2 - 3.0) < NEAR:
            psi[i], d[0, i], d[1, i], dd[0, 0, i], dd[0, 1, i], dd[1, 1, i] = _near(I1 - 3.0, I2 - 3.0, series)
        elif I1 >= I2:
            psi[i], d[0, i], d[1, i], dd[0, 0, i], dd[0, 1, i], dd[1, 1, i] = _far(I1, I2, exponents, weights, 1.0)
        else:
            psi[i], d[1, i], d[0, i], dd[1, 1, i], dd[0, 1, i], dd[0, 0, i] = _far(I2, I1, exponents, weights, -1.0)
        dd[1, 0, i] = dd[0, 1, i]


@dataclass(frozen=True)
class Ogden(GeneralMaterial):
    """Ogden's law of the principal stretches (Proc. R. Soc. Lond. A 326 (1972) 565-584).

        psi = sum_p mu_p/alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3),   l_i = J^(-1/3) lambda_i,

    of as many terms as `mu` and `alpha` have numbers. The shear modulus of the undeformed material is
    1/2 sum_p mu_p alpha_p. With every mu_p alpha_p > 0 the energy is convex in the logarithms of the stretches. With
    alpha = 2 it is the neo-Hookean law, with 2 and -2 that of Mooney and Rivlin. The constants are attributed to the
    author's fit to Treloar's vulcanised rubber, unverified.

    Parameters
    ----------
    mu: One number for each term [MPa], of the sign of its alpha.
    alpha: Exponents, not 0, from -20 to 20.
    """

    law = staticmethod(_ogden_law)

    mu: tuple[float, ...] = (0.63, 0.0012, -0.01)
    alpha: tuple[float, ...] = (1.3, 5.0, -2.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, unit, most in (("mu", "MPa", np.inf), ("alpha", "", 2 * STEEPEST)):
            value = getattr(self, name)
            values = tuple(value) if isinstance(value, tuple | list) else (value,)
            object.__setattr__(self, name, tuple(require(f"{name}[{i}]", x, unit, low=-most, high=most)
                                                 for i, x in enumerate(values)))
        if len(self.mu) != len(self.alpha) or not self.mu:
            raise ParameterError(f"ogden needs one mu and one alpha for each term; got {len(self.mu)} mu and "
                                 f"{len(self.alpha)} alpha: give both")
        for i, (mu, alpha) in enumerate(zip(self.mu, self.alpha)):
            if not mu * alpha > 0.0:
                raise ParameterError(f"mu[{i}] and alpha[{i}] of ogden must have the same sign, and not be 0, or the "
                                     f"law softens by itself; got {mu:g} MPa and {alpha:g}: leave that term out, or "
                                     "fit again")

    @property
    def constants(self) -> np.ndarray:
        exponents, mu = np.array(self.alpha) / 2, np.array(self.mu)
        weights, binomial = mu / (2 * exponents), np.ones_like(mu)
        series = np.zeros((5, TERMS))      # coefficients of g, then of x^n G, at x = 1
        for k in range(TERMS):
            series[0, k], series[1, k] = binomial @ weights, binomial @ mu / 2
            binomial = binomial * (exponents - k) / (k + 1)
        for n in range(2, 5):
            series[n] = series[n - 1]
            series[n, 1:] += series[n - 1, :-1]
        return np.concatenate([[len(mu)], exponents, weights, series.ravel()])
