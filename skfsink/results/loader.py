"""A run as it lies in its folder, finished or not: what `skfsink.load` returns.

Everything is read from text, VTU files and arrays of numbers; nothing in a folder is executed. Files are read when
they are asked for.
"""

from __future__ import annotations

import csv
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, overload

import meshio
import numpy as np

from ..errors import OutputError
from ..scene.stored import SCENE, StoredScene
from ..system.files import reported
from .energies import ENERGIES, Energy
from .fragments import FRAGMENTS, read_fragments
from .history import History, Table, deletions_header
from .probes import ProbeTable, read_probes
from .shown import Shown
from .stored_series import StoredSeries
from .summary import SUMMARY, read_summary

if TYPE_CHECKING:
    from ..scene.scene import Scene

__all__ = ["ENERGIES", "FIELD_UNITS", "Deletions", "Energy", "Frames", "Run", "load"]

log = logging.getLogger(__name__)
#: Units of the fields of a frame.
FIELD_UNITS = {"displacement": "mm", "velocity": "mm/s", "gamma": "1", "deleted": "1", "W": "MPa", "gamma_element": "1",
               "stress": "MPa", "pressure": "MPa", "von_mises": "MPa", "principal_stress": "MPa",
               "stretch": "1", "crushed": "1", "region": "1", "fibre_1": "1", "fibre_2": "1"}


class Deletions(NamedTuple):
    """Failed elements in the order they failed: time in :attr:`Run.clock` and number of the element."""

    time: np.ndarray
    element: np.ndarray


class Frames(Sequence[meshio.Mesh]):
    """Frames of the fields, read one at a time, on the undeformed body.

    Attributes
    ----------
    times: of the frames, in :attr:`Run.clock`: [s], or numbers of passes; load times [s] in a run that did not fail.
    name: "run", or "loading" for the frames of the loading.
    moments: frame number of onset, branching, arrival and end, as far as they happened.
    units: of the fields.   stored: where they are read from.
    """

    units: Mapping[str, str] = FIELD_UNITS

    def __init__(self, folder: Path, moments: Mapping[str, int], name: str = "run") -> None:
        self.folder, self.moments, self.name = folder, dict(moments), name
        self.stored = StoredSeries.of(folder, name)
        self.times = np.array(self.stored.times)

    def __len__(self) -> int:
        return len(self.times)

    @overload
    def __getitem__(self, key: int | str) -> meshio.Mesh: ...
    @overload
    def __getitem__(self, key: slice) -> list[meshio.Mesh]: ...
    def __getitem__(self, key: int | str | slice) -> meshio.Mesh | list[meshio.Mesh]:
        if isinstance(key, slice):
            return [self.frame(i) for i in range(*key.indices(len(self)))]
        return self.frame(key)

    def frame(self, key: int | str, deformed: bool = False) -> meshio.Mesh:
        """A frame by number or by moment; `deformed` moves its points by the displacement.

        Raises
        ------
        IndexError
            There is no such frame. It ends a loop over the frames.
        OutputError
            There was no such moment, or the file is missing or damaged.
        MissingExtra
            The frames are in one VTKHDF file, and h5py is not installed.
        """
        if isinstance(key, str) and key not in self.moments:
            raise OutputError(f"{self.folder.parent} has no frame {key!r}; it has {', '.join(self.moments) or 'none'}")
        number = self.moments[key] if isinstance(key, str) else range(len(self))[key]
        mesh = self.stored.mesh(number)
        if deformed:
            mesh.points = mesh.points + mesh.point_data["displacement"]
        return mesh


@dataclass(frozen=True, eq=False, repr=False)
class Run(Shown):
    """The results in a folder.

    Attributes
    ----------
    folder: of the run.
    summary: content of `summary.json`; empty if the run is not finished.
    case, parameters, assumed, model_choice: content of `scene.toml`; the mesh is the file that was given to the run,
        not the copy that this keeps.
    made_in_python: parts of the scene that `scene.toml` does not describe, such as "material".
    parts: of `analysis="both"` the two runs, "dynamic" and "quasistatic", as far as they were begun; otherwise empty.
    """

    folder: Path
    summary: dict[str, Any]
    case: str
    parameters: dict[str, Any]
    assumed: tuple[str, ...]
    model_choice: dict[str, Any]
    parts: Mapping[str, Run]
    made_in_python: tuple[str, ...] = ()

    @property
    def finished(self) -> bool:
        """Whether the run has come to its end."""
        return bool(self.summary)

    @property
    def analysis(self) -> str:
        """One of "dynamic", "quasistatic", "both"."""
        return str(self.parameters.get("analysis", "dynamic"))

    @property
    def verdict(self) -> str:
        """What became of the run, in one line; empty if it is not finished."""
        return " | ".join(str(part.summary.get("verdict", "")) for part in self.runs if part.summary)

    @property
    def clock(self) -> str:
        """What times of frames and deletions count: "s", or "pass" in a quasi-static run, which has no time."""
        return "pass" if self.analysis == "quasistatic" else "s"

    @property
    def warnings(self) -> list[str]:
        """What the run warned of."""
        return [str(text) for part in self.runs for text in part.summary.get("warnings", [])]

    @property
    def runs(self) -> tuple[Run, ...]:
        """The runs of one analysis in the folder: this one, or its parts."""
        return tuple(self.parts.values()) if self.parts else (self,)

    @cached_property
    def scene(self) -> Scene:
        """The scene, with mesh and material, made again from `scene.toml`; it warns of parts that are not those of the
        run.
        """
        from ..scene.registry import read_scene

        if self.made_in_python:
            log.warning("parts of the run in %s were made in Python (%s): those of the scene in its %s are others",
                        self.folder, ", ".join(self.made_in_python), SCENE)
        return read_scene(self.folder)

    @cached_property
    def history(self) -> Table:
        """Columns of `history.csv` as arrays, with their `units`."""
        return History.load(self._own("history.csv"))

    @cached_property
    def event(self) -> Table:
        """The rows of the history that belong to the event."""
        rows = self.history["phase"] == "event"
        return Table({name: values[rows] for name, values in self.history.items()}, self.history.dim,
                     self.history.without)

    @cached_property
    def frames(self) -> Frames:
        """The series of fields of the event; of a run that did not fail those of the loading."""
        return Frames(self._own("series"), self.summary.get("moments", {}), self.summary.get("series", "run"))

    @cached_property
    def deletions(self) -> Deletions:
        """Content of `deletions.csv`."""
        path = self._own("deletions.csv")
        with reported(f"cannot read {path}"):
            text = path.read_text(encoding="utf-8", errors="replace")
        try:
            header, *rows = csv.reader(text.splitlines())
            formerly = ["sweep", "element"]
            if header not in (deletions_header("s"), deletions_header("pass"), formerly):
                raise ValueError
            return Deletions(np.array([float(time) for time, _ in rows]), np.array([int(e) for _, e in rows], int))
        except ValueError:
            raise OutputError(f"{path} is no log of failed elements, or is damaged") from None

    @cached_property
    def probes(self) -> dict[str, ProbeTable]:
        """Columns of `probes/NAME.csv` as arrays, with their `units`, by the name of the probe; empty without any."""
        return read_probes(self._own("."))

    @cached_property
    def fragments(self) -> dict[str, np.ndarray]:
        """Columns of `fragments.csv` as arrays: the pieces of the body at each look and the end, the heaviest first."""
        return read_fragments(self._own(FRAGMENTS))

    @cached_property
    def energies(self) -> dict[str, Energy]:
        """Where the energy of the event is, by name of `ENERGIES`, as far as the run has it; empty before the event."""
        event = self.event
        if not event["step"].size:
            return {}
        row = self._arrival_row()
        found = {}
        for name, columns, meaning in ENERGIES:
            if name in event.without:
                continue
            values = np.sum([event[column] for column in columns], axis=0)
            found[name] = Energy(meaning, event.units[columns[0]], float(values[0]),
                                 None if row is None else float(values[row]), float(values[-1]))
        return found

    def _arrival_row(self) -> int | None:
        arrival, event = self.summary.get("event", {}), self.event
        time, number = arrival.get("first_arrival_s"), arrival.get("first_arrival_pass")
        if time is None and number is None:
            return None
        clock = event["time_s"] if time is not None else event["step"].astype(float)
        return int(np.argmin(np.abs(clock - (time if time is not None else number))))

    def _own(self, name: str) -> Path:
        if self.analysis == "both":
            raise OutputError(f"{self.folder} holds two runs: take one of its parts, {' or '.join(self.parts)}")
        return self.folder / name


def load(folder: str | Path) -> Run:
    """The results of a run in its folder, whether it is finished or not.

    Raises
    ------
    OutputError
        The folder holds no run, or its files are damaged. Files that are read later raise it when they are.
    """
    folder = Path(folder)
    stored = StoredScene.read(folder)
    parameters = stored.parameters_given()
    summary = read_summary(folder) if (folder / SUMMARY).exists() else {}
    parts = {name: load(folder / name) for name in ("dynamic", "quasistatic")
             if parameters.get("analysis") == "both" and (folder / name / SCENE).is_file()}
    return Run(folder, summary, stored.case, parameters, stored.assumed, dict(stored.model_choice), parts,
               stored.made_in_python)
