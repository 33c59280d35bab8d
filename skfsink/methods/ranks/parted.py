"""A body parted once, in a folder: which elements each rank has, and its part of the mesh, a file for each.

`partition.json` says of how many parts and which mesh; `elements.npy` is the number of the part of each element;
`part_0000.npz` and so on have elements and nodes by their numbers in the whole body, the nodes that other parts have
too, coordinates and connectivity.
"""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import skfem

from ...errors import ParameterError
from ...fem.space import Space
from ...system.files import prepare_folder, replaced, write_atomic
from .partition import Numbers, mesh_of, numbers, partition

__all__ = ["Parted", "write_parts"]

INDEX, OF_ELEMENTS = "partition.json", "elements.npy"
MESHES: dict[int, type[skfem.Mesh]] = {2: skfem.MeshQuad, 3: skfem.MeshHex}
UNREADABLE = OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile


def _fingerprint(space: Space) -> str:
    hashed = hashlib.sha256(str(space.mesh.t.shape).encode())
    for array in (space.X, space.mesh.t):
        hashed.update(np.ascontiguousarray(array).tobytes())
    return hashed.hexdigest()


def write_parts(space: Space, parts: int, folder: Path, overwrite: bool = False) -> None:
    """Part a body, and write its parts into a folder.

    Raises
    ------
    ParameterError
        There are more parts than elements, or METIS is not there.
    OutputError
        The folder cannot be written, or it is not empty.
    """
    part = partition(space.conn, parts)
    prepare_folder(folder, overwrite)
    with replaced(folder / OF_ELEMENTS) as path, open(path, "wb") as file:
        np.save(file, part.astype(np.int32))
    for number, own in enumerate(numbers(space.conn, part)):
        mesh, ranks = mesh_of(space, own), sorted(own.shared)
        with replaced(folder / _file(number)) as path, open(path, "wb") as file:
            np.savez(file, elements=own.elements, nodes=own.nodes, counted=own.counted, neighbours=np.array(ranks, int),
                     counts=np.array([own.shared[rank].size for rank in ranks], int),
                     shared=np.concatenate([np.zeros(0, int), *(own.shared[rank] for rank in ranks)]),
                     points=mesh.p, cells=mesh.t)
    write_atomic(folder / INDEX, json.dumps({"parts": parts, "elements": space.n_elements, "nodes": space.n_nodes,
                                             "mesh": _fingerprint(space)}, indent=1) + "\n")


def _file(number: int) -> str:
    return f"part_{number:04d}.npz"


@dataclass(frozen=True)
class Parted:
    """A folder with the parts of a body."""

    folder: Path

    def check(self, space: Space, ranks: int) -> None:
        """Refuse parts of another number than there are ranks, of another mesh, or that are not all there.

        Raises
        ------
        ParameterError
            One line.
        """
        try:
            found = json.loads((self.folder / INDEX).read_text(encoding="utf-8"))
            parts, mesh = int(found["parts"]), str(found["mesh"])
        except (*UNREADABLE, TypeError) as error:
            raise ParameterError(f"{self.folder} has no parts of a body ({type(error).__name__} at {INDEX}): make them "
                                 f"with skfsink partition") from None
        if parts != ranks:
            raise ParameterError(f"{self.folder} has {parts} parts, and there {_are(ranks)}: start it with mpiexec -n "
                                 f"{parts}, or make others with skfsink partition -n {ranks}")
        if mesh != _fingerprint(space):
            raise ParameterError(f"{self.folder} has parts of another mesh than that of the scene: make them anew with "
                                 f"skfsink partition")
        if missing := [name for name in map(_file, range(parts)) if not (self.folder / name).is_file()]:
            raise ParameterError(f"{self.folder} lacks {missing[0]}: make the parts anew with skfsink partition")

    def numbers(self, number: int) -> Numbers:
        """What a part has, without what it shares; ParameterError if its file cannot be read."""
        with self._read(number) as file:
            return Numbers(file["elements"], file["nodes"], int(file["counted"]), {})

    def part(self, number: int) -> tuple[Numbers, skfem.Mesh]:
        """What a part has, and its mesh; ParameterError if its file cannot be read."""
        with self._read(number) as file:
            shared = np.split(file["shared"], np.cumsum(file["counts"])[:-1]) if file["counts"].size else []
            own = Numbers(file["elements"], file["nodes"], int(file["counted"]),
                          {int(rank): nodes for rank, nodes in zip(file["neighbours"], shared)})
            return own, MESHES[len(file["points"])](file["points"], file["cells"])

    @contextmanager
    def _read(self, number: int) -> Iterator[Mapping[str, np.ndarray]]:
        path = self.folder / _file(number)
        try:
            with np.load(path, allow_pickle=False) as file:
                yield file
        except UNREADABLE as error:
            raise ParameterError(f"{path} cannot be read ({type(error).__name__}): make the parts anew with skfsink "
                                 f"partition, where all ranks see them") from None


def _are(ranks: int) -> str:
    return "is one rank" if ranks == 1 else f"are {ranks} ranks"
