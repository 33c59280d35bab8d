"""`list`: the cases there are."""

from __future__ import annotations

__all__ = ["list_cases"]


def list_cases() -> None:
    """List the cases, with what they are and their meshes."""
    from docstring_parser import parse
    from rich.console import Console
    from rich.table import Table

    from ..deck import CASES, case_function
    from ..sample import data_folder

    table = Table(box=None, pad_edge=False)
    table.add_column("case", no_wrap=True)
    table.add_column("what it is")
    table.add_column("meshes")
    for case in CASES:
        meshes = ["a mesh file"] if case == "custom" else sorted(
            path.stem for path in (data_folder(case) / "meshes").glob("*.vtu"))
        table.add_row(case, parse(case_function(case).__doc__ or "").short_description, ", ".join(meshes))
    Console().print(table)
