"""Files of a run: the history table, the series of fields for ParaView, and the summary.

Every file is replaced as a whole, or grows by whole lines, so that it can be read at any moment of the run and after
a run was killed. Nothing written depends on the clock: two equal runs give equal files.
"""

from __future__ import annotations

import csv
import io
import json
import math
import os
import platform
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import meshio
import numpy as np

from . import __version__
from .errors import OutputError
from .space import Space

__all__ = ["HISTORY_COLUMNS", "History", "Series", "prepare_folder", "replaced", "versions", "write_atomic",
           "write_summary"]

_ENERGY = "[N mm/mm in 2D, N mm in 3D]"
#: Columns of `history.csv`, in order, with their meaning and unit. Energies are those of :class:`.energy.Ledger`.
HISTORY_COLUMNS: dict[str, str] = {
    "phase": "phase of the run",
    "step": "load increments, sweeps or time steps taken in the phase",
    "time_s": "time since the start of the phase [s]",
    "grip_displacement_mm": "displacement of a grip [mm]",
    "reaction_N_per_mm": "force on a grip along its motion [N/mm in 2D, N in 3D]",
    "elastic": f"gamma-weighted stored energy {_ENERGY}",
    "kinetic": f"gamma-weighted kinetic energy {_ENERGY}",
    "work": f"work of the grips {_ENERGY}",
    "sink_stored": f"stored energy taken by the sink, the first part of D {_ENERGY}",
    "sink_kinetic": f"kinetic energy taken by the sink, the second part of D {_ENERGY}",
    "deletion": f"energy left in elements when they were deleted {_ENERGY}",
    "numerical": f"dissipation of the time integration {_ENERGY}",
    "released": f"energy given up in relaxing to equilibrium {_ENERGY}",
    "U_paper": f"U of the paper (Eq. 30, 32) {_ENERGY}",
    "balance": f"what the energies fail to add up to {_ENERGY}",
    "tip_x_mm": "position of the leading tip, undeformed [mm]",
    "tip_y_mm": "position of the leading tip, undeformed [mm]",
    "tip_z_mm": "position of the leading tip, undeformed [mm]",
    "crack_length_mm": "length of the crack, undeformed [mm]",
    "tip_speed_m_per_s": "speed of the leading tip [m/s]",
    "tips": "tips that advance",
    "branches": "branches, advancing or arrested",
    "deleted_elements": "failed elements",
    "gamma_min": "least relative density of a node",
    "dt_s": "time step [s]",
}
_KIND: dict[str, type] = {**dict.fromkeys(HISTORY_COLUMNS, float), "phase": str,
                          **dict.fromkeys(("step", "tips", "branches", "deleted_elements"), int)}
_MISSING: dict[type, Any] = {str: "", int: 0, float: math.nan}
VTK_ORDER = {2: [0, 1, 3, 2], 3: [0, 1, 3, 2, 4, 5, 7, 6]}  # corners of `Space.conn` in the order of VTK


@contextmanager
def _reported(failure: str) -> Iterator[None]:
    """Turn an error of the operating system into an OutputError."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"{failure}: {error.strerror or error}") from error


@contextmanager
def replaced(path: str | Path) -> Iterator[Path]:
    """Give the path of a temporary file beside `path`, and put that in its place once the block has filled it.

    Raises
    ------
    OutputError
        The file cannot be written. What stood at `path` before is untouched then, as after any other error.
    """
    part = Path(path).with_name(f".{Path(path).name}.part")
    try:
        with _reported(f"cannot write {path}"):
            yield part
            with open(part, "r+b") as file:
                os.fsync(file.fileno())
            os.replace(part, path)
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def write_atomic(path: str | Path, content: bytes | str) -> None:
    """Write a file so that a reader finds the old content or the new, never a part. Text is UTF-8, lines end in LF."""
    with replaced(path) as part:
        part.write_bytes(content.encode() if isinstance(content, str) else content)


def prepare_folder(path: str | Path, overwrite: bool = False) -> Path:
    """Make the folder of a run, and try that it can be written to. Nothing in it is ever deleted.

    Raises
    ------
    OutputError
        It is no folder, cannot be written, or has something in it and `overwrite` was not given.
    """
    path = Path(path)
    with _reported(f"cannot write to the output folder {path}"):
        if path.exists() and not path.is_dir():
            raise OutputError(f"the output folder {path} is a file")
        path.mkdir(parents=True, exist_ok=True)
        if not overwrite and any(path.iterdir()):
            raise OutputError(f"the output folder {path} is not empty; name another one, or allow to overwrite it")
        tempfile.TemporaryFile(dir=path).close()
    return path


# --- the history ---
class History:
    """The table of a run, a row at each recorded time, in memory and in a file that grows with it.

    Parameters
    ----------
    path: of the CSV file, written anew here.
    rows: to start with, from a checkpoint.

    Attributes
    ----------
    rows: a dictionary with a value for each of `HISTORY_COLUMNS` for every row.
    """

    def __init__(self, path: str | Path, rows: Sequence[Mapping[str, Any]] = ()) -> None:
        self.path = Path(path)
        self.rows = [_row(row) for row in rows]
        write_atomic(self.path, _csv([list(HISTORY_COLUMNS), *(row.values() for row in self.rows)]))

    def append(self, row: Mapping[str, Any]) -> None:
        """Add a row. Columns that it leaves out are NaN, counts are 0; an unknown column is a KeyError."""
        self.rows.append(_row(row))
        with _reported(f"cannot write {self.path}"), open(self.path, "a", encoding="utf-8", newline="") as file:
            file.write(_csv([self.rows[-1].values()]))

    def columns(self) -> dict[str, np.ndarray]:
        """The columns as arrays (rows,): `phase` of str, counts of int64, all others of float64."""
        return _columns({name: [row[name] for row in self.rows] for name in HISTORY_COLUMNS})

    @staticmethod
    def load(path: str | Path) -> dict[str, np.ndarray]:
        """Columns of a history file, as in :meth:`columns`; a last line that was not finished is left out.

        Raises
        ------
        OutputError
            The file cannot be read, or is not a history.
        """
        with _reported(f"cannot read the history {path}"):
            text = Path(path).read_text(encoding="utf-8", errors="replace")
        try:
            header, *lines = csv.reader(text[:text.rfind("\n") + 1].splitlines())
            if header != list(HISTORY_COLUMNS):
                raise ValueError
            return _columns({name: [line[i] for line in lines] for i, name in enumerate(HISTORY_COLUMNS)})
        except (IndexError, ValueError) as error:
            raise OutputError(f"{path} is not a history file of skfsink, or is damaged") from error


def _row(values: Mapping[str, Any]) -> dict[str, Any]:
    if unknown := values.keys() - HISTORY_COLUMNS.keys():
        raise KeyError(f"the history has no column {', '.join(sorted(unknown))}")
    return {name: kind(values.get(name, _MISSING[kind])) for name, kind in _KIND.items()}


def _csv(rows: Sequence[Any]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)  # floats are written by repr, which loses no bit
    return text.getvalue()


def _columns(values: Mapping[str, Sequence[Any]]) -> dict[str, np.ndarray]:
    return {name: np.array([kind(value) for value in values[name]], kind) for name, kind in _KIND.items()}


# --- the fields ---
class Series:
    """A time series of fields for ParaView: `<name>.pvd`, which names the frames `<name>_0000.vtu`, ...

    Points are those of the undeformed body: warp by the vector `displacement` to see it deformed.

    Parameters
    ----------
    folder: an existing folder.
    name: of the series.
    space: whose mesh the fields live on.
    """

    def __init__(self, folder: str | Path, name: str, space: Space) -> None:
        self.folder, self.name, self.space = Path(folder), name, space
        self.times: list[float] = []
        self._points = _vectors(space.X)
        self._cells = [("quad" if space.dim == 2 else "hexahedron", space.conn[:, VTK_ORDER[space.dim]].astype("i4"))]

    @property
    def path(self) -> Path:
        """The PVD file, which ParaView opens."""
        return self.folder / f"{self.name}.pvd"

    def frame(self, number: int) -> Path:
        """The VTU file of a frame."""
        return self.folder / f"{self.name}_{number:04d}.vtu"

    def add(self, time: float, point_data: Mapping[str, np.ndarray], cell_data: Mapping[str, np.ndarray]) -> None:
        """Write a frame, then name it in the PVD file.

        Arrays are (n,) or (n, dim) on points, (ne,) or (ne, dim) on cells. Vectors get a third component; floats are
        stored in single precision, flags as bytes.
        """
        points = {name: _field(values) for name, values in point_data.items()}
        cells = {name: [_field(values)] for name, values in cell_data.items()}
        with replaced(self.frame(len(self.times))) as part:
            meshio.write(part, meshio.Mesh(self._points, self._cells, points, cells), "vtu", compression="zlib")
        self.times.append(float(time))
        self._write_index()

    def resume(self, n: int) -> None:
        """Take up the series found in the folder after its first `n` frames; drop the later ones.

        Raises
        ------
        OutputError
            There is no such series, or it has fewer frames.
        """
        failure = f"cannot resume the series of fields: {self.path}"
        try:
            times = [float(entry.attrib["timestep"]) for entry in ET.parse(self.path).iter("DataSet")] if n else []
        except (OSError, ET.ParseError, KeyError, ValueError):
            raise OutputError(f"{failure} is missing or damaged") from None
        if (there := sum(self.frame(i).is_file() for i in range(min(n, len(times))))) < n:
            raise OutputError(f"{failure} has {there} of the {n} frames")
        self.times = times[:n]
        self._write_index()
        while self.frame(n).is_file():
            self.frame(n).unlink()
            n += 1

    def _write_index(self) -> None:
        root = ET.Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
        collection = ET.SubElement(root, "Collection")
        for i, time in enumerate(self.times):
            ET.SubElement(collection, "DataSet", timestep=repr(time), group="", part="0", file=self.frame(i).name)
        ET.indent(root, " ")
        write_atomic(self.path, '<?xml version="1.0"?>\n' + ET.tostring(root, "unicode") + "\n")


def _field(values: np.ndarray) -> np.ndarray:
    if values.dtype == bool:
        values = values.astype(np.uint8)
    elif values.dtype.kind == "f":
        limit = np.finfo(np.float32).max
        values = np.clip(values, -limit, limit).astype(np.float32)
    return _vectors(values) if values.ndim == 2 and values.shape[1] == 2 else values


def _vectors(values: np.ndarray) -> np.ndarray:
    return np.column_stack([values, np.zeros((len(values), 3 - values.shape[1]), values.dtype)])


# --- the summary ---
def write_summary(path: str | Path, summary: Mapping[str, Any]) -> None:
    """Write the results of a run as JSON, arrays as lists. An OutputError names a number that is not finite."""
    write_atomic(path, json.dumps(_plain(summary, "summary"), indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def _plain(value: Any, name: str) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item, f"{name}.{key}") for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist(), name)
    if isinstance(value, list | tuple):
        return [_plain(item, f"{name}[{i}]") for i, item in enumerate(value)]
    if isinstance(value, float) and not math.isfinite(value):
        raise OutputError(f"{name} is {value}: a summary holds finite numbers only")
    return str(value) if isinstance(value, Path) else value


def versions() -> dict[str, str]:
    """Versions of what the results came from, and the machine."""
    found = {"skfsink": __version__, "python": platform.python_version()}
    for package in ("numpy", "scipy", "scikit-fem", "numba", "pyamg", "meshio", "pypardiso"):
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return {**found, "machine": f"{platform.system()} {platform.machine()}"}
