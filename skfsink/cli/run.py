"""`run`: a scene from a deck."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

__all__ = ["run"]

FLAG = Parameter(negative="", show_default=False)


def run(deck: Path, *, out: Path | None = None, overwrite: Annotated[bool, FLAG] = False,
        quiet: Annotated[bool, FLAG] = False, partition: Path | None = None,
        frame_pieces: Annotated[bool, Parameter(negative="", show_default=False)] = False) -> None:
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
    partition
        Folder with the parts of the body, a file for each rank of MPI, that `skfsink partition` has made.
    frame_pieces
        Let each rank of MPI write its piece of a frame, in a .vtu file of its own beside a .pvtu file.
    """
    from ..scene.deck import read_deck
    from ..system.shipped import deck_name, deck_path

    path = deck_path(deck)
    named = None if path == deck else Path("results") / deck_name(path)
    read_deck(path).run(out=out or named, overwrite=overwrite, quiet=quiet, partition=partition,
                        frame_pieces=frame_pieces)
