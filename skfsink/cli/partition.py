"""`partition`: the parts of a body for several ranks, made once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

__all__ = ["partition"]


def partition(deck: Path, *, parts: Annotated[int, Parameter(name=["--parts", "-n"])], out: Path | None = None,
              overwrite: Annotated[bool, Parameter(negative="", show_default=False)] = False) -> None:
    """Part the body of a deck for several ranks of MPI, and write its parts into a folder.

    `mpiexec -n 64 skfsink run DECK --partition FOLDER` then reads them: each rank its own.

    Parameters
    ----------
    deck
        TOML file, or the name of a deck that `skfsink list` shows.
    parts
        Number of parts, one for each rank.
    out
        Folder to write; default the name of the deck with -parts-N, such as scene-parts-64.
    overwrite
        Use a folder that is not empty.
    """
    from ..errors import require
    from ..methods.ranks.parted import write_parts
    from ..scene.deck import read_deck
    from ..system.shipped import deck_path

    path = deck_path(deck)
    count = int(require("parts", parts, low=1, whole=True))
    space = read_deck(path).scene().space
    folder = out or Path(f"{path.stem}-parts-{count}")
    write_parts(space, count, folder, overwrite)
    print(f"{folder}: {count} part(s) of {space.n_elements} elements")
