"""The cases by name: modules of `skfsink.cases`, each with its :class:`.Case` as `CASE`.

They are found by file, without importing them: a case is one file, and is named nowhere else. This is the only place
that reaches up to them, as one reaches to plug-ins.
"""

from __future__ import annotations

import importlib
import importlib.util
import pkgutil
from dataclasses import replace
from pathlib import Path

from ..errors import OutputError, choose
from ..system.files import path_of
from .case import Case
from .options import Options
from .scene import Scene
from .stored import SCENE, StoredScene, corridor_mesh, kept_mesh

__all__ = ["CASES", "find_case", "find_case_of_run", "read_scene"]

#: names of the cases
CASES = tuple(sorted(module.name for module in pkgutil.iter_modules(
    importlib.util.find_spec("skfsink.cases").submodule_search_locations)))  # type: ignore[union-attr]


def find_case(name: str) -> Case:
    """The case of that name.

    Raises
    ------
    ParameterError
        There is none.
    """
    choose("case", name, CASES)
    case: Case = importlib.import_module(f"skfsink.cases.{name}").CASE
    return case


def find_case_of_run(stored: StoredScene, folder: Path) -> Case:
    """The case of the run in a folder, by its :class:`.StoredScene`.

    Raises
    ------
    OutputError
        There is no such case.
    """
    if stored.case not in CASES:
        raise OutputError(f"{folder / SCENE} is not the scene of a run: its case is {stored.case!r}")
    return find_case(stored.case)


def read_scene(folder: str | Path) -> Scene:
    """The scene of a run, made again from its `scene.toml`; options that this does not name have their defaults.

    Raises
    ------
    OutputError
        The folder holds no readable scene, or one of a case or with a parameter that do not exist.
    """
    folder = path_of("folder", folder)
    stored = StoredScene.read(folder)
    case = find_case_of_run(stored, folder)
    try:
        arguments, values = case.from_stored(stored, folder)
        options = replace(Options(), **values, corridor=corridor_mesh(folder),
                          kept_mesh=kept_mesh(folder, arguments["mesh"]))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise OutputError(f"{folder / SCENE} is not the scene of a run: {error}") from None
    return case.scene(arguments, options)
