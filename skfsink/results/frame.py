"""The fields at one time of a run, as they are drawn and compared."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import meshio
import numpy as np

from ..fields.fragments import SPENT

__all__ = ["SPENT", "Frame", "frame_file", "frame_of", "read_frame"]


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
    """

    time: float
    label: str
    u: np.ndarray
    gamma: np.ndarray
    deleted: np.ndarray
    v: np.ndarray | None = None

    @property
    def title(self) -> str:
        """Label and time in microseconds."""
        return ", ".join(filter(None, [self.label, f"{self.time * 1e6:.1f} µs" if np.isfinite(self.time) else ""]))


def read_frame(path: Path, time: float, label: str, dim: int) -> Frame:
    """A frame of the ParaView series as the fields to draw."""
    return frame_of(meshio.read(path), time, label, dim)


def frame_of(data: meshio.Mesh, time: float, label: str, dim: int) -> Frame:
    """A frame that was read as the fields to draw."""
    u, v = (np.asarray(data.point_data[name], float)[:, :dim] for name in ("displacement", "velocity"))
    return Frame(time, label, u, np.asarray(data.point_data["gamma"], float),
                 np.asarray(data.cell_data["deleted"][0], bool), v)
