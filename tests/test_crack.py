"""The crack tracker on made-up cracks: first arrival, merging, branches, separation."""

from __future__ import annotations

import numpy as np
from bodies import grid

from skfsink.fem.space import Space
from skfsink.fields.crack import ADVANCES, CrackTracker, Plane

L, CS = 0.1, 30.0  # length scale [mm], shear wave speed [m/s]
H = 0.05           # element size [mm]


def tracker(kind: str = "quad", shear_wave_speed: float | None = CS) -> tuple[CrackTracker, Space]:
    """A plate of 2 x 1 mm (in space: one element thick), held at y = 0 and y = 1."""
    shape = (40, 20) if kind == "quad" else (40, 20, 1)
    space = Space(grid(kind, shape, (2.0, 1.0, 0.1)[:len(shape)]))
    X = space.X
    rim = np.flatnonzero((X[:, 0] < 1e-9) | (X[:, 0] > 2 - 1e-9) | (X[:, 1] < 1e-9) | (X[:, 1] > 1 - 1e-9))
    grips = [np.flatnonzero(X[:, 1] < 1e-9), np.flatnonzero(X[:, 1] > 1 - 1e-9)]
    return CrackTracker(space, L, shear_wave_speed, grips, rim), space


def line(space: Space, x0: float, x1: float, y: float = 0.5) -> np.ndarray:
    """gamma (n,) of a crack one row of nodes wide from x0 to x1 [mm] at height y."""
    X = space.X
    cut = (X[:, 0] >= x0 - 1e-9) & (X[:, 0] <= x1 + 1e-9) & (np.abs(X[:, 1] - y) < 1e-9)
    return np.where(cut, 0.0, 1.0)


def test_crack_arrives_at_the_opposite_edge(kind: str) -> None:
    """Fails if the edge where it starts counts, or if the crack must pass the edge before it has arrived."""
    track, space = tracker(kind)
    assert not track.mark(1e-6, line(space, 0, 0.5))
    assert not track.mark(2e-6, line(space, 0, 1.95))
    assert track.mark(3e-6, line(space, 0, 2.0))
    assert track.arrival == 3e-6
    track.look(3e-6, line(space, 0, 2.0))
    assert track.separated


def test_crack_arrives_through_a_thin_wall() -> None:
    """Fails if a crack through a wall of 2.5 l does not arrive, arrives before it is through, or if one that comes out
    of the side that it started from, or cuts off a corner, counts as through."""
    space = Space(grid("quad", (80, 5), (4.0, 0.25)))
    X = space.X
    rim = np.flatnonzero((X[:, 0] < 1e-9) | (X[:, 0] > 4 - 1e-9) | (X[:, 1] < 1e-9) | (X[:, 1] > 0.25 - 1e-9))

    def arrives(*pieces: tuple[float, float, float, float]) -> bool:
        cut = [(X[:, 0] >= x0 - 1e-9) & (X[:, 0] <= x1 + 1e-9) & (X[:, 1] >= y0 - 1e-9) & (X[:, 1] <= y1 + 1e-9)
               for x0, x1, y0, y1 in pieces]
        return CrackTracker(space, L, CS, [], rim).mark(1e-6, np.where(np.any(cut, axis=0), 0.0, 1.0))

    assert arrives((2.0, 2.0, 0.0, 0.25)) and not arrives((2.0, 2.0, 0.0, 0.2))
    assert not arrives((1.9, 1.9, 0.0, 0.1), (1.9, 2.1, 0.1, 0.1), (2.1, 2.1, 0.0, 0.1))
    assert not arrives((0.2, 0.2, 0.0, 0.15), (0.0, 0.2, 0.15, 0.15))


def test_cracks_arrive_when_they_meet() -> None:
    """Fails if cracks that come from two edges are waited for at a third, which they never reach."""
    track, space = tracker()
    apart = np.minimum(line(space, 0, 0.9), line(space, 1.2, 2.0))
    assert not track.mark(1e-6, apart)
    track.look(1e-6, apart)
    assert not track.separated
    assert track.mark(2e-6, line(space, 0, 2.0))


def test_second_start_is_no_arrival() -> None:
    """Fails if a crack that starts at another edge counts as the arrival of the first one."""
    track, space = tracker()
    assert not track.mark(1e-6, line(space, 0, 0.3))
    assert not track.mark(2e-6, np.minimum(line(space, 0, 0.3), line(space, 1.9, 2.0, 0.25)))


def test_damage_along_the_mouth_is_no_arrival() -> None:
    """Fails if the widening mouth of a crack, more than 3 l wide, counts as two places of the rim."""
    track, space = tracker()
    wide = np.where((space.X[:, 0] < 1e-9) & (np.abs(space.X[:, 1] - 0.5) < 0.31), 0.0, 1.0)
    assert not track.mark(1e-6, np.minimum(wide, line(space, 0, 0.5)))


def test_branches_and_tip_speed() -> None:
    """Fails if a fork is not counted as two ends, roughness as one, or the speed is not that of the leading tip."""
    track, space = tracker()
    speed = 0.02  # mm/us, 20 m/s
    for k in range(1, 40):
        gamma = line(space, 0, speed * k)
        track.mark(k * 1e-6, gamma)
        tips = track.look(k * 1e-6, gamma)
        assert tips.branches == 1
    assert abs(tips.speed - 20.0) < 1.5
    X, forked = space.X, line(space, 0, 0.8)
    for sign in (1, -1):
        arm = (X[:, 0] >= 0.8) & (X[:, 0] < 1.2) & (np.abs(X[:, 1] - 0.5 - sign * (X[:, 0] - 0.8)) < H / 2)
        forked[arm | np.roll(arm, 1)] = 0.0
    track.mark(41e-6, forked)
    assert track.look(41e-6, forked).branches == 2


def test_a_clock_of_passes_is_no_time() -> None:
    """Fails if ages in passes are compared with seconds, or a speed is made of passes."""
    track, space = tracker(shear_wave_speed=None)
    for number in range(1, 6):
        gamma = line(space, 0, 0.1 * number)
        track.mark(float(number), gamma)
        tips = track.look(float(number), gamma)
        assert (tips.active, tips.speed) == (1, 0.0)
    assert track.look(5.0 + ADVANCES - 1, gamma).active == 1
    arrested = track.look(5.0 + ADVANCES, gamma)
    assert (arrested.active, arrested.branches) == (0, 1)
    assert track.mean_speed() is None


def test_leading_tip_is_kept_where_it_forks() -> None:
    """Fails if the tip is taken for roughness as long as the arms of a fresh fork are short, and an old arm leads."""
    track, space = tracker()
    X = space.X

    def column(x: float, y0: float, y1: float) -> np.ndarray:
        return np.where((np.abs(X[:, 0] - x) < 1e-9) & (X[:, 1] > y0 - 1e-9) & (X[:, 1] < y1 + 1e-9), 0.0, 1.0)

    old = np.minimum(line(space, 0, 1.2), column(0.3, 0.5, 0.9))
    fork = np.minimum(column(1.2, 0.35, 0.65), np.minimum(line(space, 1.2, 1.3, 0.65), line(space, 1.2, 1.25, 0.35)))
    for time, gamma in ((1e-6, line(space, 0, 0.0)), (2e-6, old), (3e-6, np.minimum(old, fork))):
        track.mark(time, gamma)
        tips = track.look(time, gamma)
    np.testing.assert_allclose(tips.position, (1.3, 0.65))
    assert tips.branches == 2  # the old arm and the new tip; the shorter arm of the fork may yet be roughness


def test_a_plane_of_symmetry_is_no_edge_but_a_mirror() -> None:
    """Fails if a crack along a plane of symmetry does not arrive, or one across it waits for an edge of the image.

    The plane is y = 0: a crack along it arrives at x = 2. The plane is x = 0: a crack from it to x = 2 joins that edge
    to its image, one from x = 0 to half of the width does not, and neither does one from x = 2 that stops before it.
    """
    _, space = tracker()
    X = space.X
    left, right, low, high = (X[:, 0] < 1e-9, X[:, 0] > 2 - 1e-9, X[:, 1] < 1e-9, X[:, 1] > 1 - 1e-9)

    def cut_along(axis: int, plane: np.ndarray, others: np.ndarray) -> CrackTracker:
        return CrackTracker(space, L, CS, [np.flatnonzero(low), np.flatnonzero(high)], np.flatnonzero(others),
                            [Plane(axis, np.flatnonzero(plane))])

    along = cut_along(1, low & (X[:, 0] > 0.5), left | right | high | (low & (X[:, 0] < 0.51)))
    assert not along.mark(1e-6, line(space, 0.5, 1.95, 0.0))
    assert along.mark(2e-6, line(space, 0.5, 2.0, 0.0))
    across = cut_along(0, left, right | low | high)
    assert not across.mark(1e-6, line(space, 0.0, 1.0))
    assert across.mark(2e-6, line(space, 0.0, 2.0))
    inwards = cut_along(0, left, right | low | high)
    assert not inwards.mark(1e-6, line(space, 0.05, 2.0))
    assert inwards.mark(2e-6, line(space, 0.0, 2.0))
    corner = cut_along(0, left, right | low | high)  # a place that is on the plane is its own image
    assert not corner.mark(1e-6, line(space, 0.0, 2.0, 0.0))
