"""The explicit integrator of a body in parts, as a run on the first rank sees it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...errors import ParameterError
from ...fem.petsc_matrix import PETSC, check
from ...fields.body import Body, BodyScene
from ...fields.state import State
from ..controls import EventControls
from ..integrators import INTEGRATORS, Integrator
from ..looked import Pieces
from .crew import Crew
from .gathered import Gathered
from .part import check_parts, parts_of
from .parted import Parted
from .partition import check_ranks
from .statics import check_statics
from .world import world

__all__ = ["InParts", "RankOptions", "integrator_of", "ranks_text", "refuse"]

MOVING, DENSITY = ("u", "v", "a", "W_max"), ("gamma", "sink")
NODAL = {"reaction", "viscous"}  # of the memory of an integrator


class RankOptions(NamedTuple):
    """What a run on several ranks can be asked for.

    Attributes
    ----------
    partition: folder with the parts of the body; None cuts it.
    frame_pieces: whether each rank writes its piece of a frame.
    """

    partition: Path | None = None
    frame_pieces: bool = False


def integrator_of(name: str, body: Body, controls: EventControls, options: RankOptions = RankOptions()) -> Integrator:  # noqa: B008
    """The integrator of an event: that of a body in parts where there are several ranks, and it has one."""
    comm = world()
    if comm is None or name != "explicit":
        return INTEGRATORS[name].of(body, controls)
    return InParts(body, controls, Crew(comm), options)


def ranks_text(analysis: str, integrator: str, linear: str) -> str:
    """What the ranks that there are do; empty for one."""
    comm = world()
    if comm is None:
        return ""
    loaded = "all of them load the body" if linear in PETSC else "one loads the body"
    if (analysis, integrator) == ("dynamic", "explicit"):
        return f"{comm.size} ranks: {loaded}, all of them compute its event"
    if linear in PETSC:
        event = "its equilibria" if analysis == "quasistatic" else "equilibria, and one computes its dynamic event"
        return f"{comm.size} ranks: {loaded} and compute {event}"
    return (f"{comm.size} ranks: one computes all of it, the others wait; parts know the explicit event alone, and "
            f"statics with linear {' or '.join(PETSC)}")


def refuse(scene: BodyScene, analysis: str, integrator: str, linear: str, parted: Path | None = None,
           subcycled: float = 0.0) -> None:
    """Refuse what the ranks that there are cannot compute, and solvers that are not there, before the body is loaded.

    The same of parts in a folder that are not those of this mesh for these ranks.

    Raises
    ------
    ParameterError
        Which it is.
    """
    check(linear)
    comm = world()
    if parted is not None:
        if analysis == "quasistatic" or integrator != "explicit":
            raise ParameterError("a partition is for an explicit event, and this run has none: leave partition out")
        Parted(parted).check(scene.space, 1 if comm is None else comm.size)
    if comm is None:
        return
    parts = linear in PETSC
    if parts:
        check_statics(scene.loading(), scene.controls, linear)
    if parts or (analysis != "quasistatic" and integrator == "explicit"):
        check_ranks(comm.size, scene.space.n_elements)
    if analysis != "quasistatic" and integrator == "explicit":
        check_parts(scene.space, scene.loading(), scene.controls, subcycled)


def _is_light(body: Body) -> bool:
    """Whether all that is asked of the momentum balance of a body can be fetched from its parts."""
    momentum = body.momentum
    return momentum.dead is None and momentum.followers is None and momentum.contact is None


class InParts:
    """See :class:`.Integrator` and :class:`.Explicit`.

    What changes in the parts is fetched when it is asked for: fields of the state, the reaction, stresses, and what the
    momentum balance of the whole body knows; of this no more is kept than that takes (see :class:`.Gathered`).

    Memory: that of all ranks: after `begin` or `restore`, `run`, `sync`, `reaction`, `stress` and `crushed` are of the
    state last stepped.
    """

    factorisations = 0

    def __init__(self, body: Body, controls: EventControls, crew: Crew, options: RankOptions = RankOptions()) -> None:  # noqa: B008
        self.body, self.crew, self.options = body, crew, options
        parted = None if options.partition is None else Parted(options.partition)
        self._gathered = Gathered(body.momentum, self._fetch) if _is_light(body) else None
        body.release()
        crew.take(parts_of(body, controls.explicit, crew.size, parted))
        self._own, self._reaction = crew.member.explicit, np.zeros((0, 0))
        self._state: State | None = None

    @classmethod
    def of(cls, body: Body, controls: EventControls) -> Integrator:
        """That of the ranks that there are; see :func:`integrator_of`."""
        return integrator_of("explicit", body, controls)

    # --- what a run asks ---
    @property
    def dt(self) -> float:
        """The current step [s]."""
        return self._own.dt

    @property
    def rejected(self) -> int:
        """Steps that were made again at half length."""
        return self._own.rejected

    @property
    def added_mass(self) -> float:
        """Of the smallest elements, over that of the intact body."""
        return self._own.added_mass

    @property
    def reaction(self) -> np.ndarray:
        """(n, dim) internal and viscous force less the loads, as it is now."""
        if not self._reaction.size:
            self._reaction = self._fetch("reaction")
        return self._reaction

    @property
    def solves(self) -> int:
        """Solves for gamma in the parts."""
        return self._own.density.solves

    @property
    def pieces(self) -> Pieces | None:
        """Those of the ranks, if these write frames in pieces."""
        return Pieces(self.crew.size, self.crew.each) if self.options.frame_pieces else None

    def stress(self, state: State) -> np.ndarray:
        """Mean Cauchy stress of the elements [MPa], (ne, 6), as the parts find it."""
        return self._fetch("stress")

    def crushed(self, state: State) -> np.ndarray:
        """Mask of the elements that no stress is defined for, (ne,)."""
        return self._fetch("crushed")

    def cost(self) -> dict[str, Any]:
        """`ranks`: what each has used of memory [MB], and how often they have told each other something.

        `halos` are sums at the nodes between parts, `sums` numbers that all parts give.
        """
        exchange = self.crew.member.exchange
        return {"ranks": {"peak_rss_mb": [round(peak, 1) for peak in self.crew.peaks()], "halos": exchange.halos,
                          "sums": exchange.sums_made, "gamma_iterations": self._own.density.iterations}}

    def begin(self, state: State) -> None:
        """Set the body in motion."""
        self.crew.begin(state)
        self._renew(state, True)

    def run(self, state: State, t_end: float) -> Iterator[State]:
        """Step until `t_end` [s], yielding the state after each step."""
        while state.time < t_end:
            part = self.crew.member.state
            gamma = part.gamma
            self.crew.step()
            self._renew(state, part.gamma is not gamma)
            yield state

    def step_share(self, state: State) -> float:
        """The step over the stability limit as the body is now."""
        return self.crew.share()

    def sync(self, state: State) -> None:
        """Bring `state.W_max` up to date."""
        self.crew.sync()
        state.put_off("W_max", fetch=self._fetch)

    def _renew(self, state: State, solved: bool) -> None:
        """Bring clocks and energies of the whole body up to date, and put off its fields."""
        part = self.crew.member.state
        state.time, state.grip, state.step, state.ledger = part.time, part.grip, part.step, part.ledger
        state.put_off(*MOVING, fetch=self._fetch)
        if solved:
            state.put_off(*DENSITY, fetch=self._fetch)
            new = self.crew.new_deletions()
            state.deletions.extend(new)
            state.deleted[[element for _, element in new]] = True
        whole, part_momentum = self.body.momentum, self.crew.member.body.momentum
        whole.least_J = part_momentum.least_J
        self._reaction, self._state = np.zeros((0, 0)), state
        if self._gathered is not None:
            whole.energy = part_momentum.energy
            self._gathered.now(state)

    def _fetch(self, name: str) -> Any:
        if name == "W_max":
            self.crew.sync()
        value = self.crew.gather(name)
        if name == "u" and self._gathered is None and self._state is not None and value is not None:
            momentum = self.body.momentum  # for those who look at stresses and energies
            momentum.set_time(self._state.grip)
            if (kept := self.crew.gather("kept_volume")) is not None:  # below what has failed, which the parts know
                momentum.restore({**momentum.memory(), "kept_volume": kept})
            momentum.set_gamma(self._state.gamma, self._state.deleted)
            momentum.force(value)
        return value

    # --- checkpoints ---
    def memory(self) -> dict[str, np.ndarray]:
        """What the integrator remembers, by numbers of the whole body: as :meth:`.Explicit.memory` gives it."""
        memories = self.crew.memories()
        first = memories[0]
        mode: np.ndarray = np.empty(sum(memory["numbers"].size for memory in memories))
        for memory in memories:
            mode[memory["numbers"]] = memory["mode"]
        whole = {name: value for name, value in first.items() if name != "numbers"} | {"mode": mode}
        for name in NODAL.intersection(first):
            whole[name] = self._whole(name, memories)
        if "kept_volume" in first:
            volume = np.concatenate([memory["kept_volume"] for memory in memories])
            whole["kept_volume"] = np.empty_like(volume)
            whole["kept_volume"][np.concatenate(self.crew.facets)] = volume
        return whole

    def _whole(self, name: str, memories: list[dict[str, np.ndarray]]) -> np.ndarray:
        whole: np.ndarray = np.empty_like(self.body.space.X)
        for part, memory in zip(self.crew.numbers, memories):
            whole[part.nodes] = memory[name]
        return whole

    def restore(self, state: State, memory: dict[str, np.ndarray]) -> None:
        """Go on where :meth:`memory` was taken, on any number of ranks."""
        dim, free = self.body.space.dim, self.body.free
        number = np.cumsum(free) - 1
        memories = []
        for part, facets in zip(self.crew.numbers, self.crew.facets):
            dofs = (part.nodes[:, None] * dim + np.arange(dim)).ravel()
            own = number[dofs[free[dofs]]]
            memories.append({**memory, "mode": memory["mode"][own]})
            for name in NODAL.intersection(memory):
                memories[-1][name] = memory[name][part.nodes]
            if "kept_volume" in memory:
                memories[-1]["kept_volume"] = memory["kept_volume"][facets]
        if self._gathered is None:
            self.body.momentum.restore(memory)
            self.body.take(state)
        self.crew.restore(state, memories)
        self._renew(state, False)
