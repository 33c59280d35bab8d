"""Mesh files, broken and hostile: each gives a sample or one line, soon, and nothing is written."""

from __future__ import annotations

import functools
import os
import random
import signal
import tempfile
import warnings
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import meshio
import numpy as np
import psutil
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from plates import plate

from skfsink.errors import MeshError, SkfsinkError
from skfsink.meshing.kept_mesh import mesh_name
from skfsink.meshing.mesh_file import check_mesh, read_mesh_file
from skfsink.meshing.sample import Sample, file_sample, load_sample
from skfsink.meshing.vtu import write_mesh

FORMATS = ("vtu", "vtu-text", "msh2", "msh2-binary", "msh4", "msh4-binary", "inp")
SECONDS = 10.0  # that a file may take
ROOM = 10**9    # bytes of memory that it may take


class Hang(BaseException):
    """Reading went on for too long; no Exception, so that nobody takes it for a broken file."""


@contextmanager
def alarmed() -> Iterator[None]:
    def ring(number: int, frame: FrameType | None) -> None:
        raise Hang

    old = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, old)


def suffix(form: str) -> str:
    return "." + form.partition("-")[0].rstrip("24")


def write(path: Path, form: str, mesh: meshio.Mesh) -> None:
    """Write a mesh of quadrilaterals and lines with its boundaries."""
    if form == "vtu":
        write_mesh(path, mesh)
    elif form == "vtu-text":
        write_mesh(path, mesh)
        meshio.write(path, meshio.read(path), "vtu", binary=False)
    elif form == "inp":
        meshio.write(path, meshio.Mesh(mesh.points, mesh.cells, cell_sets=mesh.cell_sets,
                                       point_sets={"corner": np.array([0, 3])}), "abaqus")
    elif form == "msh4":
        path.write_text(gmsh_4(mesh))
    elif form == "msh4-binary":  # without boundaries
        meshio.write(path, meshio.Mesh(mesh.points, mesh.cells[:1]), "gmsh")
    else:
        tags = [np.ones(len(mesh.cells[0].data), int), np.ones(len(mesh.cells[1].data), int)]
        for k, sets in enumerate(mesh.cell_sets.values()):
            tags[1][sets[1]] = k + 2
        names = {name: np.array([k + 2, 1]) for k, name in enumerate(mesh.cell_sets)}
        whole = meshio.Mesh(mesh.points, mesh.cells, cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
                            field_data={**names, "body": np.array([1, 2])})
        meshio.write(path, whole, "gmsh22", binary="binary" in form)


def gmsh_4(mesh: meshio.Mesh) -> str:
    """A mesh as gmsh writes it, with each boundary a physical group of one curve."""
    (quads, lines), sets, n = [b.data + 1 for b in mesh.cells], mesh.cell_sets, len(mesh.points)
    out = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat", "$PhysicalNames", f"{len(sets) + 1}",
           *(f'1 {k} "{name}"' for k, name in enumerate(sets, 2)), '2 1 "body"', "$EndPhysicalNames",
           "$Entities", f"0 {len(sets)} 1 0", *(f"{k} 0 0 0 4 4 0 1 {k} 0" for k, _ in enumerate(sets, 2)),
           "1 0 0 0 4 4 0 1 1 0", "$EndEntities", "$Nodes", f"1 {n} 1 {n}", f"2 1 0 {n}", *map(str, range(1, n + 1)),
           *(f"{x} {y} {z}" for x, y, z in mesh.points.tolist()), "$EndNodes"]
    blocks, number = [], 0
    for dim, tag, kind, cells in [*((1, k, 1, lines[members[1]]) for k, members in enumerate(sets.values(), 2)),
                                  (2, 1, 3, quads)]:
        blocks.append(f"{dim} {tag} {kind} {len(cells)}")
        for cell in cells.tolist():
            number += 1
            blocks.append(" ".join(map(str, [number, *cell])))
    return "\n".join([*out, "$Elements", f"{len(sets) + 1} {number} 1 {number}", *blocks, "$EndElements", ""])


@functools.cache
def template(form: str) -> bytes:
    """Content of a file of a plate of 18 elements."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"plate{suffix(form)}"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            write(path, form, plate(5))
        return path.read_bytes()


@contextmanager
def little_memory() -> Iterator[None]:
    """Let this process take no more than 1 GB besides what it has, for as long as it reads a file.

    Where the system can see to that.
    """
    try:
        import resource
    except ImportError:
        yield
        return
    old = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (psutil.Process().memory_info().vms + ROOM, old[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, old)


def outcome(path: Path) -> Sample | str:
    """The sample of a file, used as a run would begin to, or the one line that refuses it; no file is touched."""
    before = sorted(path.parent.iterdir())
    try:
        with alarmed(), little_memory():
            sample = file_sample(path)
            for name in sample.cells:
                sample.elements(name)
            sample.nodes("top")
            sample.rim("top"), sample.space.graph, sample.space.V
        result: Sample | str = sample
    except SkfsinkError as error:
        result = str(error)
        assert len(result.splitlines()) == 1 and 10 < len(result) < 1000, result
    assert sorted(path.parent.iterdir()) == before
    return result


@pytest.mark.parametrize("form", FORMATS)
def test_whole_files(form: str, tmp_path: Path) -> None:
    """Fails if a sound file is refused, or its boundaries are lost on the way: then the fuzzing tests nothing."""
    path = tmp_path / f"plate{suffix(form)}"
    path.write_bytes(template(form))
    sample = outcome(path)
    assert isinstance(sample, Sample), sample
    assert sample.space.n_elements == len(plate(5).cells[0].data)
    if form != "msh4-binary":
        assert {name: len(nodes) for name, nodes in sample.boundaries.items() if name not in ("body", "corner")} == {
            name: len(np.unique(plate(5).cells[1].data[members[1]])) for name, members in plate(5).cell_sets.items()}


# --- mutations ---
NUMBERS = [b"-1", b"0", b"1", b"3", b"nan", b"inf", b"1e308", b"-1e-320", b"2147483648", b"999999999999",
           b"18446744073709551616", b"0x10", b"", b"''", b"1 2", b"\n", b"9" * 400]
WORDS = [b"triangle", b"NumberOfPoints", b"$Nodes", b"$EndElements", b"*ELSET", b"generate", b"UInt64", b"Int8",
         b"*INCLUDE, INPUT=/dev/zero", b"appended", b"<!DOCTYPE a>", b"]]>", b"&a;", b"\xff\xfe", b"\0" * 9]


def mutated(content: bytes, dice: random.Random) -> bytes:
    """`content` with one to four changes of bytes, numbers, words or lines."""
    for _ in range(dice.choice((1, 1, 2, 4))):
        lines = content.split(b"\n")
        kind, i = dice.randrange(9), dice.randrange(len(lines))
        if kind == 0:
            place, n = dice.randrange(len(content) + 1), dice.choice((1, 1, 4, 30))
            content = content[:place] + dice.randbytes(n) + content[place + n:]
            continue
        if kind == 1:
            content = content[:dice.randrange(len(content) + 1)]
            continue
        if kind in (2, 3, 4):
            words = lines[i].split(b" ")
            words[dice.randrange(len(words))] = dice.choice(NUMBERS if kind < 4 else WORDS)
            lines[i] = b" ".join(words)
        elif kind == 5:
            lines[i:i + dice.choice((1, 1, 5))] = []
        elif kind == 6:
            j = dice.randrange(len(lines))
            lines[i], lines[j] = lines[j], lines[i]
        elif kind == 7:
            lines[i:i] = lines[i:i + dice.choice((1, 3))] * dice.choice((1, 2))
        else:
            place = dice.randrange(len(lines[i]) + 1)
            lines[i] = lines[i][:place] + dice.choice(NUMBERS + WORDS) + lines[i][place:]
        content = b"\n".join(lines)
    return content


def check_mutation(folder: Path, form: str, seed: int) -> str:
    path = folder / f"plate{suffix(form)}"
    path.write_bytes(mutated(template(form), random.Random(seed)))
    found = outcome(path)
    line = found if isinstance(found, str) else ""
    assert "more memory" not in line, line
    return line


FEW = settings(max_examples=150, deadline=None, database=None,
               suppress_health_check=[HealthCheck.function_scoped_fixture])


@FEW
@given(st.sampled_from(FORMATS), st.integers(0, 2**32))
def test_broken_files(tmp_path: Path, form: str, seed: int) -> None:
    """Fails if a changed file gives a traceback, hangs, or makes anything be written."""
    check_mutation(tmp_path, form, seed)


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMATS)
def test_thousands_of_broken_files(tmp_path: Path, form: str) -> None:
    """Fails as `test_broken_files` does, for one of 1,500 files a format (10,500); most must be refused, some not."""
    refused = sum(bool(check_mutation(tmp_path, form, seed)) for seed in range(1500))
    assert 300 < refused < 1500


@FEW
@given(st.lists(st.tuples(st.integers(0, 40), st.integers(-3, 60)), max_size=6),
       st.lists(st.tuples(st.integers(0, 40), st.floats(width=64)), max_size=4))
def test_any_nodes_and_coordinates(tmp_path: Path, nodes: list[tuple[int, int]],
                                   values: list[tuple[int, float]]) -> None:
    """Fails if elements of any nodes, at any coordinates, pass as a body with a Jacobian that is not positive."""
    mesh = plate(5)
    cells, points = mesh.cells[0].data.astype(np.int64).ravel(), mesh.points.ravel()
    for i, node in nodes:
        cells[i] = node
    for i, value in values:
        points[i] = value
    mesh.cells[0].data = cells.reshape(-1, 4)
    write_mesh(tmp_path / "plate.vtu", mesh)
    found = outcome(tmp_path / "plate.vtu")
    assert isinstance(found, str) or (np.isfinite(found.space.dN).all() and (found.space.w > 0).all())


# --- hostile on purpose ---
def xml(points: str = "0 0 0 1 0 0 1 1 0 0 1 0", head: str = "", count: str = "4", cells: str = "1",
        kind: str = "9") -> bytes:
    """A VTU file of one element."""
    return f"""<?xml version="1.0"?>{head}<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian">
<UnstructuredGrid><Piece NumberOfPoints="{count}" NumberOfCells="{cells}"><Points>
<DataArray type="Float64" NumberOfComponents="3" format="ascii">{points}</DataArray></Points><Cells>
<DataArray type="Int64" Name="connectivity" format="ascii">0 1 2 3</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">4</DataArray>
<DataArray type="UInt8" Name="types" format="ascii">{kind}</DataArray></Cells></Piece></UnstructuredGrid></VTKFile>
""".encode()


BOMB = "<!DOCTYPE a [<!ENTITY a0 '0'>" + "".join(
    f"<!ENTITY a{i} '{f'&a{i - 1};' * 10}'>" for i in range(1, 12)) + "]>"
OUTSIDE = "<!DOCTYPE a [<!ENTITY x SYSTEM 'file:///etc/passwd'>]>"
MSH2 = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
MSH4 = "$MeshFormat\n4.1 {} 8\n{}$EndMeshFormat\n"
BODY = b"*NODE\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n100001,9,0\n*ELEMENT,TYPE=CPE4\n1,1,2,3,4\n"
HOSTILE: dict[str, tuple[str, bytes]] = {
    "entity bomb": ("vtu", xml("&a11;", BOMB)),
    "external entity": ("vtu", xml("&x;", OUTSIDE)),
    "a claim of points": ("vtu", xml(count="1000000000000")),
    "a claim of cells": ("vtu", xml(cells="999999999999")),
    "negative claims": ("vtu", xml(count="-4", cells="-1")),
    "no cells": ("vtu", xml(kind="0", cells="0")),
    "unknown cells": ("vtu", xml(kind="200")),
    "empty": ("vtu", b""), "empty gmsh": ("msh", b""), "empty abaqus": ("inp", b""),
    "deep": ("vtu", b"<a>" * 100_000),
    "gmsh claims nodes": ("msh", f"{MSH2}$Nodes\n1000000000000\n1 0 0 0\n$EndNodes\n".encode()),
    "gmsh claims elements": ("msh", f"{MSH2}$Nodes\n1\n1 0 0 0\n$EndNodes\n$Elements\n1000000000000\n".encode()),
    "gmsh 4 claims blocks": ("msh", f"{MSH4.format(0, '')}$Nodes\n1000000000000 1000000000000 1 2\n".encode()),
    "gmsh 4 claims nodes": ("msh", f"{MSH4.format(0, '')}$Nodes\n1 1000000000000 1 1\n2 1 0 1000000000000\n".encode()),
    "gmsh 4 binary claims": ("msh",
                             MSH4.format(1, "\x01\0\0\0\n").encode() + b"$Nodes\n" + b"\xff\xff\xff\x7f\xff\0\0\0" * 4),
    "gmsh 4 claims entities": ("msh", f"{MSH4.format(0, '')}$Entities\n999999999999 1 1 1\n".encode()),
    "gmsh, node of another world": ("msh", f"{MSH2}$Nodes\n1\n999999999999999 0 0 0\n$EndNodes\n$Elements\n1\n"
                                           f"1 3 2 1 1 1 2 3 4\n$EndElements\n".encode()),
    "abaqus without end": ("inp", b"*NODE\n1,0,0\n*ELSET,ELSET=a,GENERATE\n1,1000000000000,1\n"),
    "abaqus includes itself": ("inp", b"*NODE\n1,0,0\n*INCLUDE,INPUT=bad.inp\n"),
    "abaqus includes a device": ("inp", b"*Include , INPUT=/dev/zero\n"),
    "abaqus generates nodes": ("inp", b"".join(
        b"*NODE\n%d,0,1\n%d,1,1\n*NGEN\n%d,%d\n" % (k, k + 4_000_000, k, k + 4_000_000)
        for k in range(10**8, 10**9, 10**7))),
    "abaqus generates elements": ("inp", BODY + b"*ELGEN\n" + b"1,2000000,0,1\n" * 30),
    "abaqus places a part often": ("inp", b"*PART,NAME=p\n" + BODY + b"*NGEN\n4,100001\n*END PART\n*ASSEMBLY,NAME=a\n"
                                   + b"".join(b"*INSTANCE,NAME=i%d,PART=p\n*END INSTANCE\n" % k for k in range(900))),
    "abaqus places many sets": ("inp", b"*PART,NAME=p\n" + BODY + b"".join(b"*NSET,NSET=s%d\n1\n" % k for k in range(
        9000)) + b"*END PART\n*ASSEMBLY,NAME=a\n" + b"".join(
            b"*INSTANCE,NAME=i%d,PART=p\n*END INSTANCE\n" % k for k in range(5000))),
    "nastran holds many": ("bdf", b"GRID,1,,0.,0.,0.\n" + b"SPC1,1,12,1,THRU,9000000\n" * 50),
    "vtk grid of a claim": ("vtk", b"# vtk DataFile Version 3.0\na\nASCII\nDATASET STRUCTURED_POINTS\n"
                                   b"DIMENSIONS 7000 7000 1\nORIGIN 0 0 0\nSPACING 1 1 1\n"),
    "xdmf": ("xdmf", b"<Xdmf><Domain/></Xdmf>"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files(name: str, tmp_path: Path) -> None:
    """Fails if a claim is believed, another file is opened, or memory or time go."""
    kind, content = HOSTILE[name]
    path = tmp_path / f"bad.{kind}"
    path.write_bytes(content)
    line = outcome(path)
    assert isinstance(line, str) and f"bad.{kind}" in line and "root:" not in line, line
    assert "more memory" not in line, line


def _compressed_bomb(path: Path) -> None:
    """A VTU file of 5 MB whose points are 5 GB of zeros."""
    import base64
    import zlib

    block = zlib.compress(bytes(2**27), 9)
    n = 40
    head = np.array([n, 2**27, 2**27, *[len(block)] * n], np.uint32).tobytes()
    text = (base64.b64encode(head) + base64.b64encode(block * n)).decode()
    content = xml(text).replace(b'format="ascii"', b'format="binary"', 1).replace(
        b'version="0.1"', b'version="0.1" header_type="UInt32" compressor="vtkZLibDataCompressor"', 1)
    path.write_bytes(content)


@pytest.mark.slow
def test_a_compressed_bomb(tmp_path: Path) -> None:
    """Fails if a small file can fill the memory."""
    _compressed_bomb(tmp_path / "bomb.vtu")
    assert (tmp_path / "bomb.vtu").stat().st_size < 10_000_000
    line = outcome(tmp_path / "bomb.vtu")
    assert isinstance(line, str) and "unpacks to 5.37e+03 MB, the most is 500 MB" in line, line


@pytest.mark.slow
def test_a_bomb_of_arrays(tmp_path: Path) -> None:
    """Fails if a small archive of arrays, as runs keep their meshes in, can fill the memory."""
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("head", "points", "cells"):
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array_header_1_0(file, {"descr": "|u1", "fortran_order": False, "shape": (2**30,)})
                for _ in range(2**6):
                    file.write(bytes(2**24))
    line = outcome(tmp_path / "bomb.npz")
    assert isinstance(line, str) and "unpacks to 3.22e+03 MB" in line, line
    assert mesh_name(str(tmp_path / "bomb.npz")) == "bomb"


def _fifo(path: Path) -> None:
    os.mkfifo(path)


def _loop(path: Path) -> None:
    path.symlink_to(path.name)


def _huge(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(3 * 10**9)


@pytest.mark.parametrize("make, part", [
    (_fifo, "no file with content"), (_loop, "there is no mesh file"), (Path.mkdir, "no file with content"),
    (lambda path: path.symlink_to("/dev/zero"), "no file with content"),
    (lambda path: path.symlink_to("nowhere"), "there is no mesh file"), (_huge, "it has 3.0 GB, the most is 2 GB")])
@pytest.mark.parametrize("name", ["a.vtu", "a.msh", "a\nb.inp"])
def test_what_is_no_file(make: Callable[[Path], None], part: str, name: str, tmp_path: Path) -> None:
    """Fails if a pipe or a device is read, which never ends, or a name breaks the line."""
    make(tmp_path / name)
    line = outcome(tmp_path / name)
    assert isinstance(line, str) and part in line, line


def test_a_name_that_no_file_can_have(tmp_path: Path) -> None:
    """Fails if the system's refusal of a name is a traceback."""
    for name in ("a\0b.vtu", "long" * 99 + ".vtu"):
        with pytest.raises(MeshError, match="there is no mesh file"):
            read_mesh_file(tmp_path / name)


def _quads(change: Callable[[meshio.Mesh], None]) -> Callable[[], meshio.Mesh]:
    def made() -> meshio.Mesh:
        mesh = plate(5)
        change(mesh)
        return mesh
    return made


def _twice(mesh: meshio.Mesh) -> None:
    mesh.cells[0].data = np.vstack([mesh.cells[0].data, mesh.cells[0].data[2, [1, 2, 3, 0]]])
    mesh.cell_sets = {}


def _corner_twice(mesh: meshio.Mesh) -> None:
    mesh.cells[0].data[4, 1] = mesh.cells[0].data[4, 0]


def _bent(mesh: meshio.Mesh) -> None:
    mesh.points[:, 2] = mesh.points[:, 0] ** 2


def _upright(mesh: meshio.Mesh) -> None:
    mesh.points = mesh.points[:, [0, 2, 1]]


def _small(mesh: meshio.Mesh) -> None:
    mesh.points *= 1e-200


def _large(mesh: meshio.Mesh) -> None:
    mesh.points *= 4e307


def _lines_beyond(mesh: meshio.Mesh) -> None:
    mesh.cells[1].data[0, 0] = 999


def _newline(mesh: meshio.Mesh) -> None:
    mesh.cell_sets = {"to\np": mesh.cell_sets["top"]}


@pytest.mark.parametrize("change, part", [
    (_twice, "1 element(s) more than once, such as one near ("),
    (_corner_twice, "element 4 is inverted or degenerate: it has a node twice, near ("),
    (_bent, "plane of constant z"), (_upright, "plane of constant z; they lie at one y: turn the mesh"),
    (_small, "mm across"), (_large, "mm across"),
    (_lines_beyond, "nodes that do not exist")])
def test_bodies_that_cannot_be(change: Callable[[meshio.Mesh], None], part: str, tmp_path: Path) -> None:
    """Fails if a mesh is computed on that counts an element twice, is flattened without a word, or overflows."""
    write_mesh(tmp_path / "bad.vtu", _quads(change)())
    line = outcome(tmp_path / "bad.vtu")
    assert isinstance(line, str) and part in line and "bad.vtu" in line, line


def test_sets_of_nodes_that_do_not_exist(tmp_path: Path) -> None:
    """Fails if a set of nodes is taken for a boundary that reaches beyond the mesh."""
    path = tmp_path / "plate.inp"
    path.write_bytes(template("inp"))
    assert len(file_sample(path).nodes("corner")) == 2
    for nodes in ("1, 999", "-1", "0", "1.5", "x"):
        path.write_bytes(template("inp") + f"\n*NSET, NSET=far\n{nodes}\n".encode())
        found = outcome(path)
        assert "plate.inp" in found if isinstance(found, str) else "far" not in found.boundaries, (nodes, found)


@pytest.mark.parametrize("node", [-1, 999])
def test_sets_of_nodes_are_checked_whoever_read_them(node: int) -> None:
    """Fails if a reader that does not look at its sets of nodes is believed."""
    mesh = plate(5)
    mesh.point_sets = {"far": np.array([0, node])}
    with pytest.raises(MeshError, match="the boundary 'far' has nodes that do not exist"):
        check_mesh("odd", mesh)


def test_boundaries_with_odd_names(tmp_path: Path) -> None:
    """Fails if the name of a boundary breaks the line that lists them."""
    mesh = _quads(_newline)()
    mesh.points[:, :2] = mesh.points[:, :2]
    sample = Sample("odd", load_sample("single_edge_notch", "coarse").space, {"to\np": np.arange(3)})
    with pytest.raises(MeshError) as error:
        sample.nodes("top")
    assert len(str(error.value).splitlines()) == 1 and "to\\np" in str(error.value)
