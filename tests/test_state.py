"""The state knows its own fields, and nothing that decides a run is kept outside of it and of what methods say."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from bodies import Fracture, held_body, notched
from guarded import NOTCHED, Stop, scene, simulation

import skfsink.run.checkpoint
import skfsink.run.simulate
from skfsink.errors import Interrupted
from skfsink.fields.body import Body
from skfsink.fields.density import DensitySolver
from skfsink.fields.momentum import Momentum
from skfsink.fields.state import State
from skfsink.methods.controls import HHTControls
from skfsink.methods.explicit import Explicit
from skfsink.methods.hht import HHT
from skfsink.methods.statics import Statics
from skfsink.run.display import Display
from skfsink.run.observers.observer import Observer
from skfsink.run.observers.view import View
from skfsink.run.simulate import Simulation


@dataclass
class Aged(State):
    """A state with more fields, as somebody may add them: arrays, one of which is not there yet, and plain values."""

    age: np.ndarray = field(default_factory=lambda: np.zeros(2))
    worn: np.ndarray | None = None
    visits: dict[str, int] = field(default_factory=dict)
    word: str = "young"


class Ageing(Observer):
    """Changes the added fields at every step."""

    def pause(self, view: View) -> None:
        state = view.state
        assert isinstance(state, Aged)
        state.age += (1.0, state.time)
        state.worn = state.gamma.copy() if state.worn is None else np.minimum(state.worn, state.gamma)
        state.visits[state.phase] = state.visits.get(state.phase, 0) + 1
        state.word = "old"


def test_an_added_field_is_copied_and_stored() -> None:
    """Fails if a field has to be named in a list to be copied, written or read.

    Seen to fail with a `copy` that names the fields of today, and with a `stored` that does.
    """
    state = Aged.intact(notched(5))
    state.visits["event"], state.ledger.sink_stored = 7, 0.5
    copy = state.copy()
    state.age[0], state.worn = 3.0, np.arange(4.0)
    state.visits["event"] = 8
    assert (copy.age == 0).all() and copy.worn is None and copy.visits == {"event": 7}
    arrays, values = state.stored()
    again = Aged.restored(arrays, json.loads(json.dumps(values)))
    assert again.age[0] == 3.0 and again.visits == {"event": 8} and again.ledger == state.ledger
    np.testing.assert_array_equal(again.worn, np.arange(4.0))
    with pytest.raises(KeyError, match="visits"):
        Aged.restored(arrays, {name: value for name, value in values.items() if name != "visits"})


@pytest.mark.parametrize(("analysis", "stop"), [pytest.param("dynamic", 3, marks=pytest.mark.slow), ("dynamic", 60),
                                                  ("quasistatic", 12)])
def test_an_added_field_goes_on_with_a_resumed_run(analysis: str, stop: int, tmp_path: Path,
                                                   monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a field that is added to the state is lost where a run goes on, in the loading, in the event, in passes.

    Seen to fail with a checkpoint that leaves out what it does not know.
    """
    for module in (skfsink.run.simulate, skfsink.run.checkpoint):
        monkeypatch.setattr(module, "State", Aged)
    of = scene(NOTCHED.sample, analysis=analysis, event_time=8e-6, overshoot=0.01, checkpoint_every=1e6)
    whole = simulation(of, tmp_path / "whole", Ageing()).run()
    with pytest.raises(Interrupted):
        simulation(of, tmp_path / "broken", Ageing(), Stop(stop)).run()
    broken = Simulation(of, tmp_path / "broken", Display(True), resume=True, observers=[Ageing()]).run()
    assert isinstance(whole, Aged) and isinstance(broken, Aged) and whole.worn is not None
    assert whole.visits.keys() == {"loading", "event"} and whole.word == broken.word == "old"
    assert broken.visits == whole.visits and whole.age[0] == sum(whole.visits.values())
    np.testing.assert_array_equal(broken.age, whole.age)
    np.testing.assert_array_equal(broken.worn, whole.worn)


def stepped(body: Body, state: State, integrator: Explicit | HHT) -> Iterator[State]:
    """The steps of an event."""
    integrator.begin(state)
    for now in integrator.run(state, 1.0):
        integrator.sync(now)
        yield now


METHODS: dict[str, Callable[[Body, State], Iterator[State]]] = {
    "explicit": lambda body, state: stepped(body, state, Explicit(body)),
    "hht": lambda body, state: stepped(body, state, HHT(body, HHTControls(dt=2e-7))),
    "passes": lambda body, state: Statics(body).propagate(state),
    "loading": lambda body, state: Statics(body).load(State.intact(body.space)),
}


@pytest.mark.parametrize("name", METHODS)
def test_a_body_that_was_used_is_as_good_as_a_new_one(name: str, fracture: Fracture) -> None:
    """Fails if a balance remembers what it was last used for: a method on a body that another crack has run through
    gives the bits that it gives on a new one.

    Seen to fail with a density solver that starts from the solution it has found last.
    """
    def new() -> Body:
        momentum = Momentum(fracture.momentum.space, fracture.momentum.material)
        return held_body(momentum, DensitySolver(momentum.space, fracture.density.law), fracture.free,
                         fracture.velocity)

    used, ends = new(), []
    other = fracture.fresh()
    other.u *= 1.1
    for _ in islice(METHODS["explicit"](used, other), 200):
        pass
    assert other.deleted.any()
    for body in (new(), used):
        steps = islice(METHODS[name](body, fracture.fresh()), 12 if name in ("passes", "loading") else 60)
        ends.append(deque(steps, maxlen=1)[0])
    one, two = (state.stored() for state in ends)
    assert one[1] == two[1]
    for key, array in one[0].items():
        np.testing.assert_array_equal(two[0][key], array, err_msg=key)
