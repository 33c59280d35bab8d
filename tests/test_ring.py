"""Rings of elements around the tips of notches: their sizes, that they are one mesh with the rest, what is refused."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import Any

import meshio
import numpy as np
import pytest

from skfsink.errors import MeshError, ParameterError
from skfsink.meshing import outline, shapes
from skfsink.meshing.edge import ASPECT, circle
from skfsink.meshing.gmsh_model import areas
from skfsink.meshing.outline import Edge, SizeField, mesh_outline, scaled_jacobian
from skfsink.meshing.ring import INNER, REACH, parted

H, TIP, RADIUS = 0.05, 0.1 / 12, 0.05
COUNT = 2 * math.ceil(math.pi * RADIUS / TIP / 2)
SMALL = {"side": 2.0, "notch": 0.5, "half_height": 0.3, "h": H}
ARC = math.pi * 1.95
#: shape, settings, and the centre of each tip with the direction of its notch
TIPS: dict[str, tuple[Any, dict[str, Any], list[tuple[float, float, int]]]] = {
    "whole": (shapes.single_edge_notch_mesh, SMALL, [(0.45, 1.0, 1)]),
    "mirror": (shapes.single_edge_notch_mesh, {**SMALL, "symmetry": "mirror"}, [(0.45, 1.0, 1)]),
    "shear": (shapes.simple_shear_mesh, {"side": 2.0, "notch": 0.8, "half_width": 0.1, "h": H}, [(0.75, 1.0, 1)]),
    "two": (shapes.symmetric_double_edge_notch_mesh, {**SMALL, "symmetry": "none"}, [(0.45, 1.0, 1), (1.55, 1.0, -1)]),
    "two, mirror": (shapes.symmetric_double_edge_notch_mesh, {**SMALL, "symmetry": "mirror"},
                    [(0.45, 1.0, 1), (1.55, 1.0, -1)]),
    "two, turn": (shapes.asymmetric_double_edge_notch_mesh, {**SMALL, "offset": 0.4},
                  [(0.45, 0.8, 1), (1.55, 1.2, -1)]),
    "slit": (shapes.cylindrical_shell_mesh, {"length": 2.0, "half_height": 0.2, "h": H},
             [(ARC / 2 - 0.45, 1.0, -1), (ARC / 2 + 0.45, 1.0, 1)]),
}
each = pytest.mark.parametrize("name", TIPS)


@cache
def tip_mesh(name: str) -> meshio.Mesh:
    pytest.importorskip("gmsh")
    make, settings, _ = TIPS[name]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(outline, "ATTEMPTS", 2)  # for speed
        made: meshio.Mesh = make(**settings, h_tip=TIP)
    return made


@each
def test_mesh_with_rings_is_one_mesh(name: str) -> None:
    """Fails if nodes of a ring are double or loose, a line of a boundary is missing, or an element is not convex."""
    found = tip_mesh(name)
    quads, lines = found.cells_dict["quad"], np.sort(found.cells_dict["line"], axis=1)
    assert scaled_jacobian(found.points, quads).min() > 0.2
    assert np.array_equal(np.unique(quads), np.arange(len(found.points)))
    edges = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    edges, count = np.unique(edges, axis=0, return_counts=True)
    assert set(count) == {1, 2}
    assert np.array_equal(edges[count == 1], np.unique(lines, axis=0)) and (count == 1).sum() == len(lines)
    members = [np.asarray(sets[1]) for sets in found.cell_sets.values()]
    assert np.array_equal(np.sort(np.concatenate(members)), np.arange(len(lines)))
    edge = {"edge"} if name == "slit" else {"left", "right"}
    assert set(found.cell_sets) == {"top", "bottom", "notch", *edge}


@each
def test_elements_along_the_tip_have_the_size_asked_for(name: str) -> None:
    """Fails if the tip has too few or uneven elements, they are not thin, or a ring is not where the next one begins.

    Elements around a tip lie between circles, a whole ring of them between two; the radii grow by even factors.
    """
    found = tip_mesh(name)
    for x, y, sense in TIPS[name][2]:
        away = np.hypot(*(found.points[:, :2] - (x, y)).T)
        ahead = (found.points[:, 0] - x) * sense > -1e-7
        tip = found.points[(np.abs(away - RADIUS) < 1e-7) & ahead]
        angles = np.sort(np.arctan2(tip[:, 1] - y, (tip[:, 0] - x) * sense))
        assert len(tip) == COUNT + 1
        np.testing.assert_allclose(np.diff(angles), math.pi / COUNT, rtol=1e-4)
        outer = RADIUS * min(REACH, H / (RADIUS * math.pi / COUNT))
        inside = np.unique(away[(away < outer + 1e-6) & ahead].round(6))
        layers = np.diff(inside)
        per_ring = [np.count_nonzero((np.abs(away - radius) < 2e-6) & ahead) for radius in inside]
        assert set(per_ring) == {COUNT + 1}
        assert 0.6 * TIP / ASPECT < layers[0] < 1.01 * TIP / ASPECT
        assert layers[-1] == pytest.approx(outer * math.pi / COUNT, rel=0.35)
        growth = layers[1:] / layers[:-1]
        np.testing.assert_allclose(growth, growth.mean(), rtol=0.01)
        assert 1.0 < growth.mean() < 2.0


@each
def test_rest_of_the_mesh_is_not_as_fine_as_the_tip(name: str) -> None:
    """Fails if the sizes in the rings spread over the whole mesh."""
    found = tip_mesh(name)
    assert np.quantile(np.sqrt(areas(found.points[found.cells_dict["quad"]])), 0.9) > 0.8 * H


def half_plate(tip: float = 0.5, *, h: float | None = TIP, aspect: float = ASPECT, seam: float = 2.0) -> list[Edge]:
    """Lower half of a plate, its tip between the flank and the seam, which ends at x = `seam`."""
    s = RADIUS * math.sqrt(0.5)
    return [Edge("bottom", (seam, 0)), Edge("right", (seam, 1)), Edge("seam", (tip, 1)),
            Edge("notch", (tip - RADIUS, 1 - RADIUS), via=(tip - RADIUS + s, 1 - s), h=h, aspect=aspect),
            Edge("notch", (0, 1 - RADIUS)), Edge("left", (0, 0))]


def turned(outline: Sequence[Edge]) -> list[Edge]:
    """The mirror image of an outline in the y axis."""
    starts = [outline[i - 1].end for i in range(len(outline))]
    return [edge._replace(end=(-start[0], start[1]), via=edge.via and (-edge.via[0], edge.via[1]))
            for edge, start in zip(reversed(outline), reversed(starts))]


@pytest.mark.parametrize("chain, seams", [(half_plate(), ("seam", None)), (turned(half_plate()), (None, "seam"))])
def test_rings_end_on_a_seam(chain: list[Edge], seams: tuple[str | None, str | None]) -> None:
    """Fails if the seam is not taken for the end of the rings, on either side, or loses its lines there."""
    pytest.importorskip("gmsh")
    outside, (ring,) = parted(chain, H)
    assert ring.seams == seams and [edge.name for edge in outside].count(INNER) == 2
    found = mesh_outline(chain, SizeField(H, 0.11))
    lines = found.cells_dict["line"][found.cell_sets["seam"][1]]
    along = np.diff(found.points[lines, 0], axis=1)
    assert -along.sum() == pytest.approx(1.5, abs=1e-6) and along.max() < 0  # in the sense of the outline
    nodes = np.sort(np.abs(found.points[np.unique(lines), 0]))
    assert nodes[1] - nodes[0] < 1.01 * TIP / ASPECT


@pytest.mark.parametrize("chain, message", [
    (half_plate(seam=0.54), r"boundary 'seam' is 0.04 mm long, too short for the rings .* around 'notch'.*0.05 mm"),
    ([Edge("bottom", (2, 0.92)), *half_plate()[1:5], Edge("left", (0, 0.92))], r"rings .* around notch have no room"),
    ([Edge("bottom", (2, 0)), Edge("right", (2, 1)), Edge("hole", (1, 1)),
      Edge("hole", (0, 0), via=(0.3, 0.7), h=TIP)], r"body lies inside of the arc 'hole'"),
    ([Edge("bottom", (2, 0), h=TIP), Edge("right", (2, 1)), Edge("left", (0, 0))], r"edge 'bottom' is straight"),
    ([Edge("bottom", (2, 0)), Edge("", (2, 1)), Edge("left", (0, 0))], r"edge of the outline to \(2, 1\) has no name"),
    (half_plate(h=2 * H), r"the element size along 'notch' must be .*0\.05"),
    (half_plate(h=0.0), r"the element size along 'notch' must be"),
    (half_plate(aspect=0.5), r"the aspect of the elements along 'notch' must be"),
])
def test_arcs_without_rings_are_refused(chain: list[Edge], message: str) -> None:
    """Fails if elements would lie outside of the body or on top of each other, or an error does not name the arc."""
    with pytest.raises((MeshError, ParameterError), match=message):
        parted(chain, H)


def test_sizes_beside_the_rings_are_theirs() -> None:
    """Fails if elements beside the rings are wanted much larger than these, or do not grow with the distance."""
    (ring,) = parted(half_plate(), H)[1]
    grid, _ = ring.quads()
    radii = np.hypot(*(grid[:, 0] - ring.centre).T)
    for away, thickness in zip(radii, np.diff(radii)):
        size = ring.size(ring.centre[0] + away, ring.centre[1], 0.15)
        assert size == pytest.approx(math.sqrt(thickness * away * ring.step), rel=1e-6)
    assert ring.size(ring.centre[0], ring.centre[1] - ring.outer - 0.2, 0.15) == pytest.approx(
        ring.size(ring.centre[0] + ring.outer, ring.centre[1], 0.15) + 0.03)


def test_rings_with_room_are_not_refused() -> None:
    """Fails if edges that only touch, or are near, are taken to cross."""
    for chain in (half_plate(), turned(half_plate()), half_plate(seam=0.56),
                    [Edge("bottom", (2, 0.84)), *half_plate()[1:5], Edge("left", (0, 0.84))]):
        assert len(parted(chain, H)[1]) == 1


def test_circle_through_three_points() -> None:
    """Fails if the centre, the radius or the sense of an arc is wrong, of one of more than half a turn as well."""
    for start, turn in ((0.3, 1.0), (2.9, 5.0), (-2.0, -4.5)):
        angles = (start, start + 0.4 * turn, start + turn)
        points = [(1 + 2 * math.cos(angle), -1 + 2 * math.sin(angle)) for angle in angles]
        centre, radius, first, found = circle(*points)
        assert centre == pytest.approx((1, -1)) and radius == pytest.approx(2.0)
        assert math.cos(first - start) == pytest.approx(1.0) and found == pytest.approx(turn)
