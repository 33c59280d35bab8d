"""Files of a run: the history table, the series of fields for ParaView, and the summary.

Every file is replaced as a whole, or grows by whole lines, so that it can be read at any moment of the run and after
a run was killed. Nothing written depends on the clock: two equal runs give equal files.
"""

from __future__ import annotations

import shutil
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import meshio
import numpy as np

from ..errors import OutputError
from ..fem.space import Space
from ..system.files import prepare_folder, replaced, reported, write_atomic
from .frame import frame_file, pieces_of_frame
from .history import HISTORY_COLUMNS, History
from .vtkhdf import PackedSeries

__all__ = ["HISTORY_COLUMNS", "History", "Series", "frame_mesh", "frame_times", "prepare_folder", "replaced",
           "write_atomic", "write_piece"]

VTK_ORDER = {2: [0, 1, 3, 2], 3: [0, 1, 3, 2, 4, 5, 7, 6]}  # corners of `Space.conn` in the order of VTK


# --- the fields ---
class Series:
    """A time series of fields for ParaView: `<name>.pvd`, which names the frames `<name>_0000.vtu`, ...

    Points are those of the undeformed body: warp by the vector `displacement` to see it deformed.

    Memory: the frames so far; `add` and `add_pieces` write the next one, `flush` and `close` wait for the last one,
    `resume` takes up those in the folder.

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

    @property
    def path(self) -> Path:
        """The PVD file, which ParaView opens."""
        return self.folder / f"{self.name}.pvd"

    @property
    def packed_path(self) -> Path:
        """The file of all frames of a finished run that has one; see :mod:`.vtkhdf`."""
        return self.folder / f"{self.name}.vtkhdf"

    @property
    def _packed(self) -> bool:
        return self.packed_path.is_file() and not self.path.is_file()

    def frame(self, number: int) -> Path:
        """The file of a frame: VTU, or where ranks have written a piece each, the PVTU file that names them."""
        path = self.folder / frame_file(self.name, number)
        return path if path.is_file() or not pieces_of_frame(path).is_file() else pieces_of_frame(path)

    def add(self, time: float, point_data: Mapping[str, np.ndarray], cell_data: Mapping[str, np.ndarray]) -> None:
        """Write a frame, then name it in the PVD file, while the caller goes on; see :meth:`flush`.

        Arrays are (n,) or (n, dim) on points, (ne,) or (ne, dim) on cells. Vectors get a third component; floats are
        stored in single precision, flags as bytes.
        """
        self.flush()
        mesh = frame_mesh(self.space, point_data, cell_data)
        self.times.append(float(time))
        self._pending = self._writer.submit(self._write, self.frame(len(self.times) - 1), mesh)

    def add_pieces(self, time: float, count: int, write: Callable[[Path], list[str]]) -> None:
        """Write a frame in `count` pieces: `write` gets the folder for them, and gives the XML of :func:`write_piece`.

        Raises
        ------
        OutputError
            One could not be written.
        """
        self.flush()
        path = self.folder / frame_file(self.name, len(self.times))
        pieces = path.with_suffix("")
        with reported(f"cannot write {pieces}"):
            pieces.mkdir(exist_ok=True)
        lines = write(pieces)
        sources = [f'<Piece Source="{pieces.name}/{piece_file(rank)}"/>' for rank in range(count)]
        write_atomic(pieces_of_frame(path), "\n".join([
            '<?xml version="1.0"?>', '<VTKFile type="PUnstructuredGrid" version="0.1" byte_order="LittleEndian">',
            '<PUnstructuredGrid GhostLevel="0">', *lines, *sources, "</PUnstructuredGrid>", "</VTKFile>"]) + "\n")
        self.times.append(float(time))
        self._write_index()

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

    def check(self, n: int) -> list[float]:
        """Times of the first `n` frames of the series found in the folder; nothing is changed.

        Raises
        ------
        OutputError
            There is no such series, or it has fewer frames.
        """
        if n and self._packed:
            return list(PackedSeries(self.packed_path).times[:n])
        failure = f"cannot resume the series of fields: {self.path}"
        try:
            times = [float(entry.attrib["timestep"]) for entry in ET.parse(self.path).iter("DataSet")] if n else []
        except (OSError, ET.ParseError, KeyError, ValueError):
            raise OutputError(f"{failure} is missing or damaged") from None
        if (there := sum(self.frame(i).is_file() for i in range(min(n, len(times))))) < n:
            raise OutputError(f"{failure} has {there} of the {n} frames")
        return times[:n]

    def resume(self, n: int) -> None:
        """Take up the series found in the folder after its first `n` frames; drop the later ones.

        Raises
        ------
        OutputError
            There is no such series, or it has fewer frames.
        """
        self.flush()
        self.times = self.check(n)
        if n and self._packed:  # a finished run
            return
        self.packed_path.unlink(missing_ok=True)
        self._write_index()
        while (path := self.frame(n)).is_file():
            path.unlink()
            shutil.rmtree(path.with_suffix(""), ignore_errors=True)
            n += 1

    def _write_index(self) -> None:
        root = ET.Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
        collection = ET.SubElement(root, "Collection")
        for i, time in enumerate(self.times):
            ET.SubElement(collection, "DataSet", timestep=repr(time), group="", part="0", file=self.frame(i).name)
        ET.indent(root, " ")
        write_atomic(self.path, '<?xml version="1.0"?>\n' + ET.tostring(root, "unicode") + "\n")


def frame_mesh(space: Space, point_data: Mapping[str, np.ndarray], cell_data: Mapping[str, np.ndarray]) -> meshio.Mesh:
    """The undeformed body with fields, as :meth:`Series.add` takes them."""
    kind = "quad" if space.dim == 2 else "hexahedron"
    return meshio.Mesh(_vectors(space.X), [(kind, space.conn[:, VTK_ORDER[space.dim]].astype("i4"))],
                       {name: _field(values) for name, values in point_data.items()},
                       {name: [_field(values)] for name, values in cell_data.items()})


def piece_file(rank: int) -> str:
    """Name of the piece of a rank in the folder of a frame."""
    return f"{rank:04d}.vtu"


def write_piece(folder: Path, rank: int, mesh: meshio.Mesh) -> list[str]:
    """Write the piece of a rank; returns what a PVTU file says of its arrays.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    with replaced(folder / piece_file(rank)) as part:
        meshio.write(part, mesh, "vtu", compression="zlib")
    lines = ["<PPoints>", _array("", mesh.points), "</PPoints>", "<PPointData>",
             *(_array(name, values) for name, values in mesh.point_data.items()), "</PPointData>", "<PCellData>",
             *(_array(name, values[0]) for name, values in mesh.cell_data.items()), "</PCellData>"]
    return lines


def _array(name: str, values: np.ndarray) -> str:
    kind = {"f": "Float", "i": "Int", "u": "UInt"}[values.dtype.kind] + str(8 * values.dtype.itemsize)
    components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    return f'<PDataArray type="{kind}" Name="{name or "Points"}"{components}/>'


def frame_times(path: Path) -> list[float]:
    """Times of the frames that a PVD file names [s], or passes; OutputError if it is not there, or damaged."""
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
