"""Rendered bodies: in place and to scale, without dead material, whatever spent nodes do; and without pyvista."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from bodies import grid

from skfsink.errors import MissingExtra
from skfsink.fem.space import Space
from skfsink.pictures import render as module
from skfsink.pictures.plot import GAMMA_MAP
from skfsink.pictures.render import SPEED_MAP, Camera, bounds, render, surface
from skfsink.results.frame import Frame

FRONT = Camera((0.0, 0.0, 1.0))
WIDTH = 240


@pytest.fixture(scope="module")
def block() -> Space:
    """4 x 2 x 0.2 mm."""
    return Space(grid("hex", (48, 24, 2), (4.0, 2.0, 0.2)))


def frame(space: Space, tip: float = -9.0, wild: float = 0.0, opening: float = 0.0) -> Frame:
    """A crack at x = 2 from the lower edge to y = `tip`."""
    across, ahead = np.abs(space.X[:, 0] - 2), np.maximum(space.X[:, 1] - tip, 0)
    gamma = np.maximum(1 - np.exp(-np.hypot(np.maximum(across - 0.1, 0), ahead) / 0.1), 1e-15)
    u = np.zeros_like(space.X)
    u[:, 0] = opening * np.sign(space.X[:, 0] - 2)
    spent = gamma < 1e-2
    u[spent] = wild * np.random.default_rng(0).normal(size=(int(spent.sum()), 3))
    v = np.broadcast_to([3e3, 0.0, 4e3], space.X.shape)
    return Frame(0.0, "", u, gamma, (gamma[space.conn] < 1e-6).all(axis=1), v)


def box(space: Space) -> np.ndarray:
    return np.array([[-0.5, -0.5], [4.5, 2.5]])


def white(picture: np.ndarray) -> np.ndarray:
    return np.asarray((picture == 255).all(axis=2))


# --- the projection ---
def test_the_camera_projects_to_scale() -> None:
    """Fails if a direction is mirrored: looking along -z with y up, x is to the right."""
    np.testing.assert_allclose(FRONT.axes, np.eye(3), atol=1e-15)
    camera = Camera((-0.75, 1.0, -0.4))
    np.testing.assert_allclose(camera.axes @ camera.axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(camera.axes) == pytest.approx(1.0)
    assert camera.project(np.array([0.0, 1.0, 0.0]))[1] > 0 and camera.project(np.array([0.0, 0.0, 1.0]))[0] > 0
    np.testing.assert_allclose(FRONT.project(np.array([[1.0, 2.0, 3.0]])), [[1.0, 2.0]])


def test_bounds_leave_out_spent_nodes(block: Space) -> None:
    for wild in (0.0, 100.0):
        np.testing.assert_allclose(bounds(block, [frame(block, 1.0, wild)], FRONT, margin=0.0),
                                   [[0.0, 0.0], [4.0, 2.0]], atol=1e-12)
    np.testing.assert_allclose(bounds(block, [frame(block)], FRONT, 0.1), [[-0.4, -0.4], [4.4, 2.4]], atol=1e-12)


def test_without_pyvista_the_extra_is_named(block: Space, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(MissingExtra, match=r'need pyvista: pip install "skfsink\[view\]"'):
        render(block, frame(block), FRONT, box(block), WIDTH)


@pytest.mark.slow
def test_no_run_imports_pyvista() -> None:
    code = ("import sys, skfsink.cases.dog_bone, skfsink.results.reference, skfsink.pictures.render; "
            "sys.exit(any(name in sys.modules for name in ('pyvista', 'vtk', 'vtkmodules')))")
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# --- pictures ---
def test_an_intact_block_is_where_it_belongs(block: Space) -> None:
    """Fails if the scale, the place or the colour of the picture is wrong."""
    pytest.importorskip("pyvista")
    picture = render(block, frame(block), FRONT, box(block), WIDTH)
    assert picture.shape == (WIDTH * 3 // 5, WIDTH, 3) and picture.dtype == np.uint8
    rows, columns = np.nonzero(~white(picture))
    scale = WIDTH / 5.0
    assert np.abs([columns.min(), columns.max() + 1] - scale * np.array([0.5, 4.5])).max() <= 1
    assert np.abs([rows.min(), rows.max() + 1] - scale * np.array([0.5, 2.5])).max() <= 1
    inside = picture[rows.min() + 3:rows.max() - 3, columns.min() + 3:columns.max() - 3].astype(float)
    intact = 255 * np.array(GAMMA_MAP(1.0)[:3])
    assert np.abs(inside - inside.mean(axis=(0, 1))).max() < 3  # even, without lines of the mesh
    assert np.abs(inside.mean(axis=(0, 1)) / intact - 0.95).max() < 0.1


def test_the_crack_is_open_and_dark_at_its_lips(block: Space) -> None:
    """Fails if dead material is drawn, or if gamma is not coloured."""
    pytest.importorskip("pyvista")
    picture = render(block, frame(block, 1.0, opening=0.1), FRONT, box(block), WIDTH)
    scale = WIDTH / 5.0
    low, high = round(scale * (3.0 - 1.0)), round(scale * (3.0 - 2.2))  # rows at y = 0.5 and y = 1.7
    gap = np.flatnonzero(white(picture)[low, round(scale):round(scale * 4)])
    assert len(gap) == pytest.approx(scale * 0.42, abs=3)  # 0.2 + twice where gamma rises to 0.1, + twice 0.1
    assert not white(picture)[high, round(scale):round(scale * 4)].any()
    beside = picture[low, round(scale) + gap[0] - 3]
    assert int(beside.sum()) < 350 < int(picture[low, round(scale)].sum())


def test_spent_nodes_do_not_show(block: Space) -> None:
    pytest.importorskip("pyvista")
    calm, wild = (render(block, frame(block, 1.0, amount, 0.1), FRONT, box(block), WIDTH) for amount in (0.0, 50.0))
    np.testing.assert_array_equal(calm, wild)


def test_the_surface_is_closed_by_the_lips(block: Space) -> None:
    """Fails if the body is a skin without walls along the crack, or ends elsewhere than where gamma is 0.1."""
    pytest.importorskip("pyvista")
    body = surface(block, frame(block, 1.0))
    assert body.n_open_edges == 0
    assert np.asarray(body["gamma"]).min() == pytest.approx(0.1, abs=1e-6)
    assert body.volume == pytest.approx(4 * 2 * 0.2 - 0.2 * 1.12 * 0.22, rel=0.01)


def test_speed_is_in_its_colours(block: Space) -> None:
    pytest.importorskip("pyvista")
    body = surface(block, frame(block, 1.0))
    np.testing.assert_allclose(np.asarray(body["speed"]), 5e3, rtol=1e-6)
    picture = render(block, frame(block), FRONT, box(block), WIDTH, field="speed", largest=1e4)
    middle = picture[picture.shape[0] // 2, WIDTH // 4].astype(float)
    assert np.abs(middle / (255 * np.array(SPEED_MAP(0.5)[:3])) - 0.95).max() < 0.15
    assert "speed" not in surface(block, Frame(0.0, "", *[getattr(frame(block), k) for k in ("u", "gamma", "deleted")])
                                  ).point_data


def test_fragments_are_left_out(block: Space) -> None:
    pytest.importorskip("pyvista")
    gamma = np.ones(block.n_nodes)
    away = np.abs(block.X[:, :2] - 1.0).max(axis=1)
    gamma[(away > 0.1) & (away < 0.35)] = 1e-15
    still = Frame(0.0, "", np.zeros_like(block.X), gamma, np.zeros(block.n_elements, bool))
    inside = np.abs(np.asarray(surface(block, still).points)[:, :2] - 1.0).max(axis=1) < 0.1
    assert inside.any()
    old, module.LEAST_PIECE = module.LEAST_PIECE, 0.05
    try:
        assert not (np.abs(np.asarray(surface(block, still).points)[:, :2] - 1.0).max(axis=1) < 0.1).any()
    finally:
        module.LEAST_PIECE = old
