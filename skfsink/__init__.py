"""skfsink: dynamic versus quasi-static crack propagation in soft materials by the material-sink theory."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .loader import Run

__version__ = "0.1.0"
__all__ = ["__version__", "load"]


def load(folder: str | Path) -> Run:
    """The results of a run in its folder, finished or not; see :class:`skfsink.loader.Run`.

    Raises
    ------
    OutputError
        The folder holds no run, or its files are damaged.
    """
    from .loader import load as load_run  # only what is asked for is imported

    return load_run(folder)
