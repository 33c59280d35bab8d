"""Reference results: the parts of a finished run that pictures and comparisons need, small enough to be committed.

A reference is a folder `cases/<case>/reference/<key>` with the run's `summary.json`, `history.csv` and `scene.toml`,
and a few frames of its fields, rounded and packed (see `packing`), in `fields.npz`.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import OutputError
from ..fem.space import Space
from ..scene.registry import read_scene
from ..scene.scene import Scene
from ..scene.stored import SCENE
from ..system.files import write_atomic
from ..system.shipped import data_folder
from .frame import Frame, frame_file, read_frame
from .history import HISTORY_COLUMNS, History, Table, history_header
from .packing import Packer, pack_file, unpack_file
from .series import frame_times
from .summary import SUMMARY, read_summary, write_summary

__all__ = ["Reference", "load", "load_coarse", "pick_frame", "read_summary", "reference_folder", "store",
           "store_coarse"]

FIELDS, HISTORY = "fields.npz", "history.csv"
COARSE = "coarse.json"
DIGITS = 7  # of the numbers in the history
_PHRASE = re.compile(r"(\w+?)(?:\s*([+*])\s*([\d.eE+-]+))?")


@dataclass(frozen=True, eq=False)
class Reference:
    """A stored result.

    Attributes
    ----------
    case, key: which one.
    scene: how it was computed, with the mesh.
    summary, history: content of `summary.json`; columns of `history.csv`.
    frames: the stored frames by the phrase that picked each, in the order in which they were asked for.
    """

    case: str
    key: str
    scene: Scene
    summary: dict[str, Any]
    history: dict[str, np.ndarray]
    frames: dict[str, Frame]

    @property
    def space(self) -> Space:
        """The spaces on the mesh."""
        return self.scene.sample.space

    def frame(self, *phrases: str) -> Frame:
        """The first of the frames that there is.

        Raises
        ------
        OutputError
            None of them is stored.
        """
        for phrase in phrases:
            if phrase in self.frames:
                return self.frames[phrase]
        raise OutputError(f"the reference {self.key} of {self.case} has no frame {' or '.join(map(repr, phrases))}; "
                          f"it has {', '.join(self.frames) or 'none'}")


def reference_folder(case: str, key: str = "") -> Path:
    """Where the references of a case are, or that of one key."""
    return data_folder(case) / "reference" / key


# --- which frames ---
def pick_frame(phrase: str, moments: dict[str, int], times: Sequence[float],
               event: dict[str, np.ndarray]) -> int | None:
    """Number of the frame that a phrase asks for; None if it names a moment that did not happen.

    Parameters
    ----------
    phrase: a moment of the run ("onset", "branching", "arrival", "end"); a moment and a time after it
        ("arrival + 5e-6", seconds, or passes of a quasi-static run); "growing", when the crack first has half of its
        final length, or another share of it ("growing * 0.3").
    moments: frame numbers by moment.   times: of the frames [s], or passes.
    event: columns of the history of the event.

    Raises
    ------
    OutputError
        The phrase has no meaning.
    """
    match = _PHRASE.fullmatch(phrase.strip())
    word, sign, text = match.groups() if match else ("", None, None)
    try:
        number = float(text) if text else 0.5 if word == "growing" else 0.0
    except ValueError:
        word, number = "", 0.0
    if word == "growing" and sign != "+":
        clock = event["time_s"] if np.ptp(event["time_s"]) > 0 else event["step"]
        length = np.interp(times, clock, event["crack_length_mm"])
        return int(np.argmax(length >= number * length[-1]))
    if word not in ("onset", "branching", "arrival", "end") or sign == "*":
        raise OutputError(f"{phrase!r} names no frame: it must be a moment (onset, branching, arrival, end), a moment "
                          "+ seconds, or growing * share")
    if word not in moments:
        return None
    return int(np.argmin(np.abs(np.asarray(times) - (times[moments[word]] + number))))


# --- writing ---
def store(run: Path, target: Path, frames: Sequence[str], velocity: Sequence[str] = ()) -> Path:
    """Store a finished run of one analysis.

    Parameters
    ----------
    run: folder of the run.   target: folder of the reference; files in it are replaced.
    frames: phrases, see :func:`pick_frame`; those that name a moment which did not happen are left out.
    velocity: those of `frames` for which the velocity is kept too.

    Raises
    ------
    OutputError
        The folder holds no finished run of one analysis, or its files cannot be read.
    """
    summary = read_summary(run)
    if "moments" not in summary:
        raise OutputError(f"{run} holds two runs; store one of dynamic, quasistatic in it")
    scene, history = read_scene(run), History.load(run / HISTORY)
    space, quasistatic = scene.sample.space, summary["analysis"] == "quasistatic"
    times = frame_times(run / "series" / "run.pvd")
    event = {name: values[history["phase"] == "event"] for name, values in history.items()}
    chosen = {phrase: pick_frame(phrase, summary["moments"], times, event) for phrase in frames}
    numbers = sorted({number for number in chosen.values() if number is not None})
    moving = {chosen[phrase] for phrase in velocity}
    packer = Packer(space)
    packed = {"mesh": np.array([packer.checksum])}
    for i, number in enumerate(numbers):
        frame = _read(run, number, times[number], space.dim)
        if frame.u.shape != space.X.shape or len(frame.deleted) != space.n_elements:
            raise OutputError(f"{run} was computed on another mesh than {scene.sample.name} of {scene.case} is now")
        packed |= packer.pack(frame, f"{i}.", number in moving)
    packed["frames"] = np.frombuffer(json.dumps(
        {"phrases": {phrase: numbers.index(n) for phrase, n in chosen.items() if n is not None},
         "times": [None if quasistatic else times[n] for n in numbers]}).encode(), np.uint8)
    target.mkdir(parents=True, exist_ok=True)
    write_atomic(target / FIELDS, pack_file(packed))
    write_atomic(target / HISTORY, _table(history))
    write_atomic(target / SCENE, (run / SCENE).read_bytes())
    write_summary(target / SUMMARY, summary)
    return target


def store_coarse(run: Path, case: str) -> Path:
    """Store the summary of a run of the coarse mesh with both analyses as `coarse.json` of the case."""
    summary = read_summary(run)
    if summary.get("analysis") != "both":
        raise OutputError(f"{run} is not a run of both analyses")
    folder = reference_folder(case)
    folder.mkdir(parents=True, exist_ok=True)
    write_summary(folder / COARSE, summary)
    return folder / COARSE


def _read(run: Path, number: int, time: float, dim: int) -> Frame:
    printed = io.StringIO()
    try:
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):  # meshio prints, and exits
            return read_frame(run / "series" / frame_file("run", number), time, "", dim)
    except (Exception, SystemExit) as error:
        reason = str(error) if isinstance(error, Exception) else "it cannot be read"
        raise OutputError(f"{run} lacks frame {number}, or it is damaged: {reason.splitlines()[0]}") from None


def _table(history: Table) -> str:
    header = dict(zip(HISTORY_COLUMNS, history_header(history.dim)))
    names = [name for name in header if name not in history.without]
    cells = [[f"{value:.{DIGITS}g}" if values.dtype.kind == "f" else str(value) for value in values]
             for values in (history[name] for name in names)]
    return "".join(",".join(row) + "\n" for row in [[header[name] for name in names], *zip(*cells)])


# --- reading ---
def load(case: str, key: str) -> Reference:
    """The reference of a case.

    Raises
    ------
    OutputError
        There is none, it is damaged, or it was computed on another mesh than the case has now.
    """
    folder = reference_folder(case, key)
    if not (folder / FIELDS).is_file():
        raise OutputError(f"case {case} has no reference result {key}")
    summary, history, scene = read_summary(folder), History.load(folder / HISTORY), read_scene(folder)
    space = scene.sample.space
    try:
        packed, packer = unpack_file(folder / FIELDS), Packer(space)
        if int(packed["mesh"][0]) != packer.checksum:
            raise OutputError(f"the reference {folder} was computed on another mesh than {scene.sample.name} of "
                              f"{case}; compute it again")
        index = json.loads(packed["frames"].tobytes())
        frames = [packer.unpack(packed, f"{i}.", time) for i, time in enumerate(index["times"])]
        phrases = {str(phrase): frames[number] for phrase, number in index["phrases"].items()}
    except OutputError:
        raise
    except Exception as error:  # zipfile, lzma and numpy raise what they like on a damaged file
        raise OutputError(f"the reference {folder / FIELDS} is damaged: {type(error).__name__} {error}") from None
    return Reference(case, key, scene, summary, history, phrases)


def load_coarse(case: str) -> dict[str, Any]:
    """The stored summary of the coarse mesh, with both analyses; OutputError if there is none."""
    return read_summary(reference_folder(case), COARSE)
