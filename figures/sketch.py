"""Sketches of the samples: outline of the mesh, grips and how they move, and dimensions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from skfsink.fem.space import Space
from skfsink.scene.scene import Scene

__all__ = ["arrows", "dimension", "loops", "plane_sample"]

FILL, INK, RED = "#e4e9ee", "0.15", "#a63d40"


def loops(space: Space) -> list[np.ndarray]:
    """Closed outlines of a plane body, or of the back of a swept one, as points (k, 2) in order."""
    facets, points = space.mesh.facets[:, space.mesh.boundary_facets()].T, space.X
    if space.dim == 3:  # the rim of the faces at least z
        faces = facets[(points[facets][:, :, 2] < points[:, 2].min() + 1e-9).all(axis=1)]
        pairs = np.sort(np.concatenate([faces[:, [i, (i + 1) % 4]] for i in range(4)]), axis=1)
        facets, count = np.unique(pairs, axis=0, return_counts=True)
        facets = facets[count == 1]
    neighbours: dict[int, list[int]] = {}
    for a, b in facets.tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    found = []
    while neighbours:
        chain = [min(neighbours)]
        while ends := neighbours.get(chain[-1]):
            follower = ends.pop()
            neighbours[follower].remove(chain[-1])
            for node in (chain[-1], follower):
                if not neighbours[node]:
                    del neighbours[node]
            chain.append(follower)
        found.append(points[chain, :2])
    return found


def dimension(ax: Axes, a: Sequence[float], b: Sequence[float], text: str, shift: Sequence[float] = (0, 0)) -> None:
    """A dimension line from a to b, moved by `shift`, with witness lines from where they are, and its text."""
    start, end, by = np.array(a, float), np.array(b, float), np.array(shift, float)
    if np.any(by):
        for point in (start, end):
            ax.plot(*np.transpose([point + 0.15 * by, point + 1.15 * by]), color=INK, linewidth=0.4)
    start, end = start + by, end + by
    ax.annotate("", start, end, arrowprops={"arrowstyle": "<|-|>,head_width=0.12,head_length=0.3", "linewidth": 0.6,
                                            "shrinkA": 0, "shrinkB": 0, "color": INK})
    upright = abs(end[1] - start[1]) > abs(end[0] - start[0])
    ax.annotate(text, (start + end) / 2, (3, 0) if upright else (0, 2), textcoords="offset points",
                ha="left" if upright else "center", va="center" if upright else "bottom", fontsize=7)


def arrows(ax: Axes, a: np.ndarray, b: np.ndarray, direction: np.ndarray, length: float, text: str) -> None:
    """A row of arrows from the edge a-b, with its text beyond their tips."""
    for share in np.linspace(0.1, 0.9, 5):
        foot = a + share * (b - a)
        ax.annotate("", foot + length * direction, foot, arrowprops={
            "arrowstyle": "-|>,head_width=0.14,head_length=0.35", "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0,
            "color": RED})
    ax.annotate(text, (a + b) / 2 + length * direction, tuple(4 * direction), textcoords="offset points", color=RED,
                ha=("right", "center", "left")[int(np.sign(np.rint(direction[0]))) + 1],
                va=("top", "center", "bottom")[int(np.sign(np.rint(direction[1]))) + 1], fontsize=7)


def _fixed(ax: Axes, a: np.ndarray, b: np.ndarray, outward: np.ndarray, size: float) -> None:
    """Hatching outside the edge a-b, which is held."""
    ax.fill(*np.transpose([a, b, b + size * outward, a + size * outward]), facecolor="none", edgecolor="0.35",
            hatch="//////", linewidth=0)
    ax.plot(*np.transpose([a, b]), color=INK, linewidth=1.6)


def plane_sample(ax: Axes, scene: Scene) -> float:
    """A plane sample, its grips and their velocities; returns its greatest side [mm], for the dimensions to come."""
    space = scene.sample.space
    outline = loops(space)
    vertices = np.concatenate(outline)
    codes = np.concatenate([[Path.MOVETO, *[Path.LINETO] * (len(loop) - 2), Path.CLOSEPOLY] for loop in outline])
    ax.add_patch(PathPatch(Path(vertices, codes), facecolor=FILL, edgecolor=INK, linewidth=0.9))
    size = float(np.ptp(space.X[:, :2], axis=0).max())
    middle = (space.X.min(axis=0) + space.X.max(axis=0))[:2] / 2
    for grip in scene.grips:
        at = space.X[scene.sample.nodes(grip.boundary)][:, :2]
        a, b = at[np.argmin(at @ [1, 1e-3])], at[np.argmax(at @ [1, 1e-3])]
        outward = np.sign(np.rint(((a + b) / 2 - middle) / size * 4))
        velocity = np.array([v or 0.0 for v in grip.velocity])[:2]
        if not velocity.any():
            _fixed(ax, a, b, outward, 0.05 * size)
            continue
        ax.plot(*np.transpose([a, b]), color=INK, linewidth=1.6)
        direction = velocity / np.linalg.norm(velocity)
        held = [name for name, v in zip("xyz", grip.velocity) if v == 0]
        text = r"$\bar v$" + "".join(f", $u_{name}=0$" for name in held)
        if abs(direction @ outward) > 0.5:
            arrows(ax, a, b, direction, 0.1 * size, text)
        else:  # along the edge: one long arrow above it
            foot = (a + b) / 2 - 0.25 * size * direction + 0.06 * size * outward
            arrows(ax, foot, foot, direction, 0.5 * size, text)
    ax.set(aspect="equal")
    ax.set_axis_off()
    return size
