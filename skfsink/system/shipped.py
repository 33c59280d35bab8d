"""Files that come with the program: the committed data of the cases with their decks, and how to cite.

A deck is `scene.toml` in a folder of `cases`, beside its meshes and what came out.
"""

from __future__ import annotations

from pathlib import Path

from ..errors import MeshError, OutputError, ParameterError

__all__ = ["citation_file", "data_folder", "data_roots", "deck_name", "deck_path", "description", "shipped_decks"]

DECK, CITATION = "scene.toml", "CITATION.cff"


def citation_file() -> Path:
    """CITATION.cff of the installed package, or of a checkout.

    Raises
    ------
    OutputError
        It is not there.
    """
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "data", package.parent):
        if (folder / CITATION).is_file():
            return folder / CITATION
    raise OutputError(f"{CITATION} is not installed with the program: install skfsink again")


def data_roots() -> tuple[Path, ...]:
    """Folders of the committed data of all cases: those of the installed package, those of a checkout."""
    package = Path(__file__).resolve().parents[1]
    return package / "data" / "cases", package.parent / "cases"


def data_folder(case: str) -> Path:
    """Folder with the committed data of a case: `cases/<case>` of a checkout, or its copy in the installed package."""
    for root in data_roots():
        if (root / case).is_dir():
            return root / case
    raise MeshError(f"the data of case {case} are not installed")


def shipped_decks() -> dict[str, Path]:
    """Paths of the decks by name, in alphabetical order."""
    found = {path.parent.name: path for root in reversed(data_roots()) for path in root.glob(f"*/{DECK}")}
    return dict(sorted(found.items()))


def deck_path(deck: Path) -> Path:
    """The file of a deck that was given by its path, or by the name of one that comes with the program.

    A file of that name in the working folder goes first.

    Raises
    ------
    ParameterError
        It is a name, and there is neither such a deck nor such a file.
    """
    if deck.is_file() or deck.suffix or len(deck.parts) != 1:
        return deck
    decks = shipped_decks()
    if deck.name not in decks:
        raise ParameterError(f"deck must be a file, or one of {', '.join(decks)}; got {deck.name!r}")
    return decks[deck.name]


def deck_name(path: Path) -> str:
    """The name of the deck in a file: of the file, or of the folder of a deck that comes with the program."""
    return path.parent.name if path in shipped_decks().values() else path.stem


def description(path: Path) -> str:
    """The first sentence of the comment that a deck begins with."""
    lines = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.lstrip("# "))
    return " ".join(lines).partition(". ")[0].rstrip(".") + "."
