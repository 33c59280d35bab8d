"""What a run looks at besides its state, wherever the body is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..fields.body import Body
from ..fields.state import State
from ..fields.stress import cauchy_stress

__all__ = ["Looked", "OneBody", "Pieces"]


class Pieces(NamedTuple):
    """Parts of a body that write their own pieces of a frame.

    Attributes
    ----------
    number: how many there are.
    each: calls a function with what each part knows, and with the arguments that follow it.
    """

    number: int
    each: Callable[..., Any]


class Looked(Protocol):
    """What is asked of a body, be it in one piece or in parts."""

    @property
    def solves(self) -> int:
        """Solves for gamma that the density of the whole body has not counted."""

    @property
    def pieces(self) -> Pieces | None:
        """Those that frames are written in; None for frames of the whole body."""

    def stress(self, state: State) -> np.ndarray:
        """Mean Cauchy stress of the elements [MPa], (ne, 6); see :func:`.cauchy_stress`."""

    def crushed(self, state: State) -> np.ndarray | None:
        """Mask of the elements that no stress is defined for, (ne,); None where finding it takes the stress of all."""

    def cost(self) -> dict[str, Any]:
        """Figures of the summary that a body in one piece has not."""


class OneBody:
    """A body in one piece."""

    body: Body
    solves = 0
    pieces: Pieces | None = None

    def __init__(self, body: Body) -> None:
        self.body = body

    def stress(self, state: State) -> np.ndarray:
        """See :class:`Looked`."""
        return cauchy_stress(self.body.momentum, state.u)

    def crushed(self, state: State) -> np.ndarray | None:
        """None: it takes the stress of all elements."""
        return None

    def cost(self) -> dict[str, Any]:
        """None."""
        return {}
