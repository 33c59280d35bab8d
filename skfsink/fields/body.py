"""The body that every method works on: its balances of momentum and mass, and what loads it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from ..errors import ParameterError
from ..fem.space import Space
from ..loads.schedule import Loading
from ..material import Material, SinkLaw
from ..material.homogeneous import wave_speed_at_failure
from ..material.regions import Region
from .contact import Contact
from .crack import CRACKED
from .deletion import GONE
from .density import DensitySolver
from .momentum import BulkViscosity, Momentum
from .state import State

__all__ = ["Body", "BodyControls", "BodyScene"]


class BodyControls(Protocol):
    """What the balances ask of the options of a scene; see :class:`.Controls`."""

    @property
    def element(self) -> str:
        """Name in :data:`.ELEMENTS`."""

    @property
    def kernels(self) -> str:
        """Name in :data:`.BACKENDS`."""

    @property
    def sink(self) -> str:
        """Name in :data:`.SINKS`."""

    @property
    def gradient(self) -> str:
        """Name in :data:`.GRADIENTS`."""

    @property
    def density_solver(self) -> str:
        """Name in :data:`.SOLVERS`."""

    @property
    def active_zone(self) -> bool:
        """Whether gamma is solved for only where it changes."""

    @property
    def force_floor(self) -> float:
        """Gamma below which a Gauss point exerts no force."""

    @property
    def deletion(self) -> float:
        """Gamma at which an element fails."""

    @property
    def contact(self) -> bool:
        """Whether the lips of cracks bear on each other."""

    @property
    def bulk_viscosity_linear(self) -> float:
        """Coefficient b1 of the bulk viscosity."""

    @property
    def bulk_viscosity_quadratic(self) -> float:
        """Coefficient b2 of the bulk viscosity."""

    def workers(self, dim: int) -> int:
        """Threads for a body of that dimension."""


class BodyScene(Protocol):
    """What a body is made from: a :class:`.Scene`, of which this package asks no more."""

    @property
    def space(self) -> Space:
        """The spaces."""

    @property
    def material(self) -> Material:
        """Stored energy of the elements that are in no region."""

    @property
    def sink_law(self) -> SinkLaw:
        """Their sink."""

    @property
    def regions(self) -> Sequence[Region]:
        """Elements of other materials."""

    @property
    def broken(self) -> np.ndarray:
        """Numbers of the elements of initial cracks."""

    @property
    def cut(self) -> np.ndarray:
        """Those of cracks whose lips are whole."""

    @property
    def controls(self) -> BodyControls:
        """Options."""

    def loading(self) -> Loading:
        """What is held, moved and pulled."""


@dataclass(frozen=True, eq=False)
class Body:
    """A body and what is done to it.

    Memory: that of its momentum balance, which is at the density and load time last given to it; see :meth:`take`.

    Parameters
    ----------
    momentum, density: the balances of momentum and of mass.
    loading: what is held, moved and pulled at each load time.
    deletion: gamma at which an element fails.
    threads: that share factorisations and loops over elements.
    broken: numbers of the elements that are broken from the start.

    Raises
    ------
    ParameterError
        The momentum balance has other loads than the loading.
    """

    momentum: Momentum
    density: DensitySolver
    loading: Loading
    deletion: float = 1e-6
    threads: int = 1
    broken: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))

    def __post_init__(self) -> None:
        if self.momentum.dead is not self.loading.dead:
            raise ParameterError("the momentum balance has other dead loads than the loading: give it `loading.dead`")
        if self.momentum.followers is not self.loading.followers:
            raise ParameterError("the momentum balance has other pressures than the loading: give it "
                                 "`loading.followers`")
        self.momentum.sliding = self.loading.sliding
        if self.loading.sliding is not None and self.momentum.contact is not None:
            raise ParameterError("contact is for boundaries that slide along axes, and one slides on an oblique plane: "
                                 "turn the body, or leave contact out")

    @classmethod
    def of(cls, scene: BodyScene) -> Body:
        """The body of a :class:`.Scene`."""
        controls, space, loading = scene.controls, scene.space, scene.loading()
        threads = controls.workers(space.dim)
        momentum = Momentum(space, scene.material, controls.element, controls.force_floor, threads,
                            regions=scene.regions, dead=loading.dead, followers=loading.followers,
                            kernels=controls.kernels,
                            bulk_viscosity=BulkViscosity(controls.bulk_viscosity_linear,
                                                         controls.bulk_viscosity_quadratic))
        if controls.contact:
            momentum.contact = Contact(space, momentum.parts, loading.free)
        density = DensitySolver(space, scene.sink_law, controls.sink, active_zone=controls.active_zone,
                                solver=controls.density_solver, regions=scene.regions, kernels=controls.kernels,
                                gradient=controls.gradient, absent=scene.cut)
        return cls(momentum, density, loading, controls.deletion, threads, scene.broken)

    @property
    def space(self) -> Space:
        """The spaces."""
        return self.momentum.space

    @property
    def free(self) -> np.ndarray:
        """Mask of the degrees of freedom that nothing holds, (n*dim,)."""
        return self.loading.free

    @property
    def size(self) -> float:
        """Greatest extent along an axis [mm]."""
        return float(np.ptp(self.space.X, axis=0).max())

    @property
    def least_energy(self) -> float:
        """Energy [N mm; N mm/mm in 2D] below which rounding is seen: 1e-6 of what a crack takes as it runs by l."""
        return 1e-6 * self.density.law.phi * self.density.law.length_scale ** self.space.volume_dim

    @property
    def crack_energy(self) -> float:
        """What a crack takes as it runs by l, Phi l^d [N mm; N mm/mm in 2D]: the scale of a body without any energy."""
        return self.density.law.phi * self.density.law.length_scale ** self.space.volume_dim

    @cached_property
    def wave_speed_at_failure(self) -> float:
        """Greatest speed of :func:`.wave_speed_at_failure` among the materials [m/s]."""
        pairs = zip(self.momentum.parts, self.density.parts, strict=True)
        return self.space.exchange.greatest(max(wave_speed_at_failure(part.material, law) for part, (_, law) in pairs))

    # --- initial cracks ---
    def begin(self, state: State | None = None) -> State:
        """The undeformed body at rest, intact but for initial cracks: an intact `state` with these in it."""
        state = State.intact(self.space) if state is None else state
        if self.broken.size:
            state.W_max[self.broken] = GONE * np.broadcast_to(self.density.phi, state.W_max.shape)[self.broken]
            state.gamma = self._begun.copy()
            state.deleted[self.broken] = True
            state.deleted |= (self.space.at_gauss(state.gamma) <= self.deletion).all(axis=1)
        return state

    @cached_property
    def _begun(self) -> np.ndarray:
        """Density around initial cracks, (n,): the history of what has failed, and gamma with it."""
        if self.density.absent.size == self.broken.size:  # all of them are cuts
            return (self.density.load > 0.0).astype(float)
        W_max = np.zeros_like(self.space.w)
        W_max[self.broken] = GONE * np.broadcast_to(self.density.phi, W_max.shape)[self.broken]
        return self.density.solve(W_max, np.ones(self.space.n_nodes))

    @cached_property
    def cracked(self) -> np.ndarray:
        """Mask of the nodes that initial cracks have cracked, (n,)."""
        return self._begun < CRACKED if self.broken.size else np.zeros(self.space.n_nodes, bool)

    def kept(self, gamma: np.ndarray) -> np.ndarray:
        """Share of the density at the beginning that is left at `gamma` (n,), and 1 in an initial crack."""
        if not self.broken.size:
            return gamma
        return np.where(self.cracked, 1.0, gamma / np.where(self.cracked, 1.0, self._begun))

    def since_begun(self, state: State) -> State:
        """A state with the density that is :meth:`kept`, without history in initial cracks: what the body saw."""
        if not self.broken.size:
            return state
        W_max = state.W_max.copy()
        W_max[self.broken] = 0.0
        return replace(state, gamma=self.kept(state.gamma), W_max=W_max)

    def release(self) -> None:
        """Free the memory of matrices, and of solvers for gamma; they are made again when they are needed."""
        if self.broken.size:
            self._begun  # noqa: B018  (kept, since it is what they would be made again for)
        self.density.release()
        vars(self.space).pop("invJ", None)

    def take(self, state: State) -> np.ndarray:
        """Bring the momentum balance to load time, density and displacement of a state; its force less dead loads."""
        self.momentum.set_time(state.grip)
        self.momentum.set_gamma(state.gamma, state.deleted)
        return self.momentum.force(state.u)
