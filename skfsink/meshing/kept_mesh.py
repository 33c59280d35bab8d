"""The mesh of a run in its folder: a file from which the same body is read again, to the last bit, wherever it is.

An archive of arrays rather than VTU: any name can be that of a boundary or a set, nodes and elements can be in several
of them, and nothing is converted. It can be taken as the mesh of another run.
"""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import meshio
import numpy as np
from skfem.io.meshio import INV_HEX_MAPPING

from ..system.files import replaced
from .files.bounds import check_unpacked

if TYPE_CHECKING:
    from .sample import Sample

__all__ = ["MESH", "SUFFIX", "keep_mesh", "mesh_name", "origin", "read_kept"]

MESH = "mesh.npz"  # in the folder of a run
SUFFIX = ".npz"
FORMAT = 1
HEX = INV_HEX_MAPPING[:8]


def keep_mesh(sample: Sample, path: Path) -> None:
    """Write a sample to a file that :func:`read_kept` reads.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    space = sample.space
    cells = np.empty_like(space.conn)
    cells[:, slice(None) if space.dim == 2 else HEX] = space.mesh.t.T
    head = {"format": FORMAT, "name": sample.name, "source": sample.source, "made": sample.made,
            "notes": list(getattr(sample, "notes", ())), "boundaries": list(sample.boundaries),
            "sets": list(sample.cells)}
    if sample.vectors:
        head["vectors"] = list(sample.vectors)
    arrays = {"head": np.frombuffer(json.dumps(head).encode(), np.uint8), "points": space.X, "cells": cells}
    for kind, sets in (("boundary", sample.boundaries), ("set", sample.cells)):
        arrays |= {f"{kind}{i}": members for i, members in enumerate(sets.values())}
    arrays |= {f"vector{i}": values for i, values in enumerate(sample.vectors.values())}
    with replaced(path) as part, open(part, "wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def read_kept(path: Path) -> meshio.Mesh:
    """The mesh that :func:`keep_mesh` wrote; `info` has `name`, `source`, `made` and `notes`.

    Raises
    ------
    ValueError, KeyError, OSError
        The file was not written by it, or is damaged.
    """
    with _opened(path) as stored:
        head = _head(stored["head"])
        points, cells = stored["points"], stored["cells"]
        kind = {4: "quad", 8: "hexahedron"}[cells.shape[1]]
        return meshio.Mesh(
            np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))]), [(kind, cells)],
            point_sets={name: stored[f"boundary{i}"] for i, name in enumerate(head["boundaries"])},
            cell_sets={name: [stored[f"set{i}"]] for i, name in enumerate(head["sets"])},
            cell_data={name: [stored[f"vector{i}"]] for i, name in enumerate(head.get("vectors", ()))},
            info={key: head[key] for key in ("name", "source", "made", "notes")})


def _opened(path: str | Path) -> Any:
    """The archive of arrays in a file; ValueError if it would unpack to more than a mesh can need."""
    with zipfile.ZipFile(path) as archive:
        check_unpacked(sum(entry.file_size for entry in archive.infolist()), Path(path).stat().st_size)
    return np.load(path, allow_pickle=False)


def _head(array: np.ndarray) -> dict[str, Any]:
    head: dict[str, Any] = json.loads(array.tobytes())
    if head["format"] != FORMAT:
        raise ValueError(f"it is of format {head['format']}, this program reads {FORMAT}")
    return head


def _read_head(path: str) -> dict[str, Any]:
    """What a kept mesh says of itself; empty if the file is none."""
    if path.endswith(SUFFIX):
        try:
            with _opened(path) as stored:
                return _head(stored["head"])
        except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile):
            pass
    return {}


def origin(path: str) -> str:
    """The file that a kept mesh was read from; any other path as it is."""
    return str(_read_head(path).get("source") or path)


def mesh_name(mesh: str) -> str:
    """The name of a mesh: its own, or the stem of its file; of a kept one that of the file it was read from."""
    return str(_read_head(mesh).get("name") or Path(mesh).stem)
