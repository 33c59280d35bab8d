"""Dead loads as forces at nodes, whatever they come from: what the balances ask of a load."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Self

import numpy as np

from ..errors import ParameterError
from ..fem.exchange import ALONE, Exchange
from ..fem.selection import Selection
from ..fem.space import Space
from .grips import Ramp

__all__ = ["NodalLoads", "Together"]


class NodalLoads:
    """Forces at nodes that keep their direction. A new kind of load derives from it and gives `at`, `rate`, `keep`.

    With `of_part` and `on` several ranks know it as well; in a part of a body values are the shares of its elements,
    and energies those of the whole.

    Memory: the load time last given to `at`, the elements last given to `keep` and, in a part of a body, its space last
    given to `on`: `potential`, `changed`, `effort`, `weigh` and `of_part` are of the loads as these left them.

    Attributes
    ----------
    nodes: at which they act, (k,), each once.
    values: their forces at the time last given to :meth:`at`, (k, dim) [N; N/mm in 2D]; replaced, never changed.
    elements: on which they act, (f,); those that have lost their force bear no load any more.
    ramps: that they follow; load increments end at their points.
    weighs: whether they fall with the density, which `weigh` is given then.
    exchange: with the other parts of the body.
    """

    exchange: Exchange = ALONE

    nodes: np.ndarray
    values: np.ndarray
    elements: np.ndarray
    ramps: tuple[Ramp, ...] = ()
    weighs: bool = False

    def at(self, t: float) -> None:
        """Take the loads of load time `t` [s]."""
        raise NotImplementedError

    def rate(self, t: float) -> float:
        """Fastest change from load time `t` on, as of a traction [MPa/s]; it decides on load increments."""
        raise NotImplementedError

    def keep(self, alive: np.ndarray) -> None:
        """Let loads act only on those of `elements` that are `alive` (f,)."""
        raise NotImplementedError

    def weigh(self, gamma: np.ndarray) -> None:
        """Let the loads be those of material with the relative density `gamma` (ne, nq)."""

    # --- energy ---
    def potential(self, u: np.ndarray) -> float:
        """-f.u of the loads at the displacement `u` (n, dim) [N mm; N mm/mm in 2D]."""
        return -self.exchange.total(float(np.vdot(self.values, u[self.nodes])))

    def changed(self, before: np.ndarray, u: np.ndarray) -> float:
        """Work -u.df of the change of the loads from `before` (k, dim), at the displacement `u` (n, dim)."""
        return -self.exchange.total(float(np.vdot(self.values - before, u[self.nodes])))

    def effort(self, before: np.ndarray, du: np.ndarray) -> float:
        """Trapezoidal work f.du of loads that were `before` (k, dim) on the way `du` (n, dim)."""
        return 0.5 * self.exchange.total(float(np.vdot(self.values + before, du[self.nodes])))

    # --- parts of a body ---
    def of_part(self, part: Selection) -> Self:
        """What a part of the body has of them, to be put `on` the space of this part.

        Raises
        ------
        ParameterError
            The kind of load cannot be computed in parts.
        """
        raise ParameterError(f"several ranks cannot compute loads of the kind {type(self).__name__}, which has "
                             f"no of_part: start it on one rank")

    def on(self, space: Space) -> None:
        """Act on the `space` of the part."""
        self.exchange = space.exchange


class Together(NodalLoads):
    """Several loads at once.

    Memory: that of each of them.
    """

    def __init__(self, loads: Sequence[NodalLoads], n_nodes: int) -> None:
        self.loads = tuple(loads)
        self._join(n_nodes)

    def _join(self, n_nodes: int) -> None:
        self._n_nodes = n_nodes
        self.nodes = np.unique(np.concatenate([load.nodes for load in self.loads]))
        self.elements = np.concatenate([load.elements for load in self.loads])
        self.ramps = tuple(ramp for load in self.loads for ramp in load.ramps)
        self.weighs = any(load.weighs for load in self.loads)
        self._add()

    def _add(self) -> None:
        total = np.zeros((self._n_nodes, self.loads[0].values.shape[1]))
        for load in self.loads:
            total[load.nodes] += load.values
        self.values = total[self.nodes]

    def at(self, t: float) -> None:
        """Take the loads of load time `t` [s]."""
        for load in self.loads:
            load.at(t)
        self._add()

    def rate(self, t: float) -> float:
        """Fastest change of one of them [MPa/s]."""
        return max(load.rate(t) for load in self.loads)

    def keep(self, alive: np.ndarray) -> None:
        """Let loads act only on those of `elements` that are `alive` (f,)."""
        ends = np.cumsum([load.elements.size for load in self.loads])
        for load, part in zip(self.loads, np.split(alive, ends[:-1])):
            load.keep(part)
        self._add()

    def weigh(self, gamma: np.ndarray) -> None:
        """Let the loads be those of material with the relative density `gamma` (ne, nq)."""
        for load in self.loads:
            load.weigh(gamma)
        self._add()

    # --- parts of a body ---
    def of_part(self, part: Selection) -> Self:
        """What a part of the body has of each of them."""
        own = copy(self)
        own.loads = tuple(load.of_part(part) for load in self.loads)
        del own.nodes, own.values, own.elements
        return own

    def on(self, space: Space) -> None:
        """Act on the `space` of the part."""
        super().on(space)
        for load in self.loads:
            load.on(space)
        self._join(space.n_nodes)
