"""Meshes whose elements do not match along their sides are refused; slits are noted, and sound meshes pass."""

from __future__ import annotations

import numpy as np
import pytest
import skfem
from bodies import grid
from test_overlap import slit

from skfsink.errors import MeshError
from skfsink.fem.space import Space
from skfsink.meshing.files.unmatched import check_sides, slit_note


def stacked(dim: int, lower: np.ndarray, upper: np.ndarray, across: np.ndarray) -> Space:
    """A body of two layers of elements, between lines x of their own, which share the nodes where these coincide."""
    points: dict[tuple[float, ...], int] = {}
    cells = []

    def box(x: np.ndarray, y: float, z: np.ndarray) -> None:
        make = skfem.MeshQuad if dim == 2 else skfem.MeshHex
        mesh = make.init_tensor(x, np.array([y, y + 0.1]), *([z] if dim == 3 else []))
        number = [points.setdefault(tuple(np.round(p, 9).tolist()), len(points)) for p in mesh.p.T]
        cells.append(np.array(number)[mesh.t])

    box(lower, 0.0, across[[0, -1]])
    box(upper, 0.1, across)
    make = skfem.MeshQuad if dim == 2 else skfem.MeshHex
    return Space(make(np.array(list(points)).T, np.hstack(cells)))


EVEN = np.linspace(0, 1, 5)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize(("upper", "count"), [
    (np.linspace(0, 1, 9), 4), (np.linspace(0, 1, 13), 8), (np.array([0, 0.25, 0.4, 0.5, 0.75, 1]), 1)])
def test_a_finer_mesh_on_a_coarser_one_is_refused(dim: int, upper: np.ndarray, count: int) -> None:
    """Fails if nodes in the middle of sides, at all of them or at a single one, leave a body open in silence."""
    sides = np.array([0.0, 0.1])
    check_sides("even", stacked(dim, EVEN, EVEN, sides))
    with pytest.raises(MeshError, match=rf"mesh fine: {count * (dim - 1)} node.s. lie in sides of elements"):
        check_sides("fine", stacked(dim, EVEN, upper, sides))


def test_faces_cut_both_ways_are_refused() -> None:
    """Fails if the node in the middle of a face, on none of its edges, is missed."""
    fine = stacked(3, EVEN, np.linspace(0, 1, 9), np.array([0.0, 0.05, 0.1]))
    with pytest.raises(MeshError, match=r"mesh fine: 17 node.s. lie in sides"):  # 9 x 3, of which 5 x 2 are shared
        check_sides("fine", fine)


def test_elements_on_top_of_others_are_refused() -> None:
    """Fails if elements that lie on others, and share their corners, are counted as more of the body."""
    mesh = grid("quad", (4, 4))
    large = [int(np.argmin(np.hypot(*(mesh.p - [[x], [y]])))) for x, y in ((0, 0), (0, 0.5), (0.5, 0.5), (0.5, 0))]
    with pytest.raises(MeshError, match="elements lie on top of others"):
        check_sides("double", Space(skfem.MeshQuad(mesh.p, np.column_stack([mesh.t, large]))))


@pytest.mark.parametrize("kind", ["quad", "hexahedron"])
def test_slits_pass_and_closed_ones_are_noted(kind: str) -> None:
    """Fails if a slit is refused, whether the nodes of its lips match or not, or if one of no width is not noted."""
    for width, coarse in ((0.02, False), (0.0, False), (0.0, True)):
        space = slit(kind, width, coarse)
        check_sides("slit", space)
        note = slit_note(space)
        lips = 5 * (1 if kind == "quad" else 5)
        assert note.startswith(f"{lips} pair(s) of nodes coincide, between (0, 0.5") == (not width and not coarse)
    assert slit_note(Space(grid(kind, (3, 3, 2)[:2 if kind == "quad" else 3]))) == ""


@pytest.mark.parametrize("dim", [2, 3])
def test_a_side_of_three_elements_is_refused(dim: int) -> None:
    """Fails if an element that lies on others, with a corner of its own, is counted as more of the body."""
    mesh = grid({2: "quad", 3: "hex"}[dim], (4,) * dim)
    own = mesh.t[:, np.abs(mesh.p[:, mesh.t].mean(axis=1) - 0.6).max(axis=0).argmin()].copy()  # an inner element
    far = mesh.p[:, own].sum(axis=0).argmax()
    corner, own[far] = mesh.p[:, own[far]] + 0.07, mesh.p.shape[1]
    over = type(mesh)(np.column_stack([mesh.p, corner]), np.column_stack([mesh.t, own]))
    check_sides("plain", Space(mesh))
    with pytest.raises(MeshError, match=rf"mesh over: {dim} {'edges' if dim == 2 else 'faces'} are shared by more"):
        check_sides("over", Space(over))
