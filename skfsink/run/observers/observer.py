"""Observers of a run: they look at it on a schedule of their own, and keep what a resumed run needs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from ...errors import CheckpointError, ParameterError
from ...scene.scene import Scene
from ...scene.schedule import Schedule, check_observers
from ..checkpoint import storable
from .view import View

__all__ = ["Observer", "Observers", "Recorder"]

Kind = TypeVar("Kind", bound="Observer")


class Observer(Schedule):
    """Base of all observers: one derives from it and overrides `look`, and what else is needed.

    Calls come in this order: `check` of a scene; `open` when the run begins or goes on, and `prepare`; `loading` after
    every load increment; `onset` where the loading has ended in a failure; then, in the event, `begin`, `look` at its
    first state, `look` after every step in which it is :meth:`due`, `pause` between two steps, `look` at its last
    state, `finish`; at last `close`, however the run has ended. A run that ends without a failure has no event:
    `unfailed` takes its place. In each call the standard observers come first, :class:`.Crack` before all others, then
    a user's in the order in which they were given; one that takes the place of a standard one comes in its place.

    An observer belongs to one run; that run may be resumed with it, another needs a new one.

    Memory: that of its class, which the hooks `open`, `prepare`, `loading`, `onset`, `unfailed`, `begin`, `due`,
    `look`, `pause`, `finish` and `close` build up in the order above; `kept` names the attributes of which a
    checkpoint needs the values, `memory` gives them, `restore` takes them up.

    Attributes
    ----------
    every: time between two looks [s]; None looks after every step.
    every_passes: the same in a quasi-static event, which has no time.
    kept: names of the attributes that a checkpoint keeps; see :func:`.storable` for what they may be.
    """

    _used = False  #: whether a run has opened it

    def check(self, scene: Scene) -> None:
        """Refuse what it cannot look at (SkfsinkError), before a run touches its folder."""

    def open(self, view: View, memory: Mapping[str, Any] | None = None) -> None:
        """The run begins, or goes on from the `memory` that a checkpoint has; nothing may be written yet."""
        if memory is not None:
            self.restore(memory)

    def prepare(self, view: View) -> None:
        """Files may be made from here on."""

    def loading(self, view: View) -> None:
        """A load increment has been taken."""

    def onset(self, view: View) -> None:
        """The body is loaded to its onset."""

    def unfailed(self, view: View) -> None:
        """The loading has ended without a failure."""

    def begin(self, view: View) -> None:
        """The event begins."""

    def due(self, view: View) -> bool:
        """Whether to look after this step."""
        if view.quasistatic:
            return view.crossed_multiple_of(self.every_passes)
        return self.every is None or view.crossed_multiple_of(self.every)

    def look(self, view: View) -> None:
        """Look at the run."""

    def pause(self, view: View) -> None:
        """Between two steps, of loading or event: the run goes on after this one."""

    def finish(self, view: View) -> None:
        """The event has ended."""

    def close(self) -> None:
        """The run has ended, in whatever way."""

    def memory(self) -> dict[str, Any]:
        """What a resumed run needs, by name; see :func:`.storable` for what it may be.

        Raises
        ------
        ParameterError
            The observer lacks an attribute that it keeps.
        """
        if missing := [name for name in self.kept if not hasattr(self, name)]:
            raise ParameterError(f"the observer {self.name} keeps {missing[0]} and has no such attribute: set it in "
                                 f"`__init__` or `open`")
        return {name: getattr(self, name) for name in self.kept}

    def restore(self, memory: Mapping[str, Any]) -> None:
        """Take up what `memory` gave.

        Raises
        ------
        CheckpointError
            It has not all attributes that the observer keeps.
        """
        if missing := [name for name in self.kept if name not in memory]:
            raise CheckpointError(f"the observer {self.name} of the checkpoint has not kept {missing[0]}: resume with "
                                  f"the class the run was begun with, or begin anew")
        for name in self.kept:
            setattr(self, name, memory[name])


class Recorder(Observer):
    """Base of the observers that keep a table, of which each look adds some rows to `_rows`.

    Memory: the `rows` so far, as :class:`Observer` says.
    """

    kept = ("rows",)

    def __init__(self) -> None:
        self._rows: list[np.ndarray] = []

    @property
    def rows(self) -> np.ndarray:
        """The rows so far, (m, columns)."""
        return np.concatenate(self._rows) if self._rows else np.zeros((0, 0))

    @rows.setter
    def rows(self, rows: np.ndarray) -> None:
        self._rows = [rows] if rows.size else []


def _place(observer: Observer, standard: Sequence[Observer]) -> str:
    """Name of the standard observer in whose place one comes; its own, where it comes beside them."""
    place = next((one.name for one in standard if isinstance(observer, type(one))), "")
    if observer.name != place and observer.name in [one.name for one in standard]:
        raise ParameterError(f"the observer {observer.name} would take the place of one of the run, and is not of its "
                             f"class: give it another `name`")
    return place or observer.name


class Observers:
    """The observers of one run, in the order in which they look.

    Memory: that of each of them, and whether `loading` was called before.

    Parameters
    ----------
    standard: those of every run.
    users: a user's, who look after these; one of the class of a standard one, or of a class that derives from it, takes
        its place.
    resumes: whether they go on with a run, and may have been in it before.

    Raises
    ------
    ParameterError
        They are none, one was in another run, two would take one place or name, or one keeps what cannot be stored.
    """

    def __init__(self, standard: Sequence[Observer], users: Sequence[Observer] = (), resumes: bool = False) -> None:
        self._users, self._has_loaded = check_observers(users), False
        places, taken = {observer.name: observer for observer in standard}, dict[str, str]()
        for observer in self._users:
            name, there = observer.name, vars(observer)
            if observer._used and not resumes:
                raise ParameterError(f"the observer {name} was in a run before and has its rows: make a new one, "
                                     f"{type(observer).__name__}(...), for each run")
            if (place := _place(observer, standard)) in taken:
                raise ParameterError(f"the observers {taken[place]} and {name} would both take the place of {place}: "
                                     f"leave one out")
            places[place], taken[place] = observer, name
            storable(f"observer {name}", {kept: there[kept] for kept in observer.kept if kept in there})
        self._all = tuple(places.values())

    def of(self, kind: type[Kind]) -> Kind:
        """The first one of a class."""
        return next(observer for observer in self._all if isinstance(observer, kind))

    def __iter__(self) -> Iterator[Observer]:
        return iter(self._all)

    def open(self, view: View, memories: Mapping[str, Mapping[str, Any]] | None) -> None:
        """Open all, from their `memories` by name if the run goes on.

        Raises
        ------
        CheckpointError
            The observers are not those the run had.
        ParameterError
            One keeps what cannot be stored.
        """
        if memories is not None:
            if gone := memories.keys() - {observer.name for observer in self._all}:
                raise CheckpointError(f"the run in {view.folder} has the observer {min(gone)}: resume it from Python, "
                                      f"with run(scene, folder, observers=[{min(gone)}(...)], resume=True)")
            if new := {observer.name for observer in self._all if observer.kept} - memories.keys():
                raise CheckpointError(f"the run in {view.folder} was begun without the observer {min(new)}, which has "
                                      f"to see all of it: resume it without, or begin anew")
        for observer in self._all:
            observer._used = True
            observer.open(view, (memories or {}).get(observer.name))
        for observer in self._all:
            observer.prepare(view)
        self._check_memories()

    def _check_memories(self) -> None:
        """See that a checkpoint can keep what a user's observers remember, before much has been computed."""
        for observer in self._users:
            storable(f"observer {observer.name}", observer.memory())

    def loading(self, view: View) -> None:
        """A load increment has been taken."""
        for observer in self._all:
            observer.loading(view)
        if not self._has_loaded:
            self._has_loaded = True
            self._check_memories()

    def onset(self, view: View) -> None:
        """The body is loaded to its onset."""
        for observer in self._all:
            observer.onset(view)

    def unfailed(self, view: View) -> None:
        """The loading has ended without a failure."""
        for observer in self._all:
            observer.unfailed(view)

    def begin(self, view: View) -> None:
        """The event begins."""
        for observer in self._all:
            observer.begin(view)
            observer.look(view)
        self._check_memories()

    def step(self, view: View) -> None:
        """A step or a pass has been taken."""
        for observer in self._all:
            if observer.due(view):
                observer.look(view)

    def pause(self, view: View) -> None:
        """Between two steps."""
        for observer in self._all:
            observer.pause(view)

    def finish(self, view: View) -> None:
        """The event has ended."""
        for observer in self._all:
            observer.look(view)
            observer.finish(view)

    def close(self) -> None:
        """The run has ended."""
        for observer in self._all:
            observer.close()

    def memories(self) -> dict[str, dict[str, Any]]:
        """The memory of each that has one, by name."""
        return {observer.name: memory for observer in self._all if (memory := observer.memory())}
