"""What has failed stays failed: bodies that are loaded, unloaded and loaded again, by each method."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from bodies import ends, notched

from skfsink.fields.body import Body
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.fields.state import State
from skfsink.loads.grips import Grip, Ramp
from skfsink.loads.schedule import Loading
from skfsink.material import AAA, SinkLaw
from skfsink.methods.controls import ExplicitControls, HHTControls, StaticsControls
from skfsink.methods.explicit import Explicit
from skfsink.methods.hht import HHT
from skfsink.methods.statics import Statics

ONSET = 0.1185  # opening of the plate at its onset [mm]
SCHEMES: dict[str, Callable[[Body], Explicit | HHT]] = {
    "explicit": lambda body: Explicit(body, ExplicitControls()),
    "hht": lambda body: HHT(body, HHTControls(dt=2e-7)),
    "hht, single pass": lambda body: HHT(body, HHTControls(dt=2e-7, coupling="single")),
}


def pulled(times: tuple[float, ...], openings: tuple[float, ...]) -> Body:
    """A notched plate whose upper end moves by `openings` [mm] at load `times` [s]; the lower one is held."""
    space = notched(9)
    low, high = (np.flatnonzero(side) for side in ends(space))
    loading = Loading(space, [(high, Grip("top", (0.0, Ramp(times, openings)))), (low, Grip("bottom", (0.0, 0.0)))])
    return Body(Momentum(space, AAA()), DensitySolver(space, SinkLaw()), loading)


class Watch:
    """Holds each state against the one before: gamma and the history have gone one way."""

    def __init__(self, body: Body, state: State, allowed: float) -> None:
        self.body, self.allowed = body, allowed
        self.gamma, self.W_max = state.gamma.copy(), state.W_max.copy()

    def __call__(self, state: State) -> None:
        assert (state.W_max >= self.W_max).all()
        assert (state.gamma - self.gamma).max() <= self.allowed
        self.gamma, self.W_max = np.minimum(self.gamma, state.gamma), state.W_max.copy()

    def relief(self) -> float:
        """Stored energy at the point that has seen the most, of those that live, over what it has seen."""
        seen = np.where(self.body.momentum.gamma > 0.1, self.W_max, 0.0)
        return float(self.body.momentum.W.ravel()[np.argmax(seen)] / seen.max())


def test_statics_do_not_heal() -> None:
    """Fails if gamma follows the energy of now, and not the greatest one: unloading and loading again is elastic.

    The energies of both are the same, and below those of the first loading. Seen to fail with a history that takes the
    energy of now.
    """
    body = pulled((0.0, 1.0, 2.0, 3.0, 4.0), (0.0, 0.98 * ONSET, 0.1 * ONSET, 0.97 * ONSET, 0.97 * ONSET))
    statics, state = Statics(body, StaticsControls(increment=0.005)), State.intact(body.space)
    watch, way = Watch(body, state, 1e-7), []
    for _ in statics.load(state):
        watch(state)
        way.append((state.grip, float(state.u[:, 1].max()), state.ledger.elastic))
        if state.grip == 1.0:
            lowest = state.gamma.min()
        if state.grip == 2.0:
            assert watch.relief() < 0.05
    assert statics.unfailed and lowest < 0.97
    assert abs(state.gamma.min() - lowest) < 1e-7
    t, opening, elastic = np.array(way).T
    places = np.linspace(0.5, 0.9, 9) * ONSET
    first, back, again = (np.interp(places, *np.sort([opening[part], np.sqrt(elastic[part])]))
                          for part in (t <= 1, (t >= 1) & (t <= 2), (t >= 2) & (t <= 3)))
    np.testing.assert_allclose(back, again, rtol=1e-4)
    assert (back < 0.999 * first).all()


@pytest.mark.parametrize("name", SCHEMES)
def test_a_crack_does_not_heal(name: str) -> None:
    """Fails if gamma grows anywhere while a crack is closed again, or when it is opened once more.

    The plate is torn by a pull beyond its onset, brought back in 10 us, and pulled as far again. Seen to fail with a
    history that takes the energy of now, in each of the schemes.
    """
    body = pulled((0.0, 1.0, 1.0 + 5e-6, 1.0 + 1.5e-5, 1.0 + 2.5e-5),
                  (0.0, 0.98 * ONSET, 1.3 * ONSET, 0.0, 1.3 * ONSET))
    state = State.intact(body.space)
    for _ in Statics(body).load(state):
        if state.grip == 1.0:
            break
    state.begin_event(0.0)
    scheme = SCHEMES[name](body)
    scheme.begin(state)
    watch, relief = Watch(body, state, 3e-6), []  # the rise measured is 7e-7, in `explicit`: its tolerance of gamma
    for _ in scheme.run(state, 2.5e-5):
        scheme.sync(state)
        watch(state)
        relief.append(watch.relief())
    assert state.grip == pytest.approx(1.0 + 2.5e-5) and state.deleted.sum() > 10
    closed = int(np.argmin(relief))
    assert relief[closed] < 0.05 and max(relief[closed:]) > 2 * relief[closed]  # and opened again
