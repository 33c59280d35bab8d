"""One sample in place of all that would be read or made: for a scene that is made again without its mesh."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from typing import TYPE_CHECKING, ParamSpec

if TYPE_CHECKING:
    from .sample import Sample

__all__ = ["reusable", "reusing"]

P = ParamSpec("P")
_SAMPLE: ContextVar[Sample | None] = ContextVar("_SAMPLE", default=None)


@contextmanager
def reusing(sample: Sample) -> Iterator[None]:
    """Within it, what is :func:`reusable` gives this sample."""
    token = _SAMPLE.set(sample)
    try:
        yield
    finally:
        _SAMPLE.reset(token)


def reusable(read: Callable[P, Sample]) -> Callable[P, Sample]:
    """Make a function that reads or makes a sample give the one of :func:`reusing`, if there is one."""
    @wraps(read)
    def sample(*args: P.args, **kwargs: P.kwargs) -> Sample:
        return _SAMPLE.get() or read(*args, **kwargs)

    return sample
