"""Keyword files of Abaqus, by kind: each against the mesh that it must be, known by construction."""

from __future__ import annotations

import logging
import time
from pathlib import Path

import meshio
import numpy as np
import pytest

from skfsink.errors import MeshError
from skfsink.meshing.files import bounds
from skfsink.meshing.mesh_file import read_mesh_file
from skfsink.meshing.sample import Sample, file_sample

# nine nodes of a plate of 2 x 2 mm, its four quadrilaterals, and two bricks on one another
NODES = "\n".join(f"{3 * j + i + 1}, {i}., {j}." for j in range(3) for i in range(3)) + "\n"
QUADS = "1, 1, 2, 5, 4\n2, 2, 3, 6, 5\n3, 4, 5, 8, 7\n4, 5, 6, 9, 8\n"
PLATE = f"*Node\n{NODES}*Element, type=CPE4, elset=all\n{QUADS}"
POINTS = np.array([[i, j] for j in range(3) for i in range(3)], float)
CONN = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
BRICKS = (
    "*NODE\n"
    + "\n".join(
        f"{4 * k + n + 1}, {x}, {y}, {k}" for k in range(3) for n, (x, y) in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)])
    )
    + "\n*ELEMENT, TYPE=C3D8R\n1, 1, 2, 3, 4, 5, 6, 7, 8\n2, 5, 6, 7, 8, 9, 10, 11, 12\n"
)


def read(folder: Path, text: str | bytes, **files: str) -> meshio.Mesh:
    """The mesh of a keyword file and of those that it includes, whose names are keywords: a.b for a_b."""
    folder.mkdir(exist_ok=True)
    (folder / "body.inp").write_bytes(text.encode() if isinstance(text, str) else text)
    for name, content in files.items():
        path = folder / name.replace("__", "/").replace("_", ".")
        path.parent.mkdir(exist_ok=True)
        path.write_text(content)
    return read_mesh_file(folder / "body.inp")


def sample(folder: Path, text: str | bytes, **files: str) -> Sample:
    """The same as a sample."""
    read(folder, text, **files)
    return file_sample(folder / "body.inp")


def refused(folder: Path, text: str | bytes, **files: str) -> str:
    """The one line with which it is refused."""
    with pytest.raises(MeshError) as caught:
        read(folder, text, **files)
    line = str(caught.value)
    assert "\n" not in line and "body.inp" in line and len(line) < 500, line
    return line


def notes(mesh: meshio.Mesh) -> str:
    """All notes on a mesh."""
    return "\n".join(mesh.info["notes"])


def is_plate(mesh: meshio.Mesh) -> None:
    """See that a mesh is the plate, node by node."""
    assert np.array_equal(mesh.points[:, :2], POINTS) and np.array_equal(mesh.cells_dict["quad"], CONN)


def members(mesh: meshio.Mesh, name: str) -> list[int]:
    """The elements of a set, by number among the first block."""
    return mesh.cell_sets[name][0].tolist()


# --- elements ---
@pytest.mark.parametrize(
    "kind",
    [
        "CPE4",
        "cpe4h",
        "CPE4I",
        "CPE4R",
        "CPE4RH",
        "CPE4IH",
        "CPE4RT",
        "CPS4",
        "CPS4R",
        "CPS4T",
        "Cps4i",
        "CPS4RT",
        "CPEG4",
        "CPEG4R",
        "CGPE4",
        "M3D4",
        "M3D4R",
        "S4",
        "S4R",
        "S4R5",
        "S4RS",
        "CPE4P",
        "CPE4RPH",
        "CPE4PHT",
        "DC2D4",
        "AC2D4",
        "CAX4",
        "cax4rh",
    ],
)
def test_elements_of_four_nodes(kind: str, tmp_path: Path) -> None:
    """Fails if a suffix or small letters make an element unknown, or plane stress is plane strain silently."""
    mesh = read(tmp_path, PLATE.replace("CPE4", kind))
    is_plate(mesh)
    assert members(mesh, "all") == [0, 1, 2, 3]
    assert ("planestress" in notes(mesh)) == kind.upper().startswith("CPS")
    assert mesh.info["element"] == {"CPS": "planestress", "CAX": "axisymmetric"}.get(kind.upper()[:3], "")
    assert ("axisymmetric" in notes(mesh)) == kind.upper().startswith("CAX")
    assert ("shells and membranes" in notes(mesh)) == (kind[0] in "MS")


@pytest.mark.parametrize(
    "kind",
    [
        "C3D8",
        "C3D8R",
        "c3d8h",
        "C3D8I",
        "C3D8IH",
        "C3D8RH",
        "C3D8T",
        "C3D8RHT",
        "SC8R",
        "SC8RT",
        "DC3D8",
        "C3D8PH",
        "C3D8S",
    ],
)
def test_elements_of_eight_nodes(kind: str, tmp_path: Path) -> None:
    """Fails if a suffix makes a brick unknown, or its nodes change places."""
    mesh = read(tmp_path, BRICKS.replace("C3D8R", kind))
    assert mesh.cells_dict["hexahedron"].tolist() == [[*range(8)], [*range(4, 12)]]
    assert np.array_equal(mesh.points[5], [1, 0, 1]) and not mesh.info["notes"]


@pytest.mark.parametrize(
    "kind, size, cell",
    [
        ("CPE3", 3, "triangle"),
        ("CPS3", 3, "triangle"),
        ("CPE3H", 3, "triangle"),
        ("CPE6M", 6, "triangle6"),
        ("CPE8", 8, "quad8"),
        ("CPS8R", 8, "quad8"),
        ("CPE8RH", 8, "quad8"),
        ("C3D4H", 4, "tetra"),
        ("C3D10M", 10, "tetra10"),
        ("C3D10MH", 10, "tetra10"),
        ("C3D6", 6, "wedge"),
        ("C3D15", 15, "wedge"),
        ("C3D20RH", 20, "hexahedron20"),
        ("C3D20", 20, "hexahedron20"),
        ("C3D27R", 27, "hexahedron27"),
        ("C3D5", 5, "pyramid"),
    ],
)
@pytest.mark.parametrize("comma", [",", ""])
def test_elements_of_other_forms(kind: str, size: int, cell: str, comma: str, tmp_path: Path) -> None:
    """Fails if a form that `skfsink mesh` converts is no cell, or an element over several lines is not one."""
    from skfsink.meshing.files.abaqus import read_abaqus

    numbers = [str(i + 1) for i in range(size + 1)]
    lines = f"{comma}\n".join([", ".join(numbers[:16]), ", ".join(numbers[16:])] if size > 15 else [", ".join(numbers)])
    nodes = "".join(f"{i + 2}, {i % 3}, {i // 3 % 3}, {i // 9}\n" for i in range(size))
    path = tmp_path / "body.inp"
    path.write_text(f"*NODE\n{nodes}*ELEMENT, TYPE={kind}\n{lines}\n")
    (block,) = read_abaqus(path).cells
    expected = (
        list(range(6 if cell == "wedge" else size))
        if cell != "hexahedron27"
        else [*range(20), 26, 24, 23, 25, 21, 22, 20]
    )
    assert block.type == cell and block.data.tolist() == [expected]


@pytest.mark.parametrize(
    "kind, part",
    [
        ("cgax4r", "line 11: elements CGAX4R are axisymmetric of a kind that is not computed"),
        ("COH2D4", "cohesive"),
        ("CINPE4", "infinite"),
        ("EC3D8R", "Eulerian"),
        ("XYZ9", "line 11: elements of type XYZ9 are not known"),
        ("U4", "elements of type U4 are not known: *USER ELEMENT"),
    ],
)
def test_elements_that_are_refused(kind: str, part: str, tmp_path: Path) -> None:
    """Fails if what is not computed is taken for a plane, or left out in silence."""
    assert part in refused(tmp_path, PLATE.replace("CPE4", kind))


def test_sets_without_members_are_named(tmp_path: Path) -> None:
    """Fails if a set that the file declares and leaves empty is left out in silence."""
    mesh = read(tmp_path, PLATE + "*Nset, nset=hole\n*Elset, elset=Core\n**\n")
    is_plate(mesh)
    assert "the node set 'hole' is empty, and is left out" in notes(mesh) and "hole" not in mesh.point_sets
    assert "the element set 'Core' is empty, and is left out" in notes(mesh) and "Core" not in mesh.cell_sets


def test_elements_that_are_no_body(tmp_path: Path) -> None:
    """Fails if springs, masses, … end the reading, are left out in silence, or stay in sets; edges are boundaries."""
    mesh = read(
        tmp_path,
        PLATE + "*Element, type=SPRINGA, elset=springs\n11, 1, 9\n*Element, type=MASS, elset=both\n12, 5\n"
        "*Element, type=CONN2D2\n13, , 5\n*Element, type=T2D2, elset=edge\n21, 1, 2\n22, 2, 3\n"
        "*Element, type=R3D4\n31, 1, 2, 3, 4\n*Element, type=DCOUP2D\n41, 1\n*Elset, elset=both\n2, 12\n"
        "*ELEMENT, TYPE=B31\n51, 7, 8, 1\n*ELEMENT, TYPE=T2D3, ELSET=top\n61, 7, 8, 9\n",
    )
    is_plate(mesh)
    assert "1 element(s) of type SPRINGA (line 16) are no body and are left out" in notes(mesh)
    assert "'springs' has only elements that are left out" in notes(mesh) and "springs" not in mesh.cell_sets
    assert members(mesh, "both") == [1]
    own = file_sample(tmp_path / "body.inp")
    assert own.nodes("edge").tolist() == [0, 1, 2] and own.nodes("top").tolist() == [6, 8]
    assert "2 element(s) of type T2D2 (line 22) are edges of the body" in notes(mesh)


def test_faces_given_by_plane_elements(tmp_path: Path) -> None:
    """Fails if plane elements on the faces of solids, as gmsh writes them, are no boundary, or ones beside are lost."""
    own = sample(tmp_path, BRICKS + "*ELEMENT, TYPE=CPS4, ELSET=foot\n7, 1, 2, 3, 4\n*ELEMENT, TYPE=T3D2\n8, 1, 2\n")
    assert own.nodes("foot").tolist() == [0, 1, 2, 3] and own.space.mesh.t.shape[1] == 2
    assert "beside the solid body" in refused(
        tmp_path, BRICKS.replace("*ELEMENT", "13, 5, 5\n*ELEMENT") + "*ELEMENT, TYPE=S4R\n7, 1, 2, 3, 13\n"
    )


def test_sets_of_element_blocks(tmp_path: Path) -> None:
    """Fails if a block without a set moves the sets of the others, or a set on two blocks is that of one."""
    text = (
        f"*Node\n{NODES}*Element, type=CPE4\n1, 1, 2, 5, 4\n*Element, type=CPE4, elset=b\n2, 2, 3, 6, 5\n"
        "*Element, elset=B, type=cpe4r\n3, 4, 5, 8, 7\n*Element, type=CPE4, elset=c\n4, 5, 6, 9, 8\n"
    )
    mesh = read(tmp_path, text)
    is_plate(mesh)
    assert members(mesh, "b") == [1, 2] and members(mesh, "c") == [3] and list(mesh.cell_sets) == ["b", "c"]


def test_elements_that_are_no_body_with_any_nodes(tmp_path: Path) -> None:
    """Fails if nodes of what is left out, of whatever number or missing, are a traceback."""
    mesh = read(tmp_path, PLATE + "*ELEMENT, TYPE=T2D2\n7, 1, 99999999999999999999\n*ELEMENT, TYPE=SPRING1\n8, 99\n9\n")
    is_plate(mesh)
    assert "T2D2 (line 16) are no body" in notes(mesh) and "2 element(s) of type SPRING1" in notes(mesh)


# --- user elements ---
USER = "*User element, nodes=4, type=U1, properties=2, coordinates=2, var=8\n1, 2\n3\n"


def test_user_elements_with_a_layer_of_plane_ones(tmp_path: Path) -> None:
    """Fails if elements that are there twice or thrice are counted so, or sets of one layer are not of the other."""
    user = QUADS.replace("\n", "\n10").removesuffix("10")
    mesh = read(
        tmp_path,
        f"*Node\n{NODES}{USER}*Element, type=U1, elset=uel\n10{user}"
        f"*Element, type=CPE4, elset=dummy\n{QUADS}*Element, type=U1\n201, 2, 5, 4, 1\n"
        "*Elset, elset=part\n102, 104\n*Elset, elset=same\n2, 4\n*Uel property, elset=uel\n1., 2.\n",
    )
    is_plate(mesh)
    assert len(mesh.cells) == 1 and members(mesh, "part") == members(mesh, "same") == [1, 3]
    assert members(mesh, "uel") == members(mesh, "dummy") == [0, 1, 2, 3]
    assert "4 user elements U1 (line 14) have the nodes of other elements and count once" in notes(mesh)


def test_user_elements_alone(tmp_path: Path) -> None:
    """Fails if user elements of a form that is clear are refused, two layers count twice, or others are guessed."""
    two = USER + USER.replace("U1", "U2")
    mesh = read(
        tmp_path,
        f"*Node\n{NODES}{two}*Element, type=U1, elset=all\n{QUADS}*Element, type=U2, elset=late\n14, 5, 6, 9, 8\n",
    )
    is_plate(mesh)
    assert members(mesh, "late") == [3] and "4 user elements U1 (line 17) are taken as quadrilaterals" in notes(mesh)
    mesh = read(tmp_path, BRICKS.replace("C3D8R", "VU8") + "*USER ELEMENT, TYPE=VU8, NODES=8, COORDINATES=3\n1,2,3\n")
    assert len(mesh.cells_dict["hexahedron"]) == 2
    line = refused(tmp_path, BRICKS.replace("C3D8R", "U8") + "*USER ELEMENT, TYPE=U8, NODES=8, COORDINATES=2\n1,2\n")
    assert "2 user elements U8 of 8 nodes" in line and "CPE4" in line


def test_user_elements_partly_with_a_layer(tmp_path: Path) -> None:
    """Fails if user elements beside a layer that covers some of them are lost, or those under it count twice."""
    layer = "*Element, type=CPE4\n11, 1, 2, 5, 4\n12, 2, 3, 6, 5\n"
    text = f"*Node\n{NODES}{USER}*Element, type=U1, elset=uel\n{QUADS}{layer}*Elset, elset=e\n1, 4, 11\n"
    mesh = read(tmp_path, text)
    assert sorted(mesh.cells_dict["quad"].tolist()) == CONN.tolist() and len(members(mesh, "uel")) == 4
    assert mesh.cells_dict["quad"][members(mesh, "e")].tolist() in (CONN[[0, 3]].tolist(), CONN[[3, 0]].tolist())


# --- nodes ---
def test_several_blocks_of_nodes(tmp_path: Path) -> None:
    """Fails if only the last *NODE counts, or a set on it is lost."""
    rows = NODES.splitlines()
    mesh = read(
        tmp_path,
        "*NODE\n"
        + "\n".join(rows[:4])
        + "\n*NODE, NSET=late\n"
        + "\n".join(rows[4:])
        + f"\n*ELEMENT, TYPE=CPE4\n{QUADS}",
    )
    is_plate(mesh)
    assert mesh.point_sets["late"].tolist() == [4, 5, 6, 7, 8]


def test_systems_of_coordinates(tmp_path: Path) -> None:
    """Fails if coordinates are taken as they stand in a moved, turned or cylindrical system."""
    turned = "".join(f"{3 * j + i + 1}, {i - 1}, {5 - j}\n" for j in range(3) for i in range(3))  # of axes to +x and -y
    mesh = read(tmp_path, f"*SYSTEM\n1, 5, 0, 2, 5, 0\n1, 4, 0\n*NODE\n{turned}*SYSTEM\n*ELEMENT, TYPE=CPE4\n{QUADS}")
    is_plate(mesh)
    mesh = read(
        tmp_path,
        "*SYSTEM\n1., 2.\n*NODE, SYSTEM=C\n1, 1., 0.\n2, 2., 0.\n3, 2., 90.\n4, 1., 90.\n*NODE, SYSTEM=S\n"
        "5, 1., 0., 90.\n*SYSTEM\n*NODE\n6, 3., 3.\n*ELEMENT, TYPE=CPE4\n1, 1, 2, 3, 4\n",
    )
    assert np.allclose(mesh.points, [[2, 2, 0], [3, 2, 0], [1, 4, 0], [1, 3, 0]])


def test_generated_nodes_and_elements(tmp_path: Path) -> None:
    """Fails if *NGEN or *ELGEN are passed over, or count another way; other generators are refused by name."""
    text = (
        "*NODE\n1, 0., 0.\n3, 2., 0.\n7, 0., 2.\n9, 2., 2.\n*NGEN, NSET=foot\n1, 3\n*NGEN, NSET=top\n7, 9, 1\n"
        "*NGEN\n1, 7, 3\n2, 8, 3\n3, 9, 3\n*ELEMENT, TYPE=CPE4\n1, 1, 2, 5, 4\n*ELGEN, ELSET=all\n1, 2, 1, 1, 2, 3, 2\n"
    )
    mesh = read(tmp_path, text)
    order = np.lexsort(mesh.points.T[:2])
    assert np.array_equal(mesh.points[order][:, :2], POINTS)
    number = np.argsort(order)
    assert np.array_equal(number[mesh.cells_dict["quad"]], CONN) and members(mesh, "all") == [0, 1, 2, 3]
    assert np.array_equal(mesh.points[mesh.point_sets["top"]][:, 1], [2, 2, 2]) and len(mesh.point_sets["foot"]) == 3
    for keyword in ("NCOPY, OLD SET=foot", "nfill", "Elcopy"):
        assert f"line 18: *{keyword.partition(',')[0].upper()} is not read" in refused(
            tmp_path, text + f"*{keyword}\n1, 2\n"
        )


def test_numbers_and_lines_as_people_write_them(tmp_path: Path) -> None:
    """Fails if Fortran numbers, tabs, blanks, case, empty lines, comments or a heading with commas end it."""
    rows = NODES.replace("1., 2.", "1.d0,\t2.D+0").replace("2., 2.", " 2 , 2.e0,").splitlines()
    text = (
        "** made by hand\n\n*HEADING\n1, 2, not a node\nmodel, * of\n*Preprint, echo=NO\n  * NODE , nset = N \n** x\n"
        + "\n\n** between\n".join(rows)
        + '\n*ELEMENT,\n TYPE = cpe4 ,\n ElSet="my Body"\n'
        + QUADS.replace("4, 5", "\t4,5")
        + '*nset,NSET="the top" , gen\n7, 9\n*NSET, NSET=a\n  1,\n\n** two\n 2, 3,\n 4\n'
    )
    mesh = read(tmp_path, text)
    is_plate(mesh)
    assert members(mesh, "my Body") == [0, 1, 2, 3] and mesh.point_sets["the top"].tolist() == [6, 7, 8]
    assert mesh.point_sets["a"].tolist() == [0, 1, 2, 3] and len(mesh.point_sets["N"]) == 9


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_encodings_and_ends_of_lines(encoding: str, end: str, tmp_path: Path) -> None:
    """Fails if a mark at the beginning, UTF-16 or the ends of lines of other systems hide what is in a file."""
    text = f"*Heading\nGröße\n{PLATE}*Nset, nset=Größe\n1, 2\n".replace("\n", end)
    mark = "\ufeff" if encoding in ("utf-16-le", "utf-16-be") else ""
    mesh = read(tmp_path, (mark + text).encode(encoding))
    is_plate(mesh)
    assert mesh.point_sets["Größe"].tolist() == [0, 1]


# --- sets ---
@pytest.mark.parametrize(
    "text, nodes",
    [
        ("*NSET, NSET=s\n1, 2, 3\n", [0, 1, 2]),
        ("*NSET, NSET=s\n1, 2,\n3\n", [0, 1, 2]),
        ("*NSET, NSET=s\n3,\n", [2]),
        ("*NSET, NSET=s\n1\n*NSET, NSET=S\n2\n", [0, 1]),
        ("*NSET, NSET=s, GENERATE\n1, 3\n", [0, 1, 2]),
        ("*NSET, NSET=s, GENERATE\n1, 9, 4\n", [0, 4, 8]),
        ("*NSET, NSET=s, GENERATE\n1, 3\n7, 9, 2\n5, 5\n", [0, 1, 2, 4, 6, 8]),
        ("*NSET, NSET=s, generate\n1, 2, 1,\n", [0, 1]),
        ("*NSET, NSET=s, UNSORTED\n9, 1\n", [0, 8]),
        ("*NSET, NSET=s\n1, 2\n** 4, 5\n3\n", [0, 1, 2]),
        ("*NSET, NSET=a\n1\n*NSET, NSET=s\na, 3\n", [0, 2]),
        ("*NSET, NSET=s\nb, 3, A\n*NSET, NSET=A\n1\n*NSET, NSET=B\n2\n", [0, 1, 2]),
        ("*NSET, NSET=s, ELSET=all\n", list(range(9))),
        ("*ELSET, ELSET=e\n1\n*NSET, NSET=s, ELSET=e\n", [0, 1, 3, 4]),
        ("*NSET, NSET=s, INTERNAL, GENERATE\n1, 3, 2\n*NSET, NSET=s\n2\n", [0, 1, 2]),
        ("*NSET,\nNSET=s,\nGENERATE\n1, 3, 1\n", [0, 1, 2]),
        ("*NSET, NSET=s\n1, 1, 1\n", [0]),
    ],
)
def test_sets_of_nodes(text: str, nodes: list[int], tmp_path: Path) -> None:
    """Fails if members of a set are lost: a second line, keyword or range, of another set, after a comment."""
    mesh = read(tmp_path, PLATE + text)
    assert mesh.point_sets["s"].tolist() == nodes


def test_sets_of_elements(tmp_path: Path) -> None:
    """Fails if a set of elements is not that of its numbers, ranges and sets, over blocks of several types."""
    mesh = read(
        tmp_path,
        f"*Node\n{NODES}*Element, type=CPE4, elset=a\n1, 1, 2, 5, 4\n4, 5, 6, 9, 8\n*Element, type=CPS4R, elset=b\n"
        "3, 4, 5, 8, 7\n20, 2, 3, 6, 5\n*Elset, elset=odd, generate\n1, 3, 2\n*Elset, elset=_PickedSet5, internal\n"
        "20,\n*Elset, elset=c\nodd, 20\nb\n*Elset, elset=C\n4\n",
    )
    assert mesh.cells_dict["quad"].tolist() == CONN[[0, 3, 2, 1]].tolist()
    assert {name: members(mesh, name) for name in mesh.cell_sets} == {
        "a": [0, 1],
        "b": [2, 3],
        "odd": [0, 2],
        "_PickedSet5": [3],
        "c": [0, 1, 2, 3],
    }


@pytest.mark.parametrize(
    "text, part",
    [
        ("*NSET, NSET=s\n1, 2\n3, 99\n", "line 18: the set 's' has the node 99, which does not exist"),
        ("*NSET, NSET=s\nno\n", "line 17: the node set 'no' does not exist"),
        ("*NSET, NSET=s\ns, 1\n", "a part of itself"),
        ("*ELSET, ELSET=s\n5\n", "line 17: the set 's' has the element 5"),
        ("*NSET, NSET=s, GENERATE\n1, 1000000000000000, 1\n", "line 17: the set 's' has the node 10,"),
        ("*NSET, NSET=s, GENERATE\n1, 3, 0\n", "line 17: a line of GENERATE"),
        ("*NSET, NSET=s, GENERATE\n3, 1\n", "GENERATE"),
        ("*NSET, NSET=s, GENERATE\n5\n", "GENERATE"),
        ("*NSET, NSET=s, GENERATE\na, b\n", "line 17: 'a' is no whole number"),
        ("*NSET, NSET=s\n1.5\n", "line 17: '1.5' is no whole number"),
        ("*NSET\n1\n", "line 16: *NSET needs NSET="),
        ("*NSET, NSET=s, ELSET=t\n", "line 16: the element set 't' does not exist"),
        ("*NSET, NSET=s, INSTANCE=i\n1\n", "line 16: there is no instance 'i'"),
        ("*NSET, NSET=s\n1_1\n", "'1_1' does not exist"),
    ],
)
def test_sets_that_cannot_be(text: str, part: str, tmp_path: Path) -> None:
    """Fails if a set is cut down to what exists of it, or the line is not named."""
    assert part in refused(tmp_path, PLATE + text)


# --- surfaces ---
@pytest.mark.parametrize(
    "face, nodes", [("S1", [0, 1]), ("S2", [1, 4]), ("S3", [3, 4]), ("S4", [0, 3]), ("e1", [0, 1])]
)
def test_faces_of_quadrilaterals(face: str, nodes: list[int], tmp_path: Path) -> None:
    """Fails if a face of an element is another one."""
    own = sample(tmp_path, PLATE + f"*Surface, type=ELEMENT, name=side\n1, {face}\n")
    assert own.nodes("side").tolist() == nodes


@pytest.mark.parametrize(
    "face, nodes",
    [
        ("S1", [1, 2, 3, 4]),
        ("S2", [5, 6, 7, 8]),
        ("S3", [1, 2, 5, 6]),
        ("S4", [2, 3, 6, 7]),
        ("S5", [3, 4, 7, 8]),
        ("S6", [1, 4, 5, 8]),
    ],
)
def test_faces_of_bricks(face: str, nodes: list[int], tmp_path: Path) -> None:
    """Fails if a face of a brick is another one."""
    own = sample(tmp_path, BRICKS + f"*SURFACE, NAME=side\n1, {face}\n")
    assert (own.nodes("side") + 1).tolist() == nodes


def test_surfaces(tmp_path: Path) -> None:
    """Fails if a surface of sets, of free faces, of nodes, of others, or one named like a set, is lost or another."""
    own = sample(
        tmp_path,
        PLATE + "*Elset, elset=_t_S3, internal, generate\n3, 4\n*Elset, elset=lower\n1, 2\n"
        "*Surface, type=ELEMENT, name=t\n_t_S3, S3\n*Surface, name=around\nlower\n*Surface, name=n, type=node\n"
        "tip, 1.\n5\n*Nset, nset=tip\n9\n*Surface, name=both, combine=union\nt, around\n"
        "*Surface, name=tip\n1, S1\n2, S1\n*Surface, name=rigid, type=SEGMENTS\nSTART, 0, 0\n",
    )
    assert own.nodes("t").tolist() == [6, 7, 8] and own.nodes("around").tolist() == [0, 1, 2, 3, 5]
    assert own.nodes("n").tolist() == [4, 8] and own.nodes("both").tolist() == [0, 1, 2, 3, 5, 6, 7, 8]
    assert own.nodes("tip").tolist() == [8] and own.nodes("surface:tip").tolist() == [0, 1, 2]
    assert any("'surface:tip'" in note for note in own.notes)


def test_surfaces_inside_of_a_body_are_noted(tmp_path: Path) -> None:
    """Fails if a surface of a wrong side of its elements, which lies within the body, is held in silence."""
    mesh = read(tmp_path, PLATE + "*Elset, elset=upper, generate\n3, 4\n*Surface, name=top\nupper, S1\n")
    assert "the surface 'top' (line 18) has 2 face(s) S1 inside of the body, between two elements" in notes(mesh)
    assert "inside of the body" not in notes(read(tmp_path, PLATE + "*Surface, name=low\n1, S1\n2, S1\nall\n"))


def test_surfaces_of_a_tool(tmp_path: Path) -> None:
    """Fails if a rigid tool and its surface end the reading, or are left out in silence."""
    tool = "*Element, type=R2D2, elset=tool\n11, 10, 11\n*Surface, name=tool\ntool, SPOS\n"
    tool += "*Surface, name=t\nall\ntool, SPOS\n"
    mesh = read(tmp_path, PLATE.replace("*Element", "10, 0., 3.\n11, 2., 3.\n*Element") + tool)
    is_plate(mesh)
    assert len(mesh.cell_sets["t"][1]) == 8 and "tool" not in mesh.cell_sets
    for part in ("surface 'tool' (line 20) has 1 element(s) that are no body", "type R2D2 (line 18) are no body"):
        assert part in notes(mesh)


@pytest.mark.parametrize(
    "text, part",
    [
        ("*Surface, name=s\n1, S5\n", "line 17: elements of type CPE4 have no face 'S5'"),
        ("*Surface, name=s\n1, SPOS\n", "no face"),
        ("*Surface, name=s\n9, S1\n", "line 17: the set 's' has the element 9"),
        ("*Surface, name=s\nno, S1\n", "'no' does not exist"),
        ("*Surface, name=s, combine=difference\na, b\n", "COMBINE=DIFFERENCE"),
        ("*Surface, name=s, combine=union\nt\n", "the surface 't' does not exist"),
        ("*Surface, name=s, type=NODE\nno\n", "node set 'no'"),
        ("*Surface, name=s, crop=t\n0, 0\n", "CROP"),
    ],
)
def test_surfaces_that_cannot_be(text: str, part: str, tmp_path: Path) -> None:
    """Fails if a surface is left out in silence, or made of other faces."""
    assert part in refused(tmp_path, PLATE + text)


# --- parts and instances ---
PART = f"*PART, NAME=P\n{PLATE}*NSET, NSET=foot, GENERATE\n1, 3\n*SURFACE, NAME=lid\nall, S3\n*END PART\n"


def test_instances_of_one_part(tmp_path: Path) -> None:
    """Fails if an instance is not there, not at its place, or sets of it are those of another."""
    text = (
        "*ASSEMBLY, NAME=A\n*INSTANCE, NAME=P-1, PART=p\n*END INSTANCE\n*INSTANCE, NAME=P-2, PART=P\n 2., 0., 0.\n"
        "*END INSTANCE\n*Instance, name=P-3, part=P\n1., 0., 0.\n1., 0., 0., 1., 0., 5., 90.\n*End Instance\n"
        "*NSET, NSET=top, INSTANCE=P-1\n7, 8, 9\n*NSET, NSET=top, INSTANCE=P-2\n9\n*NSET, NSET=mix\n"
        "P-2.foot, top, P-1.5\n"
        "*ELSET, ELSET=e, INSTANCE=P-2\nall\n*SURFACE, NAME=s\ne, S1\nP-1.all, S4\n*END ASSEMBLY\n"
    )
    mesh = read(tmp_path, PART + text)
    assert len(mesh.points) == 27 and len(mesh.cells_dict["quad"]) == 12
    assert np.array_equal(mesh.points[9:18, :2], POINTS + np.array([2, 0]))
    assert np.array_equal(mesh.points[18:, :2], np.column_stack([1 - POINTS[:, 1], POINTS[:, 0]]))  # moved, then turned
    assert np.array_equal(mesh.cells_dict["quad"], np.concatenate([CONN, CONN + 9, CONN + 18]))
    assert mesh.point_sets["top"].tolist() == [6, 7, 8, 17] and mesh.point_sets["mix"].tolist() == [
        4,
        6,
        7,
        8,
        9,
        10,
        11,
        17,
    ]
    assert mesh.point_sets["P-2.foot"].tolist() == [9, 10, 11]
    assert mesh.point_sets["foot"].tolist() == [0, 1, 2, 9, 10, 11, 18, 19, 20]
    assert members(mesh, "e") == members(mesh, "P-2.all") == [4, 5, 6, 7] and len(members(mesh, "all")) == 12
    lines = mesh.cells_dict["line"]
    assert set(lines[mesh.cell_sets["s"][1]].ravel()) == {0, 1, 3, 4, 6, 7, 9, 10, 11, 12, 13, 14}
    assert set(lines[mesh.cell_sets["P-1.lid"][1]].ravel()) == {3, 4, 5, 6, 7, 8}
    assert "'foot' is that of the instances P-1, P-2, P-3 together" in notes(mesh)


def test_instances_of_two_parts(tmp_path: Path) -> None:
    """Fails if sets of one name in two parts are made one, or what belongs to an instance or the assembly is lost."""
    other = PART.replace("NAME=P", "NAME=Q").replace("NSET=foot, GENERATE\n1, 3", "NSET=foot, GENERATE\n1, 2")
    text = (
        '*ASSEMBLY, NAME=A\n*INSTANCE, NAME=p, PART=P\n*NSET, NSET=own\n1\n*END INSTANCE\n'
        '*INSTANCE, NAME="q 1", PART=Q\n3., 0.\n'
        '*END INSTANCE\n*NODE\n1, 9., 9., 9.\n*NSET, NSET=RP\n1,\n*NSET, NSET=x\n'
        '"q 1".foot\n*ELEMENT, TYPE=MASS\n1, 1\n'
        "*END ASSEMBLY\n*MATERIAL, NAME=rubber\n*STEP\n*BOUNDARY\nRP, 1\n*END STEP\n"
    )
    mesh = read(tmp_path, PART + other + PART.replace("NAME=P", "NAME=unused") + text)
    assert len(mesh.points) == 18 and mesh.point_sets["p.foot"].tolist() == [0, 1, 2]
    assert (
        mesh.point_sets["q 1.foot"].tolist() == mesh.point_sets["x"].tolist() == [9, 10]
        and "foot" not in mesh.point_sets
    )
    assert mesh.point_sets["own"].tolist() == [0] and "RP" not in mesh.point_sets
    for part in (
        "'RP' has only nodes that belong to no element",
        "'foot' is in the parts P, Q: it is called p.foot, q 1.foot",
        "part(s) unused have no instance",
        "1 element(s) of type MASS",
        "a deck says them",
    ):
        assert part in notes(mesh), part


@pytest.mark.parametrize(
    "text, part",
    [
        ("*INSTANCE, NAME=a, PART=no\n*END INSTANCE\n", "there is no part 'no'"),
        ("*INSTANCE, NAME=a\n", "*INSTANCE needs PART="),
        ("*INSTANCE, LIBRARY=old, INSTANCE=a\n", "instance of an earlier analysis"),
        ("*INSTANCE, NAME=a, PART=P\n*END INSTANCE\n" * 2, "instance 'a' is given twice"),
        ("*INSTANCE, NAME=a, PART=P\n1, 2, 3, 4\n*END INSTANCE\n", "placed by a line of 3 and one of 7"),
        (
            "*INSTANCE, NAME=a, PART=P\n0,0,0\n1,1,1,1,1,1,90\n*END INSTANCE\n",
            "points on the axis of its rotation are one",
        ),
        ("*INSTANCE, NAME=a, PART=P\n1, x\n*END INSTANCE\n", "'x' is no finite number"),
        ("*INSTANCE, NAME=a, PART=P\n", "*END INSTANCE"),
        (PART, "part 'P' is given twice"),
        (PART.replace("NAME=P", "NAME=Q"), "parts P, Q, and no *INSTANCE"),
        ("*PART, NAME=R\n", "no *END PART"),
    ],
)
def test_parts_that_cannot_be(text: str, part: str, tmp_path: Path) -> None:
    """Fails if a part that is not complete or not placed is left out in silence."""
    assert part in refused(tmp_path, PART + text)


def test_a_part_without_an_instance(tmp_path: Path) -> None:
    """Fails if the only part of a file is lost because nothing places it."""
    mesh = read(tmp_path, PART)
    is_plate(mesh)
    assert "part 'P' has no *INSTANCE" in notes(mesh) and mesh.point_sets["foot"].tolist() == [0, 1, 2]


# --- files in files ---
def test_files_in_files(tmp_path: Path) -> None:
    """Fails if a file that is included is not read at its place: keywords, bare data lines, or both, levels deep."""
    mesh = read(
        tmp_path,
        "*HEADING\nplate\n*NODE\n*INCLUDE, INPUT=nodes.inp\n*Include, input=parts\\elements.inp\n"
        "*NSET, NSET=a\n1\n*INCLUDE, INPUT=more.txt\n3\n",
        nodes_inp=NODES,
        parts__elements_inp="*ELEMENT, TYPE=CPE4, ELSET=all, INPUT=rows.dat\n3, 4, 5, 8, 7\n4, 5, 6, 9, 8\n",
        parts__rows_dat="1, 1, 2, 5, 4\n2, 2, 3, 6, 5\n",
        more_txt="2\n*NSET, NSET=b\n7\n",
    )
    is_plate(mesh)
    assert mesh.point_sets["a"].tolist() == [0, 1] and mesh.point_sets["b"].tolist() == [2, 6]
    line = refused(tmp_path, "*NODE\n*INCLUDE, INPUT=nodes.inp\n", nodes_inp=NODES + "10, x, 2\n")
    assert "line 10 of nodes.inp: 'x' is no finite number" in line


@pytest.mark.parametrize(
    "name, part",
    [
        ("body.inp", "includes itself"),
        ("no.inp", "is not there"),
        ("../out.inp", "not in the folder"),
        ("/etc/passwd", "not in the folder"),
        ("/dev/zero", "not in the folder"),
        ("link.inp", "not in the folder"),
        ("", "needs INPUT="),
        ("sub", "is not there"),
        ("a" * 5000, "is not there"),
        ("again.inp", "includes itself"),
    ],
)
def test_files_that_are_not_included(name: str, part: str, tmp_path: Path) -> None:
    """Fails if a file outside of the folder is opened, a loop is followed, or what is not there is passed over."""
    folder = tmp_path / "folder"
    (folder / "sub").mkdir(parents=True)
    (tmp_path / "out.inp").write_text("*NSET, NSET=secret\n1\n")
    (folder / "link.inp").symlink_to(tmp_path / "out.inp")
    line = refused(folder, PLATE + f"*INCLUDE, INPUT={name}\n", again_inp="*INCLUDE, INPUT=body.inp\n")
    assert part in line and "line 16" in line.replace("line 1 of again.inp", "line 16"), line


def test_size_of_all_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Fails if the bound of size is one of each file, or files may be nested without end."""
    monkeypatch.setattr(bounds, "LARGEST", 2000)
    assert "too large together" in refused(tmp_path, PLATE + "*INCLUDE, INPUT=a.inp\n" * 9, a_inp="** long\n" * 30)
    monkeypatch.undo()
    deep = {f"f{k}_inp": f"*INCLUDE, INPUT=f{k + 1}.inp\n" for k in range(20)}
    assert "within one another" in refused(tmp_path, PLATE + "*INCLUDE, INPUT=f0.inp\n", **deep)


# --- what is not read, and what is broken ---
def test_what_is_not_read_is_named(tmp_path: Path) -> None:
    """Fails if what joins or moves parts is passed over in silence, or each material is worth a note."""
    mesh = read(
        tmp_path,
        PLATE + "*TIE, NAME=t\na, b\n*MATERIAL, NAME=m\n*MATERIAL, NAME=n\n*Mpc\nBEAM, 1, 2\n*Equation\n2\n1,1,1.\n"
        "*CONTACT PAIR\n*Rigid Body, ref node=1, elset=all\n*IMPERFECTION, FILE=x\n*Output, field\n*Node output\nU\n"
        "*ELEMENT OUTPUT\nS\n*SOLID SECTION, ELSET=all, MATERIAL=m\n1.\n*Node print\nU\n",
    )
    is_plate(mesh)
    for word in ("*TIE is not read (line 16)", "*MPC", "*EQUATION", "*CONTACTPAIR", "*RIGIDBODY", "*IMPERFECTION"):
        assert word in notes(mesh)
    assert len(mesh.info["notes"]) == 7


@pytest.mark.parametrize(
    "text, part",
    [
        ("*NODE\n1, 0., nan\n", "line 2: 'nan' is no finite number"),
        ("*NODE\n1, 0., 0.\n2, inf, 0\n", "line 3: 'inf'"),
        ("*NODE\n1, 0, 1e999\n", "line 2: '1e999'"),
        ("*NODE\n1, 0, 1_0\n", "line 2: '1_0'"),
        ("*NODE\n1.5, 0, 0\n", "no number of a node"),
        ("*NODE\n-1, 0, 0\n", "line 2: -1 is no number of a node"),
        ("*NODE\nx, 0, 0\n", "line 2: 'x'"),
        ("*NODE\n1, 0, 0\n1, 1, 0\n", "node 1 is given twice, at two places"),
        ("*NODE\n1e30, 0, 0\n", "no "),
        ("*NODE\n1, 0, 0\n", "no *ELEMENT"),
        ("*HEADING\nx\n", "no *NODE"),
        ("*", "no *NODE"),
        ("**\n", "no *NODE"),
        (f"*NODE\n{NODES}*ELEMENT\n{QUADS}", "line 11: *ELEMENT needs TYPE="),
        (PLATE + "5, 1, 2, 5\n", "line 16: element 5 has 3 nodes; one of type CPE4 has 4"),
        (PLATE + "5, 1, 2, 5\n6, 1, 2, 5, 4\n", "line 16: element 5 has 3 nodes"),
        (PLATE + "5, 1, 2,\n5\n", "line 17: element 5 has 3 nodes"),
        (PLATE + "5, 1, 2, 5, 4, 3\n", "line 16: element 5 has 5 nodes"),
        (PLATE + "5, 1, 2, 5, 99\n", "line 11: element 5 has the node 99, which does not exist"),
        (PLATE + "5, 1, 2, x, 4\n", "line 16: 'x' is no whole number"),
        (PLATE + "1, 1, 2, 5, 4\n", "element 1 is given twice: delete one of its lines"),
        (PLATE + "5, 1, 2, 99999999999999999999, 4\n", "line 16:"),
        (PLATE + "*PARAMETER\na = 1\n", "*PARAMETER is not read"),
        (PLATE + "*ELEMENT, TYPE=U1\n7, 1, 2\n*USER ELEMENT, TYPE=U1, NODES=x\n", "number of NODES"),
        (PLATE + "*NGEN\n1, 9, 0\n", "*NGEN takes"),
        (PLATE + "*NGEN\n1, 99\n", "nodes that exist"),
        (PLATE + "*ELGEN\n1, 1000000000\n", "line 16: it asks for more than 5,000,000 nodes and elements"),
        (PLATE + "*ELGEN\n77, 2\n", "*ELGEN copies an element that exists"),
        ("*NODE\n1, 0, 0\n*ELEMENT, TYPE=MASS\n1, 1\n", "no elements of a plane or solid body, only MASS"),
        ("a heading\n" + PLATE, "no keyword file"),
        ("*NODE\n\0\0\0\n", "line 2"),
    ],
)
def test_broken_files(text: str, part: str, tmp_path: Path) -> None:
    """Fails if a broken file is read as another one, or the line of what is wrong is not said."""
    started = time.process_time()
    assert part in refused(tmp_path, text)
    assert time.process_time() - started < 5


def test_every_beginning_of_a_file(tmp_path: Path) -> None:
    """Fails if a file that was cut short is a traceback."""
    text = PART + (
        "*ASSEMBLY, NAME=A\n*INSTANCE, NAME=a, PART=P\n1., 2., 0.\n*END INSTANCE\n*NSET, NSET=n, INSTANCE=a\n"
        "1, 2\n*SURFACE, NAME=s\na.all, S1\n*END ASSEMBLY\n"
    )
    for end in range(0, len(text), 3):
        try:
            read(tmp_path, text[:end])
        except MeshError as error:
            assert "\n" not in str(error) and "damaged" not in str(error), (text[:end], error)


def test_files_of_meshio(tmp_path: Path) -> None:
    """Fails if the plane meshes that meshio writes, all as CAX4P, are refused as axisymmetric."""
    cells = [("quad", CONN), ("line", np.array([[0, 1], [1, 2]]))]
    sets = {"half": [np.array([0, 2]), np.zeros(0, int)], "foot": [np.zeros(0, int), np.array([0, 1])]}
    meshio.Mesh(POINTS, cells, cell_sets=sets).write(tmp_path / "body.inp", "abaqus")
    mesh = read_mesh_file(tmp_path / "body.inp")
    is_plate(mesh)
    assert members(mesh, "half") == [0, 2] and "meshio wrote the file" in notes(mesh)
    assert file_sample(tmp_path / "body.inp").nodes("foot").tolist() == [0, 1, 2]


def test_speed(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Fails if a mesh of 90 000 nodes takes more than 3 s (it takes 0.3 s): one of a million is to take 10 s."""
    caplog.set_level(logging.ERROR)
    n = 300
    ids = np.arange(1, n * n + 1).reshape(n, n)
    nodes = "\n".join(f"{k + 1}, {k % n:.6f}, {k // n:.6f}" for k in range(n * n))
    rows = np.column_stack(
        [
            np.arange(1, (n - 1) ** 2 + 1),
            ids[:-1, :-1].ravel(),
            ids[:-1, 1:].ravel(),
            ids[1:, 1:].ravel(),
            ids[1:, :-1].ravel(),
        ]
    )
    elements = "\n".join(", ".join(map(str, row)) for row in rows.tolist())
    path = tmp_path / "body.inp"
    path.write_text(f"*NODE\n{nodes}\n*ELEMENT, TYPE=CPE4\n{elements}\n*NSET, NSET=a, GENERATE\n1, {n}\n")
    started = time.process_time()
    mesh = read_mesh_file(path)
    assert time.process_time() - started < 3
    assert len(mesh.points) == n * n and np.array_equal(mesh.cells_dict["quad"] + 1, rows[:, 1:])
