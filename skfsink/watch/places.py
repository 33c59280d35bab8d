"""Which runs are in the folders that are watched: one, the two of both analyses, those of a sweep or of a folder."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import OutputError
from ..report.scenes import path_labels
from ..run.compute import PARTS
from ..run.occupied import HOLDER
from ..scene.stored import SCENE, StoredScene
from ..sweep.one import DECK, FAILURE, RUN
from ..system.files import reported

__all__ = ["Place", "labelled", "places"]


@dataclass(frozen=True)
class Place:
    """A run, begun or to come.

    Attributes
    ----------
    folder: of the run.
    named: the path that tells it from others; of a run of a sweep the folder that its values have named.
    failure: file in which a sweep says why it failed; None outside of sweeps.
    label: the end of `named`, as long as it must be.
    """

    folder: Path
    named: Path
    failure: Path | None = None
    label: str = ""


def places(folder: Path) -> list[Place]:
    """The runs in a folder, in the order of the values in their names.

    Raises
    ------
    OutputError
        It holds none.
    """
    if not folder.is_dir():
        raise OutputError(f"there is no folder {folder}: name that of a run or a sweep")
    if (folder / SCENE).is_file() or (folder / HOLDER).is_file():
        return _of_run(folder)
    with reported(f"cannot read {folder}"):
        inside = sorted((path for path in folder.iterdir() if path.is_dir()), key=_order)
    found = [place for path in inside if (path / DECK).is_file() for place in _of_sweep(path)]
    found += [place for path in inside if (path / SCENE).is_file() for place in _of_run(path)]
    if not found:
        raise OutputError(f"{folder} holds no run and no sweep: there is no {SCENE} in it or one folder below")
    return found


def labelled(found: Sequence[Place]) -> list[Place]:
    """Places with their labels, each once."""
    once = {place.folder.absolute(): place for place in found}.values()
    return [replace(place, label=label) for place, label in zip(once, path_labels([place.named for place in once]))]


def _order(path: Path) -> list[tuple[bool, float, str]]:
    """Names with their numbers in order: seed=2 before seed=10."""
    return [(bool(number), float(number or 0), text)
            for text, number in re.findall(r"([^\d]*)(\d*\.?\d*(?:e[+-]?\d+)?)", path.name)]


def _of_sweep(folder: Path) -> list[Place]:
    """Of a folder with a deck, in which a sweep runs it."""
    run, failure = folder / RUN, folder / FAILURE
    if not (run / SCENE).is_file():
        return [Place(run, folder, failure)]
    return [Place(place.folder, folder / place.named.relative_to(run), failure) for place in _of_run(run)]


def _of_run(folder: Path) -> list[Place]:
    """The run, or those of its parts that were begun."""
    try:
        both = StoredScene.read(folder).parameters.get("analysis") == "both"
    except OutputError:  # not written yet, or damaged, which is said where it is shown
        both = False
    parts = [folder / part for part in PARTS if both and (folder / part / SCENE).is_file()]
    return [Place(part, part) for part in parts or [folder]]
