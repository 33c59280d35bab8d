"""Observers of a run: they look at it on a schedule of their own, and keep what a resumed run needs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar, TypeVar

from ...errors import CheckpointError, ParameterError
from .view import View

__all__ = ["Observer", "Observers"]

Kind = TypeVar("Kind", bound="Observer")


class Observer:
    """Base of all observers: one derives from it and overrides `look`, and what else is needed.

    Calls come in this order: `open` when the run begins or goes on, and `prepare`; `loading` after every load
    increment; `onset` where the loading has ended in a failure; then, in the event, `begin`, `look` at its first
    state, `look` after every step in which it is :meth:`due`, `pause` between two steps, `look` at its last state,
    `finish`; at last `close`, however the run has ended. A run that ends without a failure has no event: `unfailed`
    takes its place.

    Memory: that of its class, which the hooks `open`, `prepare`, `loading`, `onset`, `unfailed`, `begin`, `due`,
    `look`, `pause`, `finish` and `close` build up in the order above; `kept` names the attributes of which a
    checkpoint needs the values, `memory` gives them.

    Attributes
    ----------
    every: time between two looks [s]; None looks after every step.
    every_passes: the same in a quasi-static event, which has no time.
    """

    every: float | None = None
    every_passes: int = 1
    kept: ClassVar[tuple[str, ...]] = ()

    @property
    def name(self) -> str:
        """What a checkpoint calls it."""
        return type(self).__name__

    def open(self, view: View, memory: Mapping[str, Any] | None = None) -> None:
        """The run begins, or goes on from the `memory` that a checkpoint has; nothing may be written yet."""
        for name in self.kept if memory is not None else ():
            setattr(self, name, memory[name])  # type: ignore[index]

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
            return view.due(self.every_passes)
        return self.every is None or view.due(self.every)

    def look(self, view: View) -> None:
        """Look at the run."""

    def pause(self, view: View) -> None:
        """Between two steps, of loading or event: the run goes on after this one."""

    def finish(self, view: View) -> None:
        """The event has ended."""

    def close(self) -> None:
        """The run has ended, in whatever way."""

    def memory(self) -> dict[str, Any]:
        """What a resumed run needs: arrays, and plain values as JSON has them, by name."""
        return {name: getattr(self, name) for name in self.kept}


class Observers:
    """The observers of one run, in the order in which they look.

    Memory: that of each of them.

    Parameters
    ----------
    standard: those of every run.
    own: a user's, who look after these, or take the place of the one of the same name.

    Raises
    ------
    ParameterError
        Two have the same name, or one has that of another class.
    """

    def __init__(self, standard: Sequence[Observer], users: Sequence[Observer] = ()) -> None:
        names = [observer.name for observer in users]
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise ParameterError(f"two observers are called {twice}: give one of them another `name`")
        by_name = {observer.name: observer for observer in standard}
        for observer in users:
            there = by_name.get(observer.name)
            if there is not None and not isinstance(observer, type(there)):
                raise ParameterError(f"the observer {observer.name} would take the place of one of the run, and is not "
                                     f"of its class: give it another `name`")
            by_name[observer.name] = observer
        self._all = tuple(by_name.values())

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
        """
        if memories is not None:
            if gone := memories.keys() - {observer.name for observer in self._all}:
                raise CheckpointError(f"the run in {view.folder} has the observer {min(gone)}: resume it from Python, "
                                      f"with run(scene, folder, observers=[{min(gone)}(...)], resume=True)")
            if new := {observer.name for observer in self._all if observer.kept} - memories.keys():
                raise CheckpointError(f"the run in {view.folder} was begun without the observer {min(new)}, which has "
                                      f"to see all of it: resume it without, or begin anew")
        for observer in self._all:
            observer.open(view, (memories or {}).get(observer.name))
        for observer in self._all:
            observer.prepare(view)

    def loading(self, view: View) -> None:
        """A load increment has been taken."""
        for observer in self._all:
            observer.loading(view)

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
