"""Energies of a run from its fields alone, by the formulas of the materials: what a ledger is held against."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from skfsink.fields.body import Body
from skfsink.fields.energy import Ledger
from skfsink.fields.momentum import Momentum
from skfsink.fields.state import State
from skfsink.results.frame import Frame, frame_file, read_frame
from skfsink.results.series import frame_times


class Moment(NamedTuple):
    """The fields of a state, as far as its energies need them.

    Attributes
    ----------
    time: [s], or the number of the pass.
    gamma: relative density at the Gauss points, without what bears no force, (ne, nq).
    W: stored energy [MPa] there, zero where gamma is, (ne, nq).
    mass, half_v2: lumped mass [t/mm], without a floor, and |v|^2/2 [mm^2/s^2] of the nodes, (n,).
    """

    time: float
    gamma: np.ndarray
    W: np.ndarray
    mass: np.ndarray
    half_v2: np.ndarray


@dataclass(frozen=True)
class Energies:
    """Energies of states of a body with the element `jbar`, without its loops and its ledger."""

    body: Body

    @property
    def momentum(self) -> Momentum:
        """The balance whose materials and regions these are."""
        return self.body.momentum

    def density(self, state: State | Frame) -> np.ndarray:
        """Gauss point densities of a state, zero in deleted elements and below the force floor, (ne, nq)."""
        gamma = np.einsum("qa,ea->eq", self.body.space.N, state.gamma[self.body.space.conn])
        gamma[(gamma < self.momentum.force_floor) | state.deleted[:, None]] = 0.0
        return gamma

    def stored(self, u: np.ndarray, gamma: np.ndarray) -> np.ndarray:
        """Energy density W [MPa] at the displacement `u` (n, dim), zero where `gamma` (ne, nq) is, (ne, nq)."""
        space, W = self.body.space, np.zeros(gamma.shape)
        F = space.deformation_gradient(u)
        J = np.linalg.det(F)
        J_bar = np.broadcast_to(space.element_mean(J)[:, None], J.shape)
        for part in self.momentum.parts:
            here = gamma > 0
            if part.elements is not None:
                here[np.setdiff1d(np.arange(space.n_elements), part.elements)] = False
            W[here] = part.material.energy(F[here], J_bar[here])
        return W

    def of(self, state: State | Frame) -> Moment:
        """The moment of a state, or of a frame that has been stored."""
        gamma = self.density(state)
        rho0 = np.zeros_like(gamma)
        for part in self.momentum.parts:
            rho0[slice(None) if part.elements is None else part.elements] = part.material.rho0
        mass = self.body.space.lump(gamma * rho0)
        return Moment(state.time, gamma, self.stored(state.u, gamma), mass, 0.5 * (state.v**2).sum(axis=1))

    def elastic(self, moment: Moment) -> float:
        """Stored energy."""
        return float((self.body.space.w * moment.gamma * moment.W).sum())

    def kinetic(self, moment: Moment) -> float:
        """Kinetic energy."""
        return float(moment.mass @ moment.half_v2)

    def taken(self, moments: Iterable[Moment]) -> tuple[float, float]:
        """D in its two parts: the integral of -gamma_dot (W + rho0 |v|^2/2) over the body and over `moments`.

        Between two of them the energy is the mean by the densities: what is gone at the second has that of the first.
        """
        w = self.body.space.w
        stored = kinetic = 0.0
        for one, two in pairwise(moments):
            stored += float((w * (one.gamma - two.gamma) * _mean(one.gamma, one.W, two.gamma, two.W)).sum())
            kinetic += float(((one.mass - two.mass) * _mean(one.mass, one.half_v2, two.mass, two.half_v2)).sum())
        return stored, kinetic


def stored_moments(body: Body, folder: Path) -> list[Moment]:
    """Those of the frames that a run has left in its folder."""
    series = folder / "series"
    return [Energies(body).of(read_frame(series / frame_file("run", number), time, "", body.space.dim))
            for number, time in enumerate(frame_times(series / "run.pvd"))]


def thinned(moments: Sequence[Moment], every: int) -> list[Moment]:
    """Each `every`-th one, and the last one."""
    return [*moments[:-1:every], moments[-1]]


def check_sink(body: Body, ledger: Ledger, moments: Sequence[Moment], every: int = 1, within: float = 0.01) -> None:
    """Hold D of a ledger, in both parts, against each `every`-th moment of an event.

    Half as many tell the error of these, which is to be below `within` of the initial energy; 3e-3 of that is allowed
    beside it.
    """
    energies, initial = Energies(body), ledger.initial
    fine, coarse = (energies.taken(thinned(moments, steps)) for steps in (every, 2 * every))
    for booked, near, far in zip((ledger.sink_stored, ledger.sink_kinetic), fine, coarse, strict=True):
        assert near > 0.02 * initial
        assert abs(near - far) < within * initial
        assert booked == pytest.approx(near, abs=1.5 * abs(near - far) + 3e-3 * initial)


def _mean(m0: np.ndarray, q0: np.ndarray, m1: np.ndarray, q1: np.ndarray) -> np.ndarray:
    """Mean of a quantity by two densities, zero where both are."""
    both = m0 + m1
    return np.divide(m0 * q0 + m1 * q1, both, out=np.zeros_like(both), where=both > 0)
