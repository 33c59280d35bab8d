"""`njit` of this package: where compiled loops are kept, and when they are compiled anew.

numba keeps a compiled function until its file changes. What was built into it from other files, constants and
functions, may change without that. Here a loop is kept until its file changes, or any file of the package that this
imports, directly or through others. A loop has one file for each of its signatures; a newer one takes its place.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core import caching, config
from numba.misc.appdirs import AppDirs

from .scratch import first_writable, temporary_folder

__all__ = ["njit", "sources", "stamp"]

#: "from ..space import Space, Pattern" at the top level of a module, with dots, module and names
_IMPORT = re.compile(r"^from[ \t]+(\.+)([\w.]*)[ \t]+import[ \t]+(?:\(([^)]*)\)|([^\n#]*))", re.MULTILINE)


def njit(*functions: Callable[..., Any], cache: bool = False, **options: Any) -> Any:
    """As `numba.njit`, with the cache of this package."""
    def compiled(function: Callable[..., Any]) -> Any:
        dispatcher = numba.njit(**options)(function)
        file = Path(function.__code__.co_filename).absolute()
        if cache and file.is_file() and _folder(file.parent) is not None:  # a frozen program has no files
            dispatcher._cache = _Cache(function)
        return dispatcher

    return compiled(*functions) if functions else compiled


class _Locator(caching._CacheLocator):  # type: ignore[misc]
    """Where a function of this package is kept, and what tells its versions apart."""

    def __init__(self, file: Path) -> None:
        self._file, self._py_file = file, str(file)  # the latter is for a message of numba's

    @classmethod
    def from_function(cls, function: Any, file: str) -> _Locator:
        return cls(Path(file).absolute())

    def get_cache_path(self) -> str:
        return str(_folder(self._file.parent))

    def get_source_stamp(self) -> str:
        return stamp(self._file)

    def get_disambiguator(self) -> str:
        return "skfsink"


_Impl: Any = caching.FunctionCache._impl_class


class _CacheImpl(_Impl):  # type: ignore[misc]
    _locator_classes = (_Locator,)


class _Cache(caching.FunctionCache):  # type: ignore[misc]
    _impl_class = _CacheImpl

    def _index_key(self, sig: Any, codegen: Any) -> tuple[Any, ...]:
        """As numba's, but for loops made by a function: what they take from it may be compiled functions."""
        def hashed(value: bytes) -> str:
            return hashlib.sha256(value).hexdigest()

        around = repr(_around(self._py_func)).encode()
        return sig, codegen.magic_tuple(), (hashed(self._py_func.__code__.co_code), hashed(around))


def _around(function: Any) -> tuple[Any, ...]:
    """What a function takes from the one it is made by; a compiled function by its name and what it takes itself.

    The text of the latter is known by the stamp of the file.
    """
    found: list[Any] = []
    for cell in function.__closure__ or ():
        value = cell.cell_contents
        inner = getattr(value, "py_func", None)
        found.append(value if inner is None else (inner.__module__, inner.__qualname__, _around(inner)))
    return tuple(found)


@cache
def _folder(modules: Path) -> Path | None:
    """Where the loops of the modules in a folder are kept; None if nowhere."""
    beside = caching._CacheLocator.get_suitable_cache_subpath(str(modules / "module.py"))

    def places() -> Iterator[Path]:
        if config.CACHE_DIR:  # type: ignore[attr-defined]
            yield Path(config.CACHE_DIR) / beside  # type: ignore[attr-defined]
        yield modules / "__pycache__"
        yield Path(AppDirs(appname="numba", appauthor=False).user_cache_dir) / beside
        if (last := temporary_folder()) is not None:
            yield last / beside

    return first_writable(places())


@cache
def stamp(file: Path) -> str:
    """Hash of all that a compiled function in a file may be made of."""
    hashed = hashlib.sha256()
    for path in sources(file):
        hashed.update(f"{path.name} {hashlib.sha256(_text(path)).hexdigest()}\n".encode())
    return hashed.hexdigest()


def sources(file: Path) -> list[Path]:
    """A file and those of the package that it imports by relative imports, directly or through others, in order."""
    found, left = {file}, [file]
    while left:
        new = _imported(left.pop()) - found
        found |= new
        left += new
    return sorted(found)


@cache
def _imported(file: Path) -> frozenset[Path]:
    modules = set()
    for dots, module, several, single in _IMPORT.findall(_text(file).decode("utf-8")):
        base = file.parents[len(dots) - 1].joinpath(*filter(None, module.split(".")))
        names = [words[0] for name in (several or single).split(",") if (words := name.split())]
        for place in (base, *(base / name for name in names)):
            modules |= {place.with_name(f"{place.name}.py"), place / "__init__.py"}
    return frozenset(path for path in modules if os.path.isfile(path))


@cache
def _text(path: Path) -> bytes:
    return path.read_bytes()
