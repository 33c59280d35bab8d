"""What a run was asked for, complete: by a call, or by the folder of a run that is to go on."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..errors import MeshError, OutputError, ParameterError
from ..meshing.gmsh_model import has_gmsh
from ..meshing.kept_mesh import mesh_name, origin
from ..scene.case import Case, shared_parameters
from ..scene.options import NOT_PHYSICS, Options
from ..scene.scene import Scene
from ..scene.stored import SCENE, StoredScene, corridor_mesh, kept_mesh
from ..scene.tables import curved, read_tables
from .checkpoint import check_version
from .model import AUTO, choose_model

__all__ = ["RunRequest", "check_options", "read_request"]


@dataclass(frozen=True)
class RunRequest:
    """A case, the arguments of its function, and the options.

    Attributes
    ----------
    case, arguments, options: as they are to be computed.
    model_choice: how the model was chosen; empty if none was asked for.
    notes: warnings about what could not be had.
    """

    case: Case
    arguments: dict[str, Any]
    options: Options
    model_choice: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def resumes(self) -> bool:
        """Whether it goes on with a run."""
        return self.options.resume is not None

    @property
    def made_in_python(self) -> tuple[str, ...]:
        """What of it stands in no file."""
        functions = [name for name in self.case.tables if curved(self.arguments.get(name, ()))]
        return (*(["stop"] if callable(self.options.stop) else []), *functions)

    @property
    def folder(self) -> Path:
        """Folder of the run: the one that was named, or one named after case, mesh and analysis."""
        options, mesh = self.options, mesh_name(self.arguments["mesh"])
        if options.resume or options.out:
            return Path(options.resume or options.out or "")
        name = f"{mesh}-{options.model or options.analysis}"
        if not options.model and options.analysis != "quasistatic" and options.integrator != "explicit":
            name += f"-{options.integrator}"
        return Path("results") / self.case.name / name

    def scene(self) -> Scene:
        """The scene, with its mesh."""
        return replace(self.case.scene(self.arguments, self.options), model_choice=self.model_choice)


def check_options(options: Any) -> Options:
    """What a case function was given as its `options`.

    Raises
    ------
    ParameterError
        It is something else than :class:`Options`.
    """
    if not isinstance(options, Options):
        cure = "Options(**{...})" if isinstance(options, dict) else "Options(...), or leave them out"
        raise ParameterError(f"options must be skfsink.Options; got {options!r:.80}: give {cure}")
    return options


def read_request(case: Case, arguments: dict[str, Any], options: Options) -> RunRequest:
    """The request that the arguments of a case function and the options make; see :func:`.run_case`.

    Raises
    ------
    ParameterError
        A model, or something else than the run to go on with, was asked for that cannot be.
    OutputError
        There is no run to go on with, or no measured model.
    MeshError
        The mesh is neither a name nor a path.
    """
    check_options(options)
    if not isinstance(mesh := arguments["mesh"], str | os.PathLike):
        raise MeshError(f"mesh must be the name of a mesh, or the path of a mesh file; got {mesh!r:.80}")
    # a file by its whole path: the run may be resumed from another folder
    arguments = {**arguments, "mesh": str(Path(mesh).absolute() if Path(mesh).suffix else mesh)}
    if options.resume is not None:
        request = _resumed(RunRequest(case, arguments, options), options.resume)
    elif options.model:
        request = RunRequest(case, arguments, *choose_model(case, arguments, options))
    else:
        request = RunRequest(case, arguments, options)
    if request.options.mesh_layout == "two-pass" and not has_gmsh():
        note = "there is no gmsh to make the mesh of two passes: the mesh of the layout corridor is taken"
        return replace(request, options=replace(request.options, mesh_layout="corridor"), notes=(note,))
    return request


def _resumed(asked: RunRequest, folder: Path) -> RunRequest:
    """The request of the run in a folder, which what was asked for must not contradict."""
    case, options = asked.case, asked.options
    if options.out is not None and options.out.absolute() != folder.absolute():
        raise ParameterError(f"--out {options.out} and --resume {folder} are two folders; a run stays in its own")
    stored = StoredScene.read(folder)
    if stored.case != case.name:
        raise OutputError(f"{folder} holds a run of case {stored.case}, not of {case.name}")
    if options.model not in ("", AUTO, stored.model_choice.get("model")):
        raise ParameterError(f"--model {options.model} is not that of the run in {folder} "
                             f"({stored.model_choice.get('model')}); a resumed run keeps its scene")
    check_version(folder)
    if parts := {*stored.made_in_python} - {*asked.made_in_python}:
        raise OutputError(f"{folder / SCENE} does not describe its run, parts of which were made in Python "
                          f"({', '.join(stored.made_in_python)}): resume it from there, with "
                          + (f"{' and '.join(f'{part}=…' for part in sorted(parts))}, the same"
                             if parts <= {"stop", *case.tables} else "run(scene, folder, resume=True)"))
    _check_agreement(asked, stored, folder)
    try:
        arguments, values = case.from_stored(stored, folder)
        if others := values.keys() ^ (shared_parameters().keys() - set(NOT_PHYSICS)):
            raise KeyError(*sorted(others))
    except KeyError as error:
        raise OutputError(f"{folder / SCENE} is not the scene of a run: parameter {error}") from None
    for part in asked.made_in_python:  # the fingerprint says whether it is that of the run
        if part == "stop":
            values["stop"] = options.stop
        else:
            arguments[part] = asked.arguments[part]
    options = replace(options, **values, corridor=corridor_mesh(folder),
                      kept_mesh=kept_mesh(folder, arguments["mesh"]))
    return RunRequest(case, arguments, options, stored.model_choice)


def _check_agreement(asked: RunRequest, stored: StoredScene, folder: Path) -> None:
    """Refuse parameters that were asked for and are not those of the run in the folder (ParameterError)."""
    defaults = {**asked.case.defaults, **Options().parameters()}
    parameters = {**asked.case.newer, **stored.parameters_in(folder)}
    for name, value in {**asked.arguments, **asked.options.parameters()}.items():
        there = parameters.get(name)
        if name in asked.case.tables:
            if len(value) and not curved(value) and read_tables(name, value) != read_tables(name, there or ()):
                raise ParameterError(f"{name} are not those of the run in {folder}; a resumed run keeps its scene")
            continue
        same = value == there or (name == "mesh" and origin(value) == origin(str(there)))
        if (name in asked.options.given_names or value != defaults[name]) and not same:
            raise ParameterError(f"--{name.replace('_', '-')} {value} is not that of the run in {folder} ({there}); "
                                 f"a resumed run keeps its scene")
