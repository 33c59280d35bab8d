"""Ranks that have a part of the body each, and do what the first one asks.

The first rank runs the program: it loads the body, looks at the event, writes files. The others wait for what it
asks: to take up their part, to step, to give what they have of a field. All of them step together.
"""

from __future__ import annotations

import logging
import os
import signal
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar, cast

import numpy as np

from ...errors import OutputError, ParameterError, SkfsinkError
from ...fields.state import State
from ...fields.stress import cauchy_stress
from ...system.peak import peak_rss_mb
from ..explicit import Explicit
from .mpi import MPIExchange, wait
from .part import ELEMENTAL, NODAL, PartOfBody, state_of
from .partition import Numbers
from .tangent import TangentOfPart

if TYPE_CHECKING:
    from mpi4py import MPI

__all__ = ["Crew", "Member", "lead"]

T = TypeVar("T")
IDLE = 1e-3    # s without a task, after which a rank looks for one less often
UNEXPECTED = 1  # exit status of a program that ends by a mistake of its own
#: what the first rank asks of all: to take something that it gives, to do something, to give something back
GIVEN, DONE, COLLECTED = ("take", "begin", "restore"), ("step", "sync", "share"), ("new_deletions", "memory", "peak")
TASKS = (*GIVEN, *DONE, *COLLECTED, "gather", "each", "tangent", "end")
#: of the elements, at the last force: W, gamma at Gauss points, Cauchy stress, and whether none is defined
EVALUATED = ("W", "points", "stress", "crushed")
#: fields that can be gathered
FIELDS = (*NODAL, *ELEMENTAL, *EVALUATED, "reaction", "kept_volume")


def lead(comm: MPI.Intracomm, program: Callable[[], object]) -> NoReturn:
    """Run the `program` on the first rank, and let the others serve it; all end with it."""
    crew = Crew(comm)
    if comm.rank:
        crew.serve()
    try:
        program()
    except SystemExit as end:
        if end.code == UNEXPECTED:  # the others may be in the middle of a step
            comm.Abort(UNEXPECTED)
        crew.end()
        raise
    except BaseException:
        traceback.print_exc()
        comm.Abort(UNEXPECTED)
    crew.end()
    raise SystemExit(0)


class Member:
    """One rank with its part of the body.

    Memory: its part, the state of this and its integrator: after `take`, and `begin` or `restore`, `step`, `sync`,
    `share`, `field`, `new_deletions` and `memory` go on with them.
    """

    def __init__(self, comm: MPI.Intracomm) -> None:
        self.comm = comm
        self.part: PartOfBody | None = None
        self.tangent = TangentOfPart(comm)

    def take(self, part: PartOfBody) -> None:
        """Take up a part of the body; ParameterError on all ranks if one of them cannot read its."""
        part = self.agreed(lambda: part.read(self.comm.rank), ParameterError)
        self.part, self.body = part, part.body(self.comm)
        self.explicit = Explicit(self.body, part.controls)
        assert isinstance(self.body.space.exchange, MPIExchange)
        self.exchange = self.body.space.exchange
        self.logged = 0

    def agreed(self, does: Callable[[], T], kind: type[SkfsinkError]) -> T:
        """What `does` returns; what goes wrong on one rank goes wrong on all, as an error of a `kind`."""
        said, value = "", None
        try:
            value = does()
        except kind as error:
            said = str(error)
        if failures := [text for text in self.comm.allgather(said) if text]:
            raise kind(failures[0])
        return cast(T, value)

    def each(self, task: tuple[Callable[..., T], tuple[Any, ...]]) -> T:
        """What a function returns for this rank, and further arguments; OutputError on all if it is one's."""
        function, arguments = task
        return self.agreed(lambda: function(self, *arguments), OutputError)

    def begin(self, state: State) -> None:
        """Set the part in motion."""
        self.state = state
        self.explicit.begin(state)

    def restore(self, state: State, memory: dict[str, np.ndarray]) -> None:
        """Go on where a checkpoint was taken."""
        self.state = state
        self.explicit.restore(state, memory)

    def step(self) -> None:
        """One step, as all others."""
        self.explicit.step(self.state)

    def sync(self) -> None:
        """Bring the history of the part up to date."""
        self.explicit.sync(self.state)

    def share(self) -> float:
        """The step over its stability limit, in the whole body."""
        return self.explicit.step_share(self.state)

    def field(self, name: str) -> np.ndarray | None:
        """What counts here of a field: of the nodes, or of the elements, or of facets that pressures act on."""
        assert self.part is not None
        if name == "kept_volume":
            return self.body.momentum.memory().get(name)
        if name == "reaction":
            return self.explicit.reaction[:self.part.numbers.counted]
        if name in EVALUATED:
            momentum = self.body.momentum
            if name in ("W", "points"):
                return momentum.W if name == "W" else momentum.gamma
            stress = cauchy_stress(momentum, self.state.u)
            return stress if name == "stress" else np.isnan(stress).any(axis=1)
        value: np.ndarray | None = getattr(self.state, name)
        return value if value is None or name in ELEMENTAL else value[:self.part.numbers.counted]

    def new_deletions(self) -> list[tuple[float, int]]:
        """What has failed here since it was last asked for, by numbers in the whole body."""
        assert self.part is not None
        new, self.logged = self.state.deletions[self.logged:], len(self.state.deletions)
        return [(t, int(self.part.numbers.elements[e])) for t, e in new]

    def memory(self) -> dict[str, np.ndarray]:
        """What the integrator remembers; vectors over free unknowns are those that count here."""
        unknowns, memory = self.body.space.exchange.over(self.body.free), self.explicit.memory()
        return {**memory, "mode": memory["mode"][unknowns.counted], "numbers": unknowns.numbers[unknowns.counted]}

    def peak(self) -> float:
        """Greatest memory that this rank has used [MB]."""
        return peak_rss_mb()


class Crew:
    """All ranks, as the first of them leads them, or another one serves.

    Memory: the part of this rank, and the `numbers` and `facets` of all: after `take`, `begin`, `restore` and `gather`
    are of them.

    Parameters
    ----------
    comm: the ranks.
    """

    def __init__(self, comm: MPI.Intracomm) -> None:
        self.comm, self.member = comm, Member(comm)

    @property
    def size(self) -> int:
        """Number of ranks."""
        return int(self.comm.size)

    # --- the first rank ---
    def _ask(self, task: str, detail: int = 0) -> None:
        wait(self.comm.Ibcast(np.array([TASKS.index(task), detail], np.int64)))

    def _give(self, task: str, items: Iterable[tuple[Any, ...]]) -> None:
        """Items are made, sent and forgotten one by one: all of them may be as large as the body."""
        items = iter(items)
        own = next(items)  # what cannot be made is told before the others wait for it
        self._ask(task)
        for rank, item in enumerate(items, 1):
            self.comm.send(item, rank)
        getattr(self.member, task)(*own)

    def _do(self, task: str) -> Any:
        self._ask(task)
        return getattr(self.member, task)()

    def _collect(self, task: str) -> list[Any]:
        self._ask(task)
        return self.comm.gather(getattr(self.member, task)()) or []

    def tangent(self, task: str, items: Sequence[tuple[Any, ...]]) -> list[Any]:
        """What a method of :class:`.TangentOfPart` gives on every rank, with arguments for each."""
        self._ask("tangent")
        mine = self.comm.scatter([(task, *item) for item in items])
        return self.comm.gather(self.member.tangent.do(*mine)) or []

    def take(self, parts: Iterable[PartOfBody]) -> None:
        """Give every rank its part."""
        self.numbers: list[Numbers] = []
        self.facets: list[np.ndarray] = []  # that pressures act on, by their numbers in the whole

        def each() -> Iterator[tuple[PartOfBody]]:
            for part in parts:
                followers = part.loading.followers
                self.numbers.append(part.numbers)
                self.facets.append(np.zeros(0, np.int64) if followers is None else followers.places)
                yield (part,)

        self._give("take", each())

    def begin(self, state: State) -> None:
        """Set the body in motion from a state of the whole."""
        self._give("begin", ((state_of(state, part),) for part in self.numbers))

    def restore(self, state: State, memories: list[dict[str, np.ndarray]]) -> None:
        """Go on from a state of the whole, and what the integrator of each part remembers."""
        self._give("restore", ((state_of(state, part), memory) for part, memory in zip(self.numbers, memories)))

    def step(self) -> None:
        """One step of all."""
        self._do("step")

    def sync(self) -> None:
        """Bring histories up to date."""
        self._do("sync")

    def share(self) -> float:
        """The step over its stability limit."""
        return float(self._do("share"))

    def new_deletions(self) -> list[tuple[float, int]]:
        """What has failed since it was last asked for."""
        return sorted(entry for log in self._collect("new_deletions") for entry in log)

    def memories(self) -> list[dict[str, np.ndarray]]:
        """What the integrator of each part remembers."""
        return self._collect("memory")

    def peaks(self) -> list[float]:
        """Greatest memory that each rank has used [MB]."""
        return self._collect("peak")

    def gather(self, name: str) -> np.ndarray | None:
        """A field of the whole body, one of :data:`FIELDS`."""
        self._ask("gather", FIELDS.index(name))
        own = self.member.field(name)
        if own is None:
            return None
        places = (self.facets if name == "kept_volume" else
                  [n.nodes[:n.counted] if name in (*NODAL, "reaction") else n.elements for n in self.numbers])
        whole: np.ndarray = np.empty((sum(place.size for place in places), *own.shape[1:]), own.dtype)
        whole[places[0]] = own
        for rank, place in enumerate(places[1:], 1):
            values = np.empty((place.size, *own.shape[1:]), own.dtype)
            wait(self.comm.Irecv(values, rank))
            whole[place] = values
        return whole

    def each(self, function: Callable[..., T], *arguments: Any) -> T:
        """Let every rank call a function that can be imported, with its :class:`Member` and `arguments`.

        Returns what it gave on the first one. OutputError if it was one's.
        """
        self._ask("each")
        return self.member.each(self.comm.bcast((function, arguments)))

    def end(self) -> None:
        """Let all others go."""
        self._ask("end")

    # --- the others ---
    def serve(self) -> NoReturn:
        """Do what the first rank asks, until it lets this one go; what goes wrong here alone ends all ranks."""
        for interrupt in (signal.SIGINT, signal.SIGTERM):  # the first rank decides what becomes of them
            signal.signal(interrupt, signal.SIG_IGN)
        logging.disable()  # what there is to say the first rank says
        try:
            while (task := self._next_task())[0] != "end":
                with suppress(SkfsinkError):  # it is that of all ranks, and the first one tells it
                    self._serve(*task)
        except BaseException as error:
            if "SKFSINK_DEBUG" in os.environ:
                traceback.print_exc()
            print(f"skfsink: rank {self.comm.rank}: {type(error).__name__}: {error}", file=sys.stderr, flush=True)
            self.comm.Abort(1)
        raise SystemExit(0)

    def _next_task(self) -> tuple[str, int]:
        task = np.empty(2, np.int64)
        wait(self.comm.Ibcast(task), IDLE)
        return TASKS[task[0]], int(task[1])

    def _serve(self, task: str, detail: int) -> None:
        member, comm = self.member, self.comm
        if task in GIVEN:
            getattr(member, task)(*comm.recv(source=0))
        elif task in COLLECTED:
            comm.gather(getattr(member, task)())
        elif task == "each":
            member.each(comm.bcast(None))
        elif task == "tangent":
            comm.gather(member.tangent.do(*comm.scatter(None)))
        elif task == "gather":
            if (values := member.field(FIELDS[detail])) is not None:
                wait(comm.Isend(np.ascontiguousarray(values), 0))
        else:
            getattr(member, task)()
