"""The energies of a step of the implicit scheme: what the sink takes, what the grips do, what the scheme dissipates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..fields.energy import Ledger
from .controls import HHTControls
from .inertia import Inertia

__all__ = ["Balance", "book_motion", "book_sink", "book_viscous"]


class Balance(NamedTuple):
    """The terms of the balances at an accepted state.

    Attributes
    ----------
    force: internal and viscous force less the loads, (n, dim).
    inertia: M a over the free unknowns, as the scheme has it.
    gamma, W: relative density and stored energy [MPa] at the Gauss points, (ne, nq).
    mass: data of the mass matrix.   places: mass by place, see :meth:`.Inertia.places`.
    viscous: viscous force in `force`, None without viscosity.
    """

    force: np.ndarray
    inertia: np.ndarray
    gamma: np.ndarray
    W: np.ndarray
    mass: np.ndarray
    places: np.ndarray
    viscous: np.ndarray | None = None


def book_viscous(ledger: Ledger, old: Balance, new: Balance, du: np.ndarray) -> None:
    """Book the work against viscosity over the displacement `du` (n, dim) of a step, apart from what the scheme takes.
    """
    if old.viscous is not None and new.viscous is not None:
        work = 0.5 * float(np.vdot(old.viscous + new.viscous, du))
        ledger.viscous += work
        ledger.numerical -= work


def book_sink(ledger: Ledger, w: np.ndarray, old: Balance, new: Balance,
              half_v2: tuple[np.ndarray, np.ndarray]) -> tuple[float, float]:
    """Book D of a step; returns the change of stored energy, and what is left of the kinetic one, at its mean gamma.

    A change of gamma W splits exactly into (mean W) d(gamma) + (mean gamma) dW. With W averaged by the gammas and the
    harmonic mean of gamma, a point that dies within the step is booked with the energy it had, not with what its shape
    is worth afterwards. `half_v2` is |v|^2/2 before and after, in the places of the mass; `w` are the weights (ne, nq).
    """
    total = np.maximum(old.gamma + new.gamma, 1e-300)
    weight = w * (old.gamma - new.gamma) / total
    ledger.sink_stored += float(np.einsum("eq,eq->", weight, old.gamma * old.W + new.gamma * new.W))
    stored = float(np.einsum("eq,eq,eq->", w, 2 * old.gamma * new.gamma / total, new.W - old.W))
    (m0, m1), (k0, k1) = (old.places, new.places), half_v2
    both = np.maximum(m0 + m1, 1e-300)
    ledger.sink_kinetic += float(np.sum((m0 - m1) / both * (m0 * k0 + m1 * k1)))
    return stored, float(np.sum((m0 - m1) ** 2 / (2 * both) * (k1 - k0)))


def book_motion(inertia: Inertia, old: Balance, new: Balance, a: tuple[np.ndarray, np.ndarray], du: np.ndarray,
                step: tuple[float, HHTControls]) -> float:
    """Change of the kinetic energy in a step by the equations of the scheme, at the mean mass.

    `a` are the accelerations before and after, `du` the displacement of the step, all over the free unknowns; `step`
    are its length dt [s] and the options.
    """
    dt, c = step
    a0, a1 = a
    dM = new.mass - old.mass
    da, mean_a = a1 - a0, 0.5 * (a0 + a1)
    M_mean_a = 0.5 * (new.inertia + old.inertia) - 0.25 * inertia.times(dM, da)
    M_da = new.inertia - old.inertia - inertia.times(dM, mean_a)
    v_mean = du / dt - dt * (c.beta - c.newmark_gamma / 2) * da
    return dt * float(v_mean @ (M_mean_a + (c.newmark_gamma - 0.5) * M_da))
