"""More mass for the smallest elements, so that the few at the tip of a notch do not shorten the explicit step of all.

An element by itself swings fastest where its volume changes, with

    omega_e^2 = c_d^2 n_a sum_a |b_a|^2,

b_a the mean gradient of the shape function of a node and n_a the number of nodes: about (2 c_d/h)^2 across its least
width h. The body's highest frequency is at most the greatest of these (Irons' theorem). Elements that together fill at
most a share of the volume get as much more mass as it takes to swing like the fastest of the others. Forces stay what
they are, and so do statics and the onset; the body is heavier there, and answers later.

Of a body of revolution the widths in the half plane count: a small radius makes no small element, and b_a is the mean
over the section, without the strain around the axis.
"""

from __future__ import annotations

import numpy as np

from ..fem.space import Space
from ..fields.momentum import Momentum

__all__ = ["raised_mass", "small_elements"]


def raised_mass(momentum: Momentum, share: float) -> tuple[np.ndarray | None, float]:
    """Factors >= 1 of the mass of the elements (ne, 1), None where all are 1; and what they add to that of the body.

    Parameters
    ----------
    momentum: the balance of momentum of the body.
    share: of the volume, that the elements with more mass may fill, in [0, 1).
    """
    if share == 0.0:
        return None, 0.0
    space, exchange = momentum.space, momentum.space.exchange
    factors = _ratios(momentum, share)[:, None]
    mass = momentum.rho0 * space.V[:, None]
    added = exchange.total(float((mass * (factors - 1)).sum())) / exchange.total(float(mass.sum()))
    return (factors, added) if added > 0.0 else (None, 0.0)


def small_elements(momentum: Momentum, share: float) -> np.ndarray:
    """Numbers (m,) of the elements that :func:`raised_mass` gives more mass."""
    return np.flatnonzero(_ratios(momentum, share) > 1.0)


def _ratios(momentum: Momentum, share: float) -> np.ndarray:
    """omega_e^2 of each element over that of the fastest that is not among the share, 1 at least (ne,)."""
    space, square = momentum.space, np.empty(momentum.space.n_elements)
    for material, elements, _ in momentum.parts:
        square[slice(None) if elements is None else elements] = material.dilatational_wave_speed**2
    b, exchange = _slopes(space), space.exchange
    square *= b.shape[1] * np.einsum("eai,eai->e", b, b)
    squares, V = exchange.all(square), exchange.all(space.V)
    fastest = np.argsort(-squares, kind="stable")
    count = np.count_nonzero(np.cumsum(V[fastest]) <= share * V.sum())
    ratio = square / squares[fastest[count]]
    return np.where(ratio > 1 + 1e-9, ratio, 1.0)


def _slopes(space: Space) -> np.ndarray:
    """Mean gradients of the shape functions (ne, na, dim) [1/mm], of a body of revolution over the section."""
    if not space.axisymmetric:
        return space.mean_slopes()
    area = space.w * space.around.sum(axis=2)  # the sum of N_a/R is 1/R
    slopes: np.ndarray = np.einsum("eq,eqai->eai", area, space.dN) / area.sum(axis=1)[:, None, None]
    return slopes
