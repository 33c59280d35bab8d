"""The momentum balance of a whole body whose parts have the values: it has no loops of its own over the elements."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np

from ...fem.backend import MomentumBackend
from ...fields.momentum import Momentum
from ...fields.state import State

__all__ = ["Gathered"]


class Gathered:
    """See :class:`.MomentumBackend`; its layout is (ne, nq).

    Density and stored energy at the Gauss points are fetched from the parts. For anything else that is asked for, loops
    over the whole body are made, and kept as long as the state stays what it is.

    Memory: the state given to `now`, and loops made since.

    Parameters
    ----------
    momentum: the balance of the whole body, which takes its values from here after `now`.
    fetch: gives fields "W" and "points" of the whole body.
    """

    def __init__(self, momentum: Momentum, fetch: Callable[[str], np.ndarray]) -> None:
        self._momentum, self._fetch = momentum, fetch
        self._state: State | None = None
        self._whole: MomentumBackend | None = None

    def now(self, state: State) -> None:
        """Be of a state of the whole body from now on."""
        self._state, self._whole = state, None
        self._momentum.evaluate_by(cast(MomentumBackend, self))

    @property
    def gamma(self) -> np.ndarray:
        """Relative density at the Gauss points, (ne, nq)."""
        return self._fetch("points")

    @property
    def W(self) -> np.ndarray:
        """Stored energy density of the undamaged material [MPa], (ne, nq)."""
        return self._fetch("W")

    def tile(self, values: np.ndarray) -> np.ndarray:
        """A copy."""
        return values.copy()

    def untile(self, values: np.ndarray) -> np.ndarray:
        """The values themselves, which are fetched anew each time."""
        return values

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        if self._whole is None:
            state, momentum = self._state, self._momentum
            assert state is not None
            self._whole = momentum.new_backend()
            self._whole.relax(state.gamma, state.deleted, momentum.force_floor)
            self._whole.force(state.u, np.empty_like(momentum.space.X))
        return getattr(self._whole, name)
