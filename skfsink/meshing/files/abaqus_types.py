"""Types of elements of Abaqus: which cells they are, what they stand for, and the nodes of their faces."""

from __future__ import annotations

import re

__all__ = ["AXISYMMETRIC", "FACES", "ORDER", "PLANE_STRESS", "REFUSED", "REVOLVED", "SHELL", "SIZE", "cell_of"]

#: cell, and the form of the types of it
CELLS = (
    ("quad", r"(CPE|CPS|CPEG|CGPE|CAX|M3D|DC2D|AC2D)4[A-Z]*|S4(R5|RSW|RS|RT?|T)?|DS4|SFM3D4R?"),
    ("quad8", r"(CPE|CPS|CPEG|CGPE|CAX|M3D|DC2D|AC2D)8[A-Z]*|S8R(5|T)?|DS8|SFM3D8R?"),
    ("quad9", r"M3D9R?|S9R5"),
    ("triangle", r"(CPE|CPS|CPEG|CGPE|CAX|M3D|DC2D|AC2D)3[A-Z]*|S3(RS|RT?|T)?|STRI3|DS3|SFM3D3"),
    ("triangle6", r"(CPE|CPS|CPEG|CGPE|CAX|M3D|DC2D|AC2D)6[A-Z]*|STRI65|DS6|SFM3D6"),
    ("hexahedron", r"(C3D|DC3D|AC3D)8[A-Z]*|SC8RT?|CSS8|DCC3D8D?"),
    ("hexahedron20", r"(C3D|DC3D|AC3D)20[A-Z]*"),
    ("hexahedron27", r"C3D27[A-Z]*"),
    ("tetra", r"(C3D|DC3D|AC3D)4[A-Z]*"),
    ("tetra10", r"(C3D|DC3D|AC3D)10[A-Z]*"),
    ("wedge", r"(C3D|DC3D|AC3D)6[A-Z]*|SC6RT?"),
    ("wedge15", r"(C3D|DC3D|AC3D)15[A-Z]*"),
    ("pyramid", r"(C3D|AC3D)5[A-Z]*"),
)
PLANE_STRESS = re.compile(r"CPS\d")
REVOLVED = re.compile(r"CAX\d")
SHELL = re.compile(r"S\d|STRI|M3D|SFM3D|DS\d")
AXISYMMETRIC = re.compile(r"(CAX|CGAX|SAX|MAX|MGAX|SFMAX|SFMGAX|DCAX|DCCAX|ACAX|DSAX|SAXA|CAXA|COHAX|RAX|GKAX|"
                          r"CINAX|ACINAX|WARP)")
#: what it is that cannot be computed
REFUSED = (
    (re.compile(r"COH"), "cohesive elements: the sink makes cracks without them; leave them out and join the nodes"),
    (re.compile(r"(CIN|ACIN)"), "infinite elements: end the body where it ends"),
    (re.compile(r"EC3D"), "Eulerian elements: save the mesh of the body"),
    (re.compile(r"(PC3D|PD3D)"), "particles: save the mesh of the body"),
    (re.compile(r"(GK|EMC|EMH|FC3D|CGCAX)"), "no elements of a solid body: save the mesh of one"),
    (re.compile(r"Z\d"), "a substructure: save the mesh of the body"),
)
#: trusses, beams and rigid lines, whose first two nodes may be an edge of the body
LINE = re.compile(r"(T[23]D[23]|B[23][1-4]|R2D2|RB[23]D2|PIPE[23][12]|ELBOW|FRAME|DC1D|AC1D|SFMCL)")
RIGID_FACE = re.compile(r"R3D[34]")
#: springs, masses, connectors, …
NO_BODY = re.compile(r"(SPRING|DASHPOT|MASS|ROTARYI|HEATCAP|CONN|DCOUP|DISTCOUP|GAP|ITS|ITT|JOINT|ISL|IRS|PSI|DRAG|"
                     r"CAPS|F[23]D|FP2D|ASI|FRIC|LS[36]|TSHEAR|DGAP)")

_HEX = ("1234", "5876", "1562", "2673", "3784", "4851")
_TETRA = ("123", "142", "243", "341")
_WEDGE = ("123", "465", "1452", "2563", "3641")
#: corners of the faces S1, S2, … of a cell without its middle nodes, by number from 0
FACES = {kind: [[int(c) - 1 for c in face] for face in faces] for kind, faces in {
    "quad": ("12", "23", "34", "41"), "triangle": ("12", "23", "31"), "hexahedron": _HEX, "tetra": _TETRA,
    "wedge": _WEDGE, "pyramid": ("1234", "152", "253", "354", "451")}.items()}
#: nodes of a cell
SIZE = {"line": 2, "quad": 4, "quad8": 8, "quad9": 9, "triangle": 3, "triangle6": 6, "hexahedron": 8,
        "hexahedron20": 20, "hexahedron27": 27, "tetra": 4, "tetra10": 10, "wedge": 6, "wedge15": 15, "pyramid": 5}
#: nodes of Abaqus in the order of meshio, where that is another one
ORDER = {"hexahedron27": [*range(20), 26, 24, 23, 25, 21, 22, 20]}


def cell_of(name: str) -> str | None:
    """The cell that an element of a type in capitals is: None if it is not known, "" if it is no body.

    "line" is an element that is no body itself, but may be an edge of one.
    """
    if NO_BODY.match(name):
        return ""
    if LINE.match(name):
        return "line"
    if RIGID_FACE.match(name):
        return ""
    return next((cell for cell, form in CELLS if re.fullmatch(form, name)), None)
