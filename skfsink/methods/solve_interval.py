"""How often an explicit event solves for gamma."""

from __future__ import annotations

from ..fields.body import Body

__all__ = ["SolveInterval"]


class SolveInterval:
    """The interval between two solves for gamma.

    Parameters
    ----------
    body: the balances.
    every: steps between solves, >= 1; 0 takes as many as fit in `longest`, fewer where waves at failure are fast.

    Attributes
    ----------
    longest: longest time between solves, and longest step, by the waves of the undeformed body [s].
    stiffening: by how much waves at failure shorten it, >= 1.
    """

    SHARE = 0.03  # l/c_s between solves; the crack then runs less than 3 % of l
    STIFFENING = 4 / 3  # waves at failure faster than this times c_s, as in the tissue, make them more frequent
    MOST = 10  # steps between them at the most, lest a failing element that shortens the step keeps failing

    def __init__(self, body: Body, every: int) -> None:
        self._every, shear = every, body.momentum.shear_wave_speeds[1]
        self.longest = self.SHARE * body.density.law.length_scale / (shear * 1e3)
        self.stiffening = max(1.0, body.wave_speed_at_failure / shear / self.STIFFENING)

    def steps(self, dt: float) -> int:
        """Steps of `dt` [s] between solves."""
        return self._every or min(max(1, int(self.longest / self.stiffening / dt)), self.MOST)
