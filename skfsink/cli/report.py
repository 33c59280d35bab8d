"""`report`: one page of HTML of a run, or of several compared."""

from __future__ import annotations

from pathlib import Path

__all__ = ["report"]


def report(*folders: Path, out: Path | None = None) -> None:
    """Write one self-contained page of HTML about a run, or comparing several.

    Parameters
    ----------
    folders
        Folders of runs; one of both analyses counts as its two.
    out
        File to write; default report.html in the folder of a single run, comparison.html here for several.
    """
    from ..report import write_report

    print(write_report(folders, out))


if __name__ == "__main__":
    from .program import command

    command(report, package="commands")
