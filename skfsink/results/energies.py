"""The energies of an event as they are told: their names, what of the history adds up to each, and their meaning."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["ENERGIES", "Energy"]

#: Rows of :attr:`Run.energies`: name, columns of the history that add up to it, meaning.
ENERGIES: tuple[tuple[str, tuple[str, ...], str], ...] = (
    ("elastic", ("elastic",), "elastic energy, γ-weighted"),
    ("kinetic", ("kinetic",), "kinetic energy, γ-weighted"),
    ("contact", ("contact",), "of the lips of cracks that bear on each other"),
    ("D", ("sink_stored", "sink_kinetic"), "D, taken by the sink"),
    ("D_stored", ("sink_stored",), "of D: from stored energy"),
    ("D_kinetic", ("sink_kinetic",), "of D: from motion"),
    ("deletion", ("deletion",), "left in deleted elements"),
    ("numerical", ("numerical",), "dissipated by the time integration"),
    ("viscous", ("viscous",), "dissipated by viscosity"),
    ("released", ("released",), "released in relaxing to equilibrium"),
    ("work", ("work",), "work of the grips and of pressures during the event"),
    ("pressure_work", ("pressure_work",), "of the work: of pressures"),
    ("balance", ("balance",), "balance: what does not add up"),
    ("U", ("U_paper",), "U of the paper, Σ A ψ_f of failed elements"),
)


class Energy(NamedTuple):
    """An energy at the start of the event, at the first arrival of the crack (None without) and at the end."""

    meaning: str
    unit: str
    start: float
    arrival: float | None
    end: float
