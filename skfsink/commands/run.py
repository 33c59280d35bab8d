"""`run`: a scene from a deck."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

__all__ = ["run"]

FLAG = Parameter(negative="", show_default=False)


def run(deck: Path, *, out: Path | None = None, overwrite: Annotated[bool, FLAG] = False,
        quiet: Annotated[bool, FLAG] = False) -> None:
    """Run the scene of a deck, and leave its results in a folder.

    Parameters
    ----------
    deck
        TOML file; `skfsink show CASE` prints one, and the scene.toml of any run is one.
    out
        Output folder; default results/CASE/MESH-ANALYSIS[-INTEGRATOR].
    overwrite
        Use an output folder that is not empty.
    quiet
        Show no progress.
    """
    from ..deck import read_deck

    read_deck(deck).run(out=out, overwrite=overwrite, quiet=quiet)
