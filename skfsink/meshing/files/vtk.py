"""Legacy VTK files, as text or as bytes, of all versions: unstructured and structured grids.

This is a reader of our own, beside that of VTU files. meshio's (5.3.5) reads neither voxels nor pixels, takes the ints
of version 5.1 for numbers of 8 bytes, and has no `unsigned_char` there.

The format is described at https://docs.vtk.org/en/latest/vtk_file_formats/vtk_legacy_file_format.html.
"""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import unquote

import meshio
import numpy as np

from .bounds import MOST
from .numbers import Text
from .unreadable import Unreadable
from .vtk_cells import vtk_mesh

__all__ = ["read_vtk"]

TYPES = {"unsigned_char": "u1", "char": "i1", "signed_char": "i1", "unsigned_short": "u2", "short": "i2",
         "unsigned_int": "u4", "int": "i4", "unsigned_long": "u8", "long": "i8", "vtkidtype": "i4", "float": "f4",
         "double": "f8", "unsigned_long_long": "u8", "long_long": "i8",
         **{f"vtktype{sign}int{8 * size}": f"{sign or 'i'}{size}" for sign in ("", "u") for size in (1, 2, 4, 8)}}
COMPONENTS = {"VECTORS": 3, "NORMALS": 3, "TENSORS": 9, "TENSORS6": 6, "GLOBAL_IDS": 1, "PEDIGREE_IDS": 1}
NEXT = re.compile(rb"^[ \t]*(?!nan|inf)[A-Za-z_]", re.M | re.I)  # a line that begins with a word


def read_vtk(path: Path) -> meshio.Mesh:
    """The mesh in a legacy VTK file, with its arrays of one component.

    Raises
    ------
    Unreadable
        It is not of the format, or has more or less than it says.
    """
    return _File(path.read_bytes()).mesh()


class _File:
    """Lines and arrays of a file, one after another."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0
        if not self.line().startswith("# vtk DataFile Version"):
            raise Unreadable("it does not begin with `# vtk DataFile Version`")
        self.line()  # title
        form = self.line().strip().upper()
        if form not in ("ASCII", "BINARY"):
            raise Unreadable("its third line is neither ASCII nor BINARY")
        self.text = form == "ASCII"
        self.n, self.place = 0, "DATASET"  # entries of arrays; what they are on
        self.found: dict[str, np.ndarray] = {}
        self.arrays: dict[str, dict[str, np.ndarray]] = {"POINT_DATA": {}, "CELL_DATA": {}, "DATASET": {}}

    def line(self) -> str:
        end = self.data.find(b"\n", self.at)
        end = len(self.data) if end < 0 else end
        line, self.at = self.data[self.at:end], end + 1
        return line[:1000].decode("latin-1")

    def words(self) -> list[str]:
        """Words of the next line that has any; none at the end of the file."""
        while self.at < len(self.data):
            if words := self.line().split():
                return words
        return []

    def array(self, n: int, kind: str, what: str) -> np.ndarray:
        """The next `n` numbers."""
        where = f"its list of {what}"
        if kind.lower() == "bit":
            return (self.array(n, "char", what) if self.text
                    else np.unpackbits(self.array(-(-n // 8), "unsigned_char", what))[:n])
        if (dtype := TYPES.get(kind.lower())) is None:
            raise Unreadable(f"{where} is of the type {kind[:20]}, which is not read")
        if self.text:
            following = NEXT.search(self.data, self.at)
            end = following.start() if following else len(self.data)
            numbers = Text(self.data[self.at:end], where, dtype[0] == "f")
            values = numbers.take(n).astype(dtype)
            numbers.end()
            self.at = end
            return values
        size = np.dtype(dtype).itemsize
        if not 0 <= n <= (len(self.data) - self.at) // size:
            raise Unreadable(f"{where} has fewer numbers than it says")
        values = np.frombuffer(self.data, ">" + dtype, n, self.at).astype(dtype)
        self.at += n * size
        return values

    def mesh(self) -> meshio.Mesh:
        kind = ""
        while words := self.words():
            word = words[0].upper()
            if word == "DATASET":
                kind = words[1].upper()
                if kind not in ("UNSTRUCTURED_GRID", "STRUCTURED_GRID", "STRUCTURED_POINTS", "RECTILINEAR_GRID"):
                    raise Unreadable(f"it holds {kind[:20]} and no grid; in ParaView apply Append Datasets and save "
                                     "it as VTU")
            else:
                self._section(word, words)
        if not kind:
            raise Unreadable("it has no DATASET")
        if kind == "UNSTRUCTURED_GRID":
            for name in ("POINTS", "ends", "nodes", "CELL_TYPES"):
                if name not in self.found:
                    raise Unreadable("it lacks POINTS, CELLS or CELL_TYPES")
            points, nodes, ends, types = (self.found[name] for name in ("POINTS", "nodes", "ends", "CELL_TYPES"))
        else:
            points, nodes, ends, types = self._structured(kind)
        if nodes.size and not 0 <= nodes.min() <= nodes.max() < len(points):
            raise Unreadable("it has elements with nodes that do not exist")
        cell_data, point_data = ({name: values for name, values in self.arrays[place].items() if values.ndim == 1}
                                 for place in ("CELL_DATA", "POINT_DATA"))
        return vtk_mesh(points, nodes, ends, types, cell_data, point_data)

    def _section(self, word: str, words: list[str]) -> None:
        into = self.arrays[self.place]
        if word == "POINTS":
            self.found[word] = self.array(3 * int(words[1]), words[2], "points").reshape(-1, 3)
        elif word == "CELLS":
            self._cells(int(words[1]), int(words[2]))
        elif word == "CELL_TYPES":
            self.found[word] = self.array(int(words[1]), "int", "types of cells").astype(np.int64)
        elif word == "DIMENSIONS" or word in ("ORIGIN", "SPACING", "ASPECT_RATIO"):
            self.found[word] = np.array([float(x) for x in words[1:4]])
        elif word.endswith("_COORDINATES") and word[0] in "XYZ":
            self.found[word] = self.array(int(words[1]), words[2], "coordinates")
        elif word in ("POINT_DATA", "CELL_DATA"):
            self.place, self.n = word, int(words[1])
        elif word == "SCALARS":
            count = int(words[3]) if len(words) > 3 else 1
            here = self.at
            if self.words()[:1] != ["LOOKUP_TABLE"]:
                self.at = here
            self._keep(into, words[1], self.array(self.n * count, words[2], f"data {words[1]}"), count)
        elif word in COMPONENTS:
            count = COMPONENTS[word]
            self._keep(into, words[1], self.array(self.n * count, words[2], f"data {words[1]}"), count)
        elif word == "TEXTURE_COORDINATES":
            self.array(self.n * int(words[2]), words[3], "texture coordinates")
        elif word in ("LOOKUP_TABLE", "COLOR_SCALARS"):
            n = 4 * int(words[2]) if word == "LOOKUP_TABLE" else self.n * int(words[2])
            self.array(n, "float" if self.text else "unsigned_char", "colours")
        elif word == "FIELD":
            for _ in range(int(words[2])):
                name, count, n, kind = self._field()
                if kind.lower() == "string":
                    self._skip_strings(count * n)
                else:
                    self._keep(into, name, self.array(count * n, kind, f"data {name}"), count)
        elif word == "METADATA":
            while self.at < len(self.data) and self.line().strip():
                pass
        else:
            raise Unreadable(f"it has a section {word[:20]!r}, which is not known")

    def _field(self) -> tuple[str, int, int, str]:
        words = self.words()
        while words[:1] == ["METADATA"]:
            while self.at < len(self.data) and self.line().strip():
                pass
            words = self.words()
        if len(words) != 4:
            raise Unreadable("it has a FIELD with an array without name, numbers and type")
        return words[0], int(words[1]), int(words[2]), words[3]

    def _skip_strings(self, n: int) -> None:
        """Pass over texts: lines, or bytes after their number, whose first two bits say how long it is."""
        for _ in range(min(n, len(self.data))):
            if self.text:
                self.line()
            else:
                size = {3: 1, 2: 2, 1: 4, 0: 8}[self.data[self.at] >> 6]
                length = int.from_bytes(self.data[self.at:self.at + size], "big") & ((1 << (8 * size - 2)) - 1)
                self.at += size + length

    @staticmethod
    def _keep(into: dict[str, np.ndarray], name: str, values: np.ndarray, count: int) -> None:
        into[unquote(name)] = values if count == 1 else values.reshape(-1, count)

    def _cells(self, n: int, size: int) -> None:
        """Cells as lists that begin with their lengths, or since version 5 as two arrays."""
        here = self.at
        words = self.words()
        if words[:1] == ["OFFSETS"]:
            offsets = self.array(n, words[1], "offsets of cells").astype(np.int64)
            words = self.words()
            if words[:1] != ["CONNECTIVITY"] or not n or offsets[0]:
                raise Unreadable("its CELLS have no CONNECTIVITY")
            self.found["ends"] = offsets[1:]
            self.found["nodes"] = self.array(size, words[1], "nodes of cells").astype(np.int64)
            return
        self.at = here
        values = self.array(size, "int", "nodes of cells").astype(np.int64)
        starts = np.zeros(n, np.int64)
        at, done = 0, 0
        while done < n:  # runs of cells of one length
            if not at < size or values[at] < 0:
                raise Unreadable("its CELLS have fewer numbers than it says")
            width = 1 + int(values[at])
            most = min(n - done, (size - at) // width)
            run, step = 0, 1
            while run < most:
                part = values[at + run * width:at + min(run + step, most) * width:width] == width - 1
                run += int(part.argmin()) if not part.all() else len(part)
                if not part.all():
                    break
                step *= 2
            if not run:
                raise Unreadable("its CELLS have fewer numbers than it says")
            starts[done:done + run] = at + width * np.arange(run)
            at, done = at + run * width, done + run
        if at != size:
            raise Unreadable("its CELLS have more numbers than it says")
        lengths = values[starts]
        self.found["ends"] = np.cumsum(lengths)
        self.found["nodes"] = np.delete(values, starts)

    def _structured(self, kind: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Points and cells of a grid of lines, columns and layers."""
        shape = [int(n) for n in self.found.get("DIMENSIONS", np.zeros(0))]
        if len(shape) != 3 or min(shape) < 1:
            raise Unreadable("it lacks DIMENSIONS")
        if np.prod([float(n) for n in shape]) > MOST:
            raise Unreadable(f"its grid has more than {MOST:g} points")
        if kind == "STRUCTURED_GRID":
            points = self.found.get("POINTS", np.zeros((0, 3)))
        else:
            if kind == "STRUCTURED_POINTS":
                origin = self.found.get("ORIGIN", np.zeros(3))
                spacing = self.found.get("SPACING", self.found.get("ASPECT_RATIO", np.ones(3)))
                axes = [origin[i] + spacing[i] * np.arange(n) for i, n in enumerate(shape)]
            else:
                axes = [self.found.get(f"{x}_COORDINATES", np.zeros(0)) for x in "XYZ"]
            points = np.stack([x.ravel(order="F") for x in np.meshgrid(*axes, indexing="ij")], axis=1)
        if len(points) != int(np.prod([float(n) for n in shape])):
            raise Unreadable("its DIMENSIONS are not those of its points")
        number = np.arange(len(points)).reshape(shape, order="F")
        corners, long = number, [i for i, n in enumerate(shape) if n > 1]
        if len(long) < 2:
            raise Unreadable("its grid is a line")
        lows = {i: (slice(None, -1), slice(1, None)) for i in long}
        nodes = np.stack([corners[tuple(lows[i][(a >> long.index(i)) & 1] if i in lows else slice(None)
                                        for i in range(3))].ravel(order="F") for a in range(2**len(long))], axis=1)
        kind_number = 8 if len(long) == 2 else 11  # pixels, voxels
        return (points, nodes.ravel(), nodes.shape[1] * np.arange(1, len(nodes) + 1), np.full(len(nodes), kind_number))
