"""`resume`: go on with an interrupted run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

__all__ = ["resume"]


def resume(folder: Path, *, quiet: Annotated[bool, Parameter(negative="", show_default=False)] = False) -> None:
    """Go on with an interrupted run where its last checkpoint left it.

    Parameters
    ----------
    folder
        Folder of the run; its scene.toml says what to compute.
    quiet
        Show no progress.
    """
    from ..scene.deck import Deck
    from ..scene.registry import find_case_of_run
    from ..scene.stored import StoredScene

    Deck(find_case_of_run(StoredScene.read(folder), folder).name, {}).run(resume=folder, quiet=quiet)
