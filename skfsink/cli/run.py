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
        TOML file, or the name of a deck that `skfsink list` shows; `skfsink show CASE` prints one, and the
        scene.toml of any run is one.
    out
        Output folder; default results/CASE/MESH-ANALYSIS[-INTEGRATOR], or results/NAME of a deck with a name.
    overwrite
        Use an output folder that is not empty.
    quiet
        Show no progress.
    """
    from ..scene.deck import read_deck
    from ..system.shipped import deck_name, deck_path

    path = deck_path(deck)
    named = None if path == deck else Path("results") / deck_name(path)
    read_deck(path).run(out=out or named, overwrite=overwrite, quiet=quiet)
