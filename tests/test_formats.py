"""Mesh files of other programs: each form against a body known by construction, or refused in one line with a cure."""

from __future__ import annotations

import base64
import random
from pathlib import Path

import meshio
import numpy as np
import pytest
import vtk_kinds
from gmsh_kinds import points_of
from plates import plate
from scipy.io import netcdf_file
from test_mesh_files import mutated, outcome

from skfsink.errors import MeshError
from skfsink.meshing.files.lz4 import lz4_block
from skfsink.meshing.mesh_file import read_mesh_file
from skfsink.meshing.sample import Sample, file_sample
from skfsink.results.series import Series

STORED = sorted(vtk_kinds.FOLDER.glob("*.vt*"))
SIDES = {"left", "right", "bottom", "top", "back", "front"}


def named(sample: Sample) -> dict[str, set[tuple[float, ...]]]:
    """Points of the boundaries that the file names."""
    return {name: points_of(sample.space.X[nodes]) for name, nodes in sample.boundaries.items() if name not in SIDES}


def middles(sample: Sample) -> dict[str, set[tuple[float, ...]]]:
    """Middles of the elements of each set."""
    middle = sample.space.X[sample.space.conn].mean(axis=1)
    return {name: points_of(middle[index]) for name, index in sample.cells.items()}


# --- VTU and VTK ---
@pytest.mark.parametrize("path", STORED, ids=[path.name for path in STORED])
def test_files_that_vtk_wrote(path: Path) -> None:
    """Fails if an element is lost or turned inside out, or an array of whole numbers is no set, in any form of file."""
    sample = file_sample(path)
    X, dim = sample.space.X, sample.space.dim
    assert len(X) == 15 * (dim - 1) and np.allclose(sample.space.V, 1) and sample.space.n_elements == 8
    assert points_of(X) == {(float(x), float(y), float(z))[:dim] for x in range(5) for y in range(3)
                            for z in range(dim - 1)}
    found = middles(sample)
    assert found.keys() == {"region:1", "region:2"}
    assert found["region:1"] == {(x + 0.5, y + 0.5, 0.5)[:dim] for x in (0, 1) for y in (0, 1)}
    assert found["region:2"] == {(x + 0.5, y + 0.5, 0.5)[:dim] for x in (2, 3) for y in (0, 1)}
    end, low = points_of(X[X[:, 0] == 0]), points_of(X[X[:, 1] == 0])
    assert named(sample) == {"region:0": end, "end": end, "low": low, "low:1": low,
                             "low:0": points_of(X[X[:, 1] > 0])}


def test_files_that_vtk_writes_now(tmp_path: Path) -> None:
    """Fails as `test_files_that_vtk_wrote` does, for the version of VTK that is installed."""
    pytest.importorskip("vtk")
    vtk_kinds.write_all(tmp_path)
    paths = sorted(tmp_path.glob("*.vt*"))
    assert len(paths) >= len(STORED) > 30
    for path in paths:
        test_files_that_vtk_wrote(path)


def xml(piece: str, head: str = 'version="0.1"') -> str:
    return (f'<?xml version="1.0"?><VTKFile type="UnstructuredGrid" {head}><UnstructuredGrid>{piece}'
            "</UnstructuredGrid></VTKFile>")


def piece(points: str, cells: str, ends: str, types: str, data: str = "") -> str:
    """A piece of a VTU file as text."""
    return f"""<Piece NumberOfPoints="{len(points.split()) // 3}" NumberOfCells="{len(types.split())}"><Points>
<DataArray type="Float64" NumberOfComponents="3">{points}</DataArray></Points><Cells>
<DataArray type="Int64" Name="connectivity">{cells}</DataArray><DataArray type="Int64" Name="offsets">{ends}</DataArray>
<DataArray type="UInt8" Name="types">{types}</DataArray></Cells>{data}</Piece>"""


SQUARE = "0 0 0 1 0 0 1 1 0 0 1 0"


def test_pieces_are_one_body(tmp_path: Path) -> None:
    """Fails if the cells of a piece are lost, or its nodes and data are those of another one."""
    data = '<CellData><DataArray type="Int32" Name="part">{}</DataArray></CellData>'
    (tmp_path / "a.vtu").write_text(xml(piece(SQUARE, "0 1 2 3", "4", "9", data.format(1))
                                        + piece("3 0 0 4 0 0 4 1 0 3 1 0", "0 1 2 3", "4", "9", data.format(2))))
    mesh = read_mesh_file(tmp_path / "a.vtu")
    assert mesh.points[mesh.cells_dict["quad"]].mean(axis=1).tolist() == [[0.5, 0.5, 0], [3.5, 0.5, 0]]
    assert [mesh.cell_sets[f"part:{i}"][0].tolist() for i in (1, 2)] == [[0], [1]]


def test_vertices_and_points_are_boundaries(tmp_path: Path) -> None:
    """Fails if a marked vertex or point is no boundary, as the docs promise, or numbers of points become boundaries."""
    data = """<PointData><DataArray type="Int32" Name="clamp">0 0 1 1</DataArray>
<DataArray type="Float64" Name="side">1 2 2 1</DataArray><DataArray type="Float64" Name="u">0 0 0.5 1</DataArray>
<DataArray type="Float64" Name="zero">0 0 0 0</DataArray>
<DataArray type="Int8" Name="boundary:tip">0 5 0 0</DataArray></PointData>
<CellData><DataArray type="Int8" Name="boundary:pin">0 1 0 1</DataArray>
<DataArray type="Float32" Name="stress">1 0 0 0.5</DataArray></CellData>"""
    (tmp_path / "a.vtu").write_text(xml(piece(SQUARE, "0 1 2 3 0 2 0 1", "4 5 6 8", "9 1 1 3", data)))
    sample = file_sample(tmp_path / "a.vtu")
    assert named(sample) == {"clamp": {(1, 1), (0, 1)}, "clamp:1": {(1, 1), (0, 1)}, "clamp:0": {(0, 0), (1, 0)},
                             "side:1": {(0, 0), (0, 1)}, "side:2": {(1, 0), (1, 1)}, "tip": {(1, 0)},
                             "pin": {(0, 0), (1, 0)}}
    assert not sample.cells


def test_numbers_of_all_elements_are_no_regions(tmp_path: Path) -> None:
    """Fails if every element, or every node, becomes a set of its own because it has a number."""
    mesh = plate(13)
    mesh.cell_sets = {}
    mesh.cell_data = {"id": [np.arange(len(block.data)) for block in mesh.cells]}
    mesh.point_data = {"id": np.arange(len(mesh.points))}
    meshio.write(tmp_path / "a.vtu", mesh)
    sample = file_sample(tmp_path / "a.vtu")
    assert not sample.cells and sample.boundaries.keys() == SIDES - {"front", "back"}


def test_numbers_of_faces_come_before_those_of_edges(tmp_path: Path) -> None:
    """Fails if the curve 1 of a body in space is a part of the boundary 1, because both have that number."""
    cube = SQUARE + " 0 0 1 1 0 1 1 1 1 0 1 1"
    data = '<CellData><DataArray type="Int32" Name="tag">1 1 1 2</DataArray></CellData>'
    (tmp_path / "a.vtu").write_text(xml(piece(cube, "0 1 2 3 4 5 6 7 0 1 2 3 4 5 6 7", "8 12 14 16", "12 9 3 3", data)))
    sample = file_sample(tmp_path / "a.vtu")
    assert named(sample) == {"tag:1": {(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)}, "tag:2": {(1, 1, 1), (0, 1, 1)}}
    assert set(sample.cells) == {"tag:1"}


@pytest.mark.parametrize("kind", [6, 7, 16, 31, 42, 200])
def test_cells_that_are_not_known_are_not_left_out(kind: int, tmp_path: Path) -> None:
    """Fails if a part of the body is missing because its cells are of another kind."""
    (tmp_path / "a.vtu").write_text(xml(piece(SQUARE + " 2 0 0 2 1 0 3 1 0", "0 1 2 3 1 4 5 6 2", "4 9", f"9 {kind}")))
    with pytest.raises(MeshError, match=rf"1 cell\(s\) of VTK's kind {kind} with 5 nodes"):
        read_mesh_file(tmp_path / "a.vtu")


def test_frames_of_a_run_are_meshes(tmp_path: Path) -> None:
    """Fails if a frame that a run wrote cannot be a mesh, or its fields become regions."""
    sample = file_sample(vtk_kinds.FOLDER / "ascii-none-2d.vtu")
    n, e = sample.space.n_nodes, sample.space.n_elements
    series = Series(tmp_path, "fields", sample.space)
    series.add(0.0, {"gamma": np.ones(n), "displacement": np.zeros((n, 2))},
               {"W": np.linspace(0, 1, e), "deleted": np.arange(e) == 3})
    series.flush()
    again = file_sample(series.frame(0))
    assert np.array_equal(again.space.X, sample.space.X) and np.array_equal(again.space.conn, sample.space.conn)
    assert {name: index.tolist() for name, index in again.cells.items()} == {
        "deleted": [3], "deleted:1": [3], "deleted:0": [i for i in range(e) if i != 3]}


def test_lz4() -> None:
    """Fails if a match that overlaps itself, or a long run, is not unpacked as the format says."""
    assert lz4_block(b"\x1fa\x01\x00\x05\x50bcdef", 99) == b"a" * 25 + b"bcdef"
    assert lz4_block(b"\xf0\x0f" + bytes(30), 30) == bytes(30)
    for broken in (b"\x1fa\x02\x00\x05", b"\x1fa\x01\x00\xff", b"\xf0\xff"):
        with pytest.raises((ValueError, IndexError)):
            lz4_block(broken, 99)


def test_structured_grids(tmp_path: Path) -> None:
    """Fails if a grid that is given by its lines has other points or cells, or its claims are believed."""
    head = "# vtk DataFile Version 3.0\n\nASCII\nDATASET "
    path = tmp_path / "a.vtk"
    for text in ("STRUCTURED_POINTS\nDIMENSIONS 3 2 1\nORIGIN 0 0 0\nSPACING 1 2 1\n",
                 "RECTILINEAR_GRID\nDIMENSIONS 3 2 1\nX_COORDINATES 3 float\n0 1 2\nY_COORDINATES 2 float\n0 2\n"
                 "Z_COORDINATES 1 float\n0\n",
                 "STRUCTURED_GRID\nDIMENSIONS 3 2 1\nPOINTS 6 double\n0 0 0 1 0 0 2 0 0 0 2 0 1 2 0 2 2 0\n"):
        path.write_text(f"{head}{text}CELL_DATA 2\nSCALARS grain int 1\nLOOKUP_TABLE default\n4 5\n")
        sample = file_sample(path)
        assert points_of(sample.space.X) == {(x, y) for x in (0, 1, 2) for y in (0, 2)}
        assert middles(sample) == {"grain:4": {(0.5, 1)}, "grain:5": {(1.5, 1)}}
    path.write_text(f"{head}STRUCTURED_POINTS\nDIMENSIONS 90000 90000 9\nORIGIN 0 0 0\nSPACING 1 1 1\n")
    assert "has more than 5e+06 points" in str(outcome(path))


# --- Nastran ---
def bulk(form: str) -> str:
    """Two squares and a bar in bulk data, as free, small or large fields."""
    cards: list[list[object]] = [["GRID", 10 * i, "", x, y, "0."] for i, (x, y) in enumerate(
        [("0.", "0.0"), ("1.0", "0."), ("2.", "0."), ("0.", "1.+0"), ("10.-1", "1."), ("2.0D0", "1.")], 1)]
    cards += [["CQUAD4", 1, 7, 10, 20, 50, 40], ["CQUAD4", 2, 8, 20, 30, 60, 50], ["CBAR", 3, 9, 10, 40, "0.", "0."],
              ["SPC1", 4, 123, 10, "THRU", 20], ["SPC", 5, 60, 1, "0."], ["PSHELL", 7, 1, "1."],
              ["RBE2", 9, 10, 12, 20]]
    lines = ["SOL 101", "CEND", "BEGIN BULK", "$ comment"]
    for name, *fields in cards:
        words = [str(field) for field in fields]
        if form == "free":
            lines.append(",".join([str(name), *words]))
        elif form == "small":
            lines.append(f"{name:<8}" + "".join(f"{word:>8}" for word in words))
        else:
            rows = [words[i:i + 4] for i in range(0, len(words), 4)]
            lines += [("*       " if i else f"{name!s:<8}".replace(" ", "*", 1)) + "".join(f"{w:<16}" for w in row)
                      for i, row in enumerate(rows)]
    return "\n".join([*lines, "ENDDATA", "rubbish"])


@pytest.mark.parametrize("form", ["free", "small", "large"])
@pytest.mark.parametrize("suffix", ["bdf", "nas", "fem"])
def test_nastran(form: str, suffix: str, tmp_path: Path) -> None:
    """Fails if a field, an exponent without its letter, a property or a constraint is misread in one of the forms."""
    path = tmp_path / f"a.{suffix}"
    path.write_text(bulk(form))
    sample = file_sample(path)
    assert points_of(sample.space.X) == {(x, y) for x in (0, 1, 2) for y in (0, 1)}
    assert middles(sample) == {"property:7": {(0.5, 0.5)}, "property:8": {(1.5, 0.5)}}
    assert named(sample) == {"property:9": {(0, 0), (0, 1)}, "spc:4": {(0, 0), (1, 0)}, "spc:5": {(2, 1)}}
    assert read_mesh_file(path).info["notes"] == ["1 card(s) RBE2 were left out"]


def test_nastran_without_begin_and_with_lines_that_go_on(tmp_path: Path) -> None:
    """Fails if a file of gmsh, which has no BEGIN BULK, or an element on two lines is misread."""
    points = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    grid = "\n".join(f"GRID,{i},0,{x}.,{y}.,{z}." for i, (x, y, z) in enumerate(points, 1))
    for cell in ("CHEXA   1       3       1       2       3       4       5       6       +A\n+A      7       8",
                 "CHEXA   1       3       1       2       3       4       5       6\n        7       8",
                 "CHEXA,1,3,1,2,3,4,5,6,+\n+,7,8", "CHEXA,1,3,1,2,3,4,5,6\n,7,8",
                 "CHEXA*  1               3               1               2               *\n"
                 "*       3               4               5               6               *\n"
                 "*       7               8"):
        (tmp_path / "a.bdf").write_text(f"{grid}\n{cell}\n")
        sample = file_sample(tmp_path / "a.bdf")
        assert middles(sample) == {"property:3": {(0.5, 0.5, 0.5)}} and np.allclose(sample.space.V, 1)


@pytest.mark.parametrize("change, part", [
    (("GRID,10,,", "GRID,10,3,"), "line 5: its grid points are in the coordinate system 3"),
    (("GRID,20,", "GRID,10,"), "line 6: it has the grid point 10 twice"),
    (("CQUAD4,1,7,10,20,50,40", "CQUAD4,1,7,10,20,50,99"), "nodes that do not exist"),
    (("CQUAD4,1,7,10,20,50,40", "CQUAD4,1,7,10,20,x"), "line 11: the card CQUAD4 is not complete or has something"),
    (("CQUAD4,1,7,10,20,50,40", "CQUAD4,1,7,10"), "line 11: the card CQUAD4 is not complete"),
    (("PSHELL,7,1,1.", "INCLUDE 'a.bdf'"), "line 16: it names another file"),
    (("CQUAD4,1", "CQUADX4,1"), "line 11: it has elements CQUADX4 of a body of revolution")])
def test_nastran_that_is_not_read(change: tuple[str, str], part: str, tmp_path: Path) -> None:
    """Fails if what cannot be right is read, or its line is not named."""
    assert change[0] in bulk("free")
    (tmp_path / "a.bdf").write_text(bulk("free").replace(*change))
    assert part in str(outcome(tmp_path / "a.bdf"))


# --- UCD ---
UCD = """# a comment
6 4 1 1 0
1 0 0 0
2 1 0 0
3 2 0 0
14 0 1 0
15 1 1 0
16 2 1 0
1 4 quad 1 2 15 14
2 5 quad 2 3 16 15
3 9 line 1 14
4 9 pt 16
1 1
temperature, K
1 0.5
2 1
3 1
14 1
15 1
16 1
1 1
grain, none
1 1
2 0
3 0
4 0
"""


@pytest.mark.parametrize("suffix", ["inp", "avs", "ucd"])
def test_ucd(suffix: str, tmp_path: Path) -> None:
    """Fails if a UCD file is taken for one of Abaqus, or materials, gaps in numbers or data are misread."""
    path = tmp_path / f"a.{suffix}"
    path.write_text(UCD)
    sample = file_sample(path)
    assert middles(sample) == {"material:4": {(0.5, 0.5)}, "material:5": {(1.5, 0.5)}, "grain": {(0.5, 0.5)},
                               "grain:1": {(0.5, 0.5)}, "grain:0": {(1.5, 0.5)}}
    assert named(sample) == {"material:9": {(0, 0), (0, 1)}, "grain:0": {(0, 0), (0, 1)}}


@pytest.mark.parametrize("nodes, note", [("5 6 7 8 1 2 3 4", []), ("1 2 3 4 5 6 7 8", ["1 of 1 hexahedra were mirror "
                                                                                     "images and were turned"])])
def test_ucd_in_space(nodes: str, note: list[str], tmp_path: Path) -> None:
    """Fails if a hexahedron is read inside out, in the order of AVS or in that of other programs."""
    points = "\n".join(f"{i} {p}" for i, p in enumerate(
        ("0 0 0", "1 0 0", "1 1 0", "0 1 0", "0 0 2", "1 0 2", "1 1 2", "0 1 2"), 1))
    (tmp_path / "a.inp").write_text(f"8 1 0 0 0\n{points}\n1 1 hex {nodes}\n")
    assert file_sample(tmp_path / "a.inp").space.V.tolist() == pytest.approx([2])
    assert read_mesh_file(tmp_path / "a.inp").info["notes"] == note


# --- Exodus ---
def exodus(path: Path, dim: int, names: bool) -> None:
    """Two squares (cubes) in two blocks, with a node set and a side set."""
    with netcdf_file(str(path), "w", version=2) as out:
        def variable(name: str, values: object, kind: str, *dims: str) -> None:
            array = np.asarray(values)
            for size, d in zip(array.shape, dims):
                if d not in out.dimensions:
                    out.createDimension(d, size)
            out.createVariable(name, kind, dims)[:] = array

        def texts(name: str, words: list[str], d: str) -> None:
            rows = np.array([list(word.ljust(32, "\0").encode()) for word in words], np.uint8).view("S1")
            variable(name, rows, "c", d, "len_name")

        x, y, z = (a.ravel(order="F") for a in np.meshgrid(*[np.arange(n) for n in (3, 2, dim - 1)], indexing="ij"))
        for axis, values in zip("xyz", (x, y, z)[:dim]):
            variable(f"coord{axis}", values.astype(float), "d", "num_nodes")
        for k in (1, 2):
            nodes = [k, k + 1, k + 4, k + 3, k + 6, k + 7, k + 10, k + 9][:4 * (dim - 1)]
            variable(f"connect{k}", [nodes], "i", f"num_el_in_blk{k}", "num_nod_per_el")
            out.variables[f"connect{k}"].elem_type = "QUAD4" if dim == 2 else "HEX8"
        variable("eb_prop1", [10, 20], "i", "num_el_blk")
        variable("ns_prop1", [5], "i", "num_node_sets")
        variable("ss_prop1", [6], "i", "num_side_sets")
        variable("node_ns1", np.flatnonzero(x == 2) + 1, "i", "num_nod_ns1")
        variable("elem_ss1", [1, 2], "i", "num_side_ss1")
        variable("side_ss1", [1, 1] if dim == 2 else [5, 5], "i", "num_side_ss1")
        if names:
            texts("eb_names", ["soft", ""], "num_el_blk")
            texts("ns_names", ["end"], "num_node_sets")
            texts("ss_names", ["bottom of it"], "num_side_sets")


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("names", [True, False])
@pytest.mark.parametrize("suffix", ["e", "exo"])
def test_exodus(dim: int, names: bool, suffix: str, tmp_path: Path) -> None:
    """Fails if blocks, node sets or side sets are lost, misplaced or misnamed."""
    path = tmp_path / f"a.{suffix}"
    exodus(path, dim, names)
    sample = file_sample(path)
    X = sample.space.X
    assert len(X) == 6 * (dim - 1) and np.allclose(sample.space.V, 1)
    assert middles(sample) == {"soft" if names else "block:10": {(0.5, 0.5, 0.5)[:dim]},
                               "block:20": {(1.5, 0.5, 0.5)[:dim]}}
    assert named(sample) == {"end" if names else "nodeset:5": points_of(X[X[:, 0] == 2]),
                             "bottom of it" if names else "sideset:6": points_of(X[X[:, dim - 1] == 0])}


# --- what is refused ---
@pytest.mark.parametrize("name, content, part", [
    ("a.e", b"\x89HDF\r\n\x1a\n", "it is in the form of HDF5; make a classic one with `nccopy -6 in.e out.e`"),
    ("a.e", b"text", "save it as VTU"), ("a.med", b"\x89HDF", "open it in gmsh (File, Export) and save it as MSH 4.1"),
    ("a.cgns", b"", "open it in gmsh"), ("a.pvtu", b"<", "open it in ParaView and save it as VTU"),
    ("a.stl", b"solid", "mesh what is inside with gmsh"), ("a.vtu.gz", b"\x1f\x8b", "unpack it"),
    ("a.xyz", b"", "files .xyz are not read; what is: .msh, .vtu, .vtk, .inp"),
    ("a", b"", "files without a suffix are not read"), ("a.msh", b"(0 \"Fluent\")", "it is a mesh of Fluent"),
    ("a.msh", b"$NOD\n1\n", "it is in the format MSH 1; save it with gmsh as MSH 4.1"),
    ("a.vtk", b"# vtk DataFile Version 3.0\n\nASCII\nDATASET POLYDATA\n", "it holds POLYDATA and no grid; in ParaView"),
    ("a.vtu", b"<VTKFile type='PolyData'></VTKFile>", "it holds PolyData and not UnstructuredGrid; in ParaView"),
    ("a.vtu", b"<VTKFile type='UnstructuredGrid' compressor='vtkZstd'></VTKFile>", "save it with ZLib"),
    ("a.inp", b"6 4 1 1 0\n1 0 0 0\n", "it has fewer lines than the 6 nodes and 4 cells")])
def test_one_line_says_what_to_save_instead(name: str, content: bytes, part: str, tmp_path: Path) -> None:
    """Fails if a file is refused with the text of a library, or without what to do."""
    path = tmp_path / name
    path.write_bytes(content)
    line = str(outcome(path))
    assert part in line and name in line
    assert not any(word in line for word in ("module", "meshio", "Error", "object", "None"))


def hostile() -> dict[str, tuple[str, bytes]]:
    """Files of all readers that are to be changed at random."""
    found: dict[str, tuple[str, bytes]] = {form: (".bdf", bulk(form).encode()) for form in ("free", "small", "large")}
    found["ucd"] = (".ucd", UCD.encode())
    for stem in ("ascii-42-2d.vtk", "binary-51-2d.vtk", "binary-42-3d.vtk", "raw-lz4-2d.vtu", "base64-zlib-2d.vtu"):
        path = vtk_kinds.FOLDER / stem
        found[stem] = (path.suffix, path.read_bytes())
    for path in (vtk_kinds.FOLDER.parent / "gmsh").glob("*-3d-*.msh"):
        found[path.name] = (path.suffix, path.read_bytes())
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", hostile())
def test_broken_files_of_other_programs(name: str, tmp_path: Path) -> None:
    """Fails if a changed file gives a traceback, hangs, or is refused with the text of a library."""
    suffix, content = hostile()[name]
    path, refused = tmp_path / f"a{suffix}", 0
    for seed in range(60):
        path.write_bytes(mutated(content, random.Random(seed)))
        found = outcome(path)
        refused += isinstance(found, str)
        assert not any(word in str(found) for word in ("invalid literal", "index", "codec", "NoneType"))
    assert refused > 5


def test_broken_exodus(tmp_path: Path) -> None:
    """Fails as `test_broken_files_of_other_programs` does."""
    exodus(tmp_path / "a.e", 3, True)
    content = (tmp_path / "a.e").read_bytes()
    for seed in range(100):
        (tmp_path / "a.e").write_bytes(mutated(content, random.Random(seed)))
        outcome(tmp_path / "a.e")


def test_heads_that_are_encoded_alone(tmp_path: Path) -> None:
    """Fails if the number of bytes of an array cannot stand in base64 of its own, as some programs write it."""
    def array(values: list[float], kind: str, attributes: str) -> str:
        data = np.array(values, kind).tobytes()
        text = (base64.b64encode(len(data).to_bytes(4, "little")) + base64.b64encode(data)).decode()
        return f'<DataArray {attributes} format="binary">\n  {text}\n</DataArray>'

    points = array([float(x) for x in SQUARE.split()], "<f8", 'type="Float64" NumberOfComponents="3"')
    cells = "".join(array(values, kind, f'type="{name}" Name="{what}"') for values, kind, name, what in (
        ([0, 1, 2, 3], "<i4", "Int32", "connectivity"), ([4], "<i4", "Int32", "offsets"),
        ([9], "u1", "UInt8", "types")))
    (tmp_path / "a.vtu").write_text(xml(f'<Piece NumberOfPoints="4" NumberOfCells="1"><Points>{points}</Points>'
                                        f"<Cells>{cells}</Cells></Piece>", 'byte_order="LittleEndian"'))
    assert file_sample(tmp_path / "a.vtu").space.V.tolist() == [pytest.approx(1)]


def test_texts_and_bits_in_legacy_files(tmp_path: Path) -> None:
    """Fails if a text among the data hides what follows, or bits are misread, in text or in bytes."""
    head = "# vtk DataFile Version 3.0\nt\n{}\nDATASET UNSTRUCTURED_GRID\n"
    text = (f"{head.format('ASCII')}POINTS 4 float\n{SQUARE}\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n9\n"
            "POINT_DATA 4\nMETADATA\nINFORMATION 0\n\nFIELD FieldData 2\nnote 1 2 string\nfree text\nPOINTS\n"
            "clamp 1 4 bit\n1 0 0 1\nNORMALS n float\n" + "0 0 1\n" * 4)
    points = np.array([float(x) for x in SQUARE.split()], ">f4").tobytes()
    binary = (head.format("BINARY") + "POINTS 4 float\n").encode() + points + b"\nCELLS 1 5\n" + np.array(
        [4, 0, 1, 2, 3], ">i4").tobytes() + b"\nCELL_TYPES 1\n" + np.array([9], ">i4").tobytes() + (
        b"\nPOINT_DATA 4\nFIELD FieldData 2\nnote 1 2 string\n" + bytes([0xc0 + 4]) + b"text" + bytes([0x80, 70])
        + b"x" * 70 + b"\nclamp 1 4 bit\n\x90\n")
    for content in (text.encode(), binary, text.replace("\n", "\r\n").encode()):
        (tmp_path / "a.vtk").write_bytes(content)
        sample = file_sample(tmp_path / "a.vtk")
        assert named(sample)["clamp"] == {(0, 0), (0, 1)} and len(sample.space.conn) == 1
