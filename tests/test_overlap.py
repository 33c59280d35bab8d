"""Faces that pass through each other are found, and how deep; faces that do not are let alone."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import grid

from skfsink.fem.space import Space
from skfsink.run.observers.overlap import overlap

WIDTH = 0.02   # of the slit [mm]
N = 10         # elements along 1 mm


def slit(kind: str, width: float = WIDTH, coarse: bool = False) -> Space:
    """Unit square or cube with a slit half through at y = 1/2; `coarse`: its upper lip has no nodes of the lower."""
    mesh = grid(kind, (N, N, 4)[:2 if kind == "quad" else 3])
    points, cells = mesh.p.copy(), mesh.t.copy()
    lip = np.flatnonzero((np.abs(points[1] - 0.5) < 1e-9) & (points[0] < 0.5 - 1e-9))
    new = np.full(points.shape[1], -1)
    new[lip] = points.shape[1] + np.arange(len(lip))
    above = points[1][cells].mean(axis=0) > 0.5
    moved = new[cells]
    cells = np.where(above & (moved >= 0), moved, cells)
    upper = points[:, lip].copy()
    points[1, lip] -= width / 2
    upper[1] += width / 2
    if coarse:
        upper[0] *= 0.93
    return Space(type(mesh)(np.hstack([points, upper]), cells))


def close(space: Space, by: float) -> np.ndarray:
    """Displacement (n, dim) that lowers the upper half by `by` [mm] left of the tip, and less to the right of it."""
    above = space.X[:, 1] > 0.5 + 1e-9
    u = np.zeros_like(space.X)
    u[above, 1] = -by * np.clip((1 - space.X[above, 0]) / 0.6, 0, 1)
    return u


def intact(space: Space) -> tuple[np.ndarray, np.ndarray]:
    return np.ones(space.n_nodes), np.zeros(space.n_elements, bool)


def rotation(dim: int) -> np.ndarray:
    """Of no special angle (dim, dim)."""
    q = np.linalg.qr(np.random.default_rng(1).normal(size=(dim, dim)))[0]
    q[:, 0] *= np.sign(np.linalg.det(q))
    return q


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("coarse", [False, True])
@pytest.mark.parametrize("depth", [0.012, 0.03, 0.17])
def test_the_depth_of_plane_faces(kind: str, depth: float, coarse: bool, turned: bool) -> None:
    """Fails if the overlap of a slit that is pressed shut is missed or its depth wrong, of a body that has turned too,
    and where it is more than an element deep."""
    space = slit(kind, coarse=coarse)
    x = space.X + close(space, WIDTH + depth)
    if turned:
        x = x @ rotation(space.dim).T + 3.0
    found = overlap(space, x - space.X, *intact(space))
    assert found is not None
    assert found.depth == pytest.approx(depth, rel=1e-6)
    assert found.place[0] <= 0.4 + 1e-9 and abs(found.place[1] - 0.5) <= WIDTH / 2 + 1e-9
    assert found.inside >= (3 if kind == "quad" else 15)


@pytest.mark.parametrize("by", [-0.3, 0.0, 0.5 * WIDTH, 0.999 * WIDTH, WIDTH, WIDTH + 1e-3])
def test_faces_that_only_come_near_are_let_alone(kind: str, by: float) -> None:
    """Fails if a slit that opens, closes nearly, or just touches is taken for one whose faces have passed."""
    space = slit(kind)
    assert overlap(space, close(space, by), *intact(space)) is None


def test_lips_that_lie_on_each_other(kind: str) -> None:
    """Fails if a crack without width is taken for an overlap, or its faces may pass each other."""
    space = slit(kind, width=0.0)
    assert overlap(space, np.zeros_like(space.X), *intact(space)) is None
    above = np.zeros(space.n_nodes, bool)
    above[space.conn[space.X[space.conn].mean(axis=1)[:, 1] > 0.5]] = True
    u = np.zeros_like(space.X)
    u[above, 1] = -0.05 * np.clip((1 - space.X[above, 0]) / 0.6, 0, 1)
    u[above & (np.abs(space.X[:, 1] - 0.5) < 1e-9) & (space.X[:, 0] > 0.5 - 1e-9)] = 0.0  # the tip is in one piece
    found = overlap(space, u, *intact(space))
    assert found is not None and found.depth == pytest.approx(0.05, rel=1e-6)


def test_lips_of_a_crack_of_failed_elements(kind: str) -> None:
    """Fails if the surface is only that of the mesh, or elements that failed or are spent count as the body."""
    space = Space(grid(kind, (N, N, 2)[:2 if kind == "quad" else 3]))
    middle = space.X[space.conn].mean(axis=1)
    deleted = (middle[:, 0] < 0.5) & (np.abs(middle[:, 1] - 0.55) < 0.04)
    gamma = np.ones(space.n_nodes)
    above = space.X[:, 1] > 0.55
    u = np.zeros_like(space.X)
    u[above, 1] = -0.13 * np.clip((1 - space.X[above, 0]) / 0.6, 0, 1)
    found = overlap(space, u, gamma, deleted)
    assert found is not None and found.depth == pytest.approx(0.03, rel=1e-6)
    assert overlap(space, u / 2, gamma, deleted) is None
    gamma[space.conn[deleted]] = 0.3  # the lips are softened: what is left are faces two elements further apart
    assert overlap(space, u, gamma, deleted) is None


def test_inverted_elements_are_no_overlap(kind: str) -> None:
    """Fails if a live element turned inside out at the surface, or a dead one that flies, is taken for passed faces."""
    space = slit(kind)
    gamma, deleted = intact(space)
    u = np.zeros_like(space.X)
    node = int(np.argmin(np.abs(space.X - [0.2, 0.0, 0.5][:space.dim]).sum(axis=1)))
    u[node, 1] = 0.25  # on the lower edge, through the element above it and into the next one
    assert overlap(space, u, gamma, deleted) is None
    deleted[:] = (space.conn == node).any(axis=1)
    u[node] = 0.4
    assert overlap(space, u, gamma, deleted) is None


def test_round_notch_and_bent_bodies_are_let_alone() -> None:
    """Fails if the concave side of a curved face counts as an overlap: a strip bent to an open and to a closed ring."""
    space = Space(grid("quad", (60, 4), (2 * np.pi, 0.4)))
    for turn, passed in ((0.5, False), (0.98, False), (1.05, True)):
        angle, radius = turn * space.X[:, 0], 1.0 + space.X[:, 1]
        x = np.column_stack([radius * np.sin(angle), radius * np.cos(angle)])
        assert (overlap(space, x - space.X, *intact(space)) is not None) is passed


def test_nothing_left_of_the_body(kind: str) -> None:
    """Fails if a body of which all has failed is an error."""
    space = slit(kind)
    assert overlap(space, np.zeros_like(space.X), np.zeros(space.n_nodes), np.ones(space.n_elements, bool)) is None
