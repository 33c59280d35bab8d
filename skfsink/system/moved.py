"""Modules under the names they had before version 0.2, until 1.0: importing one warns and gives the module itself."""

from __future__ import annotations

import importlib
import sys
import warnings
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

__all__ = ["OLD", "follow_moves"]

#: old name of each documented module, without `skfsink.`, and where it is now
OLD = {
    **{name: f"scene.{name}" for name in ("options", "deck", "tables")},
    **{name: f"meshing.{name}" for name in ("sample", "shapes", "sweeping")},
    **{name: f"fem.{name}" for name in ("space", "forms")},
    **{name: f"fields.{name}" for name in ("state", "momentum", "density", "deletion", "energy", "stress", "crack")},
    **{name: f"methods.{name}" for name in ("newton", "onset", "statics", "explicit", "hht", "inertia")},
    **{name: f"results.{name}" for name in ("loader", "result", "history", "reference")},
    **{name: f"material.{name}" for name in ("homogeneous", "regions")},
    "hht_controls": "methods.controls", "places": "run.observers.places", "checks": "run.checks",
    "notes": "run.notes", "rigid": "loads.rigid",
    "film": "pictures.film", "guards": "run.observers.guard", "simulate": "run.simulate", "loading": "loads.schedule",
}


class _Moves(MetaPathFinder, Loader):
    def find_spec(self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
                  ) -> ModuleSpec | None:
        package, _, name = fullname.partition(".")
        return ModuleSpec(fullname, self) if package == "skfsink" and name in OLD else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        now = f"skfsink.{OLD[spec.name.partition('.')[2]]}"
        warnings.warn(f"{spec.name} is {now} now; the old name goes with version 1.0", DeprecationWarning, stacklevel=2)
        module = importlib.import_module(now)
        self._spec = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        module.__spec__ = self._spec  # the import system has put that of the old name there


def follow_moves() -> None:
    """Let the old names be imported in this process."""
    if not any(isinstance(finder, _Moves) for finder in sys.meta_path):
        sys.meta_path.append(_Moves())
