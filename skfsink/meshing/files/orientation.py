"""Elements numbered in the other sense: turned where nothing but the numbering is the other way round."""

from __future__ import annotations

import meshio
import numpy as np

__all__ = ["oriented"]

#: the numbering of the mirror image, with the same first node; facets, in an order that turns round with the element
TURNED = {"quad": [0, 3, 2, 1], "hexahedron": [0, 3, 2, 1, 4, 7, 6, 5]}
FACETS = {"quad": [[0, 1], [1, 2], [2, 3], [3, 0]],
          "hexahedron": [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]}
#: reference coordinates of the corners
CORNERS = {"quad": np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])}
CORNERS["hexahedron"] = np.array([[*corner, level] for level in (-1, 1) for corner in CORNERS["quad"].tolist()])


def oriented(mesh: meshio.Mesh) -> meshio.Mesh:
    """Turn quadrilaterals that run clockwise, and hexahedra that are mirror images, with a note in `info["notes"]`.

    gmsh and Abaqus number elements so where the normal of a surface points away. An element is turned if its
    Jacobian is negative at all Gauss points, and only if it then lies beside its neighbours: where one was folded over
    another, all are left as they are, to be refused. Elements of other kinds are left alone.

    Parameters
    ----------
    mesh: with finite coordinates and nodes that exist; its blocks are changed in place.
    """
    kind = next((kind for kind in ("hexahedron", "quad") if len(mesh.cells_dict.get(kind, ()))), "")
    blocks = [block for block in mesh.cells if block.type == kind]
    if not blocks:
        return mesh
    cells = np.concatenate([block.data for block in blocks]).astype(np.int64)
    other = _mirrored(np.asarray(mesh.points, float), cells, kind)
    if not other.any():
        return mesh
    cells[other] = cells[other][:, TURNED[kind]]
    if not other.all() and _folded(cells, kind):
        return mesh
    for block, data in zip(blocks, np.split(cells, np.cumsum([len(block.data) for block in blocks])[:-1])):
        block.data = data
    mesh.info = mesh.info or {}
    what = "quadrilaterals ran clockwise" if kind == "quad" else "hexahedra were mirror images"
    mesh.info.setdefault("notes", []).append(f"{int(other.sum())} of {len(cells)} {what} and were turned")
    return mesh


def _mirrored(points: np.ndarray, cells: np.ndarray, kind: str) -> np.ndarray:
    """Which elements have a negative Jacobian at every Gauss point, (ne,)."""
    corners, dim = CORNERS[kind], 2 if kind == "quad" else 3
    found = np.ones(len(cells), bool)
    for place in corners / np.sqrt(3.0):
        factor = (1 + corners * place) / 2
        slope = [corners[:, k] / 2 * np.delete(factor, k, axis=1).prod(axis=1) for k in range(dim)]
        J = np.array([[sum(points[cells[:, a], i] * s[a] for a in range(len(corners))) for i in range(dim)]
                      for s in slope])
        found &= np.linalg.det(np.moveaxis(J, 2, 0)) < 0
    return found


def _folded(cells: np.ndarray, kind: str) -> bool:
    """Whether two elements lie on the same side of a facet that they share."""
    facets = np.concatenate([cells[:, corners] for corners in FACETS[kind]])
    if (n := facets.shape[1]) > 2:  # a face may begin at any node; an edge has its sense in its order
        first = facets.argmin(axis=1)
        facets = facets[np.arange(len(facets))[:, None], (first[:, None] + np.arange(n)) % n]  # least node first
    return len(np.unique(facets, axis=0)) < len(facets)
