"""`sweep`: many runs of one scene."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

__all__ = ["sweep"]


def sweep(deck: Path, *, vary: Annotated[list[str], Parameter(negative="", consume_multiple=False)],
          out: Path | None = None, jobs: int = 1, scheduler: str = "", parquet: Annotated[
              bool, Parameter(negative="", show_default=False)] = False,
          quiet: Annotated[bool, Parameter(negative="", show_default=False)] = False) -> None:
    """Run a scene for every combination of some parameters' values; the same command again goes on where it was.

    Parameters
    ----------
    deck
        TOML file of the scene, or the name of a deck that `skfsink list` shows.
    vary
        NAME=A..B:N (N values), NAME=A..B (whole numbers) or NAME=A,B,C; may be given several times. Mesh files are
        sought from the deck's folder.
    out
        Folder of the sweep, with one of each run; default results/sweep/DECK.
    jobs
        Runs at a time on this machine, each on one core, in [1, 256].
    scheduler
        Address of a Dask scheduler whose workers run them instead, such as tcp://host:8786.
    parquet
        Write sweep.parquet besides sweep.csv.
    quiet
        Show no progress.
    """
    from ..errors import SkfsinkError
    from ..sweep.plan import failed_runs, sweep_rows
    from ..system.shipped import deck_name, deck_path

    path = deck_path(deck)
    rows = sweep_rows(path, vary, out or Path("results") / "sweep" / deck_name(path), jobs=jobs, scheduler=scheduler,
                      parquet=parquet, quiet=quiet)
    if text := failed_runs(rows):  # their rows are written: the exit status says that results are missing
        raise SkfsinkError(text)
