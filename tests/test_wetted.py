"""Where a pressure acts: sides of elements and their normals, elements without force, lips that a load reaches."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import box
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from skfsink.fem.facets import facets_of
from skfsink.fem.kernels.flood import flood
from skfsink.fem.kernels.relax import without_force
from skfsink.fem.space import Space


@pytest.fixture(params=[2, 3])
def space(request: pytest.FixtureRequest) -> Space:
    return box({2: "quad", 3: "hex"}[request.param], 7)


def test_sides_have_the_nodes_of_the_mesh_and_their_normals_outwards(space: Space):
    """Fails if a side gets the nodes of another one, or a normal into its element."""
    numbers = np.arange(space.mesh.nfacets)
    for side in (0, 1):
        there = numbers[space.mesh.f2t[side] >= 0]
        facets = facets_of(space, there, side)
        assert np.array_equal(facets.elements, space.mesh.f2t[side, there])
        assert np.array_equal(np.sort(facets.nodes, axis=1), np.sort(space.mesh.facets[:, there].T, axis=1))
        assert np.array_equal(np.take_along_axis(space.conn[facets.elements], facets.local, axis=1), facets.nodes)
        x = space.X[facets.nodes]
        if space.dim == 2:
            along = x[:, 1] - x[:, 0]
            normal = np.stack([along[:, 1], -along[:, 0]], axis=1)
        else:
            normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
        outward = x.mean(axis=1) - space.X[space.conn[facets.elements]].mean(axis=1)
        assert np.all((normal * outward).sum(axis=1) > 0.0)


def test_elements_without_force(space: Space):
    """Fails if an element that bears force at one Gauss point is left out, or one that is deleted is not."""
    rng = np.random.default_rng(3)
    gamma = rng.choice([0.2, 0.45, 0.55, 1.0], space.n_nodes, p=[0.6, 0.2, 0.1, 0.1])
    deleted = rng.random(space.n_elements) < 0.1
    found = np.empty(space.n_elements, bool)
    without_force(space.nodes, gamma, space.N, deleted, 0.5, found)
    assert np.array_equal(found, deleted | (space.at_gauss(gamma) < 0.5).all(axis=1))
    mixed = (gamma[space.conn] < 0.5).any(axis=1) & (gamma[space.conn] >= 0.5).any(axis=1) & ~deleted
    assert found[mixed].any() and not found[mixed].all()


@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
def test_lips_are_reached_over_sides(space: Space, share: float):
    """Fails if the failed region ends early, goes on over corners, or a lip is put on the wrong element."""
    rng = np.random.default_rng(5)
    gone = rng.random(space.n_elements) < share
    start = np.flatnonzero(gone)[[0, -1, 0]]
    reached, ends = np.zeros(space.n_elements, bool), np.zeros(space.mesh.nfacets, np.int8)
    flood(space.mesh.t2f, space.mesh.f2t, gone, start, reached, ends)
    one, other = space.mesh.f2t
    both = (other >= 0) & gone[one] & gone[other]
    graph = coo_array((np.ones(both.sum()), (one[both], other[both])), shape=(space.n_elements,) * 2)
    label = connected_components(graph, directed=False)[1]
    assert np.array_equal(reached, gone & np.isin(label, label[start]))
    inner = other >= 0
    assert np.array_equal(ends == 1, inner & ~gone[one] & reached[other])
    assert np.array_equal(ends == 2, inner & reached[one] & ~gone[other])
