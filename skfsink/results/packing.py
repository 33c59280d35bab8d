"""Frames of fields as few bytes, for results that are committed.

Displacement, gamma and velocity are rounded to a step, and each node stores its difference to a neighbour with a
lower number, modulo 2^16: smooth fields become small numbers, which LZMA compresses well. Nodes that are spent have no
displacement of their own and get that of the nearest node that is not.

The 15 committed references take 2.8 MB so. As float32 in `numpy.savez_compressed` the same rounded fields take 10.0 MB
(2.5 to 8.5 times as much, 3.5 in all), and fields as runs write them 4 to 12 times as much.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from ..fem.space import Space
from .frame import SPENT, Frame

__all__ = ["DISPLACEMENT_STEP", "GAMMA_STEP", "VELOCITY_STEPS", "Packer", "pack_file", "unpack_file"]

DISPLACEMENT_STEP = 1e-4    # [mm]; more where displacements exceed 3.2 mm
GAMMA_STEP = 1e-3
VELOCITY_STEPS = 1000       # in the greatest velocity component of a frame
_LARGEST = 32000            # steps in a field


class Packer:
    """Packs and unpacks frames of fields on one mesh.

    Attributes
    ----------
    checksum: of the mesh; frames packed on one mesh mean nothing on another.
    """

    def __init__(self, space: Space) -> None:
        self.space = space
        points = np.rint(space.X / 1e-6).astype("<i8")  # rolled meshes differ in their last digits between machines
        nodes = np.ascontiguousarray(space.conn, "<i8")
        self.checksum = zlib.crc32(nodes.tobytes(), zlib.crc32(points.tobytes()))
        na, n = space.conn.shape[1], space.n_nodes
        a, b = np.repeat(space.conn, na, axis=1).ravel(), np.tile(space.conn, (1, na)).ravel()
        highest = np.full(n, -1)
        np.maximum.at(highest, a[b < a], b[b < a])
        self._parent = np.where(highest < 0, n, highest)  # highest of the neighbours with a lower number, n for none

    def pack(self, frame: Frame, prefix: str, moving: bool) -> dict[str, np.ndarray]:
        """Arrays, with names that start with `prefix`, from which :meth:`unpack` makes the frame, without its label.

        The velocity is among them if `moving`.
        """
        X, live = self.space.X, frame.gamma >= SPENT
        nearest = np.arange(len(X))
        if live.any() and not live.all():
            nearest[~live] = np.flatnonzero(live)[cKDTree(X[live]).query(X[~live])[1]]
        fields = [("u", frame.u[nearest], DISPLACEMENT_STEP), ("gamma", frame.gamma[:, None], GAMMA_STEP)]
        if moving and frame.v is not None:
            v = frame.v[nearest]
            fields.append(("v", v, (float(np.abs(v).max()) or 1.0) / VELOCITY_STEPS))
        packed = {prefix + "deleted": np.packbits(frame.deleted)}
        for name, values, step in fields:
            step = max(step, float(np.abs(values).max()) / _LARGEST)
            steps = np.rint(values / step).astype(np.int16)
            above = np.vstack([steps, np.zeros_like(steps[:1])])[self._parent]
            packed[prefix + name] = _folded(steps - above)
            packed[prefix + name + "_step"] = np.array([step])
        return packed

    def unpack(self, packed: dict[str, np.ndarray], prefix: str, time: float | None) -> Frame:
        """The frame, at that time (None where time means nothing); KeyError or ValueError if it is not all there."""
        fields = {}
        for name, k in (("u", self.space.dim), ("gamma", 1), ("v", self.space.dim)):
            if name == "v" and prefix + name not in packed:
                continue
            if packed[prefix + name].shape != (k, 2, self.space.n_nodes):
                raise ValueError(f"{name} has the shape {packed[prefix + name].shape}")
            steps = self._summed(_unfolded(packed[prefix + name])).astype(np.uint16).view(np.int16)
            fields[name] = steps * float(packed[prefix + name + "_step"][0])
        bits = packed[prefix + "deleted"]
        if len(bits) != -(-self.space.n_elements // 8):
            raise ValueError(f"deleted has {len(bits)} bytes")
        deleted = np.unpackbits(bits, count=self.space.n_elements).astype(bool)
        return Frame(np.nan if time is None else float(time), "", fields["u"], fields["gamma"][:, 0], deleted,
                     fields.get("v"))

    def _summed(self, delta: np.ndarray) -> np.ndarray:
        """Sums (n, k) of the differences along each node's chain of parents; as many passes as its length has bits."""
        total, above = np.vstack([delta, np.zeros_like(delta[:1])]), np.append(self._parent, len(delta))
        while np.any(above < len(delta)):
            total, above = total + total[above], above[above]
        return total[:-1]


def _folded(delta: np.ndarray) -> np.ndarray:
    """Signed 16-bit numbers (n, k) as bytes (k, 2, n), low bytes before high ones; small numbers of either sign are
    small."""
    wide = delta.astype(np.int64)
    folded = ((wide << 1) ^ (wide >> 63)).astype(np.uint16).T
    return np.stack([folded & 255, folded >> 8], axis=1).astype(np.uint8)


def _unfolded(data: np.ndarray) -> np.ndarray:
    """Inverse of :func:`_folded`, as int64."""
    low, high = data.astype(np.int64).transpose(1, 2, 0)
    folded = low | high << 8
    return np.asarray((folded >> 1) ^ -(folded & 1))


def pack_file(arrays: dict[str, np.ndarray]) -> bytes:
    """An npz file compressed with LZMA; equal arrays give equal bytes."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_LZMA) as archive:
        for name, array in arrays.items():
            content = io.BytesIO()
            np.lib.format.write_array(content, array, allow_pickle=False)
            entry = zipfile.ZipInfo(name + ".npy")
            entry.compress_type = zipfile.ZIP_LZMA
            archive.writestr(entry, content.getvalue())
    return file.getvalue()


def unpack_file(path: Path) -> dict[str, np.ndarray]:
    """The arrays in a file of :func:`pack_file`; whatever zipfile, lzma and numpy raise if it is damaged."""
    with np.load(path, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}
