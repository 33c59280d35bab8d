"""`resume`: go on with an interrupted run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

__all__ = ["resume"]


def resume(folder: Path, *, quiet: Annotated[bool, Parameter(negative="", show_default=False)] = False,
           partition: Path | None = None,
           frame_pieces: Annotated[bool, Parameter(negative="", show_default=False)] = False) -> None:
    """Go on with an interrupted run where its last checkpoint left it.

    Parameters
    ----------
    folder
        Folder of the run; its scene.toml says what to compute.
    quiet
        Show no progress.
    partition
        Folder with the parts of the body, a file for each rank of MPI, that `skfsink partition` has made.
    frame_pieces
        Let each rank of MPI write its piece of a frame, in a .vtu file of its own beside a .pvtu file.
    """
    from ..scene.deck import Deck
    from ..scene.registry import find_case_of_run
    from ..scene.stored import StoredScene

    case = find_case_of_run(StoredScene.read(folder), folder)
    Deck(case.name, {}).run(resume=folder, quiet=quiet, partition=partition, frame_pieces=frame_pieces)
