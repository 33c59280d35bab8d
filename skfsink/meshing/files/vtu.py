"""VTU files: unstructured grids of VTK and ParaView in XML.

This is a reader of our own. meshio's (5.3.5) keeps the cells of the last piece only, leaves cells out whose kind it
does not know (voxels), and cannot read files that ParaView writes by default since 5.13 (version 2.3), or with LZ4.

The format is described at https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html.
"""

from __future__ import annotations

import base64
import binascii
import lzma
import re
import zlib
from pathlib import Path
from xml.etree import ElementTree as ET

import meshio
import numpy as np

from .bounds import check_unpacked
from .lz4 import lz4_block
from .numbers import Text
from .unreadable import Unreadable
from .vtk_cells import vtk_mesh

__all__ = ["read_vtu"]

BIT = "Bit"
TYPES = {BIT: "u1", "Float32": "f4", "Float64": "f8",
         **{f"{kind}{8 * size}": f"{letter}{size}" for kind, letter in (("Int", "i"), ("UInt", "u"))
            for size in (1, 2, 4, 8)}}


def read_vtu(path: Path) -> meshio.Mesh:
    """The mesh in a VTU file, with its arrays of one component and its vectors: arrays of three components.

    Raises
    ------
    Unreadable
        It is not of the format, or has more or less than it says.
    """
    data = path.read_bytes()
    if b"<!DOCTYPE" in data[:10**6] or b"<!ENTITY" in data[:10**6]:
        raise Unreadable("it defines entities, which a mesh has no need of")
    found = re.search(rb"<AppendedData\b[^>]*>", data)
    text, appended = data, b""
    if found is not None:
        end = data.rfind(b"</AppendedData>")
        begin = data.find(b"_", found.end()) + 1
        if not 0 < begin <= end:
            raise Unreadable("its appended data are cut off")
        text, appended = data[:found.end()] + data[end:], data[begin:end]
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise Unreadable(f"it is not XML, or cut off: see line {error.position[0]}") from None
    if root.tag != "VTKFile" or root.get("type") != "UnstructuredGrid":
        raise Unreadable(f"it holds {root.get('type') or 'something else'} and not UnstructuredGrid; "
                         "in ParaView apply Append Datasets and save it as VTU")
    raw = found is not None and root.find("AppendedData").get("encoding", "base64") == "raw"  # type: ignore[union-attr]
    return _mesh(root, _Arrays(root, appended if raw else b"".join(appended.split()), raw, len(data)))


def _mesh(root: ET.Element, arrays: _Arrays) -> meshio.Mesh:
    pieces = root.findall("UnstructuredGrid/Piece")
    if not pieces:
        raise Unreadable("it has no Piece")
    points, connectivity, ends, types = [], [], [], []
    data: dict[str, list[dict[str, np.ndarray]]] = {"PointData": [], "CellData": []}
    n_points = n_nodes = 0
    for piece in pieces:
        points.append(arrays.read(piece.find("Points/DataArray"), int(piece.get("NumberOfPoints", 0)), 3))
        cells = {array.get("Name"): array for array in piece.findall("Cells/DataArray")}
        n = int(piece.get("NumberOfCells", 0))
        ends.append(n_nodes + arrays.read(cells.get("offsets"), n).astype(np.int64))
        types.append(arrays.read(cells.get("types"), n).astype(np.int64))
        nodes = arrays.read(cells.get("connectivity")).astype(np.int64)
        if nodes.size and not 0 <= nodes.min() <= nodes.max() < len(points[-1]):
            raise Unreadable("it has elements with nodes that do not exist")
        connectivity.append(n_points + nodes)
        n_points, n_nodes = n_points + len(points[-1]), n_nodes + len(nodes)
        for kind, n_values in (("PointData", len(points[-1])), ("CellData", n)):
            data[kind].append({
                str(array.get("Name")): arrays.read(array, n_values, int(array.get("NumberOfComponents") or 1))
                for array in piece.findall(f"{kind}/DataArray") if array.get("type") in TYPES
                and (array.get("NumberOfComponents", "1") in ("", "1") or _is_vector(array))})
    point_data, cell_data = (
        {name: np.concatenate([part[name] for part in parts]) for name in parts[0] if all(name in p for p in parts)}
        for parts in data.values())
    return vtk_mesh(np.concatenate(points), np.concatenate(connectivity), np.concatenate(ends), np.concatenate(types),
                    cell_data, point_data)


def _is_vector(array: ET.Element) -> bool:
    return array.get("NumberOfComponents") == "3" and array.get("type") in ("Float32", "Float64")


class _Arrays:
    """Values of the elements DataArray of a file of `size` bytes.

    Memory: `read` counts the bytes of compressed arrays, which all together have a bound.
    """

    def __init__(self, root: ET.Element, appended: bytes, raw: bool, size: int) -> None:
        self.appended, self.raw, self.size, self.unpacked = appended, raw, size, 0
        self.order = ">" if root.get("byte_order") == "BigEndian" else "<"
        self.head = np.dtype(self.order + ("u8" if root.get("header_type") == "UInt64" else "u4"))
        compressor = root.get("compressor", "")
        if compressor and compressor not in _UNPACK:
            raise Unreadable(f"it is compressed by {compressor}; save it with ZLib, or without compression")
        self.unpack = _UNPACK.get(compressor)

    def read(self, array: ET.Element | None, n: int | None = None, components: int = 1) -> np.ndarray:
        """Values (n,), or (n, components) of several; of any number without `n`."""
        if array is None:
            raise Unreadable("it lacks points, or connectivity, offsets or types of its cells")
        name = array.get("Name") or "Points"
        if components > 1 and array.get("NumberOfComponents", "1") != str(components):
            raise Unreadable(f"its array {name} has {array.get('NumberOfComponents', 1)} components, not {components}")
        if (kind := TYPES.get(array.get("type", ""))) is None:
            raise Unreadable(f"its array {name} is of the type {array.get('type')}")
        form = array.get("format", "ascii")
        if form == "ascii":
            values = Text((array.text or "").encode(), f"its array {name}", kind[0] == "f").values.astype(kind)
        else:
            values = self._bytes(array, form, name, np.dtype(self.order + kind)).astype(kind)
            if array.get("type") == BIT:
                values = np.unpackbits(values)[:n]
        if n is not None and len(values) != n * components:
            raise Unreadable(f"its array {name} has {len(values)} values, not {n * components}")
        return values.reshape(-1, components) if components > 1 else values

    def _bytes(self, array: ET.Element, form: str, name: str, dtype: np.dtype) -> np.ndarray:
        if form == "appended":
            source = memoryview(self.appended)[max(0, int(array.get("offset", 0))):]
        elif form == "binary":
            source = memoryview(b"".join((array.text or "").encode().split()))
        else:
            raise Unreadable(f"its array {name} has the format {form}")
        raw = self.raw and form == "appended"
        size = self.head.itemsize
        short = Unreadable(f"its array {name} has fewer numbers than it says")

        def head(count: int) -> np.ndarray:
            piece = bytes(source[:count * size]) if raw else _decoded(source, count * size)
            if len(piece) < count * size:
                raise short
            return np.frombuffer(piece, self.head, count)

        if self.unpack is None:
            length = int(head(1)[0])
            if length > len(source):
                raise short
            chars = -(-size // 3) * 4
            alone = not raw and bytes(source[:chars]).endswith(b"=")  # the head was encoded on its own
            content = (bytes(source[size:size + length]) if raw else _decoded(source[chars:], length) if alone
                       else _decoded(source, size + length)[size:])
            if len(content) < length or (length % dtype.itemsize):
                raise short
            return np.frombuffer(content, dtype)
        count = int(head(1)[0])
        if count > len(source):
            raise short
        sizes = head(3 + count).astype(np.int64)
        whole, last, packed = int(sizes[1]), int(sizes[2]), sizes[3:]
        begin = (3 + count) * size
        begin = begin if raw else -(-begin // 3) * 4
        total = int(packed.sum())
        if total > len(source) or (packed < 0).any() or whole < 0 or last < 0:
            raise short
        self.unpacked += whole * max(count - 1, 0) + (last or whole)
        check_unpacked(self.unpacked, self.size)
        content = bytes(source[begin:begin + total]) if raw else _decoded(source[begin:], total)
        if len(content) < total:
            raise short
        at, parts = 0, []
        for i, part in enumerate(packed.tolist()):
            full = last if last and i == count - 1 else whole
            try:
                parts.append(self.unpack(content[at:at + part], full))
            except (zlib.error, lzma.LZMAError, IndexError, ValueError):
                raise Unreadable(f"its array {name} cannot be decompressed") from None
            if len(parts[-1]) != full:
                raise short
            at += part
        content = b"".join(parts)
        if len(content) % dtype.itemsize:
            raise short
        return np.frombuffer(content, dtype)


def _decoded(text: memoryview, n: int) -> bytes:
    """The first `n` bytes of what base64 text stands for."""
    chars = bytes(text[:-(-n // 3) * 4])
    try:
        return base64.b64decode(chars + b"=" * (-len(chars) % 4))[:n]
    except binascii.Error:
        raise Unreadable("its numbers are not base64") from None


def _zlib(data: bytes, most: int) -> bytes:
    return zlib.decompressobj().decompress(data, most) if most else b""


def _lzma(data: bytes, most: int) -> bytes:
    return lzma.LZMADecompressor().decompress(data, most) if most else b""


_UNPACK = {"vtkZLibDataCompressor": _zlib, "vtkLZMADataCompressor": _lzma, "vtkLZ4DataCompressor": lz4_block}
