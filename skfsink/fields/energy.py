"""The energy ledger: where the energy of a run is at each recorded time, and whether the sum closes.

The balance law rho a = Div(FS) with a falling gamma loses, per unit volume, the stored and the kinetic energy of the
mass that disappears:

    D = - int int gamma_dot (W + rho0 |v|^2 / 2) dV dt .

The ledger keeps D in its two parts beside the energy of the paper, U = sum over failed elements of A_i psi_f
(Eq. 30, 32), which is a measure of the failed area and does not enter the balance:

    elastic + loads + contact + kinetic + D + deletion + numerical + released + viscous = initial + external work.

Every entry is computed from its own definition; none is what is left over from the others.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields

import numpy as np

__all__ = ["OPTIONAL_TERMS", "Ledger"]

#: Terms that only some runs have; see :func:`.terms_without`.
OPTIONAL_TERMS = ("contact", "viscous")


@dataclass
class Ledger:
    """Energies [N mm; N mm/mm in 2D] since the start of the phase it belongs to.

    Memory: all entries: `drop` and `book_pressure` book on, and `sink`, `balance`, `error` and `as_dict` sum up what
    has been booked so far.

    Attributes
    ----------
    initial: elastic and kinetic energy, and potential of the dead loads, at the start of the ledger.
    elastic: gamma-weighted stored energy.
    loads: potential -f.u of the dead loads.
    contact: energy of the medium between the lips of cracks; see :mod:`.contact`.
    kinetic: gamma-weighted kinetic energy.
    work: work of the grips and of pressures, and -u.df of dead loads f that change.
    sink_stored, sink_kinetic: the two parts of D.
    deletion: stored energy of elements at the moment they were deleted, of debris the kinetic one too, and what contact
        loses as density falls.
    numerical: dissipation of the scheme, from its own identity (negative: it fed energy in).
    released: energy a quasi-static analysis gives up in relaxing at fixed gamma; a dynamic one turns it into motion.
    viscous: work done against viscosity, never negative but for terms of second order in the step.
    paper: U of the paper.
    pressure_work: the part of `work` that pressures did; no term of its own.
    debris: the part of `deletion` that was in debris; no term of its own.
    """

    initial: float = 0.0
    elastic: float = 0.0
    loads: float = 0.0
    kinetic: float = 0.0
    work: float = 0.0
    sink_stored: float = 0.0
    sink_kinetic: float = 0.0
    deletion: float = 0.0
    numerical: float = 0.0
    released: float = 0.0
    viscous: float = 0.0
    paper: float = 0.0
    contact: float = 0.0
    debris: float = 0.0
    pressure_work: float = 0.0

    @property
    def sink(self) -> float:
        """D, the energy the sink has taken."""
        return self.sink_stored + self.sink_kinetic

    @property
    def balance(self) -> float:
        """What does not close: left side minus right side of the balance."""
        return (self.elastic + self.loads + self.kinetic + self.sink + self.deletion + self.numerical + self.released
                - self.initial - self.work + self.contact + self.viscous)

    @property
    def turnover(self) -> float:
        """The greatest of the energies, whatever its sign: what the ledger is about where there is no other scale."""
        return max(abs(getattr(self, name)) for name in (field.name for field in fields(self)) if name != "paper")

    def scale(self, onset: float) -> float:
        """What errors are relative to: the elastic energy at the `onset`, without one what the ledger is about; > 0."""
        return onset if onset > 0 else self.turnover or np.finfo(float).tiny

    def error(self, scale: float) -> float:
        """|balance| relative to `scale`, usually the elastic energy at onset; without one, to the :attr:`turnover`."""
        return abs(self.balance) / self.scale(scale)

    def book_pressure(self, work: float) -> None:
        """Book the work of pressures."""
        self.work += work
        self.pressure_work += work

    def drop(self, w: np.ndarray, W: np.ndarray, before: np.ndarray, after: np.ndarray) -> None:
        """Book the stored energy taken when the Gauss point densities fall from `before` to `after` at fixed W."""
        self.sink_stored += float(np.einsum("eq,eq,eq->", w, W, before - after))

    def as_dict(self) -> dict[str, float]:
        """All entries, with D and the balance."""
        return {**asdict(self), "sink": self.sink, "balance": self.balance}
