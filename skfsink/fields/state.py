"""The state of a body: the fields that evolve, and the clocks and energies that belong to them."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from ..fem.space import Space
from .energy import Ledger

__all__ = ["State"]


@dataclass
class State:
    """Everything a run needs to go on from where it is; arrays are owned and changed in place or replaced.

    A field that is added here is copied, kept in a checkpoint and read from it without being named anywhere else: it
    has to be an array, None, or of plain values as JSON has them.

    Memory: it is the memory of a run: `begin_event` changes it, `stored` gives all of it, `put_off` lets a part
    of it be elsewhere.

    Attributes
    ----------
    u, v, a: displacement [mm], velocity [mm/s], acceleration [mm/s^2] of the nodes, (n, dim).
    gamma: relative density of the nodes, (n,).
    sink: coefficients 1/(H + eps) that gamma was solved with, (ne, nq); None if gamma is to be solved anew.
    W_max: greatest stored energy each Gauss point has seen [MPa], (ne, nq); H follows from it (Eq. 10).
    deleted: failed elements, (ne,) bool.
    deletions: the ordered log (time, element), with `time` as below.
    grip: displacement of the grips along their velocity, as a time at that velocity [s] (the load clock).
    time: time since the start of the phase [s]; in a quasi-static event the number of the pass.
    step: steps taken in the phase (load increments, passes, time steps).
    phase: "loading", "event" or "done".
    ledger: energies of the phase.
    """

    u: np.ndarray
    v: np.ndarray
    a: np.ndarray
    gamma: np.ndarray
    W_max: np.ndarray
    deleted: np.ndarray
    sink: np.ndarray | None = field(default_factory=lambda: None)
    deletions: list[tuple[float, int]] = field(default_factory=list)
    grip: float = 0.0
    time: float = 0.0
    step: int = 0
    phase: str = "loading"
    ledger: Ledger = field(default_factory=Ledger)

    @classmethod
    def intact(cls, space: Space) -> State:
        """Undeformed, at rest, gamma = 1."""
        zero = np.zeros_like(space.X)
        return cls(zero, zero.copy(), zero.copy(), np.ones(space.n_nodes), np.zeros_like(space.w),
                   np.zeros(space.n_elements, bool))

    # --- fields that are elsewhere ---
    def put_off(self, *names: str, fetch: Callable[[str], Any]) -> None:
        """Let fields be fetched by their names when they are asked for; what there was of them is forgotten."""
        for name in names:
            self.__dict__.pop(name, None)
            self.__dict__.setdefault("_elsewhere", {})[name] = fetch

    if not TYPE_CHECKING:
        def __getattr__(self, name: str) -> Any:
            elsewhere = self.__dict__.get("_elsewhere", {})
            if name not in elsewhere:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            value = self.__dict__[name] = elsewhere.pop(name)(name)
            return value

    def copy(self) -> State:
        """An independent copy, to start another analysis from."""
        return deepcopy(self)

    def begin_event(self, overshoot: float = 0.0, grip: float | None = None) -> None:
        """Start the event: clocks and ledger at zero, the displacement scaled past the onset by `overshoot`.

        `grip` is the load time past the onset [s]; without it, it grows by the same share, as under steady grips.
        """
        self.u *= 1.0 + overshoot
        self.grip = self.grip * (1.0 + overshoot) if grip is None else grip
        self.time, self.step, self.phase, self.ledger = 0.0, 0, "event", Ledger()

    # --- checkpoints ---
    def stored(self) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Fields that are arrays, and those of plain values, by name."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        arrays = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
        rest = {name: value for name, value in values.items() if name not in arrays}
        return arrays, {**rest, "ledger": asdict(self.ledger)}

    @classmethod
    def restored(cls, arrays: dict[str, np.ndarray], values: dict[str, Any]) -> State:
        """The state of which :meth:`stored` gave the fields.

        Raises
        ------
        KeyError, TypeError
            One of them is missing, or does not belong to a state.
        """
        log = [(float(time), int(element)) for time, element in values["deletions"]]
        state = cls(**{**arrays, **values, "deletions": log, "ledger": Ledger(**values["ledger"])})
        if missing := {f.name for f in fields(cls)} - arrays.keys() - values.keys():
            raise KeyError(min(missing))
        return state
