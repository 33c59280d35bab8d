"""What options check of a user's observers before anything is computed: when they look, and what they keep."""

from __future__ import annotations

from typing import Any, ClassVar

from ..errors import ParameterError, require

__all__ = ["Schedule", "check_observers"]


class Schedule:
    """When an observer looks, what a checkpoint keeps of it, and what it is called there.

    :class:`skfsink.Observer` derives from it, and is what one derives from.

    Attributes
    ----------
    every: time between two looks [s], > 0; None looks after every step.
    every_passes: the same in a quasi-static event, which has no time, >= 1.
    kept: names of the attributes that a checkpoint keeps.
    """

    every: float | None = None
    every_passes: int = 1
    kept: ClassVar[tuple[str, ...]] = ()

    @property
    def name(self) -> str:
        """What a checkpoint calls it."""
        return type(self).__name__


def check_observers(observers: Any) -> tuple[Any, ...]:
    """A user's observers, as a tuple.

    Raises
    ------
    ParameterError
        They are no list of observers, two have one name, or one has a schedule that cannot be.
    """
    if isinstance(observers, Schedule):
        raise ParameterError(f"observers must be a list: give [{type(observers).__name__}(...)]")
    if not isinstance(observers, list | tuple):
        raise ParameterError(f"observers must be a list of observers; got {observers!r:.80}")
    for observer in observers:
        _check(observer)
    names = [observer.name for observer in observers]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise ParameterError(f"two observers are called {twice}: give one of them another `name`")
    return tuple(observers)


def _check(observer: Any) -> None:
    if isinstance(observer, type) and issubclass(observer, Schedule):
        raise ParameterError(f"observers must be objects: give {observer.__name__}(...), not the class "
                             f"{observer.__name__}")
    if not isinstance(observer, Schedule):
        raise ParameterError(f"an observer must be of a class that derives from skfsink.Observer; got {observer!r:.80}")
    name, kind = observer.name, type(observer).__name__
    if not isinstance(name, str) or not name or not name.isprintable():
        raise ParameterError(f"the name of an observer {kind} must be text; got {name!r:.80}")
    if observer.every is not None:
        require(f"every of the observer {name}", observer.every, "s", low=0, low_open=True)
    require(f"every_passes of the observer {name}", observer.every_passes, low=1, whole=True)
    kept = observer.kept
    if not isinstance(kept, list | tuple) or not all(isinstance(word, str) and word.isidentifier() for word in kept):
        raise ParameterError(f"kept of the observer {name} must be names of attributes, such as (\"rows\",); got "
                             f"{kept!r:.80}")
