"""Files of gmsh: every kind that it writes of a strip and a block, against what these are by construction."""

from __future__ import annotations

import re
from pathlib import Path

import meshio
import numpy as np
import pytest
from gmsh_kinds import FOLDER, FORMS, KINDS, check, make, model, points_of, sets_of
from plates import SMALL, invoke, plate, same
from test_mesh_files import gmsh_4, outcome, write

from skfsink.meshing.mesh_file import read_mesh_file
from skfsink.meshing.sample import file_sample
from skfsink.meshing.vtu import write_mesh

STORED = sorted(FOLDER.glob("*.msh"))
NAMES = [path.stem for path in STORED]


@pytest.mark.parametrize("path", STORED, ids=NAMES)
def test_stored_files(path: Path) -> None:
    """Fails if an element, a node or a member of a group is lost, made up or moved, in a file that gmsh wrote."""
    kind, form = path.stem.rsplit("-", 2)[0], path.stem.rsplit("-", 1)[1]
    check(file_sample(path), sets_of(kind, form))


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("kind", KINDS)
def test_files_that_gmsh_writes_now(kind: str, form: str, dim: int, tmp_path: Path) -> None:
    """Fails as `test_stored_files` does, for the version of gmsh that is installed."""
    pytest.importorskip("gmsh")
    make(tmp_path / "mesh.msh", dim, form, **KINDS[kind])
    check(file_sample(tmp_path / "mesh.msh"), sets_of(kind, form))


@pytest.mark.parametrize("path", STORED, ids=NAMES)
def test_twins_in_vtu(path: Path, tmp_path: Path) -> None:
    """Fails if the VTU file of a mesh of gmsh is another mesh, or names other sets."""
    write_mesh(tmp_path / path.with_suffix(".vtu").name, read_mesh_file(path))
    assert same(file_sample(path), file_sample(tmp_path / path.with_suffix(".vtu").name))


@pytest.mark.slow
def test_runs_on_twins(tmp_path: Path) -> None:
    """Fails if runs on a file of gmsh and on the VTU file of the same mesh differ in a byte."""
    histories = []
    for name, form in (("a.vtu", ""), ("b.msh", "msh4")):
        if form:
            write(tmp_path / name, form, plate(7))
        else:
            write_mesh(tmp_path / name, plate(7))
        out = tmp_path / name[0]
        status, err, _ = invoke("--mesh", tmp_path / name, "--out", out, "--event-time", "2e-7", *SMALL)
        assert status == 0, err
        histories.append((out / "history.csv").read_bytes())
    assert histories[0] == histories[1] and len(histories[0].splitlines()) > 5


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("order, incomplete", [(2, False), (2, True), (3, False), (4, True)])
@pytest.mark.parametrize("dim", [2, 3])
def test_middle_nodes_are_dropped(dim: int, order: int, incomplete: bool, form: str, tmp_path: Path) -> None:
    """Fails if elements with nodes between their corners are not taken by their corners, whatever their order."""
    pytest.importorskip("gmsh")
    make(tmp_path / "mesh.msh", dim, form, order=order, incomplete=incomplete)
    check(file_sample(tmp_path / "mesh.msh"))


def test_any_plane_of_constant_z(tmp_path: Path) -> None:
    """Fails if a sheet at z = 3 is refused, or one in another plane taken or refused without a cure."""
    pytest.importorskip("gmsh")
    make(tmp_path / "mesh.msh", 2, height=3.0)
    check(file_sample(tmp_path / "mesh.msh"))
    text = (FOLDER / "plain-2d-22.msh").read_text()
    (tmp_path / "mesh.msh").write_text(re.sub(r"^(\d+ \S+) (\S+) (0)$", r"\1 \3 \2", text, flags=re.M))
    assert "must have its quadrilaterals in a plane of constant z" in str(outcome(tmp_path / "mesh.msh"))


def curved(path: Path, form: str, sense: tuple[int, int]) -> None:
    """Two squares with loops of either sense, beside a circle whose centre belongs to no element."""
    with model(FORMS[form]) as gmsh:
        geo = gmsh.model.geo
        points = [geo.addPoint(x, y, 0) for x, y in ((0, 0), (2, 0), (4, 0), (4, 2), (2, 2), (0, 2))]
        lines = [geo.addLine(points[i], points[j]) for i, j in ((0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 0), (1, 4))]
        loops = ([lines[0], lines[6], lines[4], lines[5]], [lines[1], lines[2], lines[3], -lines[6]])
        for loop, sign in zip(loops, sense):
            geo.addPlaneSurface([geo.addCurveLoop([sign * tag for tag in loop[::sign]])])
        geo.addPoint(1, 1, 0)
        geo.synchronize()
        for _, tag in gmsh.model.getEntities(1):
            gmsh.model.mesh.setTransfiniteCurve(tag, 3)
        for _, tag in gmsh.model.getEntities(2):
            gmsh.model.mesh.setTransfiniteSurface(tag)
            gmsh.model.mesh.setRecombine(2, tag)
        gmsh.model.mesh.generate(2)
        gmsh.write(str(path))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("sense, turned", [((1, 1), 0), ((1, -1), 4), ((-1, -1), 8)])
def test_surfaces_whose_normals_point_down(sense: tuple[int, int], turned: int, form: str, tmp_path: Path) -> None:
    """Fails if clockwise quadrilaterals, all or some, are refused, or turned without a note; or the centre stays."""
    pytest.importorskip("gmsh")
    curved(tmp_path / "mesh.msh", form, sense)
    sample = file_sample(tmp_path / "mesh.msh")
    assert points_of(sample.space.X) == {(float(x), float(y)) for x in range(5) for y in range(3)}
    assert np.allclose(sample.space.V, 1) and sample.space.n_elements == 8
    notes = read_mesh_file(tmp_path / "mesh.msh").info["notes"]
    assert [note for note in notes if "clockwise" in note] == (
        [f"{turned} of 8 quadrilaterals ran clockwise and were turned"] if turned else [])
    assert sum("1 node(s) belong to no element" in note for note in notes) == 1
    assert len(notes) == 1 + bool(turned) and "point:7" not in sample.boundaries and "point:6" in sample.boundaries


def test_an_element_that_is_folded_over_is_not_turned(tmp_path: Path) -> None:
    """Fails if an element that lies on its neighbour is taken for one that is numbered clockwise."""
    mesh = plate(3, notch=-1.0)
    mesh.points[:, :2] = np.round(mesh.points[:, :2] * 3 / 4) * 4 / 3
    inner = mesh.points[:, 0] > 3.9
    mesh.points[inner, 0] = 2.0  # the last column, folded back over the one before
    write_mesh(tmp_path / "fold.vtu", mesh)
    assert "is inverted or degenerate" in str(outcome(tmp_path / "fold.vtu"))


def test_what_gmsh_did_not_save(tmp_path: Path) -> None:
    """Fails if a file that lacks the body, or its groups, is taken or refused without a word about that."""
    path = tmp_path / "mesh.msh"
    path.write_bytes((FOLDER / "save-all-2d-22.msh").read_bytes())
    assert any("Mesh.SaveAll: save it as MSH 4.1" in note for note in read_mesh_file(path).info["notes"])
    text = (FOLDER / "plain-2d-22.msh").read_text().partition("$Elements\n")
    lines = [line for line in text[2].splitlines() if re.match(r"\d+ (1|15) ", line)]
    path.write_text("\n".join([text[0] + "$Elements", str(len(lines)), *lines, "$EndElements", ""]))
    assert "it has no elements but lines and points: where there are physical groups" in str(outcome(path))


def test_a_volume_that_was_not_saved(tmp_path: Path) -> None:
    """Fails if one face of a block is taken for a sheet without a word."""
    pytest.importorskip("gmsh")
    with model({}) as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 2, 2, 1)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.RecombineAll", 1)
        face = next(tag for _, tag in gmsh.model.getEntities(2) if gmsh.model.getBoundingBox(2, tag)[5] < 0.5)
        gmsh.model.addPhysicalGroup(2, [face], 1, "face")
        gmsh.model.mesh.generate(2)
        gmsh.write(str(tmp_path / "mesh.msh"))
    assert any("a volume of which no element was saved" in note
               for note in read_mesh_file(tmp_path / "mesh.msh").info["notes"])


@pytest.mark.parametrize("form", ["41", "41b", "22", "22b"])
@pytest.mark.parametrize("part", [1, 2])
def test_a_part_of_a_mesh_is_refused(part: int, form: str, tmp_path: Path) -> None:
    """Fails if the file of one processor is taken for the body."""
    pytest.importorskip("gmsh")
    make(tmp_path / "mesh.msh", 2, form, parts=2, options={"Mesh.PartitionSplitMeshFiles": 1})
    line = str(outcome(tmp_path / f"mesh_{part}.msh"))
    assert f"it holds part {part} of a partitioned mesh" in line and "Mesh.PartitionSplitMeshFiles = 0" in line


def test_an_unstructured_mesh_with_holes(tmp_path: Path) -> None:
    """Fails if a mesh as gmsh recombines it is not whole: area, outline and hole."""
    pytest.importorskip("gmsh")
    with model({"Mesh.RecombineAll": 1, "Mesh.RecombinationAlgorithm": 3, "Mesh.MeshSizeMax": 0.3}) as gmsh:
        occ = gmsh.model.occ
        occ.cut([(2, occ.addRectangle(0, 0, 0, 3, 2))], [(2, occ.addDisk(1.5, 1, 0, 0.5, 0.5))])
        occ.synchronize()
        hole = [tag for _, tag in gmsh.model.getEntities(1) if 0.9 < gmsh.model.getBoundingBox(1, tag)[0] < 1.1]
        gmsh.model.addPhysicalGroup(1, hole, 1, "hole \u00e9")
        gmsh.model.addPhysicalGroup(2, [tag for _, tag in gmsh.model.getEntities(2)], 1, 'a "sheet"')
        gmsh.model.mesh.generate(2)
        quads = len(gmsh.model.mesh.getElementsByType(3)[0])
        gmsh.write(str(tmp_path / "mesh.msh"))
    sample = file_sample(tmp_path / "mesh.msh")
    X = sample.space.X[sample.boundaries["hole \u00e9"]]
    assert sample.space.n_elements == quads > 40 and len(sample.cells) == 1
    assert np.allclose(np.linalg.norm(X - [1.5, 1], axis=1), 0.5)
    assert sample.space.V.sum() == pytest.approx(6 - np.pi / 4, rel=0.02)


# --- text by hand ---
def change(text: str, *pairs: tuple[str, str]) -> str:
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def test_text_as_other_systems_keep_it(tmp_path: Path) -> None:
    """Fails if ends of lines of Windows, a byte order mark, UTF-16 or a comment make another file of it."""
    text = (FOLDER / "plain-2d-41.msh").read_bytes()
    for changed in (text.replace(b"\n", b"\r\n"), b"\xef\xbb\xbf" + text, text.decode().encode("utf-16"),
                    b"$Comments\nhello\n$EndComments\n" + text, text + b"\n\n$NodeData\n1\n$EndNodeData\n"):
        (tmp_path / "mesh.msh").write_bytes(changed)
        check(file_sample(tmp_path / "mesh.msh"))


def swapped(data: bytes, size: int = 8) -> bytes:
    """A binary file of version 4.1 as a machine with the other order of bytes writes it."""
    import struct

    at = 0
    out = bytearray(data)

    def swap(n: int, width: int) -> list[int]:
        nonlocal at
        values = []
        for _ in range(n):
            values.append(int.from_bytes(data[at:at + width], "little"))
            out[at:at + width] = data[at:at + width][::-1]
            at += width
        return values

    def section(name: str) -> None:
        nonlocal at
        at = data.index(f"${name}\n".encode()) + len(name) + 2

    at = data.index(b"\n", data.index(b"$MeshFormat") + 12) + 1
    swap(1, 4)
    section("Entities")
    for dim, count in enumerate(swap(4, size)):
        for _ in range(count):
            swap(1, 4), swap(6 if dim else 3, 8), swap(swap(1, size)[0], 4)
            if dim:
                swap(swap(1, size)[0], 4)
    section("Nodes")
    for _ in range(swap(4, size)[0]):
        swap(3, 4)
        n = swap(1, size)[0]
        swap(n, size), swap(3 * n, 8)
    section("Elements")
    for _ in range(swap(4, size)[0]):
        kind = swap(3, 4)[2]
        swap(swap(1, size)[0] * (1 + {15: 1, 1: 2, 3: 4, 5: 8}[kind]), size)
    assert struct.calcsize("q") == size
    return bytes(out)


def test_the_other_order_of_bytes(tmp_path: Path) -> None:
    """Fails if a file of a big-endian machine is misread."""
    for dim in (2, 3):
        (tmp_path / "mesh.msh").write_bytes(swapped((FOLDER / f"plain-{dim}d-41b.msh").read_bytes()))
        check(file_sample(tmp_path / "mesh.msh"))


def test_binary_files_of_version_4_0(tmp_path: Path) -> None:
    """Fails if a binary file of version 4.0, which meshio writes as gmsh 4.0 did, is misread."""
    mesh = plate(5)
    ones = [np.ones(len(mesh.cells[0].data), int)]
    whole = meshio.Mesh(mesh.points, mesh.cells[:1], cell_data={"gmsh:physical": ones, "gmsh:geometrical": ones})
    meshio.gmsh.write(tmp_path / "mesh.msh", whole, "4.0", binary=True)
    assert (tmp_path / "mesh.msh").read_bytes().startswith(b"$MeshFormat\n4.0 1 8\n")
    sample = file_sample(tmp_path / "mesh.msh")
    assert np.array_equal(sample.space.X, mesh.points[:, :2]) and sample.space.n_elements == len(mesh.cells[0].data)


def test_points_and_curves_of_one_name(tmp_path: Path) -> None:
    """Fails if a group of points takes the place of a group of curves that has its name, or the other way round."""
    text = change((FOLDER / "plain-2d-41.msh").read_text(), ('0 1 "corner"', '0 1 "lid"'))
    (tmp_path / "mesh.msh").write_text(text)
    sample = file_sample(tmp_path / "mesh.msh")
    assert points_of(sample.space.X[sample.boundaries["lid"]]) == {(0, 0), *((float(x), 2.0) for x in range(5))}
    assert len(sample.cells["lid"]) == 4


PLAIN = change(gmsh_4(plate(3)))
TWO = ("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n$EndNodes\n"
       "$Elements\n{}\n{}\n$EndElements\n")
ELEMENT = "1 3 2 1 1 1 2 3 4"
BROKEN: dict[str, tuple[str, str]] = {
    "no end": (PLAIN[:len(PLAIN) // 2], "has no end; the file is cut off"),
    "version 3": (change(PLAIN, ("4.1 0 8", "3 0 8")), "MSH 3; save it with gmsh as MSH 4.1 or 2.2"),
    "size": (change(PLAIN, ("4.1 0 8", "4.1 0 16")), "stored in an unknown way"),
    "no head": ("$Nodes\n", "does not begin with $MeshFormat"),
    "no nodes": ("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n", "has no section $Nodes"),
    "word": (change(PLAIN, ("\n1 16 1 16\n", "\n1 x 1 16\n")), "$Nodes has something between its numbers"),
    "fraction": (change(PLAIN, ("\n1 16 1 16\n", "\n1.5 16 1 16\n")), "must be whole"),
    "fewer": (TWO.format(2, ELEMENT), "$Elements has fewer numbers than it says"),
    "more": (TWO.format(1, ELEMENT + "\n2 3 2 1 1 1 2 3 4"), "$Elements has more numbers than it says"),
    "no such node": (TWO.format(1, "1 3 2 1 1 1 2 3 5"), "nodes that do not exist"),
    "kind": (TWO.format(1, "1 34 2 1 1 1 2 3 4"), "gmsh's kind 34, which cannot be read"),
    "twice": (TWO.format(2, ELEMENT + "\n2 3 2 1 1 1 2 3 4"), "has 1 element(s) more than once"),
    "node twice": (change(TWO.format(1, ELEMENT), ("\n2 1 0 0", "\n1 1 0 0")), "it has the node 1 twice"),
    "nan": (change(TWO.format(1, ELEMENT), ("\n2 1 0 0", "\n2 nan 0 0")), "not finite"),
    "names": (change(PLAIN, ('1 2 "top"', "1 2 top")), "without dimension, number and name"),
    "between": (change(PLAIN, ("$Nodes", "rubbish\n$Nodes")), "something between its sections"),
    "section twice": (change(PLAIN, ("$Elements", PLAIN[PLAIN.index("$Nodes"):PLAIN.index("$Elements")] + "$Elements")),
                      "$Nodes is there twice"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_wrong_is_said(name: str, tmp_path: Path) -> None:
    """Fails if a broken file is refused without what is wrong with it."""
    (tmp_path / "mesh.msh").write_text(BROKEN[name][0])
    assert BROKEN[name][1] in str(outcome(tmp_path / "mesh.msh"))


def test_an_element_in_two_groups_of_version_2_is_one(tmp_path: Path) -> None:
    """Fails if an element that stands in a file once for each of its groups is counted twice or loses a group."""
    (tmp_path / "mesh.msh").write_text(TWO.format(3, "1 3 2 4 1 1 2 3 4\n2 3 2 5 1 1 2 3 4\n3 1 2 6 1 1 2"))
    sample = file_sample(tmp_path / "mesh.msh")
    assert {name: index.tolist() for name, index in sample.cells.items()} == {"surface:4": [0], "surface:5": [0]}
    assert sample.boundaries["curve:6"].tolist() == [0, 1]


def test_kinds_of_elements_that_alternate(tmp_path: Path) -> None:
    """Fails if elements of version 2 whose kinds alternate take quadratic time."""
    n = 10_000
    rows = "\n".join(f"{i} {'3 2 1 1 1 2 3 4' if i % 2 else '1 2 1 1 1 2'}" for i in range(1, n + 1))
    (tmp_path / "mesh.msh").write_text(TWO.format(n, rows))
    assert f"has {n // 2 - 1} element(s) more than once" in str(outcome(tmp_path / "mesh.msh"))



