"""A whole run does not depend on how the body lies in space: turned by 37 degrees, or mirrored."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import skfem
from guarded import scene, simulation

from skfsink.fem.space import Space
from skfsink.fields.state import State
from skfsink.loads.grips import Grip
from skfsink.methods.controls import HHTControls, StaticsControls
from skfsink.methods.step_length import StepLength
from skfsink.run.summarize import summarize
from skfsink.scene.scene import Scene
from skfsink.study.blocks import block

COS, SIN = np.cos(np.deg2rad(37)), np.sin(np.deg2rad(37))
TURNED, MIRRORED = np.array([[COS, -SIN], [SIN, COS]]), np.diag([1.0, -1.0])
#: iterations go by the greatest component, so that HHT has to converge before it can be the same
HHT = HHTControls(dt=3e-7, force_tolerance=1e-9, correction_tolerance=1e-9, gamma_tolerance=1e-9, max_iterations=40)
KINDS: dict[str, dict[str, Any]] = {"dynamic": {}, "hht": {"integrator": "hht", "hht": HHT},
                                    "quasistatic": {"analysis": "quasistatic"}}
#: relative differences of the figures; the greatest ones measured are 4e-8, 4e-9 and 4e-13
ALLOWED = {"dynamic": 1e-6, "hht": 1e-6, "quasistatic": 1e-10}


def turned(kind: str, Q: np.ndarray) -> Scene:
    """A distorted plate with a notch, and its grips, both turned by `Q`.

    Increments of the loading are measured along the axes, by the greatest component of the velocity and the greatest
    extent: the share asked for makes them equally long.
    """
    sample = block(11, notch=0.36, width=0.09, distortion=0.1)
    mesh = sample.space.mesh
    sample = dataclasses.replace(sample, space=Space(skfem.MeshQuad(np.ascontiguousarray(Q @ mesh.p), mesh.t)))
    increment = 0.01 * float(np.abs(Q[:, 1]).max() / np.ptp(sample.space.X, axis=0).max())
    of = scene(sample, event_time=3e-5, statics=StaticsControls(increment=increment), **KINDS[kind])
    grips = tuple(Grip(g.boundary, tuple(map(float, Q @ np.array(g.velocity, float)))) for g in of.grips)
    return dataclasses.replace(of, grips=grips)


def outcome(kind: str, Q: np.ndarray, folder: Path) -> tuple[dict[str, float], State]:
    """Figures of a run, and its last state turned back."""
    run = simulation(turned(kind, Q), folder)
    state = run.run()
    summary = summarize(run.scene, run)
    energy = summary["energy"]
    state.u = state.u @ Q
    return {"onset": summary["onset"]["displacement_mm"], "load": summary["onset"]["reaction_N_per_mm"],
            "U": energy["U_paper_final"], "U at arrival": energy["U_paper_at_arrival"],
            "D": energy["D_sink_final"], "D at arrival": energy["D_sink_at_arrival"],
            "kinetic": energy["D_sink_kinetic"], "arrival": run.crack.tracker.arrival or 0.0}, state


@pytest.mark.parametrize("kind", ["dynamic", pytest.param("hht", marks=pytest.mark.slow), "quasistatic"])
def test_a_run_is_the_same_however_the_body_lies(kind: str, tmp_path_factory: pytest.TempPathFactory,
                                                 monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if anything in a run prefers a direction: U, D and arrival, the displacement and gamma of its end.

    The step of the explicit scheme is given here: its estimate of the highest frequency starts from a vector that is
    not turned. Seen to fail with a force whose x component is 1e-4 too large.
    """
    def given(self: StepLength, *_: object) -> None:
        self.dt, self.mode = 4e-8 * 0.5**self.cut, np.zeros(1)
    monkeypatch.setattr(StepLength, "look", given)
    plain, end = outcome(kind, np.eye(2), tmp_path_factory.mktemp("plain"))
    assert plain["arrival"] > 0 and plain["U"] > 0 and len(end.deletions) > 5
    for Q in (TURNED, MIRRORED):
        found, state = outcome(kind, Q, tmp_path_factory.mktemp("run"))
        assert found == pytest.approx(plain, rel=ALLOWED[kind])
        assert [element for _, element in state.deletions] == [element for _, element in end.deletions]
        live = end.gamma > 0.1
        np.testing.assert_allclose(state.u[live], end.u[live], atol=ALLOWED[kind])
        np.testing.assert_allclose(state.gamma, end.gamma, atol=ALLOWED[kind])
