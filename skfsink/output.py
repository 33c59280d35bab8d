"""Files of a run: the history table, the series of fields for ParaView, and the summary.

Every file is replaced as a whole, or grows by whole lines, so that it can be read at any moment of the run and after
a run was killed. Nothing written depends on the clock: two equal runs give equal files.
"""

from __future__ import annotations

import json
import math
import platform
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import meshio
import numpy as np

from . import __version__
from .errors import OutputError
from .files import prepare_folder, replaced, write_atomic
from .history import HISTORY_COLUMNS, History
from .space import Space

__all__ = ["HISTORY_COLUMNS", "History", "Series", "frame_times", "prepare_folder", "read_summary", "replaced",
           "versions", "write_atomic", "write_summary"]

SUMMARY = "summary.json"
VTK_ORDER = {2: [0, 1, 3, 2], 3: [0, 1, 3, 2, 4, 5, 7, 6]}  # corners of `Space.conn` in the order of VTK


# --- the fields ---
class Series:
    """A time series of fields for ParaView: `<name>.pvd`, which names the frames `<name>_0000.vtu`, ...

    Points are those of the undeformed body: warp by the vector `displacement` to see it deformed.

    Memory: the frames so far; `add` writes the next one, `flush` and `close` wait for the last one, `resume` takes up
    those in the folder.

    Parameters
    ----------
    folder: an existing folder.
    name: of the series.
    space: whose mesh the fields live on.
    """

    def __init__(self, folder: str | Path, name: str, space: Space) -> None:
        self.folder, self.name, self.space = Path(folder), name, space
        self.times: list[float] = []
        self._writer = ThreadPoolExecutor(1, "frames")  # compressing a frame takes as long as twenty steps
        self._pending: Future[None] | None = None
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
        """Write a frame, then name it in the PVD file, while the caller goes on; see :meth:`flush`.

        Arrays are (n,) or (n, dim) on points, (ne,) or (ne, dim) on cells. Vectors get a third component; floats are
        stored in single precision, flags as bytes.
        """
        self.flush()
        points = {name: _field(values) for name, values in point_data.items()}
        cells = {name: [_field(values)] for name, values in cell_data.items()}
        mesh = meshio.Mesh(self._points, self._cells, points, cells)
        self.times.append(float(time))
        self._pending = self._writer.submit(self._write, self.frame(len(self.times) - 1), mesh)

    def flush(self) -> None:
        """Wait until every frame is written.

        Raises
        ------
        OutputError
            One could not be written.
        """
        if self._pending is not None:
            pending, self._pending = self._pending, None
            pending.result()

    def close(self) -> None:
        """Wait for the frame that is being written, if any, whatever becomes of it: the run has ended otherwise."""
        if self._pending is not None:
            self._pending.exception()
            self._pending = None

    def _write(self, path: Path, mesh: meshio.Mesh) -> None:
        with replaced(path) as part:
            meshio.write(part, mesh, "vtu", compression="zlib")
        self._write_index()

    def resume(self, n: int) -> None:
        """Take up the series found in the folder after its first `n` frames; drop the later ones.

        Raises
        ------
        OutputError
            There is no such series, or it has fewer frames.
        """
        self.flush()
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


def frame_times(path: Path) -> list[float]:
    """Times of the frames that a PVD file names [s], or sweeps; OutputError if it is not there, or damaged."""
    try:
        return [float(entry.attrib["timestep"]) for entry in ET.parse(path).iter("DataSet")]
    except (OSError, ET.ParseError, KeyError, ValueError):
        raise OutputError(f"{path} is missing or damaged") from None


def _field(values: np.ndarray) -> np.ndarray:
    """A copy as it is stored."""
    if values.dtype == bool:
        values = values.astype(np.uint8)
    elif values.dtype.kind == "f":
        limit = np.finfo(np.float32).max
        values = np.clip(values, -limit, limit).astype(np.float32)
    else:
        values = values.copy()
    return _vectors(values) if values.ndim == 2 and values.shape[1] == 2 else values


def _vectors(values: np.ndarray) -> np.ndarray:
    return np.column_stack([values, np.zeros((len(values), 3 - values.shape[1]), values.dtype)])


# --- the summary ---
def write_summary(path: str | Path, summary: Mapping[str, Any]) -> None:
    """Write the results of a run as JSON, arrays as lists. An OutputError names a number that is not finite."""
    write_atomic(path, json.dumps(_plain(summary, "summary"), indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def read_summary(folder: Path, name: str = SUMMARY) -> dict[str, Any]:
    """The summary of a finished run; OutputError if there is none, or it is damaged."""
    path = folder / name
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(summary, dict) or "case" not in summary:
            raise ValueError("no summary")
        return summary
    except FileNotFoundError:
        raise OutputError(f"{path.parent} holds no finished run: there is no {path.name}") from None
    except (OSError, ValueError) as error:
        raise OutputError(f"{path} is damaged: {error}") from None


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
