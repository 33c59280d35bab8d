"""Lanczos's method for the highest frequency, beyond what the stability of the explicit scheme tests of it."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
from bodies import boundary, box

from skfsink.errors import ConvergenceError, InstabilityError
from skfsink.fem.pattern import Pattern
from skfsink.fields.momentum import Momentum
from skfsink.material import AAA
from skfsink.methods import frequency


def estimate(tolerance: float) -> tuple[float, float, float]:
    """Estimate, exact value and residual |K x - omega^2 M x| relative to omega^2 |M x| of equal squares."""
    space = box("quad", 12, 0.2)
    momentum, free = Momentum(space, AAA()), np.repeat(~boundary(space), 2)
    mass, u, pattern = momentum.lumped_mass(0.0), np.zeros_like(space.X), Pattern(space, 2, free, upper=True)
    omega, mode = frequency.highest_frequency(momentum, pattern, free, u, mass, tolerance=tolerance)
    scale = 1 / np.sqrt(np.repeat(mass, 2)[free])
    A = scale[:, None] * pattern.symmetric(momentum.tangent(pattern, u)).toarray() * scale
    assert np.linalg.norm(mode) == pytest.approx(1, rel=1e-12)
    return omega, float(np.sqrt(la.eigvalsh(A)[-1])), float(np.linalg.norm(A @ mode - omega**2 * mode)) / omega**2


@pytest.mark.parametrize("steps", [60, 8])
def test_the_residual_is_what_was_asked_for(steps: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if a residual is said that is not there, or what was found is lost when the method starts again."""
    monkeypatch.setattr(frequency, "STEPS", steps)
    monkeypatch.setattr(frequency, "RESTARTS", 200)
    omega, exact, residual = estimate(1e-6)
    assert residual < 1.001e-6
    assert exact * (1 - 1e-6) < omega < exact * (1 + 1e-12)


def test_an_estimate_that_is_not_good_enough_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if the last value is taken, whatever its residual: it is too low, and the step too long."""
    monkeypatch.setattr(frequency, "STEPS", 4)
    monkeypatch.setattr(frequency, "RESTARTS", 2)
    with pytest.raises(ConvergenceError, match=r"no highest frequency was found in 8 steps .* its residual is still 0"):
        estimate(1e-6)


def test_a_body_that_has_blown_up_is_said_to_have() -> None:
    """Fails if a tangent that is no number is a traceback, or has a frequency."""
    space = box("quad", 4, 0.2)
    momentum, free = Momentum(space, AAA()), np.repeat(~boundary(space), 2)
    u = np.zeros_like(space.X)
    u[12, 0] = np.nan
    with pytest.raises(InstabilityError, match=r"tangent of the body is not finite: .* has blown up"):
        frequency.highest_frequency(momentum, Pattern(space, 2, free, upper=True), free, u, momentum.lumped_mass(0.0))
