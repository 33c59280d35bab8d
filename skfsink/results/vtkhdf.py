"""A series of fields in one file for ParaView: a VTKHDF unstructured grid whose steps share points and cells.

The format is that of VTK's `vtkHDFReader` (version 2.0 of the layout): the group `VTKHDF` has the mesh once, each field
as the rows of all frames one after the other, and under `Steps` the times and where the rows of each step begin. Needs
h5py, the extra `view`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import meshio
import numpy as np

from ..errors import MissingExtra, OutputError
from ..system.files import replaced

__all__ = ["PackedSeries", "check_h5py", "pack"]

_TYPES = {"quad": 9, "hexahedron": 12}
_OFFSETS = ("PartOffsets", "PointOffsets", "CellOffsets", "ConnectivityIdOffsets")
_LEVEL = 4  # of gzip: at 9 files are 1 % smaller, and take three times as long


def check_h5py() -> Any:
    """The module h5py.

    Raises
    ------
    MissingExtra
        It is not installed.
    """
    try:
        import h5py
    except ImportError:
        raise MissingExtra('--series vtkhdf needs h5py: pip install "skfsink[view]", or take --series vtu') from None
    return h5py


def pack(path: Path, times: Sequence[float], meshes: Iterable[meshio.Mesh]) -> None:
    """Write frames, of one mesh and with the same fields, as one file.

    Raises
    ------
    MissingExtra, OutputError
        h5py is not installed; the file cannot be written.
    """
    h5py, n = check_h5py(), len(times)
    with replaced(path) as part, h5py.File(part, "w", libver=("earliest", "v110"), track_order=False) as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array([2, 0], "i8")
        root.attrs.create("Type", np.bytes_("UnstructuredGrid"), dtype=h5py.string_dtype("ascii", 16))
        steps = root.create_group("Steps")
        steps.attrs["NSteps"] = n
        steps["Values"] = np.asarray(times, float)
        steps["NumberOfParts"] = np.ones(n, "i8")
        for name in _OFFSETS:  # the mesh of every step is the one there is
            shape = (n, 1) if name in ("CellOffsets", "ConnectivityIdOffsets") else n
            steps[name] = np.zeros(shape, "i8")
        for number, mesh in enumerate(meshes):
            if number == 0:
                _mesh(root, mesh)
            data = {("Point", name): values for name, values in mesh.point_data.items()}
            data |= {("Cell", name): values[0] for name, values in mesh.cell_data.items()}
            for (kind, name), values in data.items():
                values = np.asarray(values)
                rows, group = len(values), f"{kind}Data"
                if number == 0:
                    root.create_dataset(f"{group}/{name}", (n * rows, *values.shape[1:]), values.dtype,
                                        chunks=(max(rows, 1), *values.shape[1:]), **_packed())
                    steps[f"{group}Offsets/{name}"] = rows * np.arange(n)
                root[f"{group}/{name}"][number * rows:(number + 1) * rows] = values


def _packed() -> dict[str, Any]:
    return {"compression": "gzip", "compression_opts": _LEVEL, "shuffle": True}


def _mesh(root: Any, mesh: meshio.Mesh) -> None:
    block = mesh.cells[0]
    conn = np.asarray(block.data, "i4")
    cells, nodes = conn.shape
    root["NumberOfPoints"], root["NumberOfCells"] = np.array([len(mesh.points)]), np.array([cells])
    root["NumberOfConnectivityIds"] = np.array([conn.size])
    for name, values in (("Points", np.asarray(mesh.points)), ("Connectivity", conn.ravel()),
                         ("Offsets", nodes * np.arange(cells + 1, dtype="i4")),
                         ("Types", np.full(cells, _TYPES[block.type], "u1"))):
        root.create_dataset(name, data=values, chunks=values.shape, **_packed())


class PackedSeries:
    """The frames in a file that :func:`pack` has written.

    Attributes
    ----------
    path: of the file.   times: of its frames.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with self._open() as file:
            self.times = [float(time) for time in file["VTKHDF/Steps/Values"]]

    def mesh(self, number: int) -> meshio.Mesh:
        """A frame, as it was written.

        Raises
        ------
        MissingExtra, OutputError
            h5py is not installed; the file is missing or damaged.
        """
        with self._open() as file:
            root = file["VTKHDF"]
            cells = int(root["NumberOfCells"][0])
            kind = next(name for name, value in _TYPES.items() if value == root["Types"][0])
            conn = root["Connectivity"][:].reshape(cells, -1)
            data = {group: {name: self._rows(root, group, name, number) for name in root[group]}
                    for group in ("PointData", "CellData")}
            return meshio.Mesh(root["Points"][:], [(kind, conn)], data["PointData"],
                               {name: [values] for name, values in data["CellData"].items()})

    @staticmethod
    def _rows(root: Any, group: str, name: str, number: int) -> np.ndarray:
        rows = int(root["NumberOfPoints" if group == "PointData" else "NumberOfCells"][0])
        start = int(root[f"Steps/{group}Offsets/{name}"][number])
        return np.asarray(root[f"{group}/{name}"][start:start + rows])

    def _open(self) -> _Opened:
        return _Opened(self.path)


class _Opened:
    """A file that is being read; whatever is wrong with it is an OutputError of one line."""

    def __init__(self, path: Path) -> None:
        self._path, self._h5py = path, check_h5py()

    def __enter__(self) -> Any:
        try:
            self._file = self._h5py.File(self._path, "r")
        except OSError:
            raise OutputError(f"{self._path} is missing or damaged") from None
        return self._file

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, trace: Any) -> None:
        self._file.close()
        if isinstance(value, KeyError | OSError | ValueError | StopIteration | IndexError):
            raise OutputError(f"{self._path} is missing or damaged") from None
