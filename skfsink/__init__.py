"""skfsink: dynamic versus quasi-static crack propagation in soft materials by the material-sink theory."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .cases.custom import custom
    from .deck import read_deck
    from .loader import Run
    from .loads import Grip, Ramp, Traction
    from .material import SinkLaw, material_from
    from .options import Options
    from .result import Result
    from .tables import RegionLaw

__version__ = "0.1.0"
__all__ = ["Grip", "Options", "Ramp", "RegionLaw", "Result", "SinkLaw", "Traction", "__version__", "custom", "load",
           "material_from", "read_deck"]

#: where each name of this package is; it is imported when it is first asked for
_PLACES = {"custom": "cases.custom", "read_deck": "deck", "Grip": "loads", "Ramp": "loads", "Traction": "loads",
           "SinkLaw": "material", "material_from": "material", "Options": "options", "Result": "result",
           "RegionLaw": "tables"}


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = getattr(import_module(f".{_PLACES[name]}", __name__), name)
    globals()[name] = value
    return value


def load(folder: str | Path) -> Run:
    """The results of a run in its folder, finished or not; see :class:`skfsink.loader.Run`.

    Raises
    ------
    OutputError
        The folder holds no run, or its files are damaged.
    """
    from .loader import load as load_run  # only what is asked for is imported

    return load_run(folder)
