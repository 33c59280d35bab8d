"""skfsink: dynamic versus quasi-static crack propagation in soft materials by the material-sink theory."""

from __future__ import annotations

import os
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


def _place_matplotlib() -> None:
    """Let matplotlib, which is imported later, keep its list of fonts in a temporary folder if it cannot at home.

    It would make a new folder in each process otherwise, and look for all fonts again.
    """
    if "MPLCONFIGDIR" in os.environ:
        return
    for variable, default in (("XDG_CONFIG_HOME", "~/.config"), ("XDG_CACHE_HOME", "~/.cache")):
        place = Path(os.environ.get(variable) or os.path.expanduser(default)) / "matplotlib"
        while not os.path.exists(place) and place != place.parent:
            place = place.parent
        if not os.access(place, os.W_OK | os.X_OK):
            from .scratch import temporary_folder

            if (folder := temporary_folder()) is not None:
                os.environ["MPLCONFIGDIR"] = str(folder / "matplotlib")
            return


_place_matplotlib()
