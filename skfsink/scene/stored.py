"""The scene of a run in its folder: the one reader of `scene.toml`."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..errors import OutputError
from ..meshing.kept_mesh import MESH
from ..system.text import read_toml
from .options import Options
from .registry import CASES
from .scene import Scene
from .tables import joined

__all__ = ["CORRIDOR", "SCENE", "corridor_mesh", "kept", "read_choice", "read_parameters", "read_scene", "stored_case"]

SCENE, CORRIDOR = "scene.toml", "corridor.vtu"
LATER = ("merge_nodes",)  # parameters that a scene.toml of an earlier version has not; they take their defaults


def read_scene(folder: Path) -> Scene:
    """The scene of a run, made again from its `scene.toml`; options that this does not name have their defaults.

    Raises
    ------
    OutputError
        The folder holds no readable scene, or one of a case or with a parameter that do not exist.
    """
    path = folder / SCENE
    if not path.is_file():
        raise OutputError(f"{folder} holds no run: there is no {path}")
    try:
        case = str(read_toml(path)["case"])
        module = importlib.import_module(f"skfsink.cases.{case}")
        stored = read_parameters(folder, case)
        own = {name: stored.pop(name, p.default) if name in LATER else stored.pop(name)
               for name, p in inspect.signature(getattr(module, case)).parameters.items() if name != "options"}
        options = replace(Options(), **stored, corridor=corridor_mesh(folder), kept=kept(folder, own))
    except (ModuleNotFoundError, ValueError, AttributeError, KeyError, TypeError) as error:
        raise OutputError(f"{path} is not the scene of a run: {error}") from None
    scene: Scene = module._scene(own, options)
    return scene


def kept(folder: Path, own: Mapping[str, Any]) -> Path | None:
    """Mesh that a run has left in its folder, where the parameters do not name it: one that was made by gmsh."""
    return None if Path(own["mesh"]).suffix or not (folder / MESH).is_file() else folder / MESH


def corridor_mesh(folder: Path) -> Path:
    """Mesh of two passes of a run, or of the two runs that it is one of."""
    above = folder.parent / CORRIDOR
    return above if not (folder / CORRIDOR).exists() and above.exists() else folder / CORRIDOR


def read_parameters(folder: Path, case: str) -> dict[str, Any]:
    """Parameters in the `scene.toml` of a run; a mesh file that it keeps is given by its path.

    Raises
    ------
    OutputError
        The folder holds no readable scene, or one of another case.
    """
    path = folder / SCENE
    if not path.is_file():
        raise OutputError(f"{folder} holds no run to resume: there is no {path}")
    try:
        data = read_toml(path)
        found, parameters = str(data["case"]), joined(data, case == "custom")
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise OutputError(f"{path} is not the scene of a run: {error}") from None
    if found != case:
        raise OutputError(f"{folder} holds a run of case {found}, not of {case}")
    if Path(mesh := str(parameters.get("mesh", ""))).suffix:
        parameters["mesh"] = str((folder / mesh).absolute())
    return parameters


def read_choice(folder: Path) -> dict[str, Any]:
    """The choice of a model in the `scene.toml` of a run; empty if there is none."""
    return dict(read_toml(folder / SCENE).get("choice", {}))


def stored_case(folder: Path) -> str:
    """The case of the run in a folder.

    Raises
    ------
    OutputError
        It holds no run.
    """
    path = folder / SCENE
    if not path.is_file():
        raise OutputError(f"{folder} holds no run: there is no {path}")
    try:
        case = read_toml(path)["case"]
    except (OSError, ValueError, KeyError) as error:
        raise OutputError(f"{path} is not the scene of a run: {error}") from None
    if case not in CASES:
        raise OutputError(f"{path} is not the scene of a run: its case is {case!r}")
    return str(case)
