"""Loading from rest: the unloaded body is set in motion by its grips, and its dynamics followed to the onset.

Waves cross the body thousands of times while slow grips load it, so that the explicit scheme would take 10^9 steps. The
implicit one takes steps as long as the two fields converge in them, and those that do not are halved: first with the
distance to the limit load, then with the growth of the instability. When the body moves much faster than its grips, the
event begins: state, velocities and accelerations are handed over.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..errors import ParameterError
from ..fields.body import Body
from ..fields.crack import CRACKED
from ..fields.state import State
from .controls import HHTControls
from .hht import HHT

__all__ = ["LoadingFromRest"]


class LoadingFromRest:
    """Brings a state from rest to the onset by the implicit scheme.

    Parameters
    ----------
    body: the balances, and grips without ramps.
    controls: options of the event; damping and mass are taken from it.

    Attributes
    ----------
    integrator: the implicit scheme, whose memory belongs into a checkpoint.
    """

    INCREMENT = 0.002    # largest step, as displacement of a grip over the size of the body
    TOLERANCE = 1e-4     # of forces and of gamma: what is left is the kick the event begins with
    ITERATIONS = 200     # the coupling of the fields converges ever more slowly towards the limit load
    FAST = 100.0         # speed at which the event begins, in speeds of a grip; a body under load has a few

    def __init__(self, body: Body, controls: HHTControls) -> None:
        speed = body.loading.speed(0.0)
        if not speed > 0.0:
            raise ParameterError("start rest needs a grip that moves from the beginning on; all of them are still: "
                                 "give one a velocity, or take start onset")
        self._body, self._fast = body, self.FAST * speed
        longest = max(self.INCREMENT * body.size / speed, 2 * controls.dt)
        self._last = controls.dt
        self.integrator = HHT(body, replace(
            controls, coupling="iterated", dt=longest, dt_first=0.0, force_tolerance=self.TOLERANCE,
            correction_tolerance=2 * self.TOLERANCE, gamma_tolerance=self.TOLERANCE, gain_tolerance=1.0,
            max_iterations=self.ITERATIONS),
            to_onset=True)

    @property
    def increment(self) -> float:
        """The next step [s]."""
        return self.integrator.dt

    def load(self, state: State) -> Iterator[State]:
        """Load `state` to the onset, yielding it after each step; the last one is the onset."""
        if state.step == 0:
            self.integrator.begin(state)
            state.a[...] = 0.0  # nothing pulls yet; rounding of forces over the masses of small elements would stay
        # under fast grips the body cracks before it is faster than they are
        while (self.integrator.dt > self._last and float(np.abs(state.v).max()) < self._fast
               and self._body.kept(state.gamma).min() >= CRACKED):
            self.integrator.step(state)
            yield state
