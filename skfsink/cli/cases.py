"""`list`: the cases and the decks there are."""

from __future__ import annotations

__all__ = ["list_cases"]


def list_cases() -> None:
    """List the cases and the decks of other scenes, with what they are and their meshes."""
    from rich.console import Console
    from rich.table import Table

    from ..scene.registry import CASES, find_case
    from ..system.shipped import description, shipped_decks

    table = Table(box=None, pad_edge=False)
    table.add_column("case", no_wrap=True)
    table.add_column("what it is")
    table.add_column("meshes")
    for case in map(find_case, CASES):
        table.add_row(case.name, case.summary, ", ".join(case.meshes) or "a mesh file")
    decks = Table(box=None, pad_edge=False)
    decks.add_column("deck", no_wrap=True)
    decks.add_column("what it is")
    decks.add_column("meshes")
    for name, path in shipped_decks().items():
        if name in CASES:  # the deck of a case
            continue
        meshes = sorted(mesh.stem for mesh in (path.parent / "meshes").glob("*.vtu"))
        decks.add_row(name, description(path), ", ".join(meshes))
    console = Console()
    console.print(table)
    console.print()
    console.print(decks)
