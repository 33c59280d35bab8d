"""`scene.toml`, which a run leaves in its folder: what it says, read and written here alone. It is a deck as well."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from ..errors import OutputError
from ..meshing.kept_mesh import MESH
from ..system.files import reported, write_atomic
from ..system.text import read_toml

__all__ = ["CORRIDOR", "SCENE", "TABLES", "StoredScene", "corridor_mesh", "kept_mesh", "tables_beside"]

SCENE, CORRIDOR = "scene.toml", "corridor.vtu"
#: parameters that are tables, which stand beside the table `parameters` of a file
TABLES = ("grips", "tractions", "pressures", "fillings", "body_forces", "velocities", "regions", "fibres", "probes",
          "cracks")
HEAD = ("# A run of skfsink. Run it again with: skfsink run scene.toml\n"
        "# Plain numbers are in N, mm, MPa and s; density in kg/m^3.\n")


@dataclass(frozen=True)
class StoredScene:
    """What `scene.toml` says of a run.

    Attributes
    ----------
    case: name of the case.
    parameters: by name, as they are in the file; `mesh` is a name, or a path relative to the folder.
    source: mesh file of the user's that the mesh in the folder was read from; "" for other meshes.
    assumed: statements about lengths that the paper does not print.
    model_choice: how the model was chosen; empty if it was not.
    made_in_python: parts of the scene that the parameters do not give, such as "material" and "loads"; a run that has
        one can be resumed, and run again, from Python only.
    """

    case: str
    parameters: Mapping[str, Any]
    source: str = ""
    assumed: tuple[str, ...] = ()
    model_choice: Mapping[str, Any] = field(default_factory=dict)
    made_in_python: tuple[str, ...] = ()

    @classmethod
    def read(cls, folder: Path) -> StoredScene:
        """The scene of the run in a folder.

        Raises
        ------
        OutputError
            The folder holds no run, or its scene is none.
        """
        path = folder / SCENE
        if not path.is_file():
            raise OutputError(f"{folder} holds no run: there is no {path}")
        try:
            with reported(f"cannot read {path}"):
                document = read_toml(path)
            tables = TABLES if document.keys() & {*TABLES} else ()
            return cls(str(document["case"]),
                       {**document["parameters"], **{name: document.get(name, ()) for name in tables}},
                       str(document.get("source", "")), tuple(map(str, document.get("assumed", ()))),
                       dict(document.get("choice", {})), tuple(map(str, document.get("made_in_python", ()))))
        except (KeyError, TypeError, ValueError, RecursionError) as error:
            raise OutputError(f"{path} is not the scene of a run: {error}") from None

    def write(self, folder: Path) -> None:
        """Write it to a folder (OutputError)."""
        write_atomic(folder / SCENE, self.toml())

    def toml(self) -> str:
        """Its text."""
        parameters = {k: v.item() if isinstance(v, np.generic) else v for k, v in self.parameters.items()}
        source = {"source": self.source} if self.source else {}
        choice_table = {"choice": dict(self.model_choice)} if self.model_choice else {}
        python = {"made_in_python": list(self.made_in_python)} if self.made_in_python else {}
        return HEAD + tomli_w.dumps({"case": self.case, **source, **python, **tables_beside(parameters),
                                     "assumed": list(self.assumed), **choice_table})

    def parameters_in(self, folder: Path) -> dict[str, Any]:
        """The parameters, with the path of the mesh file that the run in this folder is computed on."""
        mesh = str(self.parameters.get("mesh", ""))
        return {**self.parameters, **({"mesh": str((folder / mesh).absolute())} if Path(mesh).suffix else {})}

    def parameters_given(self) -> dict[str, Any]:
        """The parameters, with the mesh file that was given to the run, not the copy it keeps."""
        return {**self.parameters, **({"mesh": self.source} if self.source else {})}


def tables_beside(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters as a file has them: numbers and text in the table `parameters`, and beside it each kind of tables."""
    tables = {name: [dict(table) for table in parameters[name]] for name in TABLES if parameters.get(name)}
    return {"parameters": {name: value for name, value in parameters.items() if name not in TABLES}, **tables}


def kept_mesh(folder: Path, mesh: str) -> Path | None:
    """Mesh that a run has left in its folder, where its parameter `mesh` does not name it: one made by gmsh."""
    return None if Path(mesh).suffix or not (folder / MESH).is_file() else folder / MESH


def corridor_mesh(folder: Path) -> Path:
    """Mesh of two passes of a run, or of the two runs that it is one of."""
    above = folder.parent / CORRIDOR
    return above if not (folder / CORRIDOR).exists() and above.exists() else folder / CORRIDOR
