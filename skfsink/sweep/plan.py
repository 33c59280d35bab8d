"""A sweep from its deck to its table: folders, runs, what is left of an earlier attempt."""

from __future__ import annotations

import tomllib
import warnings
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path, PureWindowsPath
from typing import Any

import numpy as np

from ..errors import Interrupted, OutputError, require
from ..meshing.kept_mesh import MESH
from ..meshing.sample import file_sample
from ..run.display import Display
from ..scene.deck import Deck, read_deck
from ..system.files import path_of, reported, write_atomic
from .engine import here, on_scheduler
from .one import DECK, FAILURE, RUN, finished
from .sweep_picture import draw
from .table import read_rows, read_units, write_csv, write_parquet
from .vary import combinations, read_variation, values_of, with_values

__all__ = ["failed_runs", "run_sweep", "sweep_rows"]


def run_sweep(path: str | Path, vary: Sequence[str] | Mapping[str, Sequence[Any]], out: str | Path, *, jobs: int = 1,
              scheduler: str = "", parquet: bool = False, quiet: bool = False) -> list[dict[str, Any]]:
    """Run the deck in `path` for every combination of `vary`; the rows of its table, as `pandas.DataFrame` takes them.

    A run that fails is a row with its message under `failure`, and the whole is warned of (UserWarning).

    Parameters
    ----------
    path: of the deck.
    vary: texts as of the command line (see :func:`.read_variation`), or the values by name, `{"phi": [0.1, 0.2]}`.
    out: folder of the sweep.
    jobs, scheduler, parquet, quiet: as of the command line.

    Raises
    ------
    ParameterError, OutputError, MissingExtra
        What was asked for cannot be; `out` holds another sweep.
    Interrupted
        Ctrl-C or SIGTERM: the runs that went on have left checkpoints; the same call goes on with them.
    """
    rows = sweep_rows(path_of("path", path), vary, path_of("out", out), jobs=jobs, scheduler=scheduler,
                      parquet=parquet, quiet=quiet)
    if text := failed_runs(rows):
        warnings.warn(text, stacklevel=2)
    return rows


def failed_runs(rows: Sequence[Mapping[str, Any]]) -> str:
    """How many runs of a sweep have failed, and why the first; "" if none has."""
    failed = [row for row in rows if row["failure"]]
    others = " (and others)" if len({row["failure"] for row in failed}) > 1 else ""
    return (f"{len(failed)} of {len(rows)} runs of the sweep failed, first {failed[0]['folder']}: "
            f"{failed[0]['failure']}{others}; they are rows without results, and the same sweep computes them again"
            ) if failed else ""


def sweep_rows(path: Path, vary: Sequence[str] | Mapping[str, Sequence[Any]], out: Path, *, jobs: int = 1,
               scheduler: str = "", parquet: bool = False, quiet: bool = False) -> list[dict[str, Any]]:
    """As :func:`run_sweep`, without its warning."""
    require("jobs", jobs, low=1, high=256, whole=True)
    deck = read_deck(path)
    if isinstance(vary, Mapping):
        variations = [values_of(name, values, deck) for name, values in vary.items()]
    else:
        variations = [read_variation(text, deck) for text in vary]
    names = [variation.name for variation in variations]
    varied = list(combinations([(variation.name, variation.values) for variation in variations]))
    folders = [out / _name(values) for values in varied]
    _lay_out([replace(deck, parameters=with_values(variations, _beside(values, path.parent), deck.parameters))
              for values in varied], folders)
    with Display(quiet) as display:
        display.phase("sweep")
        left = [folder for folder in folders if not finished(folder)]
        done = len(folders) - len(left)
        display.say(f"{len(folders)} runs of {deck.case} in {out}, {done} of them done already")
        try:
            with closing(on_scheduler(left, scheduler) if scheduler else here(left, jobs)) as ended:
                for folder in ended if left else ():
                    done += 1
                    failed = (folder / FAILURE).read_text().strip() if (folder / FAILURE).is_file() else ""
                    display.say(f"{folder.name}: {failed or 'done'}")
                    display.update(done / len(folders), f"{done} of {len(folders)} runs")
        except KeyboardInterrupt:
            raise Interrupted(f"interrupted with {done} of {len(folders)} runs done; the same command goes on"
                              ) from None
        rows, units = read_rows(folders, varied), read_units(folders)
        write_csv(rows, out / "sweep.csv", units)
        if parquet:
            write_parquet(rows, out / "sweep.parquet", units)
        if any(row["analysis"] for row in rows):
            draw(rows, names, out / "sweep.png", {**units, **{one.name: one.what.unit for one in variations}})
        display.update(1.0, str(out))
    return rows


def _name(values: Mapping[str, Any]) -> str:
    return ",".join(f"{name}={value:.10g}" if isinstance(value, float) else f"{name}={value}"
                    for name, value in values.items()).replace("/", "_")


def _beside(values: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The values, with a mesh file sought from the folder of the deck, as the deck's own is."""
    mesh = values.get("mesh", "")
    return {**values, "mesh": str((folder / mesh).absolute())} if Path(mesh).suffix else {**values}


def _moved(present: Path, text: str) -> bool:
    """Whether a deck of a folder is the same but for where its mesh file is; what was begun must be on that mesh.

    Raises
    ------
    OutputError
        A run was begun on another mesh.
    """
    old, new = tomllib.loads(present.read_text(encoding="utf-8")), tomllib.loads(text)
    paths = [str(data["parameters"].pop("mesh", "")) for data in (old, new)]
    names = [PureWindowsPath(path).name for path in paths]  # has both kinds of slashes
    if old != new or names[0] != names[1] or not Path(names[1]).suffix:
        return False
    mesh_of_run = present.parent / RUN / MESH
    if mesh_of_run.is_file() and Path(paths[1]).is_file():
        one, other = file_sample(mesh_of_run).space, file_sample(Path(paths[1])).space
        if not (np.array_equal(one.X, other.X) and np.array_equal(one.conn, other.conn)):
            raise OutputError(f"{present.parent} holds a run on another mesh than {paths[1]}; choose another --out")
    return True


def _lay_out(decks: Sequence[Deck], folders: Sequence[Path]) -> None:
    """Make the folders and their decks; refuse those of another sweep.

    The mesh file may have moved: runs that were begun keep their mesh, the others take it from where it is now.
    """
    texts = []
    for deck in decks:
        deck.check()
        texts.append(deck.toml())
    for folder, text in zip(folders, texts):
        present = folder / DECK
        if present.is_file() and present.read_text(encoding="utf-8") != text and not _moved(present, text):
            raise OutputError(f"{folder} holds a run of another sweep: its {DECK} differs; choose another --out")
    for folder, text in zip(folders, texts):
        if (folder / DECK).is_file() and (folder / RUN / MESH).is_file():
            continue
        with reported(f"the folder {folder} cannot be made"):
            folder.mkdir(parents=True, exist_ok=True)
        write_atomic(folder / DECK, text)
