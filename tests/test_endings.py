"""Whatever is asked for: a run ends in a finite state with a closed ledger, or with an error that has a cure."""

from __future__ import annotations

import dataclasses
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from guarded import scene, simulation
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from skfsink.errors import SkfsinkError
from skfsink.fields.momentum import Momentum
from skfsink.fields.state import State
from skfsink.material import AAA, SinkLaw
from skfsink.methods.controls import ExplicitControls, HHTControls
from skfsink.methods.statics import Statics
from skfsink.run.simulate import Loaded, Simulation
from skfsink.scene.controls import Controls
from skfsink.scene.scene import Scene
from skfsink.study.blocks import block
from skfsink.study.plate import Plate

SMALL = Plate(block(5, notch=0.4, width=0.2))
EXAMPLES = settings(max_examples=20, deadline=None, derandomize=True, database=None, phases=[Phase.generate],
                    suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(autouse=True)
def few_passes(monkeypatch: pytest.MonkeyPatch) -> None:
    """A quasi-static event ends after eight passes, wherever it is."""
    propagate = Statics.propagate
    monkeypatch.setattr(Statics, "propagate", lambda self, state: islice(propagate(self, state), 8))


def ends_well(of: Scene, state: State, folder: Path) -> None:
    """Run the event from `state` as it is; see the module."""
    momentum = Momentum(of.sample.space, of.material, of.controls.element, of.controls.force_floor)
    momentum.set_gamma(state.gamma, state.deleted)
    with np.errstate(all="ignore"):
        momentum.force(state.u)
        state.ledger.elastic = state.ledger.work = momentum.energy
        sim: Simulation = simulation(of, folder)
        try:
            sim.run(Loaded(state))
        except SkfsinkError as error:
            assert str(error) and "\n" not in str(error)
            return
    ledger, allowed = sim.state.ledger, of.controls.balance_tolerance * sim.guard.scale
    assert all(np.isfinite(value) for value in ledger.as_dict().values())
    assert abs(ledger.balance) <= allowed and -ledger.numerical <= allowed
    for name in ("u", "v", "a", "gamma", "W_max"):
        assert np.isfinite(getattr(sim.state, name)).all(), name


OPTIONS = {
    "analysis": st.sampled_from(["dynamic", "dynamic", "dynamic", "quasistatic"]),
    "integrator": st.sampled_from(["explicit", "hht"]),
    "sink": st.sampled_from(["lumped", "consistent", "nearest"]), "gradient": st.sampled_from(["monotone", "gauss"]),
    "element": st.sampled_from(["jbar", "plain"]),
    "overshoot": st.sampled_from([1e-4, 0.01, 0.1]), "deletion": st.sampled_from([1e-9, 1e-6, 1e-2]),
    "force_floor": st.sampled_from([0.0, 1e-3, 0.1])}
EXPLICIT = st.builds(ExplicitControls, courant=st.sampled_from([0.8, 1.0]), gamma_every=st.sampled_from([0, 1, 40]),
                     mass_floor=st.sampled_from([0.0, 1e-3]))
IMPLICIT = st.builds(HHTControls, alpha=st.sampled_from([0.0, -1 / 3]), dt=st.sampled_from([1e-7, 1e-5, 1e-2]),
                     mass=st.sampled_from(["lumped", "consistent"]), coupling=st.sampled_from(["iterated", "single"]),
                     mass_floor=st.sampled_from([0.0, 1e-3]))
LAWS = st.builds(SinkLaw, m=st.sampled_from([1.0, 10.0, 80.0]), length_scale=st.sampled_from([0.01, 0.1, 2.0]))


@pytest.mark.slow
@EXAMPLES
@given(controls=st.fixed_dictionaries(OPTIONS), explicit=EXPLICIT, hht=IMPLICIT, law=LAWS,
       k=st.sampled_from([5.0, 500.0, 1e5]))
def test_absurd_options(tmp_path: Path, controls: dict[str, Any], explicit: ExplicitControls, hht: HHTControls,
                        law: SinkLaw, k: float):
    """Fails if a choice of allowed options ends in NaN, in energy from nowhere, or in an error of the program."""
    asked = Controls(**controls, event_time=3e-7, checkpoint_every=1e6, explicit=explicit, hht=hht)
    of = scene(SMALL.sample, AAA(bulk_modulus=k), law)
    ends_well(dataclasses.replace(of, controls=asked), SMALL.onset, tmp_path / "run")


@pytest.mark.slow
@EXAMPLES
@given(seed=st.integers(0, 10**6), size=st.sampled_from([1e-3, 0.05, 0.5, 3.0]), decades=st.sampled_from([0, 1, 15]),
       integrator=st.sampled_from(["explicit", "hht"]), coupling=st.sampled_from(["iterated", "single"]))
def test_absurd_states(tmp_path: Path, seed: int, size: float, decades: int, integrator: str, coupling: str):
    """Fails if a run from random displacements (with inverted elements) and densities ends as it must not."""
    of = scene(block(6, distortion=0.2), integrator=integrator, event_time=1e-6, checkpoint_every=1e6,
               hht=HHTControls(coupling=coupling))
    rng, state = np.random.default_rng(seed), State.intact(of.sample.space)
    state.u = rng.normal(size=state.u.shape) * size / 6
    state.gamma = 10 ** -rng.uniform(0, decades or 1e-9, state.gamma.size)
    state.grip = 1.0
    ends_well(of, state, tmp_path / "run")
