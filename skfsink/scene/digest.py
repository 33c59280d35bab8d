"""A hash of values of any make: equal for equal content, whatever its length, the process or the machine."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Iterator, Mapping, Set
from dataclasses import fields, is_dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

__all__ = ["digest"]


def digest(value: Any) -> str:
    """Hash of numbers, text, arrays, sequences, mappings, functions, and objects of these.

    Numbers that are equal have the same hash, of whatever kind they are. An object is its class and its attributes
    but for cached ones; a class or function that is not of this package is its source as well.
    """
    hashed = hashlib.sha256()
    for piece in _pieces(value):
        hashed.update(f"{len(piece)} ".encode() + piece)
    return hashed.hexdigest()


def _pieces(value: Any) -> Iterator[bytes]:
    if value is None or isinstance(value, str | bytes):
        yield type(value).__name__.encode()
        yield value.encode() if isinstance(value, str) else value or b""
    elif isinstance(value, bool | int | float | np.number | np.bool_):
        yield b"number"
        exact = isinstance(value, int) and abs(value) >= 2**53  # no float has all digits of it
        yield (repr(value) if exact else repr(float(value) + 0.0)).encode()
    elif isinstance(value, np.ndarray):
        yield f"array {value.dtype.str} {value.shape}".encode()
        yield value.tobytes() if value.dtype != object else digest(value.tolist()).encode()
    elif isinstance(value, Mapping):
        yield b"mapping"
        for key, item in sorted((digest(key), digest(item)) for key, item in value.items()):
            yield f"{key} {item}".encode()
    elif isinstance(value, Set):
        yield b"set"
        yield from sorted(digest(item).encode() for item in value)
    elif isinstance(value, list | tuple):
        yield b"sequence"
        yield from (digest(item).encode() for item in value)
    elif isinstance(value, partial):
        yield b"partial"
        yield digest([value.func, value.args, value.keywords]).encode()
    elif isinstance(value, type) or (callable(value) and not is_dataclass(value)):
        yield from _code(value)
    else:
        yield from _code(type(value))
        kept = {name for name in getattr(value, "__dict__", {})
                if not isinstance(inspect.getattr_static(type(value), name, None), cached_property)}
        names = kept | ({field.name for field in fields(value)} if is_dataclass(value) else set())
        yield digest({name: getattr(value, name) for name in names}).encode()


def _code(subject: Any) -> Iterator[bytes]:
    """Name of a class or function, and what it does if it is not of this package, whose version a checkpoint has."""
    subject = getattr(subject, "py_func", subject)  # a compiled function
    yield str(getattr(subject, "__qualname__", type(subject).__qualname__)).encode()
    if str(getattr(subject, "__module__", "")).partition(".")[0] == "skfsink":
        return
    try:
        yield inspect.getsource(subject).encode()
    except (OSError, TypeError):
        yield getattr(getattr(subject, "__code__", None), "co_code", b"")
    if isinstance(subject, type):  # the compiled law of a material, which stands outside of its class
        law = getattr(subject, "law", None)
        yield b"" if law is None else digest(law).encode()
        for base in subject.__mro__[1:]:
            if base is not object:
                yield digest(base).encode()
