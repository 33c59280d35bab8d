"""The load time, the clock of the loading: how far a body has been loaded, and how far an increment may go."""

from __future__ import annotations

import numpy as np

from ..loads.schedule import Loading

__all__ = ["LoadTime"]


class LoadTime:
    """Increments of the load time of a body.

    Parameters
    ----------
    loading: what moves and pulls.
    size: greatest extent of the body [mm].
    shear_modulus: of its material [MPa].
    increment: the largest one, as displacement of a grip over the size of the body, or as change of a traction over
        twice the shear modulus.
    """

    def __init__(self, loading: Loading, size: float, shear_modulus: float, increment: float) -> None:
        self.loading, self.size, self.shear_modulus, self.increment = loading, size, shear_modulus, increment

    def longest(self, t: float) -> float:
        """The largest increment from load time `t` on, infinity if nothing moves up to the next knot [s]."""
        speed, pull, increment = self.loading.speed(t), self.loading.pull(t), self.increment
        by_grips = increment * self.size / speed if speed > 0.0 else np.inf
        return min(by_grips, increment * 2.0 * self.shear_modulus / pull if pull > 0.0 else np.inf)

    def way(self, t: float) -> float:
        """Length of the way to load time `t`, in the largest increments; the measure of the load."""
        total, start = 0.0, 0.0
        while start < t:
            end = min(self.loading.knot(start), t)
            total += (end - start) / self.longest(start)
            start = end
        return total

    def age(self, t: float) -> float:
        """Time the way to load time `t` would have taken at the rates from `t` on: `t` itself without ramps [s]."""
        return self.way(t) * self.longest(t) if self.loading.knots else t

    def grown(self, t: float, share: float) -> float:
        """The load time at which the load has grown by `share` since load time `t` [s].

        No later than the next knot at which something that moves turns back, or from which on nothing moves.
        """
        if not self.loading.knots:
            return t * (1.0 + share)
        longest, end = self.longest(t), t + share * self.age(t)
        left = share * self.way(t)  # in the largest increments
        rates = self.loading.rates(t)
        while end > (knot := self.loading.knot(t)):
            left -= (knot - t) / longest
            longest, following = self.longest(knot), self.loading.rates(knot)
            if longest == np.inf or (following * rates < 0.0).any():
                return knot
            t, end, rates = knot, knot + left * longest, np.where(following == 0.0, rates, following)
        return end

    def end(self, t: float, increment: float) -> float:
        """Load time after an increment from `t` on: no later than the next knot, which is hit exactly [s]."""
        knot = self.loading.knot(t)
        return knot if knot - t <= 1.001 * increment else t + increment
