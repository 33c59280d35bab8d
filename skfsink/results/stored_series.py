"""A series of fields as it lies in a folder: a file each frame, or all frames in one."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import meshio

from ..errors import OutputError
from .frame import Frame, frame_file, frame_of, read_fields
from .series import frame_times
from .vtkhdf import PackedSeries, pack

__all__ = ["PACKED", "StoredSeries", "pack_series", "series_index"]


PACKED = ".vtkhdf"  #: suffix of the one file of all frames


def series_index(folder: Path, name: str) -> Path:
    """The file that knows the frames of a series: `NAME.pvd` or, once they are packed, the one file that has them."""
    index, packed = (folder / f"{name}{suffix}" for suffix in (".pvd", PACKED))
    return packed if packed.is_file() and not index.is_file() else index


@dataclass(frozen=True)
class StoredSeries:
    """The frames of a series.

    Attributes
    ----------
    folder, name: of the series.   times: of its frames.
    packed: the one file of all frames, if there is one.
    """

    folder: Path
    name: str
    times: Sequence[float]
    packed: PackedSeries | None = None

    @classmethod
    def of(cls, folder: Path, name: str) -> StoredSeries:
        """That in a folder.

        Raises
        ------
        OutputError
            It is not there, or damaged.
        """
        index = series_index(folder, name)
        if index.suffix == PACKED:
            packed = PackedSeries(index)
            return cls(folder, name, packed.times, packed)
        return cls(folder, name, frame_times(index))

    def __len__(self) -> int:
        return len(self.times)

    def mesh(self, number: int) -> meshio.Mesh:
        """A frame with all that it has, on the undeformed body.

        Raises
        ------
        OutputError
            Its file is missing or damaged.
        """
        if self.packed is not None:
            return self.packed.mesh(number)
        path = self.folder / frame_file(self.name, number)
        printed = io.StringIO()
        try:
            with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):  # meshio prints, and exits
                return read_fields(path)
        except (Exception, SystemExit):
            raise OutputError(f"{path} is missing or damaged") from None

    def frame(self, number: int, time: float, label: str, dim: int, cells: Sequence[str] = ()) -> Frame:
        """A frame as it is drawn; see :func:`.frame_of`."""
        return frame_of(self.mesh(number), time, label, dim, cells)


def pack_series(folder: Path, name: str) -> None:
    """Make one file `NAME.vtkhdf` of the frames of a series, and remove those; nothing where it was done before.

    Raises
    ------
    MissingExtra, OutputError
        h5py is not installed; a frame is missing, or the file cannot be written.
    """
    series = StoredSeries.of(folder, name)
    if series.packed is not None or not len(series):
        return
    pack(folder / f"{name}{PACKED}", series.times, (series.mesh(number) for number in range(len(series))))
    (folder / f"{name}.pvd").unlink()  # from here on it is the other file that counts
    for number in range(len(series)):
        (folder / frame_file(name, number)).unlink()
