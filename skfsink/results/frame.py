"""The fields at one time of a run, as they are drawn and compared."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import meshio
import numpy as np

from ..errors import OutputError
from ..fields.fragments import SPENT
from ..fields.stress import principal_stresses

__all__ = ["NODE", "SPENT", "Frame", "frame_file", "frame_of", "pieces_of_frame", "read_fields", "read_frame"]

ELEMENT, NODE = "element", "node"  # arrays of pieces: numbers in the whole body


def frame_file(name: str, number: int) -> str:
    """Name of the file of a frame of the series `name`."""
    return f"{name}_{number:04d}.vtu"


@dataclass(frozen=True)
class Frame:
    """The fields at one time.

    Attributes
    ----------
    time: [s]; NaN where time means nothing.   label: what happens then; may be empty.
    u: displacement [mm], (n, dim).   gamma: relative density, (n,).   deleted: failed elements, (ne,) bool.
    v: velocity [mm/s], (n, dim), or None where it was not kept.
    cells: values of the elements by name of the field, (ne,), as far as they were asked for.
    """

    time: float
    label: str
    u: np.ndarray
    gamma: np.ndarray
    deleted: np.ndarray
    v: np.ndarray | None = None
    cells: Mapping[str, np.ndarray] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """Label and time in microseconds."""
        return ", ".join(filter(None, [self.label, f"{self.time * 1e6:.1f} µs" if np.isfinite(self.time) else ""]))


def pieces_of_frame(path: Path) -> Path:
    """The file that names the pieces of a frame, where ranks have written one each, of the `path` of its one file."""
    return path.with_suffix(".pvtu")


def read_fields(path: Path) -> meshio.Mesh:
    """The mesh with the fields of a frame, from one file, or put together from the pieces that ranks have written."""
    index = pieces_of_frame(path)
    if path.is_file() or not index.is_file():
        return meshio.read(path)
    names = [piece.attrib["Source"] for piece in ET.parse(index).iter("Piece")]
    pieces = [meshio.read(path.parent / name) for name in names]
    nodes = [piece.point_data.pop(NODE) for piece in pieces]
    elements = [piece.cell_data.pop(ELEMENT)[0] for piece in pieces]
    cells = [number[piece.cells[0].data] for piece, number in zip(pieces, nodes)]
    kind = pieces[0].cells[0].type
    return meshio.Mesh(
        _joined([piece.points for piece in pieces], nodes), [(kind, _joined(cells, elements).astype("i4"))],
        {name: _joined([piece.point_data[name] for piece in pieces], nodes) for name in pieces[0].point_data},
        {name: [_joined([piece.cell_data[name][0] for piece in pieces], elements)] for name in pieces[0].cell_data})


def _joined(values: list[np.ndarray], numbers: list[np.ndarray]) -> np.ndarray:
    """Values of all pieces in the order of the whole body."""
    whole: np.ndarray = np.empty((1 + max(int(number.max()) for number in numbers), *values[0].shape[1:]),
                                 values[0].dtype)
    for value, number in zip(values, numbers):
        whole[number] = value
    return whole


def read_frame(path: Path, time: float, label: str, dim: int, cells: Sequence[str] = ()) -> Frame:
    """A frame of the ParaView series, from its file; see :func:`frame_of`."""
    return frame_of(read_fields(path), time, label, dim, cells)


def frame_of(data: meshio.Mesh, time: float, label: str, dim: int, cells: Sequence[str] = ()) -> Frame:
    """A frame as the fields to draw; `cells` names fields of the elements.

    Raises
    ------
    OutputError
        The frame has no such field.
    """
    u, v = (np.asarray(data.point_data[name], float)[:, :dim] for name in ("displacement", "velocity"))
    return Frame(time, label, u, np.asarray(data.point_data["gamma"], float),
                 np.asarray(data.cell_data["deleted"][0], bool), v, {name: _cells(data, name) for name in cells})


def _cells(data: meshio.Mesh, name: str) -> np.ndarray:
    """Values of the elements; the greatest principal stress follows from the stress."""
    if name in data.cell_data:
        return np.asarray(data.cell_data[name][0], float)
    if name == "principal_stress" and "stress" in data.cell_data:
        return principal_stresses(np.asarray(data.cell_data["stress"][0], float))[:, -1]
    raise OutputError(f"the frames have no field {name}: run the scene with --fields {name}")
