"""VTU and VTK files in every form in which VTK writes them; `python tests/vtk_kinds.py` puts some into tests/data/vtk.

It needs VTK, which pyvista brings along (extra `view`). The body is that of :func:`gmsh_kinds.check` without the names
of its groups: cells have the array `region` (1 and 2 on its halves, 0 elsewhere) and points the mask `low` (y = 0).
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np

FOLDER = Path(__file__).parent / "data" / "vtk"
MODES, PACKED = ("ascii", "binary", "raw", "base64"), ("none", "zlib", "lz4", "lzma")


def grid(dim: int, kind: str = "plain") -> Any:
    """The body, as vtkUnstructuredGrid, of quadrilaterals or hexahedra, `pixels` (voxels) or `polygons`."""
    import vtk

    x, y, z = np.meshgrid(np.arange(5.0), np.arange(3.0), np.arange(2.0 if dim == 3 else 1.0), indexing="ij")
    number = np.arange(x.size).reshape(x.shape)
    points = vtk.vtkPoints()
    points.SetDataTypeToDouble()
    for point in zip(x.ravel(), y.ravel(), z.ravel()):
        points.InsertNextPoint(*point)
    body = vtk.vtkUnstructuredGrid()
    body.SetPoints(points)
    order = {"pixels": [0, 1, 2, 3]}.get(kind, [0, 1, 3, 2])
    region = []
    for i, j in itertools.product(range(4), range(2)):
        nodes = [int(n) for k in range(dim - 1) for n in number[i:i + 2, j:j + 2, k].T.ravel()[order]]
        cell = {("plain", 2): 9, ("plain", 3): 12, ("pixels", 2): 8, ("pixels", 3): 11, ("polygons", 2): 7}[kind, dim]
        body.InsertNextCell(cell, len(nodes), nodes)
        region.append(1 + (i > 1))
    for j in range(2):  # lines or faces at x = 0
        nodes = [int(n) for n in number[0, j:j + 2].ravel()]
        body.InsertNextCell(3 if dim == 2 else 8, len(nodes), nodes)
        region.append(0)
    for name, values, data, make in (("region", region, body.GetCellData(), vtk.vtkIntArray()),
                                     ("boundary:end", [int(r == 0) for r in region], body.GetCellData(),
                                      vtk.vtkSignedCharArray()),
                                     ("low", (y.ravel() == 0).astype(int), body.GetPointData(),
                                      vtk.vtkUnsignedCharArray()),
                                     ("field", np.sin(x + y).ravel(), body.GetPointData(), vtk.vtkFloatArray())):
        make.SetName(name)
        for value in np.asarray(values).tolist():
            make.InsertNextValue(value)
        data.AddArray(make)
    return body


def write_vtu(path: Path, body: Any, mode: str, packed: str, *, long: bool = True, big: bool = False) -> None:
    """A VTU file; `long`: heads of 64 bits, `big`: big-endian."""
    import vtk

    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(body)
    {"ascii": writer.SetDataModeToAscii, "binary": writer.SetDataModeToBinary}.get(mode, writer.SetDataModeToAppended)()
    writer.SetEncodeAppendedData(mode == "base64")
    {"none": writer.SetCompressorTypeToNone, "zlib": writer.SetCompressorTypeToZLib,
     "lz4": writer.SetCompressorTypeToLZ4, "lzma": writer.SetCompressorTypeToLZMA}[packed]()
    writer.SetHeaderTypeToUInt64() if long else writer.SetHeaderTypeToUInt32()
    if big:
        writer.SetByteOrderToBigEndian()
    writer.SetBlockSize(128)  # several blocks an array
    writer.Write()


def write_vtk(path: Path, body: Any, text: bool, version: int) -> None:
    """A legacy file, of version 4.2 or 5.1."""
    import vtk

    writer = vtk.vtkUnstructuredGridWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(body)
    writer.SetFileTypeToASCII() if text else writer.SetFileTypeToBinary()
    writer.SetFileVersion(version)
    writer.Write()


def write_all(folder: Path) -> None:
    """One file of each form."""
    for mode, packed in itertools.product(MODES, PACKED):
        write_vtu(folder / f"{mode}-{packed}-2d.vtu", grid(2), mode, packed)
    for mode, packed in (("binary", "none"), ("binary", "zlib"), ("raw", "none"), ("raw", "zlib")):
        write_vtu(folder / f"{mode}-{packed}-short-3d.vtu", grid(3), mode, packed, long=False)
        write_vtu(folder / f"{mode}-{packed}-big-2d.vtu", grid(2), mode, packed, big=True)
    for kind, dim in (("pixels", 2), ("pixels", 3), ("polygons", 2)):
        write_vtu(folder / f"{kind}-{dim}d.vtu", grid(dim, kind), "ascii", "none")
        write_vtk(folder / f"{kind}-{dim}d.vtk", grid(dim, kind), False, 42)
    for text, version, dim in itertools.product((True, False), (42, 51), (2, 3)):
        write_vtk(folder / f"{'ascii' if text else 'binary'}-{version}-{dim}d.vtk", grid(dim), text, version)


if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    write_all(FOLDER)
