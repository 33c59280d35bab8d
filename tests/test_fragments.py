"""Pieces into which cracks have cut a body."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import box

from skfsink.fem.space import Space
from skfsink.fields.fragments import fragments


def cut(space: Space, *lines: tuple[int, float]) -> np.ndarray:
    """Density that has gone on planes: pairs of an axis and a coordinate."""
    gamma = np.ones(space.n_nodes)
    for axis, at in lines:
        gamma[abs(space.X[:, axis] - at) < 1e-9] = 1e-4
    return gamma


def test_pieces_and_debris_are_counted(kind: str):
    """Fails if pieces that hang together are counted apart, or debris is not what is smaller than l.

    Six elements of a sixth each along every axis; cut at 1/3 and 5/6 of x. The last piece is one element thick.
    """
    space, alive = box(kind, 6, 0.0), np.zeros(6**(2 if kind == "quad" else 3), bool)
    assert fragments(space, np.ones(space.n_nodes), alive, 0.3, 1e-2) == (1, 0, 0.0)
    gamma = cut(space, (0, 1 / 3), (0, 5 / 6))
    volume = 1 / 6
    assert fragments(space, gamma, alive, 0.9 * volume ** (1 / space.dim), 1e-2) == (3, 0, 0.0)
    found = fragments(space, gamma, alive, 1.1 * volume ** (1 / space.dim), 1e-2)
    assert found[:2] == (3, 1) and found.debris_share == pytest.approx(volume)


def test_failed_elements_part_a_body():
    """Fails if elements that failed, or nodes without density, hold pieces together."""
    space = box("quad", 6, 0.0)
    column = abs(space.X[space.conn][:, :, 0].mean(axis=1) - 3.5 / 6) < 0.01
    ones = np.ones(space.n_nodes)
    assert column.sum() == 6
    assert fragments(space, ones, column, 0.1, 1e-2).pieces == 2
    assert fragments(space, ones, np.ones(36, bool), 0.1, 1e-2) == (0, 0, 0.0)
    assert fragments(space, 1e-3 * ones, np.zeros(36, bool), 0.1, 1e-2) == (0, 0, 0.0)
